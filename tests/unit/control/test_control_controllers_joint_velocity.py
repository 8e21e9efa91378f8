from __future__ import annotations

from itertools import pairwise
from math import nan

import pytest

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, ArmCommand, Joints
from controller_states import configured, moved, state
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.goals import MemoryBuffer, write_speeds


@pytest.fixture
def speeds() -> MemoryBuffer:
    return MemoryBuffer()


@pytest.fixture
def controller(speeds: MemoryBuffer) -> JointVelocityController:
    controller = configured(JointVelocityController(speeds))
    controller.activate(state(ZERO_JOINTS, time=0.0))
    return controller


def driven(
    controller: JointVelocityController, box: MemoryBuffer, velocity: Joints, seconds: float, until: float = 1e9
) -> list[ArmCommand]:
    """Commands for an arm that does what it is told, while ``velocity`` is ordered each cycle ``until`` [s]."""
    commands, position = [], ZERO_JOINTS
    for number in range(1, round(seconds / CYCLE)):
        if number * CYCLE < until:
            write_speeds(box, 1, velocity, number * CYCLE)
        command = controller.update(state(position, time=number * CYCLE))
        assert command is not None
        position = command.position
        commands.append(command)
    return commands


def test_velocity_controller_comes_to_the_speed_and_moves_the_position_along(
    controller: JointVelocityController, speeds: MemoryBuffer
) -> None:
    *_, before, last = driven(controller, speeds, moved(ZERO_JOINTS, 4, 0.7), 1.0)
    assert last.velocity == pytest.approx(moved(ZERO_JOINTS, 4, 0.7))
    assert last.position[4] - before.position[4] == pytest.approx(0.7 * CYCLE)


def test_velocity_controller_stops_when_nothing_comes_any_more(
    controller: JointVelocityController, speeds: MemoryBuffer
) -> None:
    commands = driven(controller, speeds, moved(ZERO_JOINTS, 4, 0.7), 1.0, until=0.5)
    assert commands[round(0.59 / CYCLE) - 1].velocity[4] == pytest.approx(0.7)
    assert commands[-1].velocity is ZERO_JOINTS
    assert commands[-1].position == commands[-20].position
    assert controller.reference == commands[-1].position


def test_velocity_controller_keeps_the_acceleration_and_jerk_of_the_joints(
    controller: JointVelocityController, speeds: MemoryBuffer
) -> None:
    commands = driven(controller, speeds, moved(ZERO_JOINTS, 0, 3.0), 0.8, until=0.2)
    rates = [(new.velocity[0] - old.velocity[0]) / CYCLE for old, new in pairwise(commands)]
    assert max(map(abs, rates)) <= YUMI_LIMITS.acceleration[0]
    assert max(abs(new - old) for old, new in pairwise(rates)) / CYCLE <= YUMI_LIMITS.jerk[0]


def test_velocity_controller_stops_before_the_end_of_the_range(
    controller: JointVelocityController, speeds: MemoryBuffer
) -> None:
    commands = driven(controller, speeds, moved(ZERO_JOINTS, 1, 1.0), 3.0)
    assert YUMI_LIMITS.upper[1] - 0.01 < commands[-1].position[1] <= YUMI_LIMITS.upper[1]
    assert commands[-1].velocity[1] < 0.05


def test_velocity_controller_takes_a_new_timeout_while_it_runs(
    controller: JointVelocityController, speeds: MemoryBuffer
) -> None:
    configured(controller, timeout=0.5)
    commands = driven(controller, speeds, moved(ZERO_JOINTS, 4, 0.7), 0.6, until=0.3)
    assert commands[-1].velocity[4] == pytest.approx(0.7)


def test_velocity_controller_goes_where_the_robot_goes_that_heeds_no_positions(
    controller: JointVelocityController, speeds: MemoryBuffer
) -> None:
    driven(controller, speeds, ZERO_JOINTS, 0.1)
    elsewhere = moved(ZERO_JOINTS, 4, 0.5)
    command = controller.update(state(elsewhere, time=0.1))
    assert command == ArmCommand(elsewhere)


def test_velocity_controller_forgets_speeds_from_before_its_activation(
    controller: JointVelocityController, speeds: MemoryBuffer
) -> None:
    write_speeds(speeds, 1, moved(ZERO_JOINTS, 4, 0.7), 0.0)
    controller.activate(state(ZERO_JOINTS, time=0.0))
    assert controller.update(state(ZERO_JOINTS, time=0.01)) == ArmCommand(ZERO_JOINTS)


def test_velocity_controller_has_no_reference_when_it_is_not_active(controller: JointVelocityController) -> None:
    controller.deactivate()
    assert controller.reference is None


def test_speed_that_is_no_number_stops_the_joint(controller: JointVelocityController, speeds: MemoryBuffer) -> None:
    driven(controller, speeds, moved(ZERO_JOINTS, 4, 0.7), 0.5)
    last = driven(controller, speeds, (0.7, nan, 0.0, 0.0, nan, 0.0, 0.0), 1.0)[-1]
    assert last.velocity == pytest.approx((0.7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
