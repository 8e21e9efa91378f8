"""A child process and the pipe to it: requests down, answers and news up, and the end of either side noticed.

A rehearsal: one cycle of a stand-in arm shortly before a datagram is due, so that the real cycle finds warm caches.

After 4 ms of sleep every page and cache line on the way to the reply has gone cold, and a cycle takes three times as
long as the next one would (docs/explanation/performance.md). The stand-in has an arm, controllers, a guard and sockets
of its own and hears what the robot said last: the same code and the same way through the kernel, and nothing of it
reaches the robot.

The fast line of one arm: its cycles in one thread of a process of its own.

Requests are served between two cycles, while no datagram is due. When the parent dies the arm holds until it stands,
then the process ends.

The parent's handles on the fast lines: a process per arm, so that no arm ever waits for the other.

How the fast line waits for the next datagram: asleep, beside processors that are awake, or looking ahead of time.

========== ==================================================== =================================================
mode       how it waits                                         what it costs
========== ==================================================== =================================================
blocking   asleep until a datagram comes; awake shortly before  a rehearsal each cycle; a processor that is halted
           it is due, for a rehearsal                           wakes up late
hot        the same beside processors that never halt           idle processors draw power; needs permission
ahead      after the rehearsal it looks for the datagram        at most 15 % of one processor per arm; a virtual
           without pause, for at most a tenth of a period       robot beside it has to wait
auto       ``hot`` where it is permitted, else ``ahead``
========== ==================================================== =================================================

When the next datagram of a robot is due, and how long before it is worth being awake.

The robot's period is known; what has to be learned is how late the machine wakes up from a sleep and how much the
arrivals jitter. The margin grows at once when a datagram was already waiting, and shrinks slowly otherwise, so that
it settles where a datagram is rarely missed and little time is spent looking.
"""

from __future__ import annotations

import io
import mmap
import os
import pickle
import signal
import struct
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from math import dist, inf
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler
from threading import Event as Flag
from threading import Lock
from types import ModuleType
from typing import Any, NamedTuple

from yumi.clock import Clock, SystemClock
from yumi.control.commands import GOAL_SIZE
from yumi.control.controller_manager import ControllerManager
from yumi.control.cycle import run_cycle
from yumi.control.flight_recorder import FLIGHT_SIZE, FlightRecorder
from yumi.control.limiter import Limiter
from yumi.control.loop import ArmLine, RequestDesk
from yumi.control.requests import (
    CheckOrders,
    CycleFailed,
    Done,
    Event,
    FastLineEnded,
    ImplausibleFeedback,
    Refusal,
    Reply,
    Request,
    SendOrders,
    Stop,
    check_orders,
    send_orders,
)
from yumi.control.shared_state import (
    FEEDBACK_SIZE,
    PROCESSES,
    SNAPSHOT_SIZE,
    Bell,
    SharedHistory,
    SharedMailbox,
    Snapshot,
    new_bell,
    peek_snapshot,
    put_snapshot,
    shared_numbers,
)
from yumi.control.statistics import StageClock
from yumi.control.trajectory import PARTNER_SIZE
from yumi.driver.arm import EgmArm
from yumi.egm.udp import HasFileno, Poller, UdpClient, UdpServer
from yumi.errors import CommandRefused, MissingPrerequisite, NoConnection, RobotNotReady, YumiError
from yumi.process.realtime import AwakeProcessors, prepare_process, release_process
from yumi.process.supervision import Failures, SupervisedThread
from yumi.robot.joints import CYCLE, JOINT_COUNT, ArmState, Side

_NUMBER = struct.Struct("!I")
_PROTOCOL = 5  # whose large blocks of memory travel beside the pickle, and are not copied by it
_READ_AT_ONCE = 1 << 16  # bytes; takes 20 µs


class PipeClosed(Exception):
    """The other side is gone."""


