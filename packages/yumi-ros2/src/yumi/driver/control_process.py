"""The control process: the cycles of both arms in one thread of a process of its own, and the parent's handle on it.

It waits on both arms' sockets and on the command pipe. Datagrams come first: each is answered, then what follows a
reply is done, then a command is served, as long as no datagram is due. When the parent dies the arms hold until they
stand, then the process ends.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from functools import partial
from math import inf
from threading import Event as Flag
from threading import Lock
from typing import Any, Concatenate, NamedTuple, ParamSpec, TypeVar, cast

from abb_protocols.catalogue import Message, clause, message, said_by
from abb_protocols.errors import CommandRefused, NoConnection, RobotNotReady, YumiError
from abb_protocols.robot.joints import Side
from abb_runtime.process.child import ChildProcess, PipeClosed, PipeEnd
from abb_runtime.process.realtime import AwakeProcessors, prepare_process
from abb_runtime.process.supervision import SupervisedThread, ThreadFailures
from abb_runtime.udp import HasFileno, Poller
from yumi.control.flight_recorder import FLIGHT_SIZE, FlightRecorder
from yumi.control.hand_over import HandOver
from yumi.control.loop import ArmLoop
from yumi.control.loop_commands import COMMANDS, Commands, serve
from yumi.control.loop_events import ControlProcessEnded, CycleFailed, Event, ReportsDropped
from yumi.control.motion.robot_response import STANDING
from yumi.control.place import ControllerBuffers
from yumi.control.shared_memory import (
    CycleEvent,
    SharedBuffer,
    SharedBytes,
    SharedNumbers,
    new_cycle_event,
    shared_numbers,
)
from yumi.control.shared_state import JointStates, SharedDeadline, Snapshot, read_snapshot
from yumi.control.speed_scale import SpeedFactor
from yumi.driver.egm_arm import FallbackThread

_POLL_PERIOD = 0.010
"""How often the robot's timeout is checked when nothing arrives [s]."""

_LAST_HOLD = 2.0
"""How long an arm without a driver is held while it still moves [s]."""

STALE_SNAPSHOT = 0.5
"""A snapshot of an arm whose datagrams come is renewed every 4 ms; an older one is of a process that hangs [s]."""

HUNG_PROCESS = 2.0
"""A process that stands still for so long is not waited for, less than the robot's watchdog waits by default [s]."""

FRESH_FEEDBACK = 1.5
"""A controller says at least once a second how it follows a trajectory [s]."""

_REPORT_PERIOD = 10.0  # [s]
_LONGEST_DATAGRAM = 4096  # bytes; a robot's has some hundred
_ANSWER_TIMEOUT = 5.0
_STOOD_STILL = message("control_process_stood_still_too_long", duration=_ANSWER_TIMEOUT)

PROCESS_ENDED = message("control_process_is_gone")
"""Why nothing can be asked of it, nor is the end of a motion known."""

PROCESS_STARTING = message("control_process_starts")
"""Why nothing can be asked of it yet."""

_P = ParamSpec("_P")
_T = TypeVar("_T")


class WakeMode(Enum):
    """How the control process waits for datagrams.

    AUTO: asleep, beside processors that are kept from halting while EGM runs, where that is permitted.
    BLOCKING: asleep; a processor that has halted meanwhile wakes up late.
    """

    AUTO = "auto"
    BLOCKING = "blocking"


class ArmBuffers(ControllerBuffers):
    """What the control process and its parent share for one arm, that of its controllers included.

    Attributes:
        snapshots: everything about the arm but its measured states.
        speed_scale: the factor on its speeds.
        deadline: until when the one who commands it must be heard again.
        read_joints: the joints as they were read from the controller, while EGM does not report them.
        flight: memory of its flight recorder.
        datagram: the robot's newest, for what the control loop does not read of it.
        cycle_done: released after every cycle.
    """

    def __init__(self) -> None:
        super().__init__()
        self.snapshots = SharedBuffer(Snapshot)
        self.speed_scale = SharedBuffer(SpeedFactor)
        self.deadline = SharedBuffer(SharedDeadline)
        self.read_joints = SharedBuffer(JointStates)
        self.flight = shared_numbers(FLIGHT_SIZE)
        self.datagram = SharedBytes(_LONGEST_DATAGRAM)
        self.cycle_done = new_cycle_event()


