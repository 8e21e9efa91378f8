"""The control loop of one arm: the cycles, with what follows a reply."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CYCLE, ZERO_JOINTS, ArmState, Joints, Side, joint_names
from yumi.control.collisions import CollisionLimiter
from yumi.control.cycle import ArmPort, Cycle, run_cycle
from yumi.control.flight_recorder import FlightRecorder, flight_memory
from yumi.control.goals import Buffer
from yumi.control.limiter import Limiter
from yumi.control.loop_events import (
    CommanderSilent,
    ControllerFailed,
    ControllerReport,
    ControllersLate,
    Event,
    ImplausibleFeedback,
    KeptApart,
    ProblemOver,
    ReferencesIgnored,
    RobotFollows,
    RobotStoppedFollowing,
    SessionLost,
    SessionResumed,
    SessionStarted,
)
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.motion.setpoint import largest_difference
from yumi.control.motion.standstill import STANDSTILL_TOLERANCE
from yumi.control.shared_state import ARM_PROBLEM_CODES, ArmProblem, JointStates, Limited, SharedDeadline, Snapshot
from yumi.control.speed_scale import FULL_SPEED, SpeedScale
from yumi.control.stage_times import AFTER_REPLY, StageClock

_INTERRUPTION = 5
"""Feedback that has not come for so many cycles is interrupted; later, by the session's own limit, it is lost."""

_DOUBTS_REPORTED = 1.0
"""Positions that are not believed are reported at most so often, as long as the arm goes on [s]."""

_LIMITED_SHOWN = 0.2
"""What an arm is kept apart from is in its snapshot for so long after the last cycle in which it was [s]."""

_STOOD_STILL = 0.040
"""A control process that looked at an arm last before so long did not run: it does so every 20 ms at the latest [s]."""

LONGEST_UNANSWERED = 0.2
"""Controllers for which the core has answered for longer are deactivated: a person decides what follows [s]."""

_AT_REST = 1e-3
"""An arm whose joints all move slower than this stands [rad/s]."""

_NO_STAGES = StageClock()


