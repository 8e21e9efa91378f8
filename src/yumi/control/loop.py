"""The control loop: the cycles of each arm with what follows a reply, and the commands served between cycles.

One of the commands allows contact on purpose: pairs of parts that may touch for a while, slowly, where the collision
limiter is on. It is MoveIt's allowed collision matrix, but that each entry ends by itself, and that no arm is faster
than :data:`CONTACT_SPEED_SCALE` as long as there is one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Concatenate, ParamSpec, Protocol, TypeVar

from yumi.catalogue import message, said_by
from yumi.control.collisions import CollisionLimiter
from yumi.control.controller import AFTER_REPLY, Buffer, ControllerInfo, HardwareInfo, ParameterInfo, StageClock, State
from yumi.control.controller_manager import ControllerManager, Strictness
from yumi.control.cycle import ArmPort, Cycle, run_cycle
from yumi.control.flight_recorder import FlightRecorder, flight_memory
from yumi.control.limiter import Limiter
from yumi.control.motion import AT_GOAL, largest_difference
from yumi.control.shared_state import (
    PROBLEMS,
    AllowedCollisionsChanged,
    ControllerFailed,
    ControllerReport,
    ControllersLate,
    Event,
    ImplausibleFeedback,
    JointStates,
    KeptApart,
    Limited,
    Problem,
    ProblemOver,
    ReferencesIgnored,
    RobotFollows,
    RobotStoppedFollowing,
    SessionLost,
    SessionResumed,
    SessionStarted,
    Snapshot,
)
from yumi.control.speed_scale import FULL, SpeedScale
from yumi.errors import CommandRefused, SwitchFailed
from yumi.robot.joints import CYCLE, ZERO, ArmState, Joints, Side, joint_names
from yumi.settings import Values

INTERRUPTION = 5
"""Feedback that has not come for so many cycles is interrupted; later, by the session's own limit, it is lost."""

DOUBTS_REPORTED = 1.0
"""Positions that are not believed are reported at most so often, as long as the arm goes on [s]."""

LIMITED_SHOWN = 0.2
"""What an arm is kept apart from is in its snapshot for so long after the last cycle in which it was [s]."""

STOOD_STILL = 0.040
"""A control process that looked at an arm last before so long did not run: it does so every 20 ms at the latest [s]."""

LONGEST_UNANSWERED = 0.2
"""Controllers for which the core has answered for longer are deactivated: a person decides what follows [s]."""

AT_REST = 1e-3
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
        if self._speed.value != FULL:
            limiter.scale_speed(self._speed.value)
        self._read_joints, self._joints_read = read_joints, 0  # and how many were
        self._last: Cycle | None = None
        self._sent_moves = False  # with the last cycle
        self._unsettled: Cycle | None = None
        self._interruption = INTERRUPTION * period
        self._due = (0.75 * period, 1.5 * period)
        self._most_unanswered = LONGEST_UNANSWERED / period
        self._session = 0
        self._problem = Problem.NONE
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
        self._position = ZERO
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
        return self._limiter.is_at_rest and max(map(abs, self._last.state.velocity)) < AT_REST

    def check_follows(self) -> None:
        """Refuse what the arm could not do because it holds; raises CommandRefused."""
        problem = self._limiter.problem
        if problem is not Problem.NONE:
            reason = message(PROBLEMS[problem], arm=self._side.word)
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
        moves = max(map(abs, last.state.velocity)) >= AT_REST or last.sent.velocity is not ZERO or self._sent_moves
        is_held = beyond > AT_GOAL and (self._limited is not None or not moves)  # it may still go by small steps
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
        self._arm.prepare(self.manager.sampled)

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
        self._stages.begin(now)
        self._unsettled = run_cycle(self._arm, self.manager, now, self._stages)
        return self._unsettled

    def settle(self, now: float) -> bool:
        """After the reply: what the next one needs, what happened, and what others see; whether there was a reply."""
        cycle, self._unsettled = self._unsettled, None
        if cycle is not None:
            before, self._last, self._position = self._last, cycle, cycle.state.position
            way = largest_difference(cycle.sent.position, before.sent.position) if before else 0.0
            moved, self._sent_moves = self._sent_moves, way > AT_REST * cycle.state.dt
            if cycle.beyond > AT_GOAL and not (moved or self._sent_moves):  # a command that turns round stands once
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
        """Report what the core has answered in place of the controllers; deactivate those that hung."""
        count = self._limiter.unanswered
        if count != self._braked:
            self._braked = count
            for cycle in self._arm.take_braked():
                self._recorder.record(cycle, None, _NO_STAGES)
        if count == self._late_reported:
            return
        controllers = self.manager.commanding
        is_hung = count - self._unanswered > self._most_unanswered
        deactivated = self.manager.deactivate_commanding() if is_hung else ()
        if deactivated or now - self._lateness_reported >= DOUBTS_REPORTED:
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
        is_ours = unwatched > STOOD_STILL and silence - unwatched < self._interruption  # until then the robot was heard
        self._last = None
        self._limiter.note_connection_lost()
        deactivated = self.manager.deactivate_commanding()
        self._events.append(SessionLost(self._side, silence, deactivated, unwatched if is_ours else 0.0))
        self.publish(now)
        return True

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
        if not self._events:
            return ()
        events, self._events = self._events, []
        return events

    def _note_limited(self, now: float) -> None:
        """Remember what the arm is kept apart from, for as long as those who look now and then need to see it."""
        counters, last = self._limiter.counters, self._last
        count = counters.kept_apart + counters.feedforward_withheld
        # Without a new count the limiter's pair may be that of an earlier cycle. An arm at its goal misses nothing.
        misses = self._sent_moves or (last is not None and last.beyond > AT_GOAL)
        limited = self._limiter.limited if count != self._kept_apart and misses else None
        self._kept_apart = count
        if limited is not None:
            self._limited, self._limited_at = limited, now
            if now - self._limited_reported >= DOUBTS_REPORTED:
                self._limited_reported = now
                self._events.append(KeptApart(self._side, limited))
        elif self._limited is not None and now - self._limited_at > LIMITED_SHOWN:
            self._limited = None

    def _note_problem(self, now: float) -> None:
        """The feedback is doubted, the arm holds for a reason of its own, or does no longer."""
        before, self._problem = self._problem, self._limiter.problem
        is_doubted = self._limiter.counters.implausible != self._implausible
        self._implausible = self._limiter.counters.implausible
        if self._problem is not before:
            if self._problem is Problem.NONE:
                self._events.append(ProblemOver(self._side, before))
            elif self._problem is Problem.REFERENCES_IGNORED:
                self._events.append(ReferencesIgnored(self._side, self.manager.deactivate_commanding()))
            else:
                self._events.append(self._doubted(is_lost=True))
        elif is_doubted and self._problem is Problem.NONE and now - self._doubt_reported >= DOUBTS_REPORTED:
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
                velocity=last.state.velocity if last else ZERO,
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