class PipeEnd:
    """One end of a pipe between two processes; values must be picklable.

    A value is sent as the number of its parts, their lengths, and the parts: its pickle, then the blocks of memory that
    it offers as :class:`pickle.PickleBuffer`.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._parts: list[bytes | mmap.mmap] = []
        self._lengths: list[int] = []
        self._filled = 0  # bytes of the last part

    def fileno(self) -> int:
        return self._connection.fileno()

    def send(self, value: object) -> None:
        """Pass ``value`` on, at one go.

        A :class:`Connection` would write the length of what is long first, and give the interpreter away before the
        rest: who reads would wait for it in between.

        Raises:
            PipeClosed: nobody is left to read it.
        """
        blocks: list[pickle.PickleBuffer] = []
        payload = io.BytesIO()
        ForkingPickler(payload, _PROTOCOL, True, blocks.append).dump(value)
        lengths = [len(payload.getbuffer()), *(block.raw().nbytes for block in blocks)]
        head = b"".join(_NUMBER.pack(number) for number in (len(lengths), *lengths))
        try:
            for part in (memoryview(head + payload.getvalue()), *(block.raw() for block in blocks)):
                left = part
                while left:
                    left = left[os.write(self.fileno(), left) :]
        except OSError as error:
            raise PipeClosed(str(error)) from error

    def receive(self) -> Any:
        """Wait for the next value.

        Raises:
            PipeClosed: nothing will come any more.
        """
        while not self.read():
            continue
        (payload, *blocks), self._parts, self._lengths = self._parts, [], []
        return pickle.loads(payload, buffers=blocks)

    def read(self) -> bool:
        """Read the begin of the next value, or at most 64 kB more of one that was begun.

        It does not wait for the rest of a long value, which may come later; to be called when something can be read.

        Returns:
            Whether the value is whole: :meth:`receive` has it at once then.

        Raises:
            PipeClosed: nothing will come any more.
        """
        if not self._lengths:
            (count,) = _NUMBER.unpack(self._exactly(_NUMBER.size))
            self._lengths = [length for (length,) in _NUMBER.iter_unpack(self._exactly(count * _NUMBER.size))]
            self._parts.append(self._exactly(self._lengths[0]))
            self._filled = self._lengths[0]
        elif not self._is_whole:
            if self._filled == self._lengths[len(self._parts) - 1]:
                self._parts.append(mmap.mmap(-1, self._lengths[len(self._parts)]))  # given back as soon as it is freed
                self._filled = 0
            with memoryview(self._parts[-1]) as part:
                self._filled += self._some(part[self._filled : self._filled + _READ_AT_ONCE])
        return self._is_whole

    @property
    def _is_whole(self) -> bool:
        return len(self._parts) == len(self._lengths) and self._filled == self._lengths[-1]

    def _exactly(self, count: int) -> bytes:
        data, filled = memoryview(bytearray(count)), 0
        while filled < count:
            filled += self._some(data[filled:])
        return bytes(data)

    def _some(self, room: memoryview) -> int:
        try:
            count = os.readv(self.fileno(), [room])
        except OSError as error:
            raise PipeClosed(str(error)) from error
        if not count:
            raise PipeClosed("the other side is gone")
        return count

    def has_value(self, timeout: float = 0.0) -> bool:
        """Whether a value, or the end, waits; looks for at most ``timeout`` [s]."""
        return self._connection.poll(timeout)

    def close(self) -> None:
        self._connection.close()


class ChildProcess:
    """A process of our own that runs ``main(pipe, *arguments)``.

    Args:
        name: for process lists.
        main: a function of a module, so that it can be found in the child.
        arguments: picklable, or shared memory.
    """

    def __init__(self, name: str, main: Callable[..., None], *arguments: object) -> None:
        with _from_the_system(name):
            ours, theirs = PROCESSES.Pipe()
        self.pipe = PipeEnd(ours)
        self._theirs = theirs
        self._process = PROCESSES.Process(name=name, target=_run, args=(main, theirs, *arguments))

    @property
    def exit_code(self) -> int | None:
        return self._process.exitcode

    @property
    def is_started(self) -> bool:
        return self._process.pid is not None

    def start(self) -> None:
        """Start it; raises MissingPrerequisite when the operating system does not let it."""
        with _without_main_module(), _from_the_system(self._process.name):
            self._process.start()
        self._theirs.close()  # so that the pipe ends when the child does

    def join(self, timeout: float) -> bool:
        """Wait for its end, at most ``timeout`` [s]; tells whether it ended."""
        self._process.join(timeout)
        return self._process.exitcode is not None

    def kill(self) -> None:
        self._process.kill()
        self._process.join()


@contextmanager
def _from_the_system(name: str) -> Iterator[None]:
    try:
        yield
    except (OSError, MemoryError) as error:
        raise MissingPrerequisite(
            f"The operating system does not let the process {name} start ({error}); see that the limits of this "
            "program are not too low (ulimit -n, ulimit -u, ulimit -v)."
        ) from error


@contextmanager
def _without_main_module() -> Iterator[None]:
    """A spawned process would import the program's main module first: a script that connects would connect again.

    Our children need nothing of it; :mod:`multiprocessing` has no other way to say so.
    """
    real = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = real


def _run(main: Callable[..., None], connection: Connection, *arguments: object) -> None:
    main(PipeEnd(connection), *arguments)
    release_process()


class Rehearsal:
    """Rehearses the cycles of one arm.

    Args:
        heard: where the robot's datagrams come from.
        socket: the stand-in's, on this machine only.
        arm: the stand-in behind it.
        manager: the stand-in's controllers.
        guard: the stand-in's.
        clock: the machine's.
    """

    def __init__(
        self,
        heard: UdpServer,
        socket: UdpServer,
        arm: EgmArm,
        manager: ControllerManager,
        guard: Limiter,
        clock: Clock,
    ) -> None:
        self._heard = heard
        self._robot = UdpClient("127.0.0.1", socket.port)
        self._arm, self._manager, self._guard = arm, manager, guard
        self._clock = clock
        self._stations = StageClock()
        self._leading = next((each.name for each in manager.controllers() if each.required), None)
        self._poller = Poller()
        self._poller.watch(socket, self._run)

    def run(self) -> None:
        """Have the stand-in answer what the robot said last."""
        if self._heard.newest is None:
            return
        self._robot.send(self._heard.newest)
        self._poller.wait(0.0)
        self._robot.receive()

    def close(self) -> None:
        """Give back its end of the stand-in's wire."""
        self._poller.close()
        self._robot.close()

    def _run(self) -> None:
        cycle = run_cycle(self._arm, self._manager, self._guard, self._clock.now(), self._stations)
        if cycle is not None:
            self._guard.observe(cycle.state)
            self._follow(cycle.state)

    def _follow(self, state: ArmState) -> None:
        if state.is_running and self._leading and not self._manager.is_commanding:
            self._manager.switch((self._leading,), (), state)


