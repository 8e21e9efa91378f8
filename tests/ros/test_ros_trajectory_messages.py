"""Trajectory goals as values: what a message may not have is told with what is allowed."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from yumi.control.controllers.joint_trajectory import Tolerances
from yumi.control.trajectory import MOST_POINTS
from yumi.errors import TrajectoryRefused
from yumi.robot.joints import Side, joint_names
from yumi.ros.messages import tolerances_of, trajectory_of

pytestmark = pytest.mark.ros

FIRST = joint_names(Side.RIGHT)[0]


@pytest.mark.parametrize(
    ("fields", "remark"),
    [
        ({"path_tolerance": [JointTolerance(name="elbow")]}, "'elbow' is not a joint of this controller"),
        (
            {"goal_tolerance": [JointTolerance(name=FIRST, position=-0.5)]},
            f"a tolerance of {FIRST} is negative; -1 is unlimited",
        ),
        ({"goal_time_tolerance": Duration(sec=-2)}, "goal_time_tolerance is -2 s; -1 is unlimited"),
    ],
)
def test_tolerances_that_cannot_be_leave_the_controllers_own_and_say_why(fields: dict[str, Any], remark: str) -> None:
    good = JointTolerance(name=FIRST, position=0.1)
    goal = FollowJointTrajectory.Goal(**{"goal_tolerance": [good], **fields})
    assert tolerances_of(goal, [Side.RIGHT]) == ({Side.RIGHT: Tolerances()}, remark)


@pytest.mark.parametrize("field", ["position", "velocity", "acceleration"])
@pytest.mark.parametrize("which", ["path_tolerance", "goal_tolerance"])
def test_tolerance_that_is_nan_is_refused(which: str, field: str) -> None:
    goal = FollowJointTrajectory.Goal(**{which: [JointTolerance(name=FIRST, **{field: nan})]})
    with pytest.raises(TrajectoryRefused, match=f"a tolerance of {FIRST} is nan; give a number"):
        tolerances_of(goal, [Side.RIGHT])


def test_trajectory_of_too_many_points_is_refused_before_they_are_read() -> None:
    trajectory = JointTrajectory(joint_names=[FIRST], points=[JointTrajectoryPoint(effort=[1.0])] * (MOST_POINTS + 1))
    with pytest.raises(TrajectoryRefused, match="it has 20001 points; at most 20000 are taken"):
        trajectory_of(trajectory, None)


def test_points_with_efforts_are_refused() -> None:
    trajectory = JointTrajectory(joint_names=[FIRST], points=[JointTrajectoryPoint(positions=[0.0], effort=[1.0])])
    sentence = "a point has efforts; this robot takes positions, velocities and accelerations"
    with pytest.raises(TrajectoryRefused, match=sentence):
        trajectory_of(trajectory, None)