class ControlProcessArm(NamedTuple):
    """An arm of the control process, built there.

    Attributes:
        loop: its cycles.
        socket: what becomes readable when its robot sends.
        fallback: what answers while this process does not, the same for both arms; None where nothing does.
    """

    loop: ArmLoop
    socket: HasFileno
    fallback: FallbackThread | None = None


_Build = Callable[[Mapping[Side, ArmBuffers]], Mapping[Side, ControlProcessArm]]
"""Builds both arms inside the process; must be picklable."""


class ControlProcessCall(NamedTuple):
    """A command on its way through the pipe, with a number that its answer bears, too."""

    number: int
    name: str
    args: tuple[object, ...]
    kwargs: Mapping[str, object]


class ControlProcessStop(NamedTuple):
    """End the control process when the arms stand."""


NO_NUMBER = 0
"""Stands for the number of a command that could not be read."""


class ControlProcessAnswer(NamedTuple):
    """What the command of that number returned."""

    number: int
    value: object


@dataclass(frozen=True, slots=True)
class ControlProcessRefusal:
    """The command broke a rule and changed nothing; where a switch failed halfway, the message says what it left."""

    said: Message


def run_control_process(
    pipe: PipeEnd,
    build: _Build,
    buffers: Mapping[Side, ArmBuffers],
    wake: WakeMode = WakeMode.BLOCKING,
    given_up: SharedNumbers | None = None,
) -> None:
    """Main function of the process."""
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP):
        signal.signal(each, signal.SIG_IGN)  # the parent decides when motion ends; its own end closes the pipe
    try:
        arms = build(buffers)
        prepared = prepare_process()
        for fallback in {arm.fallback for arm in arms.values() if arm.fallback is not None}:
            fallback.start()
    except (YumiError, OSError, MemoryError) as error:  # the last two: of limits of the operating system
        pipe.send(ControlProcessRefusal(said_by(error)))
        return
    processors = AwakeProcessors() if wake is WakeMode.AUTO and AwakeProcessors.are_permitted() else None
    how = "processors kept awake while EGM runs" if processors else "asleep between datagrams"
    pipe.send(f"Control process: {prepared}, {how}.")
    events = {side: each.cycle_done for side, each in buffers.items()}
    ControlServer(pipe, arms, events, time.monotonic, processors, given_up).run()


