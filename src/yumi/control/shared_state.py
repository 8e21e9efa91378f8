"""What the control process and the driver process share: the state of an arm, buffers in shared memory, and events.

States (:class:`Snapshot`, :class:`JointStates`, :class:`TrajectoryFeedback`) lie in buffers (:class:`SharedBuffer`),
where the newest counts. A buffer counts the writes before and after each one, so that a reader knows when the value
changed while it was read; it reads again, a few times, and returns the value it read before if the writer has died in
the middle of one. No side ever waits. The layout of a value follows from its type: numbers packed and unpacked by one
call each, which takes half the time of an array of numbers and a fifth of reading a ``ctypes.Structure`` by its fields.

Events (:data:`Event`) say what happened to an arm, in the order in which it happened; they come through the pipe of the
control process.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from itertools import chain
from math import isnan, nan
from multiprocessing.sharedctypes import RawArray
from operator import attrgetter, itemgetter
from struct import Struct
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar, get_type_hints

from yumi.catalogue import Message, clause, message
from yumi.control.controller import Buffer, GoalKind
from yumi.control.counters import LimiterCounters, WireCounters
from yumi.errors import MissingPrerequisite
from yumi.process.supervision import PROCESSES
from yumi.robot.joints import JOINT_COUNT, ZERO, Joints, Side


class Problem(IntEnum):
    """Why an arm holds whatever it is asked to do.

    REFERENCES_IGNORED: the robot plans to stand although it is commanded to move.
    IMPLAUSIBLE: it reports positions that the arm cannot have reached.
    """

    NONE = 0
    REFERENCES_IGNORED = 1
    IMPLAUSIBLE = 2


PROBLEMS = {Problem.REFERENCES_IGNORED: "references_ignored", Problem.IMPLAUSIBLE: "feedback_implausible"}
"""The code of each problem in the catalogue; its value is the arm."""

_UNDECIDED = 0.05
"""Parts further apart than this limit an arm only where it was not calculated in time that they do not [m]."""


@dataclass(frozen=True, slots=True)
class Limited:
    """What limits an arm.

    Attributes:
        part: of the arm, e.g. ``right gripper``.
        other: of the other arm, ``body``, or a box by its name.
        distance: between them now [m].
    """

    part: str
    other: str
    distance: float

    @property
    def said(self) -> Message:
        """The two parts and how near they are."""
        if self.distance < _UNDECIDED:
            return message("parts_near", part=self.part, other=self.other, distance=self.distance)
        # What needs more distances than a cycle has counts as too near, wherever it is.
        return message("parts_not_compared", part=self.part, other=self.other, distance=self.distance)

    def __str__(self) -> str:
        return clause(self.said)


class Snapshot(NamedTuple):
    """One arm after its last cycle.

    Attributes:
        time: when it was made, monotonic clock [s].
        is_streaming: whether the robot's datagrams arrive.
        is_running: whether the robot follows our commands.
        activation: number of the controller activation that commands the arm, 0 when none does.
        goal_kind: which goals the controllers take that command the arm.
        activity: counts every change of which controllers there are and of their and the hardware's states.
        position: measured positions [rad].
        velocity: measured velocities [rad/s].
        sent: the position sent last [rad].
        reference: where the active controller is going [rad]; None when no controller commands.
        cycles: datagrams answered.
        wire: what its connection has received.
        limiter: what its limiter has changed.
        limited_part: the part of the arm that is kept apart from ``limited_other``; empty 0.2 s after it was.
        limited_other: a part of the other arm, ``body``, or a box by its name.
        limited_distance: between the two [m].
        speed_cap: no speed scale is above this, whatever is set: less than 1 while parts may touch.
        interruptions: how often feedback stayed away for more than five cycles.
        problem: why the arm holds whatever it is asked to do.
    """

    time: float = 0.0
    is_streaming: bool = False
    is_running: bool = False
    activation: int = 0
    goal_kind: GoalKind = GoalKind.NONE
    activity: int = 0
    position: Joints = ZERO
    velocity: Joints = ZERO
    sent: Joints = ZERO
    reference: Joints | None = None
    cycles: int = 0
    wire: WireCounters = WireCounters()
    limiter: LimiterCounters = LimiterCounters()
    limited_part: str = ""
    limited_other: str = ""
    limited_distance: float = 0.0
    speed_cap: float = 1.0
    interruptions: int = 0
    problem: Problem = Problem.NONE

    @property
    def session(self) -> int:
        """EGM session, 0 before the first."""
        return self.wire.session

    @property
    def is_commanded(self) -> bool:
        """Whether a controller that commands the arm is active."""
        return self.activation > 0

    @property
    def command_epoch(self) -> tuple[int, int]:
        """What changes when EGM begins anew or another controller commands: session and activation."""
        return self.session, self.activation

    @property
    def limited(self) -> Limited | None:
        """What the arm is kept apart from; None while it is not."""
        return Limited(self.limited_part, self.limited_other, self.limited_distance) if self.limited_part else None

    @property
    def limited_by(self) -> str:
        """The same in words; empty while it is not."""
        return str(self.limited or "")


def read_snapshot(buffer: Buffer[Snapshot]) -> Snapshot:
    """What is known of the arm; the empty snapshot while nothing is."""
    newest = buffer.read()
    return Snapshot() if newest is None else newest[1]


class JointStates(NamedTuple):
    """One measured state.

    Attributes:
        time: when it arrived, monotonic clock [s].
        position: [rad], (7,).
        velocity: [rad/s], (7,).
    """

    time: float
    position: Joints
    velocity: Joints


class Skew(NamedTuple):
    """How far apart in time two arms were that follow one trajectory.

    Attributes:
        start: between their first cycles [s].
        worst: largest difference of where they were commanded to be on it [s].
    """

    start: float = 0.0
    worst: float = 0.0


class TrajectoryFeedback(NamedTuple):
    """One look at an arm that a trajectory controller commands.

    Attributes:
        goal: number of the command it follows, 0 while it holds.
        time: of the state, on the machine's monotonic clock [s].
        progress: the desired time on the trajectory [s].
        scale: how fast time goes by on the trajectory.
        start_skew, worst_skew: of the arms that follow it together, see :class:`Skew`; zeros for one arm.
        desired: where it should be [rad], (7,).
        desired_velocity: [rad/s], (7,).
        actual: where it is [rad], (7,).
        actual_velocity: [rad/s], (7,).
        output: where it is commanded to be, ahead of ``desired`` by the arm's delay [rad], (7,).
        output_velocity: the speed commanded beside it [rad/s], (7,).
        monitor_period: the action's feedback is given so often [s].
    """

    goal: int
    time: float
    progress: float
    scale: float
    start_skew: float
    worst_skew: float
    desired: Joints
    desired_velocity: Joints
    actual: Joints
    actual_velocity: Joints
    output: Joints
    output_velocity: Joints
    monitor_period: float

    @property
    def skew(self) -> Skew:
        return Skew(self.start_skew, self.worst_skew)


class Factor(NamedTuple):
    """A factor on the speed of one arm, above 0 up to 1."""

    value: float


# ---- shared memory

V = TypeVar("V")

_READ_ATTEMPTS = 10  # a writer on another processor is done by then; one that we took the processor from never will be
_COUNTERS = Struct("qq")  # writes begun, finished: equal and not 0 when the value is whole
_BEGUN, _FINISHED = Struct("q"), Struct("q")
_LENGTH = Struct("q")
_MESSAGE = _COUNTERS.size + _LENGTH.size  # where the bytes of a message begin
_TEXT = 64  # of a text, which is cut off there [bytes]
_UNKNOWN: Joints = (nan, nan, nan, nan, nan, nan, nan)


class _Layout:
    """How the fields of a named tuple lie in memory: numbers and texts first, then joints.

    Args:
        kind: its fields are numbers, short texts, enumerations of integers, joints, joints that may be None, or named
            tuples of these.
    """

    def __init__(self, kind: type[Any]) -> None:
        codes = {float: "d", int: "q", bool: "?", str: f"{_TEXT}s"}
        hints: dict[str, Any] = {}
        self._parts: list[tuple[int, int, type[Any]]] = []  # where in a value which of its fields make a named tuple
        for number, (name, hint) in enumerate(_fields(kind)):
            inner = {f"{name}.{field}": own for field, own in _fields(hint)}
            if inner:
                self._parts.append((number, len(inner), hint))
            hints.update(inner or {name: hint})
        vectors = [name for name, hint in hints.items() if hint in (Joints, Joints | None)]
        scalars = [name for name in hints if name not in vectors]
        enums = {name: hints[name] for name in scalars if issubclass(hints[name], IntEnum | GoalKind)}
        formats = ["q" if name in enums else codes[hints[name]] for name in scalars]
        self._texts = [index for index, name in enumerate(scalars) if hints[name] is str]
        self._kind = kind
        self._struct = Struct("".join(formats) + f"{len(vectors) * JOINT_COUNT}d")
        self._scalars = _getter(scalars)
        self._vectors = _getter(vectors)
        first = len(scalars)
        begins = {name: first + JOINT_COUNT * index for index, name in enumerate(vectors)}
        taken = [
            slice(begins[name], begins[name] + JOINT_COUNT) if name in begins else scalars.index(name) for name in hints
        ]
        self._take = itemgetter(*taken) if len(taken) > 1 else lambda numbers: (numbers[taken[0]],)
        places = {name: index for index, name in enumerate(hints)}
        self._made = [(places[name], enum) for name, enum in enums.items()]
        self._made += [(places[name], _text) for name in hints if hints[name] is str]
        self._made += [(places[name], _known) for name in vectors if hints[name] != Joints]
        self.size = self._struct.size

    def pack(self, memory: memoryview, value: Any) -> None:
        vectors = [each or _UNKNOWN for each in self._vectors(value)]
        scalars = list(self._scalars(value))
        for index in self._texts:
            scalars[index] = scalars[index].encode()
        self._struct.pack_into(memory, _COUNTERS.size, *scalars, *chain.from_iterable(vectors))

    def unpack(self, memory: memoryview) -> Any:
        fields = self._take(self._struct.unpack_from(memory, _COUNTERS.size))
        if self._made or self._parts:
            fields = list(fields)
            for index, make in self._made:
                fields[index] = make(fields[index])
            for number, count, kind in self._parts:
                fields[number : number + count] = [kind(*fields[number : number + count])]
        return self._kind(*fields)


def _text(raw: bytes) -> str:
    return raw.rstrip(b"\0").decode(errors="ignore")  # a character may have been cut in two


def _known(values: Joints) -> Joints | None:
    return None if isnan(values[0]) else values


def _fields(kind: Any) -> list[tuple[str, Any]]:
    """Names and types of a named tuple's fields; of anything else there are none."""
    names = getattr(kind, "_fields", ())
    hints = get_type_hints(kind) if names else {}
    return [(name, hints[name]) for name in names]


