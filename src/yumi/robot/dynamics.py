"""The torque a motion needs: inverse dynamics of one arm, by Newton and Euler from joint to joint.

Bodies, friction and mounting are those of reference/yumi.md §1.3-1.9. Every twist of the arm's modified
Denavit-Hartenberg chain is a right angle, so turning a vector into the next link costs four products.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, pi, sin, tanh
from typing import cast

from yumi.robot.description import JOINT_FRICTION, JOINT_ORIGINS, Mass, link_mass
from yumi.robot.joints import JOINT_COUNT, ZERO, Joints, Pose, Quaternion, Side, Vector, rotate
from yumi.robot.kinematics import (
    ELBOW_OFFSET,
    FLANGE,
    FOREARM,
    IDENTITY,
    SHOULDER_HEIGHT,
    SHOULDER_OFFSET,
    UPPER_ARM,
    WRIST_OFFSET,
    compose,
    foot_to_body,
    inverse,
    quaternion_from_euler_zyx,
)

GRAVITY = 9.81
"""Acceleration of free fall [m/s²]."""

DRIVE_INERTIA: Joints = (0.10, 0.10, 0.05, 0.05, 0.01, 0.01, 0.01)
"""Inertia of each motor seen at its joint, chain order [kg m²]: our estimate, ABB publishes none.

Rotors of 1e-5, 5e-6 and 1e-6 kg m² behind gears of 100:1.
"""

FULL_FRICTION_SPEED = 0.01
"""Speed above which friction no longer grows [rad/s]; below, it goes through zero without a jump."""

HAND = Mass(0.230, (0.0082, 0.0117, 0.0520), (0.00021, 0.0, 0.0, 0.00024, 0.0, 0.00009))
"""ABB's hand with servo and default fingers, seen from tool0 (reference/yumi.md §2.3)."""

# Per joint: sine of the twist, then offset along the last x and along this z [m], and the angle at zero [rad].
# The first twist is free: it only says from which frame gravity is seen.
_JOINTS = (
    (-1.0, 0.0, SHOULDER_HEIGHT, 0.0),
    (-1.0, -SHOULDER_OFFSET, 0.0, 0.0),
    (1.0, SHOULDER_OFFSET, UPPER_ARM, 0.0),
    (-1.0, ELBOW_OFFSET, 0.0, pi / 2.0),
    (1.0, -ELBOW_OFFSET, FOREARM, 0.0),
    (-1.0, WRIST_OFFSET, 0.0, 0.0),
    (1.0, -WRIST_OFFSET, FLANGE, 0.0),
)
_FIRST_LINK_TO_FOOT = Pose((0.0, 0.0, 0.066), (0.0, 0.0, 0.0, 1.0))

Inertia = tuple[float, float, float, float, float, float]
"""xx, xy, xz, yy, yz, zz [kg m²]."""


_Carried = tuple[float, float, float, float, float, float, float, float]
"""Sine and cosine of a joint, then force [N] and moment [N m] that its link needs, in the link's frame."""


@dataclass(frozen=True, slots=True)
class _Link:
    """What the recursion needs of a link, in its Denavit-Hartenberg frame.

    Attributes:
        sine: of the twist from the link before, -1 or 1.
        x, y: where its frame is in the one before; z is 0 [m].
        angle: of the joint at position zero [rad].
        mass: [kg].
        moment: mass times its centre [kg m].
        inertia: about the frame's origin [kg m²].
    """

    sine: float
    x: float
    y: float
    angle: float
    mass: float
    moment: Vector
    inertia: Inertia


