"""Kinematics of one arm in plain numbers: where the tool is, how it moves with the joints, and the rotations of both.

In the all-zero pose every axis of the arm is parallel to an axis of the arm's foot frame: 1 z, 2 y, 7 z, 3 y,
4 x, 5 y, 6 x. So the chain is seven plane rotations with an offset in front of each, and no matrix is needed
(reference/yumi.md §1.4; it reproduces ten poses of RobotStudio). :func:`tool0_to_body` is that chain.

Differential kinematics is fast enough for every cycle of the control loop: :func:`wrist_of` is forward kinematics with
all derivatives, :class:`DifferentialSolver` the step of the joints that makes up for what is missing to a target, and
:func:`posture_near` repeats that step. A pose and an arm angle are seven equations, those of
:mod:`yumi.robot.inverse_kinematics`; the wrist and the frame of axis 6 stand for tool0, which only lies the flange's
length further along. Where axes are in line, the step is damped (Y. Nakamura, H. Hanafusa, 1986): no joint has to jump,
and the arm angle, which counts least, gives way first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import asin, atan2, copysign, cos, hypot, inf, pi, sin, sqrt, tau
from operator import mul
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from yumi.robot.joints import Joints, Pose, Quaternion, Side, Vector, joints, rotate

# The arm in its all-zero pose, in the foot frame: x forward, z along axis 1 [m].
SHOULDER_HEIGHT = 0.166
SHOULDER_OFFSET = 0.030
UPPER_ARM = 0.2515
ELBOW_OFFSET = 0.0405
FOREARM = 0.265
WRIST_OFFSET = 0.027
FLANGE = 0.036

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)

# gravity_alpha, gravity_beta, gamma_rotation of MOC.cfg for the left arm; the right one mirrors (§1.5) [rad].
_LEFT_FOOT_ALPHA, _LEFT_FOOT_BETA, _LEFT_FOOT_GAMMA = -0.629233, 0.950657, -0.184266
_LEFT_FOOT_Y, _FOOT_Z = 0.050, 0.384


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation ``b`` followed by ``a``, both seen from the fixed frame: a ⊗ b."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def compose(b_to_a: Pose, c_to_b: Pose) -> Pose:
    """Frame c seen from frame a."""
    x, y, z = rotate(b_to_a.orientation, c_to_b.position)
    ax, ay, az = b_to_a.position
    return Pose((ax + x, ay + y, az + z), multiply(b_to_a.orientation, c_to_b.orientation))


def inverse(b_to_a: Pose) -> Pose:
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
        return IDENTITY
    half = 0.5 * factor * angle
    s = sin(half) / angle
    return (cos(half), s * x, s * y, s * z)


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
    return multiply(multiply(_about_z(yaw), _about_y(pitch)), _about_x(roll))


def upper_half(orientation: Quaternion) -> Quaternion:
    """Of the two quaternions of one rotation, the one with w ≥ 0, as RAPID writes them."""
    w, x, y, z = orientation
    return (w, x, y, z) if copysign(1.0, w) > 0.0 else (-w, -x, -y, -z)


def matrix(orientation: Quaternion) -> NDArray[np.float64]:
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
    return upper_half((w, x, y, z))


def _about_x(angle: float) -> Quaternion:
    return (cos(angle / 2.0), sin(angle / 2.0), 0.0, 0.0)


def _about_y(angle: float) -> Quaternion:
    return (cos(angle / 2.0), 0.0, sin(angle / 2.0), 0.0)


def _about_z(angle: float) -> Quaternion:
    return (cos(angle / 2.0), 0.0, 0.0, sin(angle / 2.0))


def _foot(mirror: float) -> Pose:
    alpha, beta, gamma = mirror * _LEFT_FOOT_ALPHA, _LEFT_FOOT_BETA, mirror * _LEFT_FOOT_GAMMA
    orientation = multiply(multiply(_about_x(alpha), _about_y(beta)), _about_z(gamma))
    return Pose((0.0, mirror * _LEFT_FOOT_Y, _FOOT_Z), orientation)


_FEET = {Side.LEFT: _foot(1.0), Side.RIGHT: _foot(-1.0)}
_BODY_TO_FOOT = {side: inverse(foot) for side, foot in _FEET.items()}

ARM_ANGLE_REFERENCES: Mapping[Side, Vector] = {
    side: rotate(rotation.orientation, (0.0, 1.0 if side is Side.RIGHT else -1.0, 0.0))
    for side, rotation in _BODY_TO_FOOT.items()
}
"""Where the arm angle is counted from: along the body's y axis towards the other arm, in the foot frame (§5.2)."""


