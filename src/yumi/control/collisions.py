"""The collision limiter: it keeps both arms apart from each other, from the body and from what stands around the robot.

The invariant, for whatever moves the arms: if both arms brake now as hard as they may, no two parts
come nearer to each other than the margin. A command is sent only if the whole of its braking path is clear of the whole
of the other arm's; else the arm brakes, along the path that was found clear when the command before was sent. So what
was once kept is kept, however the commands are chosen. And if the link of either arm is lost, now or while it brakes,
nothing touches where it goes on to without commands.

Whether a command is clear is decided by ``collision.cpp`` (docs/explanation/decisions/0032-arms-keep-apart.md).

This is no safety function: a person in the way, or a part that was not declared, is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import byref
from math import dist, fsum, inf, isfinite
from struct import Struct
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from yumi.control.motion import Setpoint, plan_gain
from yumi.control.progress_check import ProgressCheck, Surroundings
from yumi.control.shared_state import Limited
from yumi.robot import collision_library
from yumi.robot.collision import TOOL_FRAME, Array, CollisionModel
from yumi.robot.joints import ZERO, ArmCommand, JointLimits, Joints, Side, joints

MARGIN = 0.010
"""No two parts, padding included, come nearer to each other than this [m]."""

BODY_MARGIN = -0.002
"""From the body and the other arm's shoulder the arms keep half of their padding: at home they are that near [m]."""

_COASTING = -0.003  # [m] between parts of arms that coast: a quarter of the padding is left
_COASTING_AHEAD = 0.0  # [m] the same where a speed is fed forward: when it is taken back, the way changes slightly
DISTANCES = 20_000
"""Calculated for an arm in a cycle at most; what needs more is left to slower commands."""

_SHARE_AHEAD = 0.25  # of the distances, for where a robot coasts to which a speed is fed forward; else it follows late
_WITHHELD_FOR = 5  # cycles in which no speed is fed forward to a robot that would have coasted too far
_NOISE = 1e-3  # [rad] of where the robot plans to be
_EXACT = 1e-6  # [m]
_STAYS = 1e-6  # [rad]
_FLAT = 1e-4  # [m²/rad²] of a boundary's slope, below which no joint leads away from it
_REPEATS = 3  # of leading off one boundary after the other
_SENT, _ELSE = Struct("28d"), Struct("30d")  # of a motion as collision.cpp reads it
_NOTHING_ELSE = bytes(_ELSE.size)


