"""A second library on our URDF has the same kinematics: forward, tool and work object, Jacobian, and inverse."""

from __future__ import annotations

import numpy as np
import pytest

from abb_protocols.robot.inverse_kinematics import arm_angle, jacobian, postures
from abb_protocols.robot.joints import Joints, Pose, Side, joint_names
from abb_protocols.robot.kinematics import (
    compose_poses,
    inverse_pose,
    matrix_from_quaternion,
    quaternion_of,
    tool0_to_body,
)
from abb_protocols.robot.urdf import robot_description
from soak import long, short
from unit.robot.test_robot_inverse_kinematics import random_postures

pin = pytest.importorskip("pinocchio", reason="needs yumi-ros2[planning]")

TOOL = Pose((0.02, -0.01, 0.15), quaternion_of((0.3, -0.2, 0.5)))
WORK_OBJECT = Pose((0.4, -0.1, 0.2), quaternion_of((0.1, 0.2, -0.7)))


@pytest.fixture(scope="module")
def model():
    return pin.buildModelFromXML(robot_description())


def configured(model, side: Side, position: Joints) -> np.ndarray:
    values = pin.neutral(model)
    for name, value in zip(joint_names(side), position, strict=True):
        values[model.joints[model.getJointId(name)].idx_q] = value
    return values


def as_se3(pose: Pose):
    return pin.SE3(matrix_from_quaternion(pose.orientation), np.array(pose.position))


def test_tool_and_work_object_are_where_pinocchio_says(model) -> None:
    data = model.createData()
    for side, position in random_postures(3300, 200):
        pin.framesForwardKinematics(model, data, configured(model, side, position))
        tool0 = data.oMf[model.getFrameId(f"yumi_tool0_{side.value}")]
        expected = as_se3(WORK_OBJECT).inverse() * tool0 * as_se3(TOOL)
        found = compose_poses(inverse_pose(WORK_OBJECT), tool0_to_body(side, position, TOOL))
        assert np.array(found.position) == pytest.approx(expected.translation, abs=1e-9)
        assert matrix_from_quaternion(found.orientation) == pytest.approx(expected.rotation, abs=1e-9)


def test_the_jacobian_is_pinocchios(model) -> None:
    data = model.createData()
    for side, position in random_postures(3301, 50):
        frame = model.getFrameId(f"yumi_tool0_{side.value}")
        values = configured(model, side, position)
        expected = pin.computeFrameJacobian(model, data, values, frame, pin.LOCAL_WORLD_ALIGNED)
        columns = [model.joints[model.getJointId(name)].idx_v for name in joint_names(side)]
        assert jacobian(side, position) == pytest.approx(expected[:, columns], abs=1e-9)


@pytest.mark.parametrize("count", [short(10), long(1000, 1800.0)])
def test_every_posture_has_its_pose_in_pinocchio(model, count: int) -> None:
    data = model.createData()
    for side, position in random_postures(3302, count):
        pose = tool0_to_body(side, position)
        for each in postures(side, pose, arm_angle(side, position)):
            pin.framesForwardKinematics(model, data, configured(model, side, each))
            found = data.oMf[model.getFrameId(f"yumi_tool0_{side.value}")]
            assert found.translation == pytest.approx(np.array(pose.position), abs=1e-9)
            assert found.rotation == pytest.approx(matrix_from_quaternion(pose.orientation), abs=1e-9)
