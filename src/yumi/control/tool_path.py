"""Paths of an arm, timed within the limits of joints and tool: straight lines of the tool, and lines in joint space.

:func:`plan_path` plans lines of the tool in three steps, all before the motion begins and outside of the control
process:

1. :class:`ToolPath` says where the tool is and how the elbow is turned: straight lines with the orientation along the
   geodesic, and corners rounded within a zone, as a function of a parameter that grows with the time the tool would
   take at its own speed.
2. `_followed` goes along it with all joints, in steps of equal size of joints and parameter together. So steps are
   short where joints have to move much for little of the way (near singularities), and a way that turns back there is
   found, not jumped over.
3. `_timed` slows down where a joint would be too fast, accelerate or jerk too hard: first by a speed along the way
   that changes gradually, then by a jerk-limited start and end (Ruckig) in the time this leaves.

What results is a :class:`yumi.control.trajectory.ArmPlan` like that of any trajectory: it is followed, scaled, stopped
and judged by the same controller. :class:`ToolLimits` is what a tool must keep wherever it is led, on lines or by
streams.

A plan in joints is a chain of straight lines; :class:`RoundedPath` rounds its corners, so that it can be passed at
speed. :func:`fastest_along` passes it as fast as the joints' speeds, accelerations and jerks allow, in three steps:

1. the fastest time law that keeps speeds and accelerations, by one sweep from the end and one from the start
   (J. Bobrow, 1985; the sweeps as in TOPP-RA, H. Pham, 2018). It changes accelerations at once.
2. the average of it over the time in which a jerk builds an acceleration up, twice: accelerations change gradually.
3. more time where a jerk is still too high, and only there.

What a motion asks of the joints is judged for both by :func:`demand`, by the differences from cycle to cycle, as the
limiter sees them.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from math import fsum, hypot, inf, isfinite, pi, tau
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Result, Ruckig, Trajectory

from yumi.catalogue import Message, message
from yumi.control.trajectory import ArmPlan, TrajectoryPoint, smooth_spline_through
from yumi.errors import CommandRefused
from yumi.robot.differential_kinematics import rotated_to_foot, target_error, wrist_of, wrist_target
from yumi.robot.inverse_kinematics import Unreachable
from yumi.robot.joints import CYCLE, JointLimits, Joints, Pose, Side, Vector, joint_names, joints, rotate
from yumi.robot.kinematics import (
    FLANGE,
    IDENTITY,
    compose,
    inverse,
    multiply,
    quaternion_of,
    rotation_vector,
    tool0_to_body,
)

Array = NDArray[np.float64]
Number = TypeVar("Number", float, Array)

FASTEST = 1.5
"""The tool's highest speed [m/s], ABB's for this robot."""

SPEED = 0.25
"""Of the tool where nothing else is asked for [m/s]: what a robot may have beside people in manual mode."""

TURNING = 1.5
"""Speed of the tool's orientation where nothing else is asked for [rad/s]."""

ZONE = 0.01
"""Corners of a path are rounded from so far before them [m], as RAPID's z10."""

_AT_WALL = 1e-6  # [m] a tool so little beyond a wall is at it
_ELBOW_TURNS = tuple(sign * each for each in (0.17, 0.35, 0.7, 1.05, 1.4) for sign in (1.0, -1.0))  # [rad] of the elbow
_ACCELERATION, _JERK = 2.5, 50.0  # of the tool [m/s²], [m/s³]
_ROTATION_ACCELERATION, _ROTATION_JERK = 15.0, 300.0  # [rad/s²], [rad/s³]
_TOOL0 = Pose((0.0, 0.0, 0.0), IDENTITY)
_FARTHEST = 3.0  # [m] from the body: a pose beyond was hardly meant in metres
_KNOTS = 3  # cycles between two points of the plan: between them a spline is within a thousandth of a millimetre


class Wall(NamedTuple):
    """A plane with its free side.

    Attributes:
        name: of the settings.
        point: on it, in the body frame [m].
        normal: of length 1, to the side where the tool may be.
    """

    name: str
    point: Vector
    normal: Vector

    def distance(self, place: Sequence[float]) -> float:
        """How far a place is on the free side [m]; below 0 beyond the wall."""
        rows = zip(self.normal, place[:3], self.point, strict=True)
        return fsum([n * (p - at) for n, p, at in rows])

    def towards(self, velocity: Sequence[float]) -> float:
        """How fast a velocity leads towards the wall [m/s]."""
        return -fsum([n * v for n, v in zip(self.normal, velocity[:3], strict=True)])

    def moved(self, vector: Sequence[float], by: float) -> Vector:
        """A place or velocity, changed by so much along the normal."""
        x, y, z = (value + by * n for value, n in zip(vector[:3], self.normal, strict=True))
        return (x, y, z)


