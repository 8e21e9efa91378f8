"""One arm's part of the fast line: its cycle, what comes after the reply, and the watch over silence.

Carries out what is asked of a fast line, between two cycles.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Any

from yumi.control.commands import Mailbox
from yumi.control.controller_manager import ControllerManager
from yumi.control.cycle import ArmPort, Cycle, run_cycle
from yumi.control.flight_recorder import FlightRecorder, flight_memory
from yumi.control.limiter import FULL, Limiter, SpeedScale
from yumi.control.requests import (
    CheckOrders,
    CleanupController,
    ConfigureController,
    ControllerFailed,
    ControllerNotice,
    Done,
    Event,
    HoldArm,
    ImplausibleFeedback,
    ListControllerKinds,
    ListControllers,
    ListHardware,
    ListParameters,
    LoadController,
    Order,
    ProblemOver,
    ReferencesIgnored,
    Refusal,
    Reply,
    Request,
    RobotFollows,
    RobotStoppedFollowing,
    SendOrders,
    SessionLost,
    SessionResumed,
    SessionStarted,
    SetHardwareState,
    SetParameters,
    Strictness,
    SwitchControllers,
    UnloadController,
)
from yumi.control.shared_state import CAUSES, Problem, Snapshot, put_snapshot
from yumi.control.statistics import AFTER_REPLY, StageClock
from yumi.errors import CommandRefused, SwitchFailed
from yumi.robot.joints import CYCLE, ZERO, ArmState, Side, joint_names

INTERRUPTION = 5
"""Feedback that has not come for so many cycles is interrupted; later, by the session's own limit, it is lost."""

DOUBTS_REPORTED = 1.0
"""Positions that are not believed are reported at most so often, as long as the arm goes on [s]."""

STANDING = 1e-3
"""An arm whose joints all move slower than this stands [rad/s]."""


