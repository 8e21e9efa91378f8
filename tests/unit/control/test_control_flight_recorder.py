from __future__ import annotations

import sys
from math import nan
from struct import pack_into

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.robot.joints import ArmCommand, ArmState, Joints, joints
from yumi.control.cycle import Cycle
from yumi.control.flight_recorder import FLIGHT_SIZE, RECORDED_CYCLES, FlightRecorder, flight_memory
from yumi.control.stage_times import RECEIVE_STAGE, StageClock

STATIONS = StageClock()


def vector(number: float) -> Joints:
    return joints([number + index / 10.0 for index in range(7)])


def cycle(number: int, *, wanted: bool = True) -> Cycle:
    state = ArmState(number * 0.004, 0.004, 1, vector(number), vector(0.1), vector(0.2), is_running=True)
    command = ArmCommand(vector(0.3), vector(0.4))
    return Cycle(state, command if wanted else None, command)


@pytest.fixture
def memory() -> memoryview[float]:
    return flight_memory()


@pytest.fixture
def recorder(memory: memoryview[float]) -> FlightRecorder:
    return FlightRecorder(memory)


def record(recorder: FlightRecorder, count: int) -> None:
    for number in range(recorder.newest + 1, recorder.newest + count + 1):
        recorder.record(cycle(number), None, STATIONS)


def test_recorder_gives_back_what_a_cycle_was(recorder: FlightRecorder) -> None:
    recorder.record(cycle(1), vector(0.5), STATIONS)
    (frame,) = recorder.frames()
    assert (frame.number, frame.time, frame.dt, frame.session, frame.is_running) == (1, 0.004, 0.004, 1, True)
    assert (frame.position, frame.velocity, frame.planned) == (vector(1), vector(0.1), vector(0.2))
    assert (frame.desired, frame.sent, frame.sent_velocity) == (vector(0.3), vector(0.3), vector(0.4))
    assert frame.reference == vector(0.5)


def test_recorder_knows_that_nothing_was_wanted(recorder: FlightRecorder) -> None:
    recorder.record(cycle(1, wanted=False), None, STATIONS)
    (frame,) = recorder.frames()
    assert (frame.desired, frame.reference) == (None, None)


def test_recorder_keeps_a_wanted_position_that_is_no_number(recorder: FlightRecorder) -> None:
    broken = ArmCommand((nan, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    recorder.record(Cycle(cycle(1).state, broken, cycle(1).sent), None, STATIONS)
    wanted = recorder.frames()[0].desired
    assert wanted is not None
    assert str(wanted[0]) == "nan"


def test_recorder_keeps_the_times_of_the_stations(recorder: FlightRecorder) -> None:
    stages = StageClock(lambda: 1.25)
    stages.begin(1.0)
    stages.note(RECEIVE_STAGE)
    recorder.record(cycle(1), None, stages)
    assert recorder.frames()[0].stages.receive == 0.25


@given(st.lists(st.integers(1, 2 * RECORDED_CYCLES), min_size=1, max_size=4))
def test_recorder_remembers_the_newest_cycles_whatever_came_before(counts: list[int]) -> None:
    recorder = FlightRecorder(flight_memory())
    for count in counts:
        record(recorder, count)
        newest = recorder.newest
        expected = range(max(0, newest - RECORDED_CYCLES) + 1, newest + 1)
        frames = recorder.frames()
        assert [frame.number for frame in frames] == list(expected)
        assert all(frame.position == vector(frame.number) for frame in frames)


@given(st.integers(0, 60), st.integers(0, 80))
def test_recorder_tells_only_what_came_after(total: int, known: int) -> None:
    recorder = FlightRecorder(flight_memory())
    record(recorder, total)
    assert [frame.number for frame in recorder.since(known)] == list(range(known + 1, total + 1))


def test_copy_stays_as_it_is_while_the_recorder_goes_on(recorder: FlightRecorder) -> None:
    record(recorder, 10)
    copy = recorder.copy()
    record(recorder, 3 * RECORDED_CYCLES)
    assert [frame.number for frame in copy.frames()] == list(range(1, 11))


def test_recorder_leaves_out_a_cycle_that_is_being_replaced(
    memory: memoryview[float], recorder: FlightRecorder
) -> None:
    record(recorder, 3)
    slot = memory.tolist().index(2.0, 1) * memory.itemsize
    pack_into("d", memory, slot, 2562.0)  # the front of the slot as the recorder writes it first
    assert [frame.number for frame in recorder.frames()] == [1, 3]


def test_recorder_goes_on_where_another_one_ended(memory: memoryview[float], recorder: FlightRecorder) -> None:
    record(recorder, 5)
    record(FlightRecorder(memory), 1)
    assert FlightRecorder(memory).newest == 6


def test_recorder_needs_no_more_memory_the_longer_it_records(
    memory: memoryview[float], recorder: FlightRecorder
) -> None:
    record(recorder, RECORDED_CYCLES)
    blocks = sys.getallocatedblocks()
    record(recorder, 3 * RECORDED_CYCLES)
    assert sys.getallocatedblocks() - blocks < 20
    assert len(memory) == FLIGHT_SIZE