@dataclass(frozen=True, slots=True)
class ControllerCommand:
    """What one active controller is commanded, see :meth:`yumi.control.controller.Controller.receive`.

    Attributes:
        controller: its name.
        message: a picklable value it knows.
        activation: of the controllers that it was planned for, see :meth:`Commands.check_commands`; 0 is any.
        takes_over: whether a controller that is inactive is activated for it, in place of those that move nothing.
    """

    side: Side
    controller: str
    message: object
    activation: int = 0
    takes_over: bool = False


class Commands:
    """Everything that can be asked of the control loop, served between two cycles: each method is one command.

    Another process names the method, see :class:`CommandPort`.

    Args:
        arms: the arms of the loop.
        now: the time [s].

    Attributes:
        allowed: parts that may touch, whose time has to be watched.
    """

    def __init__(self, arms: Mapping[Side, ArmLoop], now: Callable[[], float]) -> None:
        self._arms = arms
        self._now = now
        self.allowed = AllowedCollisions(
            tuple(arms.values()), next((arm.collisions for arm in arms.values()), None), now
        )

    def load_controller(self, side: Side, name: str, kind: str, values: Values | None = None) -> None:
        """Make a controller of type ``kind``, unconfigured, with parameters that differ from their defaults."""
        self._arms[side].manager.load_kind(name, kind, values)
        self._publish(side)

    def configure_controller(self, side: Side, name: str) -> None:
        """Give an unconfigured or inactive controller its parameters; it is inactive then."""
        try:
            self._arms[side].manager.configure(name)
        finally:
            self._publish(side)

    def clean_up_controller(self, side: Side, name: str) -> None:
        """Make an inactive controller unconfigured."""
        self._arms[side].manager.clean_up(name)
        self._publish(side)

    def unload_controller(self, side: Side, name: str) -> None:
        """Forget a controller that is not active."""
        self._arms[side].manager.unload(name)
        self._publish(side)

    def switch_controllers(
        self,
        side: Side,
        activate: Sequence[str] = (),
        deactivate: Sequence[str] = (),
        strictness: Strictness = Strictness.STRICT,
    ) -> str:
        """Deactivate and activate controllers as one step, see :meth:`.ControllerManager.switch`."""
        arm = self._arms[side]
        try:
            return arm.manager.switch(activate, deactivate, arm.state, strictness)
        finally:
            self._publish(side)

    def hold(self, side: Side) -> None:
        """Deactivate whatever commands an arm; it comes to rest and holds."""
        self._arms[side].manager.deactivate_commanding()
        self._publish(side)

    def set_parameters(self, side: Side, controller: str, values: Values) -> None:
        """Change parameters of one controller from the next cycle on, all or none."""
        self._arms[side].manager.set_parameters(controller, values)

    def list_parameters(self, side: Side, controller: str) -> tuple[ParameterInfo, ...]:
        """What can be set on one controller and what is set."""
        return self._arms[side].manager.parameters(controller)

    def list_controllers(self, side: Side) -> tuple[ControllerInfo, ...]:
        """The controllers of one arm, in the order of loading."""
        return self._arms[side].manager.controllers()

    def list_controller_kinds(self, side: Side) -> tuple[str, ...]:
        """The types of controllers that can be loaded."""
        return self._arms[side].manager.kinds

    def hardware(self, side: Side) -> HardwareInfo:
        """The state of an arm's hardware component and of its interfaces."""
        return self._arms[side].manager.hardware()

    def set_hardware_state(self, side: Side, name: str, state: State) -> HardwareInfo:
        """Lead an arm's hardware component to ``state``; who uses what it no longer offers is deactivated."""
        info = self._arms[side].manager.set_hardware_state(name, state)
        self._publish(side)
        return info

    def allow_collision(self, part: str, other: str, seconds: float) -> None:
        """Let two parts touch for a time [s], see :meth:`.AllowedCollisions.allow`."""
        self.allowed.allow(part, other, seconds)

    def end_allowed_collision(self, part: str, other: str) -> None:
        """Keep two parts apart again that may touch."""
        self.allowed.end(part, other)

    def commanded_positions(self, *sides: Side) -> Mapping[Side, Joints]:
        """Where each arm's active controller commands it to be [rad], (7,); where it is without one."""
        positions = {}
        for side in sides:
            position = self._arms[side].manager.reference or self._arms[side].position
            if position is None:
                raise CommandRefused(message("no_position_yet", arm=side.word))
            positions[side] = position
        return positions

    def check_commands(self, *commands: ControllerCommand) -> Mapping[Side, int]:
        """Whether the controllers would take their commands now; nothing is changed.

        Returns:
            The activation of each arm's controllers: what is planned now is for no later one.
        """
        # A second command for a controller could rest on what the first changes.
        for (side, name), count in Counter((each.side, each.controller) for each in commands).items():
            if count > 1:
                raise CommandRefused(message("several_commands", controller=name, arm=side.word, count=count))
        for each in commands:
            arm = self._arms[each.side]
            arm.check_follows()
            if each.activation not in (0, arm.activation):
                reason = message("interrupted_while_planned", arm=each.side.word)
                raise CommandRefused(message("goal_refused", reason=reason))
            if each.takes_over and arm.manager.is_inactive(each.controller):
                arm.manager.check_take_over(each.controller, arm.state, self._now())
                arm.check_stands()
            else:
                arm.manager.check(each.controller, each.message, arm.state)
        return {each.side: self._arms[each.side].activation for each in commands}

    def send_commands(self, *commands: ControllerCommand) -> Mapping[Side, tuple[str, ...]]:
        """Have controllers of one or both arms take their commands between the same two cycles, all or none.

        Returns:
            The arms on which a controller was activated for its command, and the controllers that it has replaced.
        """
        self.check_commands(*commands)
        replaced: dict[Side, tuple[str, ...]] = {}
        try:
            for each in commands:
                arm = self._arms[each.side]
                if each.takes_over and arm.manager.is_inactive(each.controller):
                    before = arm.manager.check_take_over(each.controller, arm.state, self._now())
                    replaced[each.side] = before
                    self.switch_controllers(each.side, (each.controller,), before)
                    arm.manager.check(each.controller, each.message, arm.state)
        except Exception:
            for each in commands:
                if each.side in replaced:
                    arm = self._arms[each.side]
                    is_active = not arm.manager.is_inactive(each.controller)
                    self.switch_controllers(each.side, replaced[each.side], (each.controller,) if is_active else ())
            raise
        for each in commands:
            arm = self._arms[each.side]
            arm.manager.receive(each.controller, each.message, arm.state)
        return replaced

    def _publish(self, side: Side) -> None:
        self._arms[side].publish(self._now())


