"""One arm of the virtual robot, in virtual time."""

from __future__ import annotations

from itertools import pairwise
from math import dist, inf, nan

import pytest

from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Side, home
from abb_protocols.robot.kinematics import tool0_to_body
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_motion import EgmMotionParameters

CYCLE = 0.004032
VELOCITY_MODE = EgmMotionParameters(gain=0.0, bandwidth=0.0, max_speed=10.0)


@pytest.fixture
def arm() -> VirtualArm:
    arm = VirtualArm(Side.LEFT)
    arm.switch_motors_on()
    return arm


def beside(position: Joints, turn: float) -> Joints:
    return (position[0] + turn, *position[1:])


def settle(arm: VirtualArm, dt: float = CYCLE, longest: float = 20.0) -> float:
    """Advance until the arm stands still; the time it took [s]."""
    time = 0.0
    while not arm.is_stationary and time < longest:
        arm.advance(dt)
        time += dt
    assert arm.is_stationary
    return time


def test_arm_stands_at_home_with_motors_off_at_first():
    arm = VirtualArm(Side.RIGHT)
    assert arm.position == arm.planned == home(Side.RIGHT)
    assert arm.is_stationary
    assert not arm.motors_on


def test_arm_reaches_the_target_and_stands_still(arm):
    target = beside(home(Side.LEFT), 0.5)
    arm.move_to(target)
    settle(arm)
    assert arm.position == pytest.approx(target, abs=1e-5)
    assert arm.planned == target
    assert arm.velocity == ZERO_JOINTS


def test_motion_to_where_the_arm_stands_is_over_at_once(arm):
    nearby = beside(home(Side.LEFT), 1e-15)
    arm.move_to(nearby)
    arm.advance(0.1)
    assert arm.is_stationary
    assert arm.planned == nearby


def test_all_joints_arrive_together_on_a_straight_way(arm):
    start = home(Side.LEFT)
    arm.move_to((0.5, start[1] + 1.0, *start[2:]))
    arm.advance(0.3)
    assert arm.planned[1] - start[1] == pytest.approx(2.0 * arm.planned[0], abs=1e-9)


def test_motion_keeps_every_joint_within_its_speed(arm):
    arm.move_to((2.9, 0.7, -2.9, 1.3, 5.0, 2.4, 3.9))
    fastest = [0.0] * 7
    while not arm.is_stationary:
        arm.advance(CYCLE)
        fastest = [max(top, abs(now)) for top, now in zip(fastest, arm.velocity, strict=True)]
    limits = arm.model.limits.velocity
    assert all(top <= most + 1e-9 for top, most in zip(fastest, limits, strict=True))
    assert any(top > 0.9 * most for top, most in zip(fastest, limits, strict=True))


def test_tool_speed_stretches_the_motion(arm):
    target = beside(home(Side.LEFT), 1.0)
    way = sum(
        dist(tool0_to_body(Side.LEFT, beside(home(Side.LEFT), i / 100)).position,
             tool0_to_body(Side.LEFT, beside(home(Side.LEFT), (i + 1) / 100)).position)
        for i in range(100)
    )  # fmt: skip
    arm.move_to(target, tool_speed=0.1)
    assert settle(arm) == pytest.approx(way / 0.1, rel=0.05)


def test_turn_speed_stretches_a_motion_that_only_turns_the_tool(arm):
    start = home(Side.LEFT)
    arm.move_to((*start[:6], 1.0), turn_speed=0.2)
    assert settle(arm) == pytest.approx(5.0, rel=0.05)


def test_duration_is_kept_when_it_is_longer_than_needed(arm):
    arm.move_to(beside(home(Side.LEFT), 0.1), duration=3.0)
    assert settle(arm) == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("value", [3.0, -3.0, nan, inf])
def test_target_out_of_range_is_refused_and_nothing_moves(arm, value):
    with pytest.raises(CommandRefused, match=r"yumi_joint_1_l cannot move to .* its range is -168.5° to 168.5°"):
        arm.move_to(beside(ZERO_JOINTS, value))
    assert arm.is_stationary


def test_motion_is_refused_when_motors_are_off():
    with pytest.raises(RobotNotReady, match="motors of the left arm are off"):
        VirtualArm(Side.LEFT).move_to(ZERO_JOINTS)


def test_motion_is_refused_when_egm_guides_the_arm(arm):
    arm.start_egm(EgmMotionParameters())
    with pytest.raises(RobotNotReady, match="EGM moves the left arm"):
        arm.move_to(ZERO_JOINTS)


def test_stop_decelerates_and_holds(arm):
    arm.move_to(beside(home(Side.LEFT), 2.0))
    arm.advance(0.4)
    moving_at = arm.planned[0]
    arm.stop()
    assert settle(arm) < 0.4
    assert moving_at < arm.position[0] < 2.0 - 0.1


def test_brakes_stop_the_arm_faster_than_the_drives(arm):
    stopped = []
    for stop in (VirtualArm.stop, VirtualArm.switch_motors_off):
        arm = VirtualArm(Side.LEFT)
        arm.switch_motors_on()
        arm.move_to(beside(home(Side.LEFT), 2.0))
        arm.advance(0.4)
        stop(arm)
        stopped.append(settle(arm))
    assert stopped[1] < stopped[0]


