"""Motions of the demonstration, from goal to virtual arm and back, in virtual time."""

from __future__ import annotations

from math import radians

import pytest

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, home, joints
from refusals import assert_says
from system.virtual_time_bench import DriverArm, System
from yumi.control.loop_events import RobotFollows, SessionLost, SessionResumed
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.control.shared_state import Snapshot

GOALS: dict[Side, Joints] = {
    Side.RIGHT: joints([radians(value) for value in (42.1, -118.4, -92.1, 46.5, -143.6, 42.5, 36.1)]),
    Side.LEFT: joints([radians(value) for value in (-39.0, -104.1, 80.0, 8.0, 31.0, 93.0, 57.0)]),
}


@pytest.fixture
def system() -> System:
    return System()


@pytest.fixture
def guided(system: System) -> System:
    system.start_egm()
    return system


def distance(arm: DriverArm, goal: Joints) -> float:
    return max(abs(now - wanted) for now, wanted in zip(arm.snapshot.position, goal, strict=True))


def largest_step_share(arm: DriverArm) -> float:
    """Largest step of the admitted command, as a share of joint speed times cycle."""
    steps = [
        abs(new - old) / (speed * CYCLE)
        for before, after in zip(arm.admitted, arm.admitted[1:], strict=False)
        for old, new, speed in zip(before, after, YUMI_LIMITS.velocity, strict=True)
    ]
    return max(steps)


def test_both_arms_reach_their_goals_at_the_same_time_within_a_tenth_of_a_degree_and_stay(guided: System) -> None:
    for side, arm in guided.arms.items():
        arm.go(GOALS[side])
    guided.until(lambda: all(distance(arm, GOALS[side]) < radians(0.1) for side, arm in guided.arms.items()), 5.0)
    guided.wait(1.0)
    for side, arm in guided.arms.items():
        assert distance(arm, GOALS[side]) < radians(0.01)


def test_admitted_command_never_steps_by_more_than_the_joints_may(guided: System) -> None:
    arm = guided.arms[Side.RIGHT]
    for goal in (GOALS[Side.RIGHT], home(Side.RIGHT)):
        arm.go(goal)
        guided.wait(1.0)
    assert largest_step_share(arm) <= 1.001


def test_first_command_of_a_session_equals_the_measured_position(guided: System) -> None:
    for arm in guided.arms.values():
        assert arm.admitted[0] == pytest.approx(arm.measured[0], abs=1e-9)


@pytest.mark.parametrize("moment", [0.1, 0.3, 0.5])
def test_arm_comes_to_rest_within_its_braking_distance_when_its_controller_is_deactivated(
    guided: System, moment: float
) -> None:
    arm = guided.arms[Side.RIGHT]
    arm.go(GOALS[Side.RIGHT])
    guided.wait(moment)
    before = arm.snapshot
    arm.line.manager.deactivate_commanding()
    guided.wait(1.2)
    assert max(map(abs, arm.snapshot.velocity)) < radians(0.01)
    assert arm.admitted[-1] == arm.admitted[-100]
    for index in range(7):
        assert abs(arm.snapshot.position[index] - before.position[index]) <= braking_distance(before, index)


def braking_distance(before: Snapshot, index: int) -> float:
    """How far a joint may go on [rad]: delay, until the command leads no further than the speed, and braking."""
    speed, gain, top = abs(before.velocity[index]), YUMI_LIMITS.acceleration[index], YUMI_LIMITS.velocity[index]
    delay = 0.05  # transport, servo, and a cycle each way [s]
    useless_lead = abs(before.sent[index] - before.position[index]) - speed / EGM_GAIN
    taking_back = max(0.0, useless_lead) / (top + speed)
    faster = speed + gain * delay
    return speed * (delay + taking_back) + faster * faster / (2.0 * gain) + radians(0.1)


def test_arm_that_was_told_to_hold_does_not_creep(guided: System) -> None:
    arm = guided.arms[Side.RIGHT]
    guided.wait(0.5)
    arm.line.manager.deactivate_commanding()
    guided.wait(0.1)
    held = arm.admitted[-1]
    guided.wait(2.0)
    assert arm.admitted[-1] == held


def test_power_cut_in_motion_is_told_within_100_ms_and_the_next_session_begins_without_a_jump(guided: System) -> None:
    arm = guided.arms[Side.RIGHT]
    arm.go(GOALS[Side.RIGHT])
    guided.wait(0.5)
    guided.is_powered = False
    guided.wait(0.1)
    (lost,) = [event for event in arm.events if isinstance(event, SessionLost)]
    assert lost.silence < 0.1
    guided.is_powered = True
    guided.world.controller.restart(1.0)
    guided.wait(2.0)
    arm.admitted.clear()
    arm.measured.clear()
    guided.start_egm()
    assert arm.snapshot.session == 2
    assert arm.admitted[0] == pytest.approx(arm.measured[0], abs=1e-9)


def interrupt(system: System, fault: str, seconds: float) -> None:
    setattr(system, fault, True)
    system.wait(seconds)
    setattr(system, fault, False)


@pytest.mark.parametrize("seconds", [0.1, 2.3])
@pytest.mark.parametrize(
    ("fault", "code"), [("stands_still", "driver_stood_still_in_motion"), ("is_cut", "feedback_lost")]
)
def test_motion_ends_when_the_driver_stood_still_as_when_the_link_was_lost(
    guided: System, fault: str, code: str, seconds: float
) -> None:
    arm = guided.arms[Side.RIGHT]
    arm.go(GOALS[Side.RIGHT])
    guided.wait(0.3)
    arm.events.clear()
    interrupt(guided, fault, seconds)
    guided.wait(1.2)
    lost, *others = arm.events
    assert isinstance(lost, SessionLost)
    assert lost.deactivated == ("joint_position_controller",)
    assert_says(lost.said, code, arm="right", controllers=lost.deactivated)
    assert others == [SessionResumed(Side.RIGHT, 1), RobotFollows(Side.RIGHT)]
    assert distance(arm, GOALS[Side.RIGHT]) > radians(5.0)
    assert largest_step_share(arm) <= 1.001
    assert arm.admitted[-1] == arm.admitted[-100]


def test_motion_goes_on_when_the_driver_stood_still_for_a_few_cycles(guided: System) -> None:
    arm = guided.arms[Side.RIGHT]
    arm.go(GOALS[Side.RIGHT])
    guided.wait(0.3)
    arm.events.clear()
    interrupt(guided, "stands_still", 3 * CYCLE)
    guided.until(lambda: distance(arm, GOALS[Side.RIGHT]) < radians(0.1), 5.0)
    assert arm.events == []
