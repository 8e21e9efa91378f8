"""ROS messages of joint trajectories to values and back: their points and tolerances, feedback and states."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import isnan
from typing import Any

from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTrajectoryControllerState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectoryPoint

from abb_protocols.catalogue import message as said  # a message here is one of ROS
from abb_protocols.catalogue import quoted
from abb_protocols.robot.joints import Joints, Side, joint_names, joints
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.shared_state import TrajectoryFeedback
from yumi.control.trajectory_commands import DEFAULT_TOLERANCE, UNLIMITED_TOLERANCE, Tolerances, trajectory_refused
from yumi.planning.trajectory_request import JointTrajectory, check_trajectory_length
from yumi.ros.messages import nanoseconds, seconds, stamp


def trajectory_of(given: Any) -> JointTrajectory:
    """The trajectory in a trajectory_msgs/JointTrajectory.

    Raises:
        TrajectoryRefused: it has too many points, or one has efforts.
        CommandRefused: the time of a point has more nanoseconds than a second.
    """
    check_trajectory_length(len(given.points))
    points: list[TrajectoryPoint] = []
    for point in given.points:
        if point.effort:
            raise trajectory_refused(said("trajectory_with_efforts"))
        fields = (point.positions, point.velocities, point.accelerations)
        time = seconds(point.time_from_start, f"Trajectory refused: time_from_start of point {len(points) + 1}")
        points.append(TrajectoryPoint(time, *map(tuple, fields)))
    return JointTrajectory(tuple(given.joint_names), tuple(points))


def stamp_of(message: Any) -> int:
    """The time in the header of a trajectory [ns]; 0 is at once."""
    return nanoseconds(message.header.stamp, "Trajectory refused: header.stamp")


def tolerances_of(goal: Any, sides: Sequence[Side]) -> tuple[Mapping[Side, Tolerances], str]:
    """The tolerances of a goal for each arm, and why all are the controller's own after all; empty if they are not.

    As upstream, an unknown joint or a negative tolerance other than -1 takes back every tolerance of the goal.

    Raises:
        TrajectoryRefused: a tolerance is NaN.
        CommandRefused: a time has more nanoseconds than a second.
    """
    known = {name for side in sides for name in joint_names(side)}
    own: Mapping[Side, Tolerances] = {side: Tolerances() for side in sides}
    for each in (*goal.path_tolerance, *goal.goal_tolerance):
        if each.name not in known:
            return own, f"{quoted(each.name)} is not a joint of this controller"
        values = (each.position, each.velocity, each.acceleration)
        if any(map(isnan, values)):
            raise trajectory_refused(said("joint_tolerance_not_a_number", joint=each.name))
        if any(value < 0.0 and value != UNLIMITED_TOLERANCE for value in values):
            return own, f"a tolerance of {each.name} is negative; -1 is unlimited"
    time = seconds(goal.goal_time_tolerance, "Trajectory refused: goal_time_tolerance")
    if time < 0.0 and time != UNLIMITED_TOLERANCE:
        return own, f"goal_time_tolerance is {time:g} s; -1 is unlimited"

    def chosen(tolerances: Iterable[Any], side: Side, field: str) -> Joints:
        named = {each.name: float(getattr(each, field)) for each in tolerances}
        return joints([named.get(name, DEFAULT_TOLERANCE) for name in joint_names(side)])

    return {
        side: Tolerances(
            path=chosen(goal.path_tolerance, side, "position"),
            path_velocity=chosen(goal.path_tolerance, side, "velocity"),
            goal=chosen(goal.goal_tolerance, side, "position"),
            goal_velocity=chosen(goal.goal_tolerance, side, "velocity"),
            goal_time=time,
        )
        for side in sides
    }, ""


def feedback_message(feedbacks: Mapping[Side, TrajectoryFeedback], time_ns: int, frame: str = "") -> Any:
    """The feedback of an action that moves the arms of ``feedbacks``; ``frame`` as in joint states."""
    message = FollowJointTrajectory.Feedback(header=Header(stamp=stamp(time_ns), frame_id=frame))
    message.joint_names = _names(feedbacks)
    message.desired, message.actual, message.error = _points(feedbacks)
    return message


def state_message(feedbacks: Mapping[Side, TrajectoryFeedback], time_ns: int, frame: str = "") -> Any:
    """The state of a controller that commands the arms of ``feedbacks``; its error is reference - feedback."""
    message = JointTrajectoryControllerState(header=Header(stamp=stamp(time_ns), frame_id=frame))
    message.joint_names = _names(feedbacks)
    message.reference, message.feedback, message.error = _points(feedbacks)
    rows = ("output", "output_velocity")
    message.output.positions, message.output.velocities = (
        [value for feedback in feedbacks.values() for value in getattr(feedback, row)] for row in rows
    )
    message.output.time_from_start = message.reference.time_from_start
    if hasattr(message, "speed_scaling_factor"):  # since control_msgs 5.3.0
        message.speed_scaling_factor = min(feedback.scale for feedback in feedbacks.values())
    return message


def _names(feedbacks: Mapping[Side, TrajectoryFeedback]) -> list[str]:
    return [name for side in feedbacks for name in joint_names(side)]


def _points(feedbacks: Mapping[Side, TrajectoryFeedback]) -> tuple[Any, Any, Any]:
    """Desired, actual, and desired - actual."""
    whole, rest = divmod(max(0, round(next(iter(feedbacks.values())).progress * 1e9)), 10**9)
    time = Duration(sec=whole, nanosec=rest)

    def row(field: str) -> list[float]:
        return [value for feedback in feedbacks.values() for value in getattr(feedback, field)]

    desired, actual = (row("desired"), row("desired_velocity")), (row("actual"), row("actual_velocity"))
    error = [[want - have for want, have in zip(*rows, strict=True)] for rows in zip(desired, actual, strict=True)]
    return tuple(
        JointTrajectoryPoint(positions=position, velocities=velocity, time_from_start=time)
        for position, velocity in (desired, actual, error)
    )
