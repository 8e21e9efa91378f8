"""Joint positions in degrees, by ABB's axis numbers or by joint name; all else is in radians and in chain order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees as _degrees_of
from math import radians
from typing import Any, SupportsFloat

from yumi.errors import CommandRefused
from yumi.robot.joints import CHAIN_AXES, JOINT_COUNT, Joints, Side, chain_from_abb, joint_names, joints


def degrees(*angles: SupportsFloat | Sequence[SupportsFloat]) -> Joints:
    """Joint positions given in degrees, as radians: ``yumi.degrees(0, -130, -135, 30, 0, 40, 0)``.

    Seven angles, or one sequence of them, in chain order (axes 1, 2, 7, 3, 4, 5, 6), not the FlexPendant's: for J1 to
    J7 as the FlexPendant shows them take :func:`abb_degrees`. Raises ValueError when they are not seven.
    """
    return joints([radians(value) for value in _flat(angles)])


def abb_degrees(
    j1: SupportsFloat,
    j2: SupportsFloat,
    j3: SupportsFloat,
    j4: SupportsFloat,
    j5: SupportsFloat,
    j6: SupportsFloat,
    *,
    j7: SupportsFloat,
) -> Joints:
    """Joint positions as the FlexPendant and RobotStudio show them, by ABB's numbers of the axes.

    ::

        robot.right.move_to(yumi.abb_degrees(0, -130, 30, 0, 40, 0, j7=-135))

    Axis 7 (``eax_a`` in RAPID) sits between axes 2 and 3. It has to be named, so that seven
    numbers in chain order are never taken for ABB's.

    Returns:
        Radians in chain order (axes 1, 2, 7, 3, 4, 5, 6), (7,).
    """
    return joints(
        [
            radians(float(value))
            for value in chain_from_abb([float(each) for each in (j1, j2, j3, j4, j5, j6)], float(j7))
        ]
    )


def in_degrees(position: Sequence[SupportsFloat]) -> Joints:
    """Joint positions [rad], (7,), in degrees; raises ValueError when they are not seven."""
    return joints([_degrees_of(value) for value in _flat((position,))])


def _flat(angles: Sequence[Any]) -> list[float]:
    """Seven angles as they are, or the one sequence of them: a list, a tuple, an array."""
    values = angles[0] if len(angles) == 1 and hasattr(angles[0], "__iter__") else angles
    return [float(value) for value in values]


def in_chain_order(side: Side, values: Mapping[str, Any] | Sequence[Any]) -> Sequence[Any]:
    """Values of all joints of an arm in chain order: a mapping by joint name, or a sequence that is in this order.

    A joint is named as in ROS (``yumi_joint_7_r``), or by ABB's number of its axis (``joint_7``, ``j7``).

    Raises:
        CommandRefused: a name is not one of this arm's joints, comes twice, or is missing.
    """
    if not isinstance(values, Mapping):
        return values
    found: dict[int, Any] = {}
    for name, value in values.items():
        index = _index(side, name)
        if index in found:
            raise CommandRefused(f"Goal refused: {joint_names(side)[index]} is named twice; give each joint once.")
        found[index] = value
    missing = [name for index, name in enumerate(joint_names(side)) if index not in found]
    if missing:
        raise CommandRefused(f"Goal refused: without {', '.join(missing)}; name all {JOINT_COUNT} joints.")
    return [found[index] for index in range(JOINT_COUNT)]


def _index(side: Side, name: object) -> int:
    """Place of a named joint in the chain."""
    names = joint_names(side)
    if name in joint_names(side.other):
        raise CommandRefused(
            f"Goal refused: {name!r} is a joint of the {side.other.word} arm, and this is the {side.word} arm."
        )
    for index, (full, axis) in enumerate(zip(names, CHAIN_AXES, strict=True)):
        if name in (full, f"joint_{axis}", f"j{axis}"):
            return index
    raise CommandRefused(
        f"Goal refused: {str(name)[:60]!r} is not a joint of the {side.word} arm; it has {', '.join(names)}, or j1 to "
        f"j{JOINT_COUNT}."
    )
