"""The fast-line process: both arms' cycles in one thread, and the handle its parent holds.

Whichever robot datagram arrives is answered at once, so no arm waits for the other. Requests are served between two
cycles, right after the replies. When the parent dies the arms hold until they stand, then the process ends.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import inf
from threading import Event as Flag
from threading import Lock, Thread

from yumi.clock import Clock, SystemClock
from yumi.control.arm_line import ArmLine
from yumi.control.flight_recorder import FLIGHT_SIZE, FlightRecorder
from yumi.control.goals import GOAL_SIZE
from yumi.control.request_desk import RequestDesk
from yumi.control.requests import (
    CycleFailed,
    Done,
    Event,
    FastLineEnded,
    Refusal,
    Reply,
    Request,
    Stop,
)
from yumi.control.snapshot import SNAPSHOT_SIZE, Snapshot, peek_snapshot
from yumi.errors import CommandRefused, NoConnection, RobotNotReady, YumiError
from yumi.hardware.wake import Wait, WakeMode, describe, way_to_wait
from yumi.links.pipe import ChildProcess, PipeClosed, PipeEnd
from yumi.links.poller import HasFileno, Poller
from yumi.links.realtime import prepare_process
from yumi.links.shared_memory import Bell, SharedHistory, SharedMailbox, new_bell, shared_numbers
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import JOINT_COUNT, Side

LAST_HOLD = 2.0
"""How long an arm without a driver is held while it still moves [s]."""

_ANSWER_TIMEOUT = 5.0
_EXPECTED = 1.5 * CYCLE  # [s] after this time without a datagram requests wait for none
_TELLING_PERIOD = 10.0  # [s]
_STATES = 64  # a quarter of a second, longer than a publisher is ever busy


class ArmBoxes:
    """What the fast line and its parent share for one arm.

    Attributes:
        states: the newest measured states, see the joint state broadcaster.
        snapshots: everything else about the arm.
        goals: where it shall go, for controllers that follow a stream of goals.
        point_goals: the same for controllers that plan the way to a single point.
        flight: memory of its flight recorder.
        bell: rung after every cycle.
    """

    def __init__(self) -> None:
        self.states = SharedHistory(1 + 2 * JOINT_COUNT, _STATES)
        self.snapshots = SharedMailbox(SNAPSHOT_SIZE)
        self.goals = SharedMailbox(GOAL_SIZE)
        self.point_goals = SharedMailbox(GOAL_SIZE)
        self.flight = shared_numbers(FLIGHT_SIZE)
        self.bell: Bell = new_bell()


@dataclass(frozen=True, slots=True)
class WiredArm:
    """An arm of the fast line, built in its process.

    Attributes:
        line: its cycle.
        socket: what becomes readable when its robot speaks.
        rehearse: runs a cycle that reaches nobody, see :mod:`yumi.hardware.rehearsal`.
    """

    line: ArmLine
    socket: HasFileno
    rehearse: Callable[[], None] = lambda: None


Build = Callable[[Mapping[Side, ArmBoxes]], Mapping[Side, WiredArm]]
"""Builds the arms inside the fast-line process; must be picklable."""


class FastLineProcess:
    """The parent's handle.

    Args:
        build: how to build the arms in the child.
        wake: how it waits for datagrams.
        on_event: called on a thread of its own for everything the fast line tells.
    """

    def __init__(self, build: Build, on_event: Callable[[Event], None], wake: WakeMode = WakeMode.BLOCKING) -> None:
        self.boxes = {side: ArmBoxes() for side in Side}
        self.recorders = {side: FlightRecorder(boxes.flight) for side, boxes in self.boxes.items()}
        self.started_as = ""
        self._is_wanted = True
        self._child = ChildProcess("yumi-fast-line", run_fast_line, build, self.boxes, wake)
        self._on_event = on_event
        self._lock = Lock()
        self._answers: list[Reply] = []
        self._answered = Flag()
        self._reader = Thread(target=self._read, name="fast-line-events", daemon=True)

    def start(self) -> None:
        """Start the process and wait until it listens.

        Raises:
            NoConnection: it cannot listen for the robot.
        """
        self._child.start()
        try:
            first = self._child.pipe.receive()
        except PipeClosed as error:
            raise RobotNotReady("The fast-line process ended while it started; its output says why.") from error
        if isinstance(first, Refusal):
            self._child.join(_ANSWER_TIMEOUT)
            raise NoConnection(first.sentence)
        self.started_as = first
        self._reader.start()

    @property
    def is_alive(self) -> bool:
        """Whether the process runs."""
        return self._child.exit_code is None

    def snapshot(self, side: Side) -> Snapshot:
        """What is known of an arm; nothing when the process is gone."""
        return peek_snapshot(self.boxes[side].snapshots) if self.is_alive else Snapshot()

    def ask(self, request: Request) -> Done:
        """Have ``request`` served between two cycles.

        Raises:
            CommandRefused: a rule stands against it; nothing was changed.
            RobotNotReady: the fast line is gone.
        """
        with self._lock:
            reply = self._exchange(request)
        if isinstance(reply, Refusal):
            raise CommandRefused(reply.sentence)
        return reply

    def stop(self) -> None:
        """End the process; the arms hold as long as they move."""
        self._is_wanted = False
        if self.is_alive:
            self._tell_to_stop()
        if not self._child.join(LAST_HOLD + _ANSWER_TIMEOUT):
            self._child.kill()
        if self._reader.ident is not None:
            self._reader.join()

    def _tell_to_stop(self) -> None:
        try:
            self._child.pipe.send(Stop())
        except PipeClosed:
            return  # it has ended by itself, which is what we want

    def _exchange(self, request: Request) -> Reply:
        self._answered.clear()
        try:
            self._child.pipe.send(request)
        except PipeClosed as error:
            raise RobotNotReady("The fast-line process has ended; restart the driver.") from error
        if not self._answered.wait(_ANSWER_TIMEOUT):
            raise RobotNotReady(f"The fast line did not answer within {_ANSWER_TIMEOUT:g} s; restart the driver.")
        return self._answers.pop()

    def _read(self) -> None:
        while True:
            try:
                value = self._child.pipe.receive()
            except PipeClosed:
                if self._is_wanted:
                    self._child.join(_ANSWER_TIMEOUT)
                    self._on_event(FastLineEnded(self._child.exit_code))
                return
            if isinstance(value, Done | Refusal):
                self._answers.append(value)
                self._answered.set()
            else:
                self._on_event(value)


def run_fast_line(pipe: PipeEnd, build: Build, boxes: Mapping[Side, ArmBoxes], wake: WakeMode) -> None:
    """Main function of the fast-line process."""
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(each, signal.SIG_IGN)  # the parent decides when motion ends; its own end closes the pipe
    try:
        arms = build(boxes)
    except YumiError as error:
        pipe.send(Refusal(str(error)))
        return
    clock = SystemClock()
    wait = way_to_wait(wake, clock)
    pipe.send(f"Fast line: {prepare_process()}, {describe(wait)}.")
    FastLine(pipe, arms, boxes, clock, wait).run()


class FastLine:
    """The loop inside the process."""

    def __init__(
        self, pipe: PipeEnd, arms: Mapping[Side, WiredArm], boxes: Mapping[Side, ArmBoxes], clock: Clock, wait: Wait
    ) -> None:
        self._pipe = pipe
        self._wait = wait
        self._arms = {side: arm.line for side, arm in arms.items()}
        self._desk = RequestDesk(self._arms)
        self._clock = clock
        self._stop_at: float | None = None
        self._unfinished: list[tuple[Side, Callable[[], None]]] = []
        self._requests: list[Request] = []
        self._failures: dict[str, float] = {}
        self._poller = Poller()
        wait.prepare({side: self._rehearsal_of(side, arm) for side, arm in arms.items()})
        for side, arm in arms.items():
            self._poller.watch(arm.socket, self._cycle_of(side, arm.line, boxes[side].bell))
        self._poller.watch(pipe, self._receive)

    def run(self) -> None:
        """Serve datagrams and requests until told to stop, and until the arms stand."""
        lines = tuple(self._arms.values())
        while not self._may_end():
            self._wait.wait(self._poller, any(line.state is not None for line in lines))
            has_answered = self._finish_cycles()
            if self._requests and (has_answered or not self._is_datagram_due()):
                self._serve_requests()
            for side, line in self._arms.items():
                line.watch_silence(self._clock.now())
                self._tell(side, line)
        self._wait.close()
        self._poller.close()

    def _cycle_of(self, side: Side, line: ArmLine, bell: Bell) -> Callable[[], None]:
        now, note_arrival = self._clock.now, self._wait.note_arrival

        def finish(arrival: float) -> None:
            line.finish()
            bell.release()
            note_arrival(side, arrival)

        def answer() -> None:
            arrival = now()
            try:
                if line.answer(arrival):
                    self._unfinished.append((side, partial(finish, arrival)))
            except Exception as error:
                self._note_failure(side, error)

        return answer

    def _finish_cycles(self) -> bool:
        """What can wait until after the replies, of both arms: their datagrams often come at the same time."""
        if not self._unfinished:
            return False
        self._poller.wait(0.0)
        for side, finish in self._unfinished:
            try:
                finish()
            except Exception as error:
                self._note_failure(side, error)
        self._unfinished.clear()
        return True

    def _is_datagram_due(self) -> bool:
        now = self._clock.now()
        return any(line.state is not None and now - line.state.time < _EXPECTED for line in self._arms.values())

    def _rehearsal_of(self, side: Side, arm: WiredArm) -> Callable[[], None]:
        def rehearse() -> None:
            try:
                arm.rehearse()
            except Exception as error:
                self._note_failure(side, error)

        return rehearse

    def _note_failure(self, side: Side, error: Exception) -> None:
        """Tell a fault now and again; at 250 Hz each telling would only bury the first."""
        sentence, now = f"{type(error).__name__}: {error}", self._clock.now()
        if now - self._failures.get(sentence, -inf) > _TELLING_PERIOD:
            self._failures[sentence] = now
            self._send(CycleFailed(side, sentence))

    def _may_end(self) -> bool:
        if self._stop_at is None:
            return False
        return self._clock.now() > self._stop_at or all(line.is_still for line in self._arms.values())

    def _tell(self, side: Side, line: ArmLine) -> None:
        for event in line.take_events():
            try:
                self._send(event)
            except Exception as error:  # a controller's notice that cannot be pickled
                self._note_failure(side, error)

    def _receive(self) -> None:
        try:
            request = self._pipe.receive()
        except PipeClosed:
            self._poller.forget(self._pipe)
            self._begin_to_end()
            return
        if isinstance(request, Stop):
            self._begin_to_end()
        else:
            self._requests.append(request)

    def _serve_requests(self) -> None:
        """Right after the replies, when the next datagrams are farthest away; at once when none is due."""
        for request in self._requests:
            self._send(self._desk.serve(request, self._clock.now()))
        self._requests.clear()

    def _begin_to_end(self) -> None:
        self._stop_at = self._clock.now() + LAST_HOLD
        for line in self._arms.values():
            line.manager.deactivate_commanding()

    def _send(self, value: object) -> None:
        try:
            self._pipe.send(value)
        except PipeClosed:
            return  # the parent is gone; its end of the pipe says so to _receive
