"""``~/state`` of the robot manager: known to whoever comes late, told on each change and once a second."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile
from yumi_interfaces.msg import RobotState as RobotStateMessage

from yumi.clock import Clock
from yumi.hardware.manager_state import RobotState
from yumi.links.ticker import Ticker
from yumi.ros.robot_messages import robot_state

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
