"""How a streamed command gets in: a message becomes a checked goal in the arm's mailbox, or a refusal.

================================ ========================== ===================================================
topic                            type                       for
================================ ========================== ===================================================
joint_commands                   sensor_msgs/JointState     joint_position_controller: positions, speeds if known
joint_velocity_commands          sensor_msgs/JointState     joint_velocity_controller: velocities
<controller>/commands            std_msgs/Float64MultiArray a forward controller: 7 positions or velocities by index
================================ ========================== ===================================================
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Container
from math import nan
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from yumi.control.goals import GoalKind, put_goal, put_speeds
from yumi.control.mailbox import Mailbox
from yumi.control.snapshot import CAUSES, Problem, Snapshot
from yumi.errors import CommandRefused
from yumi.robot.joints import Joints, Side
from yumi.robot.values import ZERO
from yumi.ros.command_messages import goal_of, goal_speeds_of, positions_of, speeds_of, velocities_of

# Reliable, as ros2_control's command topics: a best-effort reader may miss the first message of a new publisher, and
# a goal is sent once. Several partial goals may come at once, hence the depth.
_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)


OLDEST_STAMP = 0.1
"""A goal whose stamp is older comes from a clock that is not ours [s]."""


class CommandTopic(ABC):
    """Takes commands for one arm; one that breaks a rule changes nothing and is answered in the log.

    Args:
        node: the arm's controller manager node.
        side: which arm.
        box: where goals go.
        snapshot: what is known of the arm.
        now: tells the time on the machine's monotonic clock [s].
    """

    name: str
    type: Any
    noun: str
    kind: GoalKind
    taker: str

    def __init__(
        self,
        node: Any,
        side: Side,
        box: Mailbox,
        snapshot: Callable[[], Snapshot],
        now: Callable[[], float] = lambda: nan,
    ) -> None:
        self._node = node
        self._log = node.get_logger()
        self._side = side
        self._box = box
        self._snapshot = snapshot
        self._now = now
        self._given_in = (0, 0)  # session and activation
        self._subscription = node.create_subscription(self.type, self.name, self.take, _QOS)

    def destroy(self) -> None:
        """Take no more commands."""
        self._node.destroy_subscription(self._subscription)

    def take(self, message: Any) -> None:
        """Pass a command on, or say why not."""
        time = self._now()
        try:
            self._accept(message, time - self._age(message))
        except CommandRefused as error:
            self._log.warning(str(error), throttle_duration_sec=1.0)

    @abstractmethod
    def put(self, message: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        """Check ``message`` and put what it says into the box.

        Args:
            message: of the topic's type.
            snapshot: of an arm that a fitting controller commands.
            time: when it arrived [s].
            is_new: whether it is the first since the controller was activated.

        Raises:
            CommandRefused: it breaks a rule.
        """

    def is_for(self, kind: GoalKind) -> bool:
        """Whether a controller that takes goals of ``kind`` takes these."""
        return self.kind in kind

    def _age(self, message: Any) -> float:
        """How long ago the sender made ``message`` [s]; 0 where its stamp does not tell."""
        return 0.0

    def _accept(self, message: Any, time: float) -> None:
        snapshot, arm = self._snapshot(), f"{self._side.word} arm"
        if not snapshot.is_running:
            raise CommandRefused(f"{self.noun} refused: EGM is not running on the {arm}; call start_egm first.")
        if snapshot.problem is not Problem.NONE:
            raise CommandRefused(f"{self.noun} refused: {arm}: {CAUSES[snapshot.problem]}.")
        if not self.is_for(snapshot.goal_kind):
            raise CommandRefused(f"{self.noun} refused: no {self.taker} is active on the {arm}; activate one first.")
        now = (snapshot.session, snapshot.activation)
        self.put(message, snapshot, time, is_new=self._given_in != now)
        self._given_in = now


class JointCommandTopic(CommandTopic):
    """Positions by name; joints that are not named keep their goal."""

    name, type, noun = "joint_commands", JointState, "Goal"
    kind, taker = GoalKind.POSITION, "position controller"

    _goal: Joints = ZERO

    def _age(self, message: Any) -> float:
        """A stream is forecast from when its goals were made, if their stamps can be true; else from their arrival."""
        stamp = message.header.stamp
        if not stamp.sec:
            return 0.0
        age = self._node.get_clock().now().nanoseconds * 1e-9 - (stamp.sec + stamp.nanosec * 1e-9)
        return age if 0.0 <= age <= OLDEST_STAMP else 0.0

    def put(self, message: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        if is_new and snapshot.reference is None:
            raise CommandRefused(f"Goal refused: the {self._side.word} arm has no reference yet; send the goal again.")
        base = snapshot.reference if is_new and snapshot.reference is not None else self._goal
        goal = goal_of(message, self._side, base)
        put_goal(self._box, snapshot.session, goal, goal_speeds_of(message, self._side), time)
        self._goal = goal


class JointVelocityTopic(CommandTopic):
    """Velocities by name; joints that are not named stop."""

    name, type, noun = "joint_velocity_commands", JointState, "Speed"
    kind, taker = GoalKind.VELOCITY, "velocity controller"

    def put(self, message: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        put_speeds(self._box, snapshot.session, velocities_of(message, self._side), time)


class ForwardTopic(CommandTopic):
    """Values by index for one controller, on ``<controller>/commands``: positions or velocities, as it forwards.

    Args:
        node: the arm's node for topics alone.
        side: which arm.
        boxes: where positions go, and where velocities.
        snapshot: what is known of the arm.
        now: tells the time on the machine's monotonic clock [s].
        controller: its name.
        active: which controllers command the arm; asked after each activation.
    """

    type, noun, taker = Float64MultiArray, "Command", "forward controller"
    kind = GoalKind.NONE

    def __init__(
        self,
        node: Any,
        side: Side,
        boxes: tuple[Mailbox, Mailbox],
        snapshot: Callable[[], Snapshot],
        now: Callable[[], float],
        controller: str,
        active: Callable[[], Container[str]],
    ) -> None:
        self.name = self._controller = controller
        self.name += "/commands"
        self._positions, self._speeds = boxes
        self._active = active
        self._known = (0, False)  # the activation, and whether the controller commands in it
        super().__init__(node, side, boxes[0], snapshot, now)

    def is_for(self, kind: GoalKind) -> bool:
        return bool(kind & (GoalKind.FORWARD_POSITION | GoalKind.FORWARD_VELOCITY))

    def put(self, message: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        self._check_active(snapshot.activation)
        if GoalKind.FORWARD_VELOCITY in snapshot.goal_kind:
            put_speeds(self._speeds, snapshot.session, speeds_of(message, self._side), time)
        else:
            put_goal(self._positions, snapshot.session, positions_of(message, self._side), time=time)

    def tell(self, notice: object) -> None:
        """A forward controller has nothing to tell."""

    def _check_active(self, activation: int) -> None:
        if activation != self._known[0]:
            self._known = (activation, self._controller in self._active())
        if not self._known[1]:
            raise CommandRefused(
                f"Command refused: {self._controller} is not active on the {self._side.word} arm; activate it first."
            )
