"""What the two ends of EGM say to each other, as frozen values in SI units.

The names follow ABB: the *robot* sends :class:`RobotMessage`, the *sensor* (that is us, or anyone who guides the
robot) answers with :class:`SensorMessage` or :class:`PathCorrection` (reference/egm.md §1-3). The joints of a
seven-axis arm come in chain order, those of another robot in ABB's, axes 1 to 6.

The wire units of EGM: degrees, millimetres, microseconds and percent; everything inside is SI.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import pi
from struct import pack, unpack
from typing import NamedTuple

from yumi.robot.joints import Joints, Pose, Quaternion, Vector

__all__ = [
    "Collision",
    "JointReport",
    "MciState",
    "MotorState",
    "PartialJoints",
    "PathCorrection",
    "Pose",
    "RapidData",
    "RapidState",
    "RobotMessage",
    "SensorMessage",
    "Twist",
]

Twist = tuple[float, float, float, float, float, float]
"""Speed of the tool: along x, y, z [m/s], then about x, y, z [rad/s]."""


class MotorState(IntEnum):
    """EgmMotorState."""

    UNDEFINED = 0
    ON = 1
    OFF = 2


class MciState(IntEnum):
    """EgmMCIState: the controller's motion correction interface, which EGM drives."""

    UNDEFINED = 0
    ERROR = 1
    STOPPED = 2
    RUNNING = 3


class RapidState(IntEnum):
    """EgmRapidCtrlExecState."""

    UNDEFINED = 0
    STOPPED = 1
    RUNNING = 2


@dataclass(frozen=True, slots=True)
class Collision:
    """EgmCollisionInfo, RobotWare 7.6.

    Attributes:
        is_triggered: whether the motion supervision sees a collision.
        quotas: how near each axis is to that; 1.0 or 100 %, the manual does not say.
    """

    is_triggered: bool
    quotas: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class RapidData:
    """What the RAPID program and the sensor may send each other, RobotWare 7.7.

    Attributes:
        flag: a digital signal; None when there is none.
        numbers: at most 40 numbers, their meaning is the program's.
    """

    flag: bool | None = None
    numbers: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class RobotMessage:
    """One datagram of the robot.

    Attributes:
        seqno: counts datagrams; a session starts at 0.
        sent_ms: the controller's send time stamp [ms], uint32.
        measured: measured joint positions [rad]; seven in chain order, or axes 1 to 6.
        planned: reference joint positions [rad], as ``measured``.
        measured_pose: tool pose of ``measured``; None when the robot sent none.
        planned_pose: tool pose of ``planned``; None when the robot sent none.
        measured_time: when ``measured`` held, controller clock of unknown epoch [s].
        planned_time: when the robot will be at ``planned``, same clock [s]; None when the robot does not say.
        motors: state of the motors.
        mci: state of the motion correction interface.
        rapid: state of the RAPID execution.
        is_converged: whether the robot is within its convergence band.
        utilization: share of the robot's performance in use, 1.0 is full; None before RobotWare 6.10.
        measured_external: measured positions of the external axes that are no part of the arm [rad], linear ones [m].
        planned_external: their references.
        measured_stamp_ns: IEEE 1588 time of ``measured`` [ns]; None before RobotWare 7.16.
        planned_stamp_ns: the same of ``planned``.
        force: measured forces [N] and torques [Nm], (6,); None without a force sensor.
        force_control: whether force control is active; None before RobotWare 7.
        move_index: counts movements and changes of target; None before RobotWare 7.6.
        collision: what the motion supervision sees; None before RobotWare 7.6.
        rapid_data: what the RAPID program sends; None before RobotWare 7.7.
        torque: torque references of the axes, in ABB's order and unit; None when the robot does not say.
        test_signals: ABB's own.
    """

    seqno: int
    sent_ms: int
    measured: tuple[float, ...]
    planned: tuple[float, ...]
    measured_pose: Pose | None
    planned_pose: Pose | None
    measured_time: float
    planned_time: float | None
    motors: MotorState
    mci: MciState
    rapid: RapidState
    is_converged: bool
    utilization: float | None = None
    measured_external: tuple[float, ...] = ()
    planned_external: tuple[float, ...] = ()
    measured_stamp_ns: int | None = None
    planned_stamp_ns: int | None = None
    force: tuple[float, ...] | None = None
    force_control: bool | None = None
    move_index: int | None = None
    collision: Collision | None = None
    rapid_data: RapidData | None = None
    torque: tuple[float, ...] | None = None
    test_signals: tuple[float, ...] = ()


