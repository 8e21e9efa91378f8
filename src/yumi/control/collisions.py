"""Keeps both arms apart from each other, from the body and from what stands around the robot.

The invariant, kept in every cycle for whatever moves the arms: if both arms brake now as hard as they may, no two parts
come nearer to each other than the margin. A command is sent only if the whole of its way to rest is clear of the whole
of the other arm's; else the arm brakes, along the way that was found clear when the command before was sent. So what
was once kept is kept, however the commands are chosen.

A way is a piece in which each joint has a range; its middle is the posture whose distances are calculated, and no part
is further from there than its reach from each joint times half of that joint's range. Where that is too much to say
that the arms keep apart, the piece is cut in two (docs/explanation/decisions/0032-arms-keep-apart.md).

This is no safety function: a person in the way, or a part that was not declared, is not seen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import dist, fsum, inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from yumi.control.motion import BrakingPath, Setpoint, braking_paths, braking_positions
from yumi.robot.collision import TOOL_FRAME, Array, CollisionModel, Contacts
from yumi.robot.joints import JOINT_COUNT, ZERO, ArmCommand, JointLimits, Joints, Side, joints

MARGIN = 0.010
"""No two parts, padding included, come nearer to each other than this [m]."""

BODY_MARGIN = -0.002
"""From the body and the other arm's shoulder the arms keep half of their padding: at home they are that near [m]."""

_TOLERANCE = 5e-4  # [m] a way is off the postures that are compared by more, or it counts as being there
_POSTURES = 64  # that are compared for a command at most; a way that needs more is left to slower commands
_COARSE = 0.2  # [m] pieces in which parts move further are cut at once: too many others are that near
_SAMPLES = 64  # of each curve of a way; a power of two
_SHORT = 5e-3  # [m] pieces in which parts move less are taken for straight
_BOUNDARY_WITHIN = 0.002  # [m] a boundary so near is led along
_SLOW = 0.06  # [rad] an arm that comes to rest within this is led along a boundary; a faster one is slowed down first
_CORNERS = 3  # boundaries that count at once
_EXACT = 1e-6  # [m]
_ALLOWED_APPROACH = 1e-4  # [m] in a cycle, of a part within its margin
_SPARE = 5e-4  # [m] so far within its margin a part may turn round
_MOVED = 3e-4  # [m] one that came nearer by more did so for another reason, and may go on from there
_NOISE = 1e-3  # [rad] of where the robot plans to be
_FLAT = 1e-4  # [m²/rad²] of a boundary's slope, below which no joint leads away from it
_REPEATS = 3  # of leading off one boundary after the other
_PATIENCE = 0.15  # [s] an arm that is limited may go on for so long without getting nearer to where it is commanded
_NEARER = 1e-3  # [rad] by less it is no nearer
_NEARER_SHARE = 0.1  # nor by less than this share of what is left
_SAME = 5e-4  # [rad] a position desired that changes by less is the same
_OWN = 0.5  # a proportional controller's changes with the arm itself, by less than this share of its motion
_SAME_SPEED = 1e-2  # [rad/s]
_ELSEWHERE = 0.02  # [rad] when the other arm has moved by this, an arm that is held tries again


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


class _Piece:
    """Of a way: a straight line in joint space, and how far each joint may be off it.

    Args:
        curve: postures that it leads along [rad], (n, 7).
        cut: makes its parts; none of the smallest pieces.

    Attributes:
        middle: of the line [rad], (7,).
        along: from there to its end [rad], (7,).
        off: it by so much, at most [rad], (7,).
        half: how far each joint is from the middle, at most [rad], (7,).
    """

    __slots__ = ("_cut", "_parts", "along", "half", "middle", "off")

    def __init__(self, curve: Array, cut: Callable[[], tuple[_Piece, ...]]) -> None:
        self.middle, self.along = 0.5 * (curve[0] + curve[-1]), 0.5 * (curve[-1] - curve[0])
        self.off = np.zeros(JOINT_COUNT)
        if len(curve) > _ENDS:
            apart = curve - self.middle
            shares = np.clip(apart @ self.along / max(float(self.along @ self.along), _TINY), -1.0, 1.0)
            self.off = np.abs(apart - shares[:, None] * self.along).max(0)
        self.half = np.abs(self.along) + self.off
        self._cut = cut
        self._parts: tuple[_Piece, ...] | None = None

    @property
    def parts(self) -> tuple[_Piece, ...]:
        """What it consists of."""
        if self._parts is None:
            self._parts = self._cut()
        return self._parts


