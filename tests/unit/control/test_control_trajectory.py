from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import pytest

from yumi.control.trajectory import (
    MOST_POINTS,
    JointTrajectory,
    ResultCode,
    TrajectoryPoint,
    plan_trajectory,
    time_to_start,
)
from yumi.errors import TrajectoryRefused
from yumi.robot.joints import JOINT_COUNT, YUMI_LIMITS, Side, home, joint_names

RIGHT, LEFT = joint_names(Side.RIGHT), joint_names(Side.LEFT)
HOME = home(Side.RIGHT)
REST = (0.0,) * JOINT_COUNT


def moved(step: float, index: int = 6) -> tuple[float, ...]:
    return tuple(value + step * (number == index) for number, value in enumerate(HOME))


def trajectory(*points: TrajectoryPoint, names: tuple[str, ...] = RIGHT) -> JointTrajectory:
    return JointTrajectory(names, points)


GOOD = trajectory(TrajectoryPoint(0.0, HOME), TrajectoryPoint(1.0, moved(0.5)))


def refusal(bad: JointTrajectory, sides: tuple[Side, ...] = (Side.RIGHT,)) -> tuple[str, int]:
    with pytest.raises(TrajectoryRefused) as caught:
        plan_trajectory(bad, sides, YUMI_LIMITS)
    return str(caught.value).removeprefix("Trajectory refused: "), caught.value.code


def refused_point(point: TrajectoryPoint) -> str:
    sentence, code = refusal(trajectory(GOOD.points[0], point))
    assert code == ResultCode.INVALID_GOAL
    return sentence


def test_plan_puts_joints_in_chain_order() -> None:
    back_to_front = JointTrajectory(RIGHT[::-1], (TrajectoryPoint(1.0, HOME[::-1]),))
    assert plan_trajectory(back_to_front, [Side.RIGHT], YUMI_LIMITS)[Side.RIGHT].first.position == HOME


def test_plan_of_both_arms_gives_each_its_own_joints() -> None:
    both = JointTrajectory((*LEFT, *RIGHT), (TrajectoryPoint(1.0, (*home(Side.LEFT), *HOME)),), start=5.0)
    plans = plan_trajectory(both, tuple(Side), YUMI_LIMITS)
    assert {side: plan.first.position for side, plan in plans.items()} == {side: home(side) for side in Side}
    assert {plan.start for plan in plans.values()} == {5.0}


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        ((), "it names no joints; name yumi_joint_1_r, "),
        ((*RIGHT[:6], RIGHT[0]), "it names the joint 'yumi_joint_1_r' twice; name each once."),
        ((*RIGHT[:6], LEFT[6]), "'yumi_joint_6_l' is not a joint of this controller; its joints are yumi_joint_1_r, "),
        (RIGHT[:5], "it leaves out yumi_joint_5_r, yumi_joint_6_r; all joints must be named."),
    ],
)
def test_trajectory_with_wrong_joints_is_refused(names: tuple[str, ...], sentence: str) -> None:
    told, code = refusal(replace(GOOD, joint_names=names))
    assert told.startswith(sentence)
    assert code == ResultCode.INVALID_JOINTS


@pytest.mark.parametrize(
    ("point", "sentence"),
    [
        (TrajectoryPoint(1.0, ()), "point 2 has no positions; every point has one for each joint."),
        (TrajectoryPoint(1.0, HOME[:6]), "point 2 has 6 positions for 7 joints; give one for each joint, or none."),
        (TrajectoryPoint(1.0, HOME, REST[:3]), "point 2 has 3 velocities for 7 joints; "),
        (TrajectoryPoint(1.0, HOME, REST, (0.0,) * 8), "point 2 has 8 accelerations for 7 joints; "),
        (TrajectoryPoint(1.0, moved(nan)), "point 2 has nan among its positions; all values are finite numbers."),
        (TrajectoryPoint(1.0, HOME, (*REST[:6], -inf)), "point 2 has -inf among its velocities; "),
        (TrajectoryPoint(nan, HOME), "point 2 is due at nan s; a time is a finite number of seconds."),
        (TrajectoryPoint(1.0, HOME, (), REST), "point 2 has accelerations without velocities; give both or neither."),
        (TrajectoryPoint(0.0, HOME), "point 2 is due at 0 s, not after point 1 at 0 s; the times of the points incr"),
        (TrajectoryPoint(1.0, HOME, (0.1, *REST[1:])), "its last point has a velocity; a trajectory ends at rest."),
        (TrajectoryPoint(1e308, HOME), "its last point is due at 1e+308 s; the latest is at 2147483648 s."),
        (TrajectoryPoint(5e-324, HOME), "point 2 is due at 4.94066e-324 s, not after point 1 at 0 s; "),
        (TrajectoryPoint(9.0, moved(4.0)), "point 2 wants yumi_joint_6_r at 229.2°; its range is -229.0° to 229.0°."),
        (
            TrajectoryPoint(9.0, moved(90.0)),
            "point 2 wants yumi_joint_6_r at 5156.6°; its range is -229.0° to 229.0°; 90 looks like degrees.",
        ),
    ],
)
def test_bad_point_is_refused(point: TrajectoryPoint, sentence: str) -> None:
    assert refused_point(point).startswith(sentence)


