"""Keeps both arms apart from each other, from the body and from what stands around the robot.

The invariant, kept in every cycle for whatever moves the arms: if both arms brake now as hard as they may, no two parts
come nearer to each other than the margin. A command is sent only if the whole of its braking path is clear of the whole
of the other arm's; else the arm brakes, along the path that was found clear when the command before was sent. So what
was once kept is kept, however the commands are chosen.

A braking path is a segment in which each joint has a range; its middle is the posture whose distances are calculated,
and no part is further from there than its reach from each joint times half of that joint's range. Where that is too
much to say that the arms keep apart, the segment is cut in two (docs/explanation/decisions/0032-arms-keep-apart.md).

This is no safety function: a person in the way, or a part that was not declared, is not seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from math import dist, fsum, inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from yumi.control.braking import ALONG, HALF, MIDDLE, NOISE, OFF, STILL, ArmMotion, Segment
from yumi.control.motion import Setpoint
from yumi.control.shared_state import Limited
from yumi.robot.collision import TOOL_FRAME, Array, CollisionModel, Contacts, Query
from yumi.robot.joints import JOINT_COUNT, ZERO, ArmCommand, JointLimits, Joints, Side, joints

MARGIN = 0.010
"""No two parts, padding included, come nearer to each other than this [m]."""

BODY_MARGIN = -0.002
"""From the body and the other arm's shoulder the arms keep half of their padding: at home they are that near [m]."""

_TOLERANCE = 5e-4  # [m] a path is off the postures that are compared by more, or it counts as being there
_COMPARISONS = 48  # of pairs of segments for an arm in a cycle at most; what needs more is left to slower commands
_COARSE = 0.15  # [m] segments in which parts move further are cut at once: too many others are that near
_FINE = 0.05  # [m] or, down to this, those that had to be cut in the last cycles all the same
_AT_ONCE = 16  # unless there are as many of them
_SIMILAR = 0.5  # of two segments, that in which parts move by this share of the other's is cut with it
_SHORT = 5e-3  # [m] segments in which parts move less are taken for straight
_BOUNDARY_WITHIN = 0.002  # [m] a boundary so near is led along
_SLOW = 0.06  # [rad] an arm that comes to rest within this is led along a boundary; a faster one is slowed down first
_CORNERS = 3  # boundaries that count at once
_EXACT = 1e-6  # [m]
_ALLOWED_APPROACH = 1e-4  # [m] in a cycle, of a part within its margin
_SPARE = 5e-4  # [m] so far within its margin a part may turn round
_MOVED = 3e-4  # [m] one that came nearer by more did so for another reason, and may go on from there
_FLAT = 1e-4  # [m²/rad²] of a boundary's slope, below which no joint leads away from it
_REPEATS = 3  # of leading off one boundary after the other


