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
from math import degrees, isnan, nan
from multiprocessing.sharedctypes import RawArray
from operator import attrgetter
from struct import Struct
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar, get_type_hints

from yumi.control.controller import Buffer, GoalKind
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


CAUSES = {
    Problem.REFERENCES_IGNORED: (
        "the robot does not follow the references: its replies may be lost; check that this machine's firewall lets "
        "UDP out to the controller"
    ),
    Problem.IMPLAUSIBLE: (
        "the robot reports positions that the arm cannot have reached: datagrams are old, forged, or another arm's; "
        "check what else sends to this port, and the remote ports of the controller's UDPUC devices; or a joint stands "
        "out of its range: jog it back"
    ),
}
"""The likely cause of each problem, for a sentence."""

INTERRUPTED = (
    "the {} arm was stopped, or another controller took it over, while the motion was planned; give the goal again."
)
"""Why a motion is refused that was planned for another EGM session or another activation."""

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

    def __str__(self) -> str:
        # What needs more distances than a cycle has counts as too near, wherever it is.
        how = "" if self.distance < _UNDECIDED else ", not shown to stay apart within one cycle"
        return f"{self.part} - {self.other}, {self.distance * 1e3:.0f} mm{how}"


class Snapshot(NamedTuple):
    """One arm after its last cycle.

    Attributes:
        time: when it was made, monotonic clock [s].
        session: EGM session, 0 before the first.
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
        missed: datagrams the robot sent that got no answer of their own.
        lost: datagrams that never arrived (gaps in the robot's sequence numbers).
        late: datagrams that waited together with a newer one, which was answered instead.
        stale: datagrams that arrived after a newer one was answered.
        repeated: datagrams that arrived before.
        malformed: datagrams that could not be read.
        foreign: datagrams from other addresses than the robot's.
        refused: commands with a value that is no finite number.
        position_limited: commands cut at a joint's range.
        slowed: commands that would have exceeded a speed, acceleration or jerk.
        kept_apart: commands that would have led an arm too near to something.
        limited_part: the part of the arm that is kept apart from ``limited_other``; empty 0.2 s after it was.
        limited_other: a part of the other arm, ``body``, or a box by its name.
        limited_distance: between the two [m].
        speed_cap: no speed scale is above this, whatever is set: less than 1 while parts may touch.
        interruptions: how often feedback stayed away for more than five cycles.
        implausible: positions reported that no arm can have reached.
        problem: why the arm holds whatever it is asked to do.
        jitter: mean difference of two datagrams' delays, in this session [s].
        worst_jitter: the largest such difference [s].
        drift_ppm: by how much the robot's clock is faster than ours [ppm].
        cycle_time: mean time between two datagrams the robot sent, by our clock [s].
    """

    time: float = 0.0
    session: int = 0
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
    missed: int = 0
    lost: int = 0
    late: int = 0
    stale: int = 0
    repeated: int = 0
    malformed: int = 0
    foreign: int = 0
    refused: int = 0
    position_limited: int = 0
    slowed: int = 0
    kept_apart: int = 0
    limited_part: str = ""
    limited_other: str = ""
    limited_distance: float = 0.0
    speed_cap: float = 1.0
    interruptions: int = 0
    implausible: int = 0
    problem: Problem = Problem.NONE
    jitter: float = 0.0
    worst_jitter: float = 0.0
    drift_ppm: float = 0.0
    cycle_time: float = 0.0

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
        kind: its fields are numbers, short texts, enumerations of integers, joints, or joints that may be None.
    """

    def __init__(self, kind: type[Any]) -> None:
        codes = {float: "d", int: "q", bool: "?", str: f"{_TEXT}s"}
        hints = {name: hint for name, hint in get_type_hints(kind).items() if not name.startswith("_")}
        vectors = [name for name, hint in hints.items() if hint in (Joints, Joints | None)]
        scalars = [name for name in hints if name not in vectors]
        enums = {name: hints[name] for name in scalars if issubclass(hints[name], IntEnum | GoalKind)}
        formats = ["q" if name in enums else codes[hints[name]] for name in scalars]
        self._texts = [index for index, name in enumerate(scalars) if hints[name] is str]
        self._kind = kind
        self._struct = Struct("".join(formats) + f"{len(vectors) * JOINT_COUNT}d")
        self._scalars = _getter(scalars)
        self._vectors = _getter(vectors)
        self._enums = [(scalars.index(name), enum) for name, enum in enums.items()]
        self._optional = [index for index, name in enumerate(vectors) if hints[name] != Joints]
        self._scalar_count, self._vector_count = len(scalars), len(vectors)
        order = {name: index for index, name in enumerate([*scalars, *vectors])}
        self._order = [order[name] for name in hints]
        self.size = self._struct.size

    def pack(self, memory: memoryview, value: Any) -> None:
        vectors = [each or _UNKNOWN for each in self._vectors(value)]
        scalars = list(self._scalars(value))
        for index in self._texts:
            scalars[index] = scalars[index].encode()
        self._struct.pack_into(memory, _COUNTERS.size, *scalars, *chain.from_iterable(vectors))

    def unpack(self, memory: memoryview) -> Any:
        numbers = self._struct.unpack_from(memory, _COUNTERS.size)
        values: list[Any] = list(numbers[: self._scalar_count])
        for index, enum in self._enums:
            values[index] = enum(values[index])
        for index in self._texts:
            values[index] = values[index].rstrip(b"\0").decode(errors="ignore")  # a character may have been cut in two
        rest = numbers[self._scalar_count :]
        vectors: list[Any] = [rest[begin : begin + JOINT_COUNT] for begin in range(0, len(rest), JOINT_COUNT)]
        for index in self._optional:
            if isnan(vectors[index][0]):
                vectors[index] = None
        values += vectors
        return self._kind(*[values[index] for index in self._order])


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
        raise MissingPrerequisite(
            f"The operating system gives no shared memory ({why}); see that /dev/shm exists and has some MB left "
            "(df /dev/shm), and that the limits of this program are not too low (ulimit -n, ulimit -v)."
        ) from error


# ---- events


@dataclass(frozen=True, slots=True)
class SessionStarted:
    """The robot began to send datagrams for an arm.

    Attributes:
        session: its number.
        deactivated: controllers that commanded the arm in the session before, whose end was not seen.
    """

    side: Side
    session: int
    deactivated: tuple[str, ...] = ()

    def __str__(self) -> str:
        arm = _arm(self.side)
        if not self.deactivated:
            return f"{arm}: EGM session {self.session} started."
        return (
            f"{arm}: the robot began EGM session {self.session} in the middle of a motion; "
            f"{', '.join(self.deactivated)} deactivated. Call start_egm to go on."
        )


@dataclass(frozen=True, slots=True)
class SessionResumed:
    """The robot's datagrams arrive again after a silence during which it went on with its session."""

    side: Side
    session: int

    def __str__(self) -> str:
        arm = _arm(self.side)
        return f"{arm}: EGM feedback is back, session {self.session} goes on and the arm holds."


