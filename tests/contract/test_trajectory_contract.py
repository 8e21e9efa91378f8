"""What every arm must let a trajectory controller do: the perfect arm in memory and the virtual arm over the wire."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import isfinite, nan, radians
from sys import getrefcount

import pytest
from trajectory_arms import NAME, SIDE, TrajectoryArm, perfect_arm, virtual_arm

from abb_protocols.errors import CommandRefused, TrajectoryRefused
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, home, joint_names, joints
from refusals import assert_says, refused
from trajectories import REST, dual_arm_trajectory, moved, planned, swing
from yumi.control.cycle import Cycle
from yumi.control.motion.spline import TrajectoryPoint, spline_through
from yumi.control.trajectory_commands import (
    UNLIMITED_TOLERANCE,
    ArmPlan,
    CancelTrajectory,
    FollowTrajectory,
    ResultCode,
    ScaleSpeed,
    Tolerances,
    TrajectoryOutcome,
)
from yumi.planning.trajectory_request import JointTrajectory, plan_trajectory

HOME = home(SIDE)
HALF_A_DEGREE = joints([radians(0.5)] * 7)
CLOSE = Tolerances(path=HALF_A_DEGREE, goal=HALF_A_DEGREE, goal_time=1.0)
INVALID = (TrajectoryOutcome.ABORTED, ResultCode.INVALID_GOAL)


@pytest.fixture(params=[perfect_arm, virtual_arm], ids=["perfect arm", "virtual arm"])
def arm(request: pytest.FixtureRequest) -> TrajectoryArm:
    make: Callable[[], TrajectoryArm] = request.param
    return make()


def assert_within_limits(cycles: list[Cycle]) -> None:
    """No step in the admitted command: speeds and accelerations within the limits."""
    ways = [cycle.sent.position for cycle in cycles]
    speeds = [[(new - old) / CYCLE for old, new in zip(*pair, strict=True)] for pair in pairwise(ways)]
    for before, after in pairwise(speeds):
        for index, (old, new) in enumerate(zip(before, after, strict=True)):
            assert abs(new) <= YUMI_LIMITS.velocity[index] * 1.001
            assert abs(new - old) <= YUMI_LIMITS.acceleration[index] * CYCLE * 1.01


def test_goal_is_reached_within_half_a_degree_all_the_way(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 1.0, 1.5), tolerances=CLOSE)
    end = arm.end()
    assert (end.goal, end.outcome, end.code) == (1, TrajectoryOutcome.SUCCEEDED, ResultCode.SUCCESSFUL)
    assert arm.position == pytest.approx(moved(HOME, 1.0), abs=radians(0.1))


def test_planners_trajectory_is_followed_within_half_a_degree(arm: TrajectoryArm) -> None:
    both = dual_arm_trajectory()
    columns = [both.joint_names.index(name) for name in joint_names(SIDE)]
    points = [
        TrajectoryPoint(point.time, *(tuple(row[column] for column in columns) for row in point[1:]))
        for point in both.points
    ]
    arm.follow(planned(points), tolerances=CLOSE)
    assert arm.end().code == ResultCode.SUCCESSFUL


def test_arm_stays_at_the_end(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 0.5, 1.0))
    arm.end()
    for cycle in arm.run(0.5)[50:]:
        assert cycle.state.position == pytest.approx(moved(HOME, 0.5), abs=1e-4)


def test_arm_that_nobody_orders_stays(arm: TrajectoryArm) -> None:
    for cycle in arm.run(0.5):
        assert cycle.state.position == pytest.approx(HOME, abs=1e-6)


@pytest.mark.parametrize("fields", [1, 2, 3], ids=["linear", "cubic", "quintic"])
def test_spline_order_is_that_of_what_is_given(arm: TrajectoryArm, fields: int) -> None:
    there = (0.0, moved(HOME, 0.6), REST, REST)
    points = [TrajectoryPoint(0.0, *(HOME, REST, REST)[:fields]), TrajectoryPoint(2.0, *there[1:][:fields])]
    arm.follow(planned(points))
    arm.run(0.5)
    u = arm.feedback.progress / 2.0
    share = {1: u, 2: 3.0 * u**2 - 2.0 * u**3, 3: 10.0 * u**3 - 15.0 * u**4 + 6.0 * u**5}[fields]
    assert arm.feedback.desired[6] == pytest.approx(0.6 * share, abs=1e-9)


def test_way_outside_of_the_path_tolerance_ends_the_motion(arm: TrajectoryArm) -> None:
    arm.set({"lookahead": 0.1})
    arm.follow(swing(HOME, 1.0, 1.5), tolerances=CLOSE)
    end = arm.end()
    assert (end.outcome, end.code) == (TrajectoryOutcome.ABORTED, ResultCode.PATH_TOLERANCE_VIOLATED)
    assert_says(end.said, "joint_off_trajectory", joint="yumi_joint_6_l", tolerance=radians(0.5))
    assert abs(end.said.values["distance"]) > radians(0.5)


def test_path_velocity_tolerance_bites(arm: TrajectoryArm) -> None:
    arm.set({"lookahead": 0.1})
    arm.follow(swing(HOME, 1.0, 1.5), tolerances=Tolerances(path_velocity=joints([0.01] * 7)))
    end = arm.end()
    assert end.code == ResultCode.PATH_TOLERANCE_VIOLATED
    assert_says(end.said, "joint_off_speed", tolerance=0.01)


def test_goal_that_is_not_reached_in_time_ends_the_motion() -> None:
    arm = virtual_arm()  # the perfect one reaches every goal
    arm.set({f"constraints.{joint_names(SIDE)[6]}.goal": 1e-15, "constraints.goal_time": 0.2})
    arm.follow(swing(HOME, 0.3333, 1.0))
    end = arm.end(3.0)
    assert (end.outcome, end.code) == (TrajectoryOutcome.ABORTED, ResultCode.GOAL_TOLERANCE_VIOLATED)
    assert_says(end.said, "joint_off_goal", joint=joint_names(SIDE)[6], tolerance=1e-15)
    assert end.said.values["late"] == pytest.approx(0.2, abs=0.005)


def test_goal_time_of_zero_waits_for_ever() -> None:
    arm = virtual_arm()
    arm.set({f"constraints.{joint_names(SIDE)[6]}.goal": 1e-15})
    arm.follow(swing(HOME, 0.3333, 0.5))
    arm.run(5.0)
    assert arm.ended == []


def test_unlimited_tolerance_takes_back_the_controllers_own(arm: TrajectoryArm) -> None:
    arm.set({f"constraints.{name}.trajectory": 1e-9 for name in joint_names(SIDE)})
    arm.follow(swing(HOME, 0.5, 1.0), tolerances=Tolerances(path=joints([UNLIMITED_TOLERANCE] * 7)))
    assert arm.end().code == ResultCode.SUCCESSFUL


def test_cancel_brings_the_arm_to_rest_within_its_limits(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 2.0, 2.0))
    arm.run(1.0)
    arm.order(CancelTrajectory(1))
    first = len(arm.loop.cycles)
    end = arm.end(1.0)
    assert (end.outcome, end.code) == (TrajectoryOutcome.CANCELED, ResultCode.SUCCESSFUL)
    arm.run(0.3)
    assert max(map(abs, arm.velocity)) < 1e-3
    assert_within_limits(arm.loop.cycles[first - 2 :])


def test_cancel_brakes_no_harder_than_it_is_told(arm: TrajectoryArm) -> None:
    arm.set({f"constraints.{joint_names(SIDE)[6]}.max_deceleration_on_cancel": 2.0})
    arm.follow(swing(HOME, 2.0, 2.0))
    arm.run(1.0)
    arm.order(CancelTrajectory())
    begin = arm.now
    arm.end(3.0)
    assert arm.now - begin > 1.875 / 2.0


def test_cancel_of_another_goal_changes_nothing(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 0.5, 1.0))
    arm.order(CancelTrajectory(7))
    assert arm.end().outcome is TrajectoryOutcome.SUCCEEDED


def test_new_trajectory_replaces_the_old_one_without_a_step(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 2.0, 2.0))
    arm.run(1.0)
    first = len(arm.loop.cycles)
    arm.follow(planned([TrajectoryPoint(1.0, HOME, REST)]), goal=2)
    assert (arm.end().goal, (arm.ended[0].outcome, arm.ended[0].code)) == (1, INVALID)
    assert (arm.end().goal, arm.ended[1].outcome) == (2, TrajectoryOutcome.SUCCEEDED)
    assert_within_limits(arm.loop.cycles[first - 2 :])


def test_trajectory_may_replace_one_that_is_being_cancelled(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 2.0, 2.0))
    arm.run(1.0)
    arm.order(CancelTrajectory(1))
    arm.run(0.05)
    first = len(arm.loop.cycles)
    arm.follow(planned([TrajectoryPoint(1.0, HOME, REST)]), goal=2)
    arm.run(1.5)
    assert [(end.goal, end.outcome) for end in arm.ended] == [
        (1, TrajectoryOutcome.ABORTED),
        (2, TrajectoryOutcome.SUCCEEDED),
    ]
    assert_within_limits(arm.loop.cycles[first - 2 :])


@pytest.mark.parametrize(
    "tolerances",
    [
        Tolerances(path=(nan, *REST[1:])),
        Tolerances(path_velocity=(nan, *REST[1:])),
        Tolerances(goal=(*REST[:6], nan)),
        Tolerances(goal_velocity=(*REST[:6], nan)),
        Tolerances(goal_time=nan),
    ],
)
def test_tolerance_that_is_no_number_is_refused(tolerances: Tolerances) -> None:
    arm = perfect_arm()
    with refused(TrajectoryRefused, "tolerance_not_a_number"):
        arm.follow(swing(HOME, 1.0, 2.0), tolerances=tolerances)


def test_controller_gives_a_trajectory_back_when_it_is_deactivated() -> None:
    arm = perfect_arm()
    plan = swing(HOME, 1.0, 2.0)
    pieces = plan.spline.segments
    before = getrefcount(pieces)
    arm.follow(plan)
    arm.run(0.1)
    assert getrefcount(pieces) > before
    arm.loop.manager.switch((), (NAME,), arm.loop.line.state)
    arm.run(0.1)
    assert getrefcount(pieces) == before


def test_speed_scaling_slows_the_motion_on_its_way(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 1.0, 2.0), tolerances=CLOSE)
    arm.run(0.5)
    arm.order(ScaleSpeed(0.5))
    begin = arm.now
    assert arm.end().outcome is TrajectoryOutcome.SUCCEEDED
    assert arm.now - begin == pytest.approx(3.0, abs=0.3)


def test_speed_scaling_of_zero_lets_the_arm_stand_until_it_goes_on(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 1.0, 2.0), tolerances=CLOSE)
    arm.run(1.0)
    arm.order(ScaleSpeed(0.0))
    arm.run(1.0)
    assert max(map(abs, arm.velocity)) < 1e-3
    arm.order(ScaleSpeed(1.0))
    assert arm.end().outcome is TrajectoryOutcome.SUCCEEDED


def test_parameter_that_is_set_leaves_the_speed_scale_alone(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 1.0, 2.0), tolerances=CLOSE)
    arm.order(ScaleSpeed(0.0))
    arm.run(1.0)
    arm.set({"constraints.goal_time": 5.0})
    place = arm.position
    assert arm.run(0.5)[-1].state.position == pytest.approx(place, abs=1e-4)


def test_stamp_in_the_future_is_waited_for(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 0.5, 1.0, start=arm.now + 0.5))
    assert arm.run(0.4)[-1].state.position == pytest.approx(HOME, abs=1e-6)
    assert arm.end().outcome is TrajectoryOutcome.SUCCEEDED
    assert arm.now == pytest.approx(arm.loop.cycles[0].state.time + 1.6, abs=0.1)


def test_stamp_that_is_partly_past_is_caught_up_with_without_a_step(arm: TrajectoryArm) -> None:
    first = len(arm.loop.cycles)
    arm.follow(swing(HOME, 0.5, 2.0, start=arm.now - 0.4), tolerances=CLOSE)
    assert arm.end(2.0).outcome is TrajectoryOutcome.SUCCEEDED
    assert_within_limits(arm.loop.cycles[first - 2 :])


def test_stamp_that_is_wholly_past_is_refused(arm: TrajectoryArm) -> None:
    with refused(TrajectoryRefused, "trajectory_is_over") as caught:
        arm.follow(swing(HOME, 0.5, 1.0, start=arm.now - 1.5))
    assert caught.value.said.values["late"] == pytest.approx(0.5, abs=5e-4)
    assert caught.value.code == ResultCode.OLD_HEADER_TIMESTAMP


def test_refused_trajectory_does_not_disturb_the_motion(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 0.5, 1.0), tolerances=CLOSE)
    arm.run(0.4)
    place = {"time": 0.0, "joint": "yumi_joint_6_l", "first": HOME[6] + 1.0}
    with refused(TrajectoryRefused, "trajectory_begins_elsewhere", **place):
        arm.follow(swing(moved(HOME, 1.0), 0.5, 1.0), goal=2)
    assert (arm.end().goal, arm.ended[0].outcome) == (1, TrajectoryOutcome.SUCCEEDED)


def test_plan_for_the_other_arm_is_refused(arm: TrajectoryArm) -> None:
    other = JointTrajectory(joint_names(Side.RIGHT), (TrajectoryPoint(1.0, home(Side.RIGHT)),))
    plan = plan_trajectory(other, (Side.RIGHT,), YUMI_LIMITS)[Side.RIGHT]
    with refused(TrajectoryRefused, "trajectory_of_other_arm", arm="right", own_arm="left"):
        arm.follow(plan)


def test_orders_it_does_not_know_are_refused(arm: TrajectoryArm) -> None:
    kind = "joint_trajectory_controller/JointTrajectoryController"
    with refused(CommandRefused, "command_of_other_controller", type=kind, command="str"):
        arm.order("home")
    with refused(CommandRefused, "speed_scaling_factor_out_of_range", factor=1.5):
        arm.order(ScaleSpeed(1.5))


def test_deactivated_controller_ends_its_motion(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 0.5, 1.0))
    arm.run(0.5)
    arm.loop.manager.switch((), (NAME,), arm.loop.line.state)
    end = arm.end(0.1)
    assert (end.outcome, end.code) == INVALID
    assert_says(end.said, "controller_deactivated")
    assert arm.feedback.goal == 0


def test_feedback_says_that_a_motion_is_over_before_its_end_is_reported(arm: TrajectoryArm) -> None:
    """A client that asks for the next motion at once must not be told that the arm still moves."""
    arm.set({"state_publish_rate": 1.0})
    arm.follow(swing(HOME, 0.2, 1.0))
    arm.run(0.2)
    assert arm.feedback.goal == 1
    assert arm.end().outcome is TrajectoryOutcome.SUCCEEDED
    assert arm.feedback.goal == 0


def test_controller_that_is_activated_again_holds(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 0.5, 1.0))
    arm.run(0.5)
    arm.loop.manager.switch((), (NAME,), arm.loop.line.state)
    arm.loop.manager.switch((NAME,), (), arm.loop.line.state)
    arm.run(0.5)
    assert max(map(abs, arm.velocity)) < 1e-3


def test_controller_that_takes_over_a_moving_arm_takes_no_trajectory_until_it_stands(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 2.0, 2.0))
    arm.run(1.0)
    arm.loop.manager.switch((), (NAME,), arm.loop.line.state)
    arm.loop.manager.switch((NAME,), (), arm.loop.line.state)
    with refused(TrajectoryRefused, "trajectory_while_arm_moves"):
        arm.follow(planned([TrajectoryPoint(1.0, HOME, REST)]), goal=2)
    arm.run(0.5)
    arm.follow(planned([TrajectoryPoint(2.0, HOME, REST)]), goal=2)
    arm.end()
    assert (arm.ended[-1].goal, arm.ended[-1].outcome) == (2, TrajectoryOutcome.SUCCEEDED)


def test_feedback_tells_what_is_desired_and_what_is(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 1.0, 2.0))
    arm.run(1.0)
    feedback = arm.feedback
    assert feedback.goal == 1
    assert feedback.actual == pytest.approx(feedback.desired, abs=radians(0.1))
    assert feedback.actual_velocity[6] == pytest.approx(feedback.desired_velocity[6], abs=0.05)


def test_check_alone_changes_nothing(arm: TrajectoryArm) -> None:
    arm.loop.manager.check(NAME, FollowTrajectory(swing(HOME, 0.5, 1.0), 1), arm.loop.line.state)
    assert arm.run(0.2)[-1].state.position == pytest.approx(HOME, abs=1e-6)


def only_axis(index: int, to: float, seconds: float, arm: TrajectoryArm) -> FollowTrajectory:
    """A command that names one joint; the others are where they are commanded to be."""
    reference = arm.loop.manager.reference
    assert reference is not None
    partial = JointTrajectory((joint_names(SIDE)[index],), (TrajectoryPoint(seconds, (to,)),))
    return FollowTrajectory(plan_trajectory(partial, [SIDE], YUMI_LIMITS, {SIDE: reference})[SIDE], 2)


def test_joints_that_a_goal_leaves_out_hold_where_that_is_allowed(arm: TrajectoryArm) -> None:
    order = only_axis(6, HOME[6] + 0.5, 1.0, arm)
    with refused(TrajectoryRefused, "trajectory_is_partial", missing=joint_names(SIDE)[:6]):
        arm.order(order)
    arm.set({"allow_partial_joints_goal": True})
    arm.order(order)
    assert arm.end().outcome is TrajectoryOutcome.SUCCEEDED
    arm.run(0.5)
    assert arm.position == pytest.approx(moved(HOME, 0.5), abs=radians(0.1))


def test_joint_that_a_goal_leaves_out_in_motion_comes_to_rest_within_its_limits(arm: TrajectoryArm) -> None:
    arm.set({"allow_partial_joints_goal": True})
    arm.follow(swing(HOME, 1.0, 2.0))
    arm.run(0.8)
    held = arm.loop.manager.reference
    assert held is not None
    arm.order(only_axis(5, HOME[5] + 0.2, 1.0, arm))
    arm.run(1.5)
    assert [end.outcome for end in arm.ended] == [TrajectoryOutcome.ABORTED, TrajectoryOutcome.SUCCEEDED]
    assert arm.position == pytest.approx((*held[:5], HOME[5] + 0.2, held[6]), abs=radians(0.2))
    assert_within_limits(arm.loop.cycles)


def test_state_is_published_at_its_rate_with_what_was_sent(arm: TrajectoryArm) -> None:
    arm.follow(swing(HOME, 0.5, 2.5))
    begin = arm.feedback_count
    cycles = arm.run(2.0)
    assert arm.feedback_count - begin == pytest.approx(100, abs=2)
    (cycle,) = [each for each in cycles if each.state.time == arm.feedback.time]
    assert arm.feedback.output == pytest.approx(cycle.desired.position, abs=1e-12)
    assert arm.feedback.output_velocity == pytest.approx(cycle.desired.velocity, abs=1e-12)
    assert arm.feedback.monitor_period == pytest.approx(0.05)


FAULTY = {
    "too fast": [(0.0, HOME), (0.5, moved(HOME, 0.1)), (0.51, moved(HOME, 1.5)), (1.5, moved(HOME, 1.5))],
    "not a number": [(0.0, HOME), (0.5, moved(HOME, 0.1)), (1.0, moved(HOME, nan)), (1.5, HOME)],
    "times not in order": [(0.0, HOME), (0.5, moved(HOME, 0.1)), (0.2, moved(HOME, -0.5)), (1.5, HOME)],
}


@pytest.mark.parametrize("points", FAULTY.values(), ids=FAULTY)
def test_plan_whose_fault_was_overlooked_moves_no_joint_beyond_its_limits(
    arm: TrajectoryArm, points: list[tuple[float, Joints]]
) -> None:
    through = [TrajectoryPoint(time, position) for time, position in points]
    arm.follow(ArmPlan(SIDE, through[0], spline_through(through), None))
    assert_within_limits(arm.run(2.5))
    assert all(isfinite(value) for cycle in arm.loop.cycles for value in cycle.sent.position)


@pytest.mark.parametrize("fault", ["too fast", "not a number"])
def test_plan_whose_fault_was_overlooked_ends_when_it_comes_to_the_fault(arm: TrajectoryArm, fault: str) -> None:
    through = [TrajectoryPoint(time, position) for time, position in FAULTY[fault]]
    arm.follow(ArmPlan(SIDE, through[0], spline_through(through), None))
    end = arm.end()
    assert (end.outcome, end.code) == INVALID
    assert_says(end.said, "trajectory_beyond_limit" if fault == "too fast" else "trajectory_leaves_range")
