"""The geometry of RAPID's moves: legs (lines, circles, motions of joints), their corners, and why one is refused.

What one move instruction describes is a `Leg`: a straight line, a circle or a joint motion, and the corner to the next,
sampled close enough that what lies between two samples follows from them; :mod:`virtual_irc5.mechanics.path` adds the
time. A leg is seen as RAPID sees it: the tool in the work object. A straight line is straight there, also where the
robot holds the work object and the tool stands still.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import atan2, ceil, degrees, inf, pi, radians

import numpy as np
import numpy.ma  # np.unique imports it when called first, 80 ms in the middle of a motion
from numpy.typing import NDArray

from abb_protocols.errors import YumiError
from abb_protocols.robot.arm_kinematics import KinematicArm, PathLost
from abb_protocols.robot.joints import ORIGIN_POSE, Joints, Pose
from abb_protocols.robot.kinematics import matrix_from_quaternion, quaternion_from_matrix
from abb_protocols.robot.rotations import rotation_vectors, rotations_about

_Array = NDArray[np.float64]

_SAMPLE_LENGTH = 0.004  # between two samples [m]: at a radius of 0.2 m the chord is 0.01 mm off
_SAMPLE_TURN = 0.05  # the same of the tool and of joints [rad]
_MOST_SAMPLES = 500
_CORNER_SAMPLES = 16
_NO_LENGTH = 1e-6  # [m], [rad]
_WRIST_MARGIN = radians(0.1)
_SHORTEST_CHORD = 1e-4  # [m] between the points of a circle


class MotionFault(Enum):
    """Why a motion is refused: ABB's event number and title."""

    OUT_OF_RANGE = (50027, "Joint Out of Range")
    SINGULAR = (50026, "Close to singularity")
    OUT_OF_REACH = (50050, "Position outside reach")
    CIRCLE = (50063, "Circle uncertain")
    CONFIGURATION = (50080, "Position not compatible")


class MotionRefused(YumiError):
    """A motion cannot be planned.

    Attributes:
        fault: why.
    """

    def __init__(self, fault: MotionFault, sentence: str) -> None:
        super().__init__(f"{sentence} ({fault.value[0]})")
        self.fault = fault


@dataclass(frozen=True, slots=True)
class LegFrames:
    """Which tool moves in which work object.

    Attributes:
        tool: the tool in tool0; where the robot does not hold it, in the world.
        wobj: the work object in the world; where the robot holds it, in tool0.
        robot_holds_tool: whether the tool moves and the work object stands.
    """

    tool: Pose = ORIGIN_POSE
    wobj: Pose = ORIGIN_POSE
    robot_holds_tool: bool = True

    def tool0(self, points: _Array, rotations: _Array) -> tuple[_Array, _Array]:
        """Where tool0 is in the world when the tool is at poses in the object, (n, 3) [m] and (n, 3, 3)."""
        (tool, tool_turn), (wobj, wobj_turn) = _parts(self.tool), _parts(self.wobj)
        if self.robot_holds_tool:
            turned = wobj_turn @ rotations @ tool_turn.T
            return wobj + points @ wobj_turn.T - turned @ tool, turned
        turned = tool_turn @ np.swapaxes(rotations, 1, 2) @ wobj_turn.T
        return tool - (turned @ (wobj + points @ wobj_turn.T)[..., None])[..., 0], turned

    def tip(self, points: _Array, rotations: _Array) -> tuple[_Array, _Array]:
        """Where the tool is in the object when tool0 is at poses in the world."""
        (tool, tool_turn), (wobj, wobj_turn) = _parts(self.tool), _parts(self.wobj)
        if self.robot_holds_tool:
            return (points + rotations @ tool - wobj) @ wobj_turn, wobj_turn.T @ rotations @ tool_turn
        back = np.swapaxes(rotations, 1, 2)
        return ((back @ (tool - points)[..., None])[..., 0] - wobj) @ wobj_turn, wobj_turn.T @ back @ tool_turn


def _parts(pose: Pose) -> tuple[_Array, _Array]:
    return np.array(pose.position), matrix_from_quaternion(pose.orientation)