@dataclass(frozen=True, slots=True)
class SessionLost:
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

    def __str__(self) -> str:
        arm, silence = _arm(self.side), f"silent for {self.silence * 1e3:.0f} ms"
        if self.stood_still:
            what = f"{arm}: the control process stood still for {self.stood_still:.2g} s"
            if not self.deactivated:
                return f"{what}; the arm was not controlled meanwhile."
            return (
                f"{what}, the arm was not controlled meanwhile; {', '.join(self.deactivated)} deactivated. "
                "Call start_egm to go on."
            )
        if not self.deactivated:
            return f"{arm}: EGM has ended, the robot is {silence}."
        return (
            f"{arm}: EGM feedback lost, the robot has been {silence}; {', '.join(self.deactivated)} deactivated. "
            "Call start_egm when the controller is back."
        )


@dataclass(frozen=True, slots=True)
class RobotFollows:
    """The robot began to follow commands."""

    side: Side

    def __str__(self) -> str:
        return f"{_arm(self.side)}: the robot follows commands."


@dataclass(frozen=True, slots=True)
class RobotStoppedFollowing:
    """The robot still sends datagrams but no longer follows commands.

    Attributes:
        deactivated: controllers that commanded the arm until then; none after an ordered stop.
    """

    side: Side
    deactivated: tuple[str, ...]

    def __str__(self) -> str:
        arm = _arm(self.side)
        if not self.deactivated:
            return f"{arm}: the robot follows commands no longer."
        return (
            f"{arm}: the robot follows commands no longer; {', '.join(self.deactivated)} deactivated. "
            "Call start_egm to go on."
        )


@dataclass(frozen=True, slots=True)
class ImplausibleFeedback:
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

    def __str__(self) -> str:
        arm = _arm(self.side)
        what = f"the reported position of {self.joint} is {degrees(self.distance):.1f}° from where the arm can be"
        if not self.is_lost:
            return f"{arm}: {what}; the datagram was not used (an old, forged or mixed-up one)."
        ended = f"; {', '.join(self.deactivated)} deactivated" if self.deactivated else ""
        cause = CAUSES[Problem.IMPLAUSIBLE]
        if self.is_other_arm:
            cause = (
                "that is where the other arm is: left and right EGM ports are exchanged? Check the remote ports of the "
                "controller's UDPUC devices ROB_L and ROB_R"
            )
        return f"{arm}: {what}, the arm holds{ended}: {cause}. Stop and start EGM when that is mended."


