"""The flight recorder: the last ten seconds of every cycle of one arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan
from mmap import mmap
from struct import Struct
from typing import TYPE_CHECKING

from abb_protocols.robot.joints import JOINT_COUNT, Joints
from yumi.control.cycle import Cycle
from yumi.control.goals import UNKNOWN_JOINTS
from yumi.control.stage_times import STAGE_MARK_COUNT, StageClock, StageTimes

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

RECORDED_CYCLES = 2480
"""Cycles that can be read back: 10 s of 4.032 ms."""

_SPARE = 80  # slots that are written while the oldest readable ones are read
_SLOTS = RECORDED_CYCLES + _SPARE
_SCALARS = 4
_VECTORS = 7
_SLOT_SIZE = 1 + _SCALARS + STAGE_MARK_COUNT + _VECTORS * JOINT_COUNT + 1

FLIGHT_SIZE = 1 + _SLOTS * _SLOT_SIZE
"""Numbers of 8 bytes in the memory of one recorder."""

_NUMBER = Struct("d")
_SLOT = Struct(f"{_SLOT_SIZE}d")


@dataclass(frozen=True, slots=True)
class RecordedCycle:
    """One recorded cycle; all positions in chain order [rad], velocities [rad/s].

    Attributes:
        number: which cycle of this arm it was, from 1.
        time: when the datagram arrived, on the machine's monotonic clock [s].
        dt: robot time since the state before, 0 for the first of a session [s].
        session: EGM session, from 1.
        is_running: whether the robot followed commands.
        position: measured positions.
        velocity: measured velocities.
        planned: positions the controller was heading for.
        desired: positions the controllers asked for; None where they held.
        sent: positions sent to the arm.
        sent_velocity: velocities sent to the arm.
        reference: where the active controller was going; None when none commanded.
        stages: how long each stage of the cycle took.
    """

    number: int
    time: float
    dt: float
    session: int
    is_running: bool
    position: Joints
    velocity: Joints
    planned: Joints
    desired: Joints | None
    sent: Joints
    sent_velocity: Joints
    reference: Joints | None
    stages: StageTimes


def flight_memory() -> memoryview[float]:
    """Memory for a recorder in one process; no more of it is taken than has been recorded in."""
    return memoryview(mmap(-1, FLIGHT_SIZE * _NUMBER.size)).cast("d")


class FlightRecorder:
    """Remembers the newest cycles of one arm, in memory that never grows; one process only may record, any may read.

    The memory is passed in: its own for tests and virtual time, shared memory in the driver, so that another process
    reads it while the control loop goes on recording. Each cycle has a slot with the cycle's number at both ends; a
    slot that was replaced while it was read is left out.

    Args:
        memory: FLIGHT_SIZE numbers of 8 bytes, 0 at first.
    """

    def __init__(self, memory: WriteableBuffer) -> None:
        self._memory = memory
        self._number = self.newest

    @property
    def newest(self) -> int:
        """Number of the cycle recorded last, 0 before the first."""
        return int(_NUMBER.unpack_from(self._memory, 0)[0])

    def record(self, cycle: Cycle, reference: Joints | None, timing: StageClock) -> None:
        """Remember ``cycle``, and forget the one that is too old; takes microseconds and no new memory."""
        state, desired, sent = cycle.state, cycle.desired, cycle.sent
        number = self._number = self._number + 1
        # One pass from front to back: the number at the front is new before, the one at the back after the rest.
        _SLOT.pack_into(
            self._memory,
            _offset(number),
            number,
            state.time,
            state.dt,
            state.session,
            state.is_running,
            *timing.marks,
            *state.position,
            *state.velocity,
            *state.planned,
            *(UNKNOWN_JOINTS if desired is None else desired.position),
            *sent.position,
            *sent.velocity,
            *(UNKNOWN_JOINTS if reference is None else reference),
            number,
        )
        _NUMBER.pack_into(self._memory, 0, number)

    def frames(self) -> tuple[RecordedCycle, ...]:
        """Everything that is remembered, oldest first."""
        return self.since(0)

    def since(self, number: int) -> tuple[RecordedCycle, ...]:
        """The cycles after cycle ``number`` that are remembered, oldest first."""
        newest, frames = self.newest, []
        for each in range(max(number, newest - RECORDED_CYCLES) + 1, newest + 1):
            offset = _offset(each)
            last = _NUMBER.unpack_from(self._memory, offset + _SLOT.size - _NUMBER.size)[0]
            values = _SLOT.unpack_from(self._memory, offset)
            first = _NUMBER.unpack_from(self._memory, offset)[0]
            if first == last == each:  # else a later cycle took its slot meanwhile
                frames.append(_frame(values))
        return tuple(frames)

    def copy(self) -> FlightRecorder:
        """A recorder with the same memories, to be read at leisure while this one goes on."""
        with memoryview(self._memory) as view:
            return FlightRecorder(bytearray(view))


def _offset(number: int) -> int:
    return _NUMBER.size + number % _SLOTS * _SLOT.size


def _frame(values: Sequence[float]) -> RecordedCycle:
    number, time, dt, session, is_running = values[: 1 + _SCALARS]
    marks = values[1 + _SCALARS : 1 + _SCALARS + STAGE_MARK_COUNT]
    begin = 1 + _SCALARS + STAGE_MARK_COUNT
    vectors = [tuple(values[start : start + JOINT_COUNT]) for start in range(begin, _SLOT_SIZE - 1, 7)]
    position, velocity, planned, desired, sent, sent_velocity, reference = vectors
    return RecordedCycle(
        number=int(number),
        time=time,
        dt=dt,
        session=int(session),
        is_running=bool(is_running),
        position=position,
        velocity=velocity,
        planned=planned,
        desired=_something(desired),
        sent=sent,
        sent_velocity=sent_velocity,
        reference=_something(reference),
        stages=StageTimes.of(marks),
    )


def _something(vector: Joints) -> Joints | None:
    """None for a vector that was never there; a controller's single NaN stays what it is."""
    return None if all(map(isnan, vector)) else vector
