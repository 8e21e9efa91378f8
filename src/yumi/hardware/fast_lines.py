"""The parent's handles on the fast lines: a process per arm, so that no arm ever waits for the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from math import dist
from threading import Event as Flag
from threading import Lock, Thread

from yumi.control.flight_recorder import FlightRecorder
from yumi.control.orders import check_orders, send_orders
from yumi.control.requests import (
    CheckOrders,
    Done,
    Event,
    FastLineEnded,
    FeedbackDoubted,
    Refusal,
    Reply,
    Request,
    SendOrders,
    Stop,
)
from yumi.control.snapshot import Snapshot, peek_snapshot, put_snapshot
from yumi.errors import CommandRefused, NoConnection, RobotNotReady
from yumi.hardware.fast_line import LAST_HOLD, UNREADABLE, Answer, ArmBoxes, Build, Question, run_fast_line
from yumi.hardware.wake import WakeMode
from yumi.links.pipe import ChildProcess, PipeClosed
from yumi.robot.joints import Side

EXCHANGED = 0.5
"""A position that one arm's datagrams report is the other arm's if it is as near to that [rad, over all joints]."""

_ANSWER_TIMEOUT = 5.0


def ended(side: Side) -> str:
    """What to tell when an arm's process is gone."""
    return f"The fast-line process of the {side.word} arm has ended; call recover, which starts another one."


class FastLineProcess:
    """The handle on one arm's process.

    Args:
        side: the arm.
        build: how to build it in the child.
        boxes: what both arms share with their parent, and with each other.
        on_event: called on a thread of its own for everything the fast line tells.
        wake: how it waits for datagrams.

    Attributes:
        started_as: what the operating system permitted it, in a sentence.
    """

    def __init__(
        self,
        side: Side,
        build: Build,
        boxes: Mapping[Side, ArmBoxes],
        on_event: Callable[[Event], None],
        wake: WakeMode,
    ) -> None:
        self._snapshots = boxes[side].snapshots
        self.started_as = ""
        self._side = side
        self._is_wanted = True
        self._child = ChildProcess(f"yumi-fast-line-{side.value}", run_fast_line, build, side, boxes, wake)
        self._on_event = on_event
        self._lock = Lock()
        self._answers: list[Reply] = []
        self._number = 0
        self._answered = Flag()
        self._reader = Thread(target=self._read, name="fast-line-events", daemon=True)

    def start(self) -> None:
        """Start the process; :meth:`wait_until_it_listens` follows."""
        self._child.start()

    def wait_until_it_listens(self) -> None:
        """Wait for the end of the start.

        Raises:
            NoConnection: it cannot listen for the robot.
        """
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

    def snapshot(self) -> Snapshot:
        """What is known of the arm; nothing when the process is gone."""
        return peek_snapshot(self._snapshots) if self.is_alive else Snapshot()

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

    def tell_to_stop(self) -> None:
        """Have the process end when the arm stands; :meth:`join` follows."""
        self._is_wanted = False
        try:
            with self._lock:
                self._child.pipe.send(Stop())
        except PipeClosed:
            return  # it has ended by itself, which is what we want

    def join(self) -> None:
        """Wait for the end of the process, which comes by force when it takes too long."""
        if not self._child.is_started:
            return
        if not self._child.join(LAST_HOLD + _ANSWER_TIMEOUT):
            self._child.kill()
        if self._reader.ident is not None:
            self._reader.join()

    def _exchange(self, request: Request) -> Reply:
        self._answered.clear()
        self._number += 1  # an answer that comes too late is not taken for that of the next request
        try:
            self._child.pipe.send(Question(self._number, request))
        except PipeClosed as error:
            raise RobotNotReady(ended(self._side)) from error
        if not self._answered.wait(_ANSWER_TIMEOUT):
            raise RobotNotReady(f"The fast line did not answer within {_ANSWER_TIMEOUT:g} s; restart the driver.")
        if not self._answers:
            raise RobotNotReady(ended(self._side))
        return self._answers.pop()

    def _read(self) -> None:
        while True:
            try:
                value = self._child.pipe.receive()
            except PipeClosed:
                self._answered.set()  # who waits for an answer waits in vain
                if self._is_wanted:
                    self._child.join(_ANSWER_TIMEOUT)
                    self._on_event(FastLineEnded(self._side, self._child.exit_code))
                return
            if isinstance(value, Answer):
                self._take_answer(value)
            else:
                self._on_event(value)

    def _take_answer(self, answer: Answer) -> None:
        if answer.number in (self._number, UNREADABLE):
            self._answers.append(answer.reply)
            self._answered.set()


