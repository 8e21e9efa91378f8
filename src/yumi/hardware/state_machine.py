"""The state machine on the robot as a client sees it: its symbols, signals, states and EGM settings.

The interface is that of ABB's StateMachine Add-In 1.1 (reference/statemachine.md); the RAPID modules in
``controller_files`` offer the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import cast

from yumi.bounds import bounded
from yumi.errors import ProtocolError
from yumi.rws.rapid_values import RapidValue

MAIN = "TRobMain"
EGM = "TRobEGM"
GRIPPER = "TRobSG"

START_JOINT = "EGM_START_JOINT"
STOP = "EGM_STOP"
RUN_GRIPPER = "RUN_SG_ROUTINE"


class MachineState(IntEnum):
    """``TRobMain/current_state``."""

    IDLE = 0
    INITIALIZE = 1
    RUN_RAPID_ROUTINE = 2
    RUN_EGM_ROUTINE = 3


class SgCommand(IntEnum):
    """``TRobSG/command_input``."""

    NONE = 0
    INITIALIZE = 1
    CALIBRATE = 2
    MOVE_TO = 3
    GRIP_IN = 4
    GRIP_OUT = 5
    BLOW_ON_1 = 6
    BLOW_ON_2 = 7
    BLOW_OFF_1 = 8
    BLOW_OFF_2 = 9
    VACUUM_ON_1 = 10
    VACUUM_ON_2 = 11
    VACUUM_OFF_1 = 12
    VACUUM_OFF_2 = 13


@dataclass(frozen=True, slots=True)
class EgmMotionSettings:
    """What a task starts an EGM motion with; the defaults are the thesis's "fullspeed" (table 4.3).

    Attributes:
        use_filtering: whether the controller filters (level 1), which adds delay.
        comm_timeout: the controller gives up after this time without our answer [s].
        cond_min_max: half width of the convergence band [deg].
        lp_filter: low-pass filter of the references, 0 is off [Hz].
        sample_rate: time between two datagrams [ms].
        max_speed_deviation: highest joint speed EGM may cause [deg/s].
        cond_time: a motion ends after this time inside the convergence band [s].
        ramp_in_time: time until the references count fully [s].
        ramp_out_time: time to come to rest [s].
        pos_corr_gain: share of the position error that counts; 0 is velocity control.
    """

    use_filtering: bool = False
    comm_timeout: float = bounded(60.0, 0.1, 1e6, "s")
    cond_min_max: float = bounded(0.5, 0.0, 180.0, "deg")
    lp_filter: float = bounded(0.0, 0.0, 100.0, "Hz")
    sample_rate: int = bounded(4, 4, 16, "ms")
    max_speed_deviation: float = bounded(180.0, 0.1, 400.0, "deg/s")
    cond_time: float = bounded(1e6, 0.1, 1e9, "s")
    ramp_in_time: float = bounded(0.1, 0.0, 10.0, "s")
    ramp_out_time: float = bounded(0.1, 0.0, 10.0, "s")
    pos_corr_gain: float = bounded(1.0, 0.0, 1.0)


def merge_egm_settings(record: RapidValue, motion: EgmMotionSettings, *, is_allowed: bool) -> RapidValue:
    """The RAPID record ``EGMSettings`` with the values of ``motion``; tool, frames and the rest are kept.

    Args:
        record: as it is on the robot.
        motion: what EGM shall be started with.
        is_allowed: whether EGM may guide this arm.

    Raises:
        ProtocolError: ``record`` is not laid out as version 1.1 of the state machine lays it out.
    """
    try:
        _, presync, setup, activate, run, stop = cast("tuple[RapidValue, ...]", record)
        _, _ = cast("tuple[RapidValue, ...]", setup)
        tool, wobj, correction_frame, sensor_frame, *_numbers = cast("tuple[RapidValue, ...]", activate)
        _, _, offset, _ = cast("tuple[RapidValue, ...]", run)
        (_,) = cast("tuple[RapidValue, ...]", stop)
    except (TypeError, ValueError) as error:
        raise ProtocolError(
            f"{EGM}/settings on the robot has an unknown layout: {record}; load the RAPID modules of this version."
        ) from error
    return (
        is_allowed,
        presync,
        (motion.use_filtering, motion.comm_timeout),
        (
            tool,
            wobj,
            correction_frame,
            sensor_frame,
            motion.cond_min_max,
            motion.lp_filter,
            float(motion.sample_rate),
            motion.max_speed_deviation,
        ),
        (motion.cond_time, motion.ramp_in_time, offset, motion.pos_corr_gain),
        (motion.ramp_out_time,),
    )