def test_brakes_hold_when_egm_was_guiding(arm):
    arm.start_egm(VELOCITY_MODE)
    arm.set_reference(None, beside(ZERO_JOINTS, 1.0))
    arm.advance(0.2)
    arm.switch_motors_off()
    assert settle(arm) < 0.3
    with pytest.raises(RobotNotReady, match="EGM does not move the left arm"):
        arm.set_reference(ZERO_JOINTS, None)


def test_measured_position_follows_a_constant_speed_late_by_delay_and_lag(arm):
    arm.start_egm(VELOCITY_MODE)
    arm.set_reference(None, beside(ZERO_JOINTS, 0.5))
    arm.advance(0.5)
    assert (arm.planned[0] - arm.position[0]) / 0.5 == pytest.approx(0.010 + 0.006, abs=1e-6)


def test_filtering_level_adds_its_delay_without_a_jump(arm):
    arm.start_egm(EgmMotionParameters(gain=0.0, bandwidth=0.0, max_speed=10.0, level=1))
    arm.set_reference(None, beside(ZERO_JOINTS, 0.5))
    arm.advance(0.5)
    assert (arm.planned[0] - arm.position[0]) / 0.5 == pytest.approx(0.032, abs=1e-6)
    assert arm.reaction_time == pytest.approx(0.032)


def test_servo_answers_a_step_of_speed_as_its_formula_says():
    arm = VirtualArm(Side.LEFT, ZERO_JOINTS, ArmModel(reference_delay=0.0, delay=0.0, lag=0.010, step=1.0))
    arm.switch_motors_on()
    arm.start_egm(VELOCITY_MODE)
    arm.set_reference(None, beside(ZERO_JOINTS, 1.0))
    arm.advance(0.010)
    assert arm.position[0] == pytest.approx(0.010 * 0.36787944, rel=1e-6)  # t - τ(1 - e^(-t/τ)) at t = τ


@pytest.mark.parametrize("dt", [0.001, 0.004032, 0.01, 0.1])
def test_motion_is_the_same_however_time_is_divided(arm, dt):
    arm.move_to(beside(home(Side.LEFT), 1.0))
    for _ in range(round(0.4 / dt)):
        arm.advance(dt)
    reference = VirtualArm(Side.LEFT)
    reference.switch_motors_on()
    reference.move_to(beside(home(Side.LEFT), 1.0))
    reference.advance(round(0.4 / dt) * dt)
    assert arm.planned == pytest.approx(reference.planned, abs=1e-9)
    assert arm.position == pytest.approx(reference.position, abs=2e-4)


def test_egm_that_ends_holds_after_its_ramp(arm):
    arm.start_egm(VELOCITY_MODE)
    arm.set_reference(None, beside(ZERO_JOINTS, 0.5))
    arm.advance(0.5)
    before = arm.planned[0]
    arm.stop_egm(1.0)
    assert settle(arm) == pytest.approx(1.0, abs=0.1)
    assert arm.position[0] - before == pytest.approx(0.25, abs=0.02)


def test_egm_that_ends_in_a_step_of_speed_does_not_speed_up_further(arm):
    arm.start_egm(VELOCITY_MODE)
    arm.set_reference(None, beside(ZERO_JOINTS, 0.2))
    arm.advance(CYCLE)
    arm.stop_egm()
    arm.advance(0.02)
    assert arm.velocity[0] < 0.2


def test_egm_that_ramps_down_returns_to_where_it_began(arm):
    arm.start_egm(VELOCITY_MODE)
    arm.set_reference(None, beside(ZERO_JOINTS, 0.5))
    arm.advance(0.5)
    arm.stop_egm(1.0, returns_to_start=True)
    settle(arm)
    assert arm.position == pytest.approx(home(Side.LEFT), abs=1e-5)


def test_arm_that_is_pushed_gives_way_smoothly_and_comes_back(arm: VirtualArm) -> None:
    start, planned = arm.position, arm.planned
    arm.push(0.1)
    seen = [arm.position]
    while len(seen) < 300:
        arm.advance(CYCLE)
        seen.append(arm.position)
    aside = [position[3] - start[3] for position in seen]
    assert max(aside) == pytest.approx(0.1, abs=1e-3)
    assert max(abs(b - a) for a, b in pairwise(aside)) < 0.002
    assert all(position[:3] + position[4:] == start[:3] + start[4:] for position in seen)
    assert (arm.position, arm.planned) == (start, planned)
    assert arm.is_stationary


def test_arm_whose_brakes_hold_it_is_not_pushed() -> None:
    with pytest.raises(CommandRefused, match="brakes hold the arm"):
        VirtualArm(Side.LEFT).push(0.1)


def test_arm_that_is_pushed_under_egm_is_planned_against_the_push(arm: VirtualArm) -> None:
    arm.start_egm(EgmMotionParameters(bandwidth=0.0, max_speed=10.0))
    start = arm.position[3]
    arm.push(0.1)
    planned, measured = [], []
    for _ in range(500):
        arm.advance(CYCLE)
        planned.append(arm.planned[3] - start)
        measured.append(arm.position[3] - start)
    assert min(planned) < -0.04
    assert 0.04 < max(measured) < 0.08
    assert measured[-1] == pytest.approx(0.0, abs=0.001)
