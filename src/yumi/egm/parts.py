"""The parts of EGM's messages between protobuf and SI values: joints, poses, clocks, forces, data of the program."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import hypot, isfinite

from yumi.egm import egm_pb2 as pb
from yumi.egm.messages import Collision, MciState, MotorState, PartialJoints, Pose, RapidData, RapidState, Twist
from yumi.egm.units import (
    DEG_PER_RAD,
    M_PER_MM,
    MM_PER_M,
    NS_PER_S,
    RAD_PER_DEG,
    clock_fields,
    single,
)
from yumi.robot.kinematics import euler_zyx, quaternion_from_euler_zyx
from yumi.robot.values import Quaternion, Vector

Motion = pb.EgmFeedBack | pb.EgmPlanned
Reference = pb.EgmPlanned | pb.EgmSpeedRef

ROBOT_AXES = 6
"""Axes in EgmJoints; a seventh travels as the first external one (reference/egm.md §3.2)."""

MOTOR_STATES = {int(state): state for state in MotorState}
MCI_STATES = {int(state): state for state in MciState}
RAPID_STATES = {int(state): state for state in RapidState}


def radians_of(values: Iterable[float]) -> tuple[float, ...]:
    return tuple([value * RAD_PER_DEG for value in values])


def read_axes(motion: Motion, axes: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The arm's joints, seven in chain order or those of ``EgmJoints``, and what external axes are left [rad]."""
    robax, external = radians_of(motion.joints.joints), radians_of(motion.externalJoints.joints)
    if axes <= ROBOT_AXES:
        return robax, external
    a1, a2, a3, a4, a5, a6 = robax
    return (a1, a2, external[0], a3, a4, a5, a6), external[1:]


def read_partial(part: Reference, axes: int) -> tuple[PartialJoints | None, tuple[float, ...]]:
    """As :func:`read_axes`, of what a sensor wrote: axes it left out are None (reference/egm.md §10 item 18)."""
    robax, external = part.joints.joints[:ROBOT_AXES], radians_of(part.externalJoints.joints)
    known: list[float | None] = [*radians_of(robax), *[None] * (ROBOT_AXES - len(robax))]
    rest = external
    if axes > ROBOT_AXES:
        known.insert(2, external[0] if external else None)
        rest = external[1:]
    return (None if known == [None] * len(known) else tuple(known)), rest


def write_axes(
    part: Motion | pb.EgmSpeedRef,
    values: Sequence[float],
    external: Sequence[float],
    rounded: Callable[[float], float] = float,
) -> None:
    """The opposite of :func:`read_axes`; seven values are in chain order [rad]."""
    robax = list(values)
    beside = list(external)
    if len(robax) > ROBOT_AXES:
        beside.insert(0, robax.pop(2))
    if robax:
        part.joints.joints[:] = [rounded(value * DEG_PER_RAD) for value in robax]
    if beside:
        part.externalJoints.joints[:] = [rounded(value * DEG_PER_RAD) for value in beside]


def read_pose(motion: Motion) -> Pose | None:
    """The robot's pose; the quaternion counts, and the Euler angles where there is none."""
    if not motion.HasField("cartesian"):
        return None
    cartesian = motion.cartesian
    orientation = _quaternion(cartesian.orient) if cartesian.HasField("orient") else _from_euler(cartesian.euler)
    return Pose(_position(cartesian.pos), orientation)


def read_goal(cartesian: pb.EgmPose) -> tuple[Vector | None, Quaternion | None]:
    """A sensor's pose: where both are given Euler angles win over the quaternion (reference/egm.md §1.1)."""
    position = _position(cartesian.pos) if cartesian.HasField("pos") else None
    if cartesian.HasField("euler"):
        return position, _from_euler(cartesian.euler)
    return position, _unit(_quaternion(cartesian.orient)) if cartesian.HasField("orient") else None


def write_goal(cartesian: pb.EgmPose, position: Vector | None, orientation: Quaternion | None) -> None:
    if position is not None:
        _put_vector(cartesian.pos, [value * MM_PER_M for value in position])
    if orientation is not None:
        _put_quaternion(cartesian.orient, orientation)


