"""What every arm must let a trajectory controller do with chunks: the perfect arm in memory and the virtual one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf

import numpy as np
import pytest
from trajectory_arms import NAME, SIDE, TrajectoryArm, perfect_arm, virtual_arm

from abb_protocols.errors import TrajectoryRefused
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, home
from cartesian_bench import shares
from refusals import refused
from trajectories import REST, moved, planned
from yumi.control.chunk_commands import ChunksExhausted, ChunkTaken, FollowChunk
from yumi.control.cycle import Cycle
from yumi.control.loop_events import ControllerReport
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.trajectory_commands import CancelTrajectory, ScaleSpeed, TrajectoryOutcome
from yumi.planning.chunk_plan import plan_chunk

HOME = home(SIDE)
RATE = 20.0
EXACT = 1.0 + 1e-5


@pytest.fixture(params=[perfect_arm, virtual_arm], ids=["perfect arm", "virtual arm"])
def arm(request: pytest.FixtureRequest) -> TrajectoryArm:
    make: Callable[[], TrajectoryArm] = request.param
    return make()


def wave(time: float, off: float = 0.0) -> Joints:
    """Where the policy wants the arm: from rest at home to and back."""
    return moved(HOME, off + 0.25 * (1.0 - np.cos(2.0 * time)))


def send(
    arm: TrajectoryArm, begin: float, first: float = 0.0, count: int = 20, off: float = 0.0, number: int = 1
) -> ChunkTaken:
    """Points of the wave from its time ``first`` on, due from ``begin`` on [s]."""
    times = [each / RATE for each in range(count)]
    positions = np.array([wave(first + each, off) for each in times])
    spline = plan_chunk(SIDE, times, positions, YUMI_LIMITS)
    taken = arm.loop.manager.receive(NAME, FollowChunk(number, begin, spline), arm.loop.line.state)
    assert isinstance(taken, ChunkTaken)
    return taken


def exhausted(arm: TrajectoryArm) -> list[ChunksExhausted]:
    reports = (event.report for event in arm.loop.events if isinstance(event, ControllerReport))
    return [report for report in reports if isinstance(report, ChunksExhausted)]


def desired(cycles: Sequence[Cycle]) -> np.ndarray:
    return np.array([each.desired.position for each in cycles if each.desired is not None])


def test_chunk_is_followed_in_time(arm: TrajectoryArm) -> None:
    begin = arm.now
    taken = send(arm, begin)
    assert taken.replaced == 0
    assert taken.until == pytest.approx(begin + 0.95)
    for cycle in arm.run(0.9)[round(0.5 / CYCLE) :]:
        assert cycle.state.position == pytest.approx(wave(cycle.state.time - begin), abs=2e-3)


def test_newer_chunk_replaces_what_has_not_been_executed(arm: TrajectoryArm) -> None:
    begin = arm.now
    first = send(arm, begin)
    assert first.late in (1, 2)  # the arm gets its first command when the first point is due: it is behind by its delay
    arm.run(0.4)
    second = send(arm, begin + 0.2, 0.2, number=2)
    assert (second.late, second.replaced) == (5, 20 - 9)  # both know the points of 0.2 to 0.4 s, which lie behind
    assert second.seam == pytest.approx(arm.now + arm_lookahead(arm))
    assert second.joined == pytest.approx(second.seam + 0.1)
    cycles = arm.run(0.6)
    assert cycles[-1].state.position == pytest.approx(wave(arm.now - begin), abs=2e-3)
    assert exhausted(arm) == []


def arm_lookahead(arm: TrajectoryArm) -> float:
    values = {it.parameter.name: it.value for it in arm.loop.manager.parameters(NAME)}
    lookahead = values["lookahead"]
    assert isinstance(lookahead, float)
    return lookahead


def test_chunk_that_begins_later_leaves_the_points_before_it(arm: TrajectoryArm) -> None:
    begin = arm.now
    send(arm, begin)
    arm.run(0.3)
    taken = send(arm, begin + 0.6, 0.6, off=0.02, number=2)
    assert (taken.late, taken.replaced) == (0, 20 - 12)
    assert taken.seam == pytest.approx(begin + 0.6)
    cycles = arm.run(1.1)
    for cycle in cycles[: round(0.25 / CYCLE)]:
        assert cycle.state.position == pytest.approx(wave(cycle.state.time - begin), abs=2e-3)
    assert cycles[-1].state.position == pytest.approx(wave(arm.now - begin, 0.02), abs=2e-3)
    assert max(shares(desired(cycles))) < EXACT


def test_arm_without_points_brakes_and_holds_until_the_next_chunk(arm: TrajectoryArm) -> None:
    begin = arm.now
    taken = send(arm, begin, count=16)
    arm.run(1.5)
    (report,) = exhausted(arm)
    assert report.number == 1
    assert report.time == pytest.approx(taken.until)
    stopped = arm.loop.cycles[-1].sent.position
    beyond = stopped[6] - wave(0.75)[6]
    assert 0.0 < beyond < 0.5**2 / (2.0 * 0.9 * 40.0) + 0.5 * 0.067  # braking, and until the deceleration is there
    assert all(cycle.sent.position == stopped for cycle in arm.run(0.5))
    again = arm.now
    send(arm, again - 0.75, 0.0, count=40, number=2)
    arm.run(0.7)
    assert arm.position == pytest.approx(wave(0.75 + arm.now - again), abs=3e-3)
    assert max(shares(desired(arm.loop.cycles))) < EXACT


def test_cancel_brakes_from_the_same_cycle_on(arm: TrajectoryArm) -> None:
    send(arm, arm.now)
    before = arm.run(0.5)
    arm.order(CancelTrajectory())
    cycles = [*before, *arm.run(0.6)]
    positions = desired(cycles)[:, 6]
    speeds = np.diff(positions) / CYCLE
    assert speeds[len(before) + 2] < speeds[len(before) - 1]
    assert abs(speeds[-1]) < 1e-9
    assert max(shares(desired(cycles))) < EXACT
    assert exhausted(arm) == []


@pytest.mark.parametrize("factor", [0.5, 0.1])
def test_slower_arm_follows_the_same_path_and_time_stretches_behind_the_observation(factor: float) -> None:
    arm = perfect_arm()
    arm.loop.manager.receive(NAME, ScaleSpeed(factor), arm.loop.line.state)
    begin = arm.now
    send(arm, begin)  # while the scale still changes
    arm.run(0.5)
    taken = send(arm, begin + 0.5, 0.5 * factor, number=2)
    assert taken.late <= 2
    assert taken.until == pytest.approx(begin + 0.5 + 0.95 / factor, abs=0.03)
    cycles = arm.run(2.0)
    assert max(shares(desired(arm.loop.cycles))) < EXACT
    assert cycles[-1].state.position != cycles[-200].state.position
    arm.run(0.95 / factor)
    assert len(exhausted(arm)) == 1
    assert max(shares(desired(arm.loop.cycles))) < EXACT


def test_arm_whose_time_stands_still_is_never_exhausted() -> None:
    arm = perfect_arm()
    arm.order(ScaleSpeed(0.0))
    arm.run(0.5)
    begin = send(arm, arm.now)
    assert begin.until > arm.now + 0.9
    arm.run(0.5)
    assert send(arm, arm.now, 0.0, number=2).until == inf
    arm.run(2.0)
    assert exhausted(arm) == []


def test_trajectory_and_chunk_replace_each_other_in_motion(arm: TrajectoryArm) -> None:
    begin = arm.now
    send(arm, begin)
    arm.run(0.4)
    there = moved(HOME, 0.3), REST, REST
    arm.follow(planned([TrajectoryPoint(0.6, *there), TrajectoryPoint(3.0, *there)], start=arm.now), goal=5)
    arm.run(1.5)
    send(arm, arm.now, 0.9, count=40, number=2, off=0.3 - (wave(0.9)[6] - HOME[6]))
    arm.run(0.3)
    assert [(each.goal, each.outcome) for each in arm.ended] == [(5, TrajectoryOutcome.ABORTED)]
    assert max(shares(desired(arm.loop.cycles))) < EXACT


def test_feedback_is_that_of_the_chunk(arm: TrajectoryArm) -> None:
    send(arm, arm.now, number=9)
    arm.run(0.5)
    assert arm.feedback.goal == 9
    assert arm.feedback.desired == pytest.approx(arm.feedback.actual, abs=2e-3)


@pytest.mark.parametrize(
    ("begin", "off", "code"),
    [
        (-3.0, 0.0, "chunk_is_over"),
        (0.0, 0.5, "chunk_jumps"),
        (2.0, 0.0, "chunk_begins_too_late"),
        (-0.85, -0.4, "chunk_out_of_reach"),
    ],
)
def test_chunk_that_cannot_be_followed_changes_nothing(arm: TrajectoryArm, begin: float, off: float, code: str) -> None:
    before = arm.loop.cycles[-1].sent.position
    with refused(TrajectoryRefused, code):
        send(arm, arm.now + begin, off=off)
    assert all(each.sent.position == before for each in arm.run(0.3))
