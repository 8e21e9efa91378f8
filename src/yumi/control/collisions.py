"""Keeps both arms apart from each other, from the body and from what stands around the robot.

The invariant, kept in every cycle for whatever moves the arms: if both arms brake now as hard as they may, no two parts
come nearer to each other than the margin. A command is sent only if the whole of its way to rest is clear of the whole
of the other arm's; else the arm brakes, along the way that was found clear when the command before was sent. So what
was once kept is kept, however the commands are chosen.

Ways are covered, not sampled: each ball of an arm sweeps a capsule along a line in joint space, thicker by how much
the ball may be off that line. They are compared seldom: a radian of a joint moves a part no further than its reach from
that joint; so of what was left beyond the margin, all but how far the ways have moved since then is still left
(docs/explanation/decisions/0032-arms-keep-apart.md).

This is no safety function: a person in the way, or a part that was not declared, is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import ceil, dist, exp, fsum, inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from yumi.control.motion import BrakingPath, Setpoint, braking_path
from yumi.robot.collision import Array, BallModel, Indices, Nearest, SweptArm
from yumi.robot.joints import JOINT_COUNT, ZERO, ArmCommand, JointLimits, Joints, Side, joints

MARGIN = 0.010
"""No two parts, padding included, come nearer to each other than this [m]."""

BODY_MARGIN = -0.002
"""From the body and the other arm's shoulder the arms keep half of their padding: at home they are that near [m]."""

_EXACT_WITHIN = 0.02  # [m] parts that are further beyond the margin need no exact distance
_BOUNDARY_WITHIN = 0.002  # [m] a boundary so near is led along
_SLOW = 0.06  # [rad] an arm that comes to rest within this is led along a boundary; a faster one is slowed down first
_STRAIGHT = 2e-3  # [rad] a way to rest of one joint, and so little of the others, counts as a straight line
_LINE_LENGTH = 0.25  # [rad] of all joints together
_SAMPLES = 12  # of a way that is not straight, at equal times
_QUARTER, _HALF = _SAMPLES // 4, _SAMPLES // 2
_STEPS = np.arange(_SAMPLES + 1.0)
_STEPS_SINCE = np.maximum(_STEPS[:-1, None] - _STEPS[:-1], 0.0)
_CORNERS = 3  # boundaries that count at once
_EXACT = 1e-6  # [m]
_ROUNDING = 1e-9  # [m]
_TOLERANCE = 5e-5  # [m] a part within its margin that came nearer by more did so for another reason
_ALLOWED_APPROACH = 1e-4  # [m] and may come nearer by, on a way that ends further out
_NOISE = 1e-3  # [rad] of where the robot plans to be
_FLAT = 1e-4  # [m²/rad²] of a boundary's slope, below which no joint leads away from it
_REPEATS = 3  # of leading off one boundary after the other


class Limited(NamedTuple):
    """What limits an arm.

    Attributes:
        part: of the arm, e.g. ``right gripper``.
        other: of the other arm, ``body``, or a box by its name.
        distance: between them now [m].
    """

    part: str
    other: str
    distance: float

    def __str__(self) -> str:
        return f"{self.part} - {self.other}, {self.distance * 1e3:.0f} mm"


_Polyline = tuple[list[Array], list[Array]]
"""Postures in a row and, of each line between two of them, by how much each joint may be off it, (7,) [rad] each."""


