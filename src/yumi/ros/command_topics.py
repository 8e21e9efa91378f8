"""How a ROS message gets in: ``joint_commands`` becomes a checked goal in the arm's mailbox, or a refusal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from yumi.control.goals import put_goal
from yumi.control.mailbox import Mailbox
from yumi.control.snapshot import Snapshot
from yumi.errors import CommandRefused
from yumi.robot.joints import Joints, Side
from yumi.ros.conversions import goal_of

# Reliable, as ros2_control's command topics: a best-effort reader may miss the first message of a new publisher, and
# a goal is sent once. Several partial goals may come at once, hence the depth.
_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)


class JointCommandTopic:
    """Takes goals for one arm; a goal that breaks a rule changes nothing and is answered in the log.

    Args:
        node: the arm's controller manager node.
        side: which arm.
        goals: where goals go.
        snapshot: what is known of the arm.
    """

    def __init__(self, node: Any, side: Side, goals: Mailbox, snapshot: Callable[[], Snapshot]) -> None:
        self._log = node.get_logger()
        self._side = side
        self._goals = goals
        self._snapshot = snapshot
        self._given_in = (0, 0)  # session and activation
        self._goal: Joints | None = None
        node.create_subscription(JointState, "joint_commands", self.take, _QOS)

    def take(self, message: Any) -> None:
        """Pass a goal on, or say why not."""
        try:
            self._accept(message)
        except CommandRefused as error:
            self._log.warning(str(error), throttle_duration_sec=1.0)

    def _accept(self, message: Any) -> None:
        snapshot = self._snapshot()
        if not snapshot.is_running:
            raise CommandRefused(
                f"Goal refused: EGM is not running on the {self._side.word} arm; call start_egm first."
            )
        if not snapshot.is_commanded or snapshot.reference is None:
            raise CommandRefused(
                f"Goal refused: no position controller is active on the {self._side.word} arm; activate one first."
            )
        now = (snapshot.session, snapshot.activation)
        base = self._goal if self._goal is not None and self._given_in == now else snapshot.reference
        self._goal, self._given_in = goal_of(message, self._side, base), now
        put_goal(self._goals, snapshot.session, self._goal)
