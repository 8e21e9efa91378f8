"""Straight lines of a tool: what is asked for, and the plan of the joints.

:func:`plan_path` plans in three steps, all before the motion begins and outside of the control process:

1. :class:`ToolPath` says where the tool is and how the elbow is turned: straight lines with the orientation along the
   geodesic, and corners rounded within a zone, as a function of a parameter that grows with the time the tool would
   take at its own speed.
2. `_followed` goes along it with all joints, in steps of equal size of joints and parameter together. So steps are
   short where joints have to move much for little of the way (near singularities), and a way that turns back there is
   found, not jumped over.
3. :func:`yumi.planning.path_timing.timed_along` decides when the joints are where.

What results is a :class:`yumi.control.trajectory_commands.ArmPlan` like that of any trajectory: it is followed, scaled,
stopped and judged by the same controller.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, inf, isfinite, pi, tau
from typing import NamedTuple

import numpy as np

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.differential_kinematics import rotated_to_foot, target_error, wrist_of, wrist_target
from abb_protocols.robot.inverse_kinematics import Unreachable
from abb_protocols.robot.joints import ORIGIN_POSE, JointLimits, Joints, Pose, Side, Vector, joint_names, joints, rotate
from abb_protocols.robot.kinematics import (
    FLANGE_OFFSET,
    compose_poses,
    inverse_pose,
    quaternion_of,
    quaternion_product,
    rotation_vector,
    tool0_to_body,
)
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.motion.spline_limits import check_motion
from yumi.control.tool_limits import TOP_TOOL_SPEED, ToolLimits
from yumi.control.trajectory_commands import ArmPlan
from yumi.planning.common_time import ended_together
from yumi.planning.path_timing import JointPath, timed_along
from yumi.planning.rounded_path import Array, rounding
from yumi.planning.smoothing import smooth_spline_through

TOOL_SPEED = 0.25
"""Of the tool where nothing else is asked for [m/s]: what a robot may have beside people in manual mode."""

TOOL_TURNING = 1.5
"""Speed of the tool's orientation where nothing else is asked for [rad/s]."""

TOOL_ZONE = 0.01
"""Corners of a path are rounded from so far before them [m], as RAPID's z10."""

_AT_WALL = 1e-6  # [m] a tool so little beyond a wall is at it
_ELBOW_TURNS = tuple(sign * each for each in (0.17, 0.35, 0.7, 1.05, 1.4) for sign in (1.0, -1.0))  # [rad] of the elbow
_ACCELERATION, _JERK = 2.5, 50.0  # of the tool [m/s²], [m/s³]
_ROTATION_ACCELERATION, _ROTATION_JERK = 15.0, 300.0  # [rad/s²], [rad/s³]
_FARTHEST = 3.0  # [m] from the body: a pose beyond was hardly meant in metres
_KNOTS = 3  # cycles between two points of the plan: between them a spline is within a thousandth of a millimetre


@dataclass(frozen=True, slots=True)
class LineWaypoint:
    """Where a path goes.

    Attributes:
        tool: pose of the tool in the body frame.
        angle: the arm angle [rad]; None keeps that of the point before.
    """

    tool: Pose
    angle: float | None = None


@dataclass(frozen=True)
class ToolMotion:
    """What one arm's tool does, along straight lines.

    Attributes:
        tool: its frame in tool0.
        waypoints: where it goes, in the body frame.
        speed: of the tool [m/s].
        turning: of its orientation [rad/s].
        zone: corners are rounded from so far before them [m].
        acceleration: share of the highest accelerations and jerks.
    """

    tool: Pose
    waypoints: tuple[LineWaypoint, ...]
    speed: float = TOOL_SPEED
    turning: float = TOOL_TURNING
    zone: float = TOOL_ZONE
    acceleration: float = 1.0