class ArmDynamics:
    """Inverse dynamics of one arm.

    Args:
        side: the arm; the two are mounted differently.
        payload: what hangs on tool0, seen from tool0; None is a bare flange.
        friction: Coulomb friction of each joint [N m], (7,).
        drive_inertia: inertia of each motor seen at its joint [kg m²], (7,).
        gravity: [m/s²].
    """

    def __init__(
        self,
        side: Side,
        payload: Mass | None = None,
        *,
        friction: Joints = JOINT_FRICTION,
        drive_inertia: Joints = DRIVE_INERTIA,
        gravity: float = GRAVITY,
    ) -> None:
        self._links = tuple(_links(payload))
        self._friction = friction
        self._drive_inertia = drive_inertia
        # Gravity felt by an arm at rest is an acceleration of its foot upwards, here seen from before the first twist.
        up = rotate(inverse(foot_to_body(side)).orientation, (0.0, 0.0, gravity))
        self._foot_acceleration = (up[0], up[2], -up[1])

    def torque(self, position: Joints, velocity: Joints = ZERO, acceleration: Joints = ZERO) -> Joints:
        """What the drives have to give at the joints, chain order [N m], (7,).

        Args:
            position: joint positions [rad], (7,).
            velocity: joint speeds [rad/s], (7,).
            acceleration: joint accelerations [rad/s²], (7,).
        """
        rigid = self._backward(self._forward(position, velocity, acceleration))
        torque = tuple(
            load + inertia * speeding_up + friction * tanh(speed / FULL_FRICTION_SPEED)
            for load, inertia, speeding_up, friction, speed in zip(
                rigid, self._drive_inertia, acceleration, self._friction, velocity, strict=True
            )
        )
        return cast("Joints", torque)

    def _forward(self, position: Joints, velocity: Joints, acceleration: Joints) -> list[_Carried]:
        """From foot to flange: what each link needs to move as the joints say."""
        wx = wy = wz = bx = by = bz = 0.0  # angular velocity and acceleration
        ax, ay, az = self._foot_acceleration
        loads: list[_Carried] = []
        for link, q, speed, speeding_up in zip(self._links, position, velocity, acceleration, strict=True):
            x, y, twist, sine, cosine = link.x, link.y, link.sine, sin(q + link.angle), cos(q + link.angle)
            # The link's origin: a + b × r + w × (w × r) with r = (x, y, 0), then everything into the link's frame.
            along, square = wx * x + wy * y, wx * wx + wy * wy + wz * wz
            ax, ay, az = (
                ax - bz * y + wx * along - x * square,
                ay + bz * x + wy * along - y * square,
                az + bx * y - by * x + wz * along,
            )
            turned = twist * wz
            wx, wy, wz = cosine * wx + sine * turned, cosine * turned - sine * wx, speed - twist * wy
            turned = twist * bz
            bx, by, bz = (
                cosine * bx + sine * turned + wy * speed,
                cosine * turned - sine * bx - wx * speed,
                speeding_up - twist * by,
            )
            turned = twist * az
            ax, ay, az = cosine * ax + sine * turned, cosine * turned - sine * ax, -twist * ay
            loads.append((sine, cosine, *_load(link, (wx, wy, wz), (bx, by, bz), (ax, ay, az))))
        return loads

    def _backward(self, loads: list[_Carried]) -> list[float]:
        """From flange to foot: what each joint carries of its own link and all beyond [N m]."""
        torque = [0.0] * JOINT_COUNT
        fx = fy = fz = nx = ny = nz = 0.0
        for index in range(JOINT_COUNT - 1, -1, -1):
            sine, cosine, link_fx, link_fy, link_fz, link_nx, link_ny, link_nz = loads[index]
            fx, fy, fz, nx, ny, nz = fx + link_fx, fy + link_fy, fz + link_fz, nx + link_nx, ny + link_ny, nz + link_nz
            torque[index] = nz
            link = self._links[index]
            x, y, twist = link.x, link.y, link.sine
            # Into the frame of the link before: Rz of the joint, then the twist about x.
            fx, fy, fz = cosine * fx - sine * fy, -twist * fz, twist * (sine * fx + cosine * fy)
            nx, ny, nz = (
                cosine * nx - sine * ny + y * fz,
                -twist * nz - x * fz,
                twist * (sine * nx + cosine * ny) + x * fy - y * fx,
            )
        return torque


