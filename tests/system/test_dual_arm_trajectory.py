"""Both arms on one trajectory: they start in the same cycle period, follow it together and end together."""

from __future__ import annotations

from itertools import pairwise
from math import radians

import pytest
from dual_arms import NAME, DualArms

from abb_protocols.catalogue import message
from abb_protocols.errors import TrajectoryRefused
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Side
from refusals import assert_says, refused
from trajectories import dual_arm_trajectory, swing
from yumi.control.speed_scale import SpeedFactor
from yumi.control.trajectory_commands import CancelTrajectory, FollowTrajectory, ResultCode, TrajectoryOutcome


@pytest.fixture
def arms() -> DualArms:
    return DualArms()


def is_at_rest(arms: DualArms, side: Side) -> bool:
    return max(map(abs, arms.arms[side].snapshot.velocity)) < 1e-3


def test_both_arms_follow_a_planners_trajectory_within_half_a_degree_and_stay_together(arms: DualArms) -> None:
    arms.send(dual_arm_trajectory())
    arms.run_until(lambda: arms.is_over, 6.0)
    ends = [ended for each in arms.ended.values() for ended in each]
    assert [(each.goal, each.outcome, each.code) for each in ends] == [
        (1, TrajectoryOutcome.SUCCEEDED, ResultCode.SUCCESSFUL),
        (1, TrajectoryOutcome.SUCCEEDED, ResultCode.SUCCESSFUL),
    ]
    for (ended,) in arms.ended.values():
        assert ended.skew is not None
        assert abs(ended.skew.start) < CYCLE
        assert ended.skew.worst < CYCLE


@pytest.mark.parametrize("phase", [0.0, 0.0015, 0.0039])
@pytest.mark.parametrize("is_at_once", [True, False])
def test_both_arms_start_in_the_first_cycle_after_the_goal_whatever_the_phase_of_their_datagrams(
    arms: DualArms, phase: float, is_at_once: bool
) -> None:
    """The skew at the start is that of the datagrams, less than a cycle, and on the way there is none."""
    arms.arms[Side.LEFT].clock.advance(phase)
    arms.run(0.1)
    cycles = {side: len(arm.cycles) for side, arm in arms.arms.items()}
    arms.send(dual_arm_trajectory(), is_at_once=is_at_once)
    arms.run_until(lambda: arms.is_over, 6.0)
    for (ended,) in arms.ended.values():
        assert ended.outcome is TrajectoryOutcome.SUCCEEDED
        assert ended.skew is not None
        assert abs(ended.skew.start) in (pytest.approx(phase, abs=1e-6), pytest.approx(CYCLE - phase, abs=1e-6))
        assert abs(ended.skew.start) < CYCLE
        assert ended.skew.worst < 1e-6
    if is_at_once:
        first = {side: arm.cycles[cycles[side]].state.time for side, arm in arms.arms.items()}
        assert first[Side.LEFT] - first[Side.RIGHT] == pytest.approx(phase, abs=1e-9)


def test_both_arms_stay_together_when_speed_scale_changes_on_the_way(arms: DualArms) -> None:
    arms.arms[Side.LEFT].clock.advance(0.0015)
    for box in arms.scales.values():
        box.write(SpeedFactor(0.5))
    arms.run(0.5)
    arms.send(dual_arm_trajectory())
    arms.run(3.0)
    for box in arms.scales.values():
        box.write(SpeedFactor(0.2))
    arms.run(3.0)
    assert {arms.feedback(side).scale for side in Side} == {0.2}
    for box in arms.scales.values():
        box.write(SpeedFactor(1.0))
    arms.run_until(lambda: arms.is_over, 20.0)
    for (ended,) in arms.ended.values():
        assert (ended.outcome, ended.said) == (TrajectoryOutcome.SUCCEEDED, message("goal_reached"))
        assert ended.skew is not None
        assert abs(ended.skew.start) < CYCLE
        assert ended.skew.worst < 2.0 * CYCLE


def test_skew_is_handed_out_during_the_motion(arms: DualArms) -> None:
    arms.arms[Side.LEFT].clock.advance(0.0015)
    arms.cycle()
    arms.send(dual_arm_trajectory())
    arms.run(2.0)
    assert arms.feedback(Side.RIGHT).skew.start == pytest.approx(-0.0015, abs=1e-6)
    assert arms.feedback(Side.RIGHT).skew.worst < 1e-6