class Boundary:
    """What an arm must not cross: ``normal`` · position ≥ ``least``, near where it was calculated.

    Attributes:
        normal: by how much a radian of each joint moves the parts apart [m/rad], (7,).
        least: [m].
        limited: the pair of parts.
        beyond: how far the arm is on this side of it on its braking path [m].
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


class Surroundings(NamedTuple):
    """What an arm is limited by, besides what stands still.

    Attributes:
        position: that the other arm is sent to [rad], (7,); None of one that is unknown.
        heard: what is known of it: whether it is heard, was read, and may not have come to where it was sent.
        margins: of all pairs of parts.
        is_limited: whether the other arm is limited itself.
    """

    position: Joints | None
    heard: tuple[bool, bool, bool]
    margins: Array
    is_limited: bool


_LIMITED_FOR = 0.15  # [s] an arm may be limited for so long without getting nearer to where it is commanded
_NEARER = 1e-3  # [rad] by less it is no nearer
_NEARER_SHARE = 0.1  # nor by less than this share of what is left
_SAME = 5e-4  # [rad] a position desired that changes by less is the same
_OWN = 0.5  # a proportional controller's changes with the arm itself, by less than this share of its motion
_SAME_SPEED = 1e-2  # [rad/s]
_ELSEWHERE = 0.02  # [rad] when the other arm has moved by this, an arm that is held tries again


class ProgressCheck:
    """Whether an arm that is limited still comes nearer to where it is commanded; else it is held.

    Two arms that are pushed at each other each slide along a boundary that the other one moves, for ever. So an arm
    that is limited has to come nearer in joint space, or it holds until it is commanded something else, or what limits
    it has changed. If the other arm is limited itself, it has to move twice as far each time that trying again was of
    no use; so both come to rest.

    Attributes:
        limited: what limits an arm that is held.
    """

    def __init__(self) -> None:
        self.limited: Limited | None = None
        self._held_by: Surroundings | None = None  # as they were when it was held; None while it is not
        self._desired: ArmCommand | None = None
        self._measured: Joints = ZERO  # where it was when it was commanded that
        self._nearest = inf  # [rad] how near it was sent to the position desired since
        self._limited_for = 0.0  # [s] without getting nearer than that
        self._elsewhere = _ELSEWHERE

    @property
    def is_limited(self) -> bool:
        """Whether it has been limited since it came nearer to where it is commanded."""
        return self._limited_for > 0.0 or self._held_by is not None

    def holds(
        self,
        desired: ArmCommand | None,
        measured: Joints,
        sent: Joints,
        dt: float,
        limited: Limited | None,
        surroundings: Surroundings,
    ) -> bool:
        """Whether the arm is to hold whatever is desired; to be asked in every cycle.

        Args:
            desired: what it is commanded; None for nothing.
            measured: where it is [rad], (7,).
            sent: the position it was sent last [rad], (7,).
            dt: time since the cycle before [s].
            limited: what limited it in that cycle, unless it was too fast to be led along a boundary.
            surroundings: as they are now.
        """
        if desired is None or not self._is_same(desired, measured):
            self._begin(desired, measured, inf if desired is None else dist(desired.position, sent))
            return False
        if self._held_by is not None:
            if not self._have_changed(self._held_by, surroundings):
                return True
            self._held_by, self.limited, self._limited_for = None, None, 0.0
            return False
        far = dist(desired.position, sent)
        if far < self._nearest - min(_NEARER, _NEARER_SHARE * self._nearest):
            self._begin(desired, measured, far)
        elif limited is not None:
            self._limited_for += dt
            if self._limited_for > _LIMITED_FOR:
                self._held_by, self.limited = surroundings, limited
                self._desired, self._measured = desired, measured
        return self._held_by is not None

    def _begin(self, desired: ArmCommand | None, measured: Joints, far: float) -> None:
        self._desired, self._measured, self._nearest = desired, measured, far
        self._held_by, self.limited = None, None
        self._limited_for, self._elsewhere = 0.0, _ELSEWHERE

    def _have_changed(self, before: Surroundings, now: Surroundings) -> bool:
        """Whether what holds the arm has changed by so much that it tries again."""
        if before.heard != now.heard or before.margins is not now.margins:
            self._elsewhere = _ELSEWHERE
            return True
        if before.position is now.position or before.position is None or now.position is None:
            return before.position is not now.position
        if not now.is_limited:  # it goes where it wants to: it is not pushed away by this one
            self._elsewhere = _ELSEWHERE
        if dist(before.position, now.position) <= self._elsewhere:
            return False
        self._elsewhere *= 2.0
        return True

    def _is_same(self, desired: ArmCommand, measured: Joints) -> bool:
        """Whether the arm is commanded the same as before, but for noise and for what its own motion makes of it."""
        last = self._desired
        if last is None:
            return False
        if desired.position == last.position and desired.velocity == last.velocity:
            return True
        moved = dist(measured, self._measured)
        is_same_speed = dist(desired.velocity, last.velocity) <= _SAME_SPEED
        return is_same_speed and dist(desired.position, last.position) <= _SAME + _OWN * moved


class CollisionLimiter:
    """Keeps both arms apart: what is known of them together; :meth:`arm` says of one arm's commands whether they may.

    Args:
        model: the shapes.
        limits: of the joints: how hard they brake.
        gain: of the robots' position loops [1/s].
        margin: the distance kept [m].

    Attributes:
        model, limits, gain, margin: as above.
        is_of: which parts are an arm's, (parts,).
        margins: between all pairs of parts [m], (parts, parts); another array when other pairs may touch.
    """

    def __init__(self, model: CollisionModel, limits: JointLimits, gain: float, margin: float = MARGIN) -> None:
        self.model = model
        self.margin = margin
        self.limits = limits
        self.gain = gain
        self._arms = {side: ArmCollisionLimiter(self, side) for side in Side}
        self.is_of = {side: np.zeros(len(model.names), dtype=bool) for side in Side}
        for side, parts in model.arms.items():
            self.is_of[side][parts] = True
        is_shoulder = model.frames == 0
        # The shoulders are as near to the other arm as to the body, and bolted to it.
        is_near = is_shoulder | (np.array(model.names) == "body")
        self._declared = np.where(is_near[:, None] | is_near, min(margin, BODY_MARGIN), margin)
        self.permit()

    def arm(self, side: Side) -> ArmCollisionLimiter:
        """What one arm's limiter asks."""
        return self._arms[side]

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
        self.margins = margins
        for arm in self._arms.values():
            arm.boundaries = []

    def _found(self, name: str, other: str) -> NDArray[np.bool_]:
        """Which pairs of parts of an arm, and of the other one or what stands still, have these names.

        ``right arm`` is all of the arm, and ``right gripper`` all that is fixed to its tool0: the fingers, a camera,
        cups and declared tools, too.
        """
        first, second = (np.array(self.model.names) == wanted for wanted in (name, other))
        for side, its in self.is_of.items():
            for group, parts in (("arm", its), ("gripper", its & (self.model.frames == TOOL_FRAME))):
                first, second = (
                    found | parts if wanted == f"{side.word} {group}" else found
                    for found, wanted in ((first, name), (second, other))
                )
        one_arm = sum(np.outer(its, its) for its in self.is_of.values()) > 0
        still = ~(self.is_of[Side.RIGHT] | self.is_of[Side.LEFT])
        return np.asarray((np.outer(first, second) | np.outer(second, first)) & ~one_arm & ~np.outer(still, still))

    def limited(self, side: Side) -> Limited | None:
        """What limits an arm in this cycle."""
        return self._arms[side].limited


