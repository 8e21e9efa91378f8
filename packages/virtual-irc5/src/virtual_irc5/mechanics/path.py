"""The motion along a planned path of an arm: passages of its legs, triggers, speed limits, and paths put aside.

The arm keeps to the geometry of the path whatever happens to its speed: it slows down, stops, goes on at another
override along the same samples. Its speed is the programmed one where acceleration and speed of the joints allow it;
the distance on the path is averaged over some cycles, so that acceleration grows and falls steadily (limited jerk).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf, sqrt
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from abb_protocols.robot.joints import CYCLE, JointLimits, Joints
from virtual_irc5.mechanics.arm_motion import MotionState
from virtual_irc5.mechanics.path_geometry import Leg, LegSpeed, PathPiece

_Array = NDArray[np.float64]
SMOOTHING = 12  # cycles

PREFETCH = 0.193548
"""How long before the arm comes to a zone the program goes on, to plan the next move [s].

As long as ABB's motion planner is ahead of the arm: the default of the system parameter Std Servo Queue Time.
"""

_TURN_WEIGHT = 0.05  # [m/rad]: what turns of the tool count in the distance along the path
_JOINT_WEIGHT = 0.01  # [m/rad]
_ACCELERATION_SHARE = 0.6  # of the acceleration for going along, and as much for going round
_LOWEST_SPEED = 1e-3  # [m/s] of distance along the path, so that the end is reached
_SAME_DISTANCE = 1e-9  # [m] of distance
_SAME_TIME = 1e-9  # [s]
_SHORTEST_LEG = 1e-4  # [m] of distance: of a leg to where the arm already is, which ends in no corner


Offset = Callable[[], _Array]
"""Reads where the arm is to be beside its path."""


@dataclass(eq=False, slots=True)
class Passage:
    """A leg on the path.

    Attributes:
        leg: the geometry.
        run: the run it is on.
        begin: distance where the arm is on it: the middle of the corner before it [m].
        end: distance of its end, or of the middle of the corner there [m].
        zone_begin: distance where the zone at its end begins [m].
        offset: reads how far the arm is to be beside it, along the axes of the path [m], (3,); None where nothing
            corrects it.
    """

    leg: Leg
    run: PathRun
    begin: float
    end: float
    zone_begin: float = 0.0
    offset: Offset | None = None


class _Corrector(Protocol):
    """Moves the arm beside its path."""

    memory: Any
    """What a path that is put aside has to be restored with."""

    def corrected(self, position: Joints, passage: Passage, dt: float) -> Joints:
        """Where the arm is instead of a position on its path [rad], after ``dt`` [s]."""

    def restart(self) -> None:
        """The path begins anew where the arm stands."""


@dataclass(slots=True)
class PathTrigger:
    """What happens when the arm passes a place.

    Attributes:
        passage: the leg it is on.
        share: where on the leg, 0 to 1 of its samples' distance.
        lead: how much earlier it happens [s]; negative is later.
        action: what happens.
    """

    passage: Passage
    share: float
    lead: float
    action: Callable[[], None]

    @property
    def distance(self) -> float:
        """Where on the run it is now [m of distance]: a corner added later moves the end of its leg."""
        begin, end = self.passage.begin, self.passage.end
        return begin + (end - begin) * self.share


@dataclass(slots=True)
class PathAcceleration:
    """What AccSet, PathAccLim and their like have set.

    Attributes:
        factor: on all accelerations.
        along: most of the tool along the path [m/s²].
    """

    factor: float = 1.0
    along: float = 11.0


@dataclass(frozen=True, slots=True)
class SpeedLimit:
    """What no motion exceeds while the system input LimitSpeed is set (SpeedLimCheckPoint, SpeedLimAxis).

    Attributes:
        tool: of the tool's point [m/s].
        axes: of the joints, chain order [rad/s], (k,); () where none of them is limited.
    """

    tool: float = inf
    axes: tuple[float, ...] = ()


NO_LIMIT = SpeedLimit()


@dataclass(eq=False)
class PathRun:
    """A part of the path between two stops: samples over the distance.

    Attributes:
        distance: of the samples [m], rising.
        joints: [rad], (n, k).
        way: of the tool [m], (n,).
        turned: its turn [rad], (n,).
        tool_speed: that the program wants between a sample and the one before it [m/s], (n,).
        turn_speed: the same of its orientation [rad/s], (n,).
        possible: speed along the path, with all that lies ahead [m/s].
        along: acceleration along the path [m/s²].
        free: speed along the path that the joints allow, whatever the program wants [m/s].
        rows, slopes, places: joints, their derivatives and distances, as the cycle reads them.
        triggers: what happens where.
    """

    limits: JointLimits
    acceleration: PathAcceleration
    distance: _Array
    joints: _Array
    way: _Array
    turned: _Array
    tool_speed: _Array
    turn_speed: _Array
    possible: list[float] = field(default_factory=list)
    along: list[float] = field(default_factory=list)
    free: list[float] = field(default_factory=list)
    rows: list[tuple[float, ...]] = field(default_factory=list)
    slopes: list[tuple[float, ...]] = field(default_factory=list)
    places: list[float] = field(default_factory=list)
    triggers: list[PathTrigger] = field(default_factory=list)

    @property
    def length(self) -> float:
        return self.places[-1]

    def prepare(self, override: float, limit: SpeedLimit = NO_LIMIT) -> None:
        """The speeds that are possible, from the geometry."""
        distance, joints = self.distance, self.joints
        slopes = np.gradient(joints, distance, axis=0)
        bends = np.gradient(slopes, distance, axis=0)
        factor = _ACCELERATION_SHARE * self.acceleration.factor
        speed, most = np.array(self.limits.velocity), np.array(self.limits.acceleration) * factor
        if limit.axes:
            speed = np.minimum(speed, limit.axes)
        way_slopes = np.gradient(self.way, distance) if len(distance) > 2 else np.ones(len(distance))
        with np.errstate(divide="ignore"):
            along = np.min(most / np.maximum(np.abs(slopes), 1e-12), 1)
            along = np.minimum(along, _ACCELERATION_SHARE * self.acceleration.along / np.maximum(way_slopes, 1e-9))
            turning = np.sqrt(np.min(most / np.maximum(np.abs(bends), 1e-12), 1))
            fast = np.minimum(np.min(speed / np.maximum(np.abs(slopes), 1e-12), 1), turning)
            # Of each interval, and of a sample the slower of its two.
            steps = np.diff(distance)
            wanted = np.minimum(
                np.minimum(self.tool_speed[1:], limit.tool / override) * steps / np.maximum(np.diff(self.way), 1e-12),
                self.turn_speed[1:] * steps / np.maximum(np.diff(self.turned), 1e-12),
            )
        wanted = np.minimum(np.concatenate([wanted[:1], wanted]), np.concatenate([wanted, wanted[-1:]])) * override
        self.free = np.minimum(fast, limit.tool).tolist()
        fast = np.minimum(fast, wanted)
        fast[-1] = 0.0
        self.along = along.tolist()
        speeds, steps_list = fast.tolist(), steps.tolist()
        for index in range(len(speeds) - 2, -1, -1):  # so that it can slow down for what comes
            reachable = sqrt(speeds[index + 1] ** 2 + 2.0 * self.along[index] * steps_list[index])
            speeds[index] = min(speeds[index], reachable)
        self.possible = speeds
        self.rows, self.slopes = list(map(tuple, joints.tolist())), list(map(tuple, slopes.tolist()))
        self.places = distance.tolist()


@dataclass(frozen=True, slots=True)
class StoredPath:
    """A path that is put aside, with where the arm stood on it."""

    runs: tuple[PathRun, ...]
    passages: tuple[Passage, ...]
    shown: float
    position: Joints
    holds: frozenset[str]
    memory: Any = None


class PathMotion:
    """The motion along the path; a `Motion` of the arm.

    Args:
        position: where the arm stands [rad].
        limits: of the joints.

    Attributes:
        state: where the arm is planned to be.
        override: speed override, 0 to 1.
        speed_limit: what no motion exceeds, whatever the override.
        acceleration: what holds for legs that are added from now on.
        holds: the reasons why it stands though there is something ahead, such as a stop of the program.
        is_abandoned: whether it slows down and forgets what is ahead.
        prefetch: how long before the arm comes to a zone `is_due` [s].
        corrector: moves the arm beside its path; None where nothing does.
        nominal: where it would be without a corrector [rad].
        reaction_time: how much later the arm is where it is planned to be [s]: what happens at a place waits for it.
        corner_failed: called with the leg that was ended by a stop instead of a corner.
    """

    def __init__(self, position: Joints, limits: JointLimits) -> None:
        self.state = MotionState.standing(position)
        self.override = 1.0
        self.speed_limit = NO_LIMIT
        self.acceleration = PathAcceleration()
        self.holds: set[str] = set()
        self.is_abandoned = False
        self.prefetch = PREFETCH
        self.corrector: _Corrector | None = None
        self.nominal = position
        self.reaction_time = 0.0
        self._passed: list[list[Any]] = []  # triggers whose place the plan has passed: time left [s], action
        self._limits = limits
        self._runs: deque[PathRun] = deque()
        self._passages: deque[Passage] = deque()
        self._at = 0.0  # distance on the run that is passed now, before it is averaged
        self._speed = 0.0
        self._past: deque[float] = deque([0.0] * SMOOTHING, SMOOTHING)
        self._shown = 0.0
        self._index = 0
        self._shown_index = 0
        self._back: tuple[float, float] | None = None  # where it goes back to on the run [m], and how fast [m/s]

    # The program's side -------------------------------------------------------------------------------------------

    @property
    def end(self) -> Leg | None:
        """The last leg that was planned; None where the arm begins anew."""
        return self._passages[-1].leg if self._passages else None

    @property
    def is_empty(self) -> bool:
        """Whether nothing is ahead."""
        return not self._runs

    def has_corner(self, leg: Leg) -> bool:
        """Whether a leg is long enough to end in a corner."""
        return self._length(leg.piece) > _SHORTEST_LEG

    def restart_at(self, position: Joints) -> None:
        """Begin anew where the arm stands [rad]; what was ahead is forgotten."""
        self._runs.clear()
        self._passages.clear()
        self.is_abandoned = False
        self.state = MotionState.standing(position)
        self.nominal = position
        if self.corrector is not None:
            self.corrector.restart()
        self._rewind()

    def _rewind(self) -> None:
        self._at = self._speed = self._shown = 0.0
        self._past = deque([0.0] * SMOOTHING, SMOOTHING)
        self._index = self._shown_index = 0
        self._back = None

    def can_round(self) -> bool:
        """Whether the corner at the end of the last leg is still ahead."""
        if not self._passages or not self._runs:
            return False
        last = self._passages[-1]
        leg, run = last.leg, self._runs[-1]
        if leg.zone.is_stop or last.run is not run or leg.out >= len(leg.shares) - 1 or self.is_abandoned:
            return False
        return run is not self._runs[0] or self._at < last.zone_begin - _SAME_DISTANCE

    def append(self, leg: Leg, rounded: PathPiece | None = None) -> Passage:
        """Add a leg at the end of the path, behind a stop or, with a corner, on the run.

        Args:
            leg: begins where the last one ends.
            rounded: the corner from the last leg; only while `can_round`.
        """
        if rounded is None:
            pieces, begin, zero = [leg.piece], 0.0, np.zeros(1)
            joints = leg.piece.joints
            run = PathRun(self._limits, self.acceleration, np.zeros(1), joints[:1], zero, zero, zero, zero)
            if not np.any(self._steps(leg.piece) > _SAME_DISTANCE):  # nothing to do: passed at once
                run.places = [0.0]
                return Passage(leg, run, 0.0, 0.0)
            self._runs.append(run)
        else:
            run, last = self._runs[-1], self._passages[-1]
            kept = int(np.searchsorted(run.distance, last.zone_begin + _SAME_DISTANCE))
            for name in ("distance", "joints", "way", "turned", "tool_speed", "turn_speed"):
                setattr(run, name, getattr(run, name)[:kept])
            begin = float(run.distance[-1]) + self._length(rounded) / 2.0
            last.end = begin
            pieces = [rounded, leg.piece.part(leg.into, len(leg.shares) - 1)]
        speeds = [piece.speed for piece in pieces]
        for piece, speed in zip(pieces, speeds, strict=True):
            self._extend(run, piece, speed)
        if run is self._runs[0]:
            self._forget_passed(run)
        run.prepare(self.override, self.speed_limit)
        in_zone = self._length(leg.piece.part(leg.out, len(leg.shares) - 1))
        passage = Passage(leg, run, begin, run.length, run.length - in_zone)
        self._passages.append(passage)
        return passage

    def _extend(self, run: PathRun, piece: PathPiece, speed: LegSpeed) -> None:
        steps = self._steps(piece)
        keep = steps > _SAME_DISTANCE
        distances = float(run.distance[-1]) + np.cumsum(steps[keep])
        tool, turn = np.full(len(distances), speed.tool), np.full(len(distances), speed.turn)
        if speed.duration > 0.0:  # even over the distance, so that the whole takes this long
            length = float(np.sum(steps))
            scale = length / speed.duration / np.maximum(steps[keep], 1e-12)
            # A way or turn that is nothing but rounding limits nothing.
            way, turned = np.diff(piece.way)[keep], np.diff(piece.turned)[keep]
            tool, turn = (
                np.where(way > _SAME_DISTANCE, way * scale, np.inf),
                np.where(turned > _SAME_DISTANCE, turned * scale, np.inf),
            )
        run.distance = np.concatenate([run.distance, distances])
        run.joints = np.concatenate([run.joints, piece.joints[1:][keep]])
        run.way = np.concatenate([run.way, run.way[-1] + piece.way[1:][keep]])
        run.turned = np.concatenate([run.turned, run.turned[-1] + piece.turned[1:][keep]])
        run.tool_speed = np.concatenate([run.tool_speed, tool])
        run.turn_speed = np.concatenate([run.turn_speed, turn])

    def _forget_passed(self, run: PathRun) -> None:
        """Drop samples that lie behind the arm; distances stay."""
        passed = int(np.searchsorted(run.distance, self._shown)) - 3
        if passed > 0:
            for name in ("distance", "joints", "way", "turned", "tool_speed", "turn_speed"):
                setattr(run, name, getattr(run, name)[passed:])
        self._index = self._shown_index = 0

    @staticmethod
    def _steps(piece: PathPiece) -> _Array:
        """Distances between the samples: the way of the tool, with its turns and those of the joints."""
        joints = np.max(np.abs(np.diff(piece.joints, axis=0)), 1)
        turn = _TURN_WEIGHT * np.diff(piece.turned)
        return np.asarray(np.sqrt(np.diff(piece.way) ** 2 + turn**2 + (_JOINT_WEIGHT * joints) ** 2))

    def _length(self, piece: PathPiece) -> float:
        return float(np.sum(self._steps(piece)))

    def store(self) -> StoredPath:
        """Put what is ahead aside, with the reasons why the arm stands; the arm has to stand."""
        holds = frozenset(self.holds)
        memory = None if self.corrector is None else self.corrector.memory
        stored = StoredPath(tuple(self._runs), tuple(self._passages), self._shown, self.state.position, holds, memory)
        self.holds.clear()
        self.restart_at(self.state.position)
        return stored

    def restore(self, stored: StoredPath) -> None:
        """Put what was stored ahead again."""
        self.restart_at(stored.position)
        if self.corrector is not None and stored.memory is not None:
            self.corrector.memory = stored.memory
        self._runs, self._passages = deque(stored.runs), deque(stored.passages)
        self._shown = stored.shown
        self.holds |= stored.holds
        self.halt()

    def is_due(self, passage: Passage) -> bool:
        """Whether the next move is needed: the arm soon comes to the zone at a leg's end, or slows down for it."""
        if not self._runs or passage.run is not self._runs[0]:
            return passage.run not in self._runs
        run, speed = passage.run, self._speed
        if self._at >= passage.zone_begin:
            return True
        if speed <= 0.0 and (self.holds or self.override <= 0.0):
            return False
        most, fastest = min(run.along[self._index :]), max(run.possible[self._index :])
        braking = speed * speed / (2.0 * most)
        left = min(passage.zone_begin, run.length - braking) - self._at
        # It takes at least as long as it would while gaining speed, and as at the highest speed there.
        gaining = (sqrt(speed * speed + 2.0 * most * left) - speed) / most if left > 0.0 else 0.0
        return left <= 0.0 or max(gaining, left / fastest) <= self.prefetch

    def has_ended(self, passage: Passage) -> bool:
        """Whether the arm has passed a leg."""
        if not self._runs or passage.run is not self._runs[0]:
            return passage.run not in self._runs
        return self._shown >= passage.end

    def set_override(self, override: float) -> None:
        """Another speed override, 0 to 1; the path stays."""
        if override == self.override:
            return
        self.override = override
        for run in self._runs:
            run.prepare(override, self.speed_limit)

    def set_speed_limit(self, limit: SpeedLimit) -> None:
        """Another limit, also for what is under way; the path stays."""
        if limit == self.speed_limit:
            return
        self.speed_limit = limit
        for run in self._runs:
            run.prepare(self.override, limit)

    def step_back(self, length: float, duration: float) -> None:
        """Go back along the path from standstill, at most to the last stop point.

        Args:
            length: of the tool's way [m].
            duration: how long it takes [s], or longer where the joints cannot go that fast.
        """
        if not self._runs:
            return
        run = self._runs[0]
        way = float(np.interp(self._at, run.distance, run.way)) - length
        place = float(np.interp(way, run.way, run.distance)) if way > run.way[0] else float(run.distance[0])
        first, last = (int(np.searchsorted(run.distance, each)) for each in (place, self._at))
        passed = slice(max(first - 1, 0), last + 1)
        fastest = min(*run.free[passed], min(run.along[passed]) * SMOOTHING * CYCLE)  # reached in the averaged cycles
        self._back = place, min((self._at - place) / duration, fastest)
        self._index = self._shown_index = 0

    def hold(self, reason: str) -> None:
        """Slow down on the path and stay there while the reason is one of `holds`; a way back ends, too."""
        self.holds.add(reason)
        self.end_step_back()

    def end_step_back(self) -> None:
        """Stay where it is on the way back."""
        self._back = None

    @property
    def is_going_back(self) -> bool:
        return self._back is not None or not self.is_standing

    def abandon(self) -> None:
        """Slow down on the path, and forget what is ahead then."""
        self.is_abandoned = bool(self._runs)
        self.end_step_back()

    # The arm's side -----------------------------------------------------------------------------------------------

    @property
    def is_standing(self) -> bool:
        """Whether the arm has come to a stop on the path, at its end or before."""
        return self._speed == 0.0 and all(value == self._at for value in self._past)

    @property
    def is_finished(self) -> bool:
        return not self._runs or (bool(self.holds) and self.is_standing)

    def halt(self) -> None:
        """The arm was stopped by something else: go on from standstill later."""
        self._at, self._speed = self._shown, 0.0
        self._past = deque([self._shown] * SMOOTHING, SMOOTHING)
        self.end_step_back()
        self._index = self._shown_index = 0
        self.state = MotionState.standing(self.state.position)

    def advance(self, dt: float) -> None:
        if not self._runs:
            self.state = MotionState.standing(self.state.position)
            return
        run = self._runs[0]
        ahead = self._go(run, dt)
        past, before = self._past, self._shown
        past.append(ahead)
        shown = self._shown = ahead if past[0] == ahead else sum(past) / SMOOTHING
        old, position = self.state, self._position(run, shown)
        self.nominal = position
        if self.corrector is not None:
            position = self.corrector.corrected(position, self._passages[0], dt)
        velocity = tuple((a - b) / dt for a, b in zip(position, old.position, strict=True))
        change = tuple((a - b) / dt for a, b in zip(velocity, old.velocity, strict=True))
        self.state = MotionState(position, velocity, change)
        if run.triggers:
            rate = (shown - before) / dt
            for trigger in [
                each for each in run.triggers if shown + rate * each.lead >= each.distance - _SAME_DISTANCE
            ]:
                run.triggers.remove(trigger)
                self._passed.append([self.reaction_time, trigger.action])
        while len(self._passages) > 1 and self.has_ended(self._passages[0]):
            self._passages.popleft()
        if shown == run.length and past[0] == ahead:
            self.state = MotionState.standing(position)
            self._runs.popleft()
            self._rewind()
            self.is_abandoned = self.is_abandoned and bool(self._runs)
        elif self.is_abandoned and self.is_standing:
            self.restart_at(self.state.position)

    def act(self, dt: float) -> None:
        """Let what happens at places that the plan has passed happen when the arm is there, after ``dt`` [s]."""
        for each in list(self._passed):
            each[0] -= dt
            if each[0] <= _SAME_TIME:
                self._passed.remove(each)
                each[1]()

    @property
    def has_acted(self) -> bool:
        """Whether everything has happened at the places that the plan has passed."""
        return not self._passed

    def _go(self, run: PathRun, dt: float) -> float:
        """How far on the run the arm is after ``dt``, before that is averaged: a step of the speed law."""
        if self._back is not None:
            place, back = self._back
            self._at = max(place, self._at - back * dt)
            if self._at == place:
                self._back = None
            self._index = self._shown_index = 0
            return self._at
        places, at, speed, index = run.places, self._at, self._speed, self._index
        while index < len(places) - 2 and places[index + 1] <= at:
            index += 1
        self._index = index
        most = run.along[index]
        if self.holds or self.is_abandoned:
            new = max(0.0, speed - most * dt)
        else:
            new = min(speed + most * dt, self._cap(run, at + speed * dt, index))
            new = max(new, speed - 2.0 * most * dt, _LOWEST_SPEED)
        ahead = at + 0.5 * (speed + new) * dt
        if ahead >= run.length - _SAME_DISTANCE:
            ahead, new = run.length, 0.0
        self._at, self._speed = ahead, new
        return ahead

    @staticmethod
    def _cap(run: PathRun, at: float, index: int) -> float:
        """The speed that is possible at a distance, so that the arm can still slow down to that at the next sample."""
        places, possible = run.places, run.possible
        if at >= places[-1]:
            return 0.0
        while index < len(places) - 2 and places[index + 1] <= at:
            index += 1
        here, there, left = possible[index], possible[index + 1], places[index + 1] - at
        if there < here:
            return min(here, sqrt(there * there + 2.0 * run.along[index] * left))
        return sqrt(there * there - (there * there - here * here) * left / (places[index + 1] - places[index]))

    def _position(self, run: PathRun, at: float) -> Joints:
        """Between two samples: the cubic with their slopes."""
        places, index = run.places, self._shown_index
        while index < len(places) - 2 and places[index + 1] <= at:
            index += 1
        self._shown_index = index
        span = places[index + 1] - places[index]
        t = (at - places[index]) / span
        if t >= 1.0:
            return run.rows[index + 1]
        back = 1.0 - t
        of_first, of_second = (1.0 + 2.0 * t) * back * back, t * t * (3.0 - 2.0 * t)
        slope_first, slope_second = t * back * back * span, -t * t * back * span
        return tuple(
            a * of_first + b * of_second + c * slope_first + d * slope_second
            for a, b, c, d in zip(
                run.rows[index], run.rows[index + 1], run.slopes[index], run.slopes[index + 1], strict=True
            )
        )
