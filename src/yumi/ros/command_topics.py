"""How a streamed command gets in: a message becomes a checked goal in the arm's mailbox, or a refusal.

================================ ========================== ===================================================
topic                            type                       for
================================ ========================== ===================================================
joint_commands                   sensor_msgs/JointState     joint_position_controller: positions, speeds if known
joint_velocity_commands          sensor_msgs/JointState     joint_velocity_controller: velocities
forward_position_controller/…    std_msgs/Float64MultiArray ``commands``: 7 positions by index
forward_velocity_controller/…    std_msgs/Float64MultiArray ``commands``: 7 velocities by index
================================ ========================== ===================================================
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from math import nan
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from yumi.control.goals import GoalKind, put_goal, put_speeds
from yumi.control.mailbox import Mailbox
from yumi.control.snapshot import Snapshot
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
        node.create_subscription(self.type, self.name, self.take, _QOS)

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

    def _age(self, message: Any) -> float:
        """How long ago the sender made ``message`` [s]; 0 where its stamp does not tell."""
        return 0.0

    def _accept(self, message: Any, time: float) -> None:
        snapshot, arm = self._snapshot(), f"{self._side.word} arm"
        if not snapshot.is_running:
            raise CommandRefused(f"{self.noun} refused: EGM is not running on the {arm}; call start_egm first.")
        if self.kind not in snapshot.goal_kind:
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


class ForwardPositionTopic(CommandTopic):
    """Positions by index."""

    name, type, noun = "forward_position_controller/commands", Float64MultiArray, "Goal"
    kind, taker = GoalKind.FORWARD_POSITION, "forward position controller"

    def put(self, message: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        put_goal(self._box, snapshot.session, positions_of(message, self._side), time=time)


class ForwardVelocityTopic(CommandTopic):
    """Velocities by index."""

    name, type, noun = "forward_velocity_controller/commands", Float64MultiArray, "Speed"
    kind, taker = GoalKind.FORWARD_VELOCITY, "forward velocity controller"

    def put(self, message: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        put_speeds(self._box, snapshot.session, speeds_of(message, self._side), time)
