"""The state machine on the robot as a client sees it: modules, signals, symbols, EGM settings, EGM's start and stop.

The interface is that of ABB's StateMachine Add-In 1.1 (reference/statemachine.md); the RAPID modules in
``controller_files`` have the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import IntEnum
from math import hypot, isclose, isfinite
from typing import Any, cast

from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.errors import (
    CommandRefused,
    ControllerRefused,
    ProtocolError,
    RobotNotReady,
    SettingsError,
    YumiError,
)
from abb_protocols.robot.description import Mass
from abb_protocols.robot.joints import Pose, Quaternion, Side, Vector
from abb_protocols.robot.load import Tool, inertia_of, principal_inertia
from abb_protocols.rws import rapid_values
from abb_protocols.rws.rapid_values import RapidValue
from abb_protocols.rws.values import RwsCode
from abb_runtime.clock import Clock, wait_until
from abb_runtime.parameters import bounded
from abb_runtime.rws.client import RwsClient
from yumi.driver.speed_setting import SpeedSetting

_NO_SYMBOL = {(400, RwsCode.FAIL), (404, RwsCode.FAIL)}  # of a symbol, and of a module, that is not there

MAIN_MODULE = "TRobMain"
EGM_MODULE = "TRobEGM"
SG_MODULE = "TRobSG"
RAPID_MODULE = "TRobRAPID"
WATCHDOG_MODULE = "TRobWatchdog"

START_JOINT_SIGNAL = "EGM_START_JOINT"
STOP_EGM_SIGNAL = "EGM_STOP"
RUN_RAPID_SIGNAL = "RUN_RAPID_ROUTINE"
ROUTINE_NAME_SYMBOL = "routine_name_input"
EXTERNAL_STATUS_SIGNAL = "WD_EXTERNAL_STATUS"
RUN_SG_SIGNAL = "RUN_SG_ROUTINE"


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

    Tool, work object and frames are RAPID values [mm, kg]; an empty text keeps those of the robot.

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
        SettingsError: a text is not a RAPID value of its type, or the tool is one that an arm cannot carry.
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
            text = getattr(self, name)
            if text and not _is_value(text, layout):  # the controller would refuse it in the middle of a start
                example = rapid_values.encode(layout)
                raise SettingsError(
                    message(
                        "egm_frame_not_rapid", setting=f"egm_motion: {name}", value=text, type=kind, example=example
                    )
                )
        try:
            self.own_tool()
        except CommandRefused as refusal:
            raise SettingsError(
                message("egm_tool_refused", setting="egm_motion: tool", value=self.tool, reason=said_by(refusal))
            ) from refusal

    def own_tool(self) -> Tool | None:
        """The :attr:`tool` with its load; None where that is empty."""
        if not self.tool:
            return None
        _, _, (mass, centre, axes, *moments) = cast("tuple[Any, ...]", rapid_values.decode(self.tool))
        load = Mass(mass, tuple(value * 1e-3 for value in centre), inertia_of(axes, moments))
        return Tool(self.tool_to_tool0, load)

    @property
    def tool_to_tool0(self) -> Pose:
        """The frame of :attr:`tool` [m]; tool0 itself where that is empty."""
        _, frame, _ = cast("tuple[RapidValue, ...]", rapid_values.decode(self.tool) if self.tool else _TOOL)
        (x, y, z), (qw, qx, qy, qz) = cast("tuple[Vector, Quaternion]", frame)
        length = hypot(qw, qx, qy, qz)
        return Pose((x * 1e-3, y * 1e-3, z * 1e-3), (qw / length, qx / length, qy / length, qz / length))

    def value(self, name: str, current: RapidValue) -> RapidValue:
        """The RAPID value of the text ``name``, or ``current`` where it is empty."""
        text: str = getattr(self, name)
        return rapid_values.decode(text) if text else current


def _is_value(text: str, layout: RapidValue) -> bool:
    try:
        return _has_layout(rapid_values.decode(text), layout)
    except ProtocolError:
        return False


def _has_layout(value: RapidValue, layout: RapidValue) -> bool:
    if isinstance(layout, tuple):
        if not isinstance(value, tuple) or len(value) != len(layout):
            return False
        parts = all(_has_layout(part, like) for part, like in zip(value, layout, strict=True))
        return parts and (layout != _UPRIGHT or isclose(hypot(*cast("tuple[float, ...]", value)), 1.0, abs_tol=1e-3))
    return type(value) is type(layout) and (not isinstance(value, float) or isfinite(value))


def _merge_egm_settings(record: RapidValue, motion: EgmMotionSettings, *, is_allowed: bool) -> RapidValue:
    """The RAPID record ``EGMSettings`` of the robot with the values of ``motion``; what it leaves open is kept.

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
            message("rapid_record_of_unknown_layout", symbol=f"{EGM_MODULE}/settings", value=str(record))
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


