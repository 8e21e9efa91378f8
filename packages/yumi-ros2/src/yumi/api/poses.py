"""Poses as scripts give them: numbers, frames of tools and work objects, arm angles, waypoints of lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, isfinite, nan
from typing import Any, SupportsFloat

from abb_protocols.catalogue import Message, message, quoted
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.joints import ORIGIN_POSE, Pose, Quaternion, Side
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION, compose_poses, euler_zyx, quaternion_from_euler_zyx
from yumi.planning.tool_path import LineWaypoint, checked_pose

PoseLike = Pose | Sequence[SupportsFloat]
"""A pose: a :class:`abb_protocols.robot.joints.Pose`, or seven numbers x, y, z [m] and the quaternion w, x, y, z."""

TOOL0 = ORIGIN_POSE


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ToolPose(Pose):
    """A pose that says of what it is: where a tool is in the robot's base frame; equal to any pose of the same numbers.

    Attributes:
        tool: its name, or what else is known of it.
        side: the arm that carries it.
    """

    tool: str
    side: Side

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Pose):
            return NotImplemented
        return (self.position, self.orientation) == (other.position, other.orientation)

    def __hash__(self) -> int:
        return hash((self.position, self.orientation))

    def __repr__(self) -> str:
        x, y, z = (f"{value * 1e3:.1f} mm" for value in self.position)
        roll, pitch, yaw = (f"{degrees(value):.1f}°" for value in euler_zyx(self.orientation))
        return (
            f"<yumi.Pose {self.tool} of the {self.side.word} arm in the base frame: x {x}, y {y}, z {z}, "
            f"roll {roll}, pitch {pitch}, yaw {yaw}>"
        )


def pose(
    x: float,
    y: float,
    z: float,
    quaternion: Sequence[SupportsFloat] | None = None,
    *,
    rpy: Sequence[SupportsFloat] | None = None,
) -> Pose:
    """A pose: ``yumi.pose(0.4, -0.2, 0.2, rpy=(math.pi, 0, 0))`` is a tool that points down.

    Args:
        x: the place [m].
        y: see x.
        z: see x.
        quaternion: the orientation as w, x, y, z; it need not have the length 1.
        rpy: the orientation as roll, pitch, yaw about x, y, z [rad], as in URDF.

    Raises:
        CommandRefused: both or a wrong number of values are given, or one is not finite.
    """
    if quaternion is not None and rpy is not None:
        raise CommandRefused(message("pose_orientation_twice"))
    orientation: Quaternion = IDENTITY_QUATERNION
    if rpy is not None:
        roll, pitch, yaw = numbers_from(rpy, 3, "rpy")
        orientation = quaternion_from_euler_zyx((roll, pitch, yaw))
    elif quaternion is not None:
        w, i, j, k = numbers_from(quaternion, 4, "quaternion")
        length = (w * w + i * i + j * j + k * k) ** 0.5
        if not 1e-6 < length < 1e6:
            raise CommandRefused(message("pose_quaternion_without_direction"))
        orientation = (w / length, i / length, j / length, k / length)
    x, y, z = numbers_from((x, y, z), 3, "its place")
    return checked_pose(Pose((x, y, z), orientation))


def pose_from(given: PoseLike) -> Pose:
    """A pose as this package has it; raises CommandRefused when it is none."""
    if isinstance(given, Pose):
        return checked_pose(given)
    x, y, z, *quaternion = numbers_from(given, 7, "pose")
    return checked_pose(Pose((x, y, z), (quaternion[0], quaternion[1], quaternion[2], quaternion[3])))


def poses_from(given: PoseLike | Sequence[PoseLike]) -> Sequence[PoseLike]:
    """One pose or several as several."""
    if isinstance(given, Pose) or (len(given) and isinstance(given[0], SupportsFloat)):
        return [given]  # type: ignore[list-item]
    return given  # type: ignore[return-value]


def numbers_from(values: Any, count: int, name: Message | str) -> list[float]:
    """So many finite numbers as they are; raises CommandRefused when they are not."""
    try:
        numbers = [float(each) for each in values]
    except (TypeError, ValueError) as error:
        raise CommandRefused(message("pose_values_no_numbers", name=name, given=quoted(values), count=count)) from error
    if len(numbers) != count or not all(map(isfinite, numbers)):
        raise CommandRefused(message("pose_values_not_finite", name=name, given=quoted(values), count=count))
    return numbers


@dataclass
class PoseFrames:
    """Tools and work objects of a robot by name; scripts add their own.

    Attributes:
        tools: frames of tools in tool0, RAPID's ``tframe``.
        work_objects: frames in the robot's body, in which poses may be given.
    """

    tools: dict[str, PoseLike] = field(default_factory=lambda: {"tool0": TOOL0, "fingertips": FINGERTIPS})
    work_objects: dict[str, PoseLike] = field(default_factory=lambda: {"wobj0": TOOL0})

    def tool(self, given: PoseLike | str) -> Pose:
        """The frame of a tool, by name or given itself."""
        return _named(given, self.tools, is_tool=True)

    def work_object(self, given: PoseLike | str | None) -> Pose:
        """The frame of a work object; None is the body's."""
        return TOOL0 if given is None else _named(given, self.work_objects, is_tool=False)


def _named(given: PoseLike | str, known: Mapping[str, PoseLike], *, is_tool: bool) -> Pose:
    if not isinstance(given, str):
        return pose_from(given)
    if given not in known:
        raise CommandRefused(
            message("tool_name_unknown" if is_tool else "work_object_unknown", name=given, known=tuple(known))
        )
    return pose_from(known[given])


def checked_angle(angle: SupportsFloat) -> float:
    """An arm angle as a number [rad]; raises CommandRefused when it is none."""
    try:
        number = float(angle)
    except (TypeError, ValueError):
        number = nan
    if not isfinite(number):
        raise CommandRefused(message("pose_angle_not_finite", given=quoted(angle)))
    return number


def waypoints_from(
    frames: PoseFrames, poses: Sequence[PoseLike], work_object: PoseLike | str | None, angle: float | None
) -> tuple[LineWaypoint, ...]:
    """Poses given in a work object as waypoints in the body frame; the arm angle is that of the last."""
    base = frames.work_object(work_object)
    points = [LineWaypoint(compose_poses(base, pose_from(each))) for each in poses]
    if points and angle is not None:
        points[-1] = replace(points[-1], angle=checked_angle(angle))
    return tuple(points)