class ArmMotion:
    """How an arm moves, and where it may come until it rests.

    Args:
        planned: where the robot plans to be [rad], (7,).
        sent: how the position sent moves.
        robot: how the robot itself moves where speeds are fed forward to it; None where it follows the position sent.
        coasts_to: where the robot may go if it is not heard any more [rad], (7,).

    Attributes:
        packed: as ``collision.cpp`` reads it.
    """

    def __init__(
        self, planned: Joints, sent: Setpoint, robot: Setpoint | None, coasts_to: Joints | None = None
    ) -> None:
        self.planned, self.sent, self.robot, self.coasts_to = planned, sent, robot, coasts_to
        p, v, a = sent
        self.packed = _SENT.pack(*planned, *p, *v, *a)
        if robot is None and coasts_to is None:  # nearly always
            self.packed += _NOTHING_ELSE
        else:
            p, v, a = robot or _NO_SETPOINT
            self.packed += _ELSE.pack(robot is not None, *p, *v, *a, coasts_to is not None, *(coasts_to or ZERO))

    def stays(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> bool:
        """Whether a command changes nothing; arguments as of the class. Most of the time an arm stands."""
        if self.sent != sent or self.robot != robot or self.coasts_to is not None:
            return False
        return self.planned is planned or dist(self.planned, planned) < _NOISE


_NO_SETPOINT = Setpoint(ZERO)


class Boundary:
    """What an arm must not cross: ``normal`` · position ≥ ``least``, near where it was calculated.

    Args:
        found: by ``collision.cpp``.
        limited: the pair of parts.
    """

    __slots__ = ("_square", "least", "limited", "normal")

    def __init__(self, found: collision_library.Boundary, limited: Limited) -> None:
        self.normal: list[float] = list(found.normal)
        self.least: float = found.least
        self.limited = limited
        self._square = max(fsum([n * n for n in self.normal]), _FLAT)

    def missing(self, position: Sequence[float]) -> float:
        """By how much a position [rad] is beyond it [m]."""
        return self.least - fsum([n * p for n, p in zip(self.normal, position, strict=True)])

    def along(self, values: Sequence[float], change: float) -> list[float]:
        """Values of the joints, changed so that they lead away from it by ``change``."""
        return [value + n * change / self._square for n, value in zip(self.normal, values, strict=True)]


class CollisionLimiter:
    """Keeps both arms apart: what is known of them together; :meth:`arm` says of one arm's commands whether they may.

    Args:
        model: the shapes.
        limits: of the joints: how hard they brake.
        gain: of the robots' position loops [1/s].
        margin: the distance kept [m].
        distances: that may be calculated for an arm in a cycle.

    Attributes:
        model, limits, margin, distances: as above.
        gain: at which the robots' plans close their leads [1/s], see :func:`plan_gain`.
        is_of: which parts are an arm's, (parts,).
        margins: between all pairs of parts [m], (parts, parts); another array when other pairs may touch.
        library, handle: ``collision.cpp``, and what it calls this.
    """

    def __init__(
        self,
        model: CollisionModel,
        limits: JointLimits,
        gain: float,
        margin: float = MARGIN,
        distances: int = DISTANCES,
    ) -> None:
        if not (isfinite(margin) and isfinite(gain)):
            raise ValueError(f"margin {margin} m and gain {gain} 1/s: both must be finite")
        self.model = model
        self.margin = margin
        self.limits = limits
        self.gain = plan_gain(gain)
        self.distances = distances
        self._arms = {side: ArmCollisionLimiter(self, side) for side in Side}
        for side, arm in self._arms.items():
            arm.other = self._arms[side.other]
        self.is_of = {side: np.zeros(len(model.names), dtype=bool) for side in Side}
        for side, parts in model.arms.items():
            self.is_of[side][parts] = True
        # The shoulders are as near to the other arm as to the body, and bolted to it.
        is_near = model.frames == 0
        is_near[model.body] = True
        self._declared = np.where(is_near[:, None] | is_near, min(margin, BODY_MARGIN), margin)
        self.library = collision_library.load()
        numbers = {name: number for number, name in enumerate(model.names)}
        names = np.array([numbers[name] for name in model.names])
        braking = np.array([*limits.acceleration, *limits.jerk, self.gain])
        self.handle: int = self.library.limiter_new(model.handle, braking.ctypes.data, names.ctypes.data)
        if not self.handle:
            raise MemoryError("no memory to keep the arms apart")
        finalize(self, self.library.limiter_delete, self.handle).atexit = False  # threads may still use it
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
        self.library.limiter_permit(self.handle, margins.ctypes.data)
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
        other: that of the other arm.
        motion: of the command sent last; None before the first.
        is_heard: whether its robot's datagrams arrive.
        is_read: whether its joints were read from the controller since they did.
        limited: what limits it in this cycle.
        boundaries: near it.
    """

    other: ArmCollisionLimiter

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
        self._distances_left = both.distances  # in this cycle
        self._decision = collision_library.Decision()
        self._feedforward_withheld_for = 0  # cycles, since the robot would have coasted too far with it
        self._coasts_into: Limited | None = None  # what it would have coasted into

    def begin_cycle(self, desired: ArmCommand | None, measured: Joints, dt: float) -> bool:
        """Whether the arm is to hold whatever is desired: see :class:`ProgressCheck`, as for the arguments."""
        before, self.limited, self._distances_left = self.limited, None, self._both.distances
        self._feedforward_withheld_for = max(self._feedforward_withheld_for - 1, 0)
        self._coasts_into = self._coasts_into if self._feedforward_withheld_for else None
        if self.motion is None:
            return False
        was_held, sent = self._progress.limited, self.motion.sent.position
        limited = before if before is not None and self._is_slow else None  # a faster one has to slow down first
        is_held = self._progress.holds(desired, measured, sent, dt, limited, self._surroundings)
        if is_held:
            self.limited = self._progress.limited
        elif was_held is not None:
            self.boundaries = []
        return is_held

    def _surroundings(self) -> Surroundings:
        its = self.other
        position = its.motion.sent.position if its.motion is not None else None
        coasts = its.motion is not None and its.motion.coasts_to is not None
        is_limited = its.limited is not None or its._progress.is_limited
        return Surroundings(position, (its.is_heard, its.is_read, coasts), self._both.margins, is_limited)

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
        self.motion = ArmMotion(motion.planned, motion.sent, motion.robot, coasts_to)

    def note_measured(self, position: Joints) -> None:
        """An arm that is not heard was read from the controller to be at ``position`` [rad], (7,).

        The other arm keeps clear of what lies between there and where it was read before.
        """
        if self.is_heard:
            return
        last, self.is_read = self.motion, True
        before = last.sent.position if last is not None else position
        # It may not have come yet to where its last command leads it.
        coasts_to = last.coasts_to if last is not None and dist(before, position) > _NOISE else None
        self.motion = ArmMotion(before, Setpoint(position), None, coasts_to)

    def sent(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> None:
        """An arm is sent a command that :meth:`accepts` has not accepted; arguments as there."""
        if not self.is_heard or self.motion is None or not self.motion.stays(planned, sent, robot):
            self.motion = ArmMotion(planned, sent, robot)
        self.is_heard = True
        self.limited = self.limited or self._coasts_into

    def accepts(self, planned: Joints, sent: Setpoint, robot: Setpoint | None, *, feeds_forward: bool = False) -> bool:
        """Whether an arm may be sent this command; if so, it is taken.

        Args:
            planned: where its robot plans to be [rad], (7,).
            sent: how the position sent would move at the end of this cycle's step.
            robot: how the robot would, where a speed is fed forward.
            feeds_forward: whether one is desired; else it is only taken back.
        """
        is_back, self.is_heard = not self.is_heard, True
        last, its = self.motion, self.other.motion
        if last is not None and not is_back and last.stays(planned, sent, robot):
            # What it stands at may have left it, or have come nearer; else nothing has changed.
            known = zip(self._compared, (last, its, self._both.margins), strict=True)
            if not self.boundaries or all(before is now for before, now in known):
                self.limited = self.limited or self._coasts_into
                return True
            motion = last
        else:
            motion = ArmMotion(planned, sent, robot)
        # Its first command is where it stands.
        if last is None or (
            self._is_clear(motion, last) and self._coasts_clear(motion, last, feeds_forward=feeds_forward)
        ):
            self.motion = motion
            self._compared = (motion, its, self._both.margins)
            self.limited = self.limited or self._coasts_into
            return True
        return False

    @property
    def may_feed_forward(self) -> bool:
        """Whether a speed may be fed forward; else the robot would coast too far if its link were lost."""
        return self._feedforward_withheld_for == 0

    @property
    def _is_slow(self) -> bool:
        """Whether the arm is led along boundaries; a faster one is slowed down first."""
        return self.motion is not None and bool(
            self._both.library.limiter_is_slow(self._both.handle, self.motion.packed)
        )

    def _is_clear(self, motion: ArmMotion, last: ArmMotion) -> bool:
        """Whether an arm keeps apart from everything on all of its braking path, whichever arm is quicker.

        Args:
            motion: its motion, should the command be sent.
            last: that of the command before.
        """
        if self._distances_left <= 0:
            return False
        is_clear, limited = self._decide(motion, last, self._distances_left)
        if limited is not None:
            self.limited = limited
        found = self._decision
        self.boundaries = [
            Boundary(each, self._limited_by(each.part, each.other, each.distance))
            for each in (found.boundaries[: found.boundary_count] if found.boundary_count else ())
        ]
        return is_clear

    def _coasts_clear(self, motion: ArmMotion, last: ArmMotion, *, feeds_forward: bool) -> bool:
        """Whether nothing touches wherever both arms would coast without their links; arguments as above."""
        its = self.other.motion
        if motion.robot is None and (its is None or its.robot is None):
            return True  # robots that are sent positions only go nowhere else
        share, apart = (_SHARE_AHEAD, _COASTING_AHEAD) if feeds_forward else (1.0, _COASTING)
        most = int(share * self._both.distances)
        is_clear, limited = self._decide(motion, last, min(self._distances_left, most), apart)
        if not is_clear:
            self._coasts_into = limited or self._coasts_into
            self._feedforward_withheld_for = _WITHHELD_FOR if feeds_forward else self._feedforward_withheld_for
        return is_clear

    def _decide(self, motion: ArmMotion, last: ArmMotion, most: int, apart: float = inf) -> tuple[bool, Limited | None]:
        """Whether ``collision.cpp`` finds a motion clear after ``last``, and what is too near, where that is known.

        Args:
            motion: an arm's, should the command be sent.
            last: that of the command before.
            most: distances that may be calculated for it.
            apart: how far parts have to stay from each other where robots coast without their links [m]; where they
                move with them when it is infinite.
        """
        both, found, its = self._both, self._decision, self.other.motion
        is_clear: bool = both.library.limiter_is_clear(
            both.handle,
            _NUMBERS[self.side],
            motion.packed,
            last.packed,
            its.packed if its is not None else None,
            apart,
            most,
            byref(found),
        )
        self._distances_left -= found.distances
        is_known = not is_clear and found.part >= 0
        return is_clear, self._limited_by(found.part, found.other, found.distance) if is_known else None

    def _limited_by(self, part: int, other: int, distance: float) -> Limited:
        names, its = self._both.model.names, self.other
        is_old = self._both.is_of[self.side.other][other] and not its.is_heard and not its.is_read
        return Limited(names[part], names[other] + (_LAST_HEARD if is_old else ""), distance)

    def steered(self, desired: ArmCommand) -> ArmCommand:
        """The command next to ``desired`` that stays on this side of the boundaries near an arm."""
        limited, now = None, self.motion.sent.position if self.motion is not None else desired.position
        # First an arm is slowed down on its path: where that is free after all, it is not left. One that is to stay
        # where it is stays there, though it may be nearer than where it would be led to.
        if not self.boundaries or not self._is_slow or dist(desired.position, now) < _STAYS:
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

_NUMBERS = {side: number for number, side in enumerate(Side)}