@dataclass(frozen=True, slots=True)
class LegSpeed:
    """How fast a leg is.

    Attributes:
        tool: of the tool's point [m/s].
        turn: of its orientation [rad/s].
        duration: how long the leg takes instead, RAPID's T [s]; 0 where the speeds count.
    """

    tool: float = inf
    turn: float = inf
    duration: float = 0.0


@dataclass(frozen=True, slots=True)
class CornerZone:
    """How near the tool comes to the end of a leg before it turns to the next one.

    Attributes:
        radius: of the corner about the end [m]; 0 is a stop point.
        turn: where the tool only turns, how far before the end the corner begins [rad].
    """

    radius: float = 0.0
    turn: float = 0.0

    @property
    def is_stop(self) -> bool:
        return self.radius <= 0.0


STOP_CORNER = CornerZone()


@dataclass(frozen=True, eq=False, slots=True)
class PathPiece:
    """A part of the path; where another one follows, its first sample is this one's last.

    Attributes:
        joints: samples [rad], (n, k).
        way: of the tool's point from the first sample [m], (n,).
        turned: of its orientation, likewise [rad], (n,).
        speed: for the intervals between the samples.
    """

    joints: _Array
    way: _Array
    turned: _Array
    speed: LegSpeed

    def part(self, first: int, last: int) -> PathPiece:
        """The samples from ``first`` to ``last``, both in it."""
        part = slice(first, last + 1)
        return PathPiece(
            self.joints[part], self.way[part] - self.way[first], self.turned[part] - self.turned[first], self.speed
        )


LegPlace = Callable[[_Array], tuple[_Array, _Array, _Array]]
"""Points [m], rotations and arm angles [rad] of the tool in the object, at shares 0 to 1 of a leg, (n,)."""


@dataclass(frozen=True, eq=False, slots=True)
class Leg:
    """A planned move.

    Attributes:
        frames: tool and work object.
        zone: at its end.
        shares: of the samples, 0 to 1, (n,).
        piece: the samples.
        place: where the tool is; None for a motion of the joints.
        into: index of the sample where the corner at its beginning may end.
        out: index of the sample where the corner at its end may begin.
    """

    frames: LegFrames
    zone: CornerZone
    shares: _Array
    piece: PathPiece
    place: LegPlace | None
    into: int
    out: int

    @property
    def end(self) -> Joints:
        """Where it ends [rad]."""
        return tuple(self.piece.joints[-1].tolist())

    def joints_at(self, shares: _Array) -> _Array:
        """Joint positions [rad] between the samples, (n, k)."""
        columns = [np.interp(shares, self.shares, column) for column in self.piece.joints.T]
        return np.stack(columns, 1)


def joint_leg(
    arm: KinematicArm,
    start: Joints,
    end: Joints,
    frames: LegFrames,
    speed: LegSpeed,
    zone: CornerZone,
    entry: CornerZone = STOP_CORNER,
) -> Leg:
    """All joints from start to end together: MoveAbsJ and MoveJ.

    Args:
        arm: the arm.
        start: where it begins [rad].
        end: where it ends [rad].
        frames: tool and work object.
        speed: of the tool.
        zone: at its end.
        entry: the zone at its beginning, that of the leg before.

    Raises:
        MotionRefused: a joint would leave its range.
    """
    _check_limits(arm, np.array([end]))
    along = np.array(end) - np.array(start)
    coarse = np.linspace(0.0, 1.0, 17)
    way, _ = _distances(arm, np.array(start) + coarse[:, None] * along, frames)
    shares = _shares(float(way[-1]), 0.0, float(np.max(np.abs(along))))
    way, turned = _distances(arm, np.array(start) + shares[:, None] * along, frames)
    begin, leave = _corner_shares(shares, way, turned, entry, zone)
    shares = np.unique(np.concatenate([shares, [begin, leave]]))
    joints = np.array(start) + shares[:, None] * along
    joints[-1] = end
    way, turned = _distances(arm, joints, frames)
    piece = PathPiece(joints, way, turned, speed)
    into, out = int(np.searchsorted(shares, begin)), int(np.searchsorted(shares, leave))
    return Leg(frames, zone, shares, piece, None, into, out)