# ---- where the tool is


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
    return flange if tool is None else compose(flange, tool)


def tool0_to_body(side: Side, position: Joints, tool: Pose | None = None) -> Pose:
    """Pose of tool0 in the body frame, which is what RAPID and EGM call world.

    Args:
        side: the arm.
        position: joint positions in chain order [rad], (7,); limits are not checked.
        tool: a tool frame in tool0, RAPID's ``tframe``; None is tool0 itself.
    """
    pose = compose(_FEET[side], tool0_to_foot(position, tool))
    return Pose(pose.position, upper_half(pose.orientation))


def _chain(position: Joints) -> tuple[Vector, Quaternion]:
    """Unrolled from flange to foot: the virtual robot calls it four times in 4 ms."""
    a1, a2, a7, a3, a4, a5, a6 = position
    # Flange and wrist, turned by axis 5 (y) and axis 4 (x); axis 6 runs through the flange's centre.
    s, c = sin(a5), cos(a5)
    x, y, z = c * FLANGE + s * WRIST_OFFSET, 0.0, c * WRIST_OFFSET - s * FLANGE - WRIST_OFFSET
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
    x, z = c * x + s * z - SHOULDER_OFFSET, c * z - s * x + SHOULDER_HEIGHT
    s, c = sin(a1), cos(a1)
    shoulder = multiply(_about_z_then_y(a1, a2), _about_z_then_y(a7, a3))
    wrist = multiply(_about_x_then_y(a4, a5), _about_x_then_y(a6, pi / 2.0))
    return (c * x - s * y, s * x + c * y, z), multiply(shoulder, wrist)


def _about_z_then_y(z_angle: float, y_angle: float) -> Quaternion:
    sz, cz, sy, cy = sin(z_angle / 2.0), cos(z_angle / 2.0), sin(y_angle / 2.0), cos(y_angle / 2.0)
    return (cz * cy, -sz * sy, cz * sy, sz * cy)


def _about_x_then_y(x_angle: float, y_angle: float) -> Quaternion:
    sx, cx, sy, cy = sin(x_angle / 2.0), cos(x_angle / 2.0), sin(y_angle / 2.0), cos(y_angle / 2.0)
    return (cx * cy, sx * cy, cx * sy, sx * sy)


# ---- how the tool moves with the joints

CONVERGED = 1e-12
"""A posture that misses its target by less has it [m], [rad].

Near a singularity a joint is off by a million times more.
"""

_METRE_IN_RADIANS = 4.0  # what a metre counts beside a radian of the tool's orientation
_LEAST_DAMPING = 1e-14  # squared: without effect where the pose depends on the joints
_SINGULAR = 0.05  # damped where it depends on them less than this
_ELBOW_FREEDOM = 0.05  # squared: the elbow gives way where it turns less than this with the joints, the pose held
_NOT_ZERO = 1e-30  # squared: the arm angle of an elbow on the line from shoulder to wrist is any

Row = tuple[float, float, float, float, float, float, float]
"""Seven numbers: one for each joint, chain order, or one for each equation."""


class WristTarget(NamedTuple):
    """A pose of tool0 and an arm angle, in the foot frame.

    Attributes:
        wrist: where axis 6 starts [m].
        x: direction of axis 6.
        y: second direction of the frame at a6 = 0.
        z: third one.
        angle: the arm angle [rad].
    """

    wrist: Vector
    x: Vector
    y: Vector
    z: Vector
    angle: float