def plan_tool_motions(
    motions: Mapping[Side, ToolMotion], starts: Mapping[Side, Joints], limits: JointLimits, within: ToolLimits
) -> Mapping[Side, ArmPlan]:
    """The motions of both arms or of one from where they stand; both end together. Raises as :func:`plan_path`.

    Args:
        motions: of each arm's tool.
        starts: where the arms stand [rad], (7,) each.
        limits: of the joints.
        within: what the tools keep.
    """
    return ended_together(
        {
            side: plan_path(
                side,
                starts[side],
                motion.waypoints,
                limits,
                tool=motion.tool,
                speed=motion.speed,
                turning=motion.turning,
                zone=motion.zone,
                acceleration=motion.acceleration,
                within=within,
            )
            for side, motion in motions.items()
        }
    )


def plan_path(
    side: Side,
    start: Joints,
    waypoints: Sequence[LineWaypoint],
    limits: JointLimits,
    *,
    tool: Pose = ORIGIN_POSE,
    speed: float = TOOL_SPEED,
    turning: float = TOOL_TURNING,
    zone: float = TOOL_ZONE,
    acceleration: float = 1.0,
    within: ToolLimits = ToolLimits(),  # noqa: B008 - it is frozen
) -> ArmPlan:
    """The motion of an arm that stands, along straight lines of its tool through waypoints.

    Args:
        side: the arm.
        start: where it stands [rad], (7,).
        waypoints: where to, from where the tool is now.
        limits: of the joints.
        tool: the tool's frame in tool0.
        speed: the tool's highest [m/s].
        turning: the highest speed of its orientation and of the elbow [rad/s].
        zone: corners are rounded from so far before them [m].
        acceleration: factor on accelerations and jerks, above 0 up to 1.
        within: what the tool keeps wherever it goes: it is not faster than that, whatever ``speed`` is.

    Raises:
        CommandRefused: a value is not finite or out of bounds, or the path leads through a wall.
        Unreachable: the arm cannot follow the lines; the sentence says from where on.
    """
    _check_request(waypoints, speed, turning, zone, acceleration)
    speed = min(speed, within.speed)
    now = wrist_of(side, start)
    here = LineWaypoint(tool0_to_body(side, start, tool), now.angle)
    _check_walls([here, *waypoints], within)
    path = ToolPath([here, *waypoints], speed, turning, zone)
    if path.length == 0.0:
        point = TrajectoryPoint(0.0, start)
        return ArmPlan(side, point, smooth_spline_through([point]), None)
    try:
        way = _followed(side, path, start, tool, limits)
    except Unreachable:
        if any(each.angle is not None for each in waypoints):
            raise
        # Where no arm angle is asked for, the elbow is free: it turns along the way, as little as helps.
        for elbow in _ELBOW_TURNS:
            turned = [
                LineWaypoint(each.tool, now.angle + elbow * number / len(waypoints))
                for number, each in enumerate(waypoints, 1)
            ]
            path = ToolPath([here, *turned], speed, turning, zone)
            with suppress(Unreachable):
                way = _followed(side, path, start, tool, limits)
                break
        else:
            raise
    rates = (
        min(_ACCELERATION / speed, _ROTATION_ACCELERATION / turning),
        min(_JERK / speed, _ROTATION_JERK / turning),
    )
    values, ticks = timed_along(way, limits, rates, acceleration)
    knots = sorted({*range(0, len(ticks), _KNOTS), len(ticks) - 1})
    points = [TrajectoryPoint(float(ticks[index]), joints(values[index, :7].tolist())) for index in knots]
    points[0] = TrajectoryPoint(0.0, start)
    spline = smooth_spline_through(points)
    check_motion(spline.segments, joint_names(side), limits)
    return ArmPlan(side, points[0], spline, None)