class ArmMotion:
    """How an arm moves, and where it may come on its way to rest.

    Args:
        planned: where the robot plans to be [rad], (7,).
        sent: how the position sent moves.
        robot: how the robot itself moves where speeds are fed forward to it; None where it follows the position sent.
        limits: of the joints.
        gain: of the robot's position loop [1/s].

    Attributes:
        brake: how far each joint goes to rest, (7,) [rad].
        robot_brake: how far the robot's own joints do, where speeds are fed forward, (7,) [rad].
    """

    __slots__ = ("_gain", "_limits", "_paths", "_way", "brake", "planned", "robot", "robot_brake", "sent")

    def __init__(
        self, planned: Joints, sent: Setpoint, robot: Setpoint | None, limits: JointLimits, gain: float
    ) -> None:
        self.planned, self.sent, self.robot = planned, sent, robot
        self._limits, self._gain = limits, gain
        self._paths = _STANDING if sent.velocity is ZERO else _braking_paths(sent.velocity, sent.acceleration, limits)
        self.brake = ZERO if sent.velocity is ZERO else joints([path.end for path in self._paths])
        self.robot_brake = ZERO
        if robot is not None:
            # Its speed is taken back by ramp_speed, which needs at most this way; see speed_to_stop.
            rows = zip(robot.velocity, robot.acceleration, limits.acceleration, limits.jerk, strict=True)
            speeds = [(v + a * abs(a) / (2.0 * jerk), top, jerk) for v, a, top, jerk in rows]
            self.robot_brake = joints([0.5 * v * (abs(v) / top + 3.0 * top / jerk) for v, top, jerk in speeds])
        self._way: SweptArm | None = None

    @property
    def length(self) -> float:
        """How far all joints together get from where they are until they rest [rad]."""
        return sum(path.highest - path.lowest for path in self._paths)

    def moved(self, before: ArmMotion) -> list[float]:
        """By how much each joint's way to rest is off the one before, at most [rad], (7,).

        Two ways to rest of which one begins faster, or with more acceleration, but the same in all else, differ most at
        their ends. So the difference is that of the positions, then of the speeds, then of the accelerations.
        """
        now, then = self.sent, before.sent
        halfway = before.brake
        if now.velocity is not then.velocity:
            halfway = joints([path.end for path in _braking_paths(now.velocity, then.acceleration, self._limits)])
        rows = zip(now.position, then.position, self.brake, halfway, before.brake, strict=True)
        ways = [abs(p - q) + abs(faster - last) + abs(new - faster) for p, q, new, faster, last in rows]
        ways = [max(way, abs(p - q)) for way, p, q in zip(ways, self.planned, before.planned, strict=True)]
        own, its = self.robot, before.robot
        if own is not None or its is not None:
            new, last = own.position if own else self.planned, its.position if its else before.planned
            leads = zip(ways, new, last, self.robot_brake, before.robot_brake, strict=True)
            ways = [max(way, abs(p - q) + abs(a - b)) for way, p, q, a, b in leads]
        return ways

    def way(self, side: Side, model: BallModel, coasts_to: Joints | None = None) -> SweptArm:
        """Where the arm comes if it brakes now, or gets no commands any more.

        Args:
            side: which arm.
            model: its shapes.
            coasts_to: where the robot goes in a straight line if it is not heard any more [rad], (7,).
        """
        if self._way is not None:
            return self._way
        sent, planned, brake = np.array((self.sent.position, self.planned, self.brake))
        end = sent + brake
        ranges = np.array(self._paths)[:, :2].T  # a joint may turn round, and come to more than its end
        spread, beyond = ranges[1] - ranges[0], _beyond(brake, ranges)
        # How far along its line the arm is, the joint that goes furthest says; the others may be anywhere.
        largest = int(spread.argmax())
        aside = spread.copy()
        aside[largest] = beyond[largest]
        # A robot that follows the position sent, late, is in the triangle of the planned position, the one sent and
        # the end. That is swept along its edges: from two of them it is no further than half of its width.
        inside = np.zeros(7)
        is_following = self.robot is None and self._gain > 0.0 and bool(brake[largest] != 0.0)
        if is_following:
            lead = planned - sent
            across = lead - lead[largest] / brake[largest] * brake if abs(brake[largest]) > _ROUNDING else brake
            inside = 0.5 * min(np.abs(brake), np.abs(across), key=np.sum)
        ways: list[_Polyline]
        if float((aside + inside).sum()) <= _STRAIGHT:
            most_aside = aside
            ways = [([sent, end], [aside]), ([planned, sent], [aside + inside])]
            if is_following:
                ways.append(([planned, end], [aside + inside]))
        else:
            ways = self._curved_ways(sent, planned, end, spread, is_following=is_following)
            most_aside = np.max(ways[0][1], 0)
        if self.robot is not None:
            # With speeds fed forward it brakes for itself, then comes to where the position sent has come.
            place, stop = np.array((self.robot.position, self.robot_brake))
            its_paths = _braking_paths(self.robot.velocity, self.robot.acceleration, self._limits)
            most_aside = np.maximum(most_aside, _beyond(stop, np.array(its_paths)[:, :2].T))
            ways.append(([planned, place, place + stop, end], [np.zeros(7), most_aside, most_aside]))
        if coasts_to is not None:
            ways.append(([planned, np.array(coasts_to)], [np.zeros(7)]))
        # A long line in pieces, so that a ball's curve is near each piece's line.
        postures: list[Array] = []
        starts: list[int] = []
        offs: list[Array] = []
        for places, allowances in ways:
            for (first, last), allowance in zip(pairwise(places), allowances, strict=True):
                count = max(1, ceil(float(np.abs(last - first).sum()) / _LINE_LENGTH))
                starts += range(len(postures), len(postures) + count)
                postures += [first + (last - first) * (piece / count) for piece in range(count)]
                offs += [allowance] * count
            postures.append(places[-1])
        begins = np.array(starts)
        self._way = model.arms[side].sweep(np.array(postures), begins, begins + 1, np.array(offs))
        return self._way

    def _curved_ways(
        self, sent: Array, planned: Array, end: Array, spread: Array, *, is_following: bool
    ) -> list[_Polyline]:
        """The ways of the position sent and of the robot, where the joints come to rest one after the other."""
        positions, duration = self._braking_positions(sent)
        step = duration / _SAMPLES
        between = np.array(self._limits.acceleration) * step * step / 8.0
        thirds = positions[: _QUARTER + 1], positions[_QUARTER : _HALF + 1], positions[_HALF:]
        off = [np.minimum(_off(each) + between, spread) for each in thirds]
        ways = [([sent, positions[_QUARTER], positions[_HALF], end], off), ([planned, sent], [np.zeros(7)])]
        if is_following:
            # It follows, by its time constant behind; then straight to the end.
            kept = exp(-self._gain * step)
            robots = kept ** _STEPS[:, None] * planned
            late = (1.0 - kept) / (self._gain * step)  # of a position that changes evenly in a step
            taken = (1.0 - late) * positions[1:] + (late - kept) * positions[:-1]
            robots[1:] += np.tril(kept**_STEPS_SINCE) @ taken
            # Its acceleration is its gain times how the lead changes.
            between += self._gain * step / 8.0 * np.abs(np.diff(positions - robots, axis=0)).max(0)
            off = [_off(robots[: _HALF + 1]) + between, _off(robots[_HALF:]) + between, between]
            ways.append(([planned, robots[_HALF], robots[-1], end], off))
        return ways

    def _braking_positions(self, sent: Array) -> tuple[Array, float]:
        """Positions at equal times on the way to rest, (n, 7) [rad], and how long it takes [s].

        In closed form, as :func:`~yumi.control.motion.braking_path`: the acceleration changes by the jerk to its peak,
        stays, and goes back to zero.
        """
        top, jerk = np.array(self._limits.acceleration), np.array(self._limits.jerk)
        velocity, acceleration = np.array(self.sent.velocity), np.array(self.sent.acceleration)
        sign = np.where(velocity + acceleration * np.abs(acceleration) / (2.0 * jerk) < 0.0, -1.0, 1.0)
        velocity, acceleration = sign * velocity, sign * acceleration
        speed = velocity + acceleration * acceleration / (2.0 * jerk)
        peak = np.minimum(top, np.sqrt(jerk * speed))
        first = np.maximum((acceleration + peak) / jerk, 0.0)
        second = np.maximum((speed - peak * peak / jerk) / np.maximum(peak, 1e-12), 0.0)
        third = peak / jerk
        duration = float((first + second + third).max())
        times = np.linspace(0.0, duration, _SAMPLES + 1)[:, None]
        one = np.minimum(times, first)
        two = np.minimum(np.maximum(times - first, 0.0), second)
        three = np.minimum(np.maximum(times - first - second, 0.0), third)
        after_first = velocity + acceleration * first - 0.5 * jerk * first * first
        after_second = after_first - peak * second
        way = one * (velocity + one * (0.5 * acceleration - one * jerk / 6.0))
        way += two * (after_first - 0.5 * two * peak)
        way += three * (after_second + three * (three * jerk / 6.0 - 0.5 * peak))
        return sent + sign * way, duration


