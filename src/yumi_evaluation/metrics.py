"""What an experiment measured, as numbers: settling, overshoot, control lag, jitter, loss, quantiles.

Pure functions. A series is a sequence of (time [s], value) in the order of time; the unit of values is the caller's.

The delay from a command to the motion it makes, from recorded cycles: what ``tracking.delay`` should be.

Each command is a position and a speed that the robot's law (reference/egm.md §6.1) makes a motion of. That motion is
calculated from the recorded commands, and the measured one is laid over it at the delay where the two agree best, as
a correlation would. The arm has to have moved in a way that does not repeat itself within the longest delay looked for:
a few goals, or a slow sine, on any joint.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from math import exp, inf, nan, sqrt
from operator import neg
from typing import NamedTuple, Protocol

from yumi.control.motion import EGM_GAIN
from yumi.errors import CommandRefused
from yumi.robot.joints import CYCLE, JOINT_COUNT, Joints
from yumi_evaluation.bench.figures import quantile

Series = Sequence[tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Distribution:
    """How values are distributed; nan where there are none.

    Attributes:
        count: how many there are.
        mean: their mean.
        jitter: mean deviation from the mean, without sign.
        lowest, p50, p90, p99, p999, highest: quantiles.
    """

    count: int
    mean: float
    jitter: float
    lowest: float
    p50: float
    p90: float
    p99: float
    p999: float
    highest: float


@dataclass(frozen=True, slots=True)
class Matches:
    """Control lags found by matching.

    Attributes:
        lags: of every reference sample that found a match, with the time of the sample [s]: (time, lag).
        sought: how many samples looked for one.
    """

    lags: tuple[tuple[float, float], ...]
    sought: int

    @property
    def share(self) -> float:
        """Share of the samples that found a match."""
        return len(self.lags) / self.sought if self.sought else nan

    @property
    def distribution(self) -> Distribution:
        """Of the lags [s]."""
        return distribution([lag for _, lag in self.lags])


class Rule(Enum):
    """Which later samples may match a reference sample: any, those moving the same way, or only before it turns."""

    BRANCH = "before the reference turns, moving the same way"
    WAY = "moving the same way"
    ANY = "moving either way"


def distribution(values: Iterable[float]) -> Distribution:
    """Mean, jitter and quantiles of ``values``."""
    ordered = sorted(values)
    count = len(ordered)
    mean = sum(ordered) / count if count else nan
    jitter = sum([abs(value - mean) for value in ordered]) / count if count else nan
    lowest, p50, p90, p99, p999, highest = (quantile(ordered, share) for share in (0.0, 0.5, 0.9, 0.99, 0.999, 1.0))
    return Distribution(count, mean, jitter, lowest, p50, p90, p99, p999, highest)


def settling_time(series: Series, goal: float, band: float) -> float | None:
    """When the values came within ``band`` of ``goal`` to stay [s]; None when they are outside at the end.

    Between two samples the way is taken to be straight, so that the result does not jump by whole periods.
    """
    outside = [index for index, (_, value) in enumerate(series) if abs(value - goal) > band]
    if not outside:
        return series[0][0] if series else None
    if outside[-1] == len(series) - 1:
        return None
    (time, value), (later, closer) = series[outside[-1]], series[outside[-1] + 1]
    far, near = abs(value - goal), abs(closer - goal)
    return time + (later - time) * (far - band) / (far - near)


def overshoot(series: Series, goal: float) -> float:
    """How far the values went past ``goal``, seen from the first one; 0 when they did not."""
    direction = 1.0 if goal >= series[0][1] else -1.0
    return max(0.0, *(direction * (value - goal) for _, value in series))


def swings(series: Series, goal: float, band: float) -> int:
    """How often the values crossed from one side of ``goal``, further than ``band``, to the other: oscillation."""
    sides = [value > goal for _, value in series if abs(value - goal) > band]
    return sum(now != before for before, now in pairwise(sides))


def final_error(series: Series, goal: float, seconds: float) -> float:
    """Largest distance from ``goal`` in the last ``seconds``: the error that stays."""
    end = series[-1][0]
    return max(abs(value - goal) for time, value in series if time > end - seconds)


def largest_error(reference: Series, measured: Series) -> float:
    """Largest distance of a measured value from the reference of its time, which is straight between its samples."""
    times = [time for time, _ in reference]
    return max(abs(value - _at(reference, times, time)) for time, value in measured)


def best_delay(reference: Series, measured: Series, longest: float = 0.6) -> float:
    """The delay of the reference with which it comes closest to the measured values, by least squares [s].

    Less than nothing is a lead. The whole motion counts, where a match is about single samples.

    Args:
        reference: dense enough to be straight between its samples; it stands before and after them.
        measured: of which every fourth value is looked at.
        longest: no longer delay, and no lead longer than a tenth of it, is looked for [s].
    """
    times, thinned = [time for time, _ in reference], measured[::4]
    best, width = 0.45 * longest, 0.55 * longest
    while width > 1e-5:
        choices = [best + width * share / 5.0 for share in range(-5, 6)]
        best = min(
            choices,
            key=lambda late: sum([(value - _at(reference, times, time - late)) ** 2 for time, value in thinned]),
        )
        width /= 4.0
    return best


def match_lags(
    reference: Series, measured: Series, tolerance: float, rule: Rule = Rule.BRANCH, longest: float = inf
) -> Matches:
    """The control lag of every reference sample: the time until a measured value comes within ``tolerance`` of it.

    A match lies on the same branch: before the reference turns, and moving the same way. Without that a sample near a
    turning point would be matched with the way back, or before the way there.

    Args:
        reference: where the joint shall be.
        measured: where it is.
        tolerance: how close is a match.
        rule: which samples may match.
        longest: no longer lag is looked for [s].
    """
    times, runs = [time for time, _ in measured], _Runs([value for _, value in measured])
    branches = directions([value for _, value in reference])
    ends = _branch_ends(reference, branches) if rule is Rule.BRANCH else [inf] * len(reference)
    lags = []
    for (time, value), way, end in zip(reference, branches, ends, strict=True):
        index = runs.first_near(value, tolerance, bisect_left(times, time), None if rule is Rule.ANY else way)
        if index is not None and times[index] <= min(end, time + longest):
            lags.append((time, times[index] - time))
    return Matches(tuple(lags), len(reference))


def directions(values: Sequence[float]) -> list[int]:
    """Which way each value moves: 1 up, -1 down; where it stands, as before."""
    ways = [(new > old) - (new < old) for old, new in pairwise(values)]
    ways += ways[-1:] or [0] * len(values)
    for index in range(1, len(ways)):
        ways[index] = ways[index] or ways[index - 1]
    return ways


def lost_count(numbers: Iterable[int]) -> int:
    """How many of consecutive sequence numbers are missing between the lowest and the highest that came."""
    came = set(numbers)
    return max(came) - min(came) + 1 - len(came) if came else 0


class _Runs:
    """Values cut where they turn: within a run they go one way, so that halving finds what is near a value."""

    def __init__(self, values: Sequence[float]) -> None:
        ways = directions(values)
        begins = [index for index in range(len(values)) if index == 0 or ways[index] != ways[index - 1]]
        self._values = values
        self._ways = [ways[begin] for begin in begins]
        self._ends = [*begins[1:], len(values)]

    def first_near(self, value: float, tolerance: float, begin: int, way: int | None) -> int | None:
        """Index of the first one from ``begin`` on within ``tolerance`` of ``value``, in a run that goes that way."""
        for run in range(bisect_right(self._ends, begin), len(self._ends)):
            if way is None or way == self._ways[run]:
                near = self._entry(value, tolerance, begin, run)
                if near < self._ends[run] and abs(self._values[near] - value) <= tolerance:
                    return near
            begin = self._ends[run]
        return None

    def _entry(self, value: float, tolerance: float, begin: int, run: int) -> int:
        """Index of the first one of the run that is not before ``value`` by more than ``tolerance``."""
        if self._ways[run] < 0:
            return bisect_left(self._values, -value - tolerance, begin, self._ends[run], key=neg)
        return bisect_left(self._values, value - tolerance, begin, self._ends[run])


def _branch_ends(reference: Series, branches: Sequence[int]) -> list[float]:
    """For every sample the time of the turning point that ends its branch [s]."""
    ends, end = [], reference[-1][0] if reference else 0.0
    for index in range(len(reference) - 1, -1, -1):
        if index + 1 < len(reference) and branches[index] != branches[index + 1]:
            end = reference[index + 1][0]
        ends.append(end)
    return ends[::-1]


def _at(series: Series, times: Sequence[float], time: float) -> float:
    index = min(max(bisect_left(times, time), 1), len(series) - 1)
    (begin, before), (end, after) = series[index - 1], series[index]
    return before + (after - before) * min(1.0, max(0.0, (time - begin) / (end - begin)))


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
        sent: positions sent to it [rad], (7,).
        sent_velocity: velocities sent to it [rad/s], (7,).
        is_running: whether it followed.
    """

    @property
    def time(self) -> float: ...
    @property
    def position(self) -> Joints: ...
    @property
    def planned(self) -> Joints: ...
    @property
    def sent(self) -> Joints: ...
    @property
    def sent_velocity(self) -> Joints: ...
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
        place = _moved(place, before.sent[joint], before.sent_velocity[joint], gain, dt)
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
    errors = [value - _transport_delay_at(time - delay, times, path) for time, value in measured]
    mean = sum(errors) / len(errors)
    return sum([(error - mean) ** 2 for error in errors]) / len(errors)


def _transport_delay_at(time: float, times: Sequence[float], path: Sequence[float]) -> float:
    index = bisect_right(times, time)
    if index == 0:
        return path[0]
    if index == len(times):
        return path[-1]
    begin, end = times[index - 1], times[index]
    share = (time - begin) / (end - begin) if end > begin else 1.0
    return path[index - 1] + (path[index] - path[index - 1]) * share