def _check_request(
    waypoints: Sequence[LineWaypoint], speed: float, turning: float, zone: float, acceleration: float
) -> None:
    if not waypoints:
        raise CommandRefused(message("path_without_poses"))
    for number, waypoint in enumerate(waypoints, 1):
        checked_pose(waypoint.tool, f"pose {number}")
        if waypoint.angle is not None and not isfinite(waypoint.angle):
            raise CommandRefused(message("path_angle_not_finite", pose=number, angle=str(waypoint.angle)))
    for name, value, lowest, highest, unit in (
        ("speed", speed, 1e-4, TOP_TOOL_SPEED, "m/s"),
        ("turning speed", turning, 1e-3, 2.0 * pi, "rad/s"),
        ("zone", zone, 0.0, 1.0, "m"),
        ("acceleration", acceleration, 0.01, 1.0, "of the highest"),
    ):
        if not lowest <= value <= highest:
            raise CommandRefused(
                message("path_value_out_of_range", name=name, value=value, lowest=lowest, highest=highest, unit=unit)
            )


def _check_walls(waypoints: Sequence[LineWaypoint], within: ToolLimits) -> None:
    """Refuse lines through walls. A wall is a plane: between two places on its free side no line and no corner is not.

    A tool that is beyond a wall already may not get further.
    """
    for wall in within.walls:
        places = [each.tool.position for each in waypoints]
        for number, (before, after) in enumerate(pairwise(places), 1):
            beyond = -wall.distance(after)
            if beyond > max(0.0, -wall.distance(before)) + _AT_WALL:
                raise CommandRefused(message("path_through_wall", pose=number, distance=beyond, wall=wall.name))


def checked_pose(pose: Pose, name: str = "the pose") -> Pose:
    """A pose with an orientation of exactly length 1: numbers that were written down or sent are rounded.

    Raises:
        CommandRefused: a value is not finite, the orientation not a unit quaternion, or the place far away.
    """
    if not all(map(isfinite, (*pose.position, *pose.orientation))):
        raise CommandRefused(message("pose_not_finite", pose=name))
    distance = hypot(*pose.position)
    if distance > _FARTHEST:
        raise CommandRefused(message("pose_too_far", pose=name, distance=distance, farthest=_FARTHEST))
    length = hypot(*pose.orientation)
    if abs(length - 1.0) > 1e-3:
        raise CommandRefused(message("pose_not_unit", pose=name, length=length))
    w, x, y, z = pose.orientation
    return Pose(pose.position, (w / length, x / length, y / length, z / length))


_SHARPEST = 1e-4  # [m] of a corner that is passed without a stop


class _At(NamedTuple):
    """The path at one parameter: pose and arm angle, and how they change with it."""

    tool: Pose
    angle: float
    velocity: Vector
    rotation: Vector
    turning: float


class _Line(NamedTuple):
    """A line between two waypoints: its length in the parameter, and what changes per unit of it.

    ``rotation`` is seen from the tool.
    """

    length: float
    velocity: Vector
    rotation: Vector
    turning: float


