"""The limiter: the last step before the network. No command leaves that a robot must never get.

The limiter refuses what is not a number, keeps positions inside the joint limits, and lets the command move only as
fast, and change its motion only as quickly, as the joints may, measured from the command sent before. To hold means to
come to rest, then to repeat the last command, not the measured position, which creeps under load.

It does not trust the session. Whatever a datagram says, as long as the robot may be following earlier commands the next
one goes on from the last. What the feedback is worth is decided in :mod:`yumi.control.feedback`, which commands the
robot follows in :mod:`yumi.control.references` (docs/explanation/decisions/0014-feedback-is-doubted.md).

What is done with the arm follows from one state, and the table of :mod:`yumi.control.limiter_state`. How fast positions
change is limited in :mod:`yumi.control.position_limiter`, the speeds sent with them in
:mod:`yumi.control.feed_forward_limiter`, both within the factor of :mod:`yumi.control.speed_scale`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from math import dist, inf, isfinite
from typing import Any, NamedTuple

from yumi.control.collisions import ArmCollisionLimiter
from yumi.control.counters import LimiterCounters
from yumi.control.feed_forward_limiter import FedForward, FeedForwardLimiter
from yumi.control.feedback import DOUBTED, FeedbackCheck
from yumi.control.limiter_state import SETTLING_STATES, LimiterEvent, LimiterState, next_state
from yumi.control.motion import (
    EGM_GAIN,
    SERVO_CYCLES,
    braking_path,
    largest_difference,
    slower,
)
from yumi.control.position_delay import PositionDelay
from yumi.control.position_limiter import PositionLimiter, PositionMotion, inside, resting_at
from yumi.control.references import ReferenceMonitor
from yumi.control.shared_state import Limited, Problem
from yumi.control.speed_scale import FULL
from yumi.robot.joints import (
    CYCLE,
    ZERO,
    ArmCommand,
    ArmState,
    JointLimits,
    Joints,
    joints,
)

_HOP = 1e-3  # [rad] beside something an arm goes by so much at once
_HOPS = 0.1  # [rad/s] while it is slower than this

FEEDBACK_DELAY = 0.050
"""By how much the measured speed may be behind the robot's own, at most [s]."""

FOLLOWING = 5.0
"""Time constants of the robot's position loop after which it stands where its references lead it: what is left is less
than a hundredth of the lead. Until then a new session does not mean that the last command is of no effect."""

_TAKEN_AT_ONCE = 0.75  # of what a joint's speed may change in a cycle
_LATE = 1.25  # periods: the robot has repeated the last command meanwhile
_NO_TIME = 0.1  # of a period: nothing follows from how far something moved meanwhile
_NO_LEAD = 1e-4  # [rad] less than the joints' resolution
_SLIGHT_LEAD = 0.01  # [rad] a lead that a robot may follow at once
_PROBE = 1e-3  # [rad] the lead that shows whether a robot that ignored its references follows again
_SETTLING_TIME = 1.0  # [s] after which a command that is back settles no further
_NEAR = 0.02  # [rad] as near as a measured position is known
_CREEPS = 2e-5  # [rad] a command that follows the noise of an arm that stands moves less in a cycle


def _is_finite(command: ArmCommand) -> bool:
    return isfinite(sum(command.position) + sum(command.velocity))


class SentMotion(NamedTuple):
    """What one arm was sent so far, as far as the next command depends on it.

    Attributes:
        positions: sent so far.
        speeds: fed forward so far.
        is_at_rest: whether the command stands, and does not lead the robot any more.
        must_settle: whether the arm is held until its command is back where the arm is, whatever is desired.
        held_for: for how long the arm is held, and nothing else was desired [s].
        stop_within: the positions between which an arm that holds may come to rest [rad]; None while it does not hold.
        stop_at: where the arm holds while its feedback is implausible [rad], (7,); None while it is not.
        was_refused: whether nothing but braking kept the arms apart, and no command beside a boundary did since.
        counters: what was changed so far.
    """

    positions: PositionMotion
    speeds: FedForward = FedForward()
    is_at_rest: bool = True
    must_settle: bool = False
    held_for: float = 0.0
    stop_within: tuple[Joints, Joints] | None = None
    stop_at: Joints | None = None
    was_refused: bool = False
    counters: LimiterCounters = LimiterCounters()


