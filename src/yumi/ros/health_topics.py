"""How the robot, its arms and its hands are, on topics: ``egm_state`` of each arm, and ``/diagnostics``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from yumi.control.snapshot import Snapshot
from yumi.hardware.manager_state import RobotState
from yumi.links.ticker import Ticker
from yumi.robot.joints import Side
from yumi.ros.conversions import egm_status, stamp
from yumi.ros.robot_messages import robot_status

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
