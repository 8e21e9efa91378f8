from __future__ import annotations

from dataclasses import replace
from math import pi, radians, sin

import pytest
from transport_delay import transport_delay

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CYCLE, joints
from abb_runtime.parameters import Values
from virtual_irc5.mechanics.arm_motion import ArmModel
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.flight_recorder import FlightRecorder, RecordedCycle, flight_memory
from yumi.control.goals import MemoryBuffer, write_goal
from yumi.control.stage_times import StageClock
from yumi_evaluation.virtual_time import VirtualArmRig


def recorded(model: ArmModel | None = None, values: Values | None = None) -> tuple[RecordedCycle, ...]:
    """Three seconds of an arm that follows a sine."""
    goals, recorder = MemoryBuffer(), FlightRecorder(flight_memory())
    arm = VirtualArmRig({"controller": JointPositionController(goals)}, model=model)
    arm.manager.set_parameters("controller", values or {})
    arm.start()
    arm.switch_to("controller")
    start = arm.robot.arm.planned
    for number in range(750):
        way = radians(15.0) * sin(2.0 * pi * 0.7 * number * CYCLE)
        write_goal(goals, 1, joints([*start[:6], start[6] + way]))
        arm.cycle()
        recorder.record(arm.cycles[-1], None, StageClock())
    return recorder.frames()


def delay_of(model: ArmModel) -> float:
    """Until a command is taken, is used, and has moved the arm for half of its cycle [s]."""
    return CYCLE + model.reference_delay + 0.5 * CYCLE + model.delay + model.lag


def test_delay_of_the_virtual_robot_is_found() -> None:
    found = transport_delay(recorded())
    assert found.delay == pytest.approx(delay_of(ArmModel()), abs=0.001)
    assert found.joint == 6
    assert found.error < radians(0.1)


def test_delay_is_found_whatever_the_controller_did() -> None:
    found = transport_delay(recorded(values={"tracking.feed_forward": True}))
    assert found.delay == pytest.approx(delay_of(ArmModel()), abs=0.001)


@pytest.mark.parametrize("delay", [0.010, 0.040])
def test_delay_is_that_of_the_arm(delay: float) -> None:
    found = transport_delay(recorded(ArmModel(delay=delay)))
    assert found.delay == pytest.approx(delay_of(ArmModel(delay=delay)), abs=0.0015)


def test_few_cycles_have_no_delay() -> None:
    with pytest.raises(CommandRefused, match="There are 100 cycles in which the robot followed; a delay needs 250"):
        transport_delay(recorded()[:100])


def test_arm_that_stands_has_no_delay() -> None:
    frames = recorded()
    still = [replace(frame, position=frames[0].position) for frame in frames]
    with pytest.raises(CommandRefused, match=r"The arm moved by 0\.0000 rad; a delay needs a motion of 0.02 rad"):
        transport_delay(still)