_START_DEADLINE = 1.0
_STOP_DEADLINE = 5.0


class StateMachines:
    """The state machines of both arms on one controller.

    Args:
        client: a connected client.
        motion: what EGM motions start with.
        clock: for waiting.
        speed: the robot's own limit is lowered with it.
    """

    def __init__(
        self, client: RwsClient, motion: EgmMotionSettings, clock: Clock, speed: SpeedSetting | None = None
    ) -> None:
        self._speed = speed or SpeedSetting()
        self._client = client
        self._motion = motion
        self._clock = clock
        self._tools: dict[Side, Tool] = {}  # of :meth:`set_tool`
        self._tcps: dict[Side, Pose] = {}  # as the robot's settings had them when they were read or written last

    def state(self, side: Side) -> MachineState:
        """The state of one arm's machine.

        Raises:
            RobotNotReady: the robot reports an unknown state, or another program is loaded.
        """
        try:
            return read_machine_state(self._client, side)
        except ControllerRefused as error:
            if (error.status, error.code) not in _NO_SYMBOL:
                raise
            raise RobotNotReady(message("state_machine_missing", task=side.task, module=MAIN_MODULE)) from error
        except ProtocolError as error:
            raise RobotNotReady(error.said) from error

    def states(self) -> Mapping[Side, MachineState]:
        return {side: self.state(side) for side in Side}

    @property
    def are_idle(self) -> bool:
        return all(self.state(side) is MachineState.IDLE for side in Side)

    def tool(self, side: Side) -> Tool | None:
        """What :meth:`set_tool` has set, or the tool of the settings; None where neither names one.

        What the robot has is no answer: its load may be that of a tool together with what an earlier driver had it
        carry, and outlives that driver.
        """
        return self._tools.get(side) or self._motion.own_tool()

    def read_tools(self) -> None:
        """Read once which tool each arm has on the robot, for :meth:`tcp`: an earlier driver may have set it.

        Settings that cannot be read are left to EGM's start, which says what is wrong with them.
        """
        for side in Side:
            with suppress(ControllerRefused, ProtocolError):
                record = self._client.value(side.task, EGM_MODULE, "settings")
                self._note_tcp(side, _merge_egm_settings(record, self._motion, is_allowed=False))

    def _note_tcp(self, side: Side, record: RapidValue) -> None:
        _, (place, turn), _ = cast("tuple[Any, ...]", record)[3][0]
        length = hypot(*turn)
        if length:  # a program that has not run yet holds zeros
            self._tcps[side] = Pose(tuple(it * 1e-3 for it in place), tuple(it / length for it in turn))

    def tcp(self, side: Side) -> Pose:
        """The frame in tool0 of the tool that EGM starts with next [m].

        By :meth:`set_tool`, else by the settings, else as the robot had it when it was connected or EGM was started.
        """
        if side in self._tools:
            return self._tools[side].tcp
        own = self._motion.tool_to_tool0
        return own if self._motion.tool else self._tcps.get(side, own)

    def set_tool(self, side: Side, tool: Tool) -> None:
        """Have the next EGM motion of an arm use ``tool`` and its payload; written now, and at each start of EGM.

        Raises:
            RobotNotReady: EGM runs on the arm, or the robot did not take the settings; nothing was changed.
        """
        if self.state(side) is MachineState.RUN_EGM_ROUTINE:
            raise RobotNotReady(message("tool_fixed_while_egm_runs", arm=side.word))
        before = self._tools.get(side)
        self._tools[side] = tool
        try:
            self._write_settings(side, self._speed.value, is_allowed=False)
        except YumiError:
            del self._tools[side]
            if before is not None:
                self._tools[side] = before
            raise

    def start_egm(self, arms: Sequence[Side]) -> None:
        """Write the EGM settings and start EGM joint motion on ``arms``; where EGM runs already it goes on.

        Raises:
            RobotNotReady: an arm did not start, or did not take its settings.
        """
        scale = self._speed.value
        starting = [side for side in arms if not self._speed.is_in_egm(side)]
        for side in Side:
            self._write_settings(side, scale, is_allowed=side in arms)
        self._client.pulse_signal(START_JOINT_SIGNAL)
        try:
            wait_until(
                self._clock,
                lambda: self._are_in(MachineState.RUN_EGM_ROUTINE, arms),
                _START_DEADLINE,
                lambda: message(
                    "state_machines_did_not_start_egm", timeout=_START_DEADLINE, machines=self._machines(arms)
                ),
            )
        finally:  # one of both may have started
            self._speed.note_start(starting, scale)

    def stop_egm(self) -> None:
        """Stop EGM; both arms come to rest.

        Raises:
            RobotNotReady: an arm did not become idle.
        """
        self._client.pulse_signal(STOP_EGM_SIGNAL)
        self.wait_for_idle(_STOP_DEADLINE + self._motion.ramp_out_time)

    def wait_for_idle(self, timeout: float) -> None:
        """Wait until both machines are idle, at most ``timeout`` [s]; raises RobotNotReady."""
        arms = tuple(Side)
        wait_until(
            self._clock,
            lambda: self._are_in(MachineState.IDLE, arms),
            timeout,
            lambda: message("state_machines_not_idle_in_time", timeout=timeout, machines=self._machines(arms)),
        )

    def _are_in(self, state: MachineState, arms: Sequence[Side]) -> bool:
        return all(self.state(side) is state for side in arms)

    def _machines(self, arms: Sequence[Side]) -> tuple[Message, ...]:
        return tuple(message("machine", arm=side.word, machine=self.state(side).name) for side in arms)

    def _write_settings(self, side: Side, scale: float, *, is_allowed: bool) -> None:
        motion = replace(self._motion, max_speed_deviation=scale * self._motion.max_speed_deviation)
        if side in self._tools:
            motion = replace(motion, tool=tooldata(self._tools[side]))
        current = self._client.value(side.task, EGM_MODULE, "settings")
        desired = _merge_egm_settings(current, motion, is_allowed=is_allowed)
        self._note_tcp(side, desired)
        if _equal(current, desired):
            return
        self._client.set_value(side.task, EGM_MODULE, "settings", desired)
        written = self._client.value(side.task, EGM_MODULE, "settings")
        if not _equal(written, desired):
            raise RobotNotReady(
                message("egm_settings_not_taken", task=side.task, written=str(desired), read=str(written))
            )