_layouts: dict[type[Any], _Layout] = {}


def _layout_of(kind: type[Any]) -> _Layout:
    if kind not in _layouts:
        _layouts[kind] = _Layout(kind)
    return _layouts[kind]


def _getter(names: list[str]) -> Any:
    """Several attributes at once, as a tuple whatever their number."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda value: tuple(getattr(value, name) for name in names)


class SharedBuffer(Generic[V]):
    """A buffer between two processes; hand it to the child when it is spawned.

    Args:
        kind: of the values; a named tuple of numbers and joints.
    """

    def __init__(self, kind: type[V]) -> None:
        with _from_the_system():
            memory = RawArray(ctypes.c_char, _COUNTERS.size + _layout_of(kind).size)
        self.__setstate__((kind, memory))

    def __getstate__(self) -> tuple[type[V], Any]:
        return self._kind, self._shared

    def __setstate__(self, state: tuple[type[V], Any]) -> None:
        self._kind, self._shared = state
        self._layout = _layout_of(self._kind)
        self._memory = memoryview(self._shared).cast("B")
        self._read_last: tuple[int, V] | None = None

    @property
    def address(self) -> int:
        """Of the memory, for the core."""
        return ctypes.addressof(self._shared)

    def write(self, value: V, number: int | None = None) -> None:
        """Replace the value; one process only may write. ``number``: its own in place of the next one."""
        memory = self._memory
        if number is None:
            number = _COUNTERS.unpack_from(memory)[1] + 1
        _BEGUN.pack_into(memory, 0, number)
        self._layout.pack(memory, value)
        _FINISHED.pack_into(memory, _BEGUN.size, number)

    def read(self) -> tuple[int, V] | None:
        """The number of the newest write, from 1, and its value; None while nothing was ever written."""
        memory, before = self._memory, self._read_last
        for _ in range(_READ_ATTEMPTS):
            begun, finished = _COUNTERS.unpack_from(memory)
            if before is not None and begun == finished == before[0]:
                return before  # the control loop reads in every cycle; a new value is rare
            if begun != finished:
                continue
            if not finished:
                return None
            value = self._layout.unpack(memory)
            if _COUNTERS.unpack_from(memory) == (finished, finished):
                self._read_last = (finished, value)
                break
        return self._read_last


class SharedBytes:
    """The newest of a series of short messages, between two processes; hand it to the child when it is spawned.

    Args:
        size: a longer message is left out [bytes].
    """

    def __init__(self, size: int) -> None:
        with _from_the_system():
            memory = RawArray(ctypes.c_char, _MESSAGE + size)
        self.__setstate__(memory)

    def __getstate__(self) -> Any:
        return self._shared

    def __setstate__(self, shared: Any) -> None:
        self._shared = shared
        self._memory = memoryview(shared).cast("B")

    def write(self, message: bytes) -> None:
        """Replace the message; one process only may write."""
        memory, end = self._memory, _MESSAGE + len(message)
        if end > len(memory):
            return
        number = _COUNTERS.unpack_from(memory)[1] + 1
        _BEGUN.pack_into(memory, 0, number)
        _LENGTH.pack_into(memory, _COUNTERS.size, len(message))
        memory[_MESSAGE:end] = message
        _FINISHED.pack_into(memory, _BEGUN.size, number)

    def read(self) -> bytes:
        """The newest message; empty while nothing was ever written, or where a writer has died in the middle."""
        memory = self._memory
        for _ in range(_READ_ATTEMPTS):
            before = _COUNTERS.unpack_from(memory)
            (length,) = _LENGTH.unpack_from(memory, _COUNTERS.size)
            message = bytes(memory[_MESSAGE : _MESSAGE + length])
            if before[0] == before[1] and _COUNTERS.unpack_from(memory) == before:
                return message
        return b""


class SharedHistory(Generic[V]):
    """The last ``depth`` values: a reader that was busy for a moment misses none."""

    def __init__(self, kind: type[V], depth: int) -> None:
        self._slots = tuple(SharedBuffer(kind) for _ in range(depth))
        self._newest = shared_numbers(1)

    def write(self, value: V) -> None:
        """Add a value; the oldest one makes room. One process only may write."""
        number = int(self._newest[0]) + 1
        self._slots[number % len(self._slots)].write(value, number)
        self._newest[0] = float(number)

    def read(self) -> tuple[int, V] | None:
        """The newest value with its number, from 1; None while nothing was ever written."""
        values = self.since(int(self._newest[0]) - 1)
        return values[-1] if values else None

    def since(self, number: int) -> list[tuple[int, V]]:
        """The values after ``number`` that are still there, oldest first."""
        newest = int(self._newest[0])
        numbers = range(max(number, newest - len(self._slots)) + 1, newest + 1)
        values = ((each, self._slots[each % len(self._slots)].read()) for each in numbers)
        # A value that was replaced meanwhile bears another number: it comes with the next call.
        return [value for each, value in values if value and value[0] == each]


SharedNumbers = ctypes.Array[ctypes.c_double]
"""A block of numbers that two processes see."""


def shared_numbers(count: int) -> SharedNumbers:
    """``count`` zeros of 8 bytes; hand them to the child when it is spawned. Who writes and reads how is theirs.

    Raises:
        MissingPrerequisite: the machine has no shared memory left.
    """
    with _from_the_system():
        return RawArray(ctypes.c_double, count)


class CycleEvent(Protocol):
    """Wakes a thread that waits in another process."""

    def release(self) -> None:
        """Set it once more; never waits."""

    def acquire(self, block: bool = True, timeout: float | None = None) -> bool:
        """Wait until it is set; returns whether it was in time."""


def new_cycle_event() -> CycleEvent:
    """An event for a process that will be spawned; raises MissingPrerequisite as :func:`shared_numbers`."""
    with _from_the_system():
        return PROCESSES.Semaphore(0)


@contextmanager
def _from_the_system() -> Iterator[None]:
    try:
        yield
    except (OSError, MemoryError) as error:
        why = error.strerror if isinstance(error, OSError) else "out of memory"
        raise MissingPrerequisite(message("no_shared_memory", why=why)) from error


# ---- events


class Happened:
    """Something that happened to an arm; its string is a sentence for a log."""

    __slots__ = ()

    @property
    def said(self) -> Message:
        """What happened, as a message."""
        raise NotImplementedError

    def __str__(self) -> str:
        return str(self.said)


@dataclass(frozen=True, slots=True)
class SessionStarted(Happened):
    """The robot began to send datagrams for an arm.

    Attributes:
        session: its number.
        deactivated: controllers that commanded the arm in the session before, whose end was not seen.
    """

    side: Side
    session: int
    deactivated: tuple[str, ...] = ()

    @property
    def said(self) -> Message:
        if not self.deactivated:
            return message("session_started", arm=self.side.word, session=self.session)
        return message(
            "session_restarted_in_motion", arm=self.side.word, session=self.session, controllers=self.deactivated
        )


@dataclass(frozen=True, slots=True)
class SessionResumed(Happened):
    """The robot's datagrams arrive again after a silence during which it went on with its session."""

    side: Side
    session: int

    @property
    def said(self) -> Message:
        return message("session_resumed", arm=self.side.word, session=self.session)