class ToolPath:
    """Straight lines from waypoint to waypoint.

    Args:
        waypoints: at least two, each with its arm angle.
        speed: of the tool [m/s].
        turning: of its orientation and of the elbow [rad/s].
        zone: corners are rounded from so far before them [m]; a tenth of a millimetre at least.

    Attributes:
        length: the time the tool takes without any limits of the joints [s]; 0 where nothing moves.
    """

    def __init__(self, waypoints: Sequence[LineWaypoint], speed: float, turning: float, zone: float) -> None:
        self._first = waypoints[0]
        self._points: list[Pose] = [waypoints[0].tool]
        self._angles = [waypoints[0].angle or 0.0]
        self._lines: list[_Line] = []
        for waypoint in waypoints[1:]:
            here, angle = self._points[-1], self._angles[-1]
            way = tuple(b - a for a, b in zip(here.position, waypoint.tool.position, strict=True))
            w, x, y, z = here.orientation
            turn = rotation_vector(quaternion_product((w, -x, -y, -z), waypoint.tool.orientation))
            elbow = 0.0 if waypoint.angle is None else (waypoint.angle - angle + pi) % tau - pi
            length = max(hypot(*way) / speed, hypot(*turn) / turning, abs(elbow) / turning)
            if length < 1e-6:
                continue
            x, y, z = (each / length for each in way)
            u, v, w = (each / length for each in turn)
            self._lines.append(_Line(length, (x, y, z), (u, v, w), elbow / length))
            self._points.append(waypoint.tool)
            self._angles.append(angle + elbow)
        self._begins = [0.0]
        for line in self._lines:
            self._begins.append(self._begins[-1] + line.length)
        self.length = self._begins[-1]
        self._zones = [0.0] * len(self._points)
        for index, (before, after) in enumerate(zip(self._lines, self._lines[1:], strict=False), 1):
            # In the parameter: on both sides as long, at most half of the shorter line.
            fastest = max(hypot(*before.velocity), hypot(*after.velocity), 1e-9)
            self._zones[index] = min(max(zone, _SHARPEST) / fastest, 0.5 * before.length, 0.5 * after.length)

    def at(self, parameter: float) -> _At:
        """Where the tool is at ``parameter``, 0 to :attr:`length`."""
        if not self._lines:
            return _At(self._points[0], self._angles[0], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
        index = 0
        while index < len(self._lines) - 1 and parameter > self._begins[index + 1]:
            index += 1
        # The nearer end of the line decides whether it is in the zone of a corner.
        corner = index if parameter - self._begins[index] < 0.5 * self._lines[index].length else index + 1
        if abs(parameter - self._begins[corner]) >= self._zones[corner] or not 0 < corner < len(self._lines):
            line, past = self._lines[index], parameter - self._begins[index]
            return self._near(index, past, 0.0, 1.0, 0.0, line, line)
        zone = self._zones[corner]
        past = parameter - self._begins[corner]
        weight, gone = rounding((past + zone) / (2.0 * zone), zone)
        before, after = self._lines[corner - 1], self._lines[corner]
        return self._near(corner, past - gone, gone, 1.0 - weight, weight, before, after)

    def _near(
        self, index: int, past: float, gone: float, rate: float, weight: float, before: _Line, after: _Line
    ) -> _At:
        """From a waypoint by ``past`` along one line and by ``gone`` along another."""
        point, angle = self._points[index], self._angles[index]
        (px, py, pz), (ax, ay, az), (bx, by, bz) = point.position, before.velocity, after.velocity
        first = quaternion_product(point.orientation, quaternion_of(before.rotation, past))
        (ux, uy, uz), (vx, vy, vz) = before.rotation, after.rotation
        return _At(
            Pose(
                (px + past * ax + gone * bx, py + past * ay + gone * by, pz + past * az + gone * bz),
                quaternion_product(first, quaternion_of(after.rotation, gone)),
            ),
            angle + past * before.turning + gone * after.turning,
            (rate * ax + weight * bx, rate * ay + weight * by, rate * az + weight * bz),
            rotate(first, (rate * ux + weight * vx, rate * uy + weight * vy, rate * uz + weight * vz)),
            rate * before.turning + weight * after.turning,
        )


_LONGEST_STEP = 0.02  # [s] of joints at their speeds and the tool at its own
_SHORTEST_STEP = 1e-6
_STRAIGHT = 2e-4  # by so much a step may be corrected, in the same unit
_CONVERGED = 1e-11
_FARTHEST_OFF = 0.1  # of a guess
_TURNS_BACK = 1e-9
_MOST_STEPS = 20_000


class _Equations:
    """The seven equations along a path, of the joints and the parameter in their units, (8,).

    Args:
        side: the arm.
        path: of its tool.
        tool: the tool's frame in tool0.
        unit: what the eight are counted in.
    """

    def __init__(self, side: Side, path: ToolPath, tool: Pose, unit: Array) -> None:
        self._side, self._path, self._unit = side, path, unit
        self._to_tool0 = inverse_pose(tool)

    def at(self, values: Array) -> tuple[Array, Array]:
        """What is missing, (7,), and how that grows with each of the eight, (7, 8)."""
        side, at = self._side, self._path.at(float(values[7]))
        tool0 = compose_poses(at.tool, self._to_tool0)
        now = wrist_of(side, joints(values[:7].tolist()))
        # The tool's velocity, at the wrist: from the tool to tool0, and back by the flange.
        arm = rotate(at.tool.orientation, self._to_tool0.position)
        back = rotate(tool0.orientation, (0.0, 0.0, -FLANGE_OFFSET))
        (rx, ry, rz), (vx, vy, vz) = at.rotation, at.velocity
        ux, uy, uz = (a + b for a, b in zip(arm, back, strict=True))
        velocity = rotated_to_foot(side, (vx + ry * uz - rz * uy, vy + rz * ux - rx * uz, vz + rx * uy - ry * ux))
        rates = [*velocity, *rotated_to_foot(side, at.rotation), at.turning]
        with_joints = np.array([*now.velocity, *now.rotation, now.elbow])
        left = target_error(now, wrist_target(side, tool0, at.angle))
        return np.array(left), np.column_stack([-with_joints, rates]) * self._unit

    def slope(self, values: Array, before: Array) -> Array:
        """The direction in which nothing is missing any more, (8,), of length 1, going on as ``before``."""
        direction = np.linalg.svd(self.at(values)[1])[2][-1]
        return np.asarray(direction * np.copysign(1.0, float(direction @ before)))

    def solved(self, guess: Array, across: Array, end: float | None) -> tuple[Array, float]:
        """The solution near a guess, and how far it lies from there; infinitely far where there is none.

        It is looked for across a direction, or at a parameter ``end``.
        """
        correction, row = 0.0, across if end is None else np.eye(8)[7]
        for _ in range(8):
            left, derivative = self.at(guess)
            off = 0.0 if end is None else end - guess[7]
            try:
                change = np.linalg.solve(np.vstack([derivative, row]), np.array([*-left, off]))
            except np.linalg.LinAlgError:
                break
            size = float(np.max(np.abs(change)))
            if not size < _FARTHEST_OFF:
                break
            guess, correction = guess + change * self._unit, max(correction, size)
            if size < _CONVERGED:
                return guess, correction
        return guess, inf


def _followed(side: Side, path: ToolPath, start: Joints, tool: Pose, limits: JointLimits) -> JointPath:
    """From ``start``, which is at the begin of the path.

    Raises:
        Unreachable: the path leaves the reach of the arm, or the range of a joint.
    """
    unit = np.array([*limits.velocity, 1.0])
    equations = _Equations(side, path, tool, unit)
    values = np.array([*start, 0.0])
    slope = equations.slope(values, np.eye(8)[7])
    found, slopes, lengths, step = [values], [slope], [0.0], _LONGEST_STEP / 4.0
    while values[7] < path.length:
        is_last = bool(values[7] + step * slope[7] >= path.length)
        if is_last:
            step = min(step, max((path.length - values[7]) / slope[7], _SHORTEST_STEP))
        after, correction = equations.solved(values + step * slope * unit, slope, path.length if is_last else None)
        if correction > _STRAIGHT and step > _SHORTEST_STEP:
            step *= 0.5
            continue
        onward = slope if correction == inf else equations.slope(after, slope)
        if correction == inf or len(found) > _MOST_STEPS or (onward[7] < _TURNS_BACK and not is_last):
            raise _unreachable(side, path, values, message("arm_stretched_out"))
        outside = limits.outside(joints(after[:7].tolist()))
        if outside is not None:
            why = message(
                "joint_leaves_range",
                joint=joint_names(side)[outside],
                position=float(after[outside]),
                lower=limits.lower[outside],
                upper=limits.upper[outside],
            )
            raise _unreachable(side, path, after, why)
        values, slope = after, onward
        found.append(values)
        slopes.append(slope)
        lengths.append(lengths[-1] + step)
        if correction < 0.3 * _STRAIGHT:
            step = min(1.5 * step, _LONGEST_STEP)
    return JointPath(np.array(lengths), np.array(found), np.array(slopes) * unit)


def _unreachable(side: Side, path: ToolPath, values: Array, why: Message) -> Unreachable:
    parameter = float(values[7])
    x, y, z = path.at(parameter).tool.position
    return Unreachable(
        message("path_unreachable", arm=side.word, share=parameter / path.length, x=x, y=y, z=z, reason=why)
    )