class ControlServer:
    """The loop inside the process.

    Args:
        pipe: to the parent.
        arms: both.
        cycle_done: released after each cycle of an arm.
        now: returns the time on the machine's monotonic clock [s].
        processors: kept awake while a robot streams; None lets them halt.
        given_up: the number of the newest command whose answer the parent waits for no more.
    """

    def __init__(
        self,
        pipe: PipeEnd,
        arms: Mapping[Side, ControlProcessArm],
        cycle_done: Mapping[Side, CycleEvent],
        now: Callable[[], float],
        processors: AwakeProcessors | None = None,
        given_up: SharedNumbers | None = None,
    ) -> None:
        self._given_up = given_up or shared_numbers(1)
        self._pipe = pipe
        self._arms = {side: arm.loop for side, arm in arms.items()}
        self._sides = tuple(arms)
        self._cycle_done = cycle_done
        self._now = now
        self._processors = processors
        self._commands = Commands(self._arms, now)
        self._stop_at: float | None = None
        self._has_command = False
        self._replied: list[tuple[Side, float]] = []
        self._failures: dict[str, float] = {}
        self._dropped = 0
        self._fallback = next((arm.fallback for arm in arms.values() if arm.fallback is not None), None)
        self._poller = Poller()
        for side, arm in arms.items():
            self._poller.watch(arm.socket, partial(self._reply, side))
        self._watch_pipe()

    def run(self) -> None:
        """Serve datagrams and commands until asked to stop, and until the arms stand."""
        arms = tuple(self._arms.values())
        while self._stop_at is None or (self._now() <= self._stop_at and not all(arm.is_still for arm in arms)):
            self._keep_awake(is_needed=any(arm.state is not None for arm in arms))
            self._flush()
            looked = self._now()  # what comes later may wait in a socket while we do something else
            if self._wait(_POLL_PERIOD):  # answers every datagram that waits
                self._wait(0.0)  # and the other arm's, which came meanwhile, before what can wait
            self._settle()
            if self._has_command and not any(arm.is_datagram_due(self._now()) for arm in arms):
                self._read_command()
            for side, arm in self._arms.items():
                try:
                    arm.watch_silence(looked)
                    events = arm.take_events()
                except Exception as error:  # the other arm is served whatever happens to this one
                    self._fail(side, error)
                    continue
                for event in events:
                    try:
                        self._send(event)
                    except Exception as error:  # a controller's report that cannot be pickled
                        self._note_failure(event.side, error)
        self._keep_awake(is_needed=False)
        if self._fallback is not None:
            self._fallback.close()
        self._poller.close()

    def _wait(self, timeout: float) -> bool:
        """Wait for datagrams and commands, at most ``timeout`` [s]; answer the first. Whether there was any."""
        if self._fallback is None:
            return self._poller.wait(timeout)
        if timeout:
            for side, arm in self._arms.items():
                try:
                    arm.prepare()
                except Exception as error:  # a controller's own formula
                    self._fail(side, error)
        ready, has_command = self._fallback.wait(self._pipe_at, timeout)
        for number in ready:
            self._reply(self._sides[number])
        if has_command:
            self._note_command()
        return bool(ready)

    def _keep_awake(self, *, is_needed: bool) -> None:
        """Keep the processors from halting, or let them halt again."""
        if self._processors is None:
            return
        with suppress(OSError):  # what was permitted at the start may be no more: replies are late at worst
            if is_needed:
                self._processors.hold()
            else:
                self._processors.release()

    def _reply(self, side: Side) -> None:
        if any(each is side for each, _ in self._replied):
            self._settle()
        arrival = self._now()
        try:
            self._arms[side].reply(arrival)
        except Exception as error:  # the other arm is served whatever happens to this one
            self._fail(side, error)
        else:
            self._replied.append((side, arrival))

    def _settle(self) -> None:
        """What can wait until both arms have their replies."""
        replied, self._replied = self._replied, []
        for side, arrival in replied:
            arm = self._arms[side]
            try:
                if arm.settle(arrival):
                    self._cycle_done[side].release()
            except Exception as error:
                self._fail(side, error)
        try:
            for change in self._commands.allowed.take_events():
                self._send(change)
        except Exception as error:  # what may touch now is not sure
            for side in self._arms:
                self._fail(side, error)

    def _fail(self, side: Side, error: Exception) -> None:
        """Have the arm hold with its next reply, and report the fault now and then: at 250 Hz it would bury others."""
        self._arms[side].manager.deactivate_commanding()
        if self._fallback is not None:
            self._arms[side].prepare()
        self._note_failure(side, error)

    def _note_failure(self, side: Side, error: Exception) -> None:
        sentence, now = f"{type(error).__name__}: {error}", self._now()
        if now - self._failures.get(f"{side.value} {sentence}", -inf) > _REPORT_PERIOD:
            self._failures[f"{side.value} {sentence}"] = now
            self._send(CycleFailed(side, sentence))

    def _note_command(self) -> None:
        """To serve a command may take longer than a reply: no datagram should have to wait for it."""
        self._has_command, self._pipe_at = True, -1
        self._poller.forget(self._pipe)

    def _watch_pipe(self) -> None:
        self._pipe_at = self._pipe.fileno()
        self._poller.watch(self._pipe, self._note_command)

    def _read_command(self) -> None:
        self._has_command = False
        try:
            command: ControlProcessCall | ControlProcessStop = self._pipe.receive()
            if isinstance(command, ControlProcessStop):
                self._begin_to_end()
            else:
                self._send(ControlProcessAnswer(command.number, self._serve(command)))
        except PipeClosed:
            self._begin_to_end()
            return
        except Exception as error:  # the next one is sound
            refusal = ControlProcessRefusal(
                message("command_unreadable", kind=type(error).__name__, reason=said_by(error))
            )
            self._send(ControlProcessAnswer(NO_NUMBER, refusal))
        self._watch_pipe()

    def _serve(self, call: ControlProcessCall) -> object:
        """The answer to a command; one that has failed already for who gave it would be a surprise."""
        if call.number <= self._given_up[0]:
            for side, arm in self._arms.items():
                arm.manager.deactivate_commanding()
                self._send(CycleFailed(side, clause(_STOOD_STILL)))
            return ControlProcessRefusal(message("command_too_late", command=call.name))
        command = COMMANDS.get(call.name)
        if command is None:
            return ControlProcessRefusal(message("command_unknown", command=call.name))
        try:
            return serve(self._commands, command, *call.args, **call.kwargs)
        except CommandRefused as refusal:
            return ControlProcessRefusal(refusal.said)

    def _begin_to_end(self) -> None:
        self._stop_at = self._now() + _LAST_HOLD
        for arm in self._arms.values():
            arm.manager.deactivate_commanding()

    def _send(self, value: object) -> None:
        """A parent that does not read, since it was stopped, must not stop the arms: nothing here waits for it."""
        try:
            self._dropped += not self._pipe.send_soon(value)
        except PipeClosed:
            return  # the parent is gone; its end of the pipe says so to _read_command

    def _flush(self) -> None:
        try:
            is_empty = self._pipe.flush()
        except PipeClosed:
            return  # as above
        if self._dropped and is_empty:
            dropped, self._dropped = self._dropped, 0
            for side, arm in self._arms.items():  # who waited for a motion hears that it failed
                arm.manager.deactivate_commanding()
                self._send(ReportsDropped(side, dropped))


