"""Messages with commands for an arm to checked values: what a person may ask of the joints, and the refusals."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, isfinite
from typing import Any

from yumi.control.goals import UNKNOWN, check_position
from yumi.errors import CommandRefused
from yumi.robot.joints import JOINT_COUNT, Joints, Side, joint_names, joints
from yumi.robot.limits import YUMI_LIMITS
from yumi.robot.values import ZERO

_IN_RADIANS = "joint_commands takes radians"
_DEGREES_ABOVE = 3.0  # times what a joint reaches [rad/s]: so far from it a speed was hardly meant in radians
_LONGEST_NAME = 60  # characters of somebody else's text in a refusal


def goal_of(message: Any, side: Side, base: Joints) -> Joints:
    """The joint goal [rad] in a ``joint_commands`` message; joints it does not name keep their value of ``base``.

    Raises:
        CommandRefused: an unknown or repeated joint, a missing or impossible position or velocity.
    """
    indices = _indices(message.name, message.position, side, "Goal", "position")
    goal = list(base)
    for index, position in zip(indices, message.position, strict=True):
        check_position(joint_names(side)[index], index, position, _IN_RADIANS)
        goal[index] = position
    return joints(goal)


def goal_speeds_of(message: Any, side: Side) -> Joints:
    """How fast the goal of a ``joint_commands`` message itself moves [rad/s]; NaN where it does not say so.

    Raises:
        CommandRefused: velocities that do not go with the names, or are impossible.
    """
    if not len(message.velocity):
        return UNKNOWN
    return joints(_by_name(message.name, message.velocity, side, "Goal", UNKNOWN))


def velocities_of(message: Any, side: Side) -> Joints:
    """The speeds [rad/s] in a ``joint_velocity_commands`` message; joints it does not name stop.

    Raises:
        CommandRefused: an unknown or repeated joint, a missing or impossible velocity.
    """
    return joints(_by_name(message.name, message.velocity, side, "Speed", ZERO))


def positions_of(message: Any, side: Side) -> Joints:
    """The positions [rad] in a Float64MultiArray, one for each joint.

    Raises:
        CommandRefused: another number of them, or an impossible one.
    """
    values = _seven(message, "Goal")
    for index, (name, position) in enumerate(zip(joint_names(side), values, strict=True)):
        check_position(name, index, position)
    return values


def speeds_of(message: Any, side: Side) -> Joints:
    """The speeds [rad/s] in a Float64MultiArray, one for each joint.

    Raises:
        CommandRefused: another number of them, or an impossible one.
    """
    values = _seven(message, "Speed")
    for index, (name, velocity) in enumerate(zip(joint_names(side), values, strict=True)):
        _check_velocity(name, index, velocity, "Speed")
    return values


def _seven(message: Any, noun: str) -> Joints:
    if len(message.data) != JOINT_COUNT:
        raise CommandRefused(f"{noun} refused: it has {len(message.data)} values; an arm has {JOINT_COUNT} joints.")
    return joints(message.data)


def _by_name(names: Sequence[str], values: Sequence[float], side: Side, noun: str, base: Joints) -> list[float]:
    indices = _indices(names, values, side, noun, "velocity")
    found = list(base)
    for index, velocity in zip(indices, values, strict=True):
        _check_velocity(joint_names(side)[index], index, velocity, noun)
        found[index] = velocity
    return found


def _indices(names: Sequence[str], values: Sequence[float], side: Side, noun: str, what: str) -> list[int]:
    """Places of the named joints in chain order."""
    if not names or len(names) != len(values):
        raise CommandRefused(
            f"{noun} refused: name has {_entries(len(names))}, {what} has {len(values)}; give one {what} for each name."
        )
    known = {name: index for index, name in enumerate(joint_names(side))}
    for name in names:
        if name not in known:
            raise CommandRefused(
                f"{noun} refused: {name[:_LONGEST_NAME]!r} is not a joint of the {side.word} arm; it has "
                f"{', '.join(known)}."
            )
    if len(set(names)) != len(names):
        twice = next(name for name in known if names.count(name) > 1)
        raise CommandRefused(f"{noun} refused: {twice} is named twice; give each joint once.")
    return [known[name] for name in names]


def _entries(count: int) -> str:
    return f"{count} {'entry' if count == 1 else 'entries'}"


def _check_velocity(name: str, index: int, velocity: float, noun: str) -> None:
    if not isfinite(velocity):
        raise CommandRefused(f"{noun} refused: {name} is {velocity}; a speed is a finite number of radians a second.")
    top = YUMI_LIMITS.velocity[index]
    if abs(velocity) <= top:
        return
    refusal = f"{noun} refused: {name} is {degrees(velocity):.1f}°/s; it reaches {degrees(top):.0f}°/s"
    if _DEGREES_ABOVE * top < abs(velocity) <= degrees(top):
        refusal += f"; {velocity:g} looks like degrees: speeds are in radians a second"
    raise CommandRefused(f"{refusal}.")