def test_violation_of_one_arm_stops_the_other_too(arms: DualArms) -> None:
    arms.send(dual_arm_trajectory())
    arms.run(2.0)
    arms.arms[Side.LEFT].to_robot = lambda datagram: ()
    arms.run_until(lambda: arms.is_over, 1.0)
    assert {ended[0].code for ended in arms.ended.values()} == {ResultCode.PATH_TOLERANCE_VIOLATED}
    assert arms.ended[Side.RIGHT][0].said == message("other_arm_aborted")
    arms.run(0.5)
    assert is_at_rest(arms, Side.RIGHT)


def test_cancel_of_one_arm_brings_both_to_rest(arms: DualArms) -> None:
    arms.send(dual_arm_trajectory())
    arms.run(2.0)
    arms.order({Side.LEFT: CancelTrajectory(1)})
    arms.run_until(lambda: arms.is_over, 1.0)
    assert {ended[0].outcome for ended in arms.ended.values()} == {TrajectoryOutcome.CANCELED}
    arms.run(0.2)
    assert all(is_at_rest(arms, side) for side in Side)


def test_lost_session_of_one_arm_stops_the_other(arms: DualArms) -> None:
    arms.send(dual_arm_trajectory())
    arms.run(2.0)
    arms.arms[Side.LEFT].to_us = lambda datagram: ()
    arms.run_until(lambda: arms.is_over, 1.0)
    assert {ended[0].outcome for ended in arms.ended.values()} == {TrajectoryOutcome.ABORTED}
    arms.run(0.5)
    assert is_at_rest(arms, Side.RIGHT)


def test_other_arm_brakes_within_its_limits(arms: DualArms) -> None:
    arms.send(dual_arm_trajectory())
    arms.run(2.5)
    arms.arms[Side.LEFT].manager.switch((), (NAME,), arms.arms[Side.LEFT].line.state)
    cycles = arms.arms[Side.RIGHT].cycles
    first = len(cycles)
    arms.run(0.5)
    ways = [cycle.sent.position for cycle in cycles[first - 2 :]]
    speeds = [[(new - old) / CYCLE for old, new in zip(*pair, strict=True)] for pair in pairwise(ways)]
    for before, after in pairwise(speeds):
        for old, new, limit in zip(before, after, YUMI_LIMITS.acceleration, strict=True):
            assert abs(new - old) <= limit * CYCLE * 1.01
    assert is_at_rest(arms, Side.RIGHT)


def test_new_trajectory_replaces_the_one_of_both_arms(arms: DualArms) -> None:
    arms.send(dual_arm_trajectory())
    arms.run(0.3)
    arms.send(dual_arm_trajectory(), goal=2)
    assert not arms.is_over
    arms.run_until(lambda: all(len(each) == 2 for each in arms.ended.values()), 6.0)
    for first, second in arms.ended.values():
        assert (first.goal, first.outcome, first.code) == (1, TrajectoryOutcome.ABORTED, ResultCode.INVALID_GOAL)
        assert (second.goal, second.outcome) == (2, TrajectoryOutcome.SUCCEEDED)


def test_arm_whose_other_arm_never_begins_stops(arms: DualArms) -> None:
    position = arms.arms[Side.LEFT].snapshot.position
    arms.order({Side.LEFT: FollowTrajectory(swing(position, 0.5, 2.0), goal=1)})
    arms.run(0.6)
    (ended,) = arms.ended[Side.LEFT]
    assert_says(ended.said, "other_arm_not_following")
    assert 0.25 <= ended.said.values["silence"] < 0.26
    assert arms.arms[Side.LEFT].snapshot.position == pytest.approx(position, abs=radians(3.0))


def test_trajectory_that_one_arm_refuses_moves_neither(arms: DualArms) -> None:
    elsewhere = dual_arm_trajectory()
    arms.send(elsewhere)
    arms.run_until(lambda: arms.is_over, 6.0)
    with refused(TrajectoryRefused, "trajectory_begins_elsewhere", joint="yumi_joint_1_r", time=0.0) as refusal:
        arms.send(elsewhere, goal=2)
    assert refusal.value.said.values["first"] == pytest.approx(0.0, abs=radians(0.05))
    arms.run(0.2)
    assert all(is_at_rest(arms, side) for side in Side)
