"""Joint positions as scripts give them: in degrees, in the order of ABB, by joint name, or by the name of a pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees as _degrees_of
from math import radians
from typing import Any, SupportsFloat

from abb_protocols.catalogue import message, quoted, said_by
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import (
    CHAIN_AXES,
    JOINT_COUNT,
    Joints,
    Side,
    chain_from_abb,
    joint_names,
    joints,
    named_pose,
)
from yumi.control.goals import check_position
from yumi.control.motion.spline import TrajectoryPoint
from yumi.planning.trajectory_request import check_trajectory_length

Position = Sequence[SupportsFloat] | Mapping[str, SupportsFloat] | str
"""Joint positions [rad]: a list, a tuple or an array of all seven in chain order (axes 1, 2, 7, 3, 4, 5, 6); a mapping
by joint name (``yumi_joint_7_r``, ``joint_7`` or ``j7``), in which joints that are left out stay where they are; or the
name of a pose (``"home"``)."""


TimedPosition = Sequence[Any]
"""A time since the begin [s], the joint positions then [rad], and, if wanted, velocities [rad/s] and accelerations."""


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


def _in_chain_order(
    side: Side, values: Mapping[str, Any] | Sequence[Any], others: Joints | None = None
) -> Sequence[Any]:
    """Values of all joints of an arm in chain order: a mapping by joint name, or a sequence that is in this order.

    A joint is named as in ROS (``yumi_joint_7_r``), or by ABB's number of its axis (``joint_7``, ``j7``). Joints that a
    mapping leaves out are taken from ``others``; with None it must name all. A string is the name of a pose of
    :data:`abb_protocols.robot.joints.POSES`.

    Raises:
        CommandRefused: a name is not one of this arm's joints, comes twice, or is missing.
    """
    if isinstance(values, str):
        return named_pose(side, values)
    if not isinstance(values, Mapping):
        return values
    found: dict[int, Any] = {}
    for name, value in values.items():
        index = _index(side, name)
        if index in found:
            raise CommandRefused(
                message("goal_refused", reason=message("joint_named_twice", name=joint_names(side)[index]))
            )
        found[index] = value
    missing = [name for index, name in enumerate(joint_names(side)) if index not in found]
    if missing and others is None:
        raise CommandRefused(message("trajectory_point_without_joints", missing=tuple(missing), joints=JOINT_COUNT))
    return [found[index] if index in found else others[index] for index in range(JOINT_COUNT)]  # type: ignore[index]


def _index(side: Side, name: object) -> int:
    """Place of a named joint in the chain."""
    names = joint_names(side)
    if name in joint_names(side.other):
        raise CommandRefused(message("goal_joint_of_other_arm", joint=name, arm=side.word, other=side.other.word))
    for index, (full, axis) in enumerate(zip(names, CHAIN_AXES, strict=True)):
        if name in (full, f"joint_{axis}", f"j{axis}"):
            return index
    raise CommandRefused(message("goal_joint_unknown", joint=str(name), arm=side.word, joints=names, count=JOINT_COUNT))


def timed_points(side: Side, points: Sequence[TimedPosition]) -> tuple[TrajectoryPoint, ...]:
    try:
        check_trajectory_length(len(points))
        return tuple(
            TrajectoryPoint(float(time), *(tuple(map(float, _in_chain_order(side, each))) for each in values))
            for time, *values in points
        )
    except (TypeError, ValueError) as error:
        raise CommandRefused(message("trajectory_points_malformed", error=said_by(error))) from error


def checked_goal(side: Side, goal: Position, others: Joints) -> Joints:
    """``goal`` [rad] in chain order; raises CommandRefused when it is not seven joints within their ranges.

    It may be the name of a pose, too, or some joints by name: those that it leaves out are taken from ``others``.
    """
    try:
        values = [float(value) for value in _in_chain_order(side, goal, others)]
    except (TypeError, ValueError) as error:
        raise CommandRefused(message("goal_not_angles", given=quoted(goal))) from error
    if len(values) != JOINT_COUNT:
        raise CommandRefused(
            message("goal_joint_count_of_arm", count=len(values), joints=JOINT_COUNT, names=joint_names(side))
        )
    for index, (name, value) in enumerate(zip(joint_names(side), values, strict=True)):
        check_position(name, index, value)
    return joints(values)