def _piece_of(curve: Array) -> _Piece:
    def cut() -> tuple[_Piece, ...]:
        middle = len(curve) // 2
        return (_piece_of(curve[: middle + 1]), _piece_of(curve[middle:])) if len(curve) > _ENDS else ()

    return _Piece(curve, cut)


def _hull(postures: Sequence[Joints | Array], cut: Callable[[], tuple[_Piece, ...]]) -> _Piece:
    """All that lies between some postures [rad], (n, 7), whichever joint moves first."""
    all_of_them = np.array(postures)
    low, high = all_of_them.min(0), all_of_them.max(0)
    piece = _Piece(0.5 * (low + high)[None], cut)
    piece.off = piece.half = 0.5 * (high - low)
    return piece


_ENDS = 2
_TINY = 1e-12  # [rad²]
_STILL = _Piece(np.zeros((1, JOINT_COUNT)), tuple)
"""Instead of the other arm's, where what stands still is compared."""


class ArmMotion:
    """How an arm moves, and where it may come on its way to rest.

    Args:
        planned: where the robot plans to be [rad], (7,).
        sent: how the position sent moves.
        robot: how the robot itself moves where speeds are fed forward to it; None where it follows the position sent.
        limits: of the joints.
        coasts_to: where the robot may go if it is not heard any more [rad], (7,).
    """

    def __init__(
        self,
        planned: Joints,
        sent: Setpoint,
        robot: Setpoint | None,
        limits: JointLimits,
        coasts_to: Joints | None = None,
    ) -> None:
        self.planned, self.sent, self.robot, self.coasts_to = planned, sent, robot, coasts_to
        self._limits = limits

    @cached_property
    def _paths(self) -> tuple[BrakingPath, ...]:
        """How each joint comes to rest, as the position sent."""
        return braking_paths(self.sent, self._limits)

    @cached_property
    def length(self) -> float:
        """How far all joints together get from where they are until they rest [rad]."""
        return sum(path.highest - path.lowest for path in self._paths)

    # The pieces hold no motion: the control process collects no garbage, and what refers to itself would stay for ever.

    @cached_property
    def ahead(self) -> _Piece:
        """Where a new command may lead the arm that it did not come by earlier ones: its way to rest."""
        limits, starts = self._limits, [self.sent] if self.robot is None else [self.sent, self.robot]
        postures = _extremes(self.sent, self._paths)
        if self.robot is not None:
            postures += _extremes(self.robot, braking_paths(self.robot, limits))
        return _hull(postures, lambda: tuple(_piece_of(braking_positions(start, limits, _SAMPLES)) for start in starts))

    @cached_property
    def way(self) -> _Piece:
        """Where it may come from now on: from where the robot plans to be to where it rests.

        A robot follows the position sent late, by the time constant of its position loop; what that takes it off the
        way of that position is left to the margin.
        """
        ahead, planned = self.ahead, self.planned
        ends = [self.sent.position, self.coasts_to, self.robot and self.robot.position]
        lines = [end for end in ends if end is not None]
        postures = (ahead.middle - ahead.half, ahead.middle + ahead.half, np.array(planned), *map(np.array, lines))
        return _hull(postures, lambda: (*(_piece_of(_line(planned, end)) for end in lines), *(ahead.parts or (ahead,))))


def _extremes(start: Setpoint, paths: Sequence[BrakingPath]) -> tuple[Joints, ...]:
    """How far the joints get backwards and forwards while they brake [rad], (7,) each."""
    rows = list(zip(start.position, paths, strict=True))
    return joints([at + path.lowest for at, path in rows]), joints([at + path.highest for at, path in rows])


def _line(begin: Joints, end: Joints) -> Array:
    first, last = np.array(begin), np.array(end)
    return np.asarray(first + np.linspace(0.0, 1.0, _SAMPLES + 1)[:, None] * (last - first))


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


