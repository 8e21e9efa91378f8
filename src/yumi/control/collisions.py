"""Keeps both arms apart from each other, from the body and from what stands around the robot.

The invariant, kept in every cycle for whatever moves the arms: if both arms brake now as hard as they may, no two parts
come nearer to each other than the margin. A command that would break it is braked, and when the arm is slow led along
the boundary. Braking needs no permission: it leads along a way that was checked. So what was once kept can be kept.

Distances of shapes are calculated seldom. A radian of a joint moves a part no further than its reach from that joint;
so of what was left beyond the margin when it was calculated last, all but the way since then is still left
(docs/explanation/decisions/0032-arms-keep-apart.md).

This is no safety function: a person in the way, or a part that was not declared, is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, dist, fsum, inf
from typing import NamedTuple

import numpy as np

from yumi.control.motion import Setpoint, braking_path
from yumi.robot.collision import Array, BallModel, Indices, Near, PlacedArm
from yumi.robot.joints import ZERO, ArmCommand, JointLimits, Joints, Side, joints

MARGIN = 0.010
"""No two parts, padding included, come nearer to each other than this [m]."""

BODY_MARGIN = -0.002
"""From the body and the other arm's shoulder the arms keep half of their padding: at home they are that near [m]."""

_FORESIGHT = 0.02  # [m] parts that are further beyond the margin need no exact distance
_STEP = 0.10  # [rad] of all joints together between two postures of a way that are looked at
_MOST_STEPS = 4
_SIGHT = 0.002  # [m] a boundary so near is led along
_SLOW = 0.06  # [rad] an arm that comes to rest within this is led along a boundary; a faster one is slowed down first
_CORNERS = 3  # boundaries that count at once
_EXACT = 1e-6  # [m]
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


class ArmMotion:
    """How an arm moves, and where it may come on its way to rest.

    Args:
        planned: where the robot plans to be [rad], (7,).
        sent: how the position sent moves.
        robot: how the robot itself moves where speeds are fed forward to it; None where it follows the position sent.
        limits: of the joints.

    Attributes:
        corners: the position sent, where it comes to rest if it brakes now, where the robot plans to be, where it comes
            to rest, (4, 7) [rad].
        postures: all that are looked at, the position sent first, (n, 7) [rad].
    """

    __slots__ = ("_placed", "corners", "planned", "postures", "robot", "sent")

    def __init__(self, planned: Joints, sent: Setpoint, robot: Setpoint | None, limits: JointLimits) -> None:
        self.planned, self.sent, self.robot = planned, sent, robot
        end = _end(sent, limits)
        self.corners = np.array((sent.position, end, planned, end if robot is None else _end(robot, limits)))
        self.postures = self.corners[:1]
        self._placed: PlacedArm | None = None

    def placed(
        self, side: Side, model: BallModel, coasts_to: Joints | None = None, before: ArmMotion | None = None
    ) -> PlacedArm:
        """The arm in all :attr:`postures`.

        Args:
            side: which arm.
            model: its shapes.
            coasts_to: where the robot goes in a straight line if it gets no commands any more [rad], (7,).
            before: its motion until now: the position sent then is the last posture.
        """
        if self._placed is None:
            sent, end, planned, robot_end = self.corners
            lines = [self.corners[:1], _line(sent, end), _line(sent, planned)]
            if self.robot is not None:
                lines.append(_line(end, robot_end))
            elif len(lines[1]) and len(lines[2]) > 1:  # the robot cuts the corner
                lines.append(_line(planned, end)[:-1])
            if coasts_to is not None:
                lines.append(_line(planned, np.array(coasts_to)))
            lines.append(self.corners[:1] if before is None else before.corners[:1])
            self.postures = np.concatenate(lines)
            self._placed = model.arms[side].place(self.postures)
        return self._placed


def _end(motion: Setpoint, limits: JointLimits) -> Joints:
    if motion.velocity is ZERO:
        return motion.position
    rows = zip(*motion, limits.acceleration, limits.jerk, strict=True)
    return joints([p + braking_path(v, a, top, jerk).end for p, v, a, top, jerk in rows])


def _line(start: Array, end: Array) -> Array:
    """From start to end in joint space, without the start, (n, 7)."""
    way = end - start
    length = float(np.abs(way).sum())
    steps = min(_MOST_STEPS, ceil(length / _STEP))
    if steps < 2:
        return end[None] if length > _EXACT else _NOWHERE
    return start + way * _FRACTIONS[steps]


_NOWHERE = np.empty((0, 7))
_FRACTIONS = [np.arange(1, steps + 1)[:, None] / max(steps, 1) for steps in range(_MOST_STEPS + 1)]