def write_pose(cartesian: pb.EgmPose, pose: Pose) -> None:
    """As the controller does: in single precision, with Euler angles made of the rounded quaternion (§2.4)."""
    _put_vector(cartesian.pos, [single(value * MM_PER_M) for value in pose.position])
    w, x, y, z = (single(value) for value in pose.orientation)
    _put_quaternion(cartesian.orient, (w, x, y, z))
    _put_vector(cartesian.euler, [angle * DEG_PER_RAD for angle in euler_zyx((w, x, y, z))])


def read_twist(speed: pb.EgmSpeedRef) -> Twist | None:
    """Missing values are zero; None when there are none."""
    values = speed.cartesians.value
    if not values:
        return None
    vx, vy, vz, wx, wy, wz = [*values[:6], *[0.0] * (6 - len(values))]
    return (vx * M_PER_MM, vy * M_PER_MM, vz * M_PER_MM, wx * RAD_PER_DEG, wy * RAD_PER_DEG, wz * RAD_PER_DEG)


def write_twist(speed: pb.EgmSpeedRef, twist: Twist) -> None:
    linear, angular = twist[:3], twist[3:]
    speed.cartesians.value[:] = [v * MM_PER_M for v in linear] + [w * DEG_PER_RAD for w in angular]


def read_clock(motion: Motion) -> float | None:
    return motion.time.sec + motion.time.usec * 1e-6 if motion.HasField("time") else None


def read_stamp(motion: Motion) -> int | None:
    return motion.timeStamp.sec * NS_PER_S + motion.timeStamp.nsec if motion.HasField("timeStamp") else None


def write_motion(motion: Motion, values: Sequence[float], external: Sequence[float], pose: Pose | None) -> None:
    """A part of the robot's message, in single precision."""
    write_axes(motion, values, external, single)
    if pose is not None:
        write_pose(motion.cartesian, pose)


def write_times(motion: Motion, time: float | None, stamp_ns: int | None) -> None:
    if time is not None:
        motion.time.sec, motion.time.usec = clock_fields(time)
    if stamp_ns is not None:
        motion.timeStamp.sec, motion.timeStamp.nsec = divmod(stamp_ns, NS_PER_S)


def read_collision(robot: pb.EgmRobot) -> Collision | None:
    if not robot.HasField("CollisionInfo"):
        return None
    return Collision(robot.CollisionInfo.collsionTriggered, tuple(robot.CollisionInfo.collDetQuota))


def read_data(data: pb.EgmRAPIDdata) -> RapidData | None:
    """None when it is empty."""
    flag = data.digVal if data.HasField("digVal") else None
    return RapidData(flag, tuple(data.dnum)) if data.dnum or flag is not None else None


def write_data(data: pb.EgmRAPIDdata, value: RapidData) -> None:
    if value.flag is not None:
        data.digVal = value.flag
    data.dnum[:] = value.numbers


def _position(part: pb.EgmCartesian) -> Vector:
    return (part.x * M_PER_MM, part.y * M_PER_MM, part.z * M_PER_MM)


def _quaternion(part: pb.EgmQuaternion) -> Quaternion:
    return (part.u0, part.u1, part.u2, part.u3)


def _from_euler(part: pb.EgmEuler) -> Quaternion:
    angles = (part.x * RAD_PER_DEG, part.y * RAD_PER_DEG, part.z * RAD_PER_DEG)
    if not all(isfinite(angle) for angle in angles):
        return angles[0], *angles  # trigonometry refuses what is not finite; who reads it shall see it
    return quaternion_from_euler_zyx(angles)


def _unit(quaternion: Quaternion) -> Quaternion:
    norm = hypot(*quaternion)
    if norm == 0.0:
        return quaternion
    w, x, y, z = quaternion
    return (w / norm, x / norm, y / norm, z / norm)


def _put_vector(part: pb.EgmCartesian | pb.EgmEuler, values: Sequence[float]) -> None:
    part.x, part.y, part.z = values


def _put_quaternion(part: pb.EgmQuaternion, values: Quaternion) -> None:
    part.u0, part.u1, part.u2, part.u3 = values
