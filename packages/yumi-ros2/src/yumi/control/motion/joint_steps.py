"""One step of the joints at a time, by the core: to goals, to rest on a braking path, and speeds that follow others.

- :func:`step_towards`: one step after goals that may move; :func:`step_to_rest`: one step of braking.
- :func:`ramp_speed`: a speed that follows another.
- :func:`braking_path`: where a joint comes to that brakes; :func:`speed_to_stop`: how fast it may be to stop in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import c_double
from functools import lru_cache
from itertools import chain
from typing import NamedTuple

from abb_protocols.robot.joints import JointLimits
from yumi.control.motion.setpoint import Setpoint
from yumi.core.library import LIMITS_STRUCT, SETPOINT_STRUCT, load


def step_towards(
    now: Setpoint, goal: Setpoint, limits: JointLimits, dt: float, enabled: Sequence[bool]
) -> Setpoint | None:
    """Where the ``enabled`` joints are after ``dt`` [s] on their quickest ways to their goals; None if none was found.

    Each joint moves for itself. A goal that moves is caught up with and followed without lag: ``core/motion.hpp``.

    Args:
        now: where the joints are.
        goal: where the goals are at the end of the step; slower and weaker than the limits.
        limits: of the joints.
        dt: how long the step is [s].
        enabled: which joints move; the others' values in the result mean nothing.
    """
    reached = (c_double * 21)()
    arguments = (
        _packed_limits(limits),
        SETPOINT_STRUCT.pack(*chain(*now)),
        SETPOINT_STRUCT.pack(*chain(*goal)),
        dt,
        bytes(enabled),
    )
    return _setpoint(list(reached)) if load().motion_step_towards(*arguments, reached) else None


def step_to_rest(now: Setpoint, limits: JointLimits, dt: float, enabled: Sequence[bool]) -> Setpoint:
    """Where the ``enabled`` joints are after ``dt`` [s] of braking as hard as they may."""
    after = (c_double * 21)()
    load().motion_step_to_rest(_packed_limits(limits), SETPOINT_STRUCT.pack(*chain(*now)), dt, bytes(enabled), after)
    return _setpoint(list(after))


@lru_cache(64)
def _packed_limits(limits: JointLimits) -> bytes:
    return LIMITS_STRUCT.pack(*limits.lower, *limits.upper, *limits.velocity, *limits.acceleration, *limits.jerk)


def _setpoint(values: Sequence[float]) -> Setpoint:
    return Setpoint(tuple(values[:7]), tuple(values[7:14]), tuple(values[14:]))


class BrakingPath(NamedTuple):
    """The way of a joint that brakes, seen from where it is [rad].

    Attributes:
        lowest: how far it gets backwards, ≤ 0; a joint may have to turn round before it rests.
        highest: how far it gets forwards, ≥ 0.
        end: where it rests, between both.
    """

    lowest: float
    highest: float
    end: float


def braking_path(velocity: float, acceleration: float, top: float, jerk: float) -> BrakingPath:
    """The quickest way to standstill from ``velocity`` [rad/s] and ``acceleration`` [rad/s²], at most ``top``.

    ``top`` and ``jerk`` are > 0.
    """
    path = (c_double * 3)()
    load().motion_braking_path(velocity, acceleration, top, jerk, path)
    return BrakingPath(*path)


def speed_to_stop(room: float, acceleration: float, jerk: float) -> float:
    """How fast a joint may be that has ``room`` [rad] to stop in [rad/s].

    The inverse of the way it needs at most, v/2 · (v/a + 3a/j): its acceleration may have to be turned round first.
    """
    return float(load().motion_speed_to_stop(room, acceleration, jerk))


def ramp_speed(
    goal: float, last: float, rate: float, top: float, acceleration: float, jerk: float, dt: float
) -> tuple[float, float]:
    """The speed after ``dt`` [s] and its rate of change, on the way from ``last`` to ``goal`` [rad/s].

    A goal that changes smoothly is followed at once, as far as it does not rise too quickly to stay below the highest.

    Args:
        goal: the speed to come to; one that is no number is 0.
        last: the speed so far.
        rate: its rate of change so far [rad/s²].
        top: highest speed.
        acceleration: highest rate of change [rad/s²].
        jerk: highest change of that rate [rad/s³].
        dt: time that passes [s] > 0.
    """
    ramp = (c_double * 2)()
    load().motion_ramp_speed(goal, last, rate, top, acceleration, jerk, dt, ramp)
    speed, change = ramp
    return speed, change