def retraced_leg(arm: KinematicArm, joints: _Array, frames: LegFrames, speed: LegSpeed) -> Leg:
    """Through positions that the arm has been at [rad], (n, k), to a stop."""
    way, turned = _distances(arm, joints, frames)
    piece = PathPiece(joints, way, turned, speed)
    return Leg(frames, STOP_CORNER, np.linspace(0.0, 1.0, len(joints)), piece, None, 0, len(joints) - 1)


def line(start: tuple[_Array, _Array, float], end: tuple[_Array, _Array, float]) -> LegPlace:
    """A straight line of the tool's point, with its orientation and the arm angle turning evenly."""
    (point, rotation, angle), (to, to_rotation, to_angle) = start, end
    turn = rotation_vectors((rotation.T @ to_rotation)[None])[0]

    def place(shares: _Array) -> tuple[_Array, _Array, _Array]:
        rotations = rotation @ rotations_about(shares[:, None] * turn)
        return point + shares[:, None] * (to - point), rotations, angle + shares * (to_angle - angle)

    return place


def circle(
    start: tuple[_Array, _Array, float],
    via: tuple[_Array, _Array],
    end: tuple[_Array, _Array, float],
    mode: CircleMode,
) -> LegPlace:
    """An arc of the tool's point from start through ``via`` to end.

    Raises:
        MotionRefused: the three points are too close together, or in a line.
    """
    (first, rotation, angle), (middle, via_rotation), (last, to_rotation, to_angle) = start, via, end
    a, b = middle - first, last - first
    if min(float(np.linalg.norm(each)) for each in (a, b, last - middle)) < _SHORTEST_CHORD:
        raise MotionRefused(
            MotionFault.CIRCLE, "MoveC: two of the circle's three points are in one place. Move them apart."
        )
    normal = np.cross(a, b)
    size = float(np.linalg.norm(normal))
    if size < 1e-4 * float(np.linalg.norm(a)) * float(np.linalg.norm(b)):
        raise MotionRefused(
            MotionFault.CIRCLE, "MoveC: the circle's three points are in a line. Use MoveL, or move one."
        )
    normal = normal / size
    # The centre is as far from all three points.
    centre = first + (np.dot(b, b) * np.cross(np.cross(a, b), a) + np.dot(a, a) * np.cross(b, np.cross(a, b))) / (
        2.0 * size * size
    )
    x = first - centre
    y = np.cross(normal, x)
    sweep = atan2(float(y @ (last - centre)), float(x @ (last - centre))) % (2.0 * pi)
    at_via = atan2(float(y @ (middle - centre)), float(x @ (middle - centre))) % (2.0 * pi)

    if mode is CircleMode.POINT:
        turn_to_via = rotation_vectors((rotation.T @ via_rotation)[None])[0]
        turn_to_end = rotation_vectors((via_rotation.T @ to_rotation)[None])[0]
        share_of_via = at_via / sweep
    relative_end = to_rotation
    if mode is CircleMode.PATH:
        relative_end = rotations_about(-sweep * normal[None])[0] @ to_rotation
    turn = rotation_vectors((rotation.T @ relative_end)[None])[0]
    if mode is CircleMode.PATH:  # as the tool turns in the object on the shortest way, beside its turn with the path
        own = rotation_vectors((rotation.T @ to_rotation)[None])[0]
        turn = _with_turns(turn, own - sweep * (rotation.T @ normal))

    def place(shares: _Array) -> tuple[_Array, _Array, _Array]:
        angles = shares[:, None] * sweep
        points = centre + np.cos(angles) * x + np.sin(angles) * y
        if mode is CircleMode.POINT:
            to_via = rotation @ rotations_about(np.minimum(shares / share_of_via, 1.0)[:, None] * turn_to_via)
            rest = np.maximum((shares - share_of_via) / (1.0 - share_of_via), 0.0)
            rotations = to_via @ rotations_about(rest[:, None] * turn_to_end)
        else:
            rotations = rotation @ rotations_about(shares[:, None] * turn)
            if mode is CircleMode.PATH:
                rotations = rotations_about(angles * normal) @ rotations
        return points, rotations, angle + shares * (to_angle - angle)

    return place


