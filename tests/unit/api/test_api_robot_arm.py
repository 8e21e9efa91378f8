from __future__ import annotations

from collections.abc import Callable

import pytest

from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import ZERO_JOINTS, Side, home, joint_names
from abb_protocols.robot.kinematics import tool0_to_body
from fake_robot import FakeRobot
from refusals import refused
from yumi.api.gripper import Gripper
from yumi.api.robot_arm import Arm
from yumi.control.controllers.joint_goal import StopMotion
from yumi.control.loop_events import SessionLost
from yumi.control.shared_state import Snapshot
from yumi.driver.reports import ArmMode

RIGHT = home(Side.RIGHT)


@pytest.fixture
def robot() -> FakeRobot:
    return FakeRobot()


@pytest.fixture
def arm(robot: FakeRobot) -> Arm:
    return Arm(Side.RIGHT, lambda: robot.executor, Gripper(Side.RIGHT, no_gripper, 10.0))


def no_gripper() -> None:
    raise AssertionError("the arm needs no gripper")


def show(robot: FakeRobot, **values: object) -> None:
    robot.control.snapshots[Side.RIGHT] = robot.control.snapshots[Side.RIGHT]._replace(**values)  # type: ignore[arg-type]


def test_arm_reports_what_is_measured(arm: Arm) -> None:
    assert arm.position == RIGHT
    assert arm.velocity == ZERO_JOINTS
    assert arm.pose == tool0_to_body(Side.RIGHT, RIGHT)
    assert arm.joint_names == joint_names(Side.RIGHT)


@pytest.mark.parametrize(
    ("values", "mode"),
    [
        ({"is_streaming": False, "is_running": False}, ArmMode.NO_EGM),
        ({"is_running": False}, ArmMode.IDLE),
        ({}, ArmMode.HOLDING),
        ({"velocity": (0.0, 0.0, -0.3, 0.0, 0.0, 0.0, 0.0)}, ArmMode.MOVING),
    ],
)
def test_arm_reports_what_it_does(robot: FakeRobot, arm: Arm, values: dict[str, object], mode: ArmMode) -> None:
    show(robot, **values)
    assert arm.mode is mode


def test_arm_that_was_stopped_is_a_fault_until_it_is_recovered(robot: FakeRobot, arm: Arm) -> None:
    robot.motions.note(SessionLost(Side.RIGHT, 0.08, ("joint_goal_controller",)))
    assert arm.mode is ArmMode.FAULT
    robot.motions.clear_faults()
    assert arm.mode is ArmMode.HOLDING


@pytest.mark.parametrize("look", [lambda arm: arm.position, lambda arm: arm.velocity, lambda arm: arm.pose])
def test_silent_arm_has_no_position(robot: FakeRobot, arm: Arm, look: Callable[[Arm], object]) -> None:
    robot.control.snapshots[Side.RIGHT] = Snapshot()
    with refused(RobotNotReady, "arm_sends_no_positions", arm="right"):
        look(arm)


def test_arm_stops_and_waits_until_it_stands(robot: FakeRobot, arm: Arm) -> None:
    robot.control.on_command = robot.end
    arm.stop()
    assert isinstance(robot.control.commands[0].message, StopMotion)


def test_arm_waits_for_its_goal_unless_reported_otherwise(robot: FakeRobot, arm: Arm) -> None:
    assert not arm.move_to(RIGHT, wait=False).is_done
    robot.control.on_command = robot.end
    assert arm.move_to(RIGHT).is_done
