from __future__ import annotations

import pytest

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ZERO_JOINTS, ArmCommand, Joints
from controller_states import JOINTS, configured, moved, state
from refusals import refused
from yumi.control.controllers.forward_command import (
    FORWARDERS,
    ForwardCommandController,
    JointGroupPositionController,
    JointGroupVelocityController,
)
from yumi.control.goals import GoalKind, MemoryBuffer, write_goal, write_speeds


@pytest.fixture
def box() -> MemoryBuffer:
    return MemoryBuffer()


@pytest.fixture
def positions(box: MemoryBuffer) -> ForwardCommandController:
    controller = configured(JointGroupPositionController(box, MemoryBuffer()))
    controller.activate(state(ZERO_JOINTS))
    return controller


@pytest.fixture
def speeds(box: MemoryBuffer) -> ForwardCommandController:
    controller = configured(JointGroupVelocityController(MemoryBuffer(), box))
    controller.activate(state(ZERO_JOINTS))
    return controller


def test_positions_are_forwarded_as_they_are(
    positions: ForwardCommandController, box: MemoryBuffer, middle: Joints
) -> None:
    write_goal(box, 1, middle)
    assert positions.update(state(ZERO_JOINTS)) == ArmCommand(middle)
    assert positions.update(state(ZERO_JOINTS)) == ArmCommand(middle)
    assert positions.reference == middle


@pytest.mark.parametrize("kind", FORWARDERS)
def test_nothing_is_commanded_until_the_first_message(kind: type[ForwardCommandController], box: MemoryBuffer) -> None:
    controller = configured(kind(box, box))
    write_goal(box, 1, ZERO_JOINTS, ZERO_JOINTS)
    controller.activate(state(ZERO_JOINTS))
    assert controller.update(state(ZERO_JOINTS)) is None
    assert controller.reference is None


def test_speeds_move_the_arm_until_the_timeout(speeds: ForwardCommandController, box: MemoryBuffer) -> None:
    write_speeds(box, 1, moved(ZERO_JOINTS, 4, 0.2), 2.5)
    commands = [speeds.update(state(ZERO_JOINTS, time=2.5 + 0.004 * number)) for number in range(400)]
    fastest = commands[120]
    assert fastest is not None
    assert fastest.velocity[4] == pytest.approx(0.2)
    assert commands[-1] is not None
    assert commands[-1].velocity is ZERO_JOINTS


def test_speeds_go_on_for_ever_when_the_timeout_is_0(speeds: ForwardCommandController, box: MemoryBuffer) -> None:
    configured(speeds, timeout=0.0)
    write_speeds(box, 1, moved(ZERO_JOINTS, 4, 0.2), 2.5)
    for number in range(100):
        command = speeds.update(state(ZERO_JOINTS, time=2.5 + number))
    assert command is not None
    assert command.velocity[4] == pytest.approx(0.2)


@pytest.mark.parametrize(("interface", "kind"), [("position", "FORWARD_POSITION"), ("velocity", "FORWARD_VELOCITY")])
def test_interface_is_chosen_by_its_parameter(interface: str, kind: str, box: MemoryBuffer) -> None:
    controller = configured(ForwardCommandController(box, box), interface_name=interface, joints=JOINTS)
    assert controller.goal_kind is GoalKind[kind]
    assert f"{JOINTS[0]}/{interface}" in controller.command_interfaces(JOINTS)


def test_other_joints_than_the_arm_s_are_refused(box: MemoryBuffer) -> None:
    with refused(CommandRefused, "parameter_joints_out_of_order", given="yumi_joint_1_r", joints=JOINTS):
        configured(ForwardCommandController(box, box), joints=JOINTS[:1])
