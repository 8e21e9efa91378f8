"""What the two ends of EGM say to each other, as frozen values in SI units and chain order.

The names follow ABB: the *robot* sends :class:`RobotMessage`, the *sensor* (that is us, or anyone who guides the
robot) answers with :class:`SensorMessage` (reference/egm.md §1-3).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from yumi.robot.joints import Joints
from yumi.robot.values import Pose

__all__ = ["MciState", "MotorState", "PartialJoints", "Pose", "RapidState", "RobotMessage", "SensorMessage"]


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
class RobotMessage:
    """One datagram of the robot.

    Attributes:
        seqno: counts datagrams; a session starts at 0.
        sent_ms: the controller's send time stamp [ms], uint32.
        measured: measured joint positions, chain order [rad].
        planned: reference joint positions, chain order [rad].
        measured_pose: tool pose of ``measured``; None when the robot sent none.
        planned_pose: tool pose of ``planned``; None when the robot sent none.
        measured_time: when ``measured`` held, controller clock of unknown epoch [s]; None before RobotWare 6.07.
        planned_time: when the robot will be at ``planned``, same clock [s]; None before RobotWare 6.07.
        motors: state of the motors.
        mci: state of the motion correction interface.
        rapid: state of the RAPID execution.
        is_converged: whether the robot is within its convergence band.
        utilization: share of the robot's performance in use, 1.0 is full; None before RobotWare 6.10.
    """

    seqno: int
    sent_ms: int
    measured: Joints
    planned: Joints
    measured_pose: Pose | None
    planned_pose: Pose | None
    measured_time: float | None
    planned_time: float | None
    motors: MotorState
    mci: MciState
    rapid: RapidState
    is_converged: bool
    utilization: float | None = None


PartialJoints = tuple[float | None, float | None, float | None, float | None, float | None, float | None, float | None]
"""Seven joint values in chain order, None where the sender gave none: the robot keeps that axis' last reference."""


@dataclass(frozen=True, slots=True)
class SensorMessage:
    """One datagram to the robot.

    A field that is None is not on the wire: without a position the robot keeps its last one, without a velocity it
    takes zero. A message with neither keeps the session alive and moves nothing.

    Attributes:
        seqno: counts our datagrams; None when a third party left it out.
        position: joint positions to reach, chain order [rad]; possibly partial when read from the wire.
        velocity: joint velocities, chain order [rad/s]; possibly partial when read from the wire.
        sent_ms: the sender's time stamp [ms]; the robot ignores it.
    """

    seqno: int | None
    position: PartialJoints | None = None
    velocity: PartialJoints | None = None
    sent_ms: int | None = None