class JointReport(NamedTuple):
    """What the control loop reads of a seven-axis arm's :class:`RobotMessage`; a tuple, since that is made fastest.

    Attributes:
        seqno: counts datagrams; a session starts at 0.
        measured: measured joint positions, chain order [rad], (7,).
        planned: reference joint positions, chain order [rad], (7,).
        measured_time: when ``measured`` held, controller clock of unknown epoch [s].
        motors: state of the motors.
        mci: state of the motion correction interface.
        rapid: state of the RAPID execution.
    """

    seqno: int
    measured: Joints
    planned: Joints
    measured_time: float
    motors: MotorState
    mci: MciState
    rapid: RapidState


PartialJoints = tuple["float | None", ...]
"""Joint values, None where the sender gave none: the robot keeps that axis' last reference."""


@dataclass(frozen=True, slots=True)
class SensorMessage:
    """One datagram to the robot.

    A field that is None is not on the wire: without a position the robot keeps its last one, without a velocity it
    takes zero. A message with neither keeps the session alive and moves nothing. The robot heeds joints in joint mode
    and the tool in pose mode.

    Attributes:
        seqno: counts our datagrams; None when a third party left it out.
        position: joint positions to reach [rad]; seven in chain order or axes 1 to 6, partial when read from the wire.
        velocity: joint velocities [rad/s], as ``position``.
        sent_ms: the sender's time stamp [ms]; the robot ignores it.
        tool_position: where the tool is to be, in EGM's correction frame [m].
        tool_orientation: its orientation; a unit quaternion, w first.
        twist: speed of the tool.
        external: positions of external axes that are no part of the arm [rad], linear ones [m].
        external_velocity: their velocities.
        rapid_data: for the RAPID program; RobotWare 7.7.
    """

    seqno: int | None
    position: PartialJoints | None = None
    velocity: PartialJoints | None = None
    sent_ms: int | None = None
    tool_position: Vector | None = None
    tool_orientation: Quaternion | None = None
    twist: Twist | None = None
    external: tuple[float, ...] = ()
    external_velocity: tuple[float, ...] = ()
    rapid_data: RapidData | None = None


@dataclass(frozen=True, slots=True)
class PathCorrection:
    """One datagram to a robot that moves along its own path (EGMMoveL, EGMMoveC).

    Attributes:
        seqno: counts our datagrams; None when a third party left it out.
        offset: where the path was measured, seen from the sensor's tool frame [m].
        age_ms: how old the measurement is [ms].
    """

    seqno: int | None
    offset: Vector
    age_ms: int = 0


RAD_PER_DEG = pi / 180.0
DEG_PER_RAD = 180.0 / pi
M_PER_MM = 1e-3
MM_PER_M = 1e3
UINT32 = 2**32
NS_PER_S = 1_000_000_000


def clock_fields(seconds: float) -> tuple[int, int]:
    """Split a controller time [s] into EgmClock's whole seconds and microseconds."""
    microseconds = round(seconds * 1e6)
    return microseconds // 1_000_000, microseconds % 1_000_000


def singles(values: Sequence[float]) -> tuple[float, ...]:
    """Round to single precision, in which the controller computes (reference/egm.md §2.4)."""
    layout = f"<{len(values)}f"
    return unpack(layout, pack(layout, *values))