def _load(link: _Link, w: Vector, b: Vector, a: Vector) -> tuple[float, float, float, float, float, float]:
    """Force and moment about its origin that move a link with angular velocity w, acceleration b, and a."""
    wx, wy, wz = w
    bx, by, bz = b
    ax, ay, az = a
    hx, hy, hz = link.moment
    xx, xy, xz, yy, yz, zz = link.inertia
    mass = link.mass
    along, square = wx * hx + wy * hy + wz * hz, wx * wx + wy * wy + wz * wz
    # Angular momentum I·w, whose change in the turning frame is I·b + w × I·w.
    lx, ly, lz = xx * wx + xy * wy + xz * wz, xy * wx + yy * wy + yz * wz, xz * wx + yz * wy + zz * wz
    return (
        mass * ax + by * hz - bz * hy + wx * along - hx * square,
        mass * ay + bz * hx - bx * hz + wy * along - hy * square,
        mass * az + bx * hy - by * hx + wz * along - hz * square,
        xx * bx + xy * by + xz * bz + wy * lz - wz * ly + hy * az - hz * ay,
        xy * bx + yy * by + yz * bz + wz * lx - wx * lz + hz * ax - hx * az,
        xz * bx + yz * by + zz * bz + wx * ly - wy * lx + hx * ay - hy * ax,
    )


def _links(payload: Mass | None) -> Iterator[_Link]:
    for index, ((sine, x, z, angle), frame) in enumerate(zip(_JOINTS, _body_frames(), strict=True)):
        own = link_mass(index)  # given in ``frame``
        centre = compose(frame, Pose(own.centre, IDENTITY)).position
        bodies = [Mass(own.mass, centre, _turned(own.inertia, frame.orientation))]
        if payload is not None and index == JOINT_COUNT - 1:
            bodies.append(payload)  # the last frame is tool0
        mass = sum(body.mass for body in bodies)
        moment = _sum(tuple(body.mass * value for value in body.centre) for body in bodies)
        inertia = _sum(_about_origin(body) for body in bodies)
        yield _Link(sine, x, -sine * z, angle, mass, cast("Vector", moment), cast("Inertia", inertia))


def _body_frames() -> Iterator[Pose]:
    """Frame in which each link's body is given, seen from the link's Denavit-Hartenberg frame."""
    body_to_foot, link_to_foot = _FIRST_LINK_TO_FOOT, Pose((0.0, 0.0, 0.0), IDENTITY)
    for index, (sine, x, z, angle) in enumerate(_JOINTS):
        if index > 0:
            origin = JOINT_ORIGINS[index - 1]
            body_to_foot = compose(body_to_foot, Pose(origin.xyz, quaternion_from_euler_zyx(origin.rpy)))
        twist = sine * pi / 2.0 if index > 0 else 0.0
        link_to_foot = compose(
            link_to_foot,
            compose(
                Pose((x, 0.0, 0.0), _turn((1.0, 0.0, 0.0), twist)),
                Pose((0.0, 0.0, z), _turn((0.0, 0.0, 1.0), angle)),
            ),
        )
        yield compose(inverse(link_to_foot), body_to_foot)


def _turned(inertia: Inertia, rotation: Quaternion) -> Inertia:
    xx, xy, xz, yy, yz, zz = inertia
    back = inverse(Pose((0.0, 0.0, 0.0), rotation)).orientation

    def product(first: Vector, second: Vector) -> float:
        x, y, z = rotate(back, first)
        u, v, w = rotate(back, second)
        return x * (xx * u + xy * v + xz * w) + y * (xy * u + yy * v + yz * w) + z * (xz * u + yz * v + zz * w)

    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    return (product(x, x), product(x, y), product(x, z), product(y, y), product(y, z), product(z, z))


def _about_origin(body: Mass) -> Inertia:
    """Steiner's rule."""
    m, (x, y, z), (xx, xy, xz, yy, yz, zz) = body.mass, body.centre, body.inertia
    return (
        xx + m * (y * y + z * z),
        xy - m * x * y,
        xz - m * x * z,
        yy + m * (x * x + z * z),
        yz - m * y * z,
        zz + m * (x * x + y * y),
    )


def _sum(rows: Iterator[tuple[float, ...]]) -> tuple[float, ...]:
    return tuple(sum(column) for column in zip(*rows, strict=True))


def _turn(axis: Vector, angle: float) -> Quaternion:
    share = sin(angle / 2.0)
    return (cos(angle / 2.0), axis[0] * share, axis[1] * share, axis[2] * share)
