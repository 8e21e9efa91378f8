"""The driver's managed nodes as a launch file or a supervisor leads them; the robot behind them is a fake."""

from __future__ import annotations

import pytest
from robot_manager_bench import Goal, RobotManagerRig
from std_srvs.srv import Trigger
from yumi_interfaces.action import SetMode
from yumi_interfaces.srv import ReadSignal

from yumi.control.controller import State
from yumi.errors import CommandRefused
from yumi.robot.joints import Side
from yumi.ros.clients import ManagedNodeClient

pytestmark = pytest.mark.ros

NODES = ["/yumi_robot", "/r/arm", "/l/arm", "/r/gripper", "/l/gripper"]
INACTIVE = "The robot is inactive; activate it first (ros2 lifecycle set /yumi_robot …)."


@pytest.mark.parametrize("node", NODES)
def test_managed_node_goes_down_and_up_again(rig: RobotManagerRig, node: str) -> None:
    assert rig.life(node) == "active"
    for label, state in (
        ("deactivate", "inactive"),
        ("cleanup", "unconfigured"),
        ("configure", "inactive"),
        ("activate", "active"),
    ):
        assert rig.lead(node, label)
        assert rig.life(node) == state


@pytest.mark.parametrize("number", [1, 99])
def test_transition_that_is_not_possible_now_is_answered_and_changes_nothing(rig: RobotManagerRig, number: int) -> None:
    assert not rig.lead_by_number("/yumi_robot", number)
    rig.client.until(rig.client.hears(f"Transition number {number} refused: the robot is active."))
    assert rig.life("/yumi_robot") == "active"


def test_inactive_robot_holds_and_is_asked_but_not_moved(rig: RobotManagerRig) -> None:
    assert rig.lead("/yumi_robot", "deactivate")
    assert rig.manager.calls == [("end_motion",)]
    refused = rig.call(Trigger, "start_egm")
    assert (refused.success, refused.message) == (False, INACTIVE)
    assert rig.call(Trigger, "get_state").success
    assert rig.call(Trigger, "stop_egm").success
    assert ("start_egm",) not in rig.manager.calls


def test_robot_is_inactive_even_where_it_cannot_be_told_to_hold(rig: RobotManagerRig) -> None:
    rig.manager.refusals["end_motion"] = "Nothing answers at 192.0.2.1."
    assert rig.lead("/yumi_robot", "deactivate")
    rig.client.until(rig.client.hears("Nothing answers at 192.0.2.1."))
    assert rig.line.held == list(Side)
    assert rig.call(Trigger, "start_egm").message == INACTIVE


def test_robot_that_was_cleaned_up_is_not_asked_at_all(rig: RobotManagerRig) -> None:
    assert rig.lead("/yumi_robot", "deactivate")
    assert rig.lead("/yumi_robot", "cleanup")
    rig.manager.calls.clear()
    refused = rig.call(ReadSignal, "read_signal", name="lamp")
    assert refused.message == "The robot is unconfigured; configure it first (ros2 lifecycle set /yumi_robot …)."
    assert rig.manager.calls == []


def test_robot_that_cannot_be_reached_stays_unconfigured(rig: RobotManagerRig) -> None:
    assert rig.lead("/yumi_robot", "deactivate")
    assert rig.lead("/yumi_robot", "cleanup")
    rig.connection.refusal = "Nothing answers at 192.0.2.1."
    assert not rig.lead("/yumi_robot", "configure")
    rig.client.until(rig.client.hears("Nothing answers at 192.0.2.1."))
    assert rig.life("/yumi_robot") == "unconfigured"


def test_arm_is_its_hardware_component(rig: RobotManagerRig) -> None:
    assert rig.lead("/l/arm", "deactivate")
    assert rig.line.states == {Side.RIGHT: State.ACTIVE, Side.LEFT: State.INACTIVE}
    assert rig.lead("/l/arm", "cleanup")
    assert rig.line.states[Side.LEFT] is State.UNCONFIGURED


def test_arm_follows_its_hardware_component(rig: RobotManagerRig) -> None:
    for state in (State.UNCONFIGURED, State.ACTIVE, State.INACTIVE):
        rig.line.states[Side.RIGHT] = state
        rig.managed.follow_hardware(Side.RIGHT)
        assert rig.life("/r/arm") == state.value
        assert rig.line.states[Side.RIGHT] is state


@pytest.mark.parametrize(("mode", "may"), [("egm_right", True), ("egm_left", False), ("egm_both", False)])
def test_inactive_arm_is_not_guided_and_the_other_is(rig: RobotManagerRig, mode: str, may: bool) -> None:
    assert rig.lead("/l/arm", "deactivate")
    _, result = Goal(rig, SetMode, "set_mode", mode=mode).end()
    assert result.success is may
    assert may or result.message.startswith("The left arm is inactive; activate it first (ros2 lifecycle set /l/arm")


def test_deactivating_the_robot_ends_an_action_before_its_next_step(rig: RobotManagerRig) -> None:
    rig.manager.may_go_on.clear()
    goal = Goal(rig, SetMode, "set_mode", mode="ready")
    rig.client.until(lambda: bool(goal.steps))
    assert rig.lead("/yumi_robot", "deactivate")
    rig.manager.may_go_on.set()
    _, result = goal.end()
    assert result.message == f"Given up before: start EGM; {INACTIVE[0].lower()}{INACTIVE[1:]}"


def test_application_leads_a_managed_node(rig: RobotManagerRig) -> None:
    gripper = ManagedNodeClient(rig.client, "l/gripper")
    gripper.deactivate()
    gripper.cleanup()
    with pytest.raises(CommandRefused, match="l/gripper does not activate: it is unconfigured"):
        gripper.activate()
    gripper.configure()
    gripper.activate()
    assert gripper.state == "active"


def test_hand_that_is_deactivated_holds(rig: RobotManagerRig) -> None:
    assert rig.lead("/l/gripper", "deactivate")
    assert [rig.grippers[side].holds for side in (Side.LEFT, Side.RIGHT)] == [1, 0]


def test_hands_hold_when_the_robot_is_deactivated(rig: RobotManagerRig) -> None:
    rig.grippers[Side.RIGHT].refusal = "The controller has no signal hand_SysState_R; it has no right Smart Gripper."
    assert rig.lead("/yumi_robot", "deactivate")
    assert [gripper.holds for gripper in rig.grippers.values()] == [1, 1]


def test_hands_hold_when_egm_of_a_deactivated_robot_does_not_end(rig: RobotManagerRig) -> None:
    rig.manager.refusals["end_motion"] = "The right arm did not reach IDLE within 5 s."
    rig.lead("/yumi_robot", "deactivate")
    assert [gripper.holds for gripper in rig.grippers.values()] == [1, 1]


@pytest.mark.parametrize("node", ["/l/gripper", "/yumi_robot"])
def test_hand_takes_no_goals_unless_it_and_the_robot_are_active(rig: RobotManagerRig, node: str) -> None:
    assert rig.managed.why_no_grip(Side.LEFT) is None
    assert rig.lead(node, "deactivate")
    reason = rig.managed.why_no_grip(Side.LEFT)
    assert reason is not None
    assert node in reason


def test_node_that_was_shut_down_says_that_only_a_restart_helps(rig: RobotManagerRig) -> None:
    """The last of all: nothing leads it up again."""
    assert rig.lead("/r/gripper", "shutdown")
    assert rig.life("/r/gripper") == "finalized"
    assert rig.managed.why_no_grip(Side.RIGHT) == "the right gripper has been shut down; restart the driver."
    assert not rig.lead("/r/gripper", "configure")
