"""What a user of the EGM server may ask of a robot, checked against what that robot is."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite

from yumi.egm.codec import MOST_NUMBERS
from yumi.egm.messages import PathCorrection, RapidData, RobotMessage, SensorMessage, Twist
from yumi.errors import CommandRefused
from yumi.hardware.robot_state import RobotState
from yumi.robot.values import Pose, Quaternion, Vector

_UNIT = 1e-3  # by how much the norm of a quaternion may differ from 1
_OLDEST = 1e6  # [s]


def standstill(message: RobotMessage) -> SensorMessage:
    """Stay where ``message`` was measured, whether the robot heeds its joints or its tool."""
    pose = message.measured_pose
    return SensorMessage(
        seqno=0,
        position=message.measured,
        external=message.measured_external,
        tool_position=None if pose is None else pose.position,
        tool_orientation=None if pose is None else pose.orientation,
    )


def reference(
    state: RobotState,
    *,
    joints: Sequence[float] | None = None,
    pose: Pose | None = None,
    speed: Sequence[float] | None = None,
    twist: Sequence[float] | None = None,
    external: Sequence[float] | None = None,
    external_speed: Sequence[float] | None = None,
    data: RapidData | None = None,
) -> SensorMessage:
    """The message with these references, see :meth:`yumi.hardware.egm_server.EgmServer.send`.

    Raises:
        CommandRefused: a value is not finite, or there are not as many as the robot has.
    """
    axes, beside = len(state.joints), len(state.external)
    return SensorMessage(
        seqno=0,
        position=None if joints is None else _finite("joints", joints, axes),
        velocity=None if speed is None else _finite("speed", speed, axes),
        tool_position=None if pose is None else _vector("position of pose", pose.position),
        tool_orientation=None if pose is None else _unit(pose.orientation),
        twist=None if twist is None else _twist(twist),
        external=() if external is None else _finite("external", external, beside),
        external_velocity=() if external_speed is None else _finite("external_speed", external_speed, beside),
        rapid_data=None if data is None else _numbers(data),
    )


def correction(offset: Sequence[float], age: float) -> PathCorrection:
    """The path correction by ``offset`` [m], measured ``age`` [s] ago.

    Raises:
        CommandRefused: a value is not finite, or the age is negative.
    """
    if not 0.0 <= age <= _OLDEST:
        raise CommandRefused(f"Correction refused: age is {age} s; a measurement is 0 to {_OLDEST:g} s old.")
    return PathCorrection(0, _vector("offset", offset), round(age * 1000.0))


def is_placed(message: SensorMessage) -> bool:
    """Whether it says where the robot shall be."""
    return message.position is not None or message.tool_position is not None or bool(message.external)


def moves(message: SensorMessage) -> bool:
    """Whether it has any reference, be it zero."""
    return (
        is_placed(message)
        or message.velocity is not None
        or message.twist is not None
        or bool(message.external_velocity)
    )


def _finite(name: str, values: Sequence[float], count: int) -> tuple[float, ...]:
    given = tuple(float(value) for value in values)
    if len(given) != count:
        raise CommandRefused(f"Reference refused: {name} has {len(given)} values; this robot takes {count}.")
    for value in given:
        if not isfinite(value):
            raise CommandRefused(f"Reference refused: {name} has {value}; the robot takes finite numbers only.")
    return given


def _vector(name: str, values: Sequence[float]) -> Vector:
    x, y, z = _finite(name, values, 3)
    return (x, y, z)


def _twist(values: Sequence[float]) -> Twist:
    vx, vy, vz, wx, wy, wz = _finite("twist", values, 6)
    return (vx, vy, vz, wx, wy, wz)


def _unit(orientation: Sequence[float]) -> Quaternion:
    w, x, y, z = _finite("orientation of pose", orientation, 4)
    norm = hypot(w, x, y, z)
    if abs(norm - 1.0) > _UNIT:
        raise CommandRefused(f"Reference refused: orientation of pose has norm {norm:g}; a unit quaternion has 1.")
    return (w / norm, x / norm, y / norm, z / norm)


def _numbers(data: RapidData) -> RapidData:
    if len(data.numbers) > MOST_NUMBERS:
        raise CommandRefused(f"Data refused: {len(data.numbers)} numbers; a RAPID program takes {MOST_NUMBERS}.")
    return RapidData(data.flag, _finite("data", data.numbers, len(data.numbers)))
