"""What speed_scale does to every controller, on a virtual arm over the wire: slower, on the same path, no jump."""

from __future__ import annotations

from collections.abc import Callable
from math import dist, radians

import numpy as np
import pytest

from abb_protocols.catalogue import message
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, home, joints
from trajectories import moved, planned, swing
from yumi.control.controllers.forward_command import JointGroupPositionController, JointGroupVelocityController
from yumi.control.controllers.joint_goal import GoalEnded, GoalOutcome, JointGoal, JointGoalController, StopMotion
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.cycle import Cycle
from yumi.control.goals import MemoryBuffer, write_goal, write_speeds
from yumi.control.limiter import Limiter
from yumi.control.loop_events import ControllerReport
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.speed_scale import SpeedFactor, SpeedScale
from yumi.control.trajectory_commands import (
    CancelTrajectory,
    FollowTrajectory,
    Tolerances,
    TrajectoryEnded,
    TrajectoryOutcome,
)
from yumi_evaluation.virtual_time import VirtualArmRig

SIDE = Side.LEFT
HOME = home(SIDE)
REST = joints([0.0] * 7)
LIMITS = YUMI_LIMITS.slowed_to(radians(180.0))  # as the driver has them, with the robot's MaxSpeedDeviation
HALF_A_DEGREE = joints([radians(0.5)] * 7)
CLOSE = Tolerances(
    path=HALF_A_DEGREE, path_velocity=joints([0.25] * 7), goal=HALF_A_DEGREE, goal_velocity=HALF_A_DEGREE, goal_time=0.5
)


class ScaledArm:
    """A virtual arm, one controller of each kind, and the scale they share."""

    def __init__(self, scale: float = 1.0) -> None:
        self.scale, self.goals, self.speeds, self.feedback = (MemoryBuffer() for _ in range(4))
        self.set(scale)
        speed = SpeedScale(self.scale)
        self.arm = VirtualArmRig(
            {
                "trajectory": JointTrajectoryController(SIDE, self.feedback, LIMITS, speed=speed),
                "goal": JointGoalController(MemoryBuffer(), LIMITS, speed=speed),
                "position": JointPositionController(self.goals, LIMITS, speed),
                "tracking": JointPositionController(self.goals, LIMITS, speed),
                "forward": JointGroupPositionController(self.goals, self.speeds, LIMITS, speed),
                "velocity": JointVelocityController(self.speeds, LIMITS, speed),
                "forward_velocity": JointGroupVelocityController(self.goals, self.speeds, LIMITS, speed),
            },
            side=SIDE,
            limiter=Limiter(LIMITS),
            speed=speed,
        )
        self.arm.manager.set_parameters("goal", {"speed_scale": 0.8, "acceleration_scale": 0.5})
        self.arm.manager.set_parameters("tracking", {"tracking.feed_forward": True})
        self.arm.start()

    def set(self, scale: float) -> None:
        self.scale.write(SpeedFactor(scale))

    def lead(self, name: str) -> None:
        self.arm.switch_to(name)
        self.arm.run(0.1)

    def order(self, name: str, message: object) -> None:
        self.arm.manager.receive(name, message, self.arm.line.state)

    def stream(self, seconds: float, speed: Joints | None = None, position: Joints | None = None) -> list[Cycle]:
        """A goal or a speed in every cycle."""
        first = len(self.arm.cycles)
        for _ in range(round(seconds / CYCLE)):
            session, now = self.arm.cycles[-1].state.session, self.arm.clock.now()
            if position is not None:
                write_goal(self.goals, session, position, time=now)
            if speed is not None:
                write_speeds(self.speeds, session, speed, now)
            self.arm.cycle()
        return self.arm.cycles[first:]

    @property
    def position(self) -> Joints:
        return self.arm.cycles[-1].state.position

    @property
    def notices(self) -> list[object]:
        return [event.report for event in self.arm.events if isinstance(event, ControllerReport)]

    def run_to_notice(self, limit: float) -> object:
        """The next thing a controller tells."""
        known = len(self.notices)
        self.arm.run_until(lambda: len(self.notices) > known, limit)
        return self.notices[known]


def sent(cycles: list[Cycle]) -> np.ndarray:
    return np.array([cycle.sent.position for cycle in cycles])


def assert_smooth(cycles: list[Cycle]) -> None:
    """What was sent keeps the joints' speeds, accelerations and jerks."""
    motion = sent(cycles)
    for limit in (LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk):
        motion = np.diff(motion, axis=0) / CYCLE
        assert np.all(np.abs(motion) <= 1.01 * np.array(limit))