class ArmCollisionLimiter:
    """Says of one arm's commands whether they keep the arms apart; see :class:`CollisionLimiter`.

    Attributes:
        side: which arm.
        motion: of the command sent last; None before the first.
        is_heard: whether its robot's datagrams arrive.
        is_read: whether its joints were read from the controller since they did.
        limited: what limits it in this cycle.
        boundaries: near it.
    """

    def __init__(self, both: CollisionLimiter, side: Side) -> None:
        self.side = side
        self.motion: ArmMotion | None = None
        self.is_heard = self.is_read = False
        self.limited: Limited | None = None
        self.boundaries: list[Boundary] = []
        self._both = both
        # Its motion, the other arm's and the margins that were found to be clear last.
        self._compared: tuple[ArmMotion | None, ArmMotion | None, Array | None] = (None, None, None)
        self._progress = ProgressCheck()
        # Of parts within their margins, how near they may be [m].
        self._floors: dict[tuple[int, int], float] = {}
        self._comparisons_left = _COMPARISONS  # in this cycle
        self._coarse = _COARSE  # [m] segments in which parts move further are cut at once, as it proved useful

    @property
    def other(self) -> ArmCollisionLimiter:
        """That of the other arm."""
        return self._both.arm(self.side.other)

    def begin_cycle(self, desired: ArmCommand | None, measured: Joints, dt: float) -> bool:
        """Whether the arm is to hold whatever is desired: see :class:`ProgressCheck`, as for the arguments."""
        before, self.limited, self._comparisons_left = self.limited, None, _COMPARISONS
        if self.motion is None:
            return False
        its, is_slow = self.other, self.motion.length < _SLOW  # a faster one has to slow down first
        position = its.motion.sent.position if its.motion is not None else None
        coasts = its.motion is not None and its.motion.coasts_to is not None
        is_limited = its.limited is not None or its._progress.is_limited
        surroundings = Surroundings(position, (its.is_heard, its.is_read, coasts), self._both.margins, is_limited)
        was_held, sent, limited = self._progress.limited, self.motion.sent.position, before if is_slow else None
        is_held = self._progress.holds(desired, measured, sent, dt, limited, surroundings)
        if is_held:
            self.limited = self._progress.limited
        elif was_held is not None:
            self.boundaries = []
        return is_held

    def connection_lost(self) -> None:
        """An arm's datagrams do not arrive any more: it goes on to where its last command leads it.

        The other arm keeps clear of that until they arrive again, or the arm's joints are read: :meth:`note_measured`.
        """
        if not self.is_heard or self.motion is None:
            return
        self.is_heard, self.is_read, motion = False, False, self.motion
        coasts_to = motion.sent.position
        if motion.robot is not None and self._both.gain > 0.0:
            rows = zip(motion.robot.position, motion.robot.velocity, strict=True)
            coasts_to = joints([p + v / self._both.gain for p, v in rows])
        self.motion = ArmMotion(motion.planned, motion.sent, motion.robot, self._both.limits, coasts_to)

    def note_measured(self, position: Joints) -> None:
        """An arm that is not heard was read from the controller to be at ``position`` [rad], (7,).

        The other arm keeps clear of what lies between there and where it was read before.
        """
        if self.is_heard:
            return
        last, self.is_read = self.motion, True
        before = last.sent.position if last is not None else position
        # It may not have come yet to where its last command leads it.
        coasts_to = last.coasts_to if last is not None and dist(before, position) > NOISE else None
        self.motion = ArmMotion(before, Setpoint(position), None, self._both.limits, coasts_to)

    def sent(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> None:
        """An arm is sent a command, whatever :meth:`accepts` says of it; arguments as there."""
        if not self.is_heard or self.motion is None or not self.motion.stays(planned, sent, robot):
            self.motion = ArmMotion(planned, sent, robot, self._both.limits)
        self.is_heard = True

    def accepts(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> bool:
        """Whether an arm may be sent this command; if so, it is taken.

        Args:
            planned: where its robot plans to be [rad], (7,).
            sent: how the position sent would move at the end of this cycle's step.
            robot: how the robot would, where a speed is fed forward.
        """
        is_back, self.is_heard = not self.is_heard, True
        last, its = self.motion, self.other.motion
        if last is not None and not is_back and last.stays(planned, sent, robot):
            # What it stands at may have left it, or have come nearer; else nothing has changed.
            known = zip(self._compared, (last, its, self._both.margins), strict=True)
            if not self.boundaries or all(before is now for before, now in known):
                return True
            motion = last
        else:
            motion = ArmMotion(planned, sent, robot, self._both.limits)
        # Its first command is where it stands.
        if last is None or self._is_clear(motion, last):
            self.motion = motion
            self._compared = (motion, its, self._both.margins)
            return True
        return False

    def _is_clear(self, motion: ArmMotion, last: ArmMotion) -> bool:
        """Whether an arm keeps apart from everything on all of its braking path, whichever arm is quicker.

        All pairs of segments of both arms' paths that may be too near are compared at once; those that are not decided
        by that are cut, and so on.

        Args:
            motion: its motion, should the command be sent.
            last: that of the command before.
        """
        its = self.other.motion
        if self._comparisons_left <= 0:
            return False
        self.boundaries = []
        floors: dict[tuple[int, int], float] | None = None
        violation: _Violation | None = None
        pairs = [(motion.ahead, STILL), *([(motion.ahead, its.reachable)] if its is not None else [])]
        is_first = True
        while pairs:
            compared = self._cut_long(pairs)
            self._comparisons_left -= len(compared.pairs) if compared else _COMPARISONS
            if compared is None or self._comparisons_left < 0:
                break
            near = self._near(compared, steers=motion.length < _SLOW)
            violation = self._violation(near, compared, floors or {})
            if violation is not None and floors is None:
                floors = self._floors_of(last, its)
                violation = self._violation(near, compared, floors) if floors else violation
            # Segments that have to be cut are so at once next time, as long as that is of use.
            self._coarse = max(_FINE, min(_COARSE, self._coarse * (1.5 if is_first and violation is None else 0.8)))
            if violation is None:
                return True
            pairs, is_first = [] if violation.is_certain else compared.cut_all(violation.undecided), False
        if violation is not None:
            self.limited = self._limited_by(violation.part, violation.other, violation.distance)
        return False

    def _near(self, compared: _Compared, *, steers: bool) -> Contacts:
        """What is near on pairs of segments, and, if the arm ``steers`` beside boundaries, those."""
        least, margin = _BOUNDARY_WITHIN if steers else 0.0, max(self._both.margin, 0.0)
        postures = compared.rows[:, :, MIDDLE].reshape(len(compared.pairs), -1)
        rows = zip(postures, compared.own, compared.others, compared.pairs, strict=True)
        near = self._both.model.contacts(
            *(
                Query(posture, max(own + others - _TOLERANCE, least) + margin, self.side if theirs is STILL else None)
                for posture, own, others, (_, theirs) in rows
            )
        )
        if steers:
            self._add_boundaries(near, compared)
        return near

    def _cut_long(self, pairs: list[_Pair]) -> _Compared | None:
        """Pairs of segments on which parts do not move too far to look at them, as far as they can be cut.

        None where these are too many.
        """
        coarse = self._coarse
        own_parts, other_parts = self._both.model.arms[self.side], self._both.model.arms[self.side.other]
        while len(pairs) <= _COMPARISONS:
            both = pairs if self.side is Side.RIGHT else [pair[::-1] for pair in pairs]
            rows = np.concatenate([each.rows for pair in both for each in pair]).reshape(len(pairs), 2, 4, JOINT_COUNT)
            moved = rows[:, :, HALF].reshape(len(pairs), -1) @ self._both.model.reach.T
            own, others = moved[:, own_parts].max(1), moved[:, other_parts].max(1)
            compared = _Compared(pairs, rows, moved, own.tolist(), others.tolist())
            far = own + others
            is_long = far > (coarse if len(pairs) < _AT_ONCE else _COARSE)
            if not is_long.any():
                return compared
            pairs = []
            for index, long in enumerate(is_long.tolist()):
                pairs += (long and compared.cut(index)) or [compared.pairs[index]]
            if len(pairs) == len(is_long):
                return compared
        return None

    def _violation(
        self, near: Contacts, compared: _Compared, floors: Mapping[tuple[int, int], float]
    ) -> _Violation | None:
        """Which parts may be too near on these segments of both arms' paths; None where none are.

        Args:
            near: parts that are near each other in the middles of the segments.
            compared: the segments.
            floors: of parts within their margins.
        """
        if not len(near.parts):
            return None
        model, rows, moved = self._both.model, compared.rows, compared.moved
        firsts, seconds = near.parts[:, 0], near.parts[:, 1]
        beyond = near.distances - self._both.margins[firsts, seconds]
        off = moved[near.queries, firsts] + moved[near.queries, seconds]
        lacking = np.flatnonzero(beyond < np.maximum(off - _TOLERANCE, 0.0))
        if not len(lacking):
            return None
        parts, segments = near.parts[lacking], near.queries[lacking]
        beyond, off = beyond[lacking], off[lacking]
        # Not all that moves comes nearer: how far along the line of nearest distance.
        half = rows[:, :, HALF]
        bends = (half * (half.cumsum(2) - 0.5 * half)).reshape(len(rows), -1) @ model.reach.T
        contacts, which = np.concatenate((lacking, lacking)), np.repeat(np.arange(2), len(lacking))
        concerned = np.flatnonzero(near.parts[contacts, which] < model.arms[Side.LEFT].stop)
        contacts, which = contacts[concerned], which[concerned]
        numbers, its = near.queries[contacts], near.parts[contacts, which]
        lines = rows[numbers, (its >= model.arms[Side.LEFT].start).astype(np.intp)]
        behind, slopes = model.slopes(near, contacts, which)
        forward = np.abs((slopes @ lines[:, ALONG, :, None])[:, :, 0]) - behind
        forward += (np.abs(slopes) @ lines[:, OFF, :, None])[:, :, 0]
        towards = np.zeros(2 * len(lacking))
        towards[concerned] = np.maximum(forward.max(1), 0.0) + bends[numbers, its]
        nearer = np.minimum(towards[: len(lacking)] + towards[len(lacking) :], off)
        free = beyond - np.maximum(nearer - _TOLERANCE, 0.0)
        for pair, floor in floors.items():
            # A part within its margin already comes no nearer, and may leave it.
            its = np.flatnonzero(((parts == pair) | (parts == pair[::-1])).all(1))
            beyond[its] = near.distances[lacking[its]] - floor
            free[its] = beyond[its] - nearer[its]
        worst = int(free.argmin())
        if free[worst] >= 0.0:
            return None
        # Each path comes as near to the middle of a segment as it is off the line.
        strays = rows[:, :, OFF].reshape(len(rows), -1) @ model.reach.T
        certain = beyond + strays[segments[:, None], parts].sum(1)
        is_certain = bool(certain.min() < 0.0)
        worst = int(certain.argmin()) if is_certain else worst
        part, other = self._own_first(parts[worst].tolist())
        distance = float(near.distances[lacking[worst]])
        return _Violation(part, other, distance, is_certain, sorted(set(segments[free < 0.0].tolist())))

    def _limited_by(self, part: int, other: int, distance: float) -> Limited:
        names, its = self._both.model.names, self.other
        is_old = self._both.is_of[self.side.other][other] and not its.is_heard and not its.is_read
        return Limited(names[part], names[other] + (_LAST_HEARD if is_old else ""), distance)

    def _floors_of(self, last: ArmMotion, its: ArmMotion | None) -> dict[tuple[int, int], float]:
        """Of parts that are within their margins now, how near they may be to each other [m]."""
        postures = (last, its or last) if self.side is Side.RIGHT else (its or last, last)
        positions, margins = np.concatenate([each.sent.position for each in postures]), self._both.margins
        kinds = (self.side,) if its is None else (self.side, None)
        near = self._both.model.contacts(*(Query(positions, max(self._both.margin, 0.0), alone) for alone in kinds))
        within: dict[tuple[int, int], float] = {}
        for index in np.flatnonzero(near.distances < margins[near.parts[:, 0], near.parts[:, 1]]).tolist():
            pair = self._own_first(near.parts[index].tolist())
            within[pair] = min(float(near.distances[index]), within.get(pair, inf))
        # What was once left does not come back; an arm that came nearer all the same may go on from there.
        floors = {}
        for pair, now in within.items():
            floor = self._floors.get(pair, now)
            floors[pair] = now if now < floor - _MOVED else max(now, min(floor, float(margins[pair]) - _SPARE))
        self._floors = floors
        return {pair: min(floor - _ALLOWED_APPROACH, within[pair]) for pair, floor in floors.items()}

    def _own_first(self, parts: Sequence[int]) -> tuple[int, int]:
        """The parts of a contact, that of the arm first."""
        first, second = parts
        return (first, second) if self._both.is_of[self.side][first] else (second, first)

    def _add_boundaries(self, near: Contacts, compared: _Compared) -> None:
        """Note what the arm must not cross; of two parts where they are nearest."""
        if not len(near.parts):
            return
        rows, moved = compared.rows, compared.moved
        firsts, seconds = near.parts[:, 0], near.parts[:, 1]
        beyond = near.distances - self._both.margins[firsts, seconds]
        is_short = moved[near.queries, firsts] + moved[near.queries, seconds] < _SHORT
        nearest = np.flatnonzero((beyond < _BOUNDARY_WITHIN) & is_short)
        if not len(nearest):
            return
        nearest = nearest[np.argsort(beyond[nearest])[:_CORNERS]]
        pairs = [self._own_first(parts) for parts in near.parts[nearest].tolist()]
        which = np.array([int(part != first) for (part, _), first in zip(pairs, firsts[nearest].tolist(), strict=True)])
        behind, slopes = self._both.model.slopes(near, nearest, which)
        middles = rows[near.queries[nearest], 0 if self.side is Side.RIGHT else 1, MIDDLE]
        found = {(each.limited.part, each.limited.other): each for each in self.boundaries}
        for row, (index, (part, other)) in enumerate(zip(nearest.tolist(), pairs, strict=True)):
            limited = self._limited_by(part, other, float(near.distances[index]))
            lacks, names = float(beyond[index]), (limited.part, limited.other)
            if names not in found or found[names].beyond > lacks:
                normal = -slopes[row, int(behind[row].argmin())]
                found[names] = Boundary(normal, float(normal @ middles[row]) - lacks, limited, lacks)
        self.boundaries = sorted(found.values(), key=lambda each: each.beyond)[:_CORNERS]

    def steered(self, desired: ArmCommand) -> ArmCommand:
        """The command next to ``desired`` that stays on this side of the boundaries near an arm."""
        limited = None
        if not self.boundaries or self.motion is None or self.motion.length >= _SLOW:
            # First an arm is slowed down on its path: where that is free after all, it is not left.
            return desired
        position, velocity = list(desired.position), list(desired.velocity)
        for _ in range(_REPEATS):
            is_clear = True
            for boundary in self.boundaries:
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
        self.limited = limited
        return ArmCommand(joints(position), joints(velocity) if any(velocity) else ZERO)


_LAST_HEARD = " where EGM reported it last"
"""Added to the name of a part of an arm whose datagrams do not arrive."""


class _Violation(NamedTuple):
    """Parts that may come too near to each other.

    Attributes:
        part: the arm's, of the worst pair.
        other: the other one.
        distance: between them in the middle of their segments [m].
        is_certain: whether smaller segments would say the same.
        undecided: the numbers of the pairs of segments on which parts may be too near.
    """

    part: int
    other: int
    distance: float
    is_certain: bool
    undecided: list[int]


_Pair = tuple[Segment, Segment]
"""Of the arm's braking path, and of the other one's."""


class _Compared(NamedTuple):
    """Pairs of segments that are compared at once.

    Attributes:
        pairs: as above, (n).
        rows: of the segments, the right arm's first, (n, 2, 4, 7).
        moved: how far each part may be from where it is in the middle of its segment [m], (n, parts).
        own: the most of it of the arm itself, (n).
        others: and of the other one, (n).
    """

    pairs: list[_Pair]
    rows: Array
    moved: Array
    own: list[float]
    others: list[float]

    def cut(self, index: int) -> list[_Pair]:
        """The parts of a pair: of that segment on which parts move further, or of both; none of the smallest."""
        (mine, theirs), own, others = self.pairs[index], self.own[index], self.others[index]
        cuts_mine = (own >= _SIMILAR * others or not theirs.parts) and bool(mine.parts)
        cuts_theirs = (others > _SIMILAR * own or not mine.parts) and bool(theirs.parts)
        if not (cuts_mine or cuts_theirs):
            return []
        return list(product(mine.parts if cuts_mine else (mine,), theirs.parts if cuts_theirs else (theirs,)))

    def cut_all(self, indices: Sequence[int]) -> list[_Pair]:
        """The parts of some pairs; none where one of them is the smallest: that is not decided by cutting."""
        parts = [self.cut(index) for index in indices]
        return [pair for each in parts for pair in each] if all(parts) else []
