from __future__ import annotations

import itertools

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ZERO_JOINTS, ArmCommand, Joints, Side, joint_names
from refusals import assert_says, refused
from unit.control.controller_doubles import RUNNING, THERE, Double
from yumi.control.manager.controller_manager import ControllerManager

FAST: Joints = (0.5,) * 7
ELSEWHERE: Joints = (0.7,) * 7


def commanded(**doubles: Double) -> ControllerManager:
    """A manager whose controllers are all active; its clock goes on by a second at each look."""
    manager = ControllerManager(joint_names(Side.RIGHT), now=itertools.count().__next__)
    for name, double in doubles.items():
        manager.load(name, double)
        manager.configure(name)
    manager.switch(tuple(doubles), (), RUNNING)
    return manager


def double(*kinds: str, position: Joints, velocity: Joints = ZERO_JOINTS, joints: int = 7) -> Double:
    double = Double(*kinds, joints=joints)
    double.command = ArmCommand(position, velocity)
    return double


def test_merged_command_takes_each_kind_from_who_claims_it() -> None:
    position = double("position", position=THERE, velocity=ELSEWHERE)
    velocity = double("velocity", position=ELSEWHERE, velocity=FAST)
    for order in ({"a": position, "b": velocity}, {"b": velocity, "a": position}):
        assert commanded(**order).update(RUNNING) == ArmCommand(THERE, FAST)


def test_merged_command_keeps_the_zero_that_lets_the_guard_pass_it_at_once() -> None:
    manager = commanded(a=double("position", position=THERE), b=double("velocity", position=ELSEWHERE))
    command = manager.update(RUNNING)
    assert command is not None
    assert command.velocity is ZERO_JOINTS
    assert command.position is THERE


def test_merged_command_takes_each_joint_from_who_claims_it() -> None:
    manager = ControllerManager(joint_names(Side.RIGHT))
    near, far = double("position", position=THERE, joints=3), double("velocity", position=ELSEWHERE, velocity=FAST)
    for name, each in (("near", near), ("far", far)):
        manager.load(name, each)
        manager.configure(name)
    manager.switch(("near", "far"), (), RUNNING)
    assert manager.update(RUNNING) == ArmCommand((0.1, 0.1, 0.1, 0.7, 0.7, 0.7, 0.7), FAST)


def test_merged_command_takes_the_speed_of_who_alone_claims_the_joint() -> None:
    near = double("position", position=THERE, velocity=FAST)
    far = double("velocity", position=ELSEWHERE, velocity=ELSEWHERE, joints=1)
    assert commanded(near=near, far=far).update(RUNNING) == ArmCommand(THERE, (0.7, *FAST[1:]))


def test_one_controller_is_believed_in_everything() -> None:
    assert commanded(a=double("velocity", position=THERE, velocity=FAST)).update(RUNNING) == ArmCommand(THERE, FAST)


def test_arm_holds_while_one_of_its_controllers_holds() -> None:
    position, velocity = Double("position"), Double("velocity")
    manager = commanded(a=position, b=velocity)
    velocity.command = None
    assert manager.update(RUNNING) is None
    assert manager.is_commanding


def test_controllers_that_command_together_go_together_when_one_fails() -> None:
    position, velocity = Double("position"), Double("velocity")
    manager = commanded(a=position, b=velocity)
    velocity.faults["update"] = ValueError("nonsense")
    assert manager.update(RUNNING) is None
    assert not manager.is_commanding
    (failure,) = manager.failures
    error = message("text", text="nonsense")
    assert_says(failure, "commanding_controllers_failed", controller="b", others=("a",), type="ValueError", error=error)
    assert position.done[-2:] == ["deactivate", "take_reports"]


def test_reference_is_that_of_the_first_who_has_one() -> None:
    position, velocity = Double("position"), Double("velocity")
    position.command = None
    assert commanded(a=position, b=velocity).reference == THERE


def test_each_of_several_controllers_has_its_own_times() -> None:
    manager = commanded(a=Double("position"), b=Double("velocity"))
    for _ in range(3):
        manager.update(RUNNING)
        manager.note_times(RUNNING, [0.0] * 8)
    assert [info.execution_time.count for info in manager.controllers()] == [3, 3]
    assert [info.execution_time.mean for info in manager.controllers()] == [1.0, 1.0]


def test_two_controllers_cannot_begin_to_claim_the_same_interface() -> None:
    with refused(CommandRefused, "interface_claimed", controller="b", interface="yumi_joint_1_r/position", owner="a"):
        commanded(a=Double("position"), b=Double("velocity", "position"))