def _counted(motion: SentMotion, **changed: bool) -> SentMotion:
    """A motion with the counters of what was changed one higher."""
    counters = motion.counters
    higher = {name: getattr(counters, name) + is_changed for name, is_changed in changed.items()}
    return motion._replace(counters=counters._replace(**higher))


class Limiter:
    """Limits the commands of one arm.

    In each cycle: :meth:`check` the state, :meth:`limit` the command, and :meth:`observe` after the reply.

    Attributes:
        state: what is done with the arm.

    Args:
        limits: of the joints; speeds, accelerations and jerks bound how the position sent moves, and how the robot
            moves where a speed is fed forward too.
        period: time between two states of the arm [s]. No command moves further than the joints may within this time,
            in which the robot takes a command, however long ago the one before was.
        gain: of the robot's position loop [1/s].
        other_arm: where the robot's other arm was measured last [rad], (7,); None where that is not known.
        collisions: what keeps the arm apart from the other one and from all else; None where nothing does.
        bandwidth: of the robot's low-pass filter on the speed [Hz]; 0 is none.
    """

    def __init__(
        self,
        limits: JointLimits,
        period: float = CYCLE,
        gain: float = EGM_GAIN,
        other_arm: Callable[[], Joints | None] = lambda: None,
        collisions: ArmCollisionLimiter | None = None,
        bandwidth: float = 0.0,
    ) -> None:
        self.state = LimiterState.NO_SESSION
        self._period = period
        most = [_TAKEN_AT_ONCE * top * period for top in limits.acceleration]
        self._taken_at_once = joints(most)  # [rad/s] a joint may change its speed by when it follows again
        self._limits = limits
        self._near = min(limits.acceleration) * FEEDBACK_DELAY / EGM_GAIN  # a lead that any robot may have
        self._gain = gain
        self._following = FOLLOWING / (gain if gain > 0.0 else EGM_GAIN)
        self._position_limiter = PositionLimiter(limits)
        self._feed_forward_limiter = FeedForwardLimiter(limits, gain, period)
        self._motion = SentMotion(resting_at(ZERO))
        self._feedback = FeedbackCheck(limits, other_arm)
        self._references = ReferenceMonitor(gain, limits.velocity, period, bandwidth)
        self._collisions = collisions
        self._session = 0
        self._sent_at = -inf
        self._checked: ArmState | None = None  # what was made of the newest state
        self._delay = PositionDelay()
        self._scale = self._scaled = FULL  # of speeds, and of positions
        self._scales = deque([FULL] * (SERVO_CYCLES + 2), SERVO_CYCLES + 2)  # of the last cycles

    @property
    def counters(self) -> LimiterCounters:
        """What was changed so far."""
        return self._motion.counters

    @property
    def is_waiting(self) -> bool:
        """Whether the command waits since the robot follows an older one."""
        return self.state is LimiterState.WAITING

    @property
    def is_at_rest(self) -> bool:
        """Whether the command stands, and does not lead the robot any more."""
        return self._motion.is_at_rest

    @property
    def problem(self) -> Problem:
        """Why the arm holds whatever is desired."""
        if self._feedback.is_lost:
            return Problem.IMPLAUSIBLE
        return Problem.REFERENCES_IGNORED if self._references.are_ignored else Problem.NONE

    @property
    def implausible_position(self) -> Joints:
        """The newest measured position that was not used [rad], (7,)."""
        return self._feedback.position

    @property
    def is_other_arm(self) -> bool:
        """Whether that is where the other arm is."""
        return self._feedback.is_other_arm

    @property
    def limited(self) -> Limited | None:
        """The parts that must not come nearer to each other, where that limits the arm in this cycle."""
        return self._collisions.limited if self._collisions else None

    def note_interruption(self) -> None:
        """No datagram of the arm arrives: the other arm keeps clear of where this one may go."""
        self._go(LimiterEvent.INTERRUPTION)
        self._lose_connection()

    def note_connection_lost(self) -> None:
        """No datagram has arrived for so long that the arm's controllers are deactivated; see above."""
        self._go(LimiterEvent.CONNECTION_LOST)
        self._lose_connection()

    def _lose_connection(self) -> None:
        if self._collisions is not None:
            self._collisions.connection_lost()

    def note_position(self, position: Joints) -> None:
        """The arm, whose datagrams do not arrive, was read from the controller to be at ``position`` [rad], (7,)."""
        if self._collisions is not None:
            self._collisions.note_measured(position)

    def scale_speed(self, scale: float) -> None:
        """Move no joint faster than ``scale`` times its limit: speeds from the next command on, positions later."""
        self._scale = scale
        self._feed_forward_limiter = FeedForwardLimiter(slower(self._limits, scale), self._gain, self._period)

    def _scale_positions(self) -> None:
        """Positions are sent later than the speeds that go with them, so their limits come down later, too."""
        self._scales.append(self._scale)
        if self._scaled != self._scale:
            self._scaled = max(self._scales)
            self._position_limiter = PositionLimiter(slower(self._limits, self._scaled))

    def check(self, state: ArmState) -> ArmState | None:
        """What of ``state`` is plausible; to be called before :meth:`limit`, which takes what this returns.

        A position that no arm can have reached is replaced by the last plausible one, and the plan by where the
        references lead it, as long as it is in doubt.

        Returns:
            None where no reply is safe: it is open whether the robot still follows, or where it is.
        """
        if state.session != self._session:
            checked = self._enter(state)
        elif self._feedback.is_plausible(state, self._motion.positions.position):
            checked = self._accept(state)
        else:
            # A plan that seemed to stand would hide that the lead becomes less as the robot goes on.
            last = self._feedback.reject(state)
            checked = self._references.expected(last) or last
            if self._feedback.is_lost:
                self._go(LimiterEvent.FEEDBACK_LOST)
            elif self._feedback.in_a_row >= DOUBTED:
                self._go(LimiterEvent.FEEDBACK_DOUBTED)
        if self._feedback.implausible != self.counters.implausible:
            self._change(counters=self.counters._replace(implausible=self._feedback.implausible))
        is_back = state.session == self._session and state.dt <= 0.0 and not state.is_running
        if checked is not None and is_back and dist(self._motion.positions.position, state.planned) >= _SLIGHT_LEAD:
            # After a silence, of a robot that does not follow: were it to begin by now, it would take the lead at once.
            self._rest()
            checked = None
        if self.state is LimiterState.BEGINNING and self._feedback.in_a_row:
            checked = None  # what is expected in place of a false position is of the session before
        is_followed = state.is_running and not self._feedback.in_a_row  # else the plan may be the expected one
        self._references.compare(checked if is_followed else None)
        self._checked = checked
        return checked

    def limit(self, state: ArmState, desired: ArmCommand | None) -> ArmCommand:
        """The command to send, next to ``desired``; None holds.

        The first command of a session in which the robot does not follow yet equals the measured position: a robot that
        begins to follow finds no step. So do the commands while the robot does not follow, once they have come there.
        """
        if state is not self._checked:
            checked = self.check(state)
            if checked is None:  # repeat the last command; before the first one, where the robot is
                if self._sent_at == -inf:
                    self._begin(state)
                return self._last
            state = checked
        is_accepted, motion = self._limit(state, desired), self._motion
        if self._collisions is not None and not is_accepted:
            self._collisions.sent(state.planned, motion.positions.moving, motion.speeds.robot)
        return ArmCommand(motion.positions.sent.position, motion.speeds.velocity)

    def _limit(self, state: ArmState, desired: ArmCommand | None) -> bool:
        """Go on with the motion for a state that was checked; whether the collision limiter has accepted it."""
        self._sent_at = state.time
        if self.state is LimiterState.BEGINNING:
            self._begin(state)
            self._go(LimiterEvent.FIRST_SENT)
            return False
        if state.dt <= 0.0:
            self._rest()  # without datagrams the command has stood still
        if not 0.0 < state.dt <= _LATE * self._period:
            self._resume(state)
        dt = min(state.dt, self._period)
        if dt < _NO_TIME * self._period:
            return False
        if self._feedback.in_a_row >= DOUBTED or not state.is_running:
            if self._feedback.in_a_row < DOUBTED:
                self._go(LimiterEvent.NOT_FOLLOWING)
            self._delay.clear()
            self._motion = self._come_to(self._motion, state, dt)
            return False
        return self._follow(state, desired, dt)

    def _follow(self, state: ArmState, desired: ArmCommand | None, dt: float) -> bool:
        """Go on with a robot that follows, and whose position is believed; returns what :meth:`_limit` does."""
        if desired is None or self._gain == 0.0 or not _is_finite(desired):
            self._delay.clear()
        else:
            desired = self._delay.next(desired, state.dt, self._motion.positions.position)
        was_waiting = self.state is LimiterState.WAITING
        self._go(self._event(state, desired))
        if self.state is LimiterState.WAITING:
            if not was_waiting:
                self._rest()  # to brake would lead it on by what it does not follow
            desired = self._place_to_wait()
            speeds = self._references.speeds(state, self._references.followed)
            self._change(speeds=self._feed_forward_limiter.follow(self._motion.speeds, speeds, dt))
        elif self.state is not LimiterState.FOLLOWING:
            desired = None
        is_accepted = False
        if self._collisions is None:
            self._motion = self._step(self._motion, state, desired, dt)
        else:
            self._motion, is_accepted = self._step_apart(self._collisions, self._motion, state, desired, dt)
        if self.state is LimiterState.SETTLING and not self._motion.must_settle:
            self._go(LimiterEvent.BACK)
        return is_accepted

    def _event(self, state: ArmState, desired: ArmCommand | None) -> LimiterEvent:
        """What a cycle brings of such a robot, and of what is desired."""
        references = self._references
        if references.are_ignored:
            return LimiterEvent.IGNORING
        if references.is_repeating if self.is_waiting else references.are_lost(self._taken_at_once):
            return LimiterEvent.REPEATING
        if desired is None or self._motion.must_settle:
            return LimiterEvent.UNDESIRED
        if not _is_finite(desired):
            self._count(refused=True)
            return LimiterEvent.UNUSABLE
        if not self._is_near(self._motion, state):
            self._count(slowed=True)
            return LimiterEvent.UNUSABLE
        return LimiterEvent.DESIRED

    def _go(self, event: LimiterEvent) -> None:
        """To the state that follows on an event, before anything else changes.

        Raises:
            ForbiddenTransition: the program is wrong. The cycle gets no reply, so that the robot keeps its reference.
        """
        self.state = next_state(self.state, event)
        if self.state in SETTLING_STATES:
            self._change(must_settle=True)

    def _change(self, **values: Any) -> None:
        """Go on with the motion as it was, but for what is different in it."""
        self._motion = self._motion._replace(**values)

    def _count(self, **changed: bool) -> None:
        self._motion = _counted(self._motion, **changed)

    def _rest(self) -> None:
        """Go on from rest."""
        self._change(positions=resting_at(self._motion.positions.position))

    def _resume(self, state: ArmState) -> None:
        """Go on with a robot that repeated the last command for a while."""
        motion = self._motion
        self._change(speeds=self._feed_forward_limiter.resume(motion.speeds, state, motion.positions.position))

    def _place_to_wait(self) -> ArmCommand:
        """Where a command waits: as near to the one that the robot follows as it may set out to at once."""
        last, gain = self._motion.positions.position, self._gain
        if gain == 0.0:
            return ArmCommand(last)
        rows = zip(self._references.followed.position, last, self._taken_at_once, strict=True)
        return ArmCommand(joints([p + max(-most / gain, min(most / gain, q - p)) for p, q, most in rows]))

    def _step_apart(
        self,
        collisions: ArmCollisionLimiter,
        motion: SentMotion,
        state: ArmState,
        wanted: ArmCommand | None,
        dt: float,
    ) -> tuple[SentMotion, bool]:
        """The first of some such motions that keeps the arms apart, and True; where none does, braking, and False."""
        is_held = collisions.begin_cycle(wanted, state.position, dt)
        candidates = (None,) if wanted is None else () if is_held else self._candidates(collisions, motion, wanted)
        found = motion
        for index, candidate in enumerate(candidates):
            found = self._step(motion, state, candidate, dt)
            feeds_forward = candidate is not None and candidate.velocity is not ZERO
            robot = found.speeds.robot
            if collisions.accepts(state.planned, found.positions.moving, robot, feeds_forward=feeds_forward):
                found = found._replace(was_refused=motion.was_refused and index > 0)
                if candidate is wanted or candidate is None or wanted is None:
                    return found, True
                # A robot that only follows later is not led elsewhere.
                is_elsewhere = candidate.position is not wanted.position
                is_withheld = wanted.velocity is not ZERO and not feeds_forward
                return _counted(found, kept_apart=is_elsewhere, feedforward_withheld=is_withheld), True
        positions = motion.positions
        if not positions.stands(dt):
            positions = self._position_limiter.brake(positions, dt)
        speeds = self._feed_forward_limiter.step(motion.speeds, state, positions.position, ZERO, dt)
        # What a refused motion has shown of how the arm comes to rest counts for the next one.
        braking = motion._replace(
            positions=positions,
            speeds=speeds,
            is_at_rest=False,
            must_settle=found.must_settle,
            stop_within=found.stop_within,
            was_refused=not is_held,
        )
        return _counted(braking, kept_apart=True), False

    def _candidates(
        self, collisions: ArmCollisionLimiter, motion: SentMotion, desired: ArmCommand
    ) -> Iterator[ArmCommand]:
        """What may be sent in place of ``desired``, one after the other until one is accepted."""
        first = collisions.steered(desired)
        feeds_forward = first.velocity is not ZERO
        if not feeds_forward or collisions.may_feed_forward:
            yield first
        if feeds_forward and not collisions.may_feed_forward:
            yield ArmCommand(first.position)  # may go there, but the robot has to follow it late
        # What was compared has found the boundary; where that does not change the command, it is refused again.
        along = collisions.steered(desired)
        if along != first and not motion.was_refused:
            yield along
        position, velocity, _ = motion.positions.moving
        far = largest_difference(desired.position, position)
        if far > _HOP and max(map(abs, velocity)) < _HOPS:
            # On its way to a far goal each joint is as quick as it may, which leads elsewhere than straight there.
            rows = zip(position, desired.position, strict=True)
            yield ArmCommand(joints([now + (goal - now) * _HOP / far for now, goal in rows]))

    def _step(self, motion: SentMotion, state: ArmState, desired: ArmCommand | None, dt: float) -> SentMotion:
        """The motion after a cycle in which the robot follows: next to ``desired``, or held."""
        if desired is None:
            if self.state is LimiterState.HOLDING:  # what is desired cannot be used; the next may be
                return self._hold(motion, state, dt)._replace(held_for=0.0)
            held, held_for = self._hold(motion, state, dt), motion.held_for + state.dt
            is_near = dist(held.positions.position, state.position) < _SLIGHT_LEAD
            # The arm stands sooner than the command is back; what keeps shaking does so for its noise.
            is_back = held.is_at_rest or (is_near and held_for >= _SETTLING_TIME)
            must_settle = not is_back or self.state is LimiterState.IGNORED
            return held._replace(must_settle=must_settle, held_for=held_for)
        goal = inside(desired.position, self._limits, motion.positions.position)
        positions = self._position_limiter.step(motion.positions, goal, dt, state.dt)
        position = positions.position
        speeds = self._feed_forward_limiter.step(motion.speeds, state, position, desired.velocity, dt)
        is_cut = goal is not desired.position
        # What is cut at the range and then passes is counted there already.
        is_slowed = position is not goal or (speeds.is_bounded and not is_cut)
        counters = motion.counters
        if is_cut or is_slowed:
            cut, slowed = counters.position_limited + is_cut, counters.slowed + is_slowed
            counters = counters._replace(position_limited=cut, slowed=slowed)
        return motion._replace(
            positions=positions, speeds=speeds, is_at_rest=False, held_for=0.0, stop_within=None, counters=counters
        )

    def observe(self, state: ArmState) -> None:
        """After the reply to ``state``: what the next one depends on."""
        motion = self._motion
        self._change(speeds=motion.speeds.observed(state, motion.positions.sent.position))
        self._scale_positions()
        is_valid = state.is_running and not self._feedback.in_a_row
        self._references.observe(
            state, self._last, is_valid=is_valid, is_at_rest=self.is_at_rest, is_waiting=self.is_waiting
        )

    @property
    def _last(self) -> ArmCommand:
        return ArmCommand(self._motion.positions.position, self._motion.speeds.velocity)

    def _enter(self, state: ArmState) -> ArmState | None:
        """A session begins, where the robot is; as long as it may follow the last command, only from there on.

        Until then a command that leads it is not answered: a robot without a reply keeps its last reference.
        """
        last = self._last
        if not self._feedback.is_start(state, last.position):
            self._feedback.reject(state)
            self._go(LimiterEvent.SESSION_ELSEWHERE)
            return None
        may_follow = state.time - self._sent_at < self._following
        is_led = max(map(abs, self._references.speeds(state, last))) >= _SLIGHT_LEAD * EGM_GAIN
        if may_follow and is_led:  # a speed that was sent with it may keep the robot away from where it was sent
            self._accept(state)
            self._go(LimiterEvent.SESSION_LED)
            return None
        self._go(LimiterEvent.SESSION_CONTINUED if may_follow else LimiterEvent.SESSION_NEW)
        self._session = state.session
        self._change(stop_within=None)
        self._delay.clear()
        self._references.begin(state)
        return self._accept(state._replace(dt=0.0))  # nothing was sent since the last command

    def _accept(self, state: ArmState) -> ArmState:
        if self._feedback.in_a_row:
            self._resume(state)
            self._change(stop_within=None, stop_at=None)
            if dist(self._motion.positions.position, state.planned) >= _SLIGHT_LEAD:
                self._change(is_at_rest=False)  # the command is not where the robot is
        return self._feedback.accept(state)

    def _begin(self, state: ArmState) -> None:
        """Begin with the first command: where the robot is, at most at the end of its range."""
        position = inside(state.position, self._limits, self._limits.lower)
        self._change(
            positions=resting_at(position), speeds=FedForward(), is_at_rest=True, must_settle=False, stop_within=None
        )
        self._references.begin(state, ArmCommand(position))

    def _hold(self, motion: SentMotion, state: ArmState, dt: float) -> SentMotion:
        """Come to rest, then repeat the last command.

        A command runs ahead of the robot by its speed over the loop gain. It goes back to the robot within its limits,
        which takes longer than the robot needs to stop; what is left of the lead meanwhile, a speed against it cancels,
        as quickly as the robot may brake. So it comes to rest on its way, not where the lead points; and not beyond,
        since a command would run after a plan that is reported elsewhere than the robot's for as long as that follows.
        """
        positions, last = motion.positions, motion.positions.position
        if motion.is_at_rest and positions.stands(dt):  # it may creep after the noise of an arm that stood
            return motion._replace(speeds=self._feed_forward_limiter.step(motion.speeds, state, last, ZERO, dt))
        # A command that chased noise would never rest; a lead of some size shows whether it is taken.
        kept = _PROBE if self.state is LimiterState.IGNORED else _NO_LEAD
        stop_within = motion.stop_within or self._places_to_stop(motion, state)
        rows = zip(last, self._place_to_rest(state), *stop_within, strict=True)
        goal = joints([max(low, min(high, now + max(-kept, min(kept, ahead - now)))) for ahead, now, low, high in rows])
        positions = self._go_to(positions, goal, state, dt)
        position = positions.position
        is_led = largest_difference(position, goal) >= _NO_LEAD
        against = self._feed_forward_limiter.against(state, position) if is_led else ZERO
        speeds = self._feed_forward_limiter.step(motion.speeds, state, position, against, dt)
        is_at_rest = not is_led and speeds.velocity is ZERO and positions.stands(dt)
        return motion._replace(positions=positions, speeds=speeds, is_at_rest=is_at_rest, stop_within=stop_within)

    def _place_to_rest(self, state: ArmState) -> Joints:
        """The position that a robot goes on to report if it stops now [rad], (7,): nearer to its plan while it moves.

        Not that of its plan, which a load keeps elsewhere than what is reported: the robot's loop would go on.
        """
        rows = zip(state.position, state.velocity, state.planned, strict=True)
        ways = [(now, speed * SERVO_CYCLES * CYCLE, plan - now) for now, speed, plan in rows]
        return joints(
            [
                now + (min(way, left) if way > 0.0 < left else max(way, left) if way < 0.0 > left else 0.0)
                for now, way, left in ways
            ]
        )

    def _places_to_stop(self, motion: SentMotion, state: ArmState) -> tuple[Joints, Joints]:
        """Between which positions a robot that is to stop comes to rest [rad], (7,).

        It brakes from where it plans to be, or follows the last command until that has stopped.
        """
        last, limits = ArmCommand(motion.positions.position, motion.speeds.velocity), self._limits
        speeds = self._references.speeds(state, last)
        rows = zip(state.planned, speeds, limits.velocity, limits.acceleration, limits.jerk, strict=True)
        ends = [now + braking_path(max(-most, min(most, speed)), 0.0, a, j).end for now, speed, most, a, j in rows]
        stop = self._position_limiter.place_to_stop(motion.positions)
        places = zip(state.planned, ends, last.position, stop, strict=True)
        ranges = [(min(row) - _NEAR, max(row) + _NEAR) for row in places]
        return joints([low for low, _ in ranges]), joints([high for _, high in ranges])

    def _come_to(self, motion: SentMotion, state: ArmState, dt: float) -> SentMotion:
        """Go to where an arm is that does not follow: were it to follow after all, it would not feel a step.

        Where its position is implausible, come to rest where the command itself does.
        """
        goal, last, stop_at = state.position, motion.positions.position, motion.stop_at
        if self._feedback.in_a_row:
            stop_at = goal = stop_at or self._position_limiter.place_to_stop(motion.positions)
        positions = self._go_to(motion.positions, goal, state, dt)
        position = positions.position
        speeds = self._feed_forward_limiter.step(motion.speeds, state, position, ZERO, dt)
        is_at_rest = dist(position, goal) < _NEAR and dist(last, position) < _CREEPS
        return motion._replace(
            positions=positions, speeds=speeds, is_at_rest=is_at_rest, stop_within=None, stop_at=stop_at
        )

    def _go_to(self, positions: PositionMotion, goal: Joints, state: ArmState, dt: float) -> PositionMotion:
        """Nearer to ``goal`` within the limits; never out of the range, or further out."""
        return self._position_limiter.step(positions, inside(goal, self._limits, positions.position), dt, state.dt)

    def _is_near(self, motion: SentMotion, state: ArmState) -> bool:
        """Whether the robot's speed, and what its acceleration can add, explain how far the command is ahead.

        Else the robot does not get our commands, and all that piles up would reach it as one blow. A robot that follows
        speeds only makes nothing of a lead.
        """
        if self._gain == 0.0:
            return True
        last, planned = motion.positions.position, state.planned
        if dist(last, planned) < self._near:
            return True
        rows = zip(last, planned, state.velocity, self._limits.acceleration, strict=True)
        # At a lead of speed over gain a robot seen at that speed has come to move so; more does not move it faster.
        return all(abs(last - now) < (abs(v) + top * FEEDBACK_DELAY) / EGM_GAIN for last, now, v, top in rows)