@dataclass(slots=True)
class _Progress:
    """Whether an arm that is limited still comes nearer to where it is commanded.

    Attributes:
        desired: what it is commanded.
        measured: where it was measured then [rad], (7,).
        nearest: how near to the position desired it was sent since [rad].
        waited: for how long it has come no nearer than that while it could have [s].
        limited: what has limited it meanwhile.
        elsewhere: how far the other arm has to move before this one, if held, tries again [rad].
        held_by: what is known of the other arm and of permitted pairs since it is held; None while it is not.
    """

    desired: ArmCommand
    measured: Joints
    nearest: float
    waited: float = 0.0
    limited: Limited | None = None
    elsewhere: float = _ELSEWHERE
    held_by: _Surroundings | None = None


class _Surroundings(NamedTuple):
    """What an arm is limited by, besides what stands still.

    Attributes:
        position: that the other arm is sent to [rad], (7,); None of one that is unknown.
        heard: what is known of it: whether it is heard, was read, and may not have come to where it was sent.
        margins: of all pairs of parts.
    """

    position: Joints | None
    heard: tuple[bool, bool, bool]
    margins: Array


@dataclass(slots=True)
class _Arm:
    """What is known of one arm.

    Attributes:
        motion: of the command sent last; None before the first.
        is_heard: whether its robot's datagrams arrive.
        is_read: whether its joints were read from the controller since they did.
        limited: what limits it in this cycle.
        boundaries: near it.
        compared: its motion, the other arm's and the margins that were found to be clear last.
        progress: how it gets on with what it is commanded; None while it is commanded nothing.
    """

    motion: ArmMotion | None = None
    is_heard: bool = False
    is_read: bool = False
    limited: Limited | None = None
    boundaries: list[Boundary] = field(default_factory=list)
    compared: tuple[ArmMotion, ArmMotion | None, Array] | None = None
    progress: _Progress | None = None