class ControlProcess:
    """The parent's handle on the control process.

    Args:
        build: how to build the arms in the child.
        on_event: called on a thread of its own for everything the process reports.
        wake: how it waits for datagrams.

    Attributes:
        buffers: what it shares with its parent, per arm.
        recorders: the memory of each arm's flight recorder.
        hand_over: who commands each arm: every command passes there.
        started_as: what the operating system permitted it, in a sentence.
    """

    def __init__(self, build: _Build, on_event: Callable[[Event], None], wake: WakeMode = WakeMode.BLOCKING) -> None:
        self.buffers = {side: ArmBuffers() for side in Side}
        self.recorders = {side: FlightRecorder(each.flight) for side, each in self.buffers.items()}
        self.started_as = ""
        self._build, self._wake = build, wake
        self._on_event = on_event
        self.hand_over = HandOver(time.monotonic, self._is_busy, self._handle)
        self._lock = Lock()
        self._number = 0
        self._given_up = shared_numbers(1)
        self._answers: list[object] = []
        self._answered = Flag()
        self._is_expected_to_run = True
        self._failures = ThreadFailures()
        self._is_ready = False
        self._child, self._reader = self._new_child()

    def _new_child(self) -> tuple[ChildProcess, SupervisedThread]:
        child = ChildProcess("yumi-control", run_control_process, self._build, self.buffers, self._wake, self._given_up)
        reader = SupervisedThread("control-events", partial(self._read, child), Flag())  # the end of the pipe ends it
        return child, reader

    def launch(self) -> None:
        """Start the process without waiting for it: its imports take as long as what a driver does meanwhile.

        :meth:`start` waits for it, :meth:`stop` ends it.

        Raises:
            MissingPrerequisite: the operating system does not let it start.
        """
        self._child.start()

    def start(self) -> None:
        """Start the process, if it was not launched before, and wait until it listens.

        Raises:
            NoConnection: it cannot listen for the robot; it does not run any more.
            RobotNotReady: it ended while it started.
        """
        try:
            self._begin()
        except BaseException:
            self.stop()
            raise

    def _begin(self) -> None:
        if not self._child.is_started:
            self._child.start()
        try:
            first = self._child.pipe.receive()
        except PipeClosed as error:
            raise RobotNotReady(message("control_process_ended_at_start")) from error
        if isinstance(first, ControlProcessRefusal):
            self._child.join(_ANSWER_TIMEOUT)
            raise NoConnection(first.said)
        self.started_as = first
        self._reader.start()
        self._is_ready = True

    def check(self) -> None:
        """See that the process runs; raises RobotNotReady when it has ended, or stands still while a robot streams.

        The robot's watchdog gets no heartbeat then: nothing controls the arms.
        """
        if not self._is_alive:
            raise RobotNotReady(PROCESS_ENDED)
        newest = [read_snapshot(each.snapshots) for each in self.buffers.values()]
        age = time.monotonic() - min((each.time for each in newest if each.is_streaming), default=inf)
        if age > HUNG_PROCESS:
            raise RobotNotReady(message("control_process_stands_still", duration=age))

    def revive(self) -> bool:
        """Start the process again if it has ended by itself, with its controllers as at first.

        Returns:
            Whether it had ended.

        Raises:
            NoConnection: it cannot listen for the robot.
            RobotNotReady: it ended while it started.
        """
        if self._is_alive:
            return False
        self._is_ready = False
        self._join()
        for buffers in self.buffers.values():
            # What its predecessor knew is history; its numbers are not given again, as goals of before bear them.
            buffers.snapshots.write(Snapshot(activity=read_snapshot(buffers.snapshots).activity))
        self._child, self._reader = self._new_child()
        self._begin()
        return True

    def snapshot(self, side: Side) -> Snapshot:
        """What is known of an arm; nothing when the process is gone, nothing of its motion when it stands still."""
        if not self._is_alive:
            return Snapshot()
        snapshot = read_snapshot(self.buffers[side].snapshots)
        if snapshot.is_streaming and time.monotonic() - snapshot.time > STALE_SNAPSHOT:
            return snapshot._replace(is_streaming=False, is_running=False, activation=0)
        return snapshot

    def call(self, command: Callable[Concatenate[Commands, _P], _T], /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Have ``command``, a method of :class:`.Commands`, served between two cycles; returns its answer.

        Raises:
            CommandRefused: a rule stands against it, or another client commands the arm; nothing was changed.
            RobotNotReady: the control process starts, has ended or does not answer.
        """
        with self.hand_over.passing(command, args, kwargs), self._lock:
            # It would find the command when it has started, long after its caller got an error.
            if self._is_alive and not self._is_ready:
                raise RobotNotReady(PROCESS_STARTING)
            self._answered.clear()
            self._answers.clear()
            self._number += 1  # an answer that comes too late is not taken for that of the next command
            try:
                self._child.pipe.send(ControlProcessCall(self._number, command.__name__, args, kwargs))
            except PipeClosed as error:
                raise RobotNotReady(PROCESS_ENDED) from error
            if not self._answered.wait(_ANSWER_TIMEOUT):
                self._given_up[0] = self._number
                raise RobotNotReady(message("control_process_does_not_answer", timeout=_ANSWER_TIMEOUT))
            if not self._answers:
                raise RobotNotReady(PROCESS_ENDED)
            value = self._answers.pop()
            if isinstance(value, ControlProcessRefusal):
                raise CommandRefused(value.said)
        return cast("_T", value)

    def stop(self) -> None:
        """End the process; the arms hold as long as they move."""
        self._is_expected_to_run = False
        with self._lock, suppress(PipeClosed):  # that it has ended by itself is what we want
            self._child.pipe.send(ControlProcessStop())
        self._join()

    @property
    def _is_alive(self) -> bool:
        return self._child.exit_code is None

    def _join(self) -> None:
        """Wait for the end of the process, which comes by force when it takes too long."""
        if not self._child.is_started:
            return
        if not self._child.join(_LAST_HOLD + _ANSWER_TIMEOUT):
            self._child.kill()
        self._reader.join()

    def _read(self, child: ChildProcess) -> None:
        while True:
            try:
                value: Any = child.pipe.receive()
            except PipeClosed:
                self._answered.set()  # who waits for an answer waits in vain
                if self._is_expected_to_run:
                    child.join(_ANSWER_TIMEOUT)
                    for side in Side:
                        ended = ControlProcessEnded(side, child.exit_code)
                        self._handle(ended)
                        self.hand_over.note(ended)
                return
            if not isinstance(value, ControlProcessAnswer):
                self._handle(value)
                self.hand_over.note(value)
            elif value.number in (self._number, NO_NUMBER):
                self._answers.append(value.value)
                self._answered.set()

    def _is_busy(self, side: Side) -> bool:
        """Whether an arm moves, or is on its way however slowly."""
        snapshot, buffers = self.snapshot(side), self.buffers[side]
        if not snapshot.is_running:
            return False
        newest = (each.read() for each in (buffers.trajectory, buffers.dual_trajectory, buffers.tool_path))
        is_followed = any(
            it is not None and it[1].goal and snapshot.time - it[1].time < FRESH_FEEDBACK for it in newest
        )
        return is_followed or snapshot.is_on_way or max(map(abs, snapshot.velocity)) > STANDING

    def _handle(self, event: Event) -> None:
        try:
            self._on_event(event)
        except Exception as error:  # who waits for an answer does not care what becomes of an event
            self._failures.note(f"Handling {type(event).__name__} of the {event.side.word} arm", error)