class Wrist(NamedTuple):
    """Where a posture has its wrist, and how that changes with the joints, in the foot frame.

    Attributes:
        wrist, x, y, z, angle: as in :class:`WristTarget`.
        velocity: of the wrist with each joint, rows x, y, z [m/rad], (3, 7).
        rotation: of its frame with each joint, rows x, y, z, (3, 7).
        elbow: of the arm angle with each joint, (7,).
    """

    wrist: Vector
    x: Vector
    y: Vector
    z: Vector
    angle: float
    velocity: tuple[Row, Row, Row]
    rotation: tuple[Row, Row, Row]
    elbow: Row


def wrist_target(side: Side, tool0: Pose, angle: float) -> WristTarget:
    """The target of a pose of tool0 in the body frame and an arm angle [rad]."""
    in_foot = compose(_BODY_TO_FOOT[side], tool0)
    w, x, y, z = in_foot.orientation
    # Columns of the rotation matrix of tool0: its z runs along axis 6, its x against the frame's third direction.
    first = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y))
    second = (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x))
    third = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))
    px, py, pz = in_foot.position
    wrist = (px - FLANGE * third[0], py - FLANGE * third[1], pz - FLANGE * third[2])
    return WristTarget(wrist, third, second, (-first[0], -first[1], -first[2]), angle)


def rotated_to_foot(side: Side, vector: Vector) -> Vector:
    """A direction or velocity of the body frame as the foot frame has it."""
    return rotate(_BODY_TO_FOOT[side].orientation, vector)