def _with_turns(vector: _Array, near: _Array) -> _Array:
    """The rotation vector of the same rotation, with as many whole turns as bring it near another one [rad]."""
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle > _NO_LENGTH else near / max(float(np.linalg.norm(near)), _NO_LENGTH)
    turns = round((float(near @ axis) - angle) / (2.0 * pi))
    return np.asarray(vector + axis * (turns * 2.0 * pi))


class CircleMode(Enum):
    """How the tool turns on a circle (CirPathMode): with the path, evenly in the object, or through the via point."""

    PATH = "PathFrame"
    OBJECT = "ObjectFrame"
    POINT = "CirPointOri"


def tool_leg(
    arm: KinematicArm,
    start: Joints,
    place: LegPlace,
    frames: LegFrames,
    speed: LegSpeed,
    zone: CornerZone,
    entry: CornerZone = STOP_CORNER,
    *,
    passes_wrist: bool = False,
) -> Leg:
    """The tool along a line or circle: MoveL and MoveC; arguments as of `joint_leg`.

    It may pass an aligned wrist with ``passes_wrist`` (SingArea Wrist).

    Raises:
        MotionRefused: the path leaves the reach or the range of a joint, or goes through a singularity.
    """
    points, rotations, _ = place(np.linspace(0.0, 1.0, 33))
    length = float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    shares = _shares(length, float(np.sum(_turns(rotations))), 0.0)
    points, rotations, _ = place(shares)
    way, turned = _cumulated(np.linalg.norm(np.diff(points, axis=0), axis=1)), _cumulated(_turns(rotations))
    begin, leave = _corner_shares(shares, way, turned, entry, zone)
    shares = np.unique(np.concatenate([shares, [begin, leave]]))
    points, rotations, angles = place(shares)
    joints = followed(arm, points, rotations, angles, frames, start)
    if arm.spherical_wrist is not None and not passes_wrist and _is_aligned(joints[:, arm.spherical_wrist]):
        axis = arm.axes[arm.spherical_wrist]
        sentence = f"The path of the {arm.name} passes axis {axis} at 0°. Use MoveJ, or SingArea\\Wrist."
        raise MotionRefused(MotionFault.SINGULAR, sentence)
    way, turned = _cumulated(np.linalg.norm(np.diff(points, axis=0), axis=1)), _cumulated(_turns(rotations))
    into, out = int(np.searchsorted(shares, begin)), int(np.searchsorted(shares, leave))
    return Leg(frames, zone, shares, PathPiece(joints, way, turned, speed), place, into, out)


def corner(arm: KinematicArm, before: Leg, after: Leg) -> PathPiece:
    """From where the zone at the end of a leg begins to where it ends on the next leg: C1, inside the zone.

    Both legs are passed slower and slower towards the corner point, the second one backwards, and added: of two lines
    that is a parabola.

    Raises:
        MotionRefused: as of `tool_leg`.
    """
    out, into = float(before.shares[before.out]), float(after.shares[after.into])
    span = float(before.piece.way[-1] - before.piece.way[before.out] + after.piece.way[after.into])
    count = max(_CORNER_SAMPLES, min(_MOST_SAMPLES, ceil(span / _SAMPLE_LENGTH)))
    time = np.linspace(0.0, 1.0, count + 1)
    first, second = 1.0 - (1.0 - out) * (1.0 - time) ** 2, into * time**2
    if before.place is not None and after.place is not None and before.frames == after.frames:
        (points, rotations, angles), (to, to_rotations, to_angles) = before.place(first), after.place(second)
        points = points + to - to[0]
        rotations = rotations @ to_rotations[0].T @ to_rotations
        seed = tuple(before.piece.joints[before.out].tolist())
        joints = followed(arm, points, rotations, angles + to_angles - to_angles[0], after.frames, seed)
        way, turned = _cumulated(np.linalg.norm(np.diff(points, axis=0), axis=1)), _cumulated(_turns(rotations))
    else:
        joints = before.joints_at(first) + after.joints_at(second) - after.piece.joints[0]
        _check_limits(arm, joints)
        way, turned = _distances(arm, joints, after.frames)
    joints[0], joints[-1] = before.piece.joints[before.out], after.piece.joints[after.into]
    return PathPiece(joints, way, turned, before.piece.speed)