@dataclass(frozen=True, slots=True)
class SessionLost(Happened):
    """No datagram was received for too long.

    Attributes:
        silence: for how long [s].
        deactivated: controllers that commanded the arm until then; none after an ordered stop.
        stood_still: how long the control process itself did not run meanwhile [s]; 0 where the robot was silent.
    """

    side: Side
    silence: float
    deactivated: tuple[str, ...]
    stood_still: float = 0.0

    @property
    def said(self) -> Message:
        if self.stood_still and self.deactivated:
            return message(
                "driver_stood_still_in_motion",
                arm=self.side.word,
                duration=self.stood_still,
                controllers=self.deactivated,
            )
        if self.stood_still:
            return message("driver_stood_still", arm=self.side.word, duration=self.stood_still)
        if self.deactivated:
            return message("feedback_lost", arm=self.side.word, silence=self.silence, controllers=self.deactivated)
        return message("session_ended", arm=self.side.word, silence=self.silence)


@dataclass(frozen=True, slots=True)
class RobotFollows(Happened):
    """The robot began to follow commands."""

    side: Side

    @property
    def said(self) -> Message:
        return message("robot_follows", arm=self.side.word)


@dataclass(frozen=True, slots=True)
class RobotStoppedFollowing(Happened):
    """The robot still sends datagrams but no longer follows commands.

    Attributes:
        deactivated: controllers that commanded the arm until then; none after an ordered stop.
    """

    side: Side
    deactivated: tuple[str, ...]

    @property
    def said(self) -> Message:
        if not self.deactivated:
            return message("robot_stopped_following", arm=self.side.word)
        return message("robot_stopped_following_in_motion", arm=self.side.word, controllers=self.deactivated)


