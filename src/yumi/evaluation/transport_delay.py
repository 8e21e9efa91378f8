"""The delay from a command to the motion it makes, from recorded cycles: what ``tracking.delay`` should be.

Each command is a position and a speed that the robot's law (reference/egm.md §6.1) makes a motion of. That motion is
calculated from the recorded commands, and the measured one is laid over it at the delay where the two agree best, as
a correlation would. The arm has to have moved in a way that does not repeat itself within the longest delay looked for:
a few goals, or a slow sine, on any joint.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import exp, sqrt
from typing import NamedTuple, Protocol

from yumi.control.feed_forward import EGM_GAIN
from yumi.errors import CommandRefused
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import JOINT_COUNT, Joints

LONGEST = 0.150
"""No longer delay is looked for [s]."""

_FEWEST = 250
_LEAST_MOTION = 0.02  # [rad]
_FINEST = 1e-5  # [s]


class CommandedCycle(Protocol):
    """What is needed of a recorded cycle; :class:`yumi.control.flight_recorder.Frame` has it.

    Attributes:
        time: when it was [s].
        position: measured positions [rad], (7,).
        planned: positions the robot was heading for [rad], (7,).
        admitted: positions it was told [rad], (7,).
        admitted_velocity: velocities it was told [rad/s], (7,).
        is_running: whether it followed.
    """

    @property
    def time(self) -> float: ...
    @property
    def position(self) -> Joints: ...
    @property
    def planned(self) -> Joints: ...
    @property
    def admitted(self) -> Joints: ...
    @property
    def admitted_velocity(self) -> Joints: ...
    @property
    def is_running(self) -> bool: ...


class TransportDelay(NamedTuple):
    """The delay of an arm.

    Attributes:
        delay: from the moment a command is sent to the middle of the motion it makes [s].
        error: root of the mean square of what the delay does not explain [rad].
        joint: index of the joint that moved most, which it was taken from.
    """

    delay: float
    error: float
    joint: int


def transport_delay(cycles: Iterable[CommandedCycle], gain: float = EGM_GAIN) -> TransportDelay:
    """The delay of an arm with which the ``cycles`` are explained best.

    Args:
        cycles: in order, from one session, while the arm moved.
        gain: of the robot's position loop, PosCorrGain times 5 [1/s].

    Raises:
        CommandRefused: there are too few cycles, or the arm hardly moved.
    """
    rows = [cycle for cycle in cycles if cycle.is_running]
    if len(rows) < _FEWEST:
        raise CommandRefused(f"There are {len(rows)} cycles in which the robot followed; a delay needs {_FEWEST}.")
    joint = max(range(JOINT_COUNT), key=lambda index: _way([row.position[index] for row in rows]))
    way = _way([row.position[joint] for row in rows])
    if way < _LEAST_MOTION:
        raise CommandRefused(f"The arm moved by {way:.4f} rad; a delay needs a motion of {_LEAST_MOTION:g} rad.")
    times, path = _ordered_path(rows, joint, gain)
    measured = [(row.time, row.position[joint]) for row in rows if row.time > rows[0].time + LONGEST]
    delay = _best_delay(times, path, measured)
    return TransportDelay(delay, sqrt(_mismatch(delay, times, path, measured)), joint)


def _way(values: Sequence[float]) -> float:
    return max(values) - min(values)


def _ordered_path(rows: Sequence[CommandedCycle], joint: int, gain: float) -> tuple[list[float], list[float]]:
    """Where the commands would have the joint be if they worked at once, each for its own cycle around its time."""
    place, times, path = rows[0].planned[joint], [rows[0].time - 0.5 * CYCLE], [rows[0].planned[joint]]
    for before, row in pairwise(rows):
        dt = min(row.time - before.time, LONGEST)
        place = _moved(place, before.admitted[joint], before.admitted_velocity[joint], gain, dt)
        times.append(times[-1] + dt)
        path.append(place)
    return times, path


def _moved(place: float, position: float, velocity: float, gain: float, dt: float) -> float:
    """The robot's law, exact for references held for ``dt``."""
    if gain <= 0.0:
        return place + velocity * dt
    end = position + velocity / gain
    return end + (place - end) * exp(-gain * dt)


def _best_delay(times: Sequence[float], path: Sequence[float], measured: Sequence[tuple[float, float]]) -> float:
    best, width = LONGEST / 2.0, LONGEST / 2.0
    while width > _FINEST:
        choices = [best + width * share / 5.0 for share in range(-5, 6)]
        best = min(choices, key=lambda delay: _mismatch(delay, times, path, measured))
        width /= 4.0
    return best


def _mismatch(
    delay: float, times: Sequence[float], path: Sequence[float], measured: Sequence[tuple[float, float]]
) -> float:
    """Mean square of the difference [rad²], apart from a constant one: the two began at different delays."""
    errors = [value - _at(time - delay, times, path) for time, value in measured]
    mean = sum(errors) / len(errors)
    return sum([(error - mean) ** 2 for error in errors]) / len(errors)


def _at(time: float, times: Sequence[float], path: Sequence[float]) -> float:
    index = bisect_right(times, time)
    if index == 0:
        return path[0]
    if index == len(times):
        return path[-1]
    begin, end = times[index - 1], times[index]
    share = (time - begin) / (end - begin) if end > begin else 1.0
    return path[index - 1] + (path[index] - path[index - 1]) * share
