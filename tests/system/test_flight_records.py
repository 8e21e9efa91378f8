"""What stops a motion leaves its last ten seconds: in virtual time for every fault, and with processes and sockets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from math import nan
from pathlib import Path
from queue import Queue

import pytest

from abb_protocols.robot.joints import CYCLE, ZERO_JOINTS, ArmCommand, ArmState, Joints, Side, joints
from abb_runtime.clock import ManualClock, SystemClock
from abb_runtime.process.child import ChildProcess, PipeEnd
from abb_runtime.udp import free_port
from system.test_control_process import ELSEWHERE, MESSAGE, POSITION, Robot
from system.virtual_time_bench import System
from yumi.control.cycle import Cycle
from yumi.control.flight_recorder import FLIGHT_SIZE, RECORDED_CYCLES, FlightRecorder, RecordedCycle
from yumi.control.goals import SessionGoal, write_goal
from yumi.control.loop_commands import Commands
from yumi.control.loop_events import Event, is_fault
from yumi.control.shared_memory import SharedNumbers, shared_numbers
from yumi.control.stage_times import StageClock
from yumi.driver.control_process import ControlProcess
from yumi.driver.settings import read_controllers
from yumi.driver.wiring import EgmPlan, build_arms
from yumi.recording.reader import Recording, read_recording
from yumi.recording.recorder import Recorder

pytestmark = pytest.mark.real_time

RIGHT = Side.RIGHT
GOAL: Joints = (1.0, -2.0, -1.0, 0.5, 0.0, 0.7, 0.0)
EPOCH = 1_800_000_000.0


def cut_power(system: System) -> None:
    system.is_powered = False


def stop_rapid(system: System) -> None:
    system.client.stop_rapid()


def break_controller(system: System) -> None:
    arm = system.arms[RIGHT]
    arm.goals.write(SessionGoal(arm.snapshot.session, nan, (), ZERO_JOINTS))  # type: ignore[arg-type]  # without positions


@pytest.fixture
def system() -> System:
    system = System()
    system.start_egm()
    return system


def records_of(system: System, folder: Path) -> Recording:
    """What the driver would have written for the faults of the right arm."""
    arm = system.arms[RIGHT]
    records = Recorder(folder, 50, {RIGHT: arm.recorder}, lambda sentence: None, ManualClock(system.now()))
    for event in arm.events:
        if event.side is RIGHT:
            records.on_event(event, system.now(), EPOCH)
    records.close()
    (file,) = folder.glob("*.mcap")
    return read_recording(file)


@pytest.mark.parametrize(
    ("fault", "kind"),
    [
        (cut_power, "SessionLost"),
        (stop_rapid, "RobotStoppedFollowing"),
        (break_controller, "ControllerFailed"),
    ],
)
def test_fault_in_motion_leaves_the_last_ten_seconds(
    system: System, tmp_path: Path, fault: Callable[[System], None], kind: str
) -> None:
    arm = system.arms[RIGHT]
    system.wait(11.0)
    arm.go(GOAL)
    system.wait(0.5)
    arm.events.clear()
    fault(system)
    system.until(lambda: any(map(is_fault, arm.events)), 0.5)
    recording = records_of(system, tmp_path)
    assert recording.stop is not None
    assert recording.stop.kind == kind
    frames = recording.frames[RIGHT]
    assert len(frames) >= 2470
    assert frames[-1].time - frames[0].time == pytest.approx(10.0, abs=0.1)
    assert frames[-1].sent == arm.admitted[-1]
    assert [frame.number for frame in frames] == list(range(frames[0].number, frames[-1].number + 1))
    assert frames[-30].reference == GOAL


def test_flight_recorder_follows_both_arms_without_a_gap(system: System) -> None:
    system.wait(1.0)
    for arm in system.arms.values():
        frames = arm.recorder.frames()
        assert [frame.sent for frame in frames] == arm.admitted[-len(frames) :]
        assert all(frame.dt == pytest.approx(CYCLE) for frame in frames[1:])


@pytest.fixture
def events() -> Queue[Event]:
    return Queue()


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def control(port: int, events: Queue[Event]) -> Iterator[ControlProcess]:
    controllers = {side: read_controllers(side) for side in Side}
    plan = EgmPlan("127.0.0.1", "127.0.0.1", {RIGHT: port, Side.LEFT: free_port()}, 0.05, CYCLE, controllers)
    lines = ControlProcess(partial(build_arms, plan), events.put)
    lines.start()
    yield lines
    lines.stop()


def test_robot_that_falls_silent_leaves_a_record_read_by_another_process(
    control: ControlProcess, port: int, events: Queue[Event], tmp_path: Path
) -> None:
    records = Recorder(tmp_path, 50, control.recorders, lambda sentence: None, SystemClock())
    with closing(Robot(port)) as robot:
        robot.exchange(MESSAGE)
        # The core may have answered before Python saw that a session begins, which deactivates what is active.
        assert control.buffers[RIGHT].cycle_done.acquire(timeout=5.0)
        control.call(Commands.switch_controllers, RIGHT, (POSITION,))
        write_goal(control.buffers[RIGHT].goals, 1, ELSEWHERE)
        for seqno in range(1, 6):
            robot.exchange(replace(MESSAGE, seqno=seqno, measured_time=1.0 + seqno * CYCLE))
    while not is_fault(event := events.get(timeout=5.0)):
        continue
    records.on_event(event, SystemClock().now(), EPOCH)
    records.close()
    recording = read_recording(next(tmp_path.glob("*_right.mcap")))
    assert recording.stop is not None
    assert recording.stop.sentence == str(event)
    frames = recording.frames[RIGHT]
    assert [frame.number for frame in frames] == [1, 2, 3, 4, 5, 6]
    by_python = [frame for frame in frames if frame.stages.reply > 0.0]  # the others the core, where Python was late
    assert by_python[-1].reference == ELSEWHERE
    assert 0.0 < frames[-1].sent[0] < ELSEWHERE[0]
    assert all(frame.stages.reply < 0.1 and frame.stages.after_reply > 0.0 for frame in by_python)
    assert 0.04 < recording.stop.time - frames[-1].time < 0.2


def record_flat_out(pipe: PipeEnd, memory: SharedNumbers, count: int) -> None:
    """In a process of its own: cycles whose numbers are all the same."""
    recorder, stages = FlightRecorder(memory), StageClock()
    for number in range(1, count + 1):
        all_same = joints([float(number)] * 7)
        command = ArmCommand(all_same, all_same)
        state = ArmState(float(number), 0.004, 1, all_same, all_same, all_same, is_running=True)
        recorder.record(Cycle(state, command, command), all_same, stages)
    pipe.send(count)


def is_whole(frame: RecordedCycle) -> bool:
    vectors = (frame.position, frame.velocity, frame.planned, frame.desired, frame.sent, frame.reference)
    return {frame.time, *(value for vector in vectors for value in vector or ())} == {float(frame.number)}


def test_cycles_read_while_another_process_records_flat_out_are_whole() -> None:
    memory = shared_numbers(FLIGHT_SIZE)
    child = ChildProcess("recording", record_flat_out, memory, 20_000)
    reader, frames = FlightRecorder(memory), 0
    child.start()
    while not child.pipe.has_value():
        seen = (*reader.since(reader.newest - 100), *reader.copy().since(reader.newest - 1000))
        frames += len(seen)
        assert all(map(is_whole, seen))
    assert child.join(5.0)
    assert frames > 0
    assert len(reader.frames()) == RECORDED_CYCLES
