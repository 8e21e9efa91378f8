"""Forward kinematics of one arm: axes and offsets, foot to tool0; the arithmetic of poses, rotations and quaternions.

In the all-zero pose every axis of the arm is parallel to an axis of the arm's foot frame: 1 z, 2 y, 7 z, 3 y,
4 x, 5 y, 6 x. So the chain is seven plane rotations with an offset in front of each (reference/yumi.md §1.4; it
reproduces ten poses of RobotStudio). :func:`tool0_to_body` is that chain, written out: no matrix is needed, and one
posture takes 4 µs, where :class:`abb_protocols.robot.chain.Chain`, for many at once, takes 60 µs.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import asin, atan2, copysign, cos, dist, hypot, pi, sin, tau

import numpy as np
from numpy.typing import NDArray

from abb_protocols.robot.joints import Joints, Pose, Quaternion, Side, Vector, rotate

# The arm in its all-zero pose, in the foot frame: x forward, z along axis 1 [m].
_SHOULDER_HEIGHT = 0.166
SHOULDER_OFFSET = 0.030
UPPER_ARM = 0.2515
ELBOW_OFFSET = 0.0405
FOREARM = 0.265
WRIST_OFFSET = 0.027
FLANGE_OFFSET = 0.036

# The same as a chain, in chain order.
TURNS_ABOUT = (2, 1, 2, 1, 0, 1, 0)
"""The axis of the foot frame that each joint turns about in the all-zero pose: 0 x, 1 y, 2 z."""
JOINT_OFFSETS: tuple[Vector, ...] = (
    (0.0, 0.0, _SHOULDER_HEIGHT),
    (-SHOULDER_OFFSET, 0.0, 0.0),
    (SHOULDER_OFFSET, 0.0, 0.0),
    (ELBOW_OFFSET, 0.0, UPPER_ARM),
    (0.0, 0.0, ELBOW_OFFSET),
    (FOREARM, 0.0, -WRIST_OFFSET),
    (0.0, 0.0, WRIST_OFFSET),
)
"""What is in front of each joint in the all-zero pose [m]."""
ELBOW_AXIS, WRIST_AXIS = 3, 6
"""Indices of the axis whose direction the arm angle is of, and of the one that begins at the wrist."""

IDENTITY_QUATERNION: Quaternion = (1.0, 0.0, 0.0, 0.0)

# gravity_alpha, gravity_beta, gamma_rotation of MOC.cfg for the left arm; the right one mirrors (§1.5) [rad].
_LEFT_FOOT_ALPHA, _LEFT_FOOT_BETA, _LEFT_FOOT_GAMMA = -0.629233, 0.950657, -0.184266
_LEFT_FOOT_Y, _FOOT_Z = 0.050, 0.384


def quaternion_product(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation ``b`` followed by ``a``, both seen from the fixed frame: a ⊗ b."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def compose_poses(b_to_a: Pose, c_to_b: Pose) -> Pose:
    """Frame c seen from frame a."""
    x, y, z = rotate(b_to_a.orientation, c_to_b.position)
    ax, ay, az = b_to_a.position
    return Pose((ax + x, ay + y, az + z), quaternion_product(b_to_a.orientation, c_to_b.orientation))


def inverse_pose(b_to_a: Pose) -> Pose:
    """Frame a seen from frame b."""
    w, x, y, z = b_to_a.orientation
    back = (w, -x, -y, -z)
    px, py, pz = rotate(back, b_to_a.position)
    return Pose((-px, -py, -pz), back)


def rotation_vector(orientation: Quaternion) -> Vector:
    """A rotation as its axis times its angle [rad], at most half a turn."""
    w, x, y, z = orientation
    sine = hypot(x, y, z)
    if sine < 1e-12:
        return (0.0, 0.0, 0.0)
    angle = 2.0 * atan2(sine, w)
    factor = (angle - tau if angle > pi else angle) / sine
    return (factor * x, factor * y, factor * z)


def quaternion_of(rotation: Vector, factor: float = 1.0) -> Quaternion:
    """The rotation by ``factor`` times an axis times its angle [rad]."""
    x, y, z = rotation
    angle = hypot(x, y, z)
    if angle < 1e-12:
        return IDENTITY_QUATERNION
    half = 0.5 * factor * angle
    s = sin(half) / angle
    return (cos(half), s * x, s * y, s * z)


def unit_quaternion(orientation: Quaternion) -> Quaternion:
    """The quaternion of length 1."""
    size = hypot(*orientation)
    w, x, y, z = orientation
    return (w / size, x / size, y / size, z / size)


def turn_between(first: Quaternion, then: Quaternion) -> Vector:
    """The rotation vector that turns one orientation into another one, by half a turn at most [rad]."""
    w, x, y, z = first
    return rotation_vector(quaternion_product(then, (w, -x, -y, -z)))


def pose_distance(first: Pose, then: Pose) -> tuple[float, float]:
    """How far two poses are apart: the distance [m] and the turn [rad]."""
    return dist(first.position, then.position), hypot(*turn_between(first.orientation, then.orientation))


def euler_zyx(orientation: Quaternion) -> Vector:
    """Roll, pitch, yaw about x, y, z of a ZYX rotation [rad], as EGM's EgmEuler (reference/egm.md §2.4)."""
    w, x, y, z = orientation
    sine_of_pitch = 2.0 * (w * y - x * z)
    return (
        atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        asin(max(-1.0, min(1.0, sine_of_pitch))),  # rounding must not push it out of asin's domain
        atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def quaternion_from_euler_zyx(rpy: Vector) -> Quaternion:
    """The orientation Rz(yaw)·Ry(pitch)·Rx(roll) from roll, pitch, yaw [rad]; URDF's ``rpy`` is the same."""
    roll, pitch, yaw = rpy
    return quaternion_product(quaternion_product(_about_z(yaw), _about_y(pitch)), _about_x(roll))


def quaternion_of_upper_half(orientation: Quaternion) -> Quaternion:
    """Of the two quaternions of one rotation, the one with w ≥ 0, as RAPID writes them."""
    w, x, y, z = orientation
    return (w, x, y, z) if copysign(1.0, w) > 0.0 else (-w, -x, -y, -z)


def matrix_from_quaternion(orientation: Quaternion) -> NDArray[np.float64]:
    """The rotation matrix of a unit quaternion, (3, 3)."""
    w, x, y, z = orientation
    return np.array(
        [
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        ]
    )


def quaternion_from_matrix(rotation: NDArray[np.float64]) -> Quaternion:
    """The unit quaternion with w ≥ 0 of a rotation matrix, (3, 3)."""
    # The eigenvector of the largest eigenvalue of this matrix, whatever the angle (I. Bar-Itzhack, 2000).
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    outer = [
        (xx - yy - zz, yx + xy, zx + xz, zy - yz),
        (yx + xy, yy - xx - zz, zy + yz, xz - zx),
        (zx + xz, zy + yz, zz - xx - yy, yx - xy),
        (zy - yz, xz - zx, yx - xy, xx + yy + zz),
    ]
    x, y, z, w = np.linalg.eigh(outer)[1][:, 3].tolist()
    return quaternion_of_upper_half((w, x, y, z))


def _about_x(angle: float) -> Quaternion:
    return (cos(angle / 2.0), sin(angle / 2.0), 0.0, 0.0)


def _about_y(angle: float) -> Quaternion:
    return (cos(angle / 2.0), 0.0, sin(angle / 2.0), 0.0)


def _about_z(angle: float) -> Quaternion:
    return (cos(angle / 2.0), 0.0, 0.0, sin(angle / 2.0))


def _foot(mirror: float) -> Pose:
    alpha, beta, gamma = mirror * _LEFT_FOOT_ALPHA, _LEFT_FOOT_BETA, mirror * _LEFT_FOOT_GAMMA
    turned = quaternion_product(quaternion_of((alpha, 0.0, 0.0)), quaternion_of((0.0, beta, 0.0)))
    orientation = quaternion_product(turned, quaternion_of((0.0, 0.0, gamma)))
    return Pose((0.0, mirror * _LEFT_FOOT_Y, _FOOT_Z), orientation)


_FEET = {Side.LEFT: _foot(1.0), Side.RIGHT: _foot(-1.0)}
_BODY_TO_FOOT = {side: inverse_pose(foot) for side, foot in _FEET.items()}

ARM_ANGLE_REFERENCES: Mapping[Side, Vector] = {
    side: rotate(rotation.orientation, (0.0, 1.0 if side is Side.RIGHT else -1.0, 0.0))
    for side, rotation in _BODY_TO_FOOT.items()
}
"""Where the arm angle is counted from: along the body's y axis towards the other arm, in the foot frame (§5.2)."""


def foot_to_body(side: Side) -> Pose:
    """Where the arm is bolted to the body: its foot frame in ``yumi_body``, ABB's base frame of the robot."""
    return _FEET[side]


def tool0_to_foot(position: Joints, tool: Pose | None = None) -> Pose:
    """Pose of tool0 in the arm's foot frame.

    Args:
        position: joint positions in chain order [rad], (7,); limits are not checked.
        tool: a tool frame in tool0, RAPID's ``tframe``; None is tool0 itself.
    """
    flange = Pose(*_chain(position))
    return flange if tool is None else compose_poses(flange, tool)


def tool0_to_body(side: Side, position: Joints, tool: Pose | None = None) -> Pose:
    """Pose of tool0 in the body frame, which is what RAPID and EGM call world.

    Args:
        side: the arm.
        position: joint positions in chain order [rad], (7,); limits are not checked.
        tool: a tool frame in tool0, RAPID's ``tframe``; None is tool0 itself.
    """
    pose = compose_poses(_FEET[side], tool0_to_foot(position, tool))
    return Pose(pose.position, quaternion_of_upper_half(pose.orientation))


def _chain(position: Joints) -> tuple[Vector, Quaternion]:
    """Unrolled from flange to foot: the virtual robot calls it four times in 4 ms."""
    a1, a2, a7, a3, a4, a5, a6 = position
    # Flange and wrist, turned by axis 5 (y) and axis 4 (x); axis 6 runs through the flange's centre.
    s, c = sin(a5), cos(a5)
    x, y, z = c * FLANGE_OFFSET + s * WRIST_OFFSET, 0.0, c * WRIST_OFFSET - s * FLANGE_OFFSET - WRIST_OFFSET
    s, c = sin(a4), cos(a4)
    y, z = -s * z, c * z
    # Forearm, turned by axis 3 (y); upper arm by axis 7 (z) and axis 2 (y).
    x, z = x + FOREARM, z + ELBOW_OFFSET
    s, c = sin(a3), cos(a3)
    x, z = c * x + s * z + ELBOW_OFFSET, c * z - s * x
    s, c = sin(a7), cos(a7)
    x, y = c * x - s * y + SHOULDER_OFFSET, s * x + c * y
    z += UPPER_ARM
    s, c = sin(a2), cos(a2)
    x, z = c * x + s * z - SHOULDER_OFFSET, c * z - s * x + _SHOULDER_HEIGHT
    s, c = sin(a1), cos(a1)
    shoulder = quaternion_product(_about_z_then_y(a1, a2), _about_z_then_y(a7, a3))
    wrist = quaternion_product(_about_x_then_y(a4, a5), _about_x_then_y(a6, pi / 2.0))
    return (c * x - s * y, s * x + c * y, z), quaternion_product(shoulder, wrist)


def _about_z_then_y(z_angle: float, y_angle: float) -> Quaternion:
    sz, cz, sy, cy = sin(z_angle / 2.0), cos(z_angle / 2.0), sin(y_angle / 2.0), cos(y_angle / 2.0)
    return (cz * cy, -sz * sy, cz * sy, sz * cy)


def _about_x_then_y(x_angle: float, y_angle: float) -> Quaternion:
    sx, cx, sy, cy = sin(x_angle / 2.0), cos(x_angle / 2.0), sin(y_angle / 2.0), cos(y_angle / 2.0)
    return (cx * cy, sx * cy, cx * sy, sx * sy)
