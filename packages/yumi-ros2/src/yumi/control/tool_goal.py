"""Goals of a stream for a tool: poses and velocities."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from typing import NamedTuple

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Pose, Side
from abb_protocols.robot.kinematics import compose_poses, pose_distance, tool0_to_body

_TOOL0: Joints = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""The tool that is none, as numbers: position x, y, z [m], quaternion w, x, y, z."""


class ToolGoal(NamedTuple):
    """One message of a stream.

    Attributes:
        session: the EGM session that it is meant for.
        time: when it was given, on the machine's monotonic clock [s].
        is_twist: whether it is a velocity, else a pose.
        is_in_tool: whether the velocity is seen from the tool, else from the body.
        angle: the arm angle to go to with a pose [rad]; NaN keeps it.
        pose: of the tool in the body frame: x, y, z [m], quaternion w, x, y, z.
        twist: velocity x, y, z [m/s], angular velocity x, y, z [rad/s], and of the arm angle [rad/s].
        tool: the tool's frame in tool0, as ``pose``.
        speed: of the tool on this stream, at most [m/s]; NaN is the controller's.
        turning: of its orientation and of the arm angle, at most [rad/s]; NaN is the controller's.
    """

    session: int
    time: float
    is_twist: bool
    is_in_tool: bool
    angle: float
    pose: Joints
    twist: Joints
    tool: Joints = _TOOL0
    speed: float = nan
    turning: float = nan


def _numbers_of(pose: Pose) -> Joints:
    """A pose as seven numbers: x, y, z [m], quaternion w, x, y, z."""
    return (*pose.position, *pose.orientation)


def pose_of(numbers: Joints) -> Pose:
    """The pose of seven numbers."""
    x, y, z, w, qx, qy, qz = numbers
    return Pose((x, y, z), (w, qx, qy, qz))


def pose_goal(session: int, pose: Pose, tool: Pose | None = None, angle: float = nan, time: float = nan) -> ToolGoal:
    """A pose of the tool in the body frame, for :class:`ToolGoal`."""
    return ToolGoal(
        session,
        time,
        False,
        False,
        angle,
        _numbers_of(pose),
        ZERO_JOINTS,
        _TOOL0 if tool is None else _numbers_of(tool),
    )


def twist_goal(
    session: int, twist: Joints, tool: Pose | None = None, *, is_in_tool: bool = False, time: float = nan
) -> ToolGoal:
    """A velocity of the tool and of the arm angle, (7,), for :class:`ToolGoal`."""
    return ToolGoal(session, time, True, is_in_tool, nan, _TOOL0, twist, _TOOL0 if tool is None else _numbers_of(tool))


_NEAR = (0.1, 0.35)
"""A stream of poses that something else has interrupted goes on so far from where the tool is sent [m], [rad]."""


def check_tool_near(side: Side, sent: Joints, goal: ToolGoal) -> None:
    """Refuse a pose at which no stream goes on, of an arm ``sent`` to a position [rad]; raises CommandRefused."""
    if goal.is_twist:
        return
    distance, turn = pose_distance(compose_poses(tool0_to_body(side, sent), pose_of(goal.tool)), pose_of(goal.pose))
    if not (distance <= _NEAR[0] and turn <= _NEAR[1]):  # NaN too
        raise CommandRefused(
            message(
                "tool_stream_begins_elsewhere",
                arm=side.word,
                distance=distance,
                turn=turn,
                most=_NEAR[0],
                most_turn=_NEAR[1],
            )
        )


_HIGHEST = 100.0
"""A velocity beyond this was hardly meant in metres or radians a second; so large ones cannot be calculated with."""


def check_twist(twist: Sequence[float]) -> None:
    """Refuse a velocity that is none; raises CommandRefused."""
    for value in twist:
        if not abs(value) <= _HIGHEST:  # NaN too
            raise CommandRefused(message("twist_implausible", value=f"{value:g}", most=_HIGHEST))