class Boundary:
    """What an arm must not cross: ``normal`` · position ≥ ``least``, near where it was calculated.

    Attributes:
        normal: by how much a radian of each joint moves the parts apart [m/rad], (7,).
        least: [m].
        limited: the pair of parts.
    """

    __slots__ = ("_square", "least", "limited", "normal")

    def __init__(self, normal: Array, least: float, limited: Limited) -> None:
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
    """What is left beyond the margin between an arm and the other one, or what stands still.

    Attributes:
        margins: of each two parts, (parts, parts or boxes) [m].
        left: of each two parts, when it was calculated last [m].
        corners: of the motions then, of this arm and, if it concerns one, of the other.
        boundaries: near the arm.
    """

    def __init__(self, margins: Array) -> None:
        self.margins = margins
        self.left = np.full_like(margins, -inf)
        self.corners: tuple[Array | None, Array | None] = (None, None)
        self.boundaries: list[Boundary] = []


@dataclass(slots=True)
class _Arm:
    """What is known of one arm.

    Attributes:
        motion: of the command sent last; None before the first.
        is_heard: whether its robot's datagrams arrive.
        coasts_to: where it goes where they do not [rad], (7,); None while they do.
        limited: what limits it in this cycle.
    """

    motion: ArmMotion | None = None
    is_heard: bool = False
    coasts_to: Joints | None = None
    limited: Limited | None = None


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
        counts = {side: len(arm.names) for side, arm in model.arms.items()}
        fixed = np.array([min(margin, BODY_MARGIN) if name == "body" else margin for name in model.boxes])
        # The shoulders are as near to the other arm as to the body.
        is_body = {side: arm.part_frames == 0 for side, arm in model.arms.items()}
        self._both = {
            side: _Left(np.where(is_body[side][:, None] | is_body[side.other], min(margin, BODY_MARGIN), margin))
            for side in Side
        }
        self._alone = {side: _Left(np.tile(fixed, (counts[side], 1))) for side in Side}
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

    def place(self, side: Side, position: Joints) -> None:
        """An arm that no command is sent to stands at ``position`` [rad], (7,)."""
        self._arms[side].motion = ArmMotion(position, Setpoint(position), None, self._limits)
        self._forget()

    def lose(self, side: Side) -> None:
        """An arm's datagrams do not arrive any more: it goes on to where its last command leads it."""
        arm = self._arms[side]
        if not arm.is_heard or arm.motion is None:
            return
        arm.is_heard, motion = False, arm.motion
        arm.coasts_to = motion.sent.position
        if motion.robot is not None and self._gain > 0.0:
            rows = zip(motion.robot.position, motion.robot.velocity, strict=True)
            arm.coasts_to = joints([p + v / self._gain for p, v in rows])
        arm.motion = ArmMotion(motion.planned, motion.sent, motion.robot, self._limits)
        self._forget()

    def take(self, side: Side, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> None:
        """An arm is sent a command, whatever :meth:`accepts` says of it; arguments as there."""
        arm = self._arms[side]
        if not _stays(arm.motion, planned, sent, robot):
            arm.motion = ArmMotion(planned, sent, robot, self._limits)
        if not arm.is_heard:
            arm.is_heard, arm.coasts_to = True, None
            self._forget()

    def accepts(self, side: Side, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> bool:
        """Whether an arm may be sent this command; if so, it is taken.

        Args:
            side: which arm.
            planned: where its robot plans to be [rad], (7,).
            sent: how the position sent would move at the end of this cycle's step.
            robot: how the robot would, where a speed is fed forward.
        """
        arm, other = self._arms[side], self._arms[side.other]
        if _stays(arm.motion, planned, sent, robot):
            return True
        motion, last = ArmMotion(planned, sent, robot, self._limits), arm.motion
        if last is None:  # its first command is where it stands
            arm.motion = motion
            return True
        is_free = True
        alone, both = self._alone[side], self._both[side]
        ways = self._ways(side, motion, alone.corners[0])
        if ways is None or (ways[:, None] > alone.left).any():
            is_free = self._is_free(side, alone, motion, last, None)
        if other.motion is not None:  # else it is not known where it is
            ways, others = (
                self._ways(each, now, before)
                for each, now, before in zip((side, side.other), (motion, other.motion), both.corners, strict=True)
            )
            if ways is None or others is None or (ways[:, None] + others > both.left).any():
                is_free = self._is_free(side, both, motion, last, other) and is_free
        if is_free:
            arm.motion = motion
        return is_free

    def steered(self, side: Side, desired: ArmCommand) -> ArmCommand:
        """The command next to ``desired`` that stays on this side of the boundaries near an arm."""
        arm = self._arms[side]
        arm.limited = None
        boundaries = self._both[side].boundaries + self._alone[side].boundaries
        if not boundaries or not self._is_slow(arm.motion):
            return desired
        position, velocity = list(desired.position), list(desired.velocity)
        for _ in range(_REPEATS):
            is_clear = True
            for boundary in boundaries:
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

    @staticmethod
    def _is_slow(motion: ArmMotion | None) -> bool:
        """First an arm is slowed down on the way it goes: where that is free after all, it is not left."""
        return motion is not None and float(np.abs(motion.corners[1] - motion.corners[0]).sum()) < _SLOW

    def _ways(self, side: Side, motion: ArmMotion, before: Array | None) -> Array | None:
        """How far each part is, on its way to rest, from where it was on another motion's way, at most [m]."""
        if before is None:
            return None
        moved = np.abs(motion.corners - before).max(0)
        return np.asarray(self.model.arms[side].reach @ moved)

    def _forget(self) -> None:
        for each in (*self._both.values(), *self._alone.values()):
            each.corners = (None, None)

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

    def _is_free(self, side: Side, known: _Left, motion: ArmMotion, last: ArmMotion, other: _Arm | None) -> bool:
        """Calculate distances on all of the arm's way to rest, whichever arm is quicker.

        Args:
            side: which arm.
            known: what is left of it.
            motion: its motion, should the command be sent.
            last: that of the command before.
            other: the other arm; None for what stands still.
        """
        model, arm = self.model, self._arms[side]
        mine, its = motion.placed(side, model, before=last), None
        within = self.margin + _FORESIGHT
        if other is None:
            near = model.from_fixed(side, mine, within)
        else:
            assert other.motion is not None
            its = other.motion.placed(side.other, model, other.coasts_to)
            near = model.between(side, mine, its, within)
        left = near.gaps - known.margins
        is_free, boundaries = True, []
        if len(near.parts):
            rows = _begins(model.arms[side].counts[near.parts])
            columns = (
                np.arange(len(near.others)) if other is None else _begins(model.arms[side.other].counts[near.others])
            )
            parts = near.parts[:, None], near.others
            # What is nearer already may not come nearer still; a robot that is not heard may be anywhere on its way.
            now = near.distances[-1, : 1 if other is None or other.is_heard else None].min(0)
            now = np.minimum.reduceat(np.minimum.reduceat(now, rows, 0), columns, 1)
            smallest = near.distances[:-1].min((0, 1))
            smallest = np.minimum.reduceat(np.minimum.reduceat(smallest, rows, 0), columns, 1)
            least = np.minimum(known.margins[parts], now)
            left[parts] = smallest - least
            over = left[parts] < (_SIGHT if self._is_slow(motion) else -_EXACT)
            if over.any():
                nearest = np.argsort(left[parts], axis=None)[: min(_CORNERS, int(over.sum()))]
                ends = (np.append(rows[1:], len(near.rows)), np.append(columns[1:], len(near.columns)))
                for row, column in zip(*np.unravel_index(nearest, over.shape), strict=True):
                    block = (slice(rows[row], ends[0][row]), slice(columns[column], ends[1][column]))
                    names = model.boxes if other is None else model.arms[side.other].names
                    part, its_part = int(near.parts[row]), int(near.others[column])
                    limited = Limited(model.arms[side].names[part], names[its_part], float(now[row, column]))
                    if left[part, its_part] < -_EXACT and is_free:
                        arm.limited, is_free = limited, False
                    boundaries.append(
                        self._boundary(side, near, block, motion, mine, its, float(least[row, column]), limited)
                    )
        known.boundaries = boundaries
        if is_free:
            known.left = left
            known.corners = (motion.corners, None if other is None or other.motion is None else other.motion.corners)
        return is_free

    def _boundary(
        self,
        side: Side,
        near: Near,
        block: tuple[slice, slice],
        motion: ArmMotion,
        mine: PlacedArm,
        its: PlacedArm | None,
        least: float,
        limited: Limited,
    ) -> Boundary:
        """Where the balls of two parts are nearest to each other on the arm's way to rest."""
        distances = near.distances[:-1, :, block[0], block[1]]
        posture, there, row, column = np.unravel_index(int(distances.argmin()), distances.shape)
        ball, second = int(near.rows[block[0]][row]), int(near.columns[block[1]][column])
        other = second if its is None else its.middles[there, :, second]
        normal = self.model.gradient(side, ball, mine, int(posture), other)
        beyond = float(distances[posture, there, row, column]) - least
        return Boundary(normal, float(normal @ motion.postures[posture]) - beyond, limited)


class ArmCollisionLimiter(NamedTuple):
    """What the limiter of one arm asks of and reports to :class:`CollisionLimiter`; methods as there."""

    both: CollisionLimiter
    side: Side

    @property
    def limited(self) -> Limited | None:
        return self.both.limited(self.side)

    def lose(self) -> None:
        self.both.lose(self.side)

    def accepts(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> bool:
        return self.both.accepts(self.side, planned, sent, robot)

    def steered(self, desired: ArmCommand) -> ArmCommand:
        return self.both.steered(self.side, desired)

    def take(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> None:
        self.both.take(self.side, planned, sent, robot)


def _stays(motion: ArmMotion | None, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> bool:
    """Whether a command changes nothing: most of the time an arm stands."""
    if motion is None or motion.sent != sent or motion.robot != robot:
        return False
    return motion.planned is planned or dist(motion.planned, planned) < _NOISE


def _begins(counts: Indices) -> Indices:
    """Where in a row of so many of each kind every kind begins."""
    begins = np.zeros(len(counts), dtype=np.intp)
    np.cumsum(counts[:-1], out=begins[1:])
    return begins
