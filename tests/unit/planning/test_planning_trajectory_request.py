from __future__ import annotations

from dataclasses import replace
from math import inf, nan, radians
from typing import Any

import pytest

from abb_protocols.errors import TrajectoryRefused
from abb_protocols.robot.joints import JOINT_COUNT, YUMI_LIMITS, Side, home, joint_names
from refusals import refused
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.trajectory_commands import ResultCode
from yumi.planning.common_time import time_to_start
from yumi.planning.trajectory_request import MOST_POINTS, JointTrajectory, plan_trajectory

RIGHT, LEFT = joint_names(Side.RIGHT), joint_names(Side.LEFT)
HOME = home(Side.RIGHT)
REST = (0.0,) * JOINT_COUNT
RANGE = {"lower": YUMI_LIMITS.lower[6], "upper": YUMI_LIMITS.upper[6]}


def moved(step: float, index: int = 6) -> tuple[float, ...]:
    return tuple(value + step * (number == index) for number, value in enumerate(HOME))


def trajectory(*points: TrajectoryPoint, names: tuple[str, ...] = RIGHT) -> JointTrajectory:
    return JointTrajectory(names, points)


GOOD = trajectory(TrajectoryPoint(0.0, HOME), TrajectoryPoint(1.0, moved(0.5)))


def assert_refused(bad: JointTrajectory, code: str, result: int = ResultCode.INVALID_GOAL, **values: Any) -> None:
    with refused(TrajectoryRefused, code, **values) as caught:
        plan_trajectory(bad, (Side.RIGHT,), YUMI_LIMITS)
    assert caught.value.code == result


def test_plan_puts_joints_in_chain_order() -> None:
    back_to_front = JointTrajectory(RIGHT[::-1], (TrajectoryPoint(1.0, HOME[::-1]),))
    assert plan_trajectory(back_to_front, [Side.RIGHT], YUMI_LIMITS)[Side.RIGHT].first.position == HOME


def test_plan_of_both_arms_gives_each_its_own_joints() -> None:
    both = JointTrajectory((*LEFT, *RIGHT), (TrajectoryPoint(1.0, (*home(Side.LEFT), *HOME)),), start=5.0)
    plans = plan_trajectory(both, tuple(Side), YUMI_LIMITS)
    assert {side: plan.first.position for side, plan in plans.items()} == {side: home(side) for side in Side}
    assert {plan.start for plan in plans.values()} == {5.0}


@pytest.mark.parametrize(
    ("names", "code", "values"),
    [
        ((), "trajectory_without_joints", {"joints": RIGHT}),
        ((*RIGHT[:6], RIGHT[0]), "trajectory_joint_twice", {"joint": "yumi_joint_1_r"}),
        ((*RIGHT[:6], LEFT[6]), "trajectory_joint_unknown", {"joint": "yumi_joint_6_l", "joints": RIGHT}),
        (RIGHT[:5], "trajectory_joints_missing", {"missing": ("yumi_joint_5_r", "yumi_joint_6_r")}),
    ],
)
def test_trajectory_with_wrong_joints_is_refused(names: tuple[str, ...], code: str, values: dict[str, Any]) -> None:
    assert_refused(replace(GOOD, joint_names=names), code, ResultCode.INVALID_JOINTS, **values)


@pytest.mark.parametrize(
    ("point", "code", "values"),
    [
        (TrajectoryPoint(1.0, ()), "point_without_positions", {"point": 2}),
        (
            TrajectoryPoint(1.0, HOME[:6]),
            "point_value_count",
            {"point": 2, "count": 6, "quantity": "positions", "joints": 7},
        ),
        (TrajectoryPoint(1.0, HOME, REST[:3]), "point_value_count", {"point": 2, "count": 3, "quantity": "velocities"}),
        (
            TrajectoryPoint(1.0, HOME, REST, (0.0,) * 8),
            "point_value_count",
            {"point": 2, "count": 8, "quantity": "accelerations"},
        ),
        (
            TrajectoryPoint(1.0, moved(nan)),
            "point_value_not_finite",
            {"point": 2, "value": "nan", "quantity": "positions"},
        ),
        (
            TrajectoryPoint(1.0, HOME, (*REST[:6], -inf)),
            "point_value_not_finite",
            {"point": 2, "value": "-inf", "quantity": "velocities"},
        ),
        (TrajectoryPoint(nan, HOME), "point_time_not_finite", {"point": 2, "time": "nan"}),
        (TrajectoryPoint(1.0, HOME, (), REST), "point_without_velocities", {"point": 2}),
        (
            TrajectoryPoint(0.0, HOME),
            "trajectory_times_not_increasing",
            {"point": 2, "time": 0.0, "before": 1, "time_before": 0.0},
        ),
        (TrajectoryPoint(1.0, HOME, (0.1, *REST[1:])), "trajectory_ends_in_motion", {}),
        (TrajectoryPoint(1e308, HOME), "trajectory_ends_too_late", {"time": 1e308, "latest": 2147483648.0}),
        (TrajectoryPoint(5e-324, HOME), "trajectory_times_not_increasing", {"point": 2, "time": 5e-324, "before": 1}),
        (
            TrajectoryPoint(9.0, moved(4.0)),
            "point_out_of_range",
            {"point": 2, "joint": "yumi_joint_6_r", "position": HOME[6] + 4.0, **RANGE},
        ),
        (
            TrajectoryPoint(9.0, moved(90.0)),
            "point_in_degrees",
            {"point": 2, "joint": "yumi_joint_6_r", "position": HOME[6] + 90.0, **RANGE},
        ),
    ],
)
def test_bad_point_is_refused(point: TrajectoryPoint, code: str, values: dict[str, Any]) -> None:
    assert_refused(trajectory(GOOD.points[0], point), code, **values)


