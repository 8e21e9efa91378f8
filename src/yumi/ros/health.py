"""How the robot, its arms and its hands are, on topics: ``egm_state`` of each arm, and ``/diagnostics``.

``~/state`` of the robot manager: known to whoever comes late, told on each change and once a second.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import DurabilityPolicy, QoSProfile
from yumi_interfaces.msg import RobotState as RobotStateMessage

from yumi.clock import Clock
from yumi.control.shared_state import Snapshot
from yumi.driver.state import RobotState
from yumi.robot.joints import Side
from yumi.ros.executors import Ticker
from yumi.ros.messages import egm_status, robot_state, robot_status, stamp

_EGM_STATE_PERIOD = 0.1  # [s]
_DIAGNOSTICS_PERIOD = 1.0  # [s]


class HealthTopics:
    """Publishes it.

    Args:
        node: whose ``/diagnostics`` it is.
        streams: a node for the topics of each arm.
        snapshot: what is known of an arm.
        robot: what is known of the robot.
        hands: both hands for ``/diagnostics``.
        ticker: keeps the rates.
    """

    def __init__(
        self,
        node: Any,
        streams: Mapping[Side, Any],
        snapshot: Callable[[Side], Snapshot],
        robot: Callable[[], RobotState],
        hands: Callable[[], list[DiagnosticStatus]],
        ticker: Ticker,
    ) -> None:
        self._clock = node.get_clock()
        self._snapshot = snapshot
        self._robot = robot
        self._hands = hands
        for side, stream in streams.items():
            publisher = stream.create_publisher(DiagnosticStatus, "egm_state", 1)
            ticker.every(_EGM_STATE_PERIOD, f"{side.value}/egm_state", partial(self._publish_arm, publisher, side))
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 1)
        ticker.every(_DIAGNOSTICS_PERIOD, "/diagnostics", self._publish_all)

    def _publish_arm(self, publisher: Any, side: Side) -> None:
        publisher.publish(egm_status(side, self._snapshot(side)))

    def _publish_all(self) -> None:
        array = DiagnosticArray()
        array.header.stamp = stamp(self._clock.now().nanoseconds)
        arms = (egm_status(side, self._snapshot(side)) for side in Side)
        array.status = [robot_status(self._robot()), *arms, *self._hands()]
        self._diagnostics.publish(array)


GLANCE = 0.05
"""How often it is looked whether something has changed [s]; the robot itself is not asked for that."""

PERIOD = 1.0
"""So often it is told without a change [s]."""

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class RobotStateTopic:
    """Publishes it.

    Args:
        node: the robot manager's node.
        state: what is known of the robot now.
        clock: the machine's clock.
        ticker: has it looked.
    """

    def __init__(self, node: Any, state: Callable[[], RobotState], clock: Clock, ticker: Ticker) -> None:
        self._publisher = node.create_publisher(RobotStateMessage, "~/state", _LATCHED)
        self._log = node.get_logger()
        self._ros_clock = node.get_clock()
        self._state = state
        self._clock = clock
        self._last: RobotState | None = None
        self._told = 0.0
        ticker.every(GLANCE, "yumi_robot_manager/state", self.update)

    def update(self) -> None:
        """Look, and tell what has changed, or what has not been told for a while."""
        state, now = self._state(), self._clock.now()
        if state == self._last and now - self._told < PERIOD:
            return
        self._last, self._told = state, now
        self._publisher.publish(robot_state(state, self._ros_clock.now().nanoseconds))
