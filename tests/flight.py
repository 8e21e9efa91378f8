"""Frames and events of a motion that was stopped, for tests of recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import sin
from pathlib import Path

from abb_protocols.robot.joints import ArmCommand, ArmState, Joints, Side, joints
from yumi.control.cycle import Cycle
from yumi.control.flight_recorder import FlightRecorder, RecordedCycle, flight_memory
from yumi.control.loop_events import SessionLost
from yumi.control.stage_times import AFTER_REPLY, SEND_STAGE, StageClock
from yumi.recording.message_types import RecordedEvent
from yumi.recording.writer import RecordingWriter

CYCLE = 0.004
LOST = SessionLost(Side.RIGHT, 0.052, ("joint_position_controller",))
SENTENCE = str(LOST)


def swinging(time: float) -> Joints:
    return joints([0.1 * axis * sin(time) for axis in range(7)])


def record_motion(recorder: FlightRecorder, count: int) -> float:
    """Record ``count`` more cycles of a motion, the first of them held; returns the time of the last one [s]."""
    times = iter([80e-6, 100e-6] * count)
    stages = StageClock(lambda: next(times))
    for number in range(recorder.newest + 1, recorder.newest + count + 1):
        time = number * CYCLE
        state = ArmState(time, CYCLE, 1, swinging(time), swinging(0.1), swinging(time), is_running=True)
        command = ArmCommand(swinging(time + 0.02))
        stages.begin(0.0)
        stages.note(SEND_STAGE)
        stages.note(AFTER_REPLY)
        wanted = None if number == 1 else command
        recorder.record(Cycle(state, wanted, command), swinging(1.0), stages)
    return recorder.newest * CYCLE


def flown(count: int) -> FlightRecorder:
    """A recorder that has seen ``count`` cycles of a motion."""
    recorder = FlightRecorder(flight_memory())
    record_motion(recorder, count)
    return recorder


def write_flight_record(
    file: Path, epoch: float, event: RecordedEvent, frames: Mapping[Side, Sequence[RecordedCycle]]
) -> None:
    """A record as the driver writes it."""
    with RecordingWriter(file, epoch) as writer:
        for side, each in frames.items():
            for frame in each:
                writer.add_frame(side, frame)
        writer.add_event(event)
