"""Keeps both arms apart from each other, from the body and from what stands around the robot.

The invariant, kept in every cycle for whatever moves the arms: if both arms brake now as hard as they may, no two parts
come nearer to each other than the margin. A command that would break it is led along the boundary, or braked. Braking
needs no permission: it leads along a path that was checked. So what was once kept can be kept.

Distances of shapes are calculated seldom. A radian of a joint moves no part of the arm further than the joint's reach;
so of what was left beyond the margin when it was calculated last, that much is still left less the way since then
(docs/explanation/decisions/0032-arms-keep-apart.md).

This is no safety function: a person in the way, or a part that was not declared, is not seen.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import ceil, fsum, inf
from typing import NamedTuple

import numpy as np

from yumi.control.motion import Setpoint, braking_path, stop
from yumi.errors import CommandRefused
from yumi.robot.collision import Array, BallModel, NearPairs, PlacedArm
from yumi.robot.joints import ZERO, ArmCommand, JointLimits, Joints, Side, joints

MARGIN = 0.010
"""No two parts, padding included, come nearer to each other than this [m]."""

BODY_MARGIN = -0.002
"""From the body the arms keep half of their padding: at home they stand that near to it [m]."""

_FORESIGHT = 0.05  # [m] pairs that are further beyond the margin need no exact distance
_STEP = 0.04  # [m] between two postures of a motion that are checked
_MOST_STEPS = 5
_SIGHT = 0.002  # [m] a boundary so near is led along
_SLOW = 0.03  # [m] an arm that comes to rest within this is led along a boundary; a faster one is slowed down first
_CORNERS = 4  # boundaries that count at once
_EXACT = 1e-6  # [m]
_FLAT = 1e-4  # [m²/rad²] of a boundary's slope, below which no joint leads away from it
_REPEATS = 3  # of leading off one boundary after the other


class Limited(NamedTuple):
    """What limits an arm.

    Attributes:
        part: of one arm, e.g. ``right gripper``.
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
        end: where the position sent comes to rest if it brakes now [rad], (7,).
        robot_end: where the robot does [rad], (7,).
    """

    __slots__ = ("_limits", "_placed", "end", "planned", "postures", "robot", "robot_end", "sent")

    def __init__(self, planned: Joints, sent: Setpoint, robot: Setpoint | None, limits: JointLimits) -> None:
        self.planned, self.sent, self.robot = planned, sent, robot
        self._limits = limits
        self._placed: PlacedArm | None = None
        self.postures: list[Joints] = []
        self.end = self._end_of(sent)
        self.robot_end = self.end if robot is None else self._end_of(robot)

    def _end_of(self, motion: Setpoint) -> Joints:
        if motion.velocity is ZERO:
            return motion.position
        rows = zip(*motion, self._limits.acceleration, self._limits.jerk, strict=True)
        return joints([p + braking_path(v, a, top, jerk).end for p, v, a, top, jerk in rows])

    def placed(self, side: Side, model: BallModel, coasts_to: Joints | None = None) -> PlacedArm:
        """The arm wherever it may be on its way to rest, see :attr:`postures`.

        Args:
            side: which arm.
            model: its shapes.
            coasts_to: where the robot goes in a straight line if it gets no commands any more [rad], (7,).
        """
        if self._placed is None:
            reach = model.reach[side]
            # First the position sent, then its way to rest, then the robot's way there.
            self.postures = [self.sent.position, *self._braking(self.sent, self.end, reach)]
            if self.robot is not None:
                self.postures += self._braking(self.robot, self.robot_end, reach)
            elif len(self.postures) > 1 and _way(self.planned, self.sent.position, reach) > _STEP:
                self.postures += _line(self.planned, self.end, reach)
            self.postures += _line(self.planned, self.sent.position, reach)
            if coasts_to is not None:
                self.postures += [*_line(self.planned, coasts_to, reach), coasts_to]
            self._placed = model.place(side, np.array(self.postures))
        return self._placed

    def _braking(self, motion: Setpoint, end: Joints, reach: Joints) -> list[Joints]:
        """On the way to rest, without its begin."""
        steps, between = min(_MOST_STEPS, ceil(_way(motion.position, end, reach) / _STEP)), []
        if steps > 1:
            with suppress(CommandRefused):  # without a plan, its end is what there is to look at
                way = stop(motion, self._limits)
                between = [way.at(way.duration * step / steps).position for step in range(1, steps)]
        return [*between, end] if steps else []

    def way_from(self, other: ArmMotion, reach: Joints) -> float:
        """How far any part is on its way to rest from where it was on another motion's way [m]."""
        if self is other:
            return 0.0
        rows = zip(
            *(reach, self.sent.position, other.sent.position, self.end, other.end),
            *(self.planned, other.planned, self.robot_end, other.robot_end),
            strict=True,
        )
        return fsum([r * max(abs(a - b), abs(c - d), abs(e - f), abs(g - h)) for r, a, b, c, d, e, f, g, h in rows])