def followed(
    arm: KinematicArm, points: _Array, rotations: _Array, angles: _Array, frames: LegFrames, start: Joints
) -> _Array:
    """Joint positions [rad], (n, k), on a path of the tool.

    Raises:
        MotionRefused: as of `tool_leg`.
    """
    at, turned = frames.tool0(points, rotations)
    try:
        joints = arm.follow(at, turned, angles, start)
    except PathLost as lost:
        x, y, z = at[lost.index].tolist()
        pose = Pose((x, y, z), quaternion_from_matrix(turned[lost.index]))
        where = f"[{x * 1e3:.1f}, {y * 1e3:.1f}, {z * 1e3:.1f}] mm (tool0 in the base frame)"
        if arm.postures(pose, float(angles[lost.index])):
            sentence = f"The path of the {arm.name} passes a singularity near {where}. Use MoveJ, or another target."
            raise MotionRefused(MotionFault.SINGULAR, sentence) from lost
        sentence = f"The {arm.name} does not reach {where}. Choose a target within reach."
        raise MotionRefused(MotionFault.OUT_OF_REACH, sentence) from lost
    _check_limits(arm, joints)
    return joints


def _is_aligned(wrist: _Array) -> bool:
    """Whether a wrist's middle axis [rad] comes to zero or changes its sign."""
    return bool(np.min(np.abs(wrist)) < _WRIST_MARGIN or np.any(wrist[:-1] * wrist[1:] < 0.0))


def _check_limits(arm: KinematicArm, joints: _Array) -> None:
    """Raise MotionRefused where a sample, (n, k), is out of the joints' range."""
    lower, upper = np.array(arm.limits.lower), np.array(arm.limits.upper)
    beyond = np.maximum(lower - joints, joints - upper)
    if float(beyond.max()) <= 1e-6:
        return
    sample, index = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    raise MotionRefused(
        MotionFault.OUT_OF_RANGE,
        f"Axis {arm.axes[index]} of the {arm.name} cannot move to {degrees(joints[sample, index]):.2f}°: its range is "
        f"{arm.limits.range_deg(int(index))}.",
    )


def _shares(length: float, turn: float, joint_turn: float) -> _Array:
    count = ceil(max(length / _SAMPLE_LENGTH, turn / _SAMPLE_TURN, joint_turn / _SAMPLE_TURN))
    return np.linspace(0.0, 1.0, max(4, min(_MOST_SAMPLES, count)) + 1)


def _corner_shares(
    shares: _Array, way: _Array, turned: _Array, entry: CornerZone, zone: CornerZone
) -> tuple[float, float]:
    """Where the corner at the beginning ends, and where that at the end begins; each has half the leg at most."""
    by_way = float(way[-1]) > _NO_LENGTH
    measure = way if by_way else turned
    total = float(measure[-1])
    if total <= _NO_LENGTH:
        return 0.0, 1.0
    begin, leave = (min(each.radius if by_way else each.turn, total / 2.0) for each in (entry, zone))
    return float(np.interp(begin, measure, shares)), float(np.interp(total - leave, measure, shares))


def _distances(arm: KinematicArm, joints: _Array, frames: LegFrames) -> tuple[_Array, _Array]:
    """Way [m] and turn [rad] of the tool from the first of joint positions on, (n,) each."""
    points, rotations = frames.tip(*arm.forward(joints))
    return _cumulated(np.linalg.norm(np.diff(points, axis=0), axis=1)), _cumulated(_turns(rotations))


def _turns(rotations: _Array) -> _Array:
    return np.asarray(np.linalg.norm(rotation_vectors(np.swapaxes(rotations[:-1], 1, 2) @ rotations[1:]), axis=1))


def _cumulated(steps: _Array) -> _Array:
    return np.concatenate([[0.0], np.cumsum(steps)])
