"""Where a joint comes to that brakes as hard as its acceleration and its jerk allow."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple


class Reach(NamedTuple):
    """How far a joint still goes until it stands, to either side of where it is [rad]; ``lowest`` ≤ 0 ≤ ``highest``."""

    lowest: float
    highest: float


def speed_to_come(acceleration: float, jerk: float) -> float:
    """By how much a joint's speed still changes while its acceleration is taken back to zero [rad/s], at least 0."""
    return acceleration * acceleration / (2.0 * jerk)


def braking_reach(velocity: float, acceleration: float, top: float, jerk: float) -> Reach:
    """The way to standstill from ``velocity`` [rad/s] and ``acceleration`` [rad/s²].

    Args:
        velocity: now.
        acceleration: now, at most ``top``.
        top: the joint's highest acceleration, > 0.
        jerk: its highest jerk [rad/s³], > 0.
    """
    left = speed_to_come(acceleration, jerk)
    if velocity + (left if acceleration > 0.0 else -left) < 0.0:
        lowest, highest = _reach_forwards(-velocity, -acceleration, top, jerk)
        return Reach(-highest, -lowest)
    return _reach_forwards(velocity, acceleration, top, jerk)


def _reach_forwards(velocity: float, acceleration: float, top: float, jerk: float) -> Reach:
    """The same for a joint that goes forwards when its acceleration is taken back.

    The way is that of a joint without acceleration, seen from the moment in which it has, or would have had, none.
    """
    speed, time = velocity + speed_to_come(acceleration, jerk), abs(acceleration) / jerk
    pause = sqrt(speed / jerk) if jerk * speed <= top * top else 0.5 * (speed / top + top / jerk)
    if acceleration >= 0.0:
        ahead = time * (velocity + time * (acceleration / 2.0 - time * jerk / 6.0))
    else:
        ahead = -time * (speed - time * time * jerk / 6.0)
    back = _way_to_turn(velocity, acceleration, jerk) if velocity < 0.0 else 0.0
    return Reach(back, speed * pause + ahead)


def _way_to_turn(velocity: float, acceleration: float, jerk: float) -> float:
    """How far a joint still goes backwards whose acceleration turns it around while it is taken back, < 0."""
    time = (acceleration - sqrt(max(acceleration * acceleration + 2.0 * jerk * velocity, 0.0))) / jerk
    return time * (velocity + time * (acceleration / 2.0 - time * jerk / 6.0))
