"""The timing of a path: as fast as the limits of joints and tool allow.

:func:`timed_along` slows lines of a tool down where a joint would be too fast, accelerate or jerk too hard: first by a
speed along the way that changes gradually, then by a jerk-limited start and end (Ruckig) in the time this leaves.

:func:`fastest_along` passes a rounded path in joint space as fast as the joints' speeds, accelerations and jerks allow,
in three steps:

1. the fastest time law that keeps speeds and accelerations, by one sweep from the end and one from the start
   (J. Bobrow, 1985; the sweeps as in TOPP-RA, H. Pham, 2018). It changes accelerations at once.
2. the average of it over the time in which a jerk builds an acceleration up, twice: accelerations change gradually.
3. more time where a jerk is still too high, and only there.

A motion is judged for both by :func:`time_demand`: what it asks of the joints, by the differences between cycles, as
the limiter sees them.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Trajectory

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CYCLE, JointLimits
from yumi.planning.rounded_path import Array, RoundedPath


class JointPath(NamedTuple):
    """All joints along a path: by the length of the way, the joints [rad] and the parameter, (n, 8), and their slopes.

    The length counts each joint in the time it takes at its highest speed, and the parameter as it is.
    """

    length: Array
    values: Array
    slopes: Array


_FINE = 0.003  # [s] between two looks at the way
_ATTEMPTS = 40
_SMOOTHING = 0.12  # [s] over which the speed along the way changes
_SHARE_OF_LIMITS = 0.9  # of the joints' limits: the limiter looks at what robot and reference add up to


def timed_along(way: JointPath, limits: JointLimits, rates: tuple[float, float], scale: float) -> tuple[Array, Array]:
    """Joints [rad] and parameter in each cycle, (n, 8), and the times [s], (n,).

    Args:
        way: with all joints.
        limits: of the joints.
        rates: acceleration and jerk of the parameter, as the tool may [1/s], [1/s²].
        scale: factor on accelerations and jerks of joints and tool, above 0 up to 1.
    """
    total = float(way.length[-1])
    count = max(round(total / _FINE), 40)
    fine = np.linspace(0.0, total, count + 1)
    gap = total / count
    strength, jerk = scale * rates[0], scale * rates[1]
    tops = np.array([*(_SHARE_OF_LIMITS * each for each in limits.velocity), 1.0])
    strengths = np.array([*(_SHARE_OF_LIMITS * scale * each for each in limits.acceleration), strength])
    jerks = np.array([*(_SHARE_OF_LIMITS * scale * each for each in limits.jerk), jerk])
    braking = np.array([*limits.acceleration, strength]), np.array([*limits.jerk, jerk])
    lower, upper = np.array([*limits.lower, -inf]), np.array([*limits.upper, inf])
    most = MotionLimits(tops, strengths, jerks, lower, upper, braking, _SHARE_OF_LIMITS)

    slope = _hermite(fine, way.length, way.values, way.slopes, 1)
    curvature = _hermite(fine, way.length, way.values, way.slopes, 2)
    highest = np.min(tops / np.maximum(np.abs(slope), 1e-9), 1)
    highest = np.minimum(highest, np.sqrt(np.min(0.5 * strengths / np.maximum(np.abs(curvature), 1e-9), 1)))
    width = max(int(_SMOOTHING / gap / 2.0), 1)
    slowing, cycle = 1.0, CYCLE
    for attempt in range(_ATTEMPTS):
        speed = _smoothed(highest, width) * slowing
        # The time that each look takes at this speed, as the parameter of the jerk-limited motion.
        times = np.concatenate([[0.0], np.cumsum(gap * 0.5 * (1.0 / speed[1:] + 1.0 / speed[:-1]))])
        pace = np.abs(slope) * speed[:, None]
        strongest = float(np.min(0.45 * strengths / np.maximum(np.max(pace, 0), 1e-9)))
        hardest = float(np.min(0.45 * jerks / np.maximum(np.max(pace, 0), 1e-9)))
        ticks, clock = _start_and_end(float(times[-1]), strongest * slowing, hardest * slowing * slowing, cycle)
        along = _hermite(clock, times, fine[:, None], speed[:, None], 0)[:, 0]
        values = _hermite(along, way.length, way.values, way.slopes, 0)
        asked_for = time_demand(values, most)
        # Each of them belongs to a place on the way.
        places = np.clip(np.searchsorted(fine, np.concatenate([[0.0], along, [total] * 2])[: len(asked_for)]), 0, count)
        if float(np.max(asked_for)) <= 1.0:
            break
        if attempt >= _ATTEMPTS // 2:
            slowing /= min(float(np.max(asked_for)), 1.5) * 1.005
            continue
        asked = np.ones(count + 1)
        np.maximum.at(asked, places, asked_for)
        slower = speed / slowing / asked**1.2
        highest = np.where(asked > 1.0, np.minimum(highest, slower), highest)
    else:
        raise CommandRefused(message("path_beyond_limits"))
    return values, ticks


def _smoothed(highest: Array, width: int) -> Array:
    """A speed that changes gradually and is nowhere above ``highest``: the lowest nearby, averaged over as much."""
    edge = np.pad(highest, 2 * width, mode="edge")
    lowest = np.min(np.lib.stride_tricks.sliding_window_view(edge, 2 * width + 1), axis=1)
    once = np.convolve(lowest, np.full(width + 1, 1.0 / (width + 1)), mode="valid")
    return np.convolve(once, np.full(width + 1, 1.0 / (width + 1)), mode="valid")


def _start_and_end(total: float, strength: float, jerk: float, cycle: float) -> tuple[Array, Array]:
    """Times in whole cycles [s], and how far a clock that starts and ends gradually is by then, 0 to ``total`` [s]."""
    plan = InputParameter(1)
    plan.current_position, plan.target_position = [0.0], [total]
    plan.max_velocity, plan.max_acceleration, plan.max_jerk = [1.0], [strength], [jerk]
    motion = Trajectory(1)
    result = Ruckig(1).calculate(plan, motion)
    assert result in (Result.Working, Result.Finished), result  # at rest at both ends there is always one
    count = int(motion.duration / cycle) + 1
    ticks: Array = np.arange(count + 1, dtype=np.float64) * cycle
    return ticks, np.array([motion.at_time(min(tick, motion.duration))[0][0] for tick in ticks.tolist()])


_PLACE = 0.004  # [s] at all joints' highest speeds, between two places at which the speed is decided
_FEWEST_PLACES = 200  # such places
_ACCELERATION_SHARES = (1.0, 0.8, 0.65)  # in step 1: with less of them, less has to be slowed down in step 3
_AVERAGED = 0.7  # of acceleration / jerk: how long each of the two averages is
_SPREAD = 12  # cycles around a place that is passed too fast, over which more time is taken
_EAGERNESS = 0.7  # of the time that is missing there, how much is added in a round
_ROUNDS = 6

NO_PATH_CEILING = 1e6
"""A ceiling that no path comes to [1/s]."""

_UNLIMITED = np.array([NO_PATH_CEILING])


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
    for share in _ACCELERATION_SHARES:
        law = _averaged(_averaged(accelerating_law(path, limits, share, ceiling), width), width)
        gaps = np.ones(len(law) - 1)
        for _ in range(_ROUNDS):
            asked = time_demand(path.at(_stretched(law, gaps))[0], limits)
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
        slower = float(np.max(time_demand(positions, limits)))
        if slower <= 1.0:
            return law, positions
        gaps_of_best = gaps_of_best * (slower + 0.001)
    raise CommandRefused(message("plan_beyond_limits"))


def accelerating_law(path: RoundedPath, limits: MotionLimits, share: float, ceiling: Array = _UNLIMITED) -> Array:
    """The parameter in each cycle on the fastest motion within speeds and a share of the accelerations."""
    count = max(int(path.length / _PLACE), _FEWEST_PLACES)
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
    counted = np.arange(len(law), dtype=float)[:, None]
    at = _hermite(np.minimum(ticks, times[-1]), times, counted, pace[:, None], 0)[:, 0]
    index = np.clip(np.floor(at).astype(int), 0, len(law) - 2)
    t = at - index
    p, q, r, s = (np.pad(law, 1, mode="edge")[index + offset] for offset in range(4))
    value = (1.0 - t) ** 3 * p + (4.0 - 6.0 * t**2 + 3.0 * t**3) * q + t**3 * s
    value = (value + (1.0 + 3.0 * t + 3.0 * t**2 - 3.0 * t**3) * r) / 6.0
    value[0], value[-1] = law[0], law[-1]  # less than a thousandth of a step away
    return np.asarray(value)


_ROOM = 1e-4  # [rad] that every joint has to the end of its range


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


def _speeds_to_stop(room: Array, acceleration: Array, jerk: Array) -> Array:
    """As :func:`yumi.control.motion.joint_steps.speed_to_stop`, for arrays (n, k) of all joints at once."""
    slow = 3.0 * acceleration / jerk
    return np.asarray(0.5 * acceleration * (np.sqrt(slow * slow + 8.0 * np.maximum(room, 0.0) / acceleration) - slow))


def time_demand(positions: Array, limits: MotionLimits) -> Array:
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
    stoppable = _speeds_to_stop(room, *(limits.braking or (limits.acceleration, limits.jerk)))
    speeds = np.abs(first)
    of_speed = np.maximum(
        np.max(speeds / limits.velocity, 1), np.max(speeds / np.maximum(limits.stopping * stoppable, 1e-9), 1)
    )
    of_acceleration = np.sqrt(np.max(np.abs(second) / limits.acceleration, 1))
    of_jerk = np.cbrt(np.max(np.abs(third) / limits.jerk, 1))
    return np.asarray(np.maximum.reduce([of_speed[2:], of_acceleration[1:], of_jerk]))


def _hermite(at: Array, nodes: Array, values: Array, slopes: Array, order: int) -> Array:
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
