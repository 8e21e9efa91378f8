"""The arms of a YuMi as data, and its arm alone (IRB 14050)."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import atan2, cos, pi, sin, tau

import numpy as np

from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.confdata import configuration
from abb_protocols.robot.inverse_kinematics import TO_TOOL0, postures
from abb_protocols.robot.joints import CHAIN_AXES, ORIGIN_POSE, YUMI_LIMITS, JointLimits, Joints, Pose, Side, home
from abb_protocols.robot.kinematics import (
    FLANGE_OFFSET,
    JOINT_OFFSETS,
    compose_poses,
    foot_to_body,
    matrix_from_quaternion,
)
from abb_protocols.robot.rotations import cross


@cache
def yumi_arm(side: Side, limits: JointLimits = YUMI_LIMITS) -> KinematicArm:
    """One arm of an IRB 14000; the world is the body frame."""
    return KinematicArm(
        **vars(TO_TOOL0[side]),
        name=f"{side.word} arm",
        axes=CHAIN_AXES,
        foot_to_world=foot_to_body(side),
        limits=limits,
        home=home(side),
        configuration=configuration,
        tool_speed=1.5,
        tool_acceleration=11.0,
        find_postures=lambda tool0, angle: postures(side, tool0, angle, limits),
        is_of_yumi=True,
    )


@cache
def irb14050() -> KinematicArm:
    """The single-arm YuMi: the arm of an IRB 14000 on its foot, its arm angle counted from the foot's z axis."""
    arm, z = yumi_arm(Side.LEFT), np.array([0.0, 0.0, 1.0])

    def find(tool0: Pose, angle: float) -> tuple[Joints, ...]:
        # The same half-plane of the elbow, counted from the direction that an IRB 14000's arm counts from.
        turned = matrix_from_quaternion(tool0.orientation)
        wrist = np.array(tool0.position) - turned[:, 2] * FLANGE_OFFSET
        line = (wrist - JOINT_OFFSETS[0]) / np.linalg.norm(wrist - JOINT_OFFSETS[0])
        across = cross(line, z)
        across = across / np.linalg.norm(across)
        inside = cross(across, line) * cos(angle - pi / 2.0) + across * sin(angle - pi / 2.0)
        other = cross(line, np.array(arm.reference))
        other = other / np.linalg.norm(other)
        counted = atan2(float(inside @ other), float(inside @ cross(other, line))) + pi / 2.0
        return arm.find_postures(compose_poses(arm.foot_to_world, tool0), float((counted + pi) % tau - pi))

    return replace(
        arm,
        name="robot",
        foot_to_world=ORIGIN_POSE,
        reference=(0.0, 0.0, 1.0),
        find_postures=find,
        is_of_yumi=False,
    )
