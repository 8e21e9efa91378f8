from __future__ import annotations

import pytest

from yumi.control.goals import put_goal
from yumi.control.mailbox import MemoryMailbox
from yumi.controllers.joint_position import JointPositionController
from yumi.controllers.joint_state_broadcaster import JointStateBroadcaster
from yumi.robot.joints import Joints
from yumi.robot.values import ZERO, ArmState


def state(position: Joints, session: int = 1) -> ArmState:
    return ArmState(2.5, 0.004, session, position, ZERO, position, is_running=True)


@pytest.fixture
def goals() -> MemoryMailbox:
    return MemoryMailbox()


@pytest.fixture
def controller(goals: MemoryMailbox) -> JointPositionController:
    controller = JointPositionController(goals)
    controller.configure({"p": 1.6})
    return controller


def wanted(controller: JointPositionController, position: Joints, session: int = 1) -> Joints:
    command = controller.update(state(position, session))
    assert command is not None
    return command.position


def test_position_controller_wants_what_it_finds_until_a_goal_comes(
    controller: JointPositionController, middle: Joints
) -> None:
    controller.activate(state(middle))
    assert wanted(controller, middle) == middle
    assert controller.reference == middle


def test_position_controller_wants_measured_plus_gain_times_error(
    controller: JointPositionController, goals: MemoryMailbox, middle: Joints
) -> None:
    controller.activate(state(ZERO))
    put_goal(goals, 1, middle)
    assert wanted(controller, ZERO) == pytest.approx([1.6 * value for value in middle])
    assert wanted(controller, middle) == pytest.approx(middle)


def test_position_controller_forgets_goals_from_before_its_activation(
    controller: JointPositionController, goals: MemoryMailbox, middle: Joints
) -> None:
    put_goal(goals, 1, middle)
    controller.activate(state(ZERO))
    assert wanted(controller, ZERO) == ZERO


def test_position_controller_ignores_goals_for_another_session(
    controller: JointPositionController, goals: MemoryMailbox, middle: Joints
) -> None:
    controller.activate(state(ZERO, session=2))
    put_goal(goals, 1, middle)
    assert wanted(controller, ZERO, session=2) == ZERO


def test_position_controller_takes_a_new_gain_while_it_runs(
    controller: JointPositionController, goals: MemoryMailbox, middle: Joints
) -> None:
    controller.activate(state(ZERO))
    put_goal(goals, 1, middle)
    controller.configure({"p": 0.5})
    assert wanted(controller, ZERO) == pytest.approx([0.5 * value for value in middle])


def test_broadcaster_hands_on_time_positions_and_velocities(middle: Joints) -> None:
    states = MemoryMailbox()
    broadcaster = JointStateBroadcaster(states)
    broadcaster.activate(state(middle))
    assert broadcaster.update(state(middle)) is None
    assert states.peek() == (1, (2.5, *middle, *ZERO))