class FastLines:
    """The fast lines of both arms.

    Args:
        build: how to build an arm in its process.
        on_event: called on threads of their own for everything the fast lines tell.
        wake: how they wait for datagrams.

    Attributes:
        boxes: what each arm's process shares with its parent.
        recorders: the memory of each arm's flight recorder.
    """

    def __init__(self, build: Build, on_event: Callable[[Event], None], wake: WakeMode = WakeMode.BLOCKING) -> None:
        self.boxes = {side: ArmBoxes() for side in Side}
        self._build, self._on_event, self._wake = build, partial(self._explain, on_event), wake
        self._lines = {side: self._new_line(side) for side in Side}
        self.recorders = {side: FlightRecorder(boxes.flight) for side, boxes in self.boxes.items()}

    def _new_line(self, side: Side) -> FastLineProcess:
        return FastLineProcess(side, self._build, self.boxes, self._on_event, self._wake)

    def start(self) -> None:
        """Start both processes and wait until they listen.

        Raises:
            NoConnection: one cannot listen for the robot; none runs any more.
        """
        try:
            for line in self._lines.values():
                line.start()
            for line in self._lines.values():
                line.wait_until_it_listens()
        except BaseException:
            self.stop()
            raise

    @property
    def started_as(self) -> str:
        """What the operating system permitted them, in a sentence."""
        return self._lines[Side.RIGHT].started_as

    def check(self) -> None:
        """See that both processes run.

        Raises:
            RobotNotReady: one has ended.
        """
        for side, line in self._lines.items():
            if not line.is_alive:
                raise RobotNotReady(ended(side))

    def revive(self) -> tuple[Side, ...]:
        """Start again what has ended by itself, with its controllers as at first; tells which arms.

        Raises:
            NoConnection: one cannot listen for the robot.
            RobotNotReady: one ended while it started.
        """
        ended_ones = tuple(side for side, line in self._lines.items() if not line.is_alive)
        for side in ended_ones:
            self._lines[side].join()
            put_snapshot(self.boxes[side].snapshots, Snapshot())  # what its predecessor knew is history
            line = self._lines[side] = self._new_line(side)
            line.start()
            line.wait_until_it_listens()
        return ended_ones

    def snapshot(self, side: Side) -> Snapshot:
        """What is known of an arm; nothing when its process is gone."""
        return self._lines[side].snapshot()

    def ask(self, request: Request) -> Done:
        """Have ``request`` served between two cycles of its arm.

        Orders for both arms are checked on both before any is sent: what stands against one stands against all.

        Raises:
            CommandRefused: a rule stands against it; nothing was changed.
            RobotNotReady: the arm's fast line is gone.
        """
        if isinstance(request, CheckOrders):
            return check_orders(request.orders, self._ask_arm)
        if isinstance(request, SendOrders):
            return send_orders(request.orders, self._ask_arm)
        return self._ask_arm(request.side, request)

    def _explain(self, on_event: Callable[[Event], None], event: Event) -> None:
        """Each arm's process knows its own positions only; those of both tell whether their datagrams are exchanged."""
        if isinstance(event, FeedbackDoubted):
            own, other = self.snapshot(event.side).position, self.snapshot(event.side.other).position
            if dist(event.position, other) < min(EXCHANGED, dist(event.position, own)):
                event = replace(event, is_other_arm=True)
        on_event(event)

    def _ask_arm(self, side: Side, request: Request) -> Done:
        return self._lines[side].ask(request)

    def stop(self) -> None:
        """End both processes; the arms hold as long as they move."""
        for line in self._lines.values():
            line.tell_to_stop()
        for line in self._lines.values():
            line.join()