def test_trajectory_without_points_is_refused() -> None:
    assert_refused(trajectory(), "trajectory_without_points")


def test_trajectory_that_begins_before_its_start_is_refused() -> None:
    assert_refused(trajectory(TrajectoryPoint(-0.1, HOME)), "trajectory_begins_too_early", time=-0.1)


def test_trajectory_that_starts_at_no_time_is_refused() -> None:
    assert_refused(replace(GOOD, start=nan), "trajectory_start_not_finite", start="nan")


def test_trajectory_faster_than_a_joint_is_refused() -> None:
    assert_refused(
        trajectory(GOOD.points[0], TrajectoryPoint(0.1, moved(0.7))),
        "trajectory_beyond_limit",
        joint="yumi_joint_6_r",
        quantity="velocity",
        unit="rad/s",
        value=7.0,
        time=0.0,
        limit=YUMI_LIMITS.velocity[6],
    )


def test_trajectory_that_accelerates_too_much_is_refused() -> None:
    hasty = trajectory(TrajectoryPoint(0.0, HOME, REST), TrajectoryPoint(0.5, moved(1.7), REST))
    assert_refused(
        hasty,
        "trajectory_beyond_limit",
        joint="yumi_joint_6_r",
        quantity="acceleration",
        unit="rad/s²",
        value=40.8,
        time=0.0,
        limit=40.0,
    )


def test_trajectory_that_leaves_a_range_between_its_points_is_refused() -> None:
    edge = TrajectoryPoint(1.0, moved(3.9), (*REST[:6], -2.0))
    swing = trajectory(TrajectoryPoint(0.0, moved(3.9), REST), edge, TrajectoryPoint(2.0, HOME, REST))
    with refused(TrajectoryRefused, "trajectory_leaves_range", joint="yumi_joint_6_r", **RANGE) as caught:
        plan_trajectory(swing, (Side.RIGHT,), YUMI_LIMITS)
    values = caught.value.said.values
    assert (values["position"], values["time"]) == pytest.approx((radians(240.4), 0.667), abs=1e-3)


@pytest.mark.parametrize("value", [1e308, -1e308, 1e5, 40.1])
def test_acceleration_beyond_a_joints_limit_is_refused_at_the_point_that_has_it(value: float) -> None:
    mad = trajectory(TrajectoryPoint(0.0, HOME, REST, (*REST[:6], value)), TrajectoryPoint(1.0, HOME, REST, REST))
    assert_refused(
        mad,
        "point_beyond_limit",
        point=1,
        joint="yumi_joint_6_r",
        quantity="acceleration",
        value=value,
        limit=40.0,
        unit="rad/s²",
    )


def test_velocity_beyond_all_numbers_is_refused() -> None:
    mad = trajectory(TrajectoryPoint(0.0, HOME, (*REST[:6], 1e308)), TrajectoryPoint(1.0, HOME, REST))
    assert_refused(
        mad,
        "point_beyond_limit",
        point=1,
        joint="yumi_joint_6_r",
        quantity="velocity",
        value=1e308,
        limit=YUMI_LIMITS.velocity[6],
        unit="rad/s",
    )


def long_trajectory(points: int) -> JointTrajectory:
    """Back and forth by a tenth of a degree, 50 points a second."""
    return trajectory(*(TrajectoryPoint(0.02 * number, moved(0.002 * (number % 2))) for number in range(points)))


def test_twenty_thousand_points_are_taken_and_one_more_is_refused() -> None:
    plan = plan_trajectory(long_trajectory(MOST_POINTS), [Side.RIGHT], YUMI_LIMITS)[Side.RIGHT]
    assert len(plan.spline.segments) == MOST_POINTS - 1
    assert_refused(long_trajectory(MOST_POINTS + 1), "trajectory_too_long", points=20001, most=20000)


def test_both_arms_start_a_long_trajectory_later_so_that_each_has_it_by_then() -> None:
    assert time_to_start(2) == time_to_start(3000) == 0.1
    assert time_to_start(MOST_POINTS) == pytest.approx(0.6)
