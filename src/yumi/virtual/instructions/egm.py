"""RAPID's EGM instructions of one arm (reference/egm.md §5): arguments to SI units, outcomes to RAPID errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import radians
from typing import Any

from yumi.egm.codec import PartialJoints
from yumi.errors import RobotNotReady
from yumi.rapid.library import Call, Library, Wait
from yumi.rapid.types import RapidRuntimeError
from yumi.robot.joints import JOINT_COUNT
from yumi.robot.kinematics import compose
from yumi.rws.types import EventType
from yumi.virtual.controller.egm import EgmOutcome
from yumi.virtual.controller.events import EventLog
from yumi.virtual.controller.signals import Configuration
from yumi.virtual.controller.units import ArmUnit
from yumi.virtual.instructions.data import FRAME_TYPES, chain_order, pose_from_rapid, wobj_from_rapid
from yumi.virtual.instructions.motion import check_may_move
from yumi.virtual.mechanics.motion import Band, EgmActivation, EgmRun, ExternalMotionData, StopMode

MOST_IDENTITIES = 4
"""EGM identities a task can hold at a time (reference/egm.md §4.8)."""

FATAL = "ERR_EGM"
"""Stops the program at once, as on the real controller; not registered, so that no error handler gets it."""

_SENSOR_SIGNALS = ("R1x", "R2y", "R3z", "R4rx", "R5ry", "R6rz", "E1")
_AXES = [f"J{axis}" for axis in range(1, 8)]
_DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
_DEFAULT_BAND_DEG = (-0.5, 0.5)
_FINAL_OUTCOMES = (EgmOutcome.CONVERGED, EgmOutcome.STOPPED)


class EgmInstructions:
    """The EGM instructions of one task."""

    def __init__(self, unit: ArmUnit, configuration: Configuration, events: EventLog) -> None:
        self._unit = unit
        self._client = unit.egm
        self._configuration = configuration
        self._events = events
        self._run: EgmRun | None = None
        self._count = unit.arm.kinematics.joint_count
        self._is_pose = False

    def get_id(self, call: Call) -> None:
        """EGMGetId: the same variable keeps its identity."""
        identities = self._unit.egm_identities
        name = call.reference("EGMid").name.lower()
        if name not in identities and len(identities) >= MOST_IDENTITIES:
            self._events.append(41828, "Too many EGM instances", type=EventType.ERROR)
            raise RapidRuntimeError(
                FATAL, f"EGMGetId: {MOST_IDENTITIES} EGM identities are in use; give one back with EGMReset (41828)."
            )
        identities.add(name)
        self._client.get_id()

    def reset(self, call: Call) -> None:
        """EGMReset: end what the identity runs and give it back."""
        self._unit.egm_identities.discard(call.reference("EGMid").name.lower())
        self._client.reset()

    def setup_uc(self, call: Call) -> None:
        """EGMSetupUC: choose device and motion data."""
        if not call.present("Joint") and self._count == JOINT_COUNT:
            raise RapidRuntimeError(FATAL, "EGMSetupUC: a seven-axis arm uses EGM with \\Joint on RobotWare 6.")
        if call.present("PathCorr"):
            raise RapidRuntimeError(FATAL, "EGMSetupUC: this virtual controller has EGM with \\Joint and \\Pose only.")
        self._is_pose = call.present("Pose")
        if call["MecUnit"].type != "TCPRobot":
            raise RapidRuntimeError(FATAL, f"EGMSetupUC: {call['MecUnit'].name} is not a TCP robot (41830).")
        name = call["UCDevice"]
        device = self._configuration.find("SIO", "COM_TRP", name.rstrip(":"))  # old programs write a colon behind it
        if device is None or device.attributes["Type"] != "UDPUC":
            raise RapidRuntimeError(
                "ERR_UDPUC_COMM", f"EGMSetupUC: no Transmission Protocol of type UDPUC is called '{name}' (41830)."
            )
        self._unit.egm_device = device.name
        data = self._motion_data(call)
        self._do(lambda: self._client.setup(call.get("CommTimeout", 1.0), data))

    def setup_signals(self, call: Call) -> None:
        """EGMSetupAI, EGMSetupAO, EGMSetupGI: references [deg] from I/O signals, axis 7 from the first of E1 to E6."""
        if not call.present("Joint"):
            raise RapidRuntimeError(FATAL, f"{call.name}: signals guide the joints here: use \\Joint.")
        if call["MecUnit"].type != "TCPRobot":
            raise RapidRuntimeError(FATAL, f"{call.name}: {call['MecUnit'].name} is not a TCP robot (41830).")
        kind, task = call.name[-2:].lower(), call.task
        self._is_pose = False
        own = _SENSOR_SIGNALS[: self._count]
        names = [call[f"{kind}{each}"].name if call.present(f"{kind}{each}") else "" for each in own]
        if not any(names):
            raise RapidRuntimeError(FATAL, f"{call.name}: at least one signal has to be given.")
        for name in filter(None, names):
            task.read_signal(name)  # raises where there is none, or its device is disabled

        def read() -> PartialJoints:
            return self._ordered([radians(task.read_signal(name)) if name else None for name in names])

        data = self._motion_data(call)
        self._do(lambda: self._client.setup(ext_config=data, signals=read))

    def _motion_data(self, call: Call) -> ExternalMotionData:
        name = call["ExtConfigName"]
        found = self._configuration.find("MOC", "EXT_MOTION_DATA", name)
        if found is None:
            raise RapidRuntimeError(FATAL, f"{call.name}: there is no External Motion Interface Data '{name}'.")
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

    def act_joint(self, call: Call) -> None:
        r"""EGMActJoint: the settings of the runs that follow; with \StreamStart positions are sent at once."""
        if self._is_pose:
            self.refuse_mode(call)
        tool, wobj = call.get("Tool"), call.get("WObj")
        bands_deg: list[Band] = [call.get(axis, _DEFAULT_BAND_DEG) for axis in _AXES[: self._count]]
        axes = EgmActivation(
            tool=None if tool is None else pose_from_rapid(tool.tframe),
            wobj=None if wobj is None else wobj_from_rapid(wobj),
            cond_min_max=self._ordered([(radians(low), radians(high)) for low, high in bands_deg]),
        )
        self._activate(call, axes)

    def refuse_mode(self, call: Call) -> None:
        """What EGMSetupUC has chosen is the other kind of motion."""
        self._events.append(41826, "EGM mode mismatch", type=EventType.ERROR)
        if self._count == JOINT_COUNT:
            raise RapidRuntimeError(
                FATAL, "EGM moves a seven-axis arm by EGMActJoint and EGMRunJoint on RobotWare 6, not by poses (41826)."
            )
        chosen = "poses" if self._is_pose else "joints"
        raise RapidRuntimeError(FATAL, f"{call.name}: EGMSetupUC has chosen {chosen} (41826).")

    def _ordered(self, axes: Sequence[Any]) -> tuple[Any, ...]:
        """One thing per axis in chain order."""
        return chain_order(axes) if self._count == JOINT_COUNT else tuple(axes)

    def act_pose(self, call: Call) -> None:
        r"""EGMActPose: the settings of the runs that follow; the sensor's poses are in SensorFrame.

        Corrections of a path are not made here, so that CorrFrame changes nothing.
        """
        if not self._is_pose:
            self.refuse_mode(call)
        tool, wobj = call.get("Tool"), call.get("WObj")
        tool_pose = None if tool is None else pose_from_rapid(tool.tframe)
        wobj_pose = None if wobj is None else wobj_from_rapid(wobj)
        frame = pose_from_rapid(call["SensorFrame"])
        kind = FRAME_TYPES[int(call["SensorFrType"])]
        if kind == "WOBJ" and wobj_pose is not None:
            frame = compose(wobj_pose, frame)
        elif kind == "TOOL":
            frame = compose(self._unit.arm.tool_pose(self._unit.arm.planned, tool_pose), frame)
        bands = [call.get(each, (-0.5, 0.5)) for each in _DIRECTIONS]
        scales = [1e-3] * 3 + [radians(1.0)] * 3
        axes = EgmActivation(
            tool=tool_pose,
            wobj=wobj_pose,
            frame=frame,
            cond_min_max=tuple((low * s, high * s) for (low, high), s in zip(bands, scales, strict=True)),
        )
        self._activate(call, axes)

    def run_pose(self, call: Call) -> Wait:
        """EGMRunPose: as EGMRunJoint."""
        if not self._is_pose:
            self.refuse_mode(call)
        yield from self._running(call, tuple(call.present(each) for each in _DIRECTIONS))

    def run_joint(self, call: Call) -> Wait:
        """EGMRunJoint: until EGM ends; an abandoned call lets EGM go on, EGMStop ends it."""
        if self._is_pose:
            self.refuse_mode(call)
        yield from self._running(call, self._ordered([call.present(axis) for axis in _AXES[: self._count]]))

    def _running(self, call: Call, axes: tuple[bool, ...]) -> Wait:
        check_may_move(call)
        if not self._unit.has_moved:
            raise RapidRuntimeError(
                FATAL, f"{call.name}: EGM cannot be the first motion after a start; run a MoveAbsJ to CJointT() before."
            )
        yield from self._standing(call)
        self._run = run = EgmRun(
            stop_mode=StopMode(int(call["Mode"])),
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
            sentence = f"{call.name}: EGM has to begin in a fine point: end the move before it with zonedata fine."
            raise RapidRuntimeError(FATAL, sentence)
        while not arm.is_stationary:
            yield None

    def wait_cond(self, call: Call) -> Wait:
        r"""EGMWaitCond: until the run that was started with \NoWaitCond ends."""
        if self._run is None:
            raise RapidRuntimeError(FATAL, "EGMWaitCond: there was no EGMRunJoint to wait for.")
        yield from self._until_over(call, self._run)

    def stop(self, call: Call) -> Wait:
        """EGMStop: done when the arm stands."""
        self._client.stop(StopMode(int(call["Mode"])), call.get("RampOutTime", 0.0))
        while not self._unit.arm.is_stationary:
            yield None

    def stream_start(self, call: Call) -> None:
        """EGMStreamStart."""
        self._do(lambda: self._client.stream_start(int(call.get("SampleRate", 4.0))))

    def stream_stop(self, call: Call) -> None:
        """EGMStreamStop."""
        self._client.stream_stop()

    def state(self, call: Call) -> Any:
        """EGMGetState."""
        return float(self._client.state)

    def _until_over(self, call: Call, run: EgmRun) -> Wait:
        while True:
            yield None
            outcome = self._client.outcome
            if outcome is EgmOutcome.COMM_TIMEOUT:
                if not run.is_waited:  # a program that did not wait cannot handle the error: the controller logs it
                    raise RapidRuntimeError(FATAL, self._client.fault)
                self._events.append(41822, "No data from the UdpUc device", self._client.fault, EventType.ERROR)
                raise RapidRuntimeError("ERR_UDPUC_COMM", self._client.fault)
            if outcome in _FINAL_OUTCOMES or not self._client.resumes:
                break
            if outcome is not EgmOutcome.RUNNING and self._unit.arm.is_stationary:
                # The program had been stopped and continues: the interrupted instruction starts EGM again.
                check_may_move(call)
                self._do(lambda: self._client.run_joint(run))
        while not self._unit.arm.is_stationary:
            yield None

    def _do(self, action: Callable[[], None]) -> None:
        try:
            action()
        except RobotNotReady as error:
            raise RapidRuntimeError(FATAL, str(error)) from error


def add_egm(library: Library, unit: ArmUnit, configuration: Configuration, events: EventLog) -> None:
    """Register the EGM instructions of one task."""
    egm = EgmInstructions(unit, configuration, events)
    identity = "VAR egmident EGMid"
    own = _AXES[: unit.arm.kinematics.joint_count]
    bands = "".join(rf", \egm_minmax {axis}" for axis in own)
    switches = "".join(rf", \switch {axis}" for axis in own)
    library.instruction("EGMGetId", identity)(egm.get_id)
    library.instruction("EGMReset", identity)(egm.reset)
    library.instruction(
        "EGMSetupUC",
        rf"mecunit MecUnit, {identity}, string ExtConfigName, string UCDevice, \switch Joint | \switch Pose "
        r"| \switch PathCorr, \switch APTR | \switch LATR, \num CommTimeout",
    )(egm.setup_uc)
    for kind, signal in (("AI", "signalai"), ("AO", "signalao"), ("GI", "signalgi")):
        names = (*_SENSOR_SIGNALS, *(f"E{number}" for number in range(2, 7)))
        inputs = "".join(rf", \VAR {signal} {kind.lower()}{name}" for name in names)
        library.instruction(
            f"EGMSetup{kind}",
            rf"mecunit MecUnit, {identity}, string ExtConfigName, \switch Joint | \switch Pose | \switch PathCorr, "
            rf"\switch APTR | \switch LATR{inputs}",
        )(egm.setup_signals)
    library.instruction(
        "EGMActJoint",
        rf"{identity}, \switch StreamStart, \tooldata Tool, \wobjdata WObj, \loaddata TLoad{bands}, "
        r"\num LpFilter, \num SampleRate, \num MaxPosDeviation, \num MaxSpeedDeviation",
    )(egm.act_joint)
    library.instruction(
        "EGMRunJoint",
        rf"{identity}, egmstopmode Mode, \switch NoWaitCond{switches}, \num CondTime, \num RampInTime, "
        r"\num RampOutTime, \num PosCorrGain",
    )(egm.run_joint)
    bands = "".join(rf", \egm_minmax {direction}" for direction in _DIRECTIONS)
    library.instruction(
        "EGMActPose",
        rf"{identity}, \switch StreamStart, \tooldata Tool, \wobjdata WObj, \loaddata TLoad, pose CorrFrame, "
        rf"egmframetype CorrFrType, pose SensorFrame, egmframetype SensorFrType{bands}, \num LpFilter, "
        r"\num SampleRate, \num MaxPosDeviation, \num MaxSpeedDeviation",
    )(egm.act_pose)
    switches = "".join(rf", \switch {direction}" for direction in _DIRECTIONS)
    library.instruction(
        "EGMRunPose",
        rf"{identity}, egmstopmode Mode, \switch NoWaitCond{switches}, \num CondTime, \num RampInTime, "
        r"\num RampOutTime, \pose Offset, \num PosCorrGain",
    )(egm.run_pose)
    library.instruction("EGMWaitCond", identity)(egm.wait_cond)
    library.instruction("EGMStop", rf"{identity}, egmstopmode Mode, \num RampOutTime")(egm.stop)
    library.instruction("EGMStreamStart", rf"{identity}, \num SampleRate")(egm.stream_start)
    library.instruction("EGMStreamStop", identity)(egm.stream_stop)
    library.function("EGMGetState", identity, "egmstate")(egm.state)