class ArmLine:
    """Runs the cycles of one arm.

    Args:
        side: which arm.
        arm: its hardware.
        manager: its controllers.
        guard: what its commands must pass.
        snapshots: where the outside world looks.
        recorder: what remembers the cycles; without one it has its own, which nobody reads.
        stations: what notes where their time goes; the hardware's own stations too, when it has the same one.
        period: time between two datagrams of the arm [s].
        speed: the factor on its speeds, which its controllers share.
    """

    def __init__(
        self,
        side: Side,
        arm: ArmPort,
        manager: ControllerManager,
        guard: Limiter,
        snapshots: Mailbox,
        recorder: FlightRecorder | None = None,
        stations: StageClock | None = None,
        period: float = CYCLE,
        speed: SpeedScale | None = None,
    ) -> None:
        self.manager = manager
        self._side = side
        self._arm = arm
        self._guard = guard
        self._snapshots = snapshots
        self._recorder = recorder or FlightRecorder(flight_memory())
        self._stations = stations or StageClock()
        self._speed = speed or SpeedScale()
        if self._speed.value != FULL:
            guard.scale_speed(self._speed.value)
        self._last: Cycle | None = None
        self._interruption = INTERRUPTION * period
        self._due = (0.5 * period, 1.5 * period)
        self._session = 0
        self._problem = Problem.NONE
        self._implausible = 0
        self._doubt_reported = -inf
        self._foreign = 0
        self._cycles = 0
        self._interruptions = 0
        self._is_interrupted = False
        self._position = ZERO
        self._events: list[Event] = []

    @property
    def state(self) -> ArmState | None:
        """The newest state while the robot streams, else None."""
        return self._last.state if self._last else None

    @property
    def is_still(self) -> bool:
        """Whether the arm stands and is told to, or cannot be heard any more.

        What is measured alone would not tell: it is behind the command, and the last command stays in force.
        """
        if self._last is None:
            return True
        return self._guard.is_at_rest and max(map(abs, self._last.state.velocity)) < STANDING

    def check_follows(self) -> None:
        """See that nothing makes the arm hold whatever it is asked to do.

        Raises:
            CommandRefused: something does.
        """
        problem = self._guard.problem
        if problem is not Problem.NONE:
            raise CommandRefused(f"Goal refused: {self._side.word} arm: {CAUSES[problem]}.")

    def is_datagram_due(self, now: float) -> bool:
        """Whether the next datagram may come any moment: what takes time waits until it is answered."""
        if self._last is None:
            return False
        soonest, latest = self._due
        return soonest < now - self._last.state.time < latest

    def run(self, now: float) -> Cycle | None:
        """Answer the newest datagram, if there is one, then do what can wait until after the reply."""
        self._stations.begin(now)
        cycle = run_cycle(self._arm, self.manager, self._guard, now, self._stations)
        if cycle is not None:
            self._after_reply(cycle)
        guard = self._guard
        if guard.counters.implausible != self._implausible or guard.problem is not self._problem:
            self._note_problem(now)
        return cycle

    def switch(
        self,
        activate: Sequence[str],
        deactivate: Sequence[str],
        now: float,
        strictness: Strictness = Strictness.STRICT,
    ) -> str:
        """Switch controllers between two cycles; whoever asked for it finds it done in the snapshot.

        Raises:
            CommandRefused: a rule stands against it; nothing was changed.
            SwitchFailed: a controller could not begin.
        """
        try:
            return self.manager.switch(activate, deactivate, self.state, strictness)
        finally:
            self.publish(now)

    def watch_silence(self, now: float) -> None:
        """Notice that the robot has fallen silent; to be called every few milliseconds."""
        silence = self._arm.lost_after(now)
        if silence is None:
            self._watch_interruption(now)
            return
        self._last = None
        self._events.append(SessionLost(self._side, silence, self.manager.deactivate_commanding()))
        self.publish(now)

    def _watch_interruption(self, now: float) -> None:
        """Without feedback nothing is calculated and nothing sent: controllers go on when it comes back in time."""
        if self._last is None:
            self._watch_strangers(now)
            return
        if self._is_interrupted or self._arm.silence(now) <= self._interruption:
            return
        self._is_interrupted = True
        self._interruptions += 1
        self.publish(now)

    def _watch_strangers(self, now: float) -> None:
        """Who waits for a robot wants to know that somebody else is speaking."""
        foreign = self._arm.wire_counters().foreign
        if foreign != self._foreign:
            self._foreign = foreign
            self.publish(now)

    def take_events(self) -> Sequence[Event]:
        """What happened since the last call."""
        for name, notice in self.manager.take_notices():
            self._events.append(ControllerNotice(self._side, name, notice))
        if not self._events:
            return ()
        events, self._events = self._events, []
        return events

    def _after_reply(self, cycle: Cycle) -> None:
        before, self._last, self._position = self._last, cycle, cycle.state.position
        self._cycles += 1
        self._is_interrupted = False
        if self._speed.advance(cycle.state.dt):
            self._guard.scale_speed(self._speed.value)
        self._guard.observe(cycle.state)
        self.manager.watch(cycle.state)
        self.manager.note_times(cycle.state, self._stations.marks)
        self._note_changes(before.state if before else None, cycle.state)
        self.publish(cycle.state.time)
        self._stations.note(AFTER_REPLY)
        self._recorder.record(cycle, self.manager.reference, self._stations)

    def _note_problem(self, now: float) -> None:
        """The feedback is doubted, the arm holds for a reason of its own, or does no longer."""
        before, self._problem = self._problem, self._guard.problem
        is_doubted = self._guard.counters.implausible != self._implausible
        self._implausible = self._guard.counters.implausible
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
        reported = self._guard.implausible_position
        distances = [abs(is_at - was) for is_at, was in zip(reported, self._position, strict=True)]
        index = distances.index(max(distances))
        deactivated = self.manager.deactivate_commanding() if is_lost else ()
        name = joint_names(self._side)[index]
        return ImplausibleFeedback(self._side, name, distances[index], reported, deactivated, is_lost)

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
        """Let the outside see the arm as it is at ``now``."""
        wire, guard, last = self._arm.wire_counters(), self._guard.counters, self._last
        reference = self.manager.reference
        put_snapshot(
            self._snapshots,
            Snapshot(
                time=now,
                session=wire.session,
                is_streaming=last is not None and not self._is_interrupted,
                is_running=last is not None and last.state.is_running,
                activity=self.manager.activity,
                activation=self.manager.activations if self.manager.is_commanding else 0,
                goal_kind=self.manager.goal_kind,
                position=self._position,
                velocity=last.state.velocity if last else ZERO,
                sent=last.sent.position if last else self._position,
                reference=reference,
                cycles=self._cycles,
                missed=wire.missed,
                lost=wire.lost,
                late=wire.late,
                stale=wire.stale,
                repeated=wire.repeated,
                malformed=wire.malformed,
                foreign=wire.foreign,
                refused=guard.refused,
                position_limited=guard.position_limited,
                slowed=guard.slowed,
                interruptions=self._interruptions,
                implausible=guard.implausible,
                problem=self._guard.problem,
                jitter=wire.jitter,
                worst_jitter=wire.worst_jitter,
                drift_ppm=wire.drift_ppm,
                cycle_time=wire.cycle_time,
            ),
        )


