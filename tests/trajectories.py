"""Trajectories for tests: the one of an independent planner for both arms, and small ones for one arm."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from abb_protocols.robot.joints import JOINT_COUNT, YUMI_LIMITS, Joints, Side, joint_names, joints
from yumi.control.motion.robot_response import SERVO_CYCLES
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.trajectory_commands import ArmPlan
from yumi.planning.trajectory_request import JointTrajectory, plan_trajectory

DUAL_ARM_FILE = Path(__file__).parent / "fixtures" / "dual_arm_trajectory.json"
REST = (0.0,) * JOINT_COUNT


def change_rate(new: Joints, old: Joints, dt: float) -> Joints:
    """How fast the joints have changed from ``old`` to ``new`` within ``dt`` [s]."""
    return joints([(after - before) / dt for after, before in zip(new, old, strict=True)])


def dual_arm_message() -> Mapping[str, Any]:
    """The planner's trajectory with the fields of trajectory_msgs/JointTrajectory."""
    message: Mapping[str, Any] = json.loads(DUAL_ARM_FILE.read_text())
    return message


def dual_arm_trajectory() -> JointTrajectory:
    """The planner's trajectory: 14 joints, 50 points, 5 s."""
    message = dual_arm_message()
    return JointTrajectory(tuple(message["joint_names"]), tuple(_point(point) for point in message["points"]))


def moved(position: Sequence[float], step: float, joint: int = 6) -> Joints:
    """``position`` with one joint moved by ``step`` [rad]."""
    a, b, c, d, e, f, g = (value + step * (index == joint) for index, value in enumerate(position))
    return (a, b, c, d, e, f, g)


def swing(
    position: Joints, step: float, duration: float, side: Side = Side.LEFT, start: float | None = None
) -> ArmPlan:
    """From ``position`` at rest to ``step`` [rad] away on axis 6, at rest again after ``duration`` [s]."""
    points = (
        TrajectoryPoint(0.0, position, REST, REST),
        TrajectoryPoint(duration, moved(position, step), REST, REST),
    )
    return planned(points, side, start)


def planned(points: Sequence[TrajectoryPoint], side: Side = Side.LEFT, start: float | None = None) -> ArmPlan:
    """One arm's plan for ``points`` in chain order."""
    trajectory = JointTrajectory(joint_names(side), tuple(points), start)
    return plan_trajectory(trajectory, (side,), YUMI_LIMITS)[side]


def _point(point: Mapping[str, Any]) -> TrajectoryPoint:
    time = point["time_from_start"]
    fields = (tuple(point[name]) for name in ("positions", "velocities", "accelerations"))
    return TrajectoryPoint(time["sec"] + time["nanosec"] * 1e-9, *fields)


def sent_beside_speeds(desired: Sequence[Joints], start: Joints | None = None) -> list[Joints]:
    """The positions that are sent where these are desired with their speeds, from rest at ``start`` on."""
    places = [start or desired[0]] * (SERVO_CYCLES + 1) + list(desired)
    late, later = places[1 : len(desired) + 1], places[: len(desired)]
    return [joints([0.5 * (a + b) for a, b in zip(*rows, strict=True)]) for rows in zip(late, later, strict=True)]