class ArmLoop:
    """Runs the cycles of one arm.

    Args:
        side: which arm.
        arm: its hardware.
        manager: its controllers.
        limiter: what its commands must pass.
        snapshots: where the outside world looks.
        recorder: what remembers the cycles; without one it has its own.
        stages: what notes where their time goes; the hardware's own too, when it has the same one.
        period: time between two datagrams of the arm [s].
        speed: the factor on its speeds, which its controllers share.
        collisions: what keeps both arms apart; None where nothing does.
        read_joints: the joints as they were read from the controller while its datagrams do not arrive.
        deadline: until when the one who commands the arm must be heard again; None where that is not watched.
    """

    def __init__(
        self,
        side: Side,
        arm: ArmPort,
        manager: ControllerManager,
        limiter: Limiter,
        snapshots: Buffer[Snapshot],
        recorder: FlightRecorder | None = None,
        stages: StageClock | None = None,
        period: float = CYCLE,
        speed: SpeedScale | None = None,
        collisions: CollisionLimiter | None = None,
        read_joints: Buffer[JointStates] | None = None,
        deadline: Buffer[SharedDeadline] | None = None,
    ) -> None:
        self.manager = manager
        self.collisions = collisions
        self._side = side
        self._arm = arm
        self._limiter = limiter
        self._snapshots = snapshots
        self._recorder = recorder or FlightRecorder(flight_memory())
        self._stages = stages or StageClock()
        self._speed = speed or SpeedScale()
        if self._speed.value != FULL_SPEED:
            limiter.scale_speed(self._speed.value)
        self._read_joints, self._joints_read = read_joints, 0  # and how many were
        self._deadline, self._ended = deadline, 0  # and the activation whose streams were ended
        self._last: Cycle | None = None
        self._sent_moves = False  # with the last cycle
        self._unsettled: Cycle | None = None
        self._interruption = _INTERRUPTION * period
        self._due = (0.75 * period, 1.5 * period)
        self._most_unanswered = LONGEST_UNANSWERED / period
        self._session = 0
        self._problem = ArmProblem.NONE
        self._implausible = 0
        self._doubt_reported = -inf
        self._kept_apart = 0
        self._limited: Limited | None = None
        self._limited_at = self._limited_reported = -inf
        self._foreign = 0
        self._unanswered = 0  # by the controllers until they answered last
        self._late_reported, self._lateness_reported = 0, -inf  # how many of them, and when
        self._braked = 0  # how many of them are recorded
        self._cycles = 0
        self._interruptions = 0
        self._is_interrupted = False
        self._looked = -inf  # when the arm was looked at last [s]
        self._position = ZERO_JOINTS
        self._events: list[Event] = []

    @property
    def state(self) -> ArmState | None:
        """The newest state while the robot streams, else None."""
        return self._last.state if self._last else None

    @property
    def is_still(self) -> bool:
        """Whether the arm stands and is commanded to, or is not heard any more.

        The measured position alone does not show it: it is behind the command, and the last command stays in force.
        """
        if self._last is None:
            return True
        return self._limiter.is_at_rest and max(map(abs, self._last.state.velocity)) < _AT_REST

    def check_follows(self) -> None:
        """Refuse what the arm could not do because it holds; raises CommandRefused."""
        problem = self._limiter.problem
        if problem is not ArmProblem.NONE:
            reason = message(ARM_PROBLEM_CODES[problem], arm=self._side.word)
            raise CommandRefused(message("goal_refused", reason=reason))

    @property
    def activation(self) -> int:
        """The number of the newest activation of controllers, as in its snapshots; 0 when none commands the arm."""
        return self.manager.activation if self.manager.is_commanding else 0

    @property
    def is_running(self) -> bool:
        """Whether the robot is heard, and follows."""
        return self._last is not None and self._last.state.is_running

    def check_stands(self) -> None:
        """Refuse what is for arms that stand, and are to; raises CommandRefused.

        A controller whose goal is reached goes on commanding it: that the arm is commanded does not mean that it moves.
        """
        last = self._last
        if last is None or not self.is_running:
            return
        beyond = last.beyond
        moves = (
            max(map(abs, last.state.velocity)) >= _AT_REST or last.sent.velocity is not ZERO_JOINTS or self._sent_moves
        )
        is_held = beyond > STANDSTILL_TOLERANCE and (
            self._limited is not None or not moves
        )  # it may still go by small steps
        if moves and not is_held:
            raise CommandRefused(message("arm_moves", arm=self._side.word))
        if is_held:
            raise CommandRefused(message("arm_held_before_goal", arm=self._side.word, distance=beyond))

    @property
    def speed_scale(self) -> float:
        """The factor on the arm's speeds that is in force."""
        return self._speed.value

    def cap_speed(self, highest: float) -> None:
        """Let the speed scale not be above ``highest``, whatever is set: gradually, where the arm can move."""
        self._speed.highest = highest
        if self._last is None:
            self._speed.jump()
            self._limiter.scale_speed(self._speed.value)

    @property
    def position(self) -> Joints | None:
        """Where the arm was measured last [rad], (7,); None before its first cycle."""
        return self._position if self._cycles else None

    def is_datagram_due(self, now: float) -> bool:
        """Whether the next datagram may arrive at any moment: what takes time waits until it is answered.

        Two arms together leave at least half of each period free, whatever their phases.
        """
        if self._last is None:
            return False
        soonest, latest = self._due
        return soonest < now - self._last.state.time < latest

    def prepare(self) -> None:
        """Before a wait for datagrams: have the next one answered at once, where that needs no controller in Python."""
        is_heard = self._limiter.unanswered == self._braked  # else the controllers may have to be deactivated first
        is_soon_silent = self._last is not None and self._silence(self._last.state.time + self._due[1]) is not None
        self._arm.prepare(self.manager.sampled if is_heard and not is_soon_silent else None, self._session)

    def run(self, now: float) -> Cycle | None:
        """Answer the newest datagram, if there is one, then do what can wait until after the reply."""
        cycle = self.reply(now)
        self.settle(now)
        return cycle

    def reply(self, now: float) -> Cycle | None:
        """Answer the newest datagram, if there is one; :meth:`settle` follows."""
        self._unsettled = None
        self._note_late(now)
        # What waits in the socket says nothing about the time in which nothing was answered.
        self._end_if_lost(now)
        self._end_if_silent(now)
        self._stages.begin(now)
        self._unsettled = run_cycle(self._arm, self.manager, now, self._stages)
        return self._unsettled

    def settle(self, now: float) -> bool:
        """After the reply: what the next one needs, what happened, and what others see; whether there was a reply."""
        cycle, self._unsettled = self._unsettled, None
        if cycle is not None:
            before, self._last, self._position = self._last, cycle, cycle.state.position
            self.manager.sent.note(cycle.desired and cycle.desired.position, cycle.sent.position)
            way = largest_difference(cycle.sent.position, before.sent.position) if before else 0.0
            moved, self._sent_moves = self._sent_moves, way > _AT_REST * cycle.state.dt
            if cycle.beyond > STANDSTILL_TOLERANCE and not (
                moved or self._sent_moves
            ):  # a command that turns round stands once
                self.manager.note_withheld(cycle.sent.position)
            if self._limiter.is_waiting:
                self.manager.note_waiting(cycle.sent.position)
            self._cycles += 1
            self._is_interrupted = False
            self._unanswered = self._limiter.unanswered
            if self._speed.advance(cycle.state.dt):
                self._limiter.scale_speed(self._speed.value)
            self._arm.settle(cycle.state)
            self.manager.watch(cycle.state)
            self.manager.note_times(cycle.state, self._stages.marks)
            self._note_changes(before.state if before else None, cycle.state)
            self._note_limited(now)
            self.publish(cycle.state.time)
            self._stages.note(AFTER_REPLY)
            self._recorder.record(cycle, self.manager.reference, self._stages)
        limiter = self._limiter
        if limiter.counters.implausible != self._implausible or limiter.problem is not self._problem:
            self._note_problem(now)
        return cycle is not None

    def watch_silence(self, now: float) -> None:
        """Notice that the robot has stopped sending; to be called every few milliseconds."""
        self._note_late(now)
        if self._end_if_lost(now):
            return
        if self._last is None:
            self._take_read_joints()
            # Who waits for a robot wants to know that another sender was heard.
            foreign = self._arm.wire_counters().foreign
            if foreign != self._foreign:
                self._foreign = foreign
                self.publish(now)
        elif not self._is_interrupted and self._arm.silence(now) > self._interruption:
            # Without feedback nothing is calculated and nothing sent: controllers go on when it comes back in time.
            self._is_interrupted = True
            self._interruptions += 1
            self._limiter.note_interruption()
            self.publish(now)

    def _note_late(self, now: float) -> None:
        """Note what the core has answered in place of the controllers; deactivate those that hung."""
        count = self._limiter.unanswered
        if count != self._braked:
            self._braked = count
            for cycle in self._arm.take_braked():
                if self._last is None or cycle.state.time > self._last.state.time:  # else one of ours was sent later
                    self.manager.sent.note(None, cycle.sent.position)
                self._recorder.record(cycle, None, _NO_STAGES)
        if count == self._late_reported:
            return
        controllers = self.manager.commanding
        is_hung = count - self._unanswered > self._most_unanswered
        deactivated = self.manager.deactivate_commanding() if is_hung else ()
        if deactivated or now - self._lateness_reported >= _DOUBTS_REPORTED:
            self._events.append(ControllersLate(self._side, count - self._late_reported, controllers, deactivated))
            self._late_reported, self._lateness_reported = count, now

    def _end_if_lost(self, now: float) -> bool:
        """Whether the arm was not heard for too long, be it that the robot was silent or that we did not run."""
        looked, self._looked = self._looked, max(now, self._looked)
        if self._last is not None and now - self._last.state.time < self._due[1]:
            return False  # it is on time
        silence = self._arm.lost_after(now)
        if silence is None:
            return False
        unwatched = now - looked
        is_ours = (
            unwatched > _STOOD_STILL and silence - unwatched < self._interruption
        )  # until then the robot was heard
        self._last = None
        self._limiter.note_connection_lost()
        deactivated = self.manager.deactivate_commanding()
        self._events.append(SessionLost(self._side, silence, deactivated, unwatched if is_ours else 0.0))
        self.publish(now)
        return True

    def _silence(self, now: float) -> float | None:
        """For how long the one who commands the arm has been silent at ``now`` [s]; None where that is not too long."""
        newest = self._deadline.read() if self._deadline is not None else None
        if newest is None or newest[1].activation in (0, self._ended) or newest[1].activation != self.activation:
            return None
        silence = now - newest[1].heard
        return silence if silence > newest[1].silence else None

    def _end_if_silent(self, now: float) -> None:
        """Have the arm come to rest, from this reply on, when the one who commands it has been silent for too long."""
        silence = self._silence(now)
        if silence is not None and self._last is not None:
            self._ended = self.activation
            self.manager.end_streams(self._last.state)
            self._events.append(CommanderSilent(self._side, silence))

    def _take_read_joints(self) -> None:
        """The other arm keeps clear of where the controller says that this one is."""
        newest = self._read_joints.read() if self._read_joints is not None else None
        if newest is not None and newest[0] != self._joints_read:
            self._joints_read = newest[0]
            self._limiter.note_position(newest[1].position)

    def take_events(self) -> Sequence[Event]:
        """What happened since the last call."""
        for name, report in self.manager.take_reports():
            self._events.append(ControllerReport(self._side, name, report))
        events, self._events = self._events, []
        return events

    def _note_limited(self, now: float) -> None:
        """Remember what the arm is kept apart from, for as long as those who look now and then need to see it."""
        counters, last = self._limiter.counters, self._last
        count = counters.kept_apart + counters.feedforward_withheld
        # Without a new count the limiter's pair may be that of an earlier cycle. An arm at its goal misses nothing.
        misses = self._sent_moves or (last is not None and last.beyond > STANDSTILL_TOLERANCE)
        limited = self._limiter.limited if count != self._kept_apart and misses else None
        self._kept_apart = count
        if limited is not None:
            self._limited, self._limited_at = limited, now
            if now - self._limited_reported >= _DOUBTS_REPORTED:
                self._limited_reported = now
                self._events.append(KeptApart(self._side, limited))
        elif self._limited is not None and now - self._limited_at > _LIMITED_SHOWN:
            self._limited = None

    def _note_problem(self, now: float) -> None:
        """The feedback is doubted, the arm holds for a reason of its own, or does no longer."""
        before, self._problem = self._problem, self._limiter.problem
        is_doubted = self._limiter.counters.implausible != self._implausible
        self._implausible = self._limiter.counters.implausible
        if self._problem is not before:
            if self._problem is ArmProblem.NONE:
                self._events.append(ProblemOver(self._side, before))
            elif self._problem is ArmProblem.REFERENCES_IGNORED:
                self._events.append(ReferencesIgnored(self._side, self.manager.deactivate_commanding()))
            else:
                self._events.append(self._doubted(is_lost=True))
        elif is_doubted and self._problem is ArmProblem.NONE and now - self._doubt_reported >= _DOUBTS_REPORTED:
            self._doubt_reported = now
            self._events.append(self._doubted(is_lost=False))
        self.publish(now)

    def _doubted(self, *, is_lost: bool) -> ImplausibleFeedback:
        reported = self._limiter.implausible_position
        # Rounded: of joints that are equally far off it is the first, whatever the last digit says.
        distances = [round(abs(is_at - was), 9) for is_at, was in zip(reported, self._position, strict=True)]
        index = distances.index(max(distances))
        deactivated = self.manager.deactivate_commanding() if is_lost else ()
        name = joint_names(self._side)[index]
        is_other_arm = self._limiter.is_other_arm
        return ImplausibleFeedback(self._side, name, distances[index], reported, deactivated, is_lost, is_other_arm)

    def _note_changes(self, before: ArmState | None, state: ArmState) -> None:
        if state.session != self._session:
            self._session, before = state.session, None
            self._events.append(SessionStarted(self._side, state.session, self.manager.deactivate_commanding()))
        elif before is None:
            self._events.append(SessionResumed(self._side, state.session))
        was_running = before is not None and before.is_running
        if state.is_running and not was_running:
            self._events.append(RobotFollows(self._side))
        elif was_running and not state.is_running:
            self._events.append(RobotStoppedFollowing(self._side, self.manager.deactivate_commanding()))
        while self.manager.failures:
            self._events.append(ControllerFailed(self._side, self.manager.failures.pop(0)))

    def publish(self, now: float) -> None:
        """Write the snapshot of the arm as it is at ``now``."""
        last, counters = self._last, self._limiter.counters
        reference = self.manager.reference
        limited = (last and self._limited) or Limited("", "", 0.0)
        self._snapshots.write(
            Snapshot(
                time=now,
                is_streaming=last is not None and not self._is_interrupted,
                is_running=last is not None and last.state.is_running,
                activity=self.manager.activity,
                activation=self.activation,
                goal_kind=self.manager.goal_kind,
                position=self._position,
                velocity=last.state.velocity if last else ZERO_JOINTS,
                sent=last.sent.position if last else self._position,
                reference=reference,
                cycles=self._cycles + counters.unanswered,
                wire=self._arm.wire_counters(),
                limiter=counters,
                limited_part=limited.part,
                limited_other=limited.other,
                limited_distance=limited.distance,
                speed_cap=self._speed.highest,
                interruptions=self._interruptions,
                problem=self._limiter.problem,
            ),
        )