_STEADINESS = 1.0 / 64.0  # weight of one interval in the learned period
_BELIEVED = (0.5, 1.5)  # intervals outside of this share of the period are gaps or bursts, not the period
_ANOTHER_PERIOD = 8  # so many intervals in a row that are not believed are the period after all
_GROWTH = 1.5
_SHRINKAGE = 0.995
_SMALLEST = 50e-6  # [s] less than any sleep is late


class ArrivalForecast:
    """Forecasts the arrivals of one arm.

    Args:
        largest_share: the margin is at most this share of the period, which bounds the time spent looking.
    """

    def __init__(self, largest_share: float = 0.1) -> None:
        self.period = CYCLE
        self.margin = _SMALLEST * 4
        self._largest_share = largest_share
        self._unbelieved = 0
        self._last = -inf

    def note_arrival(self, now: float, *, was_waiting: bool) -> None:
        """A datagram came.

        Args:
            now: when [s].
            was_waiting: whether it was there before anybody looked.
        """
        interval = now - self._last
        self._last = now
        self._learn(interval)
        factor = _GROWTH if was_waiting else _SHRINKAGE
        self.margin = min(max(self.margin * factor, _SMALLEST), self._largest_share * self.period)

    def _learn(self, interval: float) -> None:
        low, high = _BELIEVED
        if low * self.period < interval < high * self.period:
            self.period += _STEADINESS * (interval - self.period)
            self._unbelieved = 0
            return
        self._unbelieved += 1
        if self._unbelieved == _ANOTHER_PERIOD:
            self.period, self._unbelieved = interval, 0

    def wake_at(self) -> float:
        """When to be awake for the next datagram [s]; minus infinity before the first."""
        return self._last + self.period - self.margin

    def give_up_at(self) -> float:
        """Until when to look for it without a pause [s]; after that it is late and a sleep costs nothing more."""
        return self._last + self.period + self.margin