@dataclass(frozen=True, slots=True)
class ImplausibleFeedback(Happened):
    """A position was reported that the arm cannot have reached; it was not used.

    Attributes:
        joint: the joint that is furthest away, by name.
        distance: by how much [rad].
        position: what was reported [rad], (7,).
        deactivated: controllers that commanded the arm, once the feedback has not been believed for too long.
        is_lost: whether it has.
        is_other_arm: whether that is where the other arm is.
    """

    side: Side
    joint: str
    distance: float
    position: Joints
    deactivated: tuple[str, ...] = ()
    is_lost: bool = False
    is_other_arm: bool = False

    @property
    def said(self) -> Message:
        if not self.is_lost:
            return message("position_not_believed", arm=self.side.word, joint=self.joint, distance=self.distance)
        return message(
            "position_not_believed_for_long",
            arm=self.side.word,
            joint=self.joint,
            distance=self.distance,
            ended=_ended(self.deactivated),
            cause=message("positions_of_other_arm") if self.is_other_arm else message("positions_implausible"),
        )


@dataclass(frozen=True, slots=True)
class ReferencesIgnored(Happened):
    """The robot plans to stand although it is commanded to move.

    Attributes:
        deactivated: controllers that commanded the arm until then.
    """

    side: Side
    deactivated: tuple[str, ...] = ()

    @property
    def said(self) -> Message:
        return message(
            "arm_holds_ignored",
            problem=message("references_ignored", arm=self.side.word),
            ended=_ended(self.deactivated),
        )


