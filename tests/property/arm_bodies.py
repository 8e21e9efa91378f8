"""The energy of an arm, from its description alone: what the inverse dynamics are checked against."""

from __future__ import annotations

from abb_protocols.robot.description import (
    FLANGE_ORIGIN,
    JOINT_ORIGINS,
    TOOL0_ORIGIN,
    Mass,
    Origin,
    joint_1_origin,
    link_mass,
)
from abb_protocols.robot.joints import Joints, Pose, Side, Vector, rotate
from abb_protocols.robot.kinematics import compose_poses, quaternion_from_euler_zyx
from virtual_irc5.mechanics.dynamics import DRIVE_INERTIA, GRAVITY

H = 1e-5  # step of the numerical derivatives [rad]
Z = (0.0, 0.0, 1.0)


def moved(position: Joints, by: Joints, share: float) -> Joints:
    return tuple(q + share * step for q, step in zip(position, by, strict=True))


def only(index: int) -> Joints:
    return tuple(float(index == other) for other in range(7))


class ArmBodies:
    """Kinetic and potential energy of links, payload and drives, through the frames of the URDF."""

    def __init__(self, side: Side, payload: Mass | None = None) -> None:
        self._origins = (joint_1_origin(side), *JOINT_ORIGINS)
        self._payload = payload

    def kinetic(self, position: Joints, velocity: Joints) -> float:
        energy = sum(0.5 * inertia * speed * speed for inertia, speed in zip(DRIVE_INERTIA, velocity, strict=True))
        for mass, frame, joints_before in self._bodies(position):
            centre = compose_poses(frame, Pose(mass.centre, (1.0, 0.0, 0.0, 0.0))).position
            turning, linear = [0.0] * 3, [0.0] * 3
            for joint, speed in zip(joints_before, velocity, strict=False):
                axis = rotate(joint.orientation, Z)
                arm = tuple(c - o for c, o in zip(centre, joint.position, strict=True))
                turning = [total + speed * part for total, part in zip(turning, axis, strict=True)]
                linear = [total + speed * part for total, part in zip(linear, cross(axis, arm), strict=True)]
            energy += 0.5 * mass.mass * sum(v * v for v in linear) + 0.5 * about(mass, frame, turning)
        return energy

    def potential(self, position: Joints) -> float:
        return sum(
            mass.mass * GRAVITY * compose_poses(frame, Pose(mass.centre, (1.0, 0.0, 0.0, 0.0))).position[2]
            for mass, frame, _ in self._bodies(position)
        )

    def torque(self, position: Joints, velocity: Joints, acceleration: Joints) -> Joints:
        """Lagrange: d/dt ∂T/∂q̇ - ∂T/∂q + ∂V/∂q, every derivative by differences."""

        def momentum(index: int, time: float) -> float:
            # T is a quadratic form of the speeds, so the difference over ±1 is its exact derivative.
            q = moved(moved(position, velocity, time), acceleration, 0.5 * time * time)
            speed = moved(velocity, acceleration, time)
            up, down = moved(speed, only(index), 1.0), moved(speed, only(index), -1.0)
            return (self.kinetic(q, up) - self.kinetic(q, down)) / 2.0

        def lagrangian(index: int, step: float) -> float:
            q = moved(position, only(index), step)
            return self.kinetic(q, velocity) - self.potential(q)

        return tuple(
            (momentum(index, H) - momentum(index, -H) - lagrangian(index, H) + lagrangian(index, -H)) / (2.0 * H)
            for index in range(7)
        )

    def _bodies(self, position: Joints) -> list[tuple[Mass, Pose, list[Pose]]]:
        """Each body with its frame, and the frames of the joints that move it."""
        frame, joints, bodies = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)), [], []
        for index, (origin, angle) in enumerate(zip(self._origins, position, strict=True)):
            frame = compose_poses(compose_poses(frame, placed(origin)), placed(Origin(rpy=(0.0, 0.0, angle))))
            joints.append(frame)
            bodies.append((link_mass(index), frame, list(joints)))
        if self._payload is not None:
            bodies.append(
                (
                    self._payload,
                    compose_poses(compose_poses(frame, placed(FLANGE_ORIGIN)), placed(TOOL0_ORIGIN)),
                    joints,
                )
            )
        return bodies


def placed(origin: Origin) -> Pose:
    return Pose(origin.xyz, quaternion_from_euler_zyx(origin.rpy))


def cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def about(mass: Mass, frame: Pose, turning: list[float]) -> float:
    """w·I·w with the angular velocity taken into the body's frame."""
    w, x, y, z = frame.orientation
    u, v, s = rotate((w, -x, -y, -z), tuple(turning))
    xx, xy, xz, yy, yz, zz = mass.inertia
    return xx * u * u + yy * v * v + zz * s * s + 2.0 * (xy * u * v + xz * u * s + yz * v * s)