def _way(start: Joints, end: Joints, reach: Joints) -> float:
    return 0.0 if start is end else fsum([r * abs(a - b) for r, a, b in zip(reach, start, end, strict=True)])


def _line(start: Joints, end: Joints, reach: Joints) -> list[Joints]:
    """From start to end in joint space, without the end."""
    steps = min(_MOST_STEPS, ceil(_way(start, end, reach) / _STEP))
    return [_between(start, end, step / steps) for step in range(steps)]


def _between(start: Joints, end: Joints, fraction: float) -> Joints:
    return joints([a + (b - a) * fraction for a, b in zip(start, end, strict=True)])


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


@dataclass(slots=True)
class _Arm:
    """What is known of one arm.

    Attributes:
        motion: of the command sent last; None before the first.
        checked: its motion when distances from the other arm were calculated last.
        checked_alone: its motion when distances from what stands still were calculated last.
        left: what was left then beyond the margin [m].
        boundaries: near it, with the other arm and with what stands still.
        is_heard: whether its robot's datagrams arrive.
        coasts_to: where it goes where they do not [rad], (7,); None while they do.
        limited: what limits it in this cycle.
    """

    motion: ArmMotion | None = None
    checked: ArmMotion | None = None
    checked_alone: ArmMotion | None = None
    left: float = -inf
    boundaries: tuple[Sequence[Boundary], Sequence[Boundary]] = ((), ())
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
        self._left = -inf  # beyond the margin between both arms, when their distances were calculated last [m]
        self._permitted = np.zeros(model.count, dtype=bool)
        others = [model.parts_of(pair)[1] for pair in range(model.count)]
        self._margins = np.array([min(margin, BODY_MARGIN) if other == "body" else margin for other in others])

    def arm(self, side: Side) -> ArmCollisionLimiter:
        """The part of it that one arm's limiter asks."""
        return ArmCollisionLimiter(self, side)

    def permit(self, pairs: Collection[int]) -> None:
        """Let these pairs of parts touch, and no others."""
        self._permitted[:] = False
        self._permitted[list(pairs)] = True
        self._forget()

    def limited(self, side: Side) -> Limited | None:
        """What limits an arm in this cycle."""
        return self._arms[side].limited

    def place(self, side: Side, position: Joints) -> None:
        """An arm that no command is sent to stands at ``position`` [rad], (7,)."""
        arm = self._arms[side]
        arm.motion, arm.boundaries = ArmMotion(position, Setpoint(position), None, self._limits), ((), ())
        self._forget()

    def lose(self, side: Side) -> None:
        """An arm's datagrams do not arrive any more: it goes on to where its last command leads it."""
        arm = self._arms[side]
        if arm.is_heard and arm.motion is not None:
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
        if arm.motion is None or arm.motion.sent != sent or arm.motion.planned is not planned:
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
        arm, other, reach = self._arms[side], self._arms[side.other], self.model.reach
        motion, last = ArmMotion(planned, sent, robot, self._limits), arm.motion
        if last is None:  # its first command is where it stands
            arm.motion = motion
            return True
        is_free = True
        alone = arm.checked_alone
        if alone is None or motion.way_from(alone, reach[side]) > arm.left:
            is_free = self._is_free_alone(side, motion, last)
        if other.motion is not None:  # else nobody knows where it is
            moved = inf
            if arm.checked is not None and other.checked is not None:
                moved = motion.way_from(arm.checked, reach[side])
                moved += other.motion.way_from(other.checked, reach[side.other])
            if moved > self._left:
                is_free = self._is_free_together(side, motion, last) and is_free
        if is_free:
            arm.motion = motion
        return is_free

    def steered(self, side: Side, desired: ArmCommand) -> ArmCommand:
        """The command next to ``desired`` that stays on this side of the boundaries near an arm."""
        arm = self._arms[side]
        arm.limited = None
        boundaries = (*arm.boundaries[0], *arm.boundaries[1])
        if not boundaries or arm.motion is None:
            return desired
        # First slower, on the way it goes; where that way is free after all, it is not left.
        if _way(arm.motion.sent.position, arm.motion.end, self.model.reach[side]) > _SLOW:
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
                inwards = sum([n * v for n, v in zip(boundary.normal, velocity, strict=True)])
                if inwards < 0.0:
                    velocity = boundary.along(velocity, -inwards)
            if is_clear:
                break
        if arm.limited is None:
            return desired
        return ArmCommand(joints(position), joints(velocity) if any(velocity) else ZERO)

    def _forget(self) -> None:
        self._left = -inf
        for arm in self._arms.values():
            arm.left = -inf

    def _is_free_together(self, side: Side, motion: ArmMotion, last: ArmMotion) -> bool:
        """Calculate distances between both arms on all of their ways to rest, whichever is quicker."""
        arm, other = self._arms[side], self._arms[side.other]
        assert other.motion is not None
        mine = motion.placed(side, self.model)
        its = other.motion.placed(side.other, self.model, other.coasts_to)
        before = last.placed(side, self.model)
        now, count = PlacedArm(*(each[:1] for each in before)), len(motion.postures)
        own = PlacedArm(*(np.concatenate(each) for each in zip(mine, now, strict=True)))
        pair = (own, its) if side is Side.RIGHT else (its, own)
        near = self.model.between(*pair, self.margin + _FORESIGHT)
        distances = near.distances if side is Side.RIGHT else near.distances.swapaxes(0, 1)
        # What is nearer already may not come nearer still; a robot that is not heard may be anywhere on its way.
        least = np.minimum(distances[count, : 1 if other.is_heard else None].min(0), self._margins[near.pairs])
        least[self._permitted[near.pairs]] = -inf
        left = distances[:count] - least
        smallest = left.min((0, 1))
        end = float(smallest.min(initial=_FORESIGHT))
        if end >= -_EXACT:
            self._left, arm.checked, other.checked = end, motion, other.motion
        now = distances[count, 0]
        boundaries = []
        for index in self._nearest(arm, near, now, smallest):
            posture, there = divmod(int(left[:, :, index].argmin()), left.shape[1])
            normal = self.model.gradient(side, int(near.pairs[index]), mine, posture, its.middles[there])
            least = float(normal @ motion.postures[posture] - left[posture, there, index])
            boundaries.append(Boundary(normal, least, self._limited(near, index, now)))
        arm.boundaries = (boundaries, arm.boundaries[1])
        return end >= -_EXACT

    def _is_free_alone(self, side: Side, motion: ArmMotion, last: ArmMotion) -> bool:
        """Calculate distances of one arm from what stands still on all of its way to rest."""
        arm = self._arms[side]
        mine = motion.placed(side, self.model)
        before, count = last.placed(side, self.model), len(motion.postures)
        own = PlacedArm(*(np.concatenate((a, b[:1])) for a, b in zip(mine, before, strict=True)))
        near = self.model.from_fixed(side, own, self.margin + _FORESIGHT)
        least = np.minimum(near.distances[count], self._margins[near.pairs])
        least[self._permitted[near.pairs]] = -inf
        left = near.distances[:count] - least
        smallest = left.min(0)
        end = float(smallest.min(initial=_FORESIGHT))
        if end >= -_EXACT:
            arm.left, arm.checked_alone = end, motion
        now = near.distances[count]
        boundaries = []
        for index in self._nearest(arm, near, now, smallest):
            posture = int(left[:, index].argmin())
            normal = self.model.gradient(side, int(near.pairs[index]), mine, posture)
            least = float(normal @ motion.postures[posture] - left[posture, index])
            boundaries.append(Boundary(normal, least, self._limited(near, index, now)))
        arm.boundaries = (arm.boundaries[0], boundaries)
        return end >= -_EXACT

    def _nearest(self, arm: _Arm, near: NearPairs, distances: Array, left: Array) -> list[int]:
        """The pairs that are at their boundaries, one of each two parts; one that is over it limits the arm."""
        found: dict[tuple[str, str], int] = {}
        candidates = np.nonzero(left < _SIGHT)[0]
        for index in candidates[np.argsort(left[candidates])].tolist():
            if not found and left[index] < -_EXACT:
                arm.limited = self._limited(near, index, distances)
            found.setdefault(self.model.parts_of(int(near.pairs[index])), index)
            if len(found) == _CORNERS:
                break
        return list(found.values())

    def _limited(self, near: NearPairs, index: int, distances: Array) -> Limited:
        return Limited(*self.model.parts_of(int(near.pairs[index])), float(distances[index]))


class ArmCollisionLimiter(NamedTuple):
    """What the limiter of one arm asks of :class:`CollisionLimiter`, and tells it; methods as there."""

    both: CollisionLimiter
    side: Side

    def accepts(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> bool:
        return self.both.accepts(self.side, planned, sent, robot)

    def steered(self, desired: ArmCommand) -> ArmCommand:
        return self.both.steered(self.side, desired)

    def take(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> None:
        self.both.take(self.side, planned, sent, robot)
