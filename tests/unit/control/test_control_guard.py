from __future__ import annotations

from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from yumi.control.guard import LONGEST_STEP, Guard
from yumi.robot.joints import Joints
from yumi.robot.limits import YUMI_LIMITS
from yumi.robot.values import ZERO, ArmCommand, ArmState

DT = 0.004
WANTED = st.tuples(*[st.floats(-100.0, 100.0)] * 7)


def state(position: Joints, *, session: int = 1, dt: float = DT, is_running: bool = True) -> ArmState:
    return ArmState(0.0, dt, session, position, ZERO, position, is_running)


@pytest.fixture
def guard() -> Guard:
    return Guard(YUMI_LIMITS)


def moved(position: Joints, index: int, by: float) -> Joints:
    return tuple(value + by * (place == index) for place, value in enumerate(position))  # type: ignore[return-value]


def test_guard_starts_a_session_with_the_measured_position(guard: Guard, middle: Joints) -> None:
    assert guard.admit(state(middle), ArmCommand(ZERO)) == ArmCommand(middle)


def test_guard_repeats_the_measured_position_while_the_robot_does_not_follow(guard: Guard, middle: Joints) -> None:
    guard.admit(state(middle), None)
    elsewhere = moved(middle, 0, 0.3)
    assert guard.admit(state(elsewhere, is_running=False), ArmCommand(ZERO)) == ArmCommand(elsewhere)


def test_guard_holds_the_last_admitted_command_not_the_measured_position(guard: Guard, middle: Joints) -> None:
    guard.admit(state(middle), None)
    crept = moved(middle, 1, -0.01)
    assert guard.admit(state(crept), None) == ArmCommand(middle)


def test_guard_lets_a_small_step_pass_unchanged(guard: Guard, middle: Joints) -> None:
    guard.admit(state(middle), None)
    wanted = ArmCommand(moved(middle, 3, 0.001))
    assert guard.admit(state(middle), wanted) == wanted
    assert guard.counters.velocity_limited == 0


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_guard_holds_when_a_command_is_not_finite(guard: Guard, middle: Joints, value: float) -> None:
    guard.admit(state(middle), None)
    assert guard.admit(state(middle), ArmCommand(moved(middle, 2, value))) == ArmCommand(middle)
    assert guard.counters.refused == 1


def test_guard_holds_when_a_speed_is_not_finite(guard: Guard, middle: Joints) -> None:
    guard.admit(state(middle), None)
    assert guard.admit(state(middle), ArmCommand(middle, moved(ZERO, 0, nan))) == ArmCommand(middle)


@pytest.mark.parametrize("index", range(7))
@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_guard_stops_each_joint_at_its_range(guard: Guard, index: int, direction: float) -> None:
    limit = (YUMI_LIMITS.upper if direction > 0 else YUMI_LIMITS.lower)[index]
    start = moved(ZERO, index, limit - direction * 0.001)
    guard.admit(state(start), None)
    admitted = guard.admit(state(start), ArmCommand(moved(start, index, direction * 0.005)))
    assert admitted.position[index] == pytest.approx(limit)
    assert guard.counters.position_limited == 1


def test_guard_lets_an_arm_outside_its_range_come_back_but_not_go_further(guard: Guard) -> None:
    outside = moved(ZERO, 1, YUMI_LIMITS.upper[1] + 0.01)
    guard.admit(state(outside), None)
    assert guard.admit(state(outside), ArmCommand(moved(outside, 1, 0.005))).position == outside
    back = moved(outside, 1, -0.005)
    assert guard.admit(state(outside), ArmCommand(back)).position == pytest.approx(back)


@given(wanted=st.lists(WANTED, min_size=1, max_size=20), dt=st.floats(0.0, 1.0))
def test_guard_never_steps_by_more_than_velocity_times_dt(wanted: list[Joints], dt: float) -> None:
    guard = Guard(YUMI_LIMITS)
    last = guard.admit(state(ZERO), None).position
    for position in wanted:
        now = guard.admit(state(ZERO, dt=dt), ArmCommand(position)).position
        for old, new, speed in zip(last, now, YUMI_LIMITS.velocity, strict=True):
            assert abs(new - old) <= speed * min(dt, LONGEST_STEP) + 1e-12
        last = now


def test_guard_slows_all_joints_by_the_same_share(guard: Guard, middle: Joints) -> None:
    guard.admit(state(middle), None)
    wanted = moved(moved(middle, 0, 0.2), 3, 0.1)
    admitted = guard.admit(state(middle), ArmCommand(wanted)).position
    assert (admitted[3] - middle[3]) / (admitted[0] - middle[0]) == pytest.approx(0.5)
    assert guard.counters.velocity_limited == 1


def test_guard_limits_fed_forward_speeds(guard: Guard, middle: Joints) -> None:
    guard.admit(state(middle), None)
    fast: Joints = (100.0, -100.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    velocity = guard.admit(state(middle), ArmCommand(middle, fast)).velocity
    assert velocity[:2] == (YUMI_LIMITS.velocity[0], -YUMI_LIMITS.velocity[1])