GLANCE = 0.010
"""How often the silence of the robot is looked at when nothing arrives [s]."""

_SHARE_TO_LOOK = 0.05
"""At most this share of a period is spent looking, at either side of the expected arrival."""

_WAKE_STEADINESS = 1.0 / 16.0  # weight of one rehearsal in what the next is expected to take
_LONGEST_REHEARSAL = 0.001  # [s]; one that took longer was interrupted, and tells nothing about the next


class WakeMode(Enum):
    """What a user may choose."""

    AUTO = "auto"
    BLOCKING = "blocking"
    HOT = "hot"
    AHEAD = "ahead"


class Wait(ABC):
    """Sleeps until shortly before a datagram is due, then has the reply rehearsed: the real one finds warm caches.

    Args:
        clock: the machine's clock.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._forecast = ArrivalForecast()
        self._rehearsal: Callable[[], None] = _nothing
        self._rehearsal_time = 0.0
        self._was_asleep = True

    def prepare(self, rehearse: Callable[[], None]) -> None:
        """Take what rehearses the arm's cycle; who wakes up ahead of a datagram has the time for it."""
        self._rehearsal = rehearse

    def wait(self, poller: Poller, is_streaming: bool) -> None:
        """Wait for something to read and have it handled, or return after a glance.

        Args:
            poller: what is waited for.
            is_streaming: whether a robot sends datagrams now.
        """
        now, forecast = self._clock.now(), self._forecast
        self._was_asleep = True
        if not is_streaming or forecast.give_up_at() <= now:
            poller.wait(GLANCE)
            return
        pause = forecast.wake_at() - self._rehearsal_time - now
        if pause > 0.0 and not poller.doze(pause):
            self._rehearse()
        self._await(poller, forecast.give_up_at())

    def note_arrival(self, now: float) -> None:
        """A datagram came at ``now`` [s]."""
        self._forecast.note_arrival(now, was_waiting=self._was_asleep)

    def close(self) -> None:
        """Give back what it holds."""

    @abstractmethod
    def _await(self, poller: Poller, late: float) -> None:
        """Wait for a datagram that is due, until ``late`` [s] at least; the first look finds what came meanwhile."""

    def _rehearse(self) -> None:
        begin = self._clock.now()
        self._rehearsal()
        took = min(self._clock.now() - begin, _LONGEST_REHEARSAL)
        self._rehearsal_time += _WAKE_STEADINESS * (took - self._rehearsal_time)


class BlockingWait(Wait):
    """Sleeps until a datagram comes."""

    def _await(self, poller: Poller, late: float) -> None:
        if not poller.wait(0.0):
            self._was_asleep = False
            poller.wait(GLANCE)


class HotWait(BlockingWait):
    """Sleeps, while a robot streams beside processors that stay awake.

    It does not look for the datagram: a robot on this machine, with less priority, could not send it meanwhile.
    """

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        self._processors = AwakeProcessors()

    def wait(self, poller: Poller, is_streaming: bool) -> None:
        if is_streaming:
            self._processors.hold()
        else:
            self._processors.release()
        super().wait(poller, is_streaming)

    def close(self) -> None:
        self._processors.release()