def wrist_of(side: Side, position: Joints) -> Wrist:  # noqa: PLR0915 - seven axes, one after the other
    """Wrist, arm angle and all their derivatives of a posture, written out: about 10 µs."""
    a1, a2, a7, a3, a4, a5, a6 = position
    s, c = sin(a1), cos(a1)
    x1, x2, x3 = c, s, 0.0
    y1, y2, y3 = -s, c, 0.0
    # Axis 2 turns about y, behind half the offset of the shoulder; axis 7 about z, axis 3 about y.
    p2x, p2y, p2z = -SHOULDER_OFFSET * x1, -SHOULDER_OFFSET * x2, SHOULDER_HEIGHT
    b1, b2 = y1, y2
    s, c = sin(a2), cos(a2)
    z1, z2, z3 = s * x1, s * x2, c
    x1, x2, x3 = c * x1, c * x2, -s
    p3x, p3y, p3z = p2x + SHOULDER_OFFSET * x1, p2y + SHOULDER_OFFSET * x2, p2z + SHOULDER_OFFSET * x3
    c1, c2, c3 = z1, z2, z3
    s, c = sin(a7), cos(a7)
    x1, x2, x3, y1, y2, y3 = (
        c * x1 + s * y1,
        c * x2 + s * y2,
        c * x3 + s * y3,
        c * y1 - s * x1,
        c * y2 - s * x2,
        c * y3 - s * x3,
    )
    p4x = p3x + ELBOW_OFFSET * x1 + UPPER_ARM * z1
    p4y = p3y + ELBOW_OFFSET * x2 + UPPER_ARM * z2
    p4z = p3z + ELBOW_OFFSET * x3 + UPPER_ARM * z3
    e1, e2, e3 = y1, y2, y3
    s, c = sin(a3), cos(a3)
    x1, x2, x3, z1, z2, z3 = (
        c * x1 - s * z1,
        c * x2 - s * z2,
        c * x3 - s * z3,
        c * z1 + s * x1,
        c * z2 + s * x2,
        c * z3 + s * x3,
    )
    # Axis 4 turns about x, axis 5 about y, axis 6 about x.
    p5x, p5y, p5z = p4x + ELBOW_OFFSET * z1, p4y + ELBOW_OFFSET * z2, p4z + ELBOW_OFFSET * z3
    f1, f2, f3 = x1, x2, x3
    s, c = sin(a4), cos(a4)
    y1, y2, y3, z1, z2, z3 = (
        c * y1 + s * z1,
        c * y2 + s * z2,
        c * y3 + s * z3,
        c * z1 - s * y1,
        c * z2 - s * y2,
        c * z3 - s * y3,
    )
    p6x, p6y, p6z = (
        p5x + FOREARM * x1 - WRIST_OFFSET * z1,
        p5y + FOREARM * x2 - WRIST_OFFSET * z2,
        p5z + FOREARM * x3 - WRIST_OFFSET * z3,
    )
    g1, g2, g3 = y1, y2, y3
    s, c = sin(a5), cos(a5)
    x1, x2, x3, z1, z2, z3 = (
        c * x1 - s * z1,
        c * x2 - s * z2,
        c * x3 - s * z3,
        c * z1 + s * x1,
        c * z2 + s * x2,
        c * z3 + s * x3,
    )
    wx, wy, wz = p6x + WRIST_OFFSET * z1, p6y + WRIST_OFFSET * z2, p6z + WRIST_OFFSET * z3
    s, c = sin(a6), cos(a6)
    y1, y2, y3, z1, z2, z3 = (
        c * y1 + s * z1,
        c * y2 + s * z2,
        c * y3 + s * z3,
        c * z1 - s * y1,
        c * z2 - s * y2,
        c * z3 - s * y3,
    )

    # The wrist's velocity with each joint: its axis × the way from there to the wrist.
    ux, uy, uz = wx - p2x, wy - p2y, wz - p2z
    d1, d2, d3 = -wy, wx, 0.0
    d4, d5, d6 = b2 * uz, -b1 * uz, b1 * uy - b2 * ux
    ux, uy, uz = wx - p3x, wy - p3y, wz - p3z
    d7, d8, d9 = c2 * uz - c3 * uy, c3 * ux - c1 * uz, c1 * uy - c2 * ux
    ux, uy, uz = wx - p4x, wy - p4y, wz - p4z
    d10, d11, d12 = e2 * uz - e3 * uy, e3 * ux - e1 * uz, e1 * uy - e2 * ux
    ux, uy, uz = wx - p5x, wy - p5y, wz - p5z
    d13, d14, d15 = f2 * uz - f3 * uy, f3 * ux - f1 * uz, f1 * uy - f2 * ux
    ux, uy, uz = wx - p6x, wy - p6y, wz - p6z
    d16, d17, d18 = g2 * uz - g3 * uy, g3 * ux - g1 * uz, g1 * uy - g2 * ux

    # The arm angle lies between the reference and the elbow's axis e, seen along the line from shoulder to wrist.
    r1, r2, r3 = ARM_ANGLE_REFERENCES[side]
    lx, ly, lz = wx, wy, wz - SHOULDER_HEIGHT
    length = sqrt(lx * lx + ly * ly + lz * lz)
    lx, ly, lz = lx / length, ly / length, lz / length
    n1, n2, n3 = ly * r3 - lz * r2, lz * r1 - lx * r3, lx * r2 - ly * r1
    along, along_reference = lx * e1 + ly * e2 + lz * e3, lx * r1 + ly * r2 + lz * r3
    sine = n1 * e1 + n2 * e2 + n3 * e3
    cosine = e1 * r1 + e2 * r2 + e3 * r3 - along * along_reference
    size = max(sine * sine + cosine * cosine, _NOT_ZERO)
    angle = (atan2(sine, cosine) + 1.5 * pi) % tau - pi
    # Its change with the line's direction, then with the wrist; and with e, then with a turn of e.
    h1 = (cosine * (r2 * e3 - r3 * e2) + sine * (along_reference * e1 + along * r1)) / size
    h2 = (cosine * (r3 * e1 - r1 * e3) + sine * (along_reference * e2 + along * r2)) / size
    h3 = (cosine * (r1 * e2 - r2 * e1) + sine * (along_reference * e3 + along * r3)) / size
    ahead = h1 * lx + h2 * ly + h3 * lz
    h1, h2, h3 = (h1 - ahead * lx) / length, (h2 - ahead * ly) / length, (h3 - ahead * lz) / length
    k1 = (cosine * n1 - sine * (r1 - along_reference * lx)) / size
    k2 = (cosine * n2 - sine * (r2 - along_reference * ly)) / size
    k3 = (cosine * n3 - sine * (r3 - along_reference * lz)) / size
    k1, k2, k3 = e2 * k3 - e3 * k2, e3 * k1 - e1 * k3, e1 * k2 - e2 * k1
    elbow = (
        h1 * d1 + h2 * d2 + h3 * d3 + k3,
        h1 * d4 + h2 * d5 + h3 * d6 + b1 * k1 + b2 * k2,
        h1 * d7 + h2 * d8 + h3 * d9 + c1 * k1 + c2 * k2 + c3 * k3,
        h1 * d10 + h2 * d11 + h3 * d12,
        h1 * d13 + h2 * d14 + h3 * d15,
        h1 * d16 + h2 * d17 + h3 * d18,
        0.0,
    )
    return Wrist(
        (wx, wy, wz),
        (x1, x2, x3),
        (y1, y2, y3),
        (z1, z2, z3),
        angle,
        ((d1, d4, d7, d10, d13, d16, 0.0), (d2, d5, d8, d11, d14, d17, 0.0), (d3, d6, d9, d12, d15, d18, 0.0)),
        ((0.0, b1, c1, e1, f1, g1, x1), (0.0, b2, c2, e2, f2, g2, x2), (1.0, 0.0, c3, e3, f3, g3, x3)),
        elbow,
    )


