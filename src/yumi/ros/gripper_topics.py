"""What one hand shows, on topics: its fingers, its state, and the pressure in its vacuum modules."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool

from yumi.links.ticker import Ticker
from yumi.robot.gripper import HandState
from yumi.robot.hand import CupReading, HandReading
from yumi.robot.joints import Side, finger_names
from yumi.ros.conversions import stamp
from yumi.ros.gripper_action import HandTurn

PERIOD = 0.04
"""Time between two messages [s]: the controller tells what changes every 50 ms, and none shall be missed."""

FAILURES, FAILURE = "goals_failed", "last_failure"
"""Keys in ``gripper/state``: how many goals were refused or failed, and why the last one was."""

_DEPTH = 10
_STATE_EVERY = 12  # messages, while nothing changes
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class GripperTopics:
    """Publishes ``gripper/joint_states``, ``gripper/state``, ``gripper/vacuum_1/pressure`` and ``…/object_picked``.

    Nothing comes while the controller tells nothing of the hand, except ``gripper/state`` after a goal that was refused
    or failed.

    Args:
        node: a node in the arm's namespace.
        side: which arm carries the hand.
        reading: the hand as it is now, or None while that is not known.
        picked_pressure: a vacuum module whose pressure is not above this has picked something [Pa].
        channels: its vacuum modules.
        ticker: keeps the rate.
        turn: knows why the last goal was refused or failed.
    """

    def __init__(
        self,
        node: Any,
        side: Side,
        reading: Callable[[], HandReading | None],
        picked_pressure: float,
        channels: tuple[int, ...],
        ticker: Ticker,
        turn: HandTurn,
    ) -> None:
        self._clock = node.get_clock()
        self._names = list(finger_names(side))
        self._side = side
        self._reading = reading
        self._threshold = picked_pressure
        self._states = node.create_publisher(JointState, "gripper/joint_states", _DEPTH)
        self._status = node.create_publisher(DiagnosticStatus, "gripper/state", _LATCHED)
        topic = "gripper/vacuum_{}/{}"
        self._pressures = {
            each: node.create_publisher(FluidPressure, topic.format(each, "pressure"), _DEPTH) for each in channels
        }
        self._picked = {
            each: node.create_publisher(Bool, topic.format(each, "object_picked"), _LATCHED) for each in channels
        }
        self._told: dict[int, bool] = {}
        self._turn = turn
        self._failures = turn.failures
        self._last: HandState | None = None
        self._count = 0
        ticker.every(PERIOD, f"{side.value}/gripper", self._publish)

    def _publish(self) -> None:
        reading, failures = self._reading(), self._turn.failures
        has_failed, self._failures = failures != self._failures, failures
        if reading is None:
            if has_failed:
                self._publish_status(None)
            return
        now = stamp(self._clock.now().nanoseconds)
        self._states.publish(self._fingers(reading, now))
        for channel, cup in reading.cups.items():
            self._publish_cup(channel, cup, now)
        self._count += 1
        if has_failed or reading.state is not self._last or self._count % _STATE_EVERY == 0:
            self._last = reading.state
            self._publish_status(reading)

    def _publish_status(self, reading: HandReading | None) -> None:
        status, (count, reason) = gripper_status(self._side, reading), self._failures
        status.values = [*status.values, KeyValue(key=FAILURES, value=str(count)), KeyValue(key=FAILURE, value=reason)]
        self._status.publish(status)

    def _fingers(self, reading: HandReading, now: Any) -> Any:
        count = len(self._names)
        message = JointState(name=self._names)
        message.header.stamp = now
        message.position = [reading.position] * count
        message.velocity = [reading.speed] * count
        message.effort = [reading.force] * count
        return message

    def _publish_cup(self, channel: int, cup: CupReading, now: Any) -> None:
        message = FluidPressure(fluid_pressure=cup.pressure)
        message.header.stamp = now
        self._pressures[channel].publish(message)
        has_picked = cup.has_picked(self._threshold)
        if self._told.get(channel) != has_picked:
            self._told[channel] = has_picked
            self._picked[channel].publish(Bool(data=has_picked))


def gripper_status(side: Side, reading: HandReading | None) -> DiagnosticStatus:
    """A hand for ``gripper/state`` and ``/diagnostics``."""
    status = DiagnosticStatus(name=f"yumi: {side.word} gripper", hardware_id=f"Hand_{side.name[0]}")
    status.level, status.message = _level(reading)
    if reading is not None:
        values: dict[str, object] = {
            "state": reading.state.name,
            "error": reading.error,
            "calibrated": reading.is_calibrated,
            "holding": reading.is_holding,
            "position": f"{reading.position:.4f}",
            "speed": f"{reading.speed:.4f}",
            "force": f"{reading.force:.1f}",
            "camera": reading.is_camera_linked,
        }
        for channel, cup in reading.cups.items():
            values[f"vacuum_{channel}"] = "on" if cup.sucks else "blowing off" if cup.blows else "off"
            values[f"pressure_{channel}"] = f"{cup.pressure:.0f}"
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return status


def _level(reading: HandReading | None) -> tuple[bytes, str]:
    if reading is None:
        return DiagnosticStatus.STALE, "the controller tells nothing of it"
    if reading.state is HandState.ERROR:
        return DiagnosticStatus.ERROR, f"error {reading.error}; look at the event log, then call clear_error"
    if not reading.is_calibrated:
        return DiagnosticStatus.WARN, "not calibrated; call calibrate"
    if reading.is_holding:
        return DiagnosticStatus.OK, "holding"
    return DiagnosticStatus.OK, reading.state.name.lower().replace("_", " ")