@dataclass(frozen=True, slots=True)
class ToolLimits:
    """The limits of a tool's centre point.

    Attributes:
        speed: at most [m/s].
        walls: that it stays behind.
    """

    speed: float = FASTEST
    walls: tuple[Wall, ...] = ()


class ToolLimited(NamedTuple):
    """A report: a wall holds a tool that follows a stream.

    Attributes:
        wall: its name.
    """

    wall: str

    def __str__(self) -> str:
        return str(self.said)

    @property
    def said(self) -> Message:
        """The report for a person."""
        return message("tool_held_by_wall", wall=self.wall)


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Where a path goes.

    Attributes:
        tool: pose of the tool in the body frame.
        angle: the arm angle [rad]; None keeps that of the point before.
    """

    tool: Pose
    angle: float | None = None


# ---- the whole plan


def plan_path(
    side: Side,
    start: Joints,
    waypoints: Sequence[Waypoint],
    limits: JointLimits,
    *,
    tool: Pose = _TOOL0,
    speed: float = SPEED,
    turning: float = TURNING,
    zone: float = ZONE,
    acceleration: float = 1.0,
    within: ToolLimits = ToolLimits(),
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
    here = Waypoint(tool0_to_body(side, start, tool), now.angle)
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
                Waypoint(each.tool, now.angle + elbow * number / len(waypoints))
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
    values, ticks = _timed(way, limits, rates, acceleration)
    knots = sorted({*range(0, len(ticks), _KNOTS), len(ticks) - 1})
    points = [TrajectoryPoint(float(ticks[index]), joints(values[index, :7].tolist())) for index in knots]
    points[0] = TrajectoryPoint(0.0, start)
    return ArmPlan(side, points[0], smooth_spline_through(points), None)


def _check_request(
    waypoints: Sequence[Waypoint], speed: float, turning: float, zone: float, acceleration: float
) -> None:
    if not waypoints:
        raise CommandRefused(message("path_without_poses"))
    for number, waypoint in enumerate(waypoints, 1):
        checked_pose(waypoint.tool, f"pose {number}")
        if waypoint.angle is not None and not isfinite(waypoint.angle):
            raise CommandRefused(message("path_angle_not_finite", pose=number, angle=str(waypoint.angle)))
    for name, value, lowest, highest, unit in (
        ("speed", speed, 1e-4, FASTEST, "m/s"),
        ("turning speed", turning, 1e-3, 2.0 * pi, "rad/s"),
        ("zone", zone, 0.0, 1.0, "m"),
        ("acceleration", acceleration, 0.01, 1.0, "of the highest"),
    ):
        if not lowest <= value <= highest:
            raise CommandRefused(
                message("path_value_out_of_range", name=name, value=value, lowest=lowest, highest=highest, unit=unit)
            )


def _check_walls(waypoints: Sequence[Waypoint], within: ToolLimits) -> None:
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


# ---- where the tool is

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

    def __init__(self, waypoints: Sequence[Waypoint], speed: float, turning: float, zone: float) -> None:
        self._first = waypoints[0]
        self._points: list[Pose] = [waypoints[0].tool]
        self._angles = [waypoints[0].angle or 0.0]
        self._lines: list[_Line] = []
        for waypoint in waypoints[1:]:
            here, angle = self._points[-1], self._angles[-1]
            way = tuple(b - a for a, b in zip(here.position, waypoint.tool.position, strict=True))
            w, x, y, z = here.orientation
            turn = rotation_vector(multiply((w, -x, -y, -z), waypoint.tool.orientation))
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
        first = multiply(point.orientation, quaternion_of(before.rotation, past))
        (ux, uy, uz), (vx, vy, vz) = before.rotation, after.rotation
        return _At(
            Pose(
                (px + past * ax + gone * bx, py + past * ay + gone * by, pz + past * az + gone * bz),
                multiply(first, quaternion_of(after.rotation, gone)),
            ),
            angle + past * before.turning + gone * after.turning,
            (rate * ax + weight * bx, rate * ay + weight * by, rate * az + weight * bz),
            rotate(first, (rate * ux + weight * vx, rate * uy + weight * vy, rate * uz + weight * vz)),
            rate * before.turning + weight * after.turning,
        )


# ---- along the path with all joints

_LONGEST_STEP = 0.02  # [s] of joints at their speeds and the tool at its own
_SHORTEST_STEP = 1e-6
_STRAIGHT = 2e-4  # by so much a step may be corrected, in the same unit
_CONVERGED = 1e-11
_FARTHEST_OFF = 0.1  # of a guess
_TURNS_BACK = 1e-9
_MOST_STEPS = 20_000


class _Followed(NamedTuple):
    """All joints along a path: by the length of the way, the joints [rad] and the parameter, (n, 8), and their slopes.

    The length counts each joint in the time it takes at its highest speed, and the parameter as it is.
    """

    length: Array
    values: Array
    slopes: Array


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
        self._to_tool0 = inverse(tool)

    def at(self, values: Array) -> tuple[Array, Array]:
        """What is missing, (7,), and how that grows with each of the eight, (7, 8)."""
        side, at = self._side, self._path.at(float(values[7]))
        tool0 = compose(at.tool, self._to_tool0)
        now = wrist_of(side, joints(values[:7].tolist()))
        # The tool's velocity, at the wrist: from the tool to tool0, and back by the flange.
        arm = rotate(at.tool.orientation, self._to_tool0.position)
        back = rotate(tool0.orientation, (0.0, 0.0, -FLANGE))
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


def _followed(side: Side, path: ToolPath, start: Joints, tool: Pose, limits: JointLimits) -> _Followed:
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
    return _Followed(np.array(lengths), np.array(found), np.array(slopes) * unit)


def _unreachable(side: Side, path: ToolPath, values: Array, why: Message) -> Unreachable:
    parameter = float(values[7])
    x, y, z = path.at(parameter).tool.position
    return Unreachable(
        message("path_unreachable", arm=side.word, share=parameter / path.length, x=x, y=y, z=z, reason=why)
    )


# ---- when the joints are there

_FINE = 0.003  # [s] between two looks at the way
_ATTEMPTS = 40
_SMOOTHING = 0.12  # [s] over which the speed along the way changes
_SHARE_OF_LIMITS = 0.9  # of the joints' limits: the limiter looks at what robot and reference add up to


def _timed(way: _Followed, limits: JointLimits, rates: tuple[float, float], scale: float) -> tuple[Array, Array]:
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

    slope = hermite(fine, way.length, way.values, way.slopes, 1)
    curvature = hermite(fine, way.length, way.values, way.slopes, 2)
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
        along = hermite(clock, times, fine[:, None], speed[:, None], 0)[:, 0]
        values = hermite(along, way.length, way.values, way.slopes, 0)
        asked_for = demand(values, most)
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


# ---- lines in joint space

_PLACE = 0.004  # [s] at all joints' highest speeds, between two places at which the speed is decided
_FEWEST_PLACES = 200  # such places
_ACCELERATION_SHARES = (1.0, 0.8, 0.65)  # in step 1: with less of them, less has to be slowed down in step 3
_AVERAGED = 0.7  # of acceleration / jerk: how long each of the two averages is
_SPREAD = 12  # cycles around a place that is passed too fast, over which more time is taken
_EAGERNESS = 0.7  # of the time that is missing there, how much is added in a round
_ROUNDS = 6

UNLIMITED = 1e6
"""A ceiling that no path comes to [1/s]."""

_UNLIMITED = np.array([UNLIMITED])


class RoundedPath:
    """Straight lines from corner to corner in joint space, with the corners rounded: its curvature does not jump.

    Args:
        corners: (n, k) [rad], at least two, none twice in a row.
        unit: what a joint's way is counted in, (k,) [rad]: with the joints' speeds, the path's parameter is a time.
        deviation: how far a rounded corner may lie from the sharp one [rad].

    Attributes:
        length: of the path in its parameter.
    """

    def __init__(self, corners: Array, unit: Array, deviation: float) -> None:
        ways = np.diff(corners, axis=0)
        lengths = np.linalg.norm(ways / unit, axis=1)
        self._corners, self._slopes = corners, ways / lengths[:, None]
        self._lengths, self._begins = lengths, np.concatenate([[0.0], np.cumsum(lengths)])
        self.length = float(self._begins[-1])
        self._zones = np.zeros(len(corners))
        change = np.max(np.abs(np.diff(self._slopes, axis=0)), axis=1, initial=1e-9)
        halfway = rounding(0.5, 1.0)[1]
        self._zones[1:-1] = np.minimum(0.5 * np.minimum(lengths[:-1], lengths[1:]), deviation / (halfway * change))

    def sharpen(self, places: Array) -> bool:
        """Round the corners nearest to these parameters half as much; whether there is one that was rounded."""
        distance = np.abs(places[:, None] - self._begins)
        corners = np.unique(np.argmin(distance, 1)[np.min(distance / np.maximum(self._zones, 1e-12), 1) < 1.0])
        self._zones[corners] *= 0.5
        return bool(np.any(self._zones[corners] > 1e-4))

    def at(self, parameters: Array) -> tuple[Array, Array, Array]:
        """Positions, and their first and second derivatives, (n, k) each."""
        last = len(self._lengths) - 1
        line = np.clip(np.searchsorted(self._begins, parameters, side="right") - 1, 0, last)
        past = parameters - self._begins[line]
        slope = self._slopes[line]
        position, curvature = self._corners[line] + past[:, None] * slope, np.zeros_like(slope)
        corner = np.where(past < 0.5 * self._lengths[line], line, line + 1)
        near = np.abs(parameters - self._begins[corner]) < self._zones[corner]
        corner, zone = corner[near], self._zones[corner[near]]
        past = parameters[near] - self._begins[corner]
        share = (past + zone) / (2.0 * zone)
        weight, gone = (each[:, None] for each in rounding(share, zone))
        before, after = self._slopes[corner - 1], self._slopes[np.minimum(corner, last)]
        position[near] = self._corners[corner] + (past[:, None] - gone) * before + gone * after
        slope[near] = (1.0 - weight) * before + weight * after
        curvature[near] = (15.0 * share**2 * (1.0 - share) ** 2 / zone)[:, None] * (after - before)
        return position, slope, curvature


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
            asked = demand(path.at(_stretched(law, gaps))[0], limits)
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
        slower = float(np.max(demand(positions, limits)))
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
    at = hermite(np.minimum(ticks, times[-1]), times, np.arange(len(law), dtype=float)[:, None], pace[:, None], 0)[:, 0]
    index = np.clip(np.floor(at).astype(int), 0, len(law) - 2)
    t = at - index
    p, q, r, s = (np.pad(law, 1, mode="edge")[index + offset] for offset in range(4))
    value = (1.0 - t) ** 3 * p + (4.0 - 6.0 * t**2 + 3.0 * t**3) * q + t**3 * s
    value = (value + (1.0 + 3.0 * t + 3.0 * t**2 - 3.0 * t**3) * r) / 6.0
    value[0], value[-1] = law[0], law[-1]  # less than a thousandth of a step away
    return np.asarray(value)


# ---- for both: corners, limits, and what a motion asks of the joints

_ROOM = 1e-4  # [rad] that every joint has to the end of its range


def rounding(share: Number, zone: float | Array) -> tuple[Number, Number]:
    """How a corner is rounded: how much of the next line's direction is taken, and how far one has come along it.

    Args:
        share: of the way through the corner, 0 to 1.
        zone: half the length of this way.
    """
    weight = share**3 * (10.0 - 15.0 * share + 6.0 * share * share)
    return weight, 2.0 * zone * share**4 * (2.5 - 3.0 * share + share * share)  # type: ignore[return-value]


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


def speeds_to_stop(room: Array, acceleration: Array, jerk: Array) -> Array:
    """As :func:`yumi.control.motion.speed_to_stop`, for arrays (n, k) of all joints at once."""
    slow = 3.0 * acceleration / jerk
    return np.asarray(0.5 * acceleration * (np.sqrt(slow * slow + 8.0 * np.maximum(room, 0.0) / acceleration) - slow))


def demand(positions: Array, limits: MotionLimits) -> Array:
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
    stoppable = speeds_to_stop(room, *(limits.braking or (limits.acceleration, limits.jerk)))
    speeds = np.abs(first)
    of_speed = np.maximum(
        np.max(speeds / limits.velocity, 1), np.max(speeds / np.maximum(limits.stopping * stoppable, 1e-9), 1)
    )
    of_acceleration = np.sqrt(np.max(np.abs(second) / limits.acceleration, 1))
    of_jerk = np.cbrt(np.max(np.abs(third) / limits.jerk, 1))
    return np.asarray(np.maximum.reduce([of_speed[2:], of_acceleration[1:], of_jerk]))


def hermite(at: Array, nodes: Array, values: Array, slopes: Array, order: int) -> Array:
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
