"""RAPID's EGM instructions of one arm (reference/egm.md §5): arguments to SI units, outcomes to RAPID errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from enum import Enum
from math import radians
from typing import Any

import numpy as np

from abb_protocols.egm.codec import PartialJoints
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import JOINT_COUNT, Pose
from abb_protocols.robot.kinematics import compose_poses
from abb_protocols.rws.values import EventType
from virtual_irc5.instructions.moves import MOVE_SPEED, MOVES, MoveInstructions, check_may_move, standing
from virtual_irc5.instructions.path_corrections import PathCorrections
from virtual_irc5.instructions.robot_data import FRAME_TYPES, pose_from_rapid, wobj_from_rapid
from virtual_irc5.mechanics.egm_client import EgmOutcome
from virtual_irc5.mechanics.egm_motion import Band, EgmActivation, EgmRun, EgmStopMode, ExternalMotionData
from virtual_irc5.mechanics.path import Offset, Passage
from virtual_irc5.rapid import Call, Library, RapidRuntimeError, Wait
from virtual_irc5.rapid.types import raised_as
from virtual_irc5.system_parameters import SystemConfiguration

_MOST_IDENTITIES = 4
"""EGM identities a task can hold at a time (reference/egm.md §4.8)."""

_FATAL = "ERR_EGM"
"""Stops the program at once, as on the real controller; not registered, so that no error handler gets it."""

_SENSOR_SIGNALS = ("R1x", "R2y", "R3z", "R4rx", "R5ry", "R6rz", "E1")
_AXES = [f"J{axis}" for axis in range(1, 8)]
_DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
_DEFAULT_BAND_DEG = (-0.5, 0.5)
_FINAL_OUTCOMES = (EgmOutcome.CONVERGED, EgmOutcome.STOPPED)
_INTERRUPTED_OUTCOMES = (EgmOutcome.ABORTED, EgmOutcome.MOTORS_OFF)
_PATH_LEVEL = 2  # of External Motion Interface Data
_NO_OFFSET = np.zeros(3)
_PATH_SAMPLE_MS = 24  # sample rates of path corrections are multiples of it


EGM = Library(MOVES)
_IDENTITY = "VAR egmident EGMid"
_CORRECTED_MOVE = (
    rf"robtarget ToPoint, \identno ID, {MOVE_SPEED}, tooldata Tool, \wobjdata WObj, \loaddata TLoad, \switch NoCorr"
)


def _each(type_name: str, names: Iterable[str]) -> str:
    """An optional parameter for each name."""
    return "".join(rf", \{type_name} {name}" for name in names)


def _from_signals(type_name: str, kind: str) -> str:
    names = (*_SENSOR_SIGNALS, *(f"E{number}" for number in range(2, 7)))
    inputs = _each(f"VAR {type_name}", (f"{kind}{name}" for name in names))
    return (
        rf"mecunit MecUnit, {_IDENTITY}, string ExtConfigName, \switch Joint | \switch Pose | \switch PathCorr, "
        rf"\switch APTR | \switch LATR{inputs}"
    )


def _frames(call: Call) -> tuple[Pose | None, Pose | None]:
    """Tool and work object of a call, None where they are left out."""
    tool, wobj = call.get("Tool"), call.get("WObj")
    return (
        None if tool is None else pose_from_rapid(tool.tframe),
        None if wobj is None else wobj_from_rapid(wobj),
    )


class Guidance(Enum):
    """What EGMSetupUC has chosen that the sensor sends."""

    JOINTS = "joints"
    POSES = "poses"
    PATH_CORRECTIONS = "path corrections"


class EgmInstructions:
    """The EGM instructions of one task."""

    def __init__(
        self, motion: MoveInstructions, corrections: PathCorrections, configuration: SystemConfiguration
    ) -> None:
        self._motion = motion
        self._corrections = corrections
        self._unit = motion.unit
        self._client = motion.unit.egm
        self._configuration = configuration
        self._events = motion.events
        self._run: EgmRun | None = None
        self._count = motion.arm.kinematics.joint_count
        self._guidance = Guidance.JOINTS
        self._level = 0  # of the External Motion Interface Data that EGMSetupUC has chosen
        self._corrects_moves = False  # EGMActMove has been executed since the last EGMSetupUC

    @EGM.instruction("EGMGetId", _IDENTITY)
    def get_id(self, call: Call) -> None:
        """The same variable keeps its identity."""
        identities = self._unit.egm_identities
        name = call.reference("EGMid").name.lower()
        if name not in identities and len(identities) >= _MOST_IDENTITIES:
            self._events.append(41828, "Too many EGM instances", type=EventType.ERROR)
            sentence = f"{_MOST_IDENTITIES} EGM identities are in use; give one back with EGMReset (41828)."
            raise call.error(_FATAL, sentence)
        identities.add(name)
        self._client.get_id()

    @EGM.instruction("EGMReset", _IDENTITY)
    def reset(self, call: Call) -> None:
        """End what the identity runs and give it back."""
        self._unit.egm_identities.discard(call.reference("EGMid").name.lower())
        self._client.reset()

    @EGM.instruction(
        "EGMSetupUC",
        rf"mecunit MecUnit, {_IDENTITY}, string ExtConfigName, string UCDevice, \switch Joint | \switch Pose "
        r"| \switch PathCorr, \switch APTR | \switch LATR, \num CommTimeout",
    )
    def setup_uc(self, call: Call) -> None:
        """Choose device and motion data."""
        if not call.present("Joint") and self._count == JOINT_COUNT:
            raise call.error(_FATAL, "a seven-axis arm uses EGM with \\Joint on RobotWare 6.")
        if call.present("LATR"):
            raise call.error(_FATAL, "this virtual controller has no sensors that look ahead (\\LATR): use \\APTR.")
        if call["MecUnit"].type != "TCPRobot":
            raise call.error(_FATAL, f"{call['MecUnit'].name} is not a TCP robot (41830).")
        name = call["UCDevice"]
        device = self._configuration.find("SIO", "COM_TRP", name.rstrip(":"))  # old programs write a colon behind it
        if device is None or device.attributes["Type"] != "UDPUC":
            raise call.error("ERR_UDPUC_COMM", f"no Transmission Protocol of type UDPUC is called '{name}' (41830).")
        self._unit.egm_device = device.name
        data = self._motion_data(call)
        self._do(lambda: self._client.setup(call.get("CommTimeout", 1.0), data))
        self._guidance = Guidance.POSES if call.present("Pose") else Guidance.JOINTS
        if call.present("PathCorr"):
            self._guidance = Guidance.PATH_CORRECTIONS
        self._level, self._corrects_moves = data.level, False

    @EGM.instruction("EGMSetupAI", _from_signals("signalai", "ai"))
    @EGM.instruction("EGMSetupAO", _from_signals("signalao", "ao"))
    @EGM.instruction("EGMSetupGI", _from_signals("signalgi", "gi"))
    def setup_signals(self, call: Call) -> None:
        """References [deg] from I/O signals, axis 7 from the first of E1 to E6."""
        if not call.present("Joint"):
            raise call.error(_FATAL, "signals guide the joints here: use \\Joint.")
        if call["MecUnit"].type != "TCPRobot":
            raise call.error(_FATAL, f"{call['MecUnit'].name} is not a TCP robot (41830).")
        kind, task = call.name[-2:].lower(), call.task
        own = _SENSOR_SIGNALS[: self._count]
        names = [call[f"{kind}{each}"].name if call.present(f"{kind}{each}") else "" for each in own]
        if not any(names):
            raise call.error(_FATAL, "at least one signal has to be given.")
        for name in filter(None, names):
            task.read_signal(name)  # raises where there is none, or its device is disabled

        def read() -> PartialJoints:
            return self._ordered([radians(task.read_signal(name)) if name else None for name in names])

        data = self._motion_data(call)
        self._do(lambda: self._client.setup(ext_config=data, signals=read))
        self._guidance = Guidance.JOINTS

    def _motion_data(self, call: Call) -> ExternalMotionData:
        name = call["ExtConfigName"]
        found = self._configuration.find("MOC", "EXT_MOTION_DATA", name)
        if found is None:
            raise call.error(_FATAL, f"there is no External Motion Interface Data '{name}'.")
        attributes = found.attributes
        return ExternalMotionData(
            level=int(attributes["ext_motion_level"]),
            position_gain=float(attributes["ext_motion_Kp"]),
            bandwidth=float(attributes["ext_motion_filter_bandwidth"]),
            ramp_time=float(attributes["ramp_time"]),
            restarts_after_motors_off=attributes["do_not_restart_after_motors_off"].upper() != "TRUE",
        )

    def _activate(self, call: Call, axes: EgmActivation) -> None:
        """Use the settings of an act instruction: those of its axes, and what all act instructions have."""
        activation = replace(
            axes,
            lp_filter=call.get("LpFilter"),
            sample_rate_ms=int(call.get("SampleRate", 4.0)),
            max_pos_deviation=radians(call.get("MaxPosDeviation", 1000.0)),
            max_speed_deviation=radians(call.get("MaxSpeedDeviation", 1.0)),
        )
        self._do(lambda: self._client.activate(activation))
        if call.present("StreamStart") and not self._client.is_streaming:
            self._do(lambda: self._client.stream_start(activation.sample_rate_ms))

    @EGM.instruction(
        "EGMActJoint",
        rf"{_IDENTITY}, \switch StreamStart, \tooldata Tool, \wobjdata WObj, \loaddata TLoad"
        rf"{_each('egm_minmax', _AXES)}, \num LpFilter, \num SampleRate, \num MaxPosDeviation, \num MaxSpeedDeviation",
    )
    def act_joint(self, call: Call) -> None:
        r"""The settings of the runs that follow; with \StreamStart positions are sent at once."""
        self._check_guidance(call, Guidance.JOINTS)
        tool, wobj = _frames(call)
        bands_deg: list[Band] = [call.get(axis, _DEFAULT_BAND_DEG) for axis in _AXES[: self._count]]
        bands = self._ordered([(radians(low), radians(high)) for low, high in bands_deg])
        self._activate(call, EgmActivation(tool=tool, wobj=wobj, cond_min_max=bands))

    def _check_guidance(self, call: Call, needed: Guidance) -> None:
        """Refuse an instruction for something else than EGMSetupUC has chosen."""
        if self._guidance is needed:
            return
        self._events.append(41826, "EGM mode mismatch", type=EventType.ERROR)
        if self._count == JOINT_COUNT:
            raise RapidRuntimeError(
                _FATAL,
                "EGM moves a seven-axis arm by EGMActJoint and EGMRunJoint on RobotWare 6, not otherwise (41826).",
            )
        raise call.error(_FATAL, f"EGMSetupUC has chosen {self._guidance.value} (41826).")

    def _ordered(self, axes: Sequence[Any]) -> tuple[Any, ...]:
        """One thing per axis in chain order."""
        return tuple(axes[number - 1] for number in self._motion.arm.kinematics.axes)

    @EGM.instruction(
        "EGMActPose",
        rf"{_IDENTITY}, \switch StreamStart, \tooldata Tool, \wobjdata WObj, \loaddata TLoad, pose CorrFrame, "
        rf"egmframetype CorrFrType, pose SensorFrame, egmframetype SensorFrType{_each('egm_minmax', _DIRECTIONS)}, "
        r"\num LpFilter, \num SampleRate, \num MaxPosDeviation, \num MaxSpeedDeviation",
    )
    def act_pose(self, call: Call) -> None:
        """The settings of the runs that follow; the sensor's poses are in SensorFrame.

        CorrFrame is about corrections of a path, and changes nothing.
        """
        self._check_guidance(call, Guidance.POSES)
        tool, wobj = _frames(call)
        frame = pose_from_rapid(call["SensorFrame"])
        kind = FRAME_TYPES[int(call["SensorFrType"])]
        if kind == "WOBJ" and wobj is not None:
            frame = compose_poses(wobj, frame)
        elif kind == "TOOL":
            frame = compose_poses(self._unit.arm.tool_pose(self._unit.arm.planned, tool), frame)
        in_rapid = [call.get(each, (-0.5, 0.5)) for each in _DIRECTIONS]
        scales = [1e-3] * 3 + [radians(1.0)] * 3
        bands = tuple((low * s, high * s) for (low, high), s in zip(in_rapid, scales, strict=True))
        self._activate(call, EgmActivation(tool=tool, wobj=wobj, frame=frame, cond_min_max=bands))

    @EGM.instruction("EGMActMove", rf"{_IDENTITY}, pose SensorFrame, \num SampleRate")
    def act_move(self, call: Call) -> None:
        """The sample rate of the moves that follow.

        The offsets of an at-point tracker are along the axes of the path, so that SensorFrame changes nothing.
        """
        self._check_guidance(call, Guidance.PATH_CORRECTIONS)
        rate_ms = int(call.get("SampleRate", float(_PATH_SAMPLE_MS)))
        activation = EgmActivation(sample_rate_ms=max(1, rate_ms // _PATH_SAMPLE_MS) * _PATH_SAMPLE_MS)
        self._do(lambda: self._client.activate(activation))
        self._corrects_moves = True

    @EGM.instruction("EGMMoveL", f"{_IDENTITY}, {_CORRECTED_MOVE}")
    @EGM.instruction("EGMMoveC", f"{_IDENTITY}, robtarget CirPoint, {_CORRECTED_MOVE}")
    def move_corrected(self, call: Call) -> Wait:
        """A move whose path the sensor corrects, from a fine point to a fine point."""
        client, path = self._client, self._unit.arm.path
        self._check_guidance(call, Guidance.PATH_CORRECTIONS)
        if not self._corrects_moves:
            raise call.error(_FATAL, "no path is corrected yet: use EGMActMove before.")
        if self._level != _PATH_LEVEL:
            self._events.append(50452, "External Interface cyclic error", type=EventType.ERROR)
            raise call.error(_FATAL, f"the External Motion Interface Data needs the level {_PATH_LEVEL}, Path (50452).")
        if not client.has_path:
            yield from self._standing(call)
        self._do(client.expect_path)
        self._corrections.attach()
        passages: list[Passage] = []

        def begin(passage: Passage) -> None:
            passages.append(passage)
            self._do(lambda: client.correct_path(passage))

        offset: Offset = (lambda: _NO_OFFSET) if call.present("NoCorr") else (lambda: client.offset)
        moving = self._motion.passed(call, self._motion.build(call), begin, offset)
        client.is_path_awaited = True
        try:
            for due in moving:
                self._check_sensor()
                # The program had been stopped and continues: the sensor corrects the rest of the path.
                if (
                    passages
                    and client.outcome in _INTERRUPTED_OUTCOMES
                    and client.resumes
                    and not path.has_ended(passages[0])
                ):
                    begin(passages[0])
                yield due
        finally:
            client.is_path_awaited = False
            moving.close()

    def _check_sensor(self) -> None:
        """Raise the error of a sensor that has been silent, as far as the program can handle it."""
        if self._client.outcome is EgmOutcome.COMM_TIMEOUT:
            self._events.append(41822, "No data from the UdpUc device", self._client.fault, EventType.ERROR)
            raise RapidRuntimeError("ERR_UDPUC_COMM", self._client.fault)

    @EGM.instruction(
        "EGMRunPose",
        rf"{_IDENTITY}, egmstopmode Mode, \switch NoWaitCond{_each('switch', _DIRECTIONS)}, \num CondTime, "
        r"\num RampInTime, \num RampOutTime, \pose Offset, \num PosCorrGain",
    )
    def run_pose(self, call: Call) -> Wait:
        """As EGMRunJoint."""
        self._check_guidance(call, Guidance.POSES)
        yield from self._running(call, tuple(call.present(each) for each in _DIRECTIONS))

    @EGM.instruction(
        "EGMRunJoint",
        rf"{_IDENTITY}, egmstopmode Mode, \switch NoWaitCond{_each('switch', _AXES)}, \num CondTime, \num RampInTime, "
        r"\num RampOutTime, \num PosCorrGain",
    )
    def run_joint(self, call: Call) -> Wait:
        """Until EGM ends; an abandoned call lets EGM go on, EGMStop ends it."""
        self._check_guidance(call, Guidance.JOINTS)
        yield from self._running(call, self._ordered([call.present(axis) for axis in _AXES[: self._count]]))

    def _running(self, call: Call, axes: tuple[bool, ...]) -> Wait:
        check_may_move(call)
        if not self._unit.has_moved:
            raise call.error(
                _FATAL, "EGM cannot be the first motion after a start; run a MoveAbsJ to CJointT() before."
            )
        yield from self._standing(call)
        self._run = run = EgmRun(
            stop_mode=EgmStopMode(int(call["Mode"])),
            axes=axes,
            cond_time=call.get("CondTime", 1.0),
            ramp_in_time=call.get("RampInTime", 0.0),
            ramp_out_time=call.get("RampOutTime", 1.0),
            pos_corr_gain=call.get("PosCorrGain", 1.0),
            is_waited=not call.present("NoWaitCond"),
        )
        self._do(lambda: self._client.run_joint(run))
        if run.is_waited:
            yield from self._until_over(call, run)

    def _standing(self, call: Call) -> Wait:
        """The program's moves have to end in a fine point; EGM's own way to a stop is waited for."""
        arm = self._unit.arm
        if not arm.path.is_empty:
            raise call.error(_FATAL, "EGM has to begin in a fine point: end the move before it with zonedata fine.")
        yield from standing(arm)

    @EGM.instruction("EGMWaitCond", _IDENTITY)
    def wait_cond(self, call: Call) -> Wait:
        r"""Until the run that was started with \NoWaitCond ends."""
        if self._run is None:
            raise call.error(_FATAL, "there was no EGMRunJoint to wait for.")
        yield from self._until_over(call, self._run)

    @EGM.instruction("EGMStop", rf"{_IDENTITY}, egmstopmode Mode, \num RampOutTime")
    def stop(self, call: Call) -> Wait:
        """Done when the arm stands."""
        self._client.stop(EgmStopMode(int(call["Mode"])), call.get("RampOutTime", 0.0))
        yield from standing(self._unit.arm)

    @EGM.instruction("EGMStreamStart", rf"{_IDENTITY}, \num SampleRate")
    def stream_start(self, call: Call) -> None:
        self._do(lambda: self._client.stream_start(int(call.get("SampleRate", 4.0))))

    @EGM.instruction("EGMStreamStop", _IDENTITY)
    def stream_stop(self, call: Call) -> None:
        self._client.stream_stop()

    @EGM.function("EGMGetState", _IDENTITY, "egmstate")
    def state(self, call: Call) -> Any:
        return float(self._client.state)

    def _until_over(self, call: Call, run: EgmRun) -> Wait:
        while True:
            yield None
            outcome = self._client.outcome
            if outcome is EgmOutcome.COMM_TIMEOUT and not run.is_waited:
                # A program that did not wait cannot handle the error: the controller logs it.
                raise RapidRuntimeError(_FATAL, self._client.fault)
            self._check_sensor()
            if outcome in _FINAL_OUTCOMES or not self._client.resumes:
                break
            if outcome is not EgmOutcome.RUNNING and self._unit.arm.is_stationary:
                # The program had been stopped and continues: the interrupted instruction starts EGM again.
                check_may_move(call)
                self._do(lambda: self._client.run_joint(run))
        yield from standing(self._unit.arm)

    def _do(self, action: Callable[[], None]) -> None:
        with raised_as(_FATAL, RobotNotReady):
            action()