def fastest(cycles: list[Cycle]) -> float:
    """The largest share of its limit that any joint's command moved with."""
    return float(np.max(np.abs(np.diff(sent(cycles), axis=0)) / CYCLE / LIMITS.velocity))


@pytest.mark.parametrize("scale", [0.1, 0.5])
def test_trajectory_takes_as_much_longer_and_keeps_its_tolerances_and_its_path(scale: float) -> None:
    full, slow = ScaledArm(), ScaledArm(scale)
    paths = []
    for arm in (full, slow):
        arm.lead("trajectory")
        first, begin = len(arm.arm.cycles), arm.arm.clock.now()
        arm.order("trajectory", FollowTrajectory(swing(HOME, 1.0, 0.8), 1, CLOSE))
        end = arm.run_to_notice(10.0)
        assert isinstance(end, TrajectoryEnded)
        assert end.outcome is TrajectoryOutcome.SUCCEEDED
        arm.duration = arm.arm.clock.now() - begin  # type: ignore[attr-defined]
        assert_smooth(arm.arm.cycles[first:])
        paths.append(sent(arm.arm.cycles[first:]))
    assert slow.duration - full.duration == pytest.approx(0.8 / scale - 0.8, abs=0.1)  # type: ignore[attr-defined]
    apart = np.linalg.norm(paths[0][:, None] - paths[1], axis=2)
    assert apart.min(axis=1).max() < 0.02


def test_trajectory_feedback_tells_the_scale_and_the_slower_speed() -> None:
    arm = ScaledArm(0.25)
    arm.lead("trajectory")
    arm.order("trajectory", FollowTrajectory(swing(HOME, 1.0, 2.0), 1, CLOSE))
    arm.arm.run(4.0)
    letter = arm.feedback.read()
    assert letter is not None
    feedback = letter[1]
    assert feedback.scale == 0.25
    assert feedback.progress == pytest.approx(1.0, abs=0.05)
    assert feedback.desired_velocity[6] == pytest.approx(feedback.actual_velocity[6], abs=0.03)


def test_scale_that_changes_in_the_middle_of_a_fast_trajectory_is_smooth_and_keeps_the_path_tolerance() -> None:
    arm = ScaledArm()
    arm.lead("trajectory")
    first = len(arm.arm.cycles)
    arm.order("trajectory", FollowTrajectory(swing(HOME, 2.0, 1.4), 1, CLOSE))
    arm.arm.run(0.5)
    arm.set(0.1)
    arm.arm.run(1.0)
    assert fastest(arm.arm.cycles[-100:]) < 0.1
    arm.set(1.0)
    end = arm.run_to_notice(5.0)
    assert isinstance(end, TrajectoryEnded)
    assert (end.outcome, end.said) == (TrajectoryOutcome.SUCCEEDED, message("goal_reached"))
    assert_smooth(arm.arm.cycles[first:])


def test_slow_trajectory_that_is_cancelled_stops_at_once_and_another_one_can_begin_while_it_does() -> None:
    arm = ScaledArm(0.2)
    arm.lead("trajectory")
    first = len(arm.arm.cycles)
    arm.order("trajectory", FollowTrajectory(swing(HOME, 2.0, 1.4), 1, CLOSE))
    arm.arm.run(2.2)
    arm.order("trajectory", CancelTrajectory(1))
    arm.arm.run(0.03)
    back = planned([TrajectoryPoint(3.0, HOME, REST)])
    arm.order("trajectory", FollowTrajectory(back, 2, Tolerances(goal=HALF_A_DEGREE, goal_time=0.5)))
    end = arm.run_to_notice(20.0)
    assert isinstance(end, TrajectoryEnded)
    assert end.goal == 1
    end = arm.run_to_notice(20.0)
    assert isinstance(end, TrajectoryEnded)
    assert (end.goal, end.outcome) == (2, TrajectoryOutcome.SUCCEEDED)
    assert arm.position == pytest.approx(HOME, abs=radians(0.1))
    assert_smooth(arm.arm.cycles[first:])


