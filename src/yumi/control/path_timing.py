"""When the joints are where on a path: as fast as their speeds, accelerations and jerks allow.

A plan in joints is a chain of straight lines; :class:`RoundedPath` rounds its corners, so that it can be passed at
speed. :func:`fastest_along` finds the time law in three steps:

1. the fastest one that keeps speeds and accelerations, by one sweep from the end and one from the start (J. Bobrow,
   1985; the sweeps as in TOPP-RA, H. Pham, 2018). It changes accelerations at once.
2. the average of it over the time in which a jerk builds an acceleration up, twice: accelerations change gradually.
3. more time where a jerk is still too high, and only there.

What a motion asks of the joints is judged by the differences from cycle to cycle, as the limiter sees them, by
:func:`demand`; :mod:`yumi.control.tool_path` judges lines of the tool by the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from yumi.errors import CommandRefused
from yumi.robot.joints import CYCLE

Array = NDArray[np.float64]
Number = TypeVar("Number", float, Array)

_FINE = 0.004  # [s] at all joints' highest speeds, between two places at which the speed is decided
_FEWEST = 200  # such places
_SHARES = (1.0, 0.8, 0.65)  # of the accelerations in step 1: with less of them, less has to be slowed down in step 3
_AVERAGED = 0.7  # of acceleration / jerk: how long each of the two averages is
_SPREAD = 12  # cycles around a place that is passed too fast, over which more time is taken
_EAGERNESS = 0.7  # of the time that is missing there, how much is added in a round
_ROUNDS = 6
UNLIMITED = 1e6
"""A ceiling that no path comes to [1/s]."""
_UNLIMITED = np.array([UNLIMITED])
_ROOM = 1e-4  # [rad] that every joint has to the end of its range


def rounding(share: Number, zone: float | Array) -> tuple[Number, Number]:
    """How a corner is rounded: how much of the next line's direction is taken, and how far one has come along it.

    Args:
        share: of the way through the corner, 0 to 1.
        zone: half the length of this way.
    """
    weight = share**3 * (10.0 - 15.0 * share + 6.0 * share * share)
    return weight, 2.0 * zone * share**4 * (2.5 - 3.0 * share + share * share)  # type: ignore[return-value]


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """What k joints may, and what they need to stop before the ends of their ranges.

    Attributes:
        velocity: highest [rad/s], (k,).
        acceleration: highest [rad/s²], (k,).
        jerk: highest [rad/s³], (k,).
        lower: end of the range [rad], (k,); minus infinity for what may go on.
        upper: see lower.
        braking: acceleration and jerk with which a joint stops before it, (k,) each; as above when left out.
        stopping: share of the speed from which it can stop that it may have.
    """

    velocity: Array
    acceleration: Array
    jerk: Array
    lower: Array
    upper: Array
    braking: tuple[Array, Array] | None = None
    stopping: float = 1.0


def speeds_to_stop(room: Array, acceleration: Array, jerk: Array) -> Array:
    """As :func:`yumi.control.motion.speed_to_stop`, for arrays (n, k) of all joints at once."""
    slow = 3.0 * acceleration / jerk
    return np.asarray(0.5 * acceleration * (np.sqrt(slow * slow + 8.0 * np.maximum(room, 0.0) / acceleration) - slow))


def demand(positions: Array, limits: MotionLimits) -> Array:
    """How much more time each step would have to take for the limits to be kept: above 1, they are not.

    Args:
        positions: of the joints in each cycle [rad], (n, k); at rest before and after.
        limits: of the joints.

    Returns:
        (n + 3,); the first belongs to one cycle before the first position.
    """
    rows = np.concatenate([*[positions[:1]] * 3, positions, *[positions[-1:]] * 3])
    first = np.diff(rows, axis=0) / CYCLE
    second, third = np.diff(first, axis=0) / CYCLE, np.diff(first, 2, axis=0) / CYCLE**2
    # A joint that comes near the end of its range must be able to stop before it, as the limiter has it.
    room = np.where(first > 0.0, limits.upper - rows[1:], rows[1:] - limits.lower) + _ROOM
    stoppable = speeds_to_stop(room, *(limits.braking or (limits.acceleration, limits.jerk)))
    speeds = np.abs(first)
    of_speed = np.maximum(
        np.max(speeds / limits.velocity, 1), np.max(speeds / np.maximum(limits.stopping * stoppable, 1e-9), 1)
    )
    of_acceleration = np.sqrt(np.max(np.abs(second) / limits.acceleration, 1))
    of_jerk = np.cbrt(np.max(np.abs(third) / limits.jerk, 1))
    return np.asarray(np.maximum.reduce([of_speed[2:], of_acceleration[1:], of_jerk]))


class RoundedPath:
    """Straight lines from corner to corner in joint space, with the corners rounded: its curvature does not jump.

    Args:
        corners: (n, k) [rad], at least two, none twice in a row.
        unit: what a joint's way is counted in, (k,) [rad]: with the joints' speeds, the path's parameter is a time.
        deviation: how far a rounded corner may lie from the sharp one [rad].

    Attributes:
        length: of the path in its parameter.
    """

    def __init__(self, corners: Array, unit: Array, deviation: float) -> None:
        ways = np.diff(corners, axis=0)
        lengths = np.linalg.norm(ways / unit, axis=1)
        self._corners, self._slopes = corners, ways / lengths[:, None]
        self._lengths, self._begins = lengths, np.concatenate([[0.0], np.cumsum(lengths)])
        self.length = float(self._begins[-1])
        self._zones = np.zeros(len(corners))
        change = np.max(np.abs(np.diff(self._slopes, axis=0)), axis=1, initial=1e-9)
        halfway = rounding(0.5, 1.0)[1]
        self._zones[1:-1] = np.minimum(0.5 * np.minimum(lengths[:-1], lengths[1:]), deviation / (halfway * change))

    def sharpen(self, places: Array) -> bool:
        """Round the corners nearest to these parameters half as much; whether there is one that was rounded."""
        distance = np.abs(places[:, None] - self._begins)
        corners = np.unique(np.argmin(distance, 1)[np.min(distance / np.maximum(self._zones, 1e-12), 1) < 1.0])
        self._zones[corners] *= 0.5
        return bool(np.any(self._zones[corners] > 1e-4))

    def at(self, parameters: Array) -> tuple[Array, Array, Array]:
        """Positions, and their first and second derivatives, (n, k) each."""
        last = len(self._lengths) - 1
        line = np.clip(np.searchsorted(self._begins, parameters, side="right") - 1, 0, last)
        past = parameters - self._begins[line]
        slope = self._slopes[line]
        position, curvature = self._corners[line] + past[:, None] * slope, np.zeros_like(slope)
        corner = np.where(past < 0.5 * self._lengths[line], line, line + 1)
        near = np.abs(parameters - self._begins[corner]) < self._zones[corner]
        corner, zone = corner[near], self._zones[corner[near]]
        past = parameters[near] - self._begins[corner]
        share = (past + zone) / (2.0 * zone)
        weight, gone = (each[:, None] for each in rounding(share, zone))
        before, after = self._slopes[corner - 1], self._slopes[np.minimum(corner, last)]
        position[near] = self._corners[corner] + (past[:, None] - gone) * before + gone * after
        slope[near] = (1.0 - weight) * before + weight * after
        curvature[near] = (15.0 * share**2 * (1.0 - share) ** 2 / zone)[:, None] * (after - before)
        return position, slope, curvature


def fastest_along(path: RoundedPath, limits: MotionLimits, ceiling: Array = _UNLIMITED) -> tuple[Array, Array]:
    """A motion along a path, from rest to rest, close to the fastest that keeps the limits.

    Args:
        path: where to.
        limits: of the joints.
        ceiling: highest speeds of the path's parameter [1/s], at places that are evenly spaced along it, (m,).

    Returns:
        The parameter of the path in each cycle, (n,), and the positions [rad], (n, k).

    Raises:
        CommandRefused: no motion along the path keeps the limits.
    """
    # How many cycles each step of a law takes: the best of all that were tried.
    best, law_of_best, gaps_of_best = inf, np.zeros(0), np.zeros(0)
    width = max(int(_AVERAGED * float(np.max(limits.acceleration / limits.jerk)) / CYCLE), 1)
    for share in _SHARES:
        law = _averaged(_averaged(accelerating_law(path, limits, share, ceiling), width), width)
        gaps = np.ones(len(law) - 1)
        for _ in range(_ROUNDS):
            asked = demand(path.at(_stretched(law, gaps))[0], limits)
            slower = max(float(np.max(asked)), 1.0)
            if float(gaps.sum()) * slower < best:
                best, law_of_best, gaps_of_best = float(gaps.sum()) * slower, law, gaps * slower
            if slower == 1.0:
                break
            # More time there and a little around, so that taking more time does not itself accelerate too much.
            times = np.concatenate([[0.0], np.cumsum(gaps)])
            factor = 1.0 + _EAGERNESS * np.maximum(np.interp(times, np.arange(len(asked)) - 1.0, asked) - 1.0, 0.0)
            edge = np.pad(factor, _SPREAD, mode="edge")
            factor = np.max(np.lib.stride_tricks.sliding_window_view(edge, 2 * _SPREAD + 1), axis=1)
            factor = _averaged(_averaged(factor, _SPREAD), _SPREAD)[_SPREAD + 1 : _SPREAD + 1 + len(law)]
            gaps = gaps * 0.5 * (factor[1:] + factor[:-1])
    # A motion as a whole takes a little more time than its places ask for, where rounding makes some of them faster.
    for _ in range(_ROUNDS):
        law = _stretched(law_of_best, gaps_of_best)
        positions = path.at(law)[0]
        slower = float(np.max(demand(positions, limits)))
        if slower <= 1.0:
            return law, positions
        gaps_of_best = gaps_of_best * (slower + 0.001)
    raise CommandRefused("Nothing was planned: no motion along the path keeps the joints' limits; take another goal.")


def accelerating_law(path: RoundedPath, limits: MotionLimits, share: float, ceiling: Array = _UNLIMITED) -> Array:
    """The parameter in each cycle on the fastest motion within speeds and a share of the accelerations."""
    count = max(int(path.length / _FINE), _FEWEST)
    fine, gap = np.linspace(0.0, path.length, count + 1), path.length / count
    _, slope, curvature = path.at(fine)
    # With x the parameter's speed squared and u its acceleration: |slope u + curvature x| <= acceleration.
    size = np.maximum(np.abs(slope), 1e-12)
    most, own = share * limits.acceleration / size, np.copysign(curvature, curvature * slope) / size
    highest = np.min((limits.velocity / size) ** 2, 1)
    highest = np.minimum(highest, np.min(share * limits.acceleration / np.maximum(np.abs(curvature), 1e-12), 1))
    highest = np.minimum(highest, np.interp(fine, np.linspace(0.0, path.length, len(ceiling)), ceiling) ** 2)
    squared = highest.tolist()
    squared[0] = squared[-1] = 0.0
    for index in range(count - 1, -1, -1):
        after = squared[index + 1]
        braking = float((most[index + 1] + own[index + 1] * after).min())
        squared[index] = min(squared[index], after + 2.0 * gap * max(braking, 0.0))
    for index in range(count):
        here = squared[index]
        speeding_up = float((most[index] - own[index] * here).min())
        squared[index + 1] = min(squared[index + 1], here + 2.0 * gap * max(speeding_up, 0.0))
    speed = np.sqrt(np.array(squared))
    times = np.concatenate([[0.0], np.cumsum(2.0 * gap / np.maximum(speed[1:] + speed[:-1], 1e-9))])
    return np.asarray(np.interp(np.arange(int(np.ceil(times[-1] / CYCLE)) + 1) * CYCLE, times, fine))


def _averaged(values: Array, width: int) -> Array:
    """The averages over ``width`` values, from the first alone to the last alone: ``width + 1`` more than values."""
    padded = np.concatenate([np.full(width, values[0]), values, np.full(width, values[-1])])
    total = np.cumsum(np.concatenate([[0.0], padded]))
    return np.asarray((total[width:] - total[:-width]) / width)


def _stretched(law: Array, gaps: Array) -> Array:
    """A law whose steps take so many cycles each, in every cycle; on a cubic B-spline, which adds no jerk."""
    times = np.concatenate([[0.0], np.cumsum(gaps)])
    edge = np.concatenate([gaps[:1], gaps, gaps[-1:]])
    pace = 2.0 / (edge[1:] + edge[:-1])
    ticks = np.arange(float(np.ceil(times[-1])) + 1.0)
    at = hermite(np.minimum(ticks, times[-1]), times, np.arange(len(law), dtype=float)[:, None], pace[:, None], 0)[:, 0]
    index = np.clip(np.floor(at).astype(int), 0, len(law) - 2)
    t = at - index
    p, q, r, s = (np.pad(law, 1, mode="edge")[index + offset] for offset in range(4))
    value = (1.0 - t) ** 3 * p + (4.0 - 6.0 * t**2 + 3.0 * t**3) * q + t**3 * s
    value = (value + (1.0 + 3.0 * t + 3.0 * t**2 - 3.0 * t**3) * r) / 6.0
    value[0], value[-1] = law[0], law[-1]  # less than a thousandth of a step away
    return np.asarray(value)


def hermite(at: Array, nodes: Array, values: Array, slopes: Array, order: int) -> Array:
    """Cubic pieces through values (n, k) with slopes at nodes (n,), or their ``order``th derivative, at places (m,)."""
    index = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, len(nodes) - 2)
    width = (nodes[index + 1] - nodes[index])[:, None]
    t = (at[:, None] - nodes[index][:, None]) / width
    p, q, v, w = values[index], values[index + 1], slopes[index] * width, slopes[index + 1] * width
    c2, c3 = 3.0 * (q - p) - 2.0 * v - w, 2.0 * (p - q) + v + w
    if order == 0:
        return np.asarray(p + t * (v + t * (c2 + t * c3)))
    if order == 1:
        return np.asarray((v + t * (2.0 * c2 + t * 3.0 * c3)) / width)
    return np.asarray((2.0 * c2 + t * 6.0 * c3) / width**2)
