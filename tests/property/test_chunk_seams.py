"""No seam between chunks makes a step, at any rate, inference time, loss and correction; without points an arm brakes.

What may change within one cycle is what a continuous acceleration does: the jerk limit times the cycle.
"""

from __future__ import annotations

from math import ceil

import numpy as np
import pytest
from chunk_runs import ChunkRun, Inference, Policy, follow_chunks, steps_of

from abb_protocols.errors import TrajectoryRefused
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Side, joint_names, joints, named_pose
from cartesian_bench import shares
from soak import MINUTES, long, short, tell
from yumi.control.chunk_commands import FollowChunk
from yumi.control.motion.chunk_motion import LONGEST_LEAD, ChunkMotion, join_chunk
from yumi.control.motion.robot_response import RESPONSE_DELAY
from yumi.control.motion.setpoint import Setpoint
from yumi.planning.chunk_plan import plan_chunk

SIDE = Side.RIGHT
EXACT = 1.0 + 1e-5  # the last digits of differences of third order
BRAKES = 0.9  # of the jerk limit: an arm that brakes
MOMENT = 1e-9  # [s]
ROUNDING = (1e-8, 1e-6, 1e-5)  # [rad], [rad/s], [rad/s²]: what the limits let change within the moment, and rounding


def assert_brakes_at_the_end(run: ChunkRun) -> None:
    """Whatever moves when the points are exhausted brakes with its full jerk from the first whole cycle after that."""
    speeds, rates, jerks = (np.diff(run.desired, order, axis=0) / CYCLE**order for order in (1, 2, 3))
    full = BRAKES * np.array(YUMI_LIMITS.jerk)
    for each in run.exhausted:
        # The first position that is commanded after the last point: earlier than due by the arm's delay.
        first = int(np.searchsorted(run.times + RESPONSE_DELAY, each.time))
        speed = speeds[first - 2]
        towards_rest = -np.sign(speed)
        is_nearly_at_rest = towards_rest * rates[first] > 0.5 * np.sqrt(np.abs(speed) * full)  # it has braked already
        is_braking = towards_rest * jerks[first] > 0.999 * full
        lasts = np.abs(speed) > full * (4.5 * CYCLE) ** 2  # slower joints are past their full jerk when it is measured
        assert (is_braking | is_nearly_at_rest)[lasts].all()


@pytest.mark.parametrize("minutes", [short(0.04, pytest.mark.timeout(60)), long(MINUTES, 600.0 * MINUTES)])
@pytest.mark.parametrize("duration", [0.0, 0.1, 0.3, 0.8])
@pytest.mark.parametrize("rate", [5.0, 10.0, 50.0])
def test_no_seam_makes_a_step(rate: float, duration: float, minutes: float) -> None:
    points = min(50, max(8, ceil((2.0 * duration + 0.3) * rate)))
    run = follow_chunks(Inference(rate, points, duration), 60.0 * minutes, seed=int(rate + 10.0 * duration))
    assert run.taken
    assert set(run.refused) <= {"chunk_out_of_reach"}  # what is left of a chunk may be too short to get onto it
    desired, sent = steps_of(run.desired), shares(run.sent)
    assert desired.share < EXACT
    assert max(sent) < EXACT
    assert_brakes_at_the_end(run)
    if minutes >= 1.0:
        lost = run.lost / (run.lost + len(run.taken) + len(run.refused))
        assert lost == pytest.approx(0.1, abs=0.05)
        tell(f"{rate:g} Hz, {duration:g} s: {len(run.taken)} chunks, {len(run.exhausted)} times exhausted, {desired}")


@pytest.mark.parametrize("count", [short(300), long(30000.0, 1800.0)])
def test_position_velocity_and_acceleration_are_continuous_at_every_seam(count: float) -> None:
    """Chunks that begin early, late and far in the future, elsewhere than the arm is, and after the end of others."""
    chance = np.random.default_rng(7)
    names, time = joint_names(SIDE), 0.0
    policy = Policy(chance, named_pose(SIDE, "ready"))
    motion: ChunkMotion | Setpoint = Setpoint(joints(policy.at(np.zeros(1))[0].tolist()))
    seams = refused = early = 0
    for number in range(int(count)):
        since = np.arange(chance.integers(8, 50)) / chance.choice([5.0, 10.0, 30.0, 50.0])
        begin = time + chance.uniform(-0.5, 1.0)
        positions = policy.at(begin + since) + chance.normal(0.0, 0.02, 7)
        chunk = FollowChunk(number, begin, plan_chunk(SIDE, since.tolist(), positions, YUMI_LIMITS))
        try:
            joined = join_chunk(chunk, begin, motion, time, names, YUMI_LIMITS)
        except TrajectoryRefused:
            refused += 1
        else:
            early += joined.seam > time
            assert time <= joined.seam <= joined.joined <= joined.seam + LONGEST_LEAD + 1e-9
            before = motion.setpoint(joined.seam) if isinstance(motion, ChunkMotion) else motion
            if isinstance(motion, ChunkMotion):
                assert joined.setpoint(time) == motion.setpoint(time)  # until the seam nothing has changed
            assert_same(before, joined.setpoint(joined.seam))
            for moment in (joined.seam, joined.joined):
                assert_same(joined.setpoint(moment - MOMENT), joined.setpoint(min(moment + MOMENT, joined.end)))
            assert_same(joined.setpoint(joined.end - MOMENT), joined.at_end)
            motion, seams = joined, seams + 1
        time += chance.uniform(0.0, 0.4)
        if isinstance(motion, ChunkMotion) and time >= motion.end:
            motion = Setpoint(joints(policy.at(np.array([time]))[0].tolist()))
    assert seams > 0.5 * count
    assert early > 0.2 * count
    assert refused > 0


def assert_same(before: Setpoint, after: Setpoint) -> None:
    for old, new, most in zip(before, after, ROUNDING, strict=True):
        assert new == pytest.approx(old, abs=most)
