"""The diagnostics of one arm's controller manager: its controllers, its hardware, and how evenly both are updated."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from yumi.control.controller import State
from yumi.control.controller_info import ControllerInfo, HardwareInfo, Statistics
from yumi.ros.messages import RATE

DIAGNOSTIC_OK: bytes = DiagnosticStatus.OK
DIAGNOSTIC_WARN: bytes = DiagnosticStatus.WARN
DIAGNOSTIC_ERROR: bytes = DiagnosticStatus.ERROR

_Threshold = Callable[[str, str], tuple[float, float]]
"""From a subject and a quantity to where a warning and an error begin, [Hz] or [µs]."""

ManagerStatus = tuple[bytes, str, list[KeyValue]]
"""Level, sentence and values."""


def controllers_status(controllers: Iterable[ControllerInfo], threshold: _Threshold) -> ManagerStatus:
    """The controllers' states, and how long the updates of the active ones take."""
    infos = tuple(controllers)
    if not infos:
        return DIAGNOSTIC_WARN, "No controllers are currently loaded", []
    pairs, faults = [], []
    for info in infos:
        pairs.append(KeyValue(key=f"{info.name}.state", value=info.state.value))
        if info.state is State.ACTIVE and info.execution_time.count:
            pairs.append(KeyValue(key=f"{info.name}.execution_time", value=_times_text(info.execution_time)))
            faults += _time_faults(f"an update of {info.name}", info.execution_time, "controllers", threshold)
    is_all = all(info.state is State.ACTIVE for info in infos)
    level, sentence = _judged("All controllers are active" if is_all else "Not all controllers are active", faults)
    return level, sentence, pairs


def hardware_status(hardware: HardwareInfo, threshold: _Threshold) -> ManagerStatus:
    """The component's state, how long reading and writing take, and how often."""
    pairs = [KeyValue(key=f"{hardware.name}.state", value=hardware.state.value)]
    if hardware.state is not State.ACTIVE:
        return DIAGNOSTIC_ERROR, "No hardware components are active", pairs
    faults = _rate_faults(hardware.period, "hardware_components", threshold)
    mean, deviation, slowest, fastest = _in_hertz(hardware.period)
    rates = f"Avg: {mean:.1f} [{slowest:.1f} - {fastest:.1f}] Hz, StdDev: {deviation:.1f}"
    for word, times in (("read", hardware.read_time), ("write", hardware.write_time)):
        if times.count:
            cycle = f"{hardware.name}.{word}_cycle"
            pairs.append(KeyValue(key=f"{cycle}.execution_time", value=_times_text(times)))
            pairs.append(KeyValue(key=f"{cycle}.periodicity", value=rates))
            faults += _time_faults(f"a {word}", times, "hardware_components", threshold)
    level, sentence = _judged("All hardware components are active", faults)
    return level, sentence, pairs


def manager_status(hardware: HardwareInfo, threshold: _Threshold) -> ManagerStatus:
    """How often the controllers are updated; the robot's datagrams are what makes it."""
    pairs, period = [KeyValue(key="update_rate", value=str(RATE))], hardware.period
    if period.count:
        names = ("average", "standard_deviation", "min", "max")
        figures = zip(names, _in_hertz(period), strict=True)
        pairs += [KeyValue(key=f"periodicity.{name}", value=f"{value:.2f}") for name, value in figures]
    faults = _rate_faults(period, "controller_manager", threshold)
    level, sentence = _judged("Controller Manager is running", faults)
    return level, sentence, pairs


def _times_text(times: Statistics) -> str:
    mean, lowest, highest, deviation = (
        value * 1e6 for value in (times.mean, times.minimum, times.maximum, times.deviation)
    )
    return f"Avg: {mean:.1f} [{lowest:.1f} - {highest:.1f}] us, StdDev: {deviation:.1f}"


def _in_hertz(period: Statistics) -> tuple[float, float, float, float]:
    """Mean, standard deviation (to first order), lowest and highest rate of some periods [Hz]."""
    if not period.count or period.mean <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    fastest = 1.0 / period.minimum if period.minimum > 0.0 else 0.0
    return 1.0 / period.mean, period.deviation / period.mean**2, 1.0 / period.maximum, fastest


_Fault = tuple[bytes, str]
"""Level, and why it is not OK."""


def _time_faults(what: str, times: Statistics, subject: str, threshold: _Threshold) -> list[_Fault]:
    mean, deviation = times.mean * 1e6, times.deviation * 1e6
    return [
        *_fault(f"{what} takes {mean:.0f} us", mean, threshold(subject, "execution_time.mean_error"), "us"),
        *_fault(
            f"the time of {what} varies by {deviation:.0f} us",
            deviation,
            threshold(subject, "execution_time.standard_deviation"),
            "us",
        ),
    ]


def _rate_faults(period: Statistics, subject: str, threshold: _Threshold) -> list[_Fault]:
    if not period.count:
        return []
    mean, deviation, _, _ = _in_hertz(period)
    return [
        *_fault(
            f"the rate is {mean:.1f} Hz instead of {RATE} Hz",
            abs(mean - RATE),
            threshold(subject, "periodicity.mean_error"),
            "Hz",
        ),
        *_fault(
            f"the rate varies by {deviation:.1f} Hz",
            deviation,
            threshold(subject, "periodicity.standard_deviation"),
            "Hz",
        ),
    ]


def _fault(sentence: str, value: float, limits: tuple[float, float], unit: str) -> list[_Fault]:
    """None where ``value`` is below both limits."""
    warn, error = limits
    if value <= min(warn, error):
        return []
    level, limit = (DIAGNOSTIC_ERROR, error) if value > error else (DIAGNOSTIC_WARN, warn)
    return [(level, f"{sentence} (limit {limit:g} {unit})")]


def _judged(sentence: str, faults: Iterable[_Fault]) -> _Fault:
    """The worst level, and all reasons after ``sentence``."""
    known = list(faults)
    return max([DIAGNOSTIC_OK, *(level for level, _ in known)]), "; ".join([sentence, *(reason for _, reason in known)])
