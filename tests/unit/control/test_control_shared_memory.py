from __future__ import annotations

import struct
from typing import NamedTuple

import pytest

from abb_protocols.robot.joints import ZERO_JOINTS, Joints
from abb_runtime.process.child import ChildProcess, PipeClosed, PipeEnd
from yumi.control.goals import GoalKind
from yumi.control.shared_memory import SharedBuffer, SharedBytes, SharedHistory
from yumi.control.shared_state import ArmProblem, JointStates, Snapshot
from yumi.control.speed_scale import SpeedFactor

ROUNDS = 1000  # different values that the reader has to see
SEVEN: Joints = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)


class Counts(NamedTuple):
    """Fields that lie among those of another value."""

    count: int
    mean: float


class Sample(NamedTuple):
    """A value with a field of every type that is shared."""

    number: int
    counts: Counts
    time: float
    more: Counts
    is_on: bool
    problem: ArmProblem
    kind: GoalKind
    position: Joints
    reference: Joints | None


ONE = Sample(
    1,
    Counts(7, 0.5),
    0.25,
    Counts(8, -0.5),
    True,
    ArmProblem.IMPLAUSIBLE,
    GoalKind.POSITION | GoalKind.VELOCITY,
    SEVEN,
    None,
)
OTHER = Sample(-3, Counts(0, 0.0), 1e9, Counts(9, 1.5), False, ArmProblem.NONE, GoalKind.NONE, ZERO_JOINTS, SEVEN)


def fill(pipe: PipeEnd, buffer: SharedBuffer[JointStates]) -> None:
    """In a child: values whose numbers are all equal, as fast as it goes, until the reader has seen enough."""
    number = 0
    while not pipe.has_value():
        number += 1
        buffer.write(all_equal(number))
    pipe.send(number)


def all_equal(number: int) -> JointStates:
    joints = (float(number),) * 7
    return JointStates(float(number), joints, joints)  # type: ignore[arg-type]


def answer_once(pipe: PipeEnd) -> None:
    pipe.send(pipe.receive() * 2)


def test_buffer_is_empty_at_first() -> None:
    assert SharedBuffer(SpeedFactor).read() is None


def test_buffer_holds_the_latest_value_with_its_number_and_the_types_of_its_fields() -> None:
    buffer = SharedBuffer(Sample)
    for number, value in enumerate((ONE, OTHER, ONE), 1):
        buffer.write(value)
        read = buffer.read()
        assert read == (number, value)
        assert [type(each) for each in read[1]] == [type(each) for each in value]


def test_buffer_keeps_short_texts_and_cuts_longer_ones_off() -> None:
    buffer = SharedBuffer(Snapshot)
    buffer.write(Snapshot(limited_part="left gripper", limited_other="Tür", limited_distance=0.011))
    number, read = buffer.read() or (0, Snapshot())
    assert (number, read) == (1, Snapshot(limited_part="left gripper", limited_other="Tür", limited_distance=0.011))
    buffer.write(Snapshot(limited_other=63 * "a" + "ü"))  # of two bytes
    assert (buffer.read() or (0, Snapshot()))[1].limited_other == 63 * "a"


def test_buffer_refuses_values_of_another_size() -> None:
    with pytest.raises(struct.error):
        SharedBuffer(JointStates).write(JointStates(0.0, (1.0, 2.0), ZERO_JOINTS))  # type: ignore[arg-type]


def test_buffer_shows_the_value_before_when_its_writer_died_in_the_middle_of_one() -> None:
    buffer = SharedBuffer(SpeedFactor)
    assert buffer.read() is None
    buffer.write(SpeedFactor(1.0))
    assert buffer.read() == (1, SpeedFactor(1.0))
    struct.pack_into("q", buffer._memory, 0, 2)  # begun, never finished
    struct.pack_into("d", buffer._memory, 16, 5.0)
    assert buffer.read() == (1, SpeedFactor(1.0))
    buffer.write(SpeedFactor(3.0))
    assert buffer.read() == (2, SpeedFactor(3.0))


def test_buffer_never_shows_half_a_value_of_another_process() -> None:
    buffer = SharedBuffer(JointStates)
    child = ChildProcess("writer", fill, buffer)
    child.start()
    seen = set()
    while len(seen) < ROUNDS:
        newest = buffer.read()
        if newest is not None:
            assert newest[1] == all_equal(newest[0])
            seen.add(newest[0])
    child.pipe.send("enough")
    last = child.pipe.receive()
    assert child.join(10.0)
    assert buffer.read() == (last, all_equal(last))


def test_history_keeps_the_newest_values_in_order() -> None:
    history = SharedHistory(SpeedFactor, 3)
    assert history.read() is None
    for value in (10.0, 20.0, 30.0, 40.0):
        history.write(SpeedFactor(value))
    assert history.since(0) == [(2, (20.0,)), (3, (30.0,)), (4, (40.0,))]
    assert history.since(3) == [(4, (40.0,))]
    assert history.since(4) == []
    assert history.read() == (4, (40.0,))


def test_pipe_passes_values_and_notices_the_end_of_the_child() -> None:
    child = ChildProcess("answerer", answer_once)
    child.start()
    child.pipe.send(21)
    assert child.pipe.receive() == 42
    with pytest.raises(PipeClosed):
        child.pipe.receive()
    assert child.join(10.0)
    assert child.exit_code == 0


def test_bytes_hold_the_newest_message_that_fits() -> None:
    messages = SharedBytes(8)
    assert messages.read() == b""
    messages.write(b"first")
    messages.write(b"second")
    messages.write(b"too long for it")
    assert messages.read() == b"second"


def test_bytes_show_nothing_when_their_writer_died_in_the_middle_of_a_message() -> None:
    messages = SharedBytes(8)
    messages.write(b"first")
    messages._memory[0] += 1  # a write has begun
    assert messages.read() == b""
