from __future__ import annotations

import pytest

from abb_protocols.robot.joints import CYCLE, ZERO_JOINTS, Joints
from controller_states import JOINTS, configured, moved, state
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_state_broadcaster import JointStateBroadcaster
from yumi.control.goals import MemoryBuffer, write_goal
from yumi_evaluation.virtual_time import VirtualArmRig


@pytest.fixture
def goals() -> MemoryBuffer:
    return MemoryBuffer()


@pytest.fixture
def controller(goals: MemoryBuffer) -> JointPositionController:
    return configured(JointPositionController(goals), p=1.6)


def wanted(
    controller: JointPositionController, position: Joints, session: int = 1, velocity: Joints = ZERO_JOINTS
) -> Joints:
    command = controller.update(state(position, session=session, velocity=velocity))
    assert command is not None
    return command.position


def test_position_controller_wants_what_it_finds_until_a_goal_comes(
    controller: JointPositionController, middle: Joints
) -> None:
    controller.activate(state(middle))
    assert wanted(controller, middle) == middle
    assert controller.reference == middle


def test_position_controller_wants_measured_plus_gain_times_error(
    controller: JointPositionController, goals: MemoryBuffer, middle: Joints
) -> None:
    controller.activate(state(ZERO_JOINTS))
    write_goal(goals, 1, middle)
    assert wanted(controller, ZERO_JOINTS) == pytest.approx([1.6 * value for value in middle])
    assert wanted(controller, middle) == pytest.approx(middle)


def test_position_controller_forgets_goals_from_before_its_activation(
    controller: JointPositionController, goals: MemoryBuffer, middle: Joints
) -> None:
    write_goal(goals, 1, middle)
    controller.activate(state(ZERO_JOINTS))
    assert wanted(controller, ZERO_JOINTS) == ZERO_JOINTS


def test_position_controller_ignores_goals_for_another_session(
    controller: JointPositionController, goals: MemoryBuffer, middle: Joints
) -> None:
    controller.activate(state(ZERO_JOINTS, session=2))
    write_goal(goals, 1, middle)
    assert wanted(controller, ZERO_JOINTS, session=2) == ZERO_JOINTS


def test_position_controller_takes_a_new_gain_while_it_runs(
    controller: JointPositionController, goals: MemoryBuffer, middle: Joints
) -> None:
    controller.activate(state(ZERO_JOINTS))
    write_goal(goals, 1, middle)
    configured(controller, p=0.5)
    assert wanted(controller, ZERO_JOINTS) == pytest.approx([0.5 * value for value in middle])


def test_joint_with_a_gain_of_its_own_has_that(
    controller: JointPositionController, goals: MemoryBuffer, middle: Joints
) -> None:
    configured(controller, p=1.0, **{f"gains.{JOINTS[2]}.p": 0.0})
    controller.activate(state(ZERO_JOINTS))
    write_goal(goals, 1, middle)
    assert wanted(controller, ZERO_JOINTS) == pytest.approx([*middle[:2], 0.0, *middle[3:]])


def test_integral_grows_with_the_error_and_ends_at_its_clamp(
    controller: JointPositionController, goals: MemoryBuffer
) -> None:
    configured(controller, p=0.0, i=2.0, i_clamp_max=0.05, i_clamp_min=-0.02)
    controller.activate(state(ZERO_JOINTS))
    write_goal(goals, 1, moved(moved(ZERO_JOINTS, 0, 0.5), 1, -0.5))
    assert wanted(controller, ZERO_JOINTS)[0] == pytest.approx(2.0 * 0.5 * CYCLE)
    for _ in range(100):
        last = wanted(controller, ZERO_JOINTS)
    assert last[:3] == pytest.approx((0.05, -0.02, 0.0))


def test_integral_is_forgotten_at_activation(controller: JointPositionController, goals: MemoryBuffer) -> None:
    configured(controller, p=0.0, i=2.0)
    controller.activate(state(ZERO_JOINTS))
    write_goal(goals, 1, moved(ZERO_JOINTS, 0, 0.5))
    wanted(controller, ZERO_JOINTS)
    controller.activate(state(ZERO_JOINTS))
    assert wanted(controller, ZERO_JOINTS) == ZERO_JOINTS


def test_derivative_brakes_a_moving_arm_and_gives_no_kick_when_the_goal_jumps(
    controller: JointPositionController, goals: MemoryBuffer
) -> None:
    configured(controller, p=1.0, d=0.1)
    controller.activate(state(ZERO_JOINTS))
    write_goal(goals, 1, moved(ZERO_JOINTS, 0, 0.5))
    assert wanted(controller, ZERO_JOINTS)[0] == pytest.approx(0.5)
    assert wanted(controller, ZERO_JOINTS, velocity=moved(ZERO_JOINTS, 0, 2.0))[0] == pytest.approx(0.5 - 0.2)


def test_feed_forward_tells_the_speed_of_the_stream_with_its_position(
    controller: JointPositionController, goals: MemoryBuffer
) -> None:
    configured(controller, **{"tracking.feed_forward": True, "tracking.delay": 0.05})
    controller.activate(state(ZERO_JOINTS))
    for number in range(400):
        write_goal(goals, 1, moved(ZERO_JOINTS, 4, 0.5 * number * CYCLE), time=number * CYCLE)
        command = controller.update(state(ZERO_JOINTS, time=number * CYCLE))
    assert command is not None
    assert command.velocity[4] == pytest.approx(0.5, abs=1e-3)
    assert command.position[4] == pytest.approx(0.5 * (399 * CYCLE + 0.05), abs=1e-3)
    assert controller.reference == moved(ZERO_JOINTS, 4, 0.5 * 399 * CYCLE)


def test_feed_forward_begins_with_the_speed_the_arm_has(controller: JointPositionController) -> None:
    configured(controller, **{"tracking.feed_forward": True})
    moving = state(ZERO_JOINTS, velocity=moved(ZERO_JOINTS, 4, 1.0))
    controller.activate(moving)
    command = controller.update(moving)
    assert command is not None
    assert command.velocity[4] == pytest.approx(1.0, abs=0.02)


def test_feed_forward_can_be_switched_on_and_off_while_the_arm_is_commanded(
    controller: JointPositionController, goals: MemoryBuffer, middle: Joints
) -> None:
    controller.activate(state(middle))
    for follows in (True, False, True):
        configured(controller, **{"tracking.feed_forward": follows})
        assert wanted(controller, middle) == pytest.approx(middle, abs=1e-12)


def test_broadcaster_hands_on_time_positions_and_velocities(middle: Joints) -> None:
    states = MemoryBuffer()
    broadcaster = JointStateBroadcaster(states)
    broadcaster.activate(state(middle))
    assert broadcaster.update(state(middle, time=2.5)) is None
    assert states.read() == (1, (2.5, middle, ZERO_JOINTS))


def test_gain_that_is_set_between_two_cycles_counts_in_the_next(goals: MemoryBuffer) -> None:
    arm = VirtualArmRig({"controller": JointPositionController(goals)})
    arm.start()
    arm.switch_to("controller")
    goal = moved(arm.robot.arm.planned, 6, 0.2)
    write_goal(goals, 1, goal)
    for gain in (1.0, 0.3, 1.7):
        arm.manager.set_parameters("controller", {"p": gain})
        arm.cycle()
        cycle = arm.cycles[-1]
        assert cycle.desired is not None
        measured = cycle.state.position[6]
        assert cycle.desired.position[6] == pytest.approx(measured + gain * (goal[6] - measured))
