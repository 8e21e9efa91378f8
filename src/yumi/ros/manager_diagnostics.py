"""What a controller manager tells on ``/diagnostics``: its controllers, its hardware, its rate; as ros2_control."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from yumi.control.inventory import ControllerInfo, HardwareInfo
from yumi.control.lifecycle import State
from yumi.control.statistics import Statistics
from yumi.errors import YumiError
from yumi.links.ticker import Ticker
from yumi.ros.arm_controllers import ArmControllers
from yumi.ros.arm_hardware import ArmHardware
from yumi.ros.conversions import stamp

HARDWARE_ID = "ros2_control"
_PERIOD = 1.0  # [s]

Threshold = Callable[[str, str], tuple[float, float]]
"""From a subject and a quantity to where a warning and an error begin, [Hz] or [µs]."""


Status = tuple[bytes, str, list[KeyValue]]
"""Level, sentence and values."""

OK: bytes = DiagnosticStatus.OK
WARN: bytes = DiagnosticStatus.WARN
ERROR: bytes = DiagnosticStatus.ERROR


class ManagerDiagnostics:
    """Publishes three statuses a second for one controller manager.

    Args:
        node: the controller manager's node.
        controllers: the arm's controllers; None while the robot description is awaited.
        hardware: the arm's component.
        threshold: where warnings and errors begin.
        rate: how often controllers shall be updated [Hz].
        ticker: has them published; it waits for the fast line each time.
    """

    def __init__(
        self,
        node: Any,
        controllers: ArmControllers,
        hardware: ArmHardware,
        is_waiting: Callable[[], bool],
        threshold: Threshold,
        rate: int,
        ticker: Ticker,
    ) -> None:
        self._name = node.get_fully_qualified_name()  # both arms' managers have the same bare name
        self._clock = node.get_clock()
        self._controllers = controllers
        self._hardware = hardware
        self._is_waiting = is_waiting
        self._threshold = threshold
        self._rate = rate
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 1)
        ticker.every(_PERIOD, f"/diagnostics of {self._name}", self._publish)

    def _publish(self) -> None:
        array = DiagnosticArray()
        array.header.stamp = stamp(self._clock.now().nanoseconds)
        array.status = [
            DiagnosticStatus(
                name=f"{self._name}: {task}", hardware_id=HARDWARE_ID, level=level, message=text, values=pairs
            )
            for task, (level, text, pairs) in self._tasks()
        ]
        self._publisher.publish(array)

    def _tasks(self) -> Iterable[tuple[str, Status]]:
        if self._is_waiting():
            waiting = "Waiting for robot description...."
            return [("Controller Manager Activity", (WARN, waiting, []))]
        try:
            controllers, hardware = self._controllers.list(), self._hardware.info()
        except YumiError as error:
            return [("Controller Manager Activity", (ERROR, str(error), []))]
        return [
            ("Controllers Activity", controllers_status(controllers, self._threshold)),
            ("Hardware Components Activity", hardware_status(hardware, self._rate, self._threshold)),
            ("Controller Manager Activity", manager_status(hardware, self._rate, self._threshold)),
        ]


def controllers_status(controllers: Iterable[ControllerInfo], threshold: Threshold) -> Status:
    """The controllers' states, and how long the updates of the active ones take."""
    infos = tuple(controllers)
    if not infos:
        return WARN, "No controllers are currently loaded", []
    pairs, level = [], OK
    for info in infos:
        pairs.append(_pair(f"{info.name}.state", info.state.value))
        if info.state is State.ACTIVE and info.execution_time.count:
            pairs.append(_pair(f"{info.name}.execution_time", _times(info.execution_time)))
            level = max(level, _time_level(info.execution_time, "controllers", threshold))
    is_all = all(info.state is State.ACTIVE for info in infos)
    return level, "All controllers are active" if is_all else "Not all controllers are active", pairs


def hardware_status(hardware: HardwareInfo, rate: int, threshold: Threshold) -> Status:
    """The component's state, how long reading and writing take, and how often."""
    pairs = [_pair(f"{hardware.name}.state", hardware.state.value)]
    if hardware.state is not State.ACTIVE:
        return ERROR, "No hardware components are active", pairs
    level = OK
    for word, times in (("read", hardware.read_time), ("write", hardware.write_time)):
        if times.count:
            pairs.append(_pair(f"{hardware.name}.{word}_cycle.execution_time", _times(times)))
            pairs.append(_pair(f"{hardware.name}.{word}_cycle.periodicity", _rates(hardware.period)))
            level = max(level, _time_level(times, "hardware_components", threshold))
    level = max(level, _rate_level(hardware.period, rate, "hardware_components", threshold))
    return level, "All hardware components are active", pairs


def manager_status(hardware: HardwareInfo, rate: int, threshold: Threshold) -> Status:
    """How often the controllers are updated; the robot's datagrams are what makes it."""
    pairs, period = [_pair("update_rate", str(rate))], hardware.period
    if not period.count:
        return OK, "Controller Manager is running", pairs
    mean, deviation, slowest, fastest = _in_hertz(period)
    figures = {"average": mean, "standard_deviation": deviation, "min": slowest, "max": fastest}
    pairs += [_pair(f"periodicity.{key}", f"{value:.2f}") for key, value in figures.items()]
    return _rate_level(period, rate, "controller_manager", threshold), "Controller Manager is running", pairs


def _pair(key: str, value: str) -> KeyValue:
    return KeyValue(key=key, value=value)


def _times(times: Statistics) -> str:
    mean, lowest, highest, deviation = (
        value * 1e6 for value in (times.mean, times.minimum, times.maximum, times.deviation)
    )
    return f"Avg: {mean:.1f} [{lowest:.1f} - {highest:.1f}] us, StdDev: {deviation:.1f}"


def _rates(period: Statistics) -> str:
    mean, deviation, slowest, fastest = _in_hertz(period)
    return f"Avg: {mean:.1f} [{slowest:.1f} - {fastest:.1f}] Hz, StdDev: {deviation:.1f}"


def _in_hertz(period: Statistics) -> tuple[float, float, float, float]:
    """Mean, standard deviation (to first order), lowest and highest rate of some periods [Hz]."""
    if not period.count or period.mean <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    fastest = 1.0 / period.minimum if period.minimum > 0.0 else 0.0
    return 1.0 / period.mean, period.deviation / period.mean**2, 1.0 / period.maximum, fastest


def _time_level(times: Statistics, subject: str, threshold: Threshold) -> bytes:
    mean = _level(times.mean * 1e6, threshold(subject, "execution_time.mean_error"))
    return max(mean, _level(times.deviation * 1e6, threshold(subject, "execution_time.standard_deviation")))


def _rate_level(period: Statistics, rate: int, subject: str, threshold: Threshold) -> bytes:
    if not period.count:
        return OK
    mean, deviation, _, _ = _in_hertz(period)
    worst = _level(abs(mean - rate), threshold(subject, "periodicity.mean_error"))
    return max(worst, _level(deviation, threshold(subject, "periodicity.standard_deviation")))


def _level(value: float, limits: tuple[float, float]) -> bytes:
    warn, error = limits
    if value > error:
        return ERROR
    return WARN if value > warn else OK