def tooldata(tool: Tool) -> str:
    """A tool with its payload as a RAPID value [mm, kg]: the controller's model of the arm counts both as its load."""
    total, place = tool.total, tuple(value * 1e3 for value in tool.tcp.position)
    axes, moments = principal_inertia(total)
    centre = tuple(value * 1e3 for value in total.centre)
    return rapid_values.encode((True, (place, tool.tcp.orientation), (total.mass, centre, axes, *moments)))


def read_machine_state(client: RwsClient, side: Side) -> MachineState:
    """The state of an arm's machine, read once; raises ProtocolError when there is no such state."""
    value = client.value(side.task, MAIN_MODULE, "current_state")
    if not isinstance(value, float) or value not in set(MachineState):
        symbol = f"{side.task}/{MAIN_MODULE}/current_state"
        raise ProtocolError(message("machine_state_unknown", symbol=symbol, value=rapid_values.encode(value)))
    return MachineState(int(value))


def _equal(left: RapidValue, right: RapidValue) -> bool:
    """Whether two values are the same in the single precision of RAPID's num."""
    if isinstance(left, tuple) and isinstance(right, tuple):
        return len(left) == len(right) and all(_equal(one, other) for one, other in zip(left, right, strict=True))
    if isinstance(left, float) and isinstance(right, float | int) and not isinstance(right, bool):
        return isclose(left, right, rel_tol=1e-5, abs_tol=1e-9)
    return left == right