@pytest.mark.parametrize("scale", [0.05, 0.5])
def test_point_to_point_motion_takes_as_much_longer(scale: float) -> None:
    durations = []
    for each in (1.0, scale):
        arm = ScaledArm(each)
        arm.lead("goal")
        first, goal = len(arm.arm.cycles), moved(HOME, 0.5)
        arm.order("goal", JointGoal(goal, 1))
        end = arm.run_to_notice(60.0)
        assert isinstance(end, GoalEnded)
        assert end.outcome is GoalOutcome.REACHED
        cycles = arm.arm.cycles[first:]
        desired = [cycle.desired.position for cycle in cycles if cycle.desired]
        durations.append(sum(dist(position, goal) > 1e-4 for position in desired) * CYCLE)
        assert_smooth(cycles)
    full, slow = durations
    assert slow == pytest.approx(full / scale, rel=0.03)


def test_point_to_point_motion_takes_a_new_scale_a_new_goal_and_a_stop_in_its_middle_without_a_jump() -> None:
    arm = ScaledArm()
    arm.lead("goal")
    first = len(arm.arm.cycles)
    arm.order("goal", JointGoal(moved(HOME, 2.0), 1))
    arm.arm.run(0.3)
    arm.set(0.2)
    arm.arm.run(0.8)
    assert fastest(arm.arm.cycles[-50:]) < 0.2001
    arm.order("goal", JointGoal(moved(HOME, -0.5), 2))
    arm.arm.run(0.5)
    arm.order("goal", StopMotion(3))
    arm.arm.run(0.03)
    arm.order("goal", JointGoal(moved(HOME, 0.2), 4))
    arm.arm.run_until(lambda: bool(arm.notices) and arm.notices[-1].identity == 4, 20.0)  # type: ignore[attr-defined]
    assert arm.notices[-1] == GoalEnded(4, GoalOutcome.REACHED, message("goal_reached"))
    assert str(arm.notices[-1]) == str(message("motion_ended", number=4, reason=message("goal_reached")))  # in the log
    assert_smooth(arm.arm.cycles[first:])


def test_stop_is_not_slowed_down() -> None:
    arm = ScaledArm(0.1)
    arm.lead("goal")
    arm.order("goal", JointGoal(moved(HOME, 1.5), 1))
    arm.arm.run(3.0)
    assert fastest(arm.arm.cycles[-10:]) > 0.04
    arm.order("goal", StopMotion(2))
    arm.arm.run(0.15)
    assert fastest(arm.arm.cycles[-10:]) < 0.001


@pytest.mark.parametrize("name", ["position", "tracking", "forward"])
@pytest.mark.parametrize("scale", [0.01, 0.1, 0.5])
def test_stream_of_positions_moves_no_joint_faster_and_arrives(name: str, scale: float) -> None:
    arm = ScaledArm(scale)
    arm.lead(name)
    goal = moved(HOME, min(0.5, 6.0 * scale))
    cycles = arm.stream(3.0, position=goal)
    assert 0.6 * scale < fastest(cycles) <= 1.002 * scale
    assert arm.position == pytest.approx(goal, abs=radians(0.2))
    assert_smooth(cycles)


@pytest.mark.parametrize("name", ["velocity", "forward_velocity"])
def test_stream_of_speeds_is_limited_to_the_scaled_limits(name: str) -> None:
    arm = ScaledArm(0.1)
    arm.lead(name)
    cycles = arm.stream(1.0, speed=joints([0.0] * 6 + [1.0]))
    top = 0.1 * LIMITS.velocity[6]
    assert cycles[-1].state.velocity[6] == pytest.approx(top, rel=0.02)
    assert fastest(cycles) <= 0.1001
    cycles += arm.stream(0.5, speed=REST)
    assert fastest(cycles[-20:]) < 1e-4
    assert_smooth(cycles)


def drive_fast(name: str, arm: ScaledArm) -> Callable[[float], list[Cycle]]:
    if "velocity" in name:
        return lambda seconds: arm.stream(seconds, speed=joints([0.0] * 6 + [2.5]))
    return lambda seconds: arm.stream(seconds, position=moved(HOME, 2.5))


@pytest.mark.parametrize("name", ["position", "tracking", "forward", "velocity", "forward_velocity"])
def test_arm_that_is_streamed_to_at_speed_slows_down_smoothly_when_the_scale_drops_and_comes_back(name: str) -> None:
    arm = ScaledArm()
    arm.lead(name)
    drive = drive_fast(name, arm)
    cycles = drive(0.3)
    assert fastest(cycles[-10:]) > 0.5
    arm.set(0.05)
    cycles += drive(0.7)
    assert fastest(cycles[-50:]) <= 0.0501
    arm.set(0.5)
    cycles += drive(0.5)
    assert 0.2 < fastest(cycles[-100:]) <= 1.002 * 0.5
    assert_smooth(cycles)
