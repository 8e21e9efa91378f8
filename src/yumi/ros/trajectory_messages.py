"""Trajectory messages to values and back."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import isnan
from typing import Any

from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTrajectoryControllerState
from trajectory_msgs.msg import JointTrajectoryPoint

from yumi.control.spline import TrajectoryPoint
from yumi.control.trajectory import JointTrajectory, check_count, refused
from yumi.control.trajectory_feedback import TrajectoryFeedback
from yumi.controllers.trajectory_orders import DEFAULT, UNLIMITED, Tolerances
from yumi.robot.joints import Joints, Side, joint_names, joints
from yumi.ros.conversions import stamp

_NS = 1_000_000_000
_Difference = Callable[[TrajectoryFeedback], Iterable[float]]


def trajectory_of(message: Any, start: float | None) -> JointTrajectory:
    """The trajectory in a trajectory_msgs/JointTrajectory that starts at ``start`` on the monotonic clock [s].

    Raises:
        TrajectoryRefused: it has too many points, or one has efforts.
    """
    check_count(len(message.points))
    return JointTrajectory(tuple(message.joint_names), tuple(map(_point, message.points)), start)


def stamp_of(message: Any) -> int:
    """The time in a header [ns]; 0 is at once."""
    return int(message.header.stamp.sec) * _NS + int(message.header.stamp.nanosec)


def tolerances_of(goal: Any, sides: Sequence[Side]) -> tuple[Mapping[Side, Tolerances], str]:
    """The tolerances of a goal for each arm, and why all are the controller's own after all; empty if they are not.

    As upstream, an unknown joint or a negative tolerance other than -1 takes back every tolerance of the goal.

    Raises:
        TrajectoryRefused: a tolerance is NaN.
    """
    known = {name for side in sides for name in joint_names(side)}
    own: Mapping[Side, Tolerances] = {side: Tolerances() for side in sides}
    for each in (*goal.path_tolerance, *goal.goal_tolerance):
        if each.name not in known:
            return own, f"{each.name!r} is no joint of this controller"
        values = (each.position, each.velocity, each.acceleration)
        if any(map(isnan, values)):
            raise refused(f"a tolerance of {each.name} is nan; give a number, 0 for the controller's own, -1 for none.")
        if any(value < 0.0 and value != UNLIMITED for value in values):
            return own, f"a tolerance of {each.name} is negative; -1 is unlimited"
    time = seconds(goal.goal_time_tolerance)
    if time < 0.0 and time != UNLIMITED:
        return own, f"goal_time_tolerance is {time:g} s; -1 is unlimited"
    return {side: _tolerances(goal, side, time) for side in sides}, ""


def seconds(duration: Any) -> float:
    """A builtin_interfaces/Duration [s]."""
    return float(duration.sec) + float(duration.nanosec) / _NS


def feedback_message(feedbacks: Mapping[Side, TrajectoryFeedback], time_ns: int) -> Any:
    """The feedback of an action that moves the arms of ``feedbacks``."""
    message = FollowJointTrajectory.Feedback()
    message.header.stamp = stamp(time_ns)
    message.joint_names = _names(feedbacks)
    message.desired, message.actual, message.error = _points(feedbacks)
    return message


def state_message(feedbacks: Mapping[Side, TrajectoryFeedback], time_ns: int) -> Any:
    """The state of a controller that commands the arms of ``feedbacks``; its error is reference - feedback."""
    message = JointTrajectoryControllerState()
    message.header.stamp = stamp(time_ns)
    message.joint_names = _names(feedbacks)
    message.reference, message.feedback, message.error = _points(feedbacks)
    if hasattr(message, "speed_scaling_factor"):  # since control_msgs 5.3.0
        message.speed_scaling_factor = min(feedback.scale for feedback in feedbacks.values())
    return message


def _point(message: Any) -> TrajectoryPoint:
    if message.effort:
        raise refused("a point has efforts; this robot takes positions, velocities and accelerations.")
    fields = (message.positions, message.velocities, message.accelerations)
    return TrajectoryPoint(seconds(message.time_from_start), *map(tuple, fields))


def _tolerances(goal: Any, side: Side, time: float) -> Tolerances:
    return Tolerances(
        path=_chosen(goal.path_tolerance, side, "position"),
        path_velocity=_chosen(goal.path_tolerance, side, "velocity"),
        goal=_chosen(goal.goal_tolerance, side, "position"),
        goal_velocity=_chosen(goal.goal_tolerance, side, "velocity"),
        goal_time=time,
    )


def _chosen(tolerances: Iterable[Any], side: Side, field: str) -> Joints:
    named = {each.name: float(getattr(each, field)) for each in tolerances}
    return joints([named.get(name, DEFAULT) for name in joint_names(side)])


def _names(feedbacks: Mapping[Side, TrajectoryFeedback]) -> list[str]:
    return [name for side in feedbacks for name in joint_names(side)]


def _points(feedbacks: Mapping[Side, TrajectoryFeedback]) -> tuple[Any, Any, Any]:
    """Desired, actual, and desired - actual."""
    time = next(iter(feedbacks.values())).progress
    desired = [_row(feedbacks, lambda each: each.desired), _row(feedbacks, lambda each: each.desired_velocity)]
    actual = [_row(feedbacks, lambda each: each.actual), _row(feedbacks, lambda each: each.actual_velocity)]
    error = [[want - have for want, have in zip(*rows, strict=True)] for rows in zip(desired, actual, strict=True)]
    return tuple(_point_message(time, *rows) for rows in (desired, actual, error))


def _row(feedbacks: Mapping[Side, TrajectoryFeedback], values: _Difference) -> list[float]:
    return [value for feedback in feedbacks.values() for value in values(feedback)]


def _point_message(time: float, position: list[float], velocity: list[float]) -> Any:
    nanoseconds = max(0, round(time * _NS))
    return JointTrajectoryPoint(
        positions=position,
        velocities=velocity,
        time_from_start=Duration(sec=nanoseconds // _NS, nanosec=nanoseconds % _NS),
    )