@dataclass(frozen=True, slots=True)
class ReferencesIgnored:
    """The robot plans to stand although it is commanded to move.

    Attributes:
        deactivated: controllers that commanded the arm until then.
    """

    side: Side
    deactivated: tuple[str, ...] = ()

    def __str__(self) -> str:
        ended = f"; {', '.join(self.deactivated)} deactivated" if self.deactivated else ""
        return f"{_arm(self.side)}: {CAUSES[Problem.REFERENCES_IGNORED]}. The arm holds{ended}."


@dataclass(frozen=True, slots=True)
class ProblemOver:
    """What made the arm hold is over; it goes on holding until it is commanded."""

    side: Side
    problem: Problem

    def __str__(self) -> str:
        arm = _arm(self.side)
        if self.problem is Problem.REFERENCES_IGNORED:
            return f"{arm}: the robot follows the references again. Call recover to go on."
        return f"{arm}: the reported positions are plausible again. Call recover to go on."


@dataclass(frozen=True, slots=True)
class KeptApart:
    """An arm is limited because it would come too near to something; reported about once a second while it lasts.

    Attributes:
        limited: the two parts and their distance.
    """

    side: Side
    limited: Limited

    def __str__(self) -> str:
        return f"{_arm(self.side)}: motion limited by {self.limited}."


@dataclass(frozen=True, slots=True)
class AllowedCollisionsChanged:
    """Other parts may touch than before, of both arms: see :mod:`yumi.control.loop`.

    Attributes:
        side: the arm under which it is recorded; it concerns both.
        pairs: of parts that may touch now.
    """

    side: ClassVar[Side] = Side.RIGHT
    pairs: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        if not self.pairs:
            return "All parts are kept apart again, and the arms have their speed."
        allowed = ", ".join(f"{part} - {other}" for part, other in self.pairs)
        return f"May touch for a while, slowly: {allowed}."


@dataclass(frozen=True, slots=True)
class ControllerFailed:
    """A controller raised an error in its update."""

    side: Side
    sentence: str

    def __str__(self) -> str:
        return f"{_arm(self.side)}: {self.sentence}"


@dataclass(frozen=True, slots=True)
class ControllerReport:
    """Something a controller reports, in the order in which it happened.

    Attributes:
        controller: its name.
        report: a frozen value of the controller's own kind, see :meth:`.Controller.take_reports`.
    """

    side: Side
    controller: str
    report: object

    def __str__(self) -> str:
        return f"{_arm(self.side)}: {self.controller}: {self.report}"


@dataclass(frozen=True, slots=True)
class CycleFailed:
    """A cycle could not be completed; reported at most every few seconds."""

    side: Side
    sentence: str

    def __str__(self) -> str:
        return f"{_arm(self.side)}: a cycle could not be completed: {self.sentence}."


@dataclass(frozen=True, slots=True)
class ReportsDropped:
    """The driver did not read what the control process reported, and reads again: one event for each arm, which holds.

    Attributes:
        count: how many events and answers, of both arms, were dropped.
    """

    side: Side
    count: int

    def __str__(self) -> str:
        return (
            f"{_arm(self.side)}: the driver did not read the control process's reports for a while and "
            f"{self.count} were dropped; the arms were served meanwhile, and hold now. Was the driver stopped or its "
            "machine overloaded? See the state for what holds now."
        )


@dataclass(frozen=True, slots=True)
class ControlProcessEnded:
    """The control process has ended by itself: one event for each arm."""

    side: Side
    exit_code: int | None

    def __str__(self) -> str:
        return (
            f"{_arm(self.side)}: the control process has ended (exit code {self.exit_code}); the "
            "robot gets no answers any more and keeps its last references. Call recover, which starts another one."
        )


Event = (
    SessionStarted
    | SessionResumed
    | SessionLost
    | RobotFollows
    | RobotStoppedFollowing
    | ImplausibleFeedback
    | ReferencesIgnored
    | ProblemOver
    | KeptApart
    | AllowedCollisionsChanged
    | ControllerFailed
    | ControllerReport
    | CycleFailed
    | ReportsDropped
    | ControlProcessEnded
)
"""What happened to an arm; its text is a sentence for people."""


def is_fault(event: Event) -> bool:
    """Whether ``event`` is a fault: nothing had asked for it."""
    if isinstance(event, SessionStarted | SessionLost | RobotStoppedFollowing):
        return bool(event.deactivated)
    if isinstance(event, ImplausibleFeedback):
        return event.is_lost
    return isinstance(event, ReferencesIgnored | ControllerFailed | CycleFailed | ReportsDropped | ControlProcessEnded)


def _arm(side: Side) -> str:
    return f"{side.word.capitalize()} arm"