Serve = Callable[[ArmLine, Any, float], Done]


class RequestDesk:
    """Serves requests one after the other; the arms' cycles have to rest meanwhile.

    Args:
        lines: the arms of this process.
    """

    def __init__(self, lines: Mapping[Side, ArmLine]) -> None:
        self._lines = lines

    def serve(self, request: Request, now: float) -> Reply:
        """Carry out ``request``; whatever stands against it becomes a refusal."""
        try:
            return self._carry_out(request, now)
        except (CommandRefused, SwitchFailed) as error:
            return Refusal(str(error))
        except Exception as error:
            return Refusal(f"The request {type(request).__name__} failed with {type(error).__name__}: {error}.")

    def _carry_out(self, request: Request, now: float) -> Done:
        if isinstance(request, CheckOrders):
            return self._check_orders(request.orders)
        if isinstance(request, SendOrders):
            return self._send_orders(request.orders)
        return _SERVED[type(request)](self._lines[request.side], request, now)

    def _check_orders(self, orders: tuple[Order, ...]) -> Done:
        """A second order for a controller could rest on what the first changes."""
        addressees = Counter((order.side, order.controller) for order in orders)
        for (side, name), count in addressees.items():
            if count > 1:
                raise CommandRefused(f"Controller {name!r} of {side.value} is sent {count} orders at once; send one.")
        for order in orders:
            line = self._lines[order.side]
            line.check_follows()
            line.manager.check(order.controller, order.message, line.state)
        return Done()

    def _send_orders(self, orders: tuple[Order, ...]) -> Done:
        """All are checked before any is taken."""
        self._check_orders(orders)
        for order in orders:
            line = self._lines[order.side]
            line.manager.receive(order.controller, order.message, line.state)
        return Done()


def _load(line: ArmLine, request: LoadController, now: float) -> Done:
    line.manager.load_kind(request.name, request.kind, request.values)
    return _shown(line, now)


def _configure(line: ArmLine, request: ConfigureController, now: float) -> Done:
    try:
        line.manager.configure(request.name)
    finally:
        line.publish(now)
    return Done()


def _clean_up(line: ArmLine, request: CleanupController, now: float) -> Done:
    line.manager.clean_up(request.name)
    return _shown(line, now)


def _unload(line: ArmLine, request: UnloadController, now: float) -> Done:
    line.manager.unload(request.name)
    return _shown(line, now)


def _switch(line: ArmLine, request: SwitchControllers, now: float) -> Done:
    return Done(sentence=line.switch(request.activate, request.deactivate, now, request.strictness))


def _hold(line: ArmLine, request: HoldArm, now: float) -> Done:
    line.manager.deactivate_commanding()
    return _shown(line, now)


def _set_parameters(line: ArmLine, request: SetParameters, now: float) -> Done:
    line.manager.set_parameters(request.controller, request.values)
    return Done()


def _list_parameters(line: ArmLine, request: ListParameters, now: float) -> Done:
    return Done(parameters=line.manager.parameters(request.controller))


def _list_controllers(line: ArmLine, request: ListControllers, now: float) -> Done:
    return Done(controllers=line.manager.controllers())


def _list_kinds(line: ArmLine, request: ListControllerKinds, now: float) -> Done:
    return Done(kinds=line.manager.kinds)


def _list_hardware(line: ArmLine, request: ListHardware, now: float) -> Done:
    return Done(hardware=(line.manager.hardware(),))


def _set_hardware_state(line: ArmLine, request: SetHardwareState, now: float) -> Done:
    info = line.manager.set_hardware_state(request.name, request.state)
    line.publish(now)
    return Done(hardware=(info,))


def _shown(line: ArmLine, now: float) -> Done:
    """Done, and to be seen in the snapshot."""
    line.publish(now)
    return Done()


_SERVED: Mapping[type, Serve] = {
    LoadController: _load,
    ConfigureController: _configure,
    CleanupController: _clean_up,
    UnloadController: _unload,
    SwitchControllers: _switch,
    HoldArm: _hold,
    SetParameters: _set_parameters,
    ListParameters: _list_parameters,
    ListControllers: _list_controllers,
    ListControllerKinds: _list_kinds,
    ListHardware: _list_hardware,
    SetHardwareState: _set_hardware_state,
}