COMMANDS: Mapping[str, Callable[..., object]] = {
    name: command for name, command in vars(Commands).items() if not name.startswith("_")
}
"""The commands by name; nothing else is called from another process."""

_P = ParamSpec("_P")
_T = TypeVar("_T")


def serve(
    commands: Commands, command: Callable[Concatenate[Commands, _P], _T], *args: _P.args, **kwargs: _P.kwargs
) -> _T:
    """Carry out one command of :class:`Commands`.

    Raises:
        CommandRefused: a rule stands against it, or it failed; the sentence says what a failed switch has left.
    """
    try:
        return command(commands, *args, **kwargs)
    except (CommandRefused, SwitchFailed) as error:
        raise CommandRefused(error.said) from error
    except Exception as error:
        name = getattr(command, "__name__", "")
        raise CommandRefused(
            message("command_failed", command=name, kind=type(error).__name__, why=said_by(error))
        ) from error


class CommandPort(Protocol):
    """Where commands are given, from any thread."""

    def call(self, command: Callable[Concatenate[Commands, _P], _T], /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Have ``command``, a method of :class:`Commands`, served between two cycles; returns its answer.

        Raises:
            CommandRefused: a rule stands against it.
            RobotNotReady: the control process has ended or does not answer.
        """


# ---- allowed collisions

CONTACT_SPEED_SCALE = 0.1
"""No arm is faster than this share of its speeds while a collision is allowed."""

LONGEST_CONTACT = 60.0
"""A collision is allowed for so long at most [s]; asked for again, the time begins anew."""

PartPair = tuple[str, str]


class AllowedCollisions:
    """The pairs of parts that may touch now: as soon as both arms are slow.

    Args:
        arms: both.
        collisions: what keeps them apart; None where nothing does.
        now: the time [s].
    """

    def __init__(self, arms: Sequence[ArmLoop], collisions: CollisionLimiter | None, now: Callable[[], float]) -> None:
        self._arms, self._collisions, self._now = arms, collisions, now
        self._until: dict[PartPair, float] = {}
        self._first_end = inf
        self._permitted: tuple[PartPair, ...] = ()
        self._running: list[bool] = []  # of each arm, when it was looked at last
        self._events: list[AllowedCollisionsChanged] = []

    def allow(self, part: str, other: str, seconds: float) -> None:
        """Let two parts touch for a time [s]; the same pair again begins anew.

        The arms become slow first, which takes a third of a second, and nothing may touch before.

        Raises:
            CommandRefused: the limiter is off, there are no such parts, the time is out of range, or an arm moves
                or is held before its goal.
        """
        if self._collisions is None:
            raise CommandRefused(message("nothing_to_allow"))
        if not 0.0 < seconds <= LONGEST_CONTACT:  # NaN too
            raise CommandRefused(message("contact_time_out_of_range", time=seconds, longest=LONGEST_CONTACT))
        _check_parts(self._collisions, part, other)
        if not self._until:
            try:
                for arm in self._arms:
                    arm.check_stands()
            except CommandRefused as why:
                raise CommandRefused(message("contact_is_for_slow_motions", reason=why.said)) from why
            self._running = [arm.is_running for arm in self._arms]
        self._until[_pair(part, other)] = self._now() + seconds
        self._update()

    def end(self, part: str, other: str) -> None:
        """Keep two parts apart again; nothing where they are.

        Raises:
            CommandRefused: there are no such parts: others would go on touching.
        """
        if self._until.pop(_pair(part, other), None) is not None:
            self._update()
        elif self._collisions is not None:
            _check_parts(self._collisions, part, other)

    def take_events(self) -> Sequence[AllowedCollisionsChanged]:
        """End what has lasted its time, permit what waits for the arms, and return what has changed since.

        All of it ends when an arm stops following or is not heard any more: what it was for is over.
        """
        if self._until and self._has_stopped():
            self._until.clear()
            self._update()
        elif self._now() >= self._first_end:
            now = self._now()
            self._until = {pair: until for pair, until in self._until.items() if until > now}
            self._update()
        elif len(self._permitted) < len(self._until):
            self._update()
        if not self._events:
            return ()
        events, self._events = self._events, []
        return events

    def _has_stopped(self) -> bool:
        """Whether an arm that followed does no longer."""
        before, self._running = self._running, [arm.is_running for arm in self._arms]
        return any(was and not runs for was, runs in zip(before, self._running, strict=True))

    def _update(self) -> None:
        """Have the arms slow as long as anything is allowed, and permit that once they are."""
        assert self._collisions is not None  # else nothing is allowed
        self._first_end = min(self._until.values(), default=inf)
        highest = CONTACT_SPEED_SCALE if self._until else FULL
        for arm in self._arms:
            arm.cap_speed(highest)
        permitted = tuple(self._until) if all(arm.speed_scale <= highest for arm in self._arms) else ()
        if permitted == self._permitted:
            return
        self._permitted = permitted
        self._collisions.permit(*permitted)
        self._events.append(AllowedCollisionsChanged(permitted))


def _check_parts(collisions: CollisionLimiter, part: str, other: str) -> None:
    if not collisions.pairs_of(part, other):
        raise CommandRefused(message("no_such_parts", part=part, other=other))


def _pair(part: str, other: str) -> PartPair:
    """In one order, whichever is named first."""
    return (part, other) if part <= other else (other, part)