@dataclass(frozen=True, slots=True)
class ControllersLate(Happened):
    """No controller answered in time, and the core braked the arm; reported about once a second while it lasts.

    Attributes:
        cycles: datagrams that the core answered since the last report.
        controllers: that command the arm, or did until then.
        deactivated: those of them that were deactivated, since the core had to answer for too long in a row.
    """

    side: Side
    cycles: int
    controllers: tuple[str, ...]
    deactivated: tuple[str, ...] = ()

    @property
    def said(self) -> Message:
        if self.deactivated:
            return message("controllers_hung", arm=self.side.word, cycles=self.cycles, controllers=self.deactivated)
        if not self.controllers:
            return message("loop_was_late", arm=self.side.word, cycles=self.cycles)
        return message("controllers_were_late", arm=self.side.word, cycles=self.cycles, controllers=self.controllers)


@dataclass(frozen=True, slots=True)
class ProblemOver(Happened):
    """What made the arm hold is over; it goes on holding until it is commanded."""

    side: Side
    problem: Problem

    @property
    def said(self) -> Message:
        if self.problem is Problem.REFERENCES_IGNORED:
            return message("references_followed_again", arm=self.side.word)
        return message("positions_plausible_again", arm=self.side.word)


@dataclass(frozen=True, slots=True)
class KeptApart(Happened):
    """An arm is limited because it would come too near to something; reported about once a second while it lasts.

    Attributes:
        limited: the two parts and their distance.
    """

    side: Side
    limited: Limited

    @property
    def said(self) -> Message:
        return message("motion_limited", arm=self.side.word, limited=self.limited.said)


