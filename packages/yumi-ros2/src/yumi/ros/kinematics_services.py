"""Services of one arm's kinematics: all postures of a pose, and how the tool moves with the joints."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import isfinite
from typing import Any

from sensor_msgs.msg import JointState
from yumi_interfaces.srv import InverseKinematics, Jacobian

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, RobotNotReady, YumiError
from abb_protocols.robot.inverse_kinematics import arm_angle, jacobian, postures, unreachable
from abb_protocols.robot.joints import JOINT_COUNT, YUMI_LIMITS, Joints, Side, joint_names, joints
from abb_protocols.robot.kinematics import compose_poses, inverse_pose
from yumi.control.motion.setpoint import largest_difference
from yumi.planning.tool_path import checked_pose
from yumi.ros.frames import RobotFrames
from yumi.ros.messages import SERVICES_QOS, pose_of_ros_message, say_why


class KinematicsServices:
    """Serves ``<controller>/inverse_kinematics`` and ``<controller>/jacobian`` of one arm.

    Args:
        node: the controller's.
        side: which arm.
        controller: its name.
        frames: of the robot.
    """

    def __init__(self, node: Any, side: Side, controller: str, frames: RobotFrames) -> None:
        self._node, self._side, self._frames = node, side, frames
        self._services = [
            node.create_service(kind, f"{controller}/{name}", partial(_answered, answer), qos_profile=SERVICES_QOS)
            for kind, name, answer in (
                (InverseKinematics, "inverse_kinematics", self._postures),
                (Jacobian, "jacobian", self._jacobian),
            )
        ]

    def destroy(self) -> None:
        """Serve no longer."""
        for service in self._services:
            self._node.destroy_service(service)

    def _now(self) -> Joints:
        state = self._frames.measured(self._side)
        if state is None:
            raise RobotNotReady(message("position_unknown", arm=self._side.word))
        return state.position

    def _postures(self, request: Any, response: Any) -> None:
        side, pose = self._side, request.target_pose
        target = compose_poses(self._frames.to_base(pose.header.frame_id), checked_pose(pose_of_ros_message(pose.pose)))
        tool0 = compose_poses(target, inverse_pose(self._frames.tool(side, request.tool_frame)))
        now = self._now()
        angle = request.arm_angle if request.turn_elbow else arm_angle(side, now)
        if not isfinite(angle):
            raise CommandRefused(message("arm_angle_not_finite", value=angle))
        found = sorted(postures(side, tool0, angle, YUMI_LIMITS), key=lambda each: largest_difference(each, now))
        response.postures = [JointState(name=joint_names(side), position=each) for each in found]
        response.success = bool(found)
        if not found:
            reason = message("no_posture_with_arm_angle", arm=side.word)
            say_why(response, unreachable(side, tool0, reason, now))

    def _jacobian(self, request: Any, response: Any) -> None:
        position = request.position if len(request.position) else self._now()
        if len(position) != JOINT_COUNT or not all(map(isfinite, position)):
            raise CommandRefused(message("no_joint_positions", joints=JOINT_COUNT))
        tool = self._frames.tool(self._side, request.tool_frame)
        response.jacobian = jacobian(self._side, joints(position), tool).ravel()
        response.success = True


def _answered(answer: Callable[[Any, Any], None], request: Any, response: Any) -> Any:
    """A response that says why where a request is refused."""
    try:
        answer(request, response)
    except YumiError as error:
        say_why(response, error)
    return response
