from __future__ import annotations

from dataclasses import replace
from math import radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.errors import TrajectoryRefused
from abb_protocols.robot.joints import YUMI_LIMITS, Side, home, joint_names
from refusals import refused
from trajectories import REST, moved, planned, swing
from yumi.control.motion.blending import START_TOLERANCE, blend
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.spline import Spline, SplineSampler, TrajectoryPoint
from yumi.control.motion.spline_limits import check_motion
from yumi.control.trajectory_commands import ResultCode

HOME = home(Side.LEFT)
AT_HOME = Setpoint(HOME)
CYCLE = 0.004


def moving(speed: float, position: float = 0.0) -> Setpoint:
    """Axis 6 moves through ``position`` [rad] from home."""
    return Setpoint(moved(HOME, position), moved(REST, speed), REST)


def assert_smooth(spline: Spline, setpoint: Setpoint, begin: float) -> None:
    """It begins with ``setpoint``, and no velocity steps at a seam."""
    assert spline.begin == pytest.approx(begin)
    first = SplineSampler(spline).setpoint(spline.begin)
    assert first.position == pytest.approx(setpoint.position, abs=1e-9)
    assert first.velocity == pytest.approx(setpoint.velocity, abs=1e-9)
    for piece in spline.segments[:-1]:
        before, after = SplineSampler(spline).setpoint(piece.end - 1e-9), SplineSampler(spline).setpoint(piece.end)
        assert before.velocity == pytest.approx(after.velocity, abs=1e-5)


def test_trajectory_that_begins_where_the_arm_is_is_followed_as_it_is() -> None:
    plan = swing(HOME, 0.5, 2.0)
    assert blend(plan, AT_HOME, 0.0, YUMI_LIMITS) == plan.spline


def test_arm_at_rest_waits_for_the_start() -> None:
    spline = blend(swing(HOME, 0.5, 2.0), AT_HOME, -3.0, YUMI_LIMITS)
    assert SplineSampler(spline).motion(-1.0) == (pytest.approx(HOME), REST)
    assert spline.begin == 0.0


def test_arm_goes_to_a_first_point_that_is_due_later() -> None:
    spline = blend(planned([TrajectoryPoint(1.0, moved(HOME, 0.5), REST)]), AT_HOME, 0.0, YUMI_LIMITS)
    assert_smooth(spline, AT_HOME, 0.0)
    assert SplineSampler(spline).position(1.0) == moved(HOME, 0.5)


def test_moving_arm_blends_into_a_first_point_that_is_due_later() -> None:
    plan = planned([TrajectoryPoint(0.8, moved(HOME, 0.5), moved(REST, 0.3)), TrajectoryPoint(2.0, HOME, REST)])
    assert_smooth(blend(plan, moving(-0.5), 0.0, YUMI_LIMITS), moving(-0.5), 0.0)


def test_moving_arm_blends_into_points_without_velocities() -> None:
    plan = planned([TrajectoryPoint(0.8, moved(HOME, 0.5)), TrajectoryPoint(2.0, HOME)])
    assert_smooth(blend(plan, moving(-0.5), 0.0, YUMI_LIMITS), moving(-0.5), 0.0)


def test_moving_arm_blends_into_a_trajectory_that_begins_at_once() -> None:
    spline = blend(swing(HOME, 0.5, 2.0), moving(0.4), 0.0, YUMI_LIMITS)
    assert_smooth(spline, moving(0.4), 0.0)
    check_motion(spline.segments, joint_names(Side.LEFT), YUMI_LIMITS)


@given(st.floats(0.0, 1.9))
def test_arm_that_is_late_catches_up_without_a_step(late: float) -> None:
    plan = swing(HOME, 0.5, 2.0)
    spline = blend(plan, AT_HOME, late, YUMI_LIMITS)
    check_motion(spline.segments, joint_names(Side.LEFT), YUMI_LIMITS)
    assert SplineSampler(spline).position(late) == pytest.approx(HOME, abs=1e-6)
    assert SplineSampler(spline).position(late + 1.6) == pytest.approx(SplineSampler(plan.spline).position(late + 1.6))


def test_trajectory_that_is_over_is_refused() -> None:
    with refused(TrajectoryRefused, "trajectory_is_over", late=0.5) as caught:
        blend(swing(HOME, 0.5, 2.0), AT_HOME, 2.5, YUMI_LIMITS)
    assert caught.value.code == ResultCode.OLD_HEADER_TIMESTAMP


def test_first_point_at_zero_that_is_elsewhere_is_refused() -> None:
    blend(swing(moved(HOME, 0.9 * START_TOLERANCE), 0.5, 2.0), AT_HOME, 0.0, YUMI_LIMITS)
    place = {"time": 0.0, "joint": "yumi_joint_6_l", "first": HOME[6] + 1.1 * START_TOLERANCE, "position": HOME[6]}
    with refused(TrajectoryRefused, "trajectory_begins_elsewhere", **place):
        blend(swing(moved(HOME, 1.1 * START_TOLERANCE), 0.5, 2.0), AT_HOME, 0.0, YUMI_LIMITS)


def test_trajectory_whose_start_the_arm_has_missed_elsewhere_is_refused() -> None:
    place = {"joint": "yumi_joint_6_l", "now": HOME[6] + 0.25, "since": 1.0, "position": HOME[6] + radians(-5.0)}
    with refused(TrajectoryRefused, "trajectory_is_elsewhere", **place):
        blend(swing(HOME, 0.5, 2.0), Setpoint(moved(HOME, radians(-5.0))), 1.0, YUMI_LIMITS)


def test_first_point_that_cannot_be_reached_in_time_is_refused() -> None:
    excess = {"joint": "yumi_joint_6_l", "quantity": "velocity", "value": 12.5, "time": 0.0}
    with refused(TrajectoryRefused, "trajectory_beyond_limit", **excess):
        blend(planned([TrajectoryPoint(0.04, moved(HOME, 0.5))]), AT_HOME, 0.0, YUMI_LIMITS)


def test_trajectory_that_runs_away_from_a_late_arm_is_refused() -> None:
    weak = replace(YUMI_LIMITS, acceleration=(0.1,) * 7)
    with refused(TrajectoryRefused, "trajectory_too_far_away", duration=1.6):
        blend(swing(HOME, 0.5, 2.0), AT_HOME, 1.0, weak)


@given(st.lists(st.floats(-0.1, 2.5), min_size=2, max_size=8))
def test_joined_way_is_read_at_times_in_any_order(times: list[float]) -> None:
    spline = blend(swing(HOME, 0.5, 2.0), moving(0.4), 0.0, YUMI_LIMITS)
    walk = SplineSampler(spline)
    for time in times:
        assert walk.setpoint(time) == SplineSampler(spline).setpoint(time)