@dataclass(frozen=True, slots=True)
class AllowedCollisionsChanged(Happened):
    """Other parts may touch than before, of both arms: see :mod:`yumi.control.loop`.

    Attributes:
        side: the arm under which it is recorded; it concerns both.
        pairs: of parts that may touch now.
    """

    side: ClassVar[Side] = Side.RIGHT
    pairs: tuple[tuple[str, str], ...]

    @property
    def said(self) -> Message:
        if not self.pairs:
            return message("all_kept_apart")
        return message("may_touch", pairs=tuple(f"{part} - {other}" for part, other in self.pairs))


@dataclass(frozen=True, slots=True)
class ControllerFailed(Happened):
    """A controller raised an error in its update."""

    side: Side
    failure: Message

    @property
    def said(self) -> Message:
        return message("controller_failed", arm=self.side.word, failure=self.failure)


@dataclass(frozen=True, slots=True)
class ControllerReport(Happened):
    """Something a controller reports, in the order in which it happened.

    Attributes:
        controller: its name.
        report: a frozen value of the controller's own kind, see :meth:`.Controller.take_reports`.
    """

    side: Side
    controller: str
    report: object

    @property
    def said(self) -> Message:
        said = getattr(self.report, "said", None)
        report = said if isinstance(said, Message) else message("text", text=str(self.report))
        return message("controller_reports", arm=self.side.word, controller=self.controller, report=report)


@dataclass(frozen=True, slots=True)
class CycleFailed(Happened):
    """A cycle could not be completed; reported at most every few seconds."""

    side: Side
    failure: str

    @property
    def said(self) -> Message:
        return message("cycle_failed", arm=self.side.word, failure=self.failure)


@dataclass(frozen=True, slots=True)
class ReportsDropped(Happened):
    """The driver did not read what the control process reported, and reads again: one event for each arm, which holds.

    Attributes:
        count: how many events and answers, of both arms, were dropped.
    """

    side: Side
    count: int

    @property
    def said(self) -> Message:
        return message("reports_dropped", arm=self.side.word, count=self.count)


@dataclass(frozen=True, slots=True)
class ControlProcessEnded(Happened):
    """The control process has ended by itself: one event for each arm."""

    side: Side
    exit_code: int | None

    @property
    def said(self) -> Message:
        return message("control_process_ended", arm=self.side.word, exit_code=self.exit_code)


Event = (
    SessionStarted
    | SessionResumed
    | SessionLost
    | RobotFollows
    | RobotStoppedFollowing
    | ImplausibleFeedback
    | ReferencesIgnored
    | ProblemOver
    | ControllersLate
    | KeptApart
    | AllowedCollisionsChanged
    | ControllerFailed
    | ControllerReport
    | CycleFailed
    | ReportsDropped
    | ControlProcessEnded
)
"""What happened to an arm."""


def is_fault(event: Event) -> bool:
    """Whether ``event`` is a fault: nothing had asked for it."""
    if isinstance(event, SessionStarted | SessionLost | RobotStoppedFollowing | ControllersLate):
        return bool(event.deactivated)
    if isinstance(event, ImplausibleFeedback):
        return event.is_lost
    return isinstance(event, ReferencesIgnored | ControllerFailed | CycleFailed | ReportsDropped | ControlProcessEnded)


def _ended(controllers: tuple[str, ...]) -> Message:
    return message("controllers_deactivated", controllers=controllers) if controllers else message("nothing")