class AheadWait(Wait):
    """Sleeps until shortly before a datagram is due, then looks for it without a pause."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        self._forecast = ArrivalForecast(_SHARE_TO_LOOK)

    def _await(self, poller: Poller, late: float) -> None:
        while not poller.wait(0.0):
            self._was_asleep = False
            if self._clock.now() >= late:
                return


def _nothing() -> None:
    """Until there is something to rehearse."""


def way_to_wait(mode: WakeMode, clock: Clock) -> Wait:
    """How to wait in ``mode``; ``auto`` and ``hot`` take what is permitted."""
    if mode is WakeMode.BLOCKING:
        return BlockingWait(clock)
    if mode is not WakeMode.AHEAD and AwakeProcessors.are_permitted():
        return HotWait(clock)
    return BlockingWait(clock) if mode is WakeMode.HOT else AheadWait(clock)


def describe(wait: Wait) -> str:
    """The way to wait in a few words for the log."""
    if isinstance(wait, HotWait):
        return "processors kept awake while EGM runs"
    return "awake shortly before each datagram" if isinstance(wait, AheadWait) else "asleep between datagrams"


LAST_HOLD = 2.0
"""How long an arm without a driver is held while it still moves [s]."""

_TELLING_PERIOD = 10.0  # [s]
_STATES = 64  # a quarter of a second, longer than a publisher is ever busy


class ArmBoxes:
    """What the fast line and its parent share for one arm.

    Attributes:
        states: the newest measured states, see the joint state broadcaster.
        snapshots: everything else about the arm.
        goals: where it shall go, for controllers that follow a stream of goals.
        point_goals: the same for controllers that plan the way to a single point.
        speeds: how fast it shall go.
        forward_positions: positions by index.
        forward_speeds: speeds by index.
        trajectory: how it follows a trajectory of its own.
        dual_trajectory: how it follows its part of one for both arms.
        dual_status: what it tells the other arm meanwhile.
        speed_scale: the factor on its speeds.
        flight: memory of its flight recorder.
        bell: rung after every cycle.
    """

    def __init__(self) -> None:
        self.states = SharedHistory(1 + 2 * JOINT_COUNT, _STATES)
        self.snapshots = SharedMailbox(SNAPSHOT_SIZE)
        self.goals = SharedMailbox(GOAL_SIZE)
        self.speeds = SharedMailbox(GOAL_SIZE)
        self.forward_positions = SharedMailbox(GOAL_SIZE)
        self.forward_speeds = SharedMailbox(GOAL_SIZE)
        self.trajectory = SharedMailbox(FEEDBACK_SIZE)
        self.dual_trajectory = SharedMailbox(FEEDBACK_SIZE)
        self.dual_status = SharedMailbox(PARTNER_SIZE)
        self.point_goals = SharedMailbox(GOAL_SIZE)
        self.speed_scale = SharedMailbox(1)
        self.flight = shared_numbers(FLIGHT_SIZE)
        self.bell: Bell = new_bell()


@dataclass(frozen=True, slots=True)
class WiredArm:
    """An arm of the fast line, built in its process.

    Attributes:
        line: its cycle.
        socket: what becomes readable when its robot speaks.
        rehearse: runs a cycle that reaches nobody, see :mod:`yumi.driver.control_process`.
    """

    line: ArmLine
    socket: HasFileno
    rehearse: Callable[[], None] = lambda: None


class Question(NamedTuple):
    """A request on its way through the pipe, with a number that its answer bears, too."""

    number: int
    request: Request


UNREADABLE = 0
"""Stands for the number of a request that could not be read."""


class Answer(NamedTuple):
    """What became of the request of that number."""

    number: int
    reply: Reply


Build = Callable[[Side, Mapping[Side, ArmBoxes]], WiredArm]
"""Builds an arm inside its process, with the boxes of both arms; must be picklable."""


def run_fast_line(pipe: PipeEnd, build: Build, side: Side, boxes: Mapping[Side, ArmBoxes], wake: WakeMode) -> None:
    """Main function of the process."""
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP):
        signal.signal(each, signal.SIG_IGN)  # the parent decides when motion ends; its own end closes the pipe
    try:
        arm = build(side, boxes)
    except (YumiError, OSError, MemoryError) as error:  # the last two: of limits of the operating system
        pipe.send(Refusal(str(error) or type(error).__name__))
        return
    clock = SystemClock()
    wait = way_to_wait(wake, clock)
    pipe.send(f"Fast line: {prepare_process()}, {describe(wait)}.")
    FastLine(pipe, side, arm, boxes[side].bell, clock, wait).run()


class FastLine:
    """The loop inside the process."""

    def __init__(self, pipe: PipeEnd, side: Side, arm: WiredArm, bell: Bell, clock: Clock, wait: Wait) -> None:
        self._pipe = pipe
        self._side = side
        self._line = arm.line
        self._rehearsal = arm.rehearse
        self._bell = bell
        self._clock = clock
        self._wait = wait
        self._stop_at: float | None = None
        self._desk = RequestDesk({side: arm.line})
        self._has_mail = False
        self._failures: dict[str, float] = {}
        self._poller = Poller()
        self._poller.watch(arm.socket, self._answer)
        self._poller.watch(pipe, self._note_mail)
        wait.prepare(self._rehearse)

    def run(self) -> None:
        """Serve datagrams and requests until told to stop, and until the arm stands."""
        line = self._line
        while not self._may_end():
            looked = self._clock.now()  # what comes later may lie in the socket while we do something else
            self._wait.wait(self._poller, line.state is not None)
            if self._has_mail and not line.is_datagram_due(self._clock.now()):
                self._read_mail()
            line.watch_silence(looked)
            for event in line.take_events():
                self._tell(event)
        self._wait.close()
        self._poller.close()

    def _answer(self) -> None:
        arrival = self._clock.now()
        try:
            if self._line.run(arrival) is None:
                return
        except Exception as error:
            self._line.manager.deactivate_commanding()  # the next reply holds
            self._note_failure(error)
            return
        self._bell.release()
        self._wait.note_arrival(arrival)

    def _rehearse(self) -> None:
        try:
            self._rehearsal()
        except Exception as error:
            self._note_failure(error)

    def _note_failure(self, error: Exception) -> None:
        """Tell a fault now and again; at 250 Hz each telling would only bury the first."""
        sentence, now = f"{type(error).__name__}: {error}", self._clock.now()
        if now - self._failures.get(sentence, -inf) > _TELLING_PERIOD:
            self._failures[sentence] = now
            self._send(CycleFailed(self._side, sentence))

    def _may_end(self) -> bool:
        if self._stop_at is None:
            return False
        return self._clock.now() > self._stop_at or self._line.is_still

    def _note_mail(self) -> None:
        """To serve a request may take longer than a reply: no datagram should have to wait for it."""
        self._has_mail = True
        self._poller.forget(self._pipe)

    def _read_mail(self) -> None:
        self._has_mail = False
        try:
            if self._pipe.read():  # else it is a long trajectory, whose rest comes between the next cycles
                self._serve(self._pipe.receive())
        except PipeClosed:
            self._begin_to_end()
            return
        except Exception as error:  # it was read whole: the next one is sound
            self._send(Answer(UNREADABLE, Refusal(f"The request cannot be read: {type(error).__name__}: {error}.")))
        self._poller.watch(self._pipe, self._note_mail)

    def _serve(self, mail: Question | Stop) -> None:
        if isinstance(mail, Stop):
            self._begin_to_end()
        else:
            self._send(Answer(mail.number, self._desk.serve(mail.request, self._clock.now())))

    def _begin_to_end(self) -> None:
        self._stop_at = self._clock.now() + LAST_HOLD
        self._line.manager.deactivate_commanding()

    def _tell(self, event: Event) -> None:
        try:
            self._send(event)
        except Exception as error:  # a controller's notice that cannot be pickled
            self._note_failure(error)

    def _send(self, value: object) -> None:
        try:
            self._pipe.send(value)
        except PipeClosed:
            return  # the parent is gone; its end of the pipe says so to _receive


STALE = 0.5
"""A snapshot of an arm whose datagrams come is renewed every 4 ms; an older one tells of a process that hangs [s]."""

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
        self._failures = Failures()
        self._reader = SupervisedThread("fast-line-events", self._read, Flag())  # the end of the pipe ends it

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
        """What is known of the arm; nothing when the process is gone, nothing of its motion when it stands still."""
        if not self.is_alive:
            return Snapshot()
        snapshot = peek_snapshot(self._snapshots)
        if snapshot.is_streaming and time.monotonic() - snapshot.time > STALE:
            return replace(snapshot, is_streaming=False, is_running=False, activation=0)
        return snapshot

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
                    self._tell(FastLineEnded(self._side, self._child.exit_code))
                return
            if isinstance(value, Answer):
                self._take_answer(value)
            else:
                self._tell(value)

    def _tell(self, event: Event) -> None:
        try:
            self._on_event(event)
        except Exception as error:  # who waits for an answer does not care what becomes of an event
            self._failures.note(f"Handling {type(event).__name__} of the {self._side.word} arm", error)

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
        if isinstance(event, ImplausibleFeedback):
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