class CollisionLimiter:
    """Says of both arms' commands whether they keep the arms apart.

    Args:
        model: the shapes.
        limits: of the joints: how hard they brake.
        gain: of the robots' position loops [1/s].
        margin: the distance kept [m].
    """

    def __init__(self, model: CollisionModel, limits: JointLimits, gain: float, margin: float = MARGIN) -> None:
        self.model = model
        self.margin = margin
        self._limits = limits
        self._gain = gain
        self._arms = {side: _Arm() for side in Side}
        self._is_of = {side: np.zeros(len(model.names), dtype=bool) for side in Side}
        for side, parts in model.arms.items():
            self._is_of[side][parts] = True
        is_shoulder = model.frames == 0
        # The shoulders are as near to the other arm as to the body, and bolted to it.
        is_near = is_shoulder | (np.array(model.names) == "body")
        self._declared = np.where(is_near[:, None] | is_near, min(margin, BODY_MARGIN), margin)
        # Of parts within their margins, how near they may be [m].
        self._floors: dict[tuple[Side, bool], dict[tuple[int, int], float]] = {
            (side, is_alone): {} for side in Side for is_alone in (False, True)
        }
        self.permit()

    def arm(self, side: Side) -> ArmCollisionLimiter:
        """The part of it that one arm's limiter asks."""
        return ArmCollisionLimiter(self, side)

    def pairs_of(self, name: str, other: str) -> int:
        """How many pairs of parts have these names, in either order; see :meth:`permit`."""
        return int(np.triu(self._found(name, other)).sum())

    def permit(self, *pairs: tuple[str, str]) -> None:
        """Let the parts of these names touch, and no others.

        A name is that of a part (``right gripper``), of an arm (``right arm``) or of what stands still (``table``).
        """
        margins = self._declared.copy()
        for pair in pairs:
            margins[self._found(*pair)] = -inf
        self._margins = margins
        for arm in self._arms.values():
            arm.boundaries = []

    def _found(self, name: str, other: str) -> NDArray[np.bool_]:
        """Which pairs of parts of an arm, and of the other one or what stands still, have these names.

        ``right arm`` is all of the arm, and ``right gripper`` all that is fixed to its tool0: the fingers, a camera,
        cups and declared tools, too.
        """
        first, second = (np.array(self.model.names) == wanted for wanted in (name, other))
        for side, its in self._is_of.items():
            for group, parts in (("arm", its), ("gripper", its & (self.model.frames == TOOL_FRAME))):
                first, second = (
                    found | parts if wanted == f"{side.word} {group}" else found
                    for found, wanted in ((first, name), (second, other))
                )
        one_arm = sum(np.outer(its, its) for its in self._is_of.values()) > 0
        still = ~(self._is_of[Side.RIGHT] | self._is_of[Side.LEFT])
        return np.asarray((np.outer(first, second) | np.outer(second, first)) & ~one_arm & ~np.outer(still, still))

    def begin_cycle(self, side: Side) -> None:
        """Nothing limits an arm so far."""
        arm = self._arms[side]
        if arm.progress is not None:
            arm.progress.limited = arm.limited or arm.progress.limited
        arm.limited = None

    def holds(self, side: Side, desired: ArmCommand | None, measured: Joints, dt: float) -> bool:
        """Whether an arm is to hold whatever is desired; to be asked once in a cycle, at its begin.

        Two arms that are pushed at each other each slide along a boundary that the other one moves, for ever. So an arm
        that is limited has to come nearer to where it is commanded, in joint space, or it is held: until it is
        commanded something else, or what limits it has changed. The other arm has to move twice as far each time that
        was of no use; so both come to rest.

        Args:
            side: which arm.
            desired: what it is commanded; None for nothing.
            measured: where it was measured [rad], (7,).
            dt: time since the cycle before [s].
        """
        arm = self._arms[side]
        if desired is None or arm.motion is None:
            arm.progress = None
            return False
        progress, far = arm.progress, dist(desired.position, arm.motion.sent.position)
        if progress is None or not _is_same(desired, measured, progress):
            arm.progress = _Progress(desired, measured, far)
            return False
        if progress.held_by is not None:
            if not self._has_changed(side, progress):
                arm.limited = progress.limited
                return True
            progress.held_by, progress.waited, arm.boundaries = None, 0.0, []
        if far < progress.nearest - min(_NEARER, _NEARER_SHARE * progress.nearest):
            arm.progress = _Progress(desired, measured, far)
        elif progress.limited is not None and arm.motion.length < _SLOW:  # a faster one has to slow down first
            progress.waited += dt
            if progress.waited > _PATIENCE:
                progress.desired, progress.measured = desired, measured
                progress.held_by, arm.limited = self._surroundings(side), progress.limited
                return True
        return False

    def _surroundings(self, side: Side) -> _Surroundings:
        its = self._arms[side.other]
        position = its.motion.sent.position if its.motion is not None else None
        coasts = its.motion is not None and its.motion.coasts_to is not None
        return _Surroundings(position, (its.is_heard, its.is_read, coasts), self._margins)

    def _has_changed(self, side: Side, progress: _Progress) -> bool:
        """Whether what holds an arm has changed by so much that it tries again."""
        before, now = progress.held_by, self._surroundings(side)
        assert before is not None
        if before.heard != now.heard or before.margins is not now.margins:
            progress.elsewhere = _ELSEWHERE
            return True
        if before.position is now.position or before.position is None or now.position is None:
            return before.position is not now.position
        if dist(before.position, now.position) <= progress.elsewhere:
            return False
        progress.elsewhere *= 2.0
        return True

    def limited(self, side: Side) -> Limited | None:
        """What limits an arm in this cycle."""
        return self._arms[side].limited

    def connection_lost(self, side: Side) -> None:
        """An arm's datagrams do not arrive any more: it goes on to where its last command leads it.

        The other arm keeps clear of that until they arrive again, or the arm's joints are read; see :meth:`stands`.
        """
        arm = self._arms[side]
        if not arm.is_heard or arm.motion is None:
            return
        arm.is_heard, arm.is_read, motion = False, False, arm.motion
        coasts_to = motion.sent.position
        if motion.robot is not None and self._gain > 0.0:
            rows = zip(motion.robot.position, motion.robot.velocity, strict=True)
            coasts_to = joints([p + v / self._gain for p, v in rows])
        arm.motion = ArmMotion(motion.planned, motion.sent, motion.robot, self._limits, coasts_to)

    def stands(self, side: Side, position: Joints) -> None:
        """An arm that is not heard was read from the controller to be at ``position`` [rad], (7,).

        The other arm keeps clear of what lies between there and where it was read before.
        """
        arm = self._arms[side]
        if arm.is_heard:
            return
        last, arm.is_read = arm.motion, True
        before = last.sent.position if last is not None else position
        # It may not have come yet to where its last command leads it.
        coasts_to = last.coasts_to if last is not None and dist(before, position) > _NOISE else None
        arm.motion = ArmMotion(before, Setpoint(position), None, self._limits, coasts_to)

    def sent(self, side: Side, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> None:
        """An arm is sent a command, whatever :meth:`accepts` says of it; arguments as there."""
        arm = self._arms[side]
        if not arm.is_heard or not _stays(arm.motion, planned, sent, robot):
            arm.motion = ArmMotion(planned, sent, robot, self._limits)
        arm.is_heard = True

    def accepts(self, side: Side, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> bool:
        """Whether an arm may be sent this command; if so, it is taken.

        Args:
            side: which arm.
            planned: where its robot plans to be [rad], (7,).
            sent: how the position sent would move at the end of this cycle's step.
            robot: how the robot would, where a speed is fed forward.
        """
        arm = self._arms[side]
        is_back, arm.is_heard = not arm.is_heard, True
        last, its = arm.motion, self._arms[side.other].motion
        if last is not None and not is_back and _stays(last, planned, sent, robot):
            # What it stands at may have left it, or have come nearer; else nothing has changed.
            if not arm.boundaries or arm.compared == (last, its, self._margins):
                return True
            motion = last
        else:
            motion = ArmMotion(planned, sent, robot, self._limits)
        # Its first command is where it stands.
        if last is None or self._is_clear(side, motion, last):
            arm.motion = motion
            arm.compared = (motion, its, self._margins)
            return True
        return False

    def _is_clear(self, side: Side, motion: ArmMotion, last: ArmMotion) -> bool:
        """Whether an arm keeps apart from everything on all of its way to rest, whichever arm is quicker.

        Args:
            side: which arm.
            motion: its motion, should the command be sent.
            last: that of the command before.
        """
        arm, its = self._arms[side], self._arms[side.other].motion
        arm.boundaries = []
        if not self._is_apart(side, motion, last, None):
            return False
        return its is None or self._is_apart(side, motion, last, its)

    def _is_apart(self, side: Side, motion: ArmMotion, last: ArmMotion, its: ArmMotion | None) -> bool:
        """Whether it keeps apart from the other arm; ``its`` None: from what stands still."""
        reach, floors, limited = self.model.reach, None, None
        parts = self.model.arms[side], self.model.arms[side.other]
        pieces: list[tuple[_Piece, _Piece]] = [(motion.ahead, _STILL if its is None else its.way)]
        compared = 0
        while pieces:
            mine, theirs = pieces.pop()
            halves = (mine.half, theirs.half) if side is Side.RIGHT else (theirs.half, mine.half)
            moved = reach @ np.concatenate(halves)
            own, others = (float(moved[each].max()) for each in parts)
            larger, smaller = (mine, theirs) if own >= others else (theirs, mine)
            if own + others <= _COARSE or not larger.parts:
                if compared == _POSTURES:
                    break
                compared += 1
                lack = self._lack(side, mine, theirs, moved, floors or {}, motion, its)
                if lack is not None and floors is None:
                    floors = self._floors_of(side, last, its)
                    if floors:
                        lack = self._lack(side, mine, theirs, moved, floors, motion, its)
                if lack is None:
                    continue
                limited = lack.limited
                larger, smaller = (mine, theirs) if lack.is_mine_longer else (theirs, mine)
                if lack.is_certain or not (larger.parts or smaller.parts):
                    break
            cut = larger if larger.parts else smaller
            pieces += [(part, theirs) if cut is mine else (mine, part) for part in cut.parts]
        else:
            return True
        self._arms[side].limited = limited
        return False

    def _lack(
        self,
        side: Side,
        mine: _Piece,
        theirs: _Piece,
        moved: Array,
        floors: Mapping[tuple[int, int], float],
        motion: ArmMotion,
        its: ArmMotion | None,
    ) -> _Lack | None:
        """Which parts may be too near on these pieces of both arms' ways; None where none are.

        Args:
            side: which arm.
            mine: of its way.
            theirs: of the other arm's.
            moved: how far each part may be from where it is in the middle of both [m].
            floors: of parts within their margins.
            motion: the arm's, should the command be sent.
            its: the other arm's; None where what stands still is compared.
        """
        model, steers = self.model, motion.length < _SLOW
        right, left = (mine, theirs) if side is Side.RIGHT else (theirs, mine)
        furthest = float(moved[model.arms[side]].max() + moved[model.arms[side.other]].max())
        seen = max(furthest - _TOLERANCE, _BOUNDARY_WITHIN if steers else 0.0)
        postures = np.concatenate((right.middle, left.middle))
        near = model.contacts(postures, max(self.margin, 0.0) + seen, side if its is None else None)
        margins = self._margins
        beyond = near.distances - margins[near.firsts, near.seconds]
        off = moved[near.firsts] + moved[near.seconds]
        if steers:
            self._add_boundaries(side, mine, near, np.where(off < _SHORT, beyond, inf))
        lacking = np.flatnonzero(beyond < np.maximum(off - _TOLERANCE, 0.0))
        if not len(lacking):
            return None
        # Not all that moves comes nearer: how far along the line of nearest distance.
        bends = model.reach @ np.concatenate(
            [piece.half * (np.cumsum(piece.half) - 0.5 * piece.half) for piece in (right, left)]
        )
        nearer = bends[near.firsts[lacking]] + bends[near.seconds[lacking]]
        for which, piece in ((Side.RIGHT, right), (Side.LEFT, left)):
            is_of = self._is_of[which]
            concerned = np.flatnonzero(is_of[near.firsts[lacking]] | is_of[near.seconds[lacking]])
            if len(concerned) and piece.half.any():
                behind, slopes = model.slopes(lacking[concerned], which)
                forward = np.abs(slopes @ piece.along) + np.abs(slopes) @ piece.off - behind
                nearer[concerned] += np.maximum(forward.max(1), 0.0)
        nearer = np.minimum(nearer, off[lacking])
        beyond, off = beyond[lacking], off[lacking]
        free = beyond - np.maximum(nearer - _TOLERANCE, 0.0)
        for index, at in enumerate(lacking.tolist()) if floors else ():
            # A part within its margin already comes no nearer, and may leave it.
            floor = floors.get(self._pair(side, near, at))
            if floor is not None:
                beyond[index] = float(near.distances[at]) - floor + _ALLOWED_APPROACH
                free[index] = beyond[index] - nearer[index]
        worst = int(free.argmin())
        if free[worst] >= 0.0:
            return None
        at = int(lacking[worst])
        part, its_part = self._pair(side, near, at)
        return _Lack(
            self._limited_by(side, part, its_part, float(near.distances[at])),
            is_certain=bool(beyond[worst] + off[worst] < 0.0),
            is_mine_longer=bool(moved[part] >= moved[its_part]),
        )

    def _limited_by(self, side: Side, part: int, other: int, distance: float) -> Limited:
        names, its = self.model.names, self._arms[side.other]
        is_old = self._is_of[side.other][other] and not its.is_heard and not its.is_read
        return Limited(names[part], names[other] + (_LAST_HEARD if is_old else ""), distance)

    def _floors_of(self, side: Side, last: ArmMotion, its: ArmMotion | None) -> dict[tuple[int, int], float]:
        """Of parts that are within their margins now, how near they may be to each other [m]."""
        postures = (last, its or last) if side is Side.RIGHT else (its or last, last)
        positions, margins = np.concatenate([each.sent.position for each in postures]), self._margins
        near = self.model.contacts(positions, max(self.margin, 0.0), side if its is None else None)
        within: dict[tuple[int, int], float] = {}
        for index in np.flatnonzero(near.distances < margins[near.firsts, near.seconds]).tolist():
            pair = self._pair(side, near, index)
            within[pair] = min(float(near.distances[index]), within.get(pair, inf))
        # What was once left does not come back; an arm that came nearer all the same may go on from there.
        known = self._floors[side, its is None]
        floors = {}
        for pair, now in within.items():
            floor = known.get(pair, now)
            least = min(floor, float(margins[pair]) - _SPARE)
            floors[pair] = now if now < floor - _MOVED else max(now, min(floor, max(now, least)))
        self._floors[side, its is None] = floors
        return floors

    def _pair(self, side: Side, near: Contacts, index: int) -> tuple[int, int]:
        """The parts of a contact, that of the arm first."""
        first, second = int(near.firsts[index]), int(near.seconds[index])
        return (first, second) if self._is_of[side][first] else (second, first)

    def _add_boundaries(self, side: Side, mine: _Piece, near: Contacts, beyond: Array) -> None:
        """Note what the arm must not cross; of two parts where they are nearest."""
        arm = self._arms[side]
        found = {each.limited[:2]: each for each in arm.boundaries}
        nearest = np.flatnonzero(beyond < _BOUNDARY_WITHIN)
        nearest = nearest[np.argsort(beyond[nearest])[:_CORNERS]]
        for index in nearest.tolist():
            part, other = self._pair(side, near, index)
            limited, lacks = self._limited_by(side, part, other, float(near.distances[index])), float(beyond[index])
            if limited[:2] in found and found[limited[:2]].beyond <= lacks:
                continue
            behind, slopes = self.model.slopes(np.array([index]), side)
            normal = -slopes[0, int(behind[0].argmin())]
            found[limited[:2]] = Boundary(normal, float(normal @ mine.middle) - lacks, limited, lacks)
        arm.boundaries = sorted(found.values(), key=lambda each: each.beyond)[:_CORNERS]

    def steered(self, side: Side, desired: ArmCommand) -> ArmCommand:
        """The command next to ``desired`` that stays on this side of the boundaries near an arm."""
        arm, limited = self._arms[side], None
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
                is_clear, limited = False, boundary.limited
                position = boundary.along(position, missing)
                inwards = fsum([n * v for n, v in zip(boundary.normal, velocity, strict=True)])
                if inwards < 0.0:
                    velocity = boundary.along(velocity, -inwards)
            if is_clear:
                break
        if limited is None:
            return desired
        arm.limited = limited
        return ArmCommand(joints(position), joints(velocity) if any(velocity) else ZERO)


_LAST_HEARD = " where EGM reported it last"
"""Added to the name of a part of an arm whose datagrams do not arrive."""


class _Lack(NamedTuple):
    """Two parts that may come too near.

    Attributes:
        limited: which.
        is_certain: whether smaller pieces would say the same.
        is_mine_longer: whether the arm itself moves further on its piece than the other one.
    """

    limited: Limited
    is_certain: bool
    is_mine_longer: bool


class ArmCollisionLimiter(NamedTuple):
    """What the limiter of one arm asks of and reports to :class:`CollisionLimiter`; methods as there."""

    both: CollisionLimiter
    side: Side

    @property
    def limited(self) -> Limited | None:
        return self.both.limited(self.side)

    def begin_cycle(self) -> None:
        self.both.begin_cycle(self.side)

    def holds(self, desired: ArmCommand | None, measured: Joints, dt: float) -> bool:
        return self.both.holds(self.side, desired, measured, dt)

    def connection_lost(self) -> None:
        self.both.connection_lost(self.side)

    def stands(self, position: Joints) -> None:
        self.both.stands(self.side, position)

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


def _is_same(desired: ArmCommand, measured: Joints, before: _Progress) -> bool:
    """Whether an arm is commanded the same as before, but for noise and for what its own motion makes of it."""
    last = before.desired
    if desired.position == last.position and desired.velocity == last.velocity:
        return True
    moved = dist(measured, before.measured)
    is_same_speed = dist(desired.velocity, last.velocity) <= _SAME_SPEED
    return is_same_speed and dist(desired.position, last.position) <= _SAME + _OWN * moved