def target_error(now: Wrist, target: WristTarget) -> Row:
    """What is missing to a target: position [m], rotation [rad] and arm angle [rad], (7,), in the foot frame."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = now.x, now.y, now.z
    (ux, uy, uz), (vx, vy, vz), (wx, wy, wz) = target.x, target.y, target.z
    # Half the sum of the cross products of the directions: the axis times the sine of the angle between the frames.
    rx = 0.5 * (ay * uz - az * uy + by * vz - bz * vy + cy * wz - cz * wy)
    ry = 0.5 * (az * ux - ax * uz + bz * vx - bx * vz + cz * wx - cx * wz)
    rz = 0.5 * (ax * uy - ay * ux + bx * vy - by * vx + cx * wy - cy * wx)
    sine = hypot(rx, ry, rz)
    if sine > 1e-6:
        cosine = 0.5 * (ax * ux + ay * uy + az * uz + bx * vx + by * vy + bz * vz + cx * wx + cy * wy + cz * wz - 1.0)
        factor = atan2(sine, cosine) / sine
        rx, ry, rz = factor * rx, factor * ry, factor * rz
    (px, py, pz), (qx, qy, qz) = now.wrist, target.wrist
    return (qx - px, qy - py, qz - pz, rx, ry, rz, (target.angle - now.angle + pi) % tau - pi)


class DifferentialSolver:
    """Changes of the joints that make desired changes of position, rotation and arm angle, see :func:`target_error`.

    The pose comes first, the arm angle takes what freedom is left. Away from singularities both are exact. Where the
    pose cannot change in a direction, its changes are damped; where the elbow cannot turn with the pose held, it gives
    way. What is not reached is left for the next steps. Making one takes about 60 µs, each change 10 µs.

    Args:
        now: where the arm is.
        locked: joints that do not take part.
        weakest: that of the step before, from which it goes on to be found.

    Attributes:
        weakest: the change of the pose that the joints can make least, (6,), as far as it is known.
        independence: how much the pose changes in it with the joints, towards 0 where axes are in line.
    """

    def __init__(self, now: Wrist, locked: Sequence[int] = (), weakest: Sequence[float] = (1.0,) * 6) -> None:
        rows = [*([_METRE_IN_RADIANS * value for value in row] for row in now.velocity), *map(list, now.rotation)]
        elbow = list(now.elbow)
        for row in (*rows, elbow):
            for index in locked:
                row[index] = 0.0
        self._rows, self._elbow = rows, elbow
        products = [[sum(map(mul, row, other)) for other in rows[: index + 1]] for index, row in enumerate(rows)]
        self._factor = _factored(products, _LEAST_DAMPING)
        # Inverse iteration: its answer comes near to the weakest direction, and a step further in each cycle.
        found = self._solved(weakest)
        size = sqrt(sum(map(mul, found, found)))
        self.weakest = tuple([value / size for value in found])
        square = sqrt(sum(map(mul, weakest, weakest))) / size
        self.independence = sqrt(square)
        if square < _SINGULAR * _SINGULAR:
            self._factor = _factored(products, _SINGULAR * _SINGULAR - square + _LEAST_DAMPING)
        kept = self._joints(self._solved([sum(map(mul, row, elbow)) for row in rows]))
        self._free = [value - own for value, own in zip(elbow, kept, strict=True)]
        self._freedom = max(sum(map(mul, self._free, self._free)), _ELBOW_FREEDOM)

    def change(self, desired: Row, most: float = inf) -> Joints:
        """The change of the joints for a desired change [m], [rad], in the foot frame.

        Where the weakest direction would take the joints further than ``most`` [rad], less of it is made: at the end
        of its reach the arm slides along it.
        """
        px, py, pz, rx, ry, rz, angle = desired
        metre = _METRE_IN_RADIANS
        goal: tuple[float, ...] = (metre * px, metre * py, metre * pz, rx, ry, rz)
        weak, furthest = sum(map(mul, goal, self.weakest)), most * self.independence
        if abs(weak) > furthest:
            less = copysign(abs(weak) - furthest, weak)
            goal = tuple([value - less * each for value, each in zip(goal, self.weakest, strict=True)])
        change = self._joints(self._solved(goal))
        factor = (angle - sum(map(mul, self._elbow, change))) / self._freedom
        return joints([value + factor * free for value, free in zip(change, self._free, strict=True)])

    def _joints(self, solved: Sequence[float]) -> list[float]:
        return [sum(map(mul, solved, column)) for column in zip(*self._rows, strict=True)]

    def _solved(self, goal: Sequence[float]) -> list[float]:
        factor, half = self._factor, list[float]()
        for line, value in zip(factor, goal, strict=True):
            half.append((value - sum(map(mul, line, half))) / line[-1])  # the shorter one ends the sum
        for index in range(5, -1, -1):
            line = factor[index]
            value = half[index] = half[index] / line[index]
            for column in range(index):
                half[column] -= line[column] * value
        return half


def _factored(products: list[list[float]], damping: float) -> list[list[float]]:
    """The lower half of ``products + damping``, a symmetric matrix given by its own, by Cholesky's method."""
    factor: list[list[float]] = []
    for row in products:
        line: list[float] = []
        for value, other in zip(row, factor, strict=False):  # the last value of a row has no other
            line.append((value - sum(map(mul, line, other))) / other[-1])
        line.append(sqrt(max(row[-1] - sum(map(mul, line, line)), 0.0) + damping))
        factor.append(line)
    return factor


def posture_near(side: Side, target: WristTarget, seed: Joints, steps: int = 12) -> tuple[Joints, float]:
    """The posture of a target that continues from a seed, by Newton's method.

    Returns:
        The joints [rad], (7,), and the largest of what it misses [m], [rad]; not small where there is none.
    """
    position = seed
    for _ in range(steps):
        now = wrist_of(side, position)
        left = target_error(now, target)
        miss = max(map(abs, left))
        if miss < CONVERGED:
            return position, miss
        change = DifferentialSolver(now).change(left)
        factor = min(1.0, 0.5 / max(map(abs, change)))
        position = joints([value + factor * step for value, step in zip(position, change, strict=True)])
    return position, max(map(abs, target_error(wrist_of(side, position), target)))
