"""The state of the robot on topics: ``egm_state`` of each arm, ``/diagnostics``, ``~/state`` of the robot manager."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from yumi_interfaces.msg import RobotState as RobotStateMessage

from yumi.clock import Clock
from yumi.control.shared_state import Snapshot
from yumi.driver.state import RobotState
from yumi.robot.joints import Side
from yumi.ros.executors import TimerThread
from yumi.ros.messages import LATCHED, egm_status, robot_state, robot_status, stamp

_EGM_STATE_PERIOD = 0.1  # [s]
_DIAGNOSTICS_PERIOD = 1.0  # [s]


class HealthTopics:
    """Publishes ``egm_state`` of each arm and the driver's ``/diagnostics``.

    Args:
        node: whose ``/diagnostics`` it is.
        streams: a node for the topics of each arm.
        snapshot: the state of an arm.
        robot: the state of the robot.
        grippers: both grippers' statuses for ``/diagnostics``.
        timers: keeps the rates.
    """

    def __init__(
        self,
        node: Any,
        streams: Mapping[Side, Any],
        snapshot: Callable[[Side], Snapshot],
        robot: Callable[[], RobotState],
        grippers: Callable[[], list[DiagnosticStatus]],
        timers: TimerThread,
    ) -> None:
        clock = node.get_clock()
        diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 1)

        def publish_arm(publisher: Any, side: Side) -> None:
            publisher.publish(egm_status(side, snapshot(side)))

        def publish_diagnostics() -> None:
            array = DiagnosticArray()
            array.header.stamp = stamp(clock.now().nanoseconds)
            arms = (egm_status(side, snapshot(side)) for side in Side)
            array.status = [robot_status(robot()), *arms, *grippers()]
            diagnostics.publish(array)

        for side, stream in streams.items():
            publisher = stream.create_publisher(DiagnosticStatus, "egm_state", 1)
            timers.every(_EGM_STATE_PERIOD, f"{side.value}/egm_state", partial(publish_arm, publisher, side))
        timers.every(_DIAGNOSTICS_PERIOD, "/diagnostics", publish_diagnostics)


POLL_PERIOD = 0.05
"""How often the state is compared with the last one [s]; that asks nothing of the robot itself."""

PERIOD = 1.0
"""The state is published at least so often [s]."""


class RobotStateTopic:
    """Publishes ``~/state`` of the robot manager, latched, on each change and once a second."""

    def __init__(self, node: Any, state: Callable[[], RobotState], clock: Clock, timers: TimerThread) -> None:
        self._publisher = node.create_publisher(RobotStateMessage, "~/state", LATCHED)
        self._ros_clock = node.get_clock()
        self._state = state
        self._clock = clock
        self._last: RobotState | None = None
        self._published = 0.0
        timers.every(POLL_PERIOD, "yumi_robot_manager/state", self.update)

    def update(self) -> None:
        """Publish a state that has changed, or was published long ago."""
        state, now = self._state(), self._clock.now()
        if state == self._last and now - self._published < PERIOD:
            return
        self._last, self._published = state, now
        self._publisher.publish(robot_state(state, self._ros_clock.now().nanoseconds))