def test_trajectory_without_points_is_refused() -> None:
    assert refusal(trajectory())[0] == "it has no points; to stop a motion, cancel its goal."


def test_trajectory_that_begins_before_its_start_is_refused() -> None:
    early = trajectory(TrajectoryPoint(-0.1, HOME))
    assert refusal(early)[0] == "point 1 is due at -0.1 s; time_from_start is 0 s or later."


def test_trajectory_that_starts_at_no_time_is_refused() -> None:
    assert refusal(replace(GOOD, start=nan))[0] == "its start is nan; a time is a finite number of seconds."


def test_trajectory_faster_than_a_joint_is_refused() -> None:
    assert refused_point(TrajectoryPoint(0.1, moved(0.7))) == (
        "yumi_joint_6_r would have the velocity 7.00 rad/s at 0.000 s; its limit is 6.98 rad/s; give it more time."
    )


def test_trajectory_that_accelerates_too_much_is_refused() -> None:
    hasty = trajectory(TrajectoryPoint(0.0, HOME, REST), TrajectoryPoint(0.5, moved(1.7), REST))
    assert refusal(hasty)[0] == (
        "yumi_joint_6_r would have the acceleration 40.80 rad/s² at 0.000 s; its limit is 40.00 rad/s²; "
        "give it more time."
    )


def test_trajectory_that_leaves_a_range_between_its_points_is_refused() -> None:
    edge = TrajectoryPoint(1.0, moved(3.9), (*REST[:6], -2.0))
    swing = trajectory(TrajectoryPoint(0.0, moved(3.9), REST), edge, TrajectoryPoint(2.0, HOME, REST))
    assert refusal(swing)[0] == (
        "yumi_joint_6_r would be at 240.4° at 0.667 s, between two points; its range is -229.0° to 229.0°."
    )


@pytest.mark.parametrize("value", [1e308, -1e308, 1e5, 40.1])
def test_acceleration_beyond_a_joints_limit_is_refused_at_the_point_that_has_it(value: float) -> None:
    mad = trajectory(TrajectoryPoint(0.0, HOME, REST, (*REST[:6], value)), TrajectoryPoint(1.0, HOME, REST, REST))
    assert refusal(mad)[0] == (
        f"point 1 wants yumi_joint_6_r to accelerate with {value:.4g} rad/s²; its limit is 40.00 rad/s²; "
        "give it more time."
    )


def test_velocity_beyond_all_numbers_is_refused() -> None:
    mad = trajectory(TrajectoryPoint(0.0, HOME, (*REST[:6], 1e308)), TrajectoryPoint(1.0, HOME, REST))
    assert refusal(mad)[0] == (
        "point 1 wants yumi_joint_6_r to move with 1e+308 rad/s; its limit is 6.98 rad/s; give it more time."
    )


def long_trajectory(points: int) -> JointTrajectory:
    """Back and forth by a tenth of a degree, 50 points a second."""
    return trajectory(*(TrajectoryPoint(0.02 * number, moved(0.002 * (number % 2))) for number in range(points)))


def test_twenty_thousand_points_are_taken_and_one_more_is_refused() -> None:
    plan = plan_trajectory(long_trajectory(MOST_POINTS), [Side.RIGHT], YUMI_LIMITS)[Side.RIGHT]
    assert len(plan.spline.segments) == MOST_POINTS - 1
    assert refusal(long_trajectory(MOST_POINTS + 1))[0] == (
        "it has 20001 points; at most 20000 are taken: leave out points, or send it in several goals."
    )


def test_both_arms_start_a_long_trajectory_later_so_that_each_has_it_by_then() -> None:
    assert time_to_start(2) == time_to_start(3000) == 0.1
    assert time_to_start(MOST_POINTS) == pytest.approx(0.6)
