"""Trajectories of positions alone, as policies send them: smooth, and one after another without a stop."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, joint_names, joints
from cartesian_bench import shares
from unit.robot.test_robot_kinematics import rad
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.goals import MemoryBuffer
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.trajectory_commands import FollowTrajectory
from yumi.planning.trajectory_request import JointTrajectory, plan_trajectory, timed_trajectory
from yumi_evaluation.virtual_time import VirtualArmRig

NAME, SIDE = "joint_trajectory_controller", Side.RIGHT
NAMES = joint_names(SIDE)
POSTURE = rad((20, -90, -110, 10, 30, 60, 10))


def wave(time: float) -> Joints:
    """Where a policy wants the arm: it begins at rest in the posture."""
    swing = radians(25.0) * (1.0 - np.cos(1.5 * time))
    return joints([value + (swing if index in (0, 4) else -0.5 * swing) for index, value in enumerate(POSTURE)])


def chunk(start: float, count: int, rate: float, noise: float = 0.0, seed: int = 0) -> JointTrajectory:
    """``count`` points after ``start`` without times, ``rate`` a second."""
    generator = np.random.default_rng(seed)
    points = []
    for number in range(1, count + 1):
        position = np.array(wave(start + number / rate)) + generator.normal(0.0, noise, 7)
        points.append(TrajectoryPoint(0.0, joints(position.tolist())))
    return JointTrajectory(NAMES, tuple(points))


class Follower:
    """An arm that follows trajectories in virtual time."""

    def __init__(self) -> None:
        self.controller = JointTrajectoryController(SIDE, MemoryBuffer())
        self.rig = VirtualArmRig({NAME: self.controller}, side=SIDE, position=POSTURE)
        self.rig.start()
        self.rig.switch_to(NAME)
        self.rig.run(0.1)
        self.number = 0

    def send(self, trajectory: JointTrajectory) -> None:
        """As the action has it: smoothed from how the arm is commanded now."""
        start = Setpoint(self.controller._position, self.controller._velocity)
        plan = plan_trajectory(trajectory, (SIDE,), YUMI_LIMITS, None, {SIDE: start})[SIDE]
        self.number += 1
        self.rig.manager.receive(NAME, FollowTrajectory(plan, self.number), self.rig.line.state)

    @property
    def sent(self) -> np.ndarray:
        return np.array([cycle.sent.position for cycle in self.rig.cycles])


def test_times_come_from_the_frequency() -> None:
    given = timed_trajectory(chunk(0.0, 3, 20.0), 20.0)
    assert [each.time for each in given.points] == pytest.approx([0.05, 0.1, 0.15])
    assert timed_trajectory(given, 5.0) is given


@pytest.mark.parametrize(("rate", "count", "noise"), [(10.0, 8, 0.0), (30.0, 16, 0.001), (50.0, 50, 0.001)])
def test_chunks_one_after_another_are_one_motion(rate: float, count: int, noise: float) -> None:
    follower = Follower()
    first, begin = len(follower.rig.cycles), follower.rig.clock.now()
    renewed = max(count // 2, 2) / rate
    while (now := follower.rig.clock.now() - begin) < 3.0:
        follower.send(timed_trajectory(chunk(now, count, rate, noise, seed=follower.number), rate))
        follower.rig.run(renewed)
    assert follower.number >= 3
    sent = follower.sent[first - 3 :]
    speeds = np.max(np.abs(np.diff(sent, axis=0)) / CYCLE, axis=1)
    under_way = speeds[round(0.6 / CYCLE) : round(1.6 / CYCLE)]
    assert float(np.min(under_way)) > 0.3 * float(np.max(under_way))  # it does not stop between two
    assert max(shares(sent)) < 1.0 + 1e-5
    assert follower.rig.snapshot.limiter.slowed < 10


def test_a_chunk_that_begins_elsewhere_is_joined_later() -> None:
    follower = Follower()
    follower.send(timed_trajectory(chunk(0.0, 20, 20.0), 20.0))
    follower.rig.run(0.6)
    off = chunk(0.6, 20, 20.0)
    shifted = [each._replace(position=joints([value + 0.08 for value in each.position])) for each in off.points]
    first = len(follower.rig.cycles)
    follower.send(timed_trajectory(JointTrajectory(NAMES, tuple(shifted)), 20.0))
    follower.rig.run(2.0)
    assert follower.sent[-1] == pytest.approx(shifted[-1].position, abs=2e-3)
    assert max(shares(follower.sent[first - 3 :])) < 1.0 + 1e-5


def test_without_the_parameter_points_are_joined_by_straight_lines() -> None:
    points = tuple(TrajectoryPoint(time, wave(time)) for time in (0.0, 0.5, 1.0))
    plan = plan_trajectory(JointTrajectory(NAMES, points), (SIDE,), YUMI_LIMITS)[SIDE]
    assert not plan.is_smoothed
    assert all(row[2:] == (0.0, 0.0, 0.0, 0.0) for segment in plan.spline.segments for row in segment.rows)
    smooth = plan_trajectory(JointTrajectory(NAMES, points), (SIDE,), YUMI_LIMITS, None, {SIDE: Setpoint(POSTURE)})
    assert smooth[SIDE].is_smoothed
    assert smooth[SIDE].spline.segments[0].rows[0][1] == 0.0  # from rest
