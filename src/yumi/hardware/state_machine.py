"""The state machine on the robot as a client sees it: its symbols, signals, states and EGM settings.

The interface is that of ABB's StateMachine Add-In 1.1 (reference/statemachine.md); the RAPID modules in
``controller_files`` offer the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from math import hypot, isclose
from typing import cast

from yumi.bounds import bounded
from yumi.errors import ProtocolError, SettingsError
from yumi.rws import rapid_values
from yumi.rws.rapid_values import RapidValue

MAIN = "TRobMain"
EGM = "TRobEGM"
GRIPPER = "TRobSG"
RAPID = "TRobRAPID"
WATCHDOG = "TRobWatchdog"

START_JOINT = "EGM_START_JOINT"
STOP = "EGM_STOP"
RUN_RAPID = "RUN_RAPID_ROUTINE"
EXTERNAL_STATUS = "WD_EXTERNAL_STATUS"
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


_UPRIGHT: RapidValue = (1.0, 0.0, 0.0, 0.0)
_POSE: RapidValue = ((0.0, 0.0, 0.0), _UPRIGHT)
_LOAD: RapidValue = (0.0, (0.0, 0.0, 0.0), _UPRIGHT, 0.0, 0.0, 0.0)
_TOOL: RapidValue = (True, _POSE, _LOAD)
_WOBJ: RapidValue = (False, True, "", _POSE, _POSE)
_LAYOUTS: Mapping[str, tuple[str, RapidValue]] = {
    "tool": ("tooldata", _TOOL),
    "wobj": ("wobjdata", _WOBJ),
    "correction_frame": ("pose", _POSE),
    "sensor_frame": ("pose", _POSE),
    "offset": ("pose", _POSE),
}


@dataclass(frozen=True, slots=True)
class EgmMotionSettings:
    """What a task starts an EGM motion with; the defaults are the thesis's "fullspeed" (table 4.3).

    Tool, work object and frames are RAPID values [mm, kg]; an empty text keeps what the robot has.

    Attributes:
        use_presync: whether both arms wait for each other before they begin.
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
        tool: tooldata; its load counts in the controller's model of the arm.
        wobj: wobjdata, for poses.
        correction_frame: pose, for poses.
        sensor_frame: pose, for poses.
        offset: pose, for poses.

    Raises:
        SettingsError: a text is no RAPID value of its type.
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
    use_presync: bool = False
    tool: str = ""
    wobj: str = ""
    correction_frame: str = ""
    sensor_frame: str = ""
    offset: str = ""

    def __post_init__(self) -> None:
        for name, (kind, layout) in _LAYOUTS.items():
            _check_text(name, kind, layout, getattr(self, name))

    def value(self, name: str, current: RapidValue) -> RapidValue:
        """The RAPID value of the text ``name``, or ``current`` where it is empty."""
        text: str = getattr(self, name)
        return rapid_values.decode(text) if text else current


def _check_text(name: str, kind: str, layout: RapidValue, text: str) -> None:
    """Refuse a text that RAPID would not take: the controller would do so in the middle of a start."""
    if not text:
        return
    try:
        is_fitting = _has_layout(rapid_values.decode(text), layout)
    except ProtocolError:
        is_fitting = False
    if not is_fitting:
        raise SettingsError(f"egm_motion: {name} is {text!r}; it must be a RAPID {kind} such as {_literal(layout)}.")


def _has_layout(value: RapidValue, layout: RapidValue) -> bool:
    if isinstance(layout, tuple):
        if not isinstance(value, tuple) or len(value) != len(layout):
            return False
        parts = all(_has_layout(part, like) for part, like in zip(value, layout, strict=True))
        return parts and (layout != _UPRIGHT or isclose(hypot(*cast("tuple[float, ...]", value)), 1.0, abs_tol=1e-3))
    return type(value) is type(layout)


def _literal(layout: RapidValue) -> str:
    return rapid_values.encode(layout)


def merge_egm_settings(record: RapidValue, motion: EgmMotionSettings, *, is_allowed: bool) -> RapidValue:
    """The RAPID record ``EGMSettings`` with the values of ``motion``; what it leaves open is kept.

    Args:
        record: as it is on the robot.
        motion: what EGM shall be started with.
        is_allowed: whether EGM may guide this arm.

    Raises:
        ProtocolError: ``record`` is not laid out as version 1.1 of the state machine lays it out.
    """
    try:
        _, _, setup, activate, run, stop = cast("tuple[RapidValue, ...]", record)
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
        motion.use_presync,
        (motion.use_filtering, motion.comm_timeout),
        (
            motion.value("tool", tool),
            motion.value("wobj", wobj),
            motion.value("correction_frame", correction_frame),
            motion.value("sensor_frame", sensor_frame),
            motion.cond_min_max,
            motion.lp_filter,
            float(motion.sample_rate),
            motion.max_speed_deviation,
        ),
        (motion.cond_time, motion.ramp_in_time, motion.value("offset", offset), motion.pos_corr_gain),
        (motion.ramp_out_time,),
    )