_STANDING = (BrakingPath(0.0, 0.0, 0.0),) * JOINT_COUNT


def _braking_paths(velocity: Joints, acceleration: Joints, limits: JointLimits) -> tuple[BrakingPath, ...]:
    rows = zip(velocity, acceleration, limits.acceleration, limits.jerk, strict=True)
    return tuple(braking_path(v, a, top, jerk) for v, a, top, jerk in rows)


def _beyond(brake: Array, ranges: Array) -> Array:
    """By how much joints that come to rest after ``brake`` get out of the range from 0 to there, (7,) [rad].

    Args:
        brake: (7,) [rad].
        ranges: how far each joint gets backwards and forwards, (2, 7) [rad].
    """
    past, behind = ranges[1] - np.maximum(brake, 0.0), np.minimum(brake, 0.0) - ranges[0]
    return np.asarray(np.maximum(np.maximum(past, behind), 0.0))


def _off(positions: Array) -> Array:
    """By how much positions are off the straight line from the first to the last one, at most, (7,) [rad]."""
    along = positions[-1] - positions[0]
    apart = positions - positions[0]
    # A joint that turns round gets beyond an end of the line.
    shares = np.clip(apart @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    return np.asarray(np.abs(apart - shares[:, None] * along).max(0))


class Boundary:
    """What an arm must not cross: ``normal`` · position ≥ ``least``, near where it was calculated.

    Attributes:
        normal: by how much a radian of each joint moves the parts apart [m/rad], (7,).
        least: [m].
        limited: the pair of parts.
        beyond: how far the arm is on this side of it on its way to rest [m].
    """

    __slots__ = ("_square", "beyond", "least", "limited", "normal")

    def __init__(self, normal: Array, least: float, limited: Limited, beyond: float) -> None:
        self.beyond = beyond
        self.normal: list[float] = normal.tolist()
        self.least, self.limited = least, limited
        self._square = max(float(normal @ normal), _FLAT)

    def missing(self, position: Sequence[float]) -> float:
        """By how much a position [rad] is beyond it [m]."""
        return self.least - fsum([n * p for n, p in zip(self.normal, position, strict=True)])

    def along(self, values: Sequence[float], change: float) -> list[float]:
        """Values of the joints, changed so that they lead away from it by ``change``."""
        return [value + n * change / self._square for n, value in zip(self.normal, values, strict=True)]


class _Left:
    """What is left beyond the margin between the arms, or between an arm and what stands still.

    Attributes:
        margins: of each two parts, (parts, parts or boxes) [m]; infinitely below zero where they may touch.
        left: of each two parts, at least [m].
        groups: of capsules of one name, which are one part, the same number, (parts, parts or boxes).
        floors: of each group within its margin, how near it may be [m].
    """

    def __init__(self, margins: Array, groups: Indices) -> None:
        self.margins = margins
        self.groups = groups
        self.floors = np.empty(int(groups.max()) + 1)
        self.left = np.empty_like(margins)
        self.forget()

    def forget(self) -> None:
        """Calculate all distances anew."""
        self.left[:] = np.where(np.isneginf(self.margins), inf, -inf)
        self.floors[:] = -inf

    @property
    def turned(self) -> _Left:
        """The same, as the other arm has it."""
        turned = _Left.__new__(_Left)
        turned.margins, turned.left = self.margins.T, self.left.T
        turned.groups, turned.floors = self.groups.T, self.floors
        return turned


@dataclass(slots=True)
class _Arm:
    """What is known of one arm.

    Attributes:
        motion: of the command sent last; None before the first.
        is_heard: whether its robot's datagrams arrive.
        coasts_to: where it goes where they do not [rad], (7,); None while they do.
        limited: what limits it in this cycle.
        boundaries: near it.
    """

    motion: ArmMotion | None = None
    is_heard: bool = False
    coasts_to: Joints | None = None
    limited: Limited | None = None
    boundaries: list[Boundary] = field(default_factory=list)


class CollisionLimiter:
    """Says of both arms' commands whether they keep the arms apart.

    Args:
        model: the shapes.
        limits: of the joints: how hard they brake.
        gain: of the robots' position loops [1/s].
        margin: the distance kept [m].
    """

    def __init__(self, model: BallModel, limits: JointLimits, gain: float, margin: float = MARGIN) -> None:
        self.model = model
        self.margin = margin
        self._limits = limits
        self._gain = gain
        self._arms = {side: _Arm() for side in Side}
        near = min(margin, BODY_MARGIN)
        # The shoulders are as near to the other arm as to the body, and bolted to it.
        right, left = (arm.part_frames == 0 for arm in model.arms.values())
        margins = np.where(right[:, None] | left, near, margin)
        margins[right[:, None] & left] = -inf
        (rows, columns), boxes = (
            (np.unique(arm.names, return_inverse=True)[1] for arm in model.arms.values()),
            model.boxes,
        )
        both = _Left(margins, rows[:, None] * (int(columns.max()) + 1) + columns)
        self._both = {Side.RIGHT: both, Side.LEFT: both.turned}
        is_body = np.array([name == "body" for name in model.boxes])
        self._alone = {
            side: _Left(
                np.where((arm.part_frames == 0)[:, None] & is_body, -inf, np.where(is_body, near, margin)),
                names[:, None] * len(boxes) + np.arange(len(boxes)),
            )
            for (side, arm), names in zip(model.arms.items(), (rows, columns), strict=True)
        }
        self._permitted: tuple[tuple[_Left, int, int, float], ...] = ()

    def arm(self, side: Side) -> ArmCollisionLimiter:
        """The part of it that one arm's limiter asks."""
        return ArmCollisionLimiter(self, side)

    def pairs_of(self, name: str, other: str) -> int:
        """How many pairs of parts have these names, in either order; see :meth:`permit`."""
        return len(self._found(name, other))

    def permit(self, *pairs: tuple[str, str]) -> None:
        """Let the parts of these names touch, and no others.

        A name is that of a part (``right gripper``), of an arm (``right arm``) or of what stands still (``table``).
        """
        for left, row, column, margin in self._permitted:
            left.margins[row, column] = margin
        found = {(id(each[0]), *each[1:]): each for pair in pairs for each in self._found(*pair)}.values()
        self._permitted = tuple((left, row, column, float(left.margins[row, column])) for left, row, column in found)
        for left, row, column, _ in self._permitted:
            left.margins[row, column] = -inf
        self._forget()

    def limited(self, side: Side) -> Limited | None:
        """What limits an arm in this cycle."""
        return self._arms[side].limited

    def connection_lost(self, side: Side) -> None:
        """An arm's datagrams do not arrive any more: it goes on to where its last command leads it.

        The other arm keeps clear of that until they arrive again: where RAPID, or a hand, moves the arm is not known.
        """
        arm = self._arms[side]
        if not arm.is_heard or arm.motion is None:
            return
        arm.is_heard, motion = False, arm.motion
        arm.coasts_to = motion.sent.position
        if motion.robot is not None and self._gain > 0.0:
            rows = zip(motion.robot.position, motion.robot.velocity, strict=True)
            arm.coasts_to = joints([p + v / self._gain for p, v in rows])
        arm.motion = ArmMotion(motion.planned, motion.sent, motion.robot, self._limits, self._gain)
        self._forget()

    def sent(self, side: Side, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> None:
        """An arm is sent a command, whatever :meth:`accepts` says of it; arguments as there."""
        arm = self._arms[side]
        if not arm.is_heard:
            arm.is_heard, arm.coasts_to = True, None
            self._forget()
        if _stays(arm.motion, planned, sent, robot):
            return
        motion = ArmMotion(planned, sent, robot, self._limits, self._gain)
        if arm.motion is not None:
            ways = self._ways(side, motion, arm.motion)
            for known in (self._alone[side], self._both[side]):
                known.left -= ways
        arm.motion = motion

    def accepts(self, side: Side, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> bool:
        """Whether an arm may be sent this command; if so, it is taken.

        Args:
            side: which arm.
            planned: where its robot plans to be [rad], (7,).
            sent: how the position sent would move at the end of this cycle's step.
            robot: how the robot would, where a speed is fed forward.
        """
        arm, other = self._arms[side], self._arms[side.other]
        if not arm.is_heard:
            arm.is_heard, arm.coasts_to = True, None
            self._forget()
        # What it stands at may have left it, or have come nearer.
        known = self._alone[side].left, self._both[side].left
        is_stale = bool(arm.boundaries) and any(bool((left < 0.0).any()) for left in known)
        if _stays(arm.motion, planned, sent, robot) and not is_stale:
            return True
        motion, last = ArmMotion(planned, sent, robot, self._limits, self._gain), arm.motion
        if last is None:  # its first command is where it stands
            arm.motion = motion
            return True
        ways = self._ways(side, motion, last)
        alone = self._alone[side].left - ways
        lacking = alone < 0.0
        is_free = True
        boundaries: list[Boundary] = []
        if lacking.any():
            is_free = self._measure(side, motion, last, None, alone, lacking, boundaries)
        both = self._both[side].left
        if other.motion is not None:  # else it is not known where it is
            both = both - ways
            lacking = both < 0.0
            if lacking.any():
                is_free = self._measure(side, motion, last, other, both, lacking, boundaries) and is_free
        arm.boundaries = sorted(boundaries, key=lambda each: each.beyond)[:_CORNERS]
        if is_free:
            arm.motion = motion
            self._alone[side].left[:] = alone
            if other.motion is not None:
                self._both[side].left[:] = both
        return is_free

    def steered(self, side: Side, desired: ArmCommand) -> ArmCommand:
        """The command next to ``desired`` that stays on this side of the boundaries near an arm."""
        arm = self._arms[side]
        arm.limited = None
        if not arm.boundaries or arm.motion is None or arm.motion.length >= _SLOW:
            # First an arm is slowed down on the way it goes: where that is free after all, it is not left.
            return desired
        position, velocity = list(desired.position), list(desired.velocity)
        for _ in range(_REPEATS):
            is_clear = True
            for boundary in arm.boundaries:
                missing = boundary.missing(position)
                if missing <= _EXACT:
                    continue
                is_clear, arm.limited = False, boundary.limited
                position = boundary.along(position, missing)
                inwards = fsum([n * v for n, v in zip(boundary.normal, velocity, strict=True)])
                if inwards < 0.0:
                    velocity = boundary.along(velocity, -inwards)
            if is_clear:
                break
        if arm.limited is None:
            return desired
        return ArmCommand(joints(position), joints(velocity) if any(velocity) else ZERO)

    def _ways(self, side: Side, motion: ArmMotion, last: ArmMotion) -> Array:
        """How far each part is, on its way to rest, from where it was on the way before, at most, (parts, 1) [m]."""
        return np.asarray(self.model.arms[side].reach @ np.array(motion.moved(last)))[:, None]

    def _forget(self) -> None:
        for each in (self._both[Side.RIGHT], *self._alone.values()):
            each.forget()
        for arm in self._arms.values():
            arm.boundaries = []

    def _found(self, name: str, other: str) -> list[tuple[_Left, int, int]]:
        def fits(part: str, wanted: str) -> bool:
            return wanted in {part, f"{part.partition(' ')[0]} arm"}

        found = []
        for side in Side:
            its = self.model.arms[side.other].names
            for left, columns in ((self._both[side], its), (self._alone[side], self.model.boxes)):
                found += [
                    (left, row, column)
                    for row, a in enumerate(self.model.arms[side].names)
                    for column, b in enumerate(columns)
                    if (fits(a, name) and fits(b, other)) or (fits(a, other) and fits(b, name))
                ]
        return found

    def _measure(
        self,
        side: Side,
        motion: ArmMotion,
        last: ArmMotion,
        other: _Arm | None,
        left: Array,
        lacking: NDArray[np.bool_],
        boundaries: list[Boundary],
    ) -> bool:
        """Calculate distances on all of the arm's way to rest, whichever arm is quicker.

        Args:
            side: which arm.
            motion: its motion, should the command be sent.
            last: that of the command before.
            other: the other arm; None for what stands still.
            left: of each two parts, to be updated [m].
            lacking: which of them are compared.
            boundaries: near the arm, to be added to.

        Returns:
            Whether the arm may move like this.
        """
        model, arm = self.model, self._arms[side]
        rows, columns = np.nonzero(lacking)
        known = (self._alone if other is None else self._both)[side]
        its: SweptArm | None = None
        if other is not None and other.motion is not None:
            its = other.motion.way(side.other, model, other.coasts_to)
        way, margins = motion.way(side, model), known.margins[rows, columns]
        near = self._compare(side, way, its, (rows, columns), margins)
        beyond = near.distances - margins
        broken = np.flatnonzero(beyond < -_ROUNDING)
        if len(broken):
            inside = self._inside(side, known, (rows[broken], columns[broken]), motion, last, other, its)
            beyond[broken] = np.maximum(beyond[broken], inside)
        left[rows, columns] = beyond
        seen = _BOUNDARY_WITHIN if motion.length < _SLOW else -_ROUNDING
        names = model.boxes if its is None else model.arms[side.other].names
        for pair in np.argsort(beyond)[:_CORNERS].tolist():
            lacks, at = float(beyond[pair]), near.least(pair)
            if lacks >= seen:
                break
            part, its_part = model.arms[side].names[int(rows[pair])], names[int(columns[pair])]
            if other is not None and not other.is_heard:
                its_part += _LAST_HEARD
            limited = Limited(part, its_part, float(near.distances[pair]))
            if lacks < -_ROUNDING:
                arm.limited = arm.limited or limited
            if at is None:  # known by what is round the parts only
                continue
            # Where the balls of two parts are nearest to each other.
            line, its_line = (int(each[at]) for each in near.lines)
            ball, its_ball = (int(each[at]) for each in near.balls)
            posture = int(way.starts[line] if near.shares[0][at] < 0.5 else way.ends[line])
            middle: Array | int = its_ball
            if its is not None:
                (middles,), (halves,) = model.arms[side.other].lines(its, *np.array([[its_ball], [its_line]]))
                middle = middles + (2.0 * near.shares[1][at] - 1.0) * halves
            normal = model.gradient(side, way, posture, ball, middle)
            least = float(normal @ way.postures[posture]) - lacks
            boundaries.append(Boundary(normal, least, limited, lacks))
        return bool(beyond.min() >= -_ROUNDING)

    def _compare(
        self, side: Side, way: SweptArm, its: SweptArm | None, pairs: tuple[Indices, Indices], margins: Array
    ) -> Nearest:
        """How near parts of an arm come to those of the other one, or to what stands still."""
        within = margins + _EXACT_WITHIN
        if its is None:
            return self.model.from_fixed(side, way, pairs, within)
        return self.model.between(side, way, its, pairs, within)

    def _inside(
        self,
        side: Side,
        known: _Left,
        pairs: tuple[Indices, Indices],
        motion: ArmMotion,
        last: ArmMotion,
        other: _Arm | None,
        its: SweptArm | None,
    ) -> Array:
        """Of pairs that are nearer than their margin already how much further than that they stay on their way [m].

        They may not come nearer still. On a way that leads out of the margin no room is kept for how much the way may
        bend, and a little is lost to begin with. Below zero for pairs that are not within their margin.
        """
        model, groups = self.model, known.groups[pairs]
        first, second = np.nonzero(np.isin(known.groups, groups))
        margins = known.margins[first, second]

        def least(way: SweptArm, its: SweptArm | None) -> Array:
            """Of all capsules of the same parts the least distance."""
            nearest = np.full(len(known.floors), inf)
            distances = self._compare(side, way, its, (first, second), margins).distances
            np.minimum.at(nearest, known.groups[first, second], distances)
            return nearest[groups]

        arm, way, theirs = model.arms[side], motion.way(side, model), its
        if other is not None and other.motion is not None and other.is_heard:  # else it may be anywhere on its way
            postures = np.array((other.motion.sent.position, other.motion.planned))
            theirs = model.arms[side.other].sweep(postures, *_STILL)
        now = least(arm.sweep(np.array((last.sent.position, motion.planned)), *_STILL), theirs)
        end = np.array(motion.sent.position) + motion.brake
        at_end = least(arm.sweep(np.array((end, end)), *_STILL), theirs)
        # What was once left does not come back; an arm that came nearer all the same may go on from there.
        floors = known.floors[groups]
        floors = np.where(now < floors - _TOLERANCE, now, np.maximum(floors, now))
        known.floors[groups] = floors
        lines = way._replace(excess=np.zeros_like(way.excess))
        its_lines = its and its._replace(excess=np.zeros_like(its.excess))
        found = self._compare(side, lines, its_lines, pairs, known.margins[pairs]).distances
        allowed = np.where(at_end >= floors, np.minimum(now, floors) - _ALLOWED_APPROACH, floors)
        return np.where(floors < known.margins[pairs], found - allowed, -inf)


_LAST_HEARD = " where EGM reported it last"
"""Added to the name of a part of an arm whose datagrams do not arrive."""

_STILL = np.array((0, 1)), np.array((0, 1)), np.zeros((2, 7))
"""An arm that stands in one of two postures; see :meth:`~yumi.robot.collision.ArmBalls.sweep`."""


class ArmCollisionLimiter(NamedTuple):
    """What the limiter of one arm asks of and reports to :class:`CollisionLimiter`; methods as there."""

    both: CollisionLimiter
    side: Side

    @property
    def limited(self) -> Limited | None:
        return self.both.limited(self.side)

    def connection_lost(self) -> None:
        self.both.connection_lost(self.side)

    def accepts(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> bool:
        return self.both.accepts(self.side, planned, sent, robot)

    def steered(self, desired: ArmCommand) -> ArmCommand:
        return self.both.steered(self.side, desired)

    def sent(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> None:
        self.both.sent(self.side, planned, sent, robot)


def _stays(motion: ArmMotion | None, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> bool:
    """Whether a command changes nothing: most of the time an arm stands."""
    if motion is None or motion.sent != sent or motion.robot != robot:
        return False
    return motion.planned is planned or dist(motion.planned, planned) < _NOISE
