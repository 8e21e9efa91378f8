r"""What a program sets for its motions (ConfL, AccSet, VelSet, PDispOn ...), how it stops, retraces and corrects them.

The path recorder (option Path Recovery) records where the arm was planned to be in each cycle, so that the way back is
the way it came, whatever moves it was made of.

Path corrections (option 612-1, Path Offset) are offsets that a program adds to moves with \Corr, in path coordinates: x
along the path, y across it and the tool's z axis, z completes them. An offset is taken over while the arm moves,
smoothly; at standstill nothing changes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from yumi.errors import RobotNotReady
from yumi.rapid.builtins.data import LINEAR_AXIS_MM_S, ROTATING_AXIS_DEG_S
from yumi.rapid.library import Call, Library, Wait
from yumi.rapid.program import SystemEvent
from yumi.rapid.types import RapidRuntimeError
from yumi.robot.arm_kinematics import Lost
from yumi.robot.joints import JOINT_COUNT, Joints, Pose
from yumi.robot.kinematics import compose, inverse
from yumi.rws.types import EventType
from yumi.virtual.controller.events import EventLog
from yumi.virtual.controller.units import ArmUnit
from yumi.virtual.instructions.data import NOT_PRESENT, chain_order, jointtarget, rapid_from_pose, unit_quaternion
from yumi.virtual.instructions.motion import FATAL, MotionInstructions, check_may_move, place_of
from yumi.virtual.mechanics.arm import STOPPED, VirtualArm
from yumi.virtual.mechanics.path import Acceleration, Passage
from yumi.virtual.mechanics.path_geometry import (
    CircleMode,
    Frames,
    Leg,
    MotionFault,
    Speed,
    Zone,
    followed,
    retraced_leg,
)

Array = NDArray[np.float64]

STOP_MOVE = "StopMove"
"""Why an arm stands on its path: the program has stopped its movements."""

_SMALLEST_FACTOR = 0.2  # of AccSet
_LOWEST_ACCELERATION = 0.1  # of PathAccLim [m/s²]

_CIRCLE_MODES = {
    "ObjectFrame": CircleMode.OBJECT,
    "CirPointOri": CircleMode.POINT,
    "Wrist45": CircleMode.OBJECT,
    "Wrist46": CircleMode.OBJECT,
    "Wrist56": CircleMode.OBJECT,
}

_MODE_SWITCHES = ("PathFrame", *_CIRCLE_MODES)
_TUNING_TYPES = ("DF", "KP", "KV", "TI", "FRIC_LEV", "FRIC_RAMP", "DG", "DH", "DI", "DK", "DL")


class MotionSettingInstructions:
    """The settings and stops of one task."""

    def __init__(self, motion: MotionInstructions, robots: Sequence[ArmUnit], *, is_motion_task: bool) -> None:
        self._motion = motion
        self._unit = motion.unit
        self._robots, self._is_motion_task = robots, is_motion_task

    # Settings -----------------------------------------------------------------------------------------------------

    def check_lines(self, call: Call) -> None:
        """ConfL."""
        self._unit.settings.checks_lines = not call.present("Off")

    def check_joints(self, call: Call) -> None:
        """ConfJ."""
        self._unit.settings.checks_joints = not call.present("Off")

    def singular_area(self, call: Call) -> None:
        r"""SingArea: accepted; the orientation is kept with \Wrist, too, and the arm slows down instead."""
        self._unit.settings.locks_axis4 = call.present("LockAxis4")
        self._unit.settings.wrist_may_turn = call.present("Wrist") or call.present("LockAxis4")

    def set_acceleration(self, call: Call) -> None:
        """AccSet: accelerations and how fast they build up, 20 to 100 %."""
        settings, ramp = self._unit.settings, max(call["Ramp"], 10.0)
        settings.accelerations = (call["Acc"], ramp, call.get("FinePointRamp", 100.0))
        self._accelerate(along=self._unit.arm.path.acceleration.along)

    def limit_acceleration(self, call: Call) -> None:
        """PathAccLim: the tool's acceleration along the path [m/s²]."""
        limits = [
            call[f"{name}Max"]
            for name, flag in (("Acc", "AccLim"), ("Decel", "DecelLim"))
            if call[flag] and call.present(f"{name}Max")
        ]
        if any(limit < _LOWEST_ACCELERATION for limit in limits):
            sentence = f"PathAccLim takes at least {_LOWEST_ACCELERATION} m/s², not {min(limits):g}."
            raise RapidRuntimeError("ERR_ACC_TOO_LOW", sentence)
        settings = self._unit.settings
        settings.acceleration_limit = call.get("AccMax") if call["AccLim"] else None
        settings.deceleration_limit = call.get("DecelMax") if call["DecelLim"] else None
        self._accelerate(along=min([*limits, self._unit.arm.kinematics.tool_acceleration]))

    def limit_world_acceleration(self, call: Call) -> None:
        r"""WorldAccLim: the tool's acceleration [m/s²], with \Off the robot's own limit."""
        most = self._unit.arm.kinematics.tool_acceleration
        limit = call.get("On", inf)
        if limit < _LOWEST_ACCELERATION:
            sentence = f"WorldAccLim takes at least {_LOWEST_ACCELERATION} m/s², not {limit:g}."
            raise RapidRuntimeError("ERR_ACC_TOO_LOW", sentence)
        self._unit.settings.world_limit = None if limit == inf else limit
        self._accelerate(along=min(limit, most))

    def _accelerate(self, along: float) -> None:
        acceleration, ramp, _ = self._unit.settings.accelerations
        factor = max(acceleration / 100.0, _SMALLEST_FACTOR) * max(ramp / 100.0, _SMALLEST_FACTOR) ** 0.5
        self._unit.arm.path.acceleration = Acceleration(min(factor, 1.0), along)

    def set_velocity(self, call: Call) -> None:
        """VelSet: factor on all programmed speeds [%], highest speed of the tool [mm/s]."""
        self._unit.settings.speed_percent, self._unit.settings.most_speed = call["Override"], call["Max"]

    def refresh_speed(self, call: Call) -> None:
        """SpeedRefresh: another override for the motions of this task, also for the one under way [%]."""
        if not 0.0 <= call["Override"] <= 100.0:
            sentence = f"SpeedRefresh takes 0 to 100 %, not {call['Override']:g}."
            raise RapidRuntimeError("ERR_SPEED_REFRESH_LIM", sentence)
        self._unit.settings.refreshed = call["Override"]
        self._motion.override_speed()

    def limit_tool_speed(self, call: Call) -> None:
        """SpeedLimCheckPoint: of the tool's point [mm/s], while the system input LimitSpeed is set."""
        self._limit(call, tool=self._limiting(call, "RobSpeed") * 1e-3)

    def limit_axis_speed(self, call: Call) -> None:
        """SpeedLimAxis: of one axis [deg/s], while the system input LimitSpeed is set."""
        kinematics, limit = self._unit.arm.kinematics, self._unit.settings.speed_limit
        axes = list(limit.axes or (inf,) * kinematics.joint_count)
        axes[self._joint(call, "AxisNo")] = radians(self._limiting(call, "AxisSpeed"))
        self._limit(call, axes=tuple(axes))

    def _limiting(self, call: Call, name: str) -> float:
        value: float = call[name]
        if not 0.0 < value < inf:
            raise RapidRuntimeError("ERR_SPEEDLIM_VALUE", f"{call.name}: a speed limit is above 0, not {value:g}.")
        return value

    def _limit(self, call: Call, **changes: Any) -> None:
        self._unit.settings.speed_limit = replace(self._unit.settings.speed_limit, **changes)
        self._unit.limit_speed()

    def _joint(self, call: Call, name: str) -> int:
        """Index in chain order of an axis of the robot, in ABB's numbering."""
        axis, count = call[name], self._unit.arm.kinematics.joint_count
        if axis != int(axis) or not 1 <= axis <= count:
            raise RapidRuntimeError("ERR_AXIS_PAR", f"{call.name}: the robot has the axes 1 to {count}, not {axis:g}.")
        order = chain_order(range(1, JOINT_COUNT + 1)) if count == JOINT_COUNT else range(1, count + 1)
        return list(order).index(int(axis))

    def set_resolution(self, call: Call) -> None:
        """PathResol: kept in C_MOTSET; the samples of paths are as close as they have to be."""
        if not 25.0 <= call["PathSampleTime"] <= 400.0:
            raise RapidRuntimeError("ERR_ARGVALERR", f"PathResol takes 25 to 400 %, not {call['PathSampleTime']:g}.")
        self._unit.settings.path_resolution = call["PathSampleTime"]

    def buffer_events(self, *, is_active: bool) -> None:
        """ActEventBuffer, DeactEventBuffer: kept in C_MOTSET; the Event Preset Time is 0 here."""
        self._unit.settings.has_event_buffer = is_active

    def motion_settings(self) -> Any:
        """C_MOTSET: what the program has set for its motions; -1 where it has set no limit."""
        settings = self._unit.settings
        limits = [
            part
            for limit in (settings.acceleration_limit, settings.deceleration_limit)
            for part in (limit is not None, -1.0 if limit is None else limit)
        ]
        mode = list(CircleMode).index(settings.circles)
        return (
            (settings.speed_percent, settings.most_speed),
            settings.accelerations,
            (settings.wrist_may_turn and not settings.locks_axis4, settings.locks_axis4, not settings.wrist_may_turn),
            (settings.checks_joints, settings.checks_lines, 30.0, 30.0, 30.0),
            settings.path_resolution,
            settings.supervision is not None,
            100.0 if settings.supervision is None else settings.supervision,
            *limits,
            float(mode),
            settings.world_limit is not None,
            -1.0 if settings.world_limit is None else settings.world_limit,
            settings.has_event_buffer,
        )

    def displacements(self) -> Any:
        """C_PROGDISP: the program displacement and the offsets of external axes."""
        none = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
        return self._unit.settings.displacement or none, self._unit.settings.offsets

    def tune(self, call: Call) -> None:
        r"""TuneServo: \Type:=TUNE_KP changes how closely an axis follows its plan, other types nothing."""
        value, kind, index = call["TuneValue"], call.get("Type", 0.0), self._joint(call, "Axis")
        if not 1.0 <= value <= 500.0:
            raise RapidRuntimeError("ERR_ARGVALERR", f"TuneServo takes 1 to 500 %, not {value:g}.")
        if _TUNING_TYPES[int(kind)] == "KP":
            self._unit.settings.gains[index] = value / 100.0
            self._unit.arm.tune(self._unit.settings.gains)

    def reset_tuning(self, call: Call) -> None:
        """TuneReset: all axes are tuned as usual."""
        self._unit.settings.gains.clear()
        self._unit.arm.tune()

    def displace(self, call: Call) -> None:
        r"""PDispOn: what moves the programmed point to where the tool is, or to \ExeP; with \Rot it turns, too."""
        settings = self._unit.settings
        settings.displacement = None
        frames = self._motion.frames(call["Tool"], call.get("WObj"))
        here = call.get("ExeP") or self._motion.robtarget(self._unit.arm.planned, frames)
        there, origin = (_pose_of_target(each) for each in (here, call["ProgPoint"]))
        if not call.present("Rot"):
            there = Pose(there.position, origin.orientation)
        settings.displacement = rapid_from_pose(compose(there, inverse(origin)))

    def set_displacement(self, call: Call) -> None:
        """PDispSet."""
        pose = call["DispFrame"]
        unit_quaternion(pose.rot)
        self._unit.settings.displacement = pose

    def end_displacement(self, call: Call) -> None:
        """PDispOff."""
        self._unit.settings.displacement = None

    def offset_axes(self, call: Call) -> None:
        r"""EOffsOn: what moves the external axes of the programmed point to where they are, or to those of \ExeP."""
        self._unit.settings.offsets = (0.0,) * 6
        point = call["ProgPoint"]
        here = call["ExeP"].extax if call.present("ExeP") else self._external(point)
        self._unit.settings.offsets = tuple(
            a - b if a < NOT_PRESENT and b < NOT_PRESENT else 0.0 for a, b in zip(here, point.extax, strict=True)
        )

    def _external(self, point: Any) -> Any:
        """The external axes where the arm is: arm angle for a robtarget, axis 7 for a jointtarget [deg]."""
        planned = self._unit.arm.planned
        if hasattr(point, "robax"):
            return jointtarget(planned)[1]
        return self._motion.robtarget(planned, Frames())[3]  # the same with any tool

    def set_offsets(self, call: Call) -> None:
        """EOffsSet."""
        self._unit.settings.offsets = tuple(value if value < NOT_PRESENT else 0.0 for value in call["EAxOffs"])

    def end_offsets(self, call: Call) -> None:
        """EOffsOff."""
        self._unit.settings.offsets = (0.0,) * 6

    def soften(self, call: Call) -> None:
        """SoftAct: accepted; the virtual arm has no servo that gives way."""
        axis, softness = call["Axis"], call["Softness"]
        if axis != int(axis) or not 1 <= axis <= self._unit.arm.kinematics.joint_count or not 0 <= softness <= 100:
            sentence = f"SoftAct takes an axis of the robot and 0 to 100 %, not {axis:g} and {softness:g}."
            raise RapidRuntimeError("ERR_ARGVALERR", sentence)
        self._unit.settings.softness[int(axis)] = softness

    def stiffen(self, call: Call) -> None:
        """SoftDeact."""
        self._unit.settings.softness.clear()

    def supervise(self, call: Call) -> None:
        r"""MotionSup: whether arms that touch something stop the program; no forces are modelled that it could tune."""
        tune = call.get("TuneValue", 100.0)
        if not 1.0 <= tune <= 300.0:
            raise RapidRuntimeError("ERR_ARGVALERR", f"MotionSup takes a \\TuneValue of 1 to 300 %, not {tune:g}.")
        self._unit.settings.supervision = None if call.present("Off") else tune

    def grip_load(self, call: Call) -> None:
        """GripLoad."""
        if call["Load"].mass < 0.0:
            raise RapidRuntimeError("ERR_ARGVALERR", f"GripLoad: a load has no mass of {call['Load'].mass:g} kg.")
        self._unit.settings.load = call["Load"]

    def set_circle_mode(self, call: Call) -> None:
        """CirPathMode."""
        chosen = next((mode for name, mode in _CIRCLE_MODES.items() if call.present(name)), CircleMode.PATH)
        self._unit.settings.circles = chosen

    def warn_of_corners(self, call: Call) -> None:
        """CornerPathWarning."""
        self._unit.settings.warns_of_corners = call["Active"]

    def activate(self, call: Call) -> None:
        """ActUnit: all units are active."""

    def deactivate(self, call: Call) -> None:
        """DeactUnit: the units of a robot stay active."""
        name = call["MechUnit"].name
        raise RapidRuntimeError(FATAL, f"DeactUnit: {name} belongs to the robot and cannot be deactivated.")

    def accept(self, call: Call) -> None:
        """What changes nothing that can be seen: tuning of servos, process modes, path resolution."""

    def lead(self, call: Call) -> Wait:
        r"""SetLeadThrough: an arm that is led by hand stands on its path; \Off forgets the path, and goes on.

        No hand leads the virtual arm: it stays where it is.
        """
        unit, arm = self._unit, self._unit.arm
        if call.present("Off"):
            unit.led.discard(unit.mechanical_unit)
            if not call.present("NoClearPath") and arm.is_stationary and not arm.path.is_empty:
                arm.path.restart_at(arm.planned)
            if not call.present("NoStartMove"):
                self.start_move(call)
            return
        if not call.present("NoStopMove"):
            yield from self.stop_move(call)
        unit.led.add(unit.mechanical_unit)

    # Stops --------------------------------------------------------------------------------------------------------

    def stop_move(self, call: Call) -> Wait:
        r"""StopMove: the arm slows down on its path and stays there; done when it stands.

        \AllMotionTasks means all arms, and so does a task without a robot.
        """
        arms = self._arms(call)
        for arm in arms:
            arm.path.hold(STOP_MOVE)
        while not all(arm.is_stationary or arm.egm is not None for arm in arms):
            yield None

    def step_back(self, call: Call) -> Wait:
        """StepBwdPath: back along the path, at most to the last stop point, before it goes on after a stop."""
        if call.task.event is not SystemEvent.RESTART:
            raise RapidRuntimeError(FATAL, "StepBwdPath: it is an instruction of event routines of RESTART.")
        if call["StepLength"] < 0.0 or not call["StepTime"] > 0.0:
            sentence = "StepBwdPath takes a StepLength of 0 mm or more and a StepTime above 0 s."
            raise RapidRuntimeError("ERR_ARGVALERR", sentence)
        arm = self._unit.arm
        self._regain(arm)
        while not arm.is_stationary:
            yield None
            self._regain(arm)
        arm.path.step_back(call["StepLength"] * 1e-3, call["StepTime"])
        try:
            while arm.path.is_going_back or not arm.is_stationary:
                yield None
                self._regain(arm)
        finally:
            arm.path.end_step_back()

    def _regain(self, arm: VirtualArm) -> None:
        """Bring an arm back to its path, where it stays until the event routines of the start have ended."""
        arm.path.holds.add(STOPPED)
        try:
            arm.regain_path()
        except RobotNotReady as error:
            raise RapidRuntimeError("ERR_PATH_STOP", str(error)) from error

    def start_move(self, call: Call) -> None:
        """StartMove: on along the path, unless the program that moves one of the arms is stopped."""
        check_may_move(call)
        units = self._units(call)
        for unit in units:
            if not unit.is_started() and not unit.arm.path.is_empty:
                sentence = f"{call.name}: {unit.task} is stopped, and its arm stays where it is until it is started."
                raise RapidRuntimeError("ERR_PROGSTOP", sentence)
        for arm in [unit.arm for unit in units]:
            arm.path.holds.discard(STOP_MOVE)
            try:
                arm.follow_path()
            except RobotNotReady as error:
                raise RapidRuntimeError("ERR_STARTMOVE", str(error)) from error

    def start_and_retry(self, call: Call) -> None:
        """StartMoveRetry: StartMove and RETRY in one, so that nothing comes between them."""
        if call.task.clause != "ERR":
            raise RapidRuntimeError(FATAL, "StartMoveRetry: it is an instruction of error handlers.")
        self.start_move(call)
        call.task.retry()

    def reset_stop(self, call: Call) -> None:
        """StopMoveReset: forget a stop without going on now."""
        for arm in self._arms(call):
            arm.path.holds.discard(STOP_MOVE)

    def _units(self, call: Call) -> Sequence[ArmUnit]:
        return self._robots if call.get("AllMotionTasks", False) or not self._is_motion_task else [self._unit]

    def _arms(self, call: Call) -> list[VirtualArm]:
        return [unit.arm for unit in self._units(call)]

    def clear_path(self, call: Call) -> None:
        """ClearPath: forget the rest of the path; the arm has to stand, as after StopMove."""
        arm = self._unit.arm
        if arm.path.is_empty:
            return
        if not arm.is_stationary:
            raise RapidRuntimeError("ERR_PATH", "ClearPath: stop the movements with StopMove before.")
        arm.path.restart_at(arm.planned)

    def store_path(self, call: Call) -> Wait:
        """StorePath: put the rest of the path aside, for other motions until RestoPath."""
        arm = self._unit.arm
        if self._unit.stored_paths:
            raise RapidRuntimeError(FATAL, "StorePath: a path is stored already; RestoPath has to come before.")
        while not arm.is_stationary:
            yield None
        self._unit.stored_paths.append(arm.path.store())

    def restore_path(self, call: Call) -> Wait:
        """RestoPath: the path that was stored is ahead again, and starts with StartMove."""
        arm = self._unit.arm
        if not self._unit.stored_paths:
            raise RapidRuntimeError(FATAL, "RestoPath: no path is stored.")
        while not arm.is_stationary:
            yield None
        arm.leave_path()  # it may stand elsewhere than where the stored path goes on
        arm.path.restore(self._unit.stored_paths.pop())

    def path_level(self, call: Call) -> float:
        """PathLevel: 1, or 2 between StorePath and RestoPath."""
        return float(self._unit.path_level)

    def is_stopped(self, call: Call) -> bool:
        """IsStopMoveAct."""
        return any(STOP_MOVE in arm.path.holds for arm in self._arms(call))

    def recover(self, call: Call) -> Wait:
        """ProcerrRecovery: stop the movements and let the error handler go on, with ERR_PATH_STOP."""
        arm = self._unit.arm
        arm.path.hold(STOP_MOVE)
        while not arm.is_stationary:
            yield None
        raise RapidRuntimeError("ERR_PATH_STOP", "ProcerrRecovery has stopped the movements.")


def _pose_of_target(target: Any) -> Pose:
    x, y, z = (value * 1e-3 for value in target[0])
    return Pose((x, y, z), unit_quaternion(target[1]))


def add_motion_settings(
    library: Library, motion: MotionInstructions, robots: Sequence[ArmUnit], *, is_motion_task: bool = True
) -> None:
    """Register the settings and stops of one task; ``robots`` are those of all tasks."""
    own = MotionSettingInstructions(motion, robots, is_motion_task=is_motion_task)
    kinematics = motion.arm.kinematics
    library.alias("tunetype", "num")
    for number, name in enumerate(_TUNING_TYPES):
        library.data(f"TUNE_{name}", "tunetype", float(number))
    library.alias("motionprocessmode", "num")
    modes = ("OPTIMAL_CYCLE_TIME_MODE", "LOW_SPEED_ACCURACY_MODE", "LOW_SPEED_STIFF_MODE", "ACCURACY_MODE")
    for number, name in enumerate((*modes, *(f"MPM_USER_MODE_{each}" for each in range(1, 5))), start=1):
        library.data(name, "motionprocessmode", float(number))
    library.live_data("C_MOTSET", "motsetdata", own.motion_settings)
    library.live_data("C_PROGDISP", "progdisp", own.displacements)
    all_tasks = r"\switch AllMotionTasks"
    instructions: tuple[tuple[str, str, Callable[[Call], Any]], ...] = (
        ("ConfL", r"\switch On | \switch Off", own.check_lines),
        ("ConfJ", r"\switch On | \switch Off", own.check_joints),
        ("SingArea", r"\switch Wrist | \switch LockAxis4 | \switch Off", own.singular_area),
        ("AccSet", r"num Acc, num Ramp, \num FinePointRamp", own.set_acceleration),
        ("PathAccLim", r"bool AccLim, \num AccMax, bool DecelLim, \num DecelMax", own.limit_acceleration),
        ("WorldAccLim", r"\num On | \switch Off", own.limit_world_acceleration),
        ("VelSet", "num Override, num Max", own.set_velocity),
        ("SpeedRefresh", "num Override", own.refresh_speed),
        (
            "PDispOn",
            r"\switch Rot, \robtarget ExeP, robtarget ProgPoint, tooldata Tool, \wobjdata WObj",
            own.displace,
        ),
        ("PDispSet", "pose DispFrame", own.set_displacement),
        ("PDispOff", "", own.end_displacement),
        ("EOffsOn", r"\robtarget ExeP, anytype ProgPoint", own.offset_axes),
        ("EOffsSet", "extjoint EAxOffs", own.set_offsets),
        ("EOffsOff", "", own.end_offsets),
        ("SoftAct", r"\mecunit MechUnit, num Axis, num Softness, \num Ramp", own.soften),
        ("SoftDeact", r"\num Ramp", own.stiffen),
        ("MotionSup", r"\switch On | \switch Off, \num TuneValue", own.supervise),
        ("GripLoad", "loaddata Load", own.grip_load),
        ("MechUnitLoad", "mecunit MechUnit, num AxisNo, loaddata Load", own.accept),
        ("CirPathMode", " | ".join(rf"\switch {name}" for name in _MODE_SWITCHES), own.set_circle_mode),
        ("CornerPathWarning", "bool Active", own.warn_of_corners),
        ("PathResol", "num PathSampleTime", own.set_resolution),
        ("ActEventBuffer", "", lambda _: own.buffer_events(is_active=True)),
        ("DeactEventBuffer", "", lambda _: own.buffer_events(is_active=False)),
        ("SpeedLimCheckPoint", "num RobSpeed", own.limit_tool_speed),
        ("SpeedLimAxis", "mecunit MechUnit, num AxisNo, num AxisSpeed", own.limit_axis_speed),
        ("TuneServo", r"mecunit MecUnit, num Axis, num TuneValue, \tunetype Type", own.tune),
        ("TuneReset", "", own.reset_tuning),
        ("MotionProcessModeSet", "motionprocessmode Mode", own.accept),
        ("ActUnit", "mecunit MechUnit", own.activate),
        ("DeactUnit", "mecunit MechUnit", own.deactivate),
        ("StopMove", rf"\switch Quick, {all_tasks}", own.stop_move),
        ("StartMove", all_tasks, own.start_move),
        ("StepBwdPath", "num StepLength, num StepTime", own.step_back),
        ("StartMoveRetry", "", own.start_and_retry),
        ("StopMoveReset", all_tasks, own.reset_stop),
        ("ClearPath", "", own.clear_path),
        (
            "SetLeadThrough",
            r"\switch On | \switch Off, \switch NoStopMove, \switch NoClearPath, \switch NoStartMove",
            own.lead,
        ),
        ("StorePath", r"\switch KeepSync", own.store_path),
        ("RestoPath", "", own.restore_path),
        ("ProcerrRecovery", r"\switch SyncOrgMoveInst | \switch SyncLastMoveInst, \switch ProcSignal", own.recover),
    )
    for name, signature, implementation in instructions:
        library.instruction(name, signature)(implementation)
    functions: tuple[tuple[str, str, str, Callable[[Call], Any]], ...] = (
        ("IsStopMoveAct", r"\switch FromMoveTask | \switch FromNonMoveTask", "bool", own.is_stopped),
        ("PathLevel", "", "num", own.path_level),
        ("CSpeedOverride", r"\switch CTask", "num", lambda _: motion.arm.path.override * 100.0),
        ("MaxRobSpeed", "", "num", lambda _: kinematics.tool_speed * 1e3),
        ("MaxRobReorientSpeed", "", "num", lambda _: 500.0),
        ("MaxExtLinearSpeed", "", "num", lambda _: LINEAR_AXIS_MM_S),
        ("MaxExtReorientSpeed", "", "num", lambda _: ROTATING_AXIS_DEG_S),
        ("IsLeadThrough", "", "bool", lambda _: motion.unit.mechanical_unit in motion.unit.led),
        ("RobName", "", "string", lambda _: motion.unit.mechanical_unit),
        ("TaskRunMec", "", "bool", lambda _: is_motion_task),
        ("TaskRunRob", "", "bool", lambda _: is_motion_task),
    )
    for name, signature, returns, implementation in functions:
        library.function(name, signature, returns)(implementation)


MOST_RECORDED = 50_000  # positions: what is older is forgotten
_RECORDED_STEP = radians(0.1)  # between two positions, of the axis that moves most
_RECORDER = "path recorder"
_OFFSET_SHARE = 0.1  # of the way: within it \ToolOffs is reached
_RETRACING_SPEED = Speed(0.25, radians(90.0))  # without \Speed


@dataclass(eq=False, slots=True)
class PathIdentity:
    """What a pathrecid stands for: a place on the recorded path; None before PathRecStart.

    Attributes:
        recording: which recording it is of.
        index: of the position there.
    """

    recording: int = 0
    index: int | None = None


class PathRecorder:
    """The path recorder of one task."""

    def __init__(self, motion: MotionInstructions) -> None:
        self._motion = motion
        self._unit = motion.unit
        self._positions: list[Joints] = []
        self._recording = 0
        self._at: int | None = None  # the position where the arm is on its way back and forth; None at the end
        self._is_retracing = False

    def start(self, call: Call) -> None:
        """PathRecStart: record from here on; while it records, mark this place."""
        self._unit.observers[_RECORDER] = self._observe
        self._unit.beginnings[_RECORDER] = self._forget
        self._observe(is_mark=True)
        call["ID"].recording, call["ID"].index = self._recording, len(self._positions) - 1

    def stop(self, call: Call) -> None:
        r"""PathRecStop: record no more; with \Clear what is recorded is forgotten."""
        self._unit.observers.pop(_RECORDER, None)
        if call.present("Clear"):
            self._clear()

    def _clear(self) -> None:
        self._positions.clear()
        self._recording += 1
        self._at = None

    def _forget(self) -> None:
        """The program begins at main: nothing is recorded, until PathRecStart."""
        self._unit.observers.pop(_RECORDER, None)
        self._clear()
        self._is_retracing = False

    def _observe(self, *, is_mark: bool = False) -> None:
        """Record where the arm is planned to be, but not while it goes back or forth, or on a path between."""
        if self._is_retracing or self._unit.path_level > 1:
            return
        here, positions = self._unit.arm.planned, self._positions
        if self._at is not None:  # the program goes on: what lay ahead of here is another path now
            del positions[self._at + 1 :]
            self._at = None
        moved = max(abs(a - b) for a, b in zip(here, positions[-1], strict=True)) if positions else _RECORDED_STEP
        if moved >= _RECORDED_STEP or (is_mark and moved > 0.0):
            positions.append(here)
            if len(positions) > MOST_RECORDED:
                del positions[: MOST_RECORDED // 2]
                self._recording += 1  # places that were marked before cannot be reached any more

    def back(self, call: Call) -> Wait:
        r"""PathRecMoveBwd: to the place of \ID, or where the recording began."""
        end = self._end(call, 0)
        if not self._is_behind(end):
            raise RapidRuntimeError("ERR_PATHDIST", f"{call.name}: that place is not on the path behind the arm.")
        yield from self._retrace(call, end)

    def forth(self, call: Call) -> Wait:
        r"""PathRecMoveFwd: to the place of \ID, or where the way back began."""
        end = self._end(call, len(self._positions) - 1)
        if not self._is_ahead(end):
            raise RapidRuntimeError("ERR_PATHDIST", f"{call.name}: that place is not on the path ahead of the arm.")
        yield from self._retrace(call, end)

    def is_valid_back(self, call: Call) -> bool:
        """PathRecValidBwd."""
        return self._is_behind(self._end(call, 0))

    def is_valid_forth(self, call: Call) -> bool:
        """PathRecValidFwd."""
        return self._is_ahead(self._end(call, len(self._positions) - 1))

    def _end(self, call: Call, default: int) -> int | None:
        """Where a call goes to; None for a place of another recording."""
        if not call.present("ID"):
            return default if self._positions else None
        identity: PathIdentity = call["ID"]
        return identity.index if identity.recording == self._recording else None

    def _is_behind(self, end: int | None) -> bool:
        at = len(self._positions) - 1 if self._at is None else self._at
        return end is not None and (end < at or (end == at and self._at is None and len(self._positions) > 0))

    def _is_ahead(self, end: int | None) -> bool:
        return end is not None and self._at is not None and end > self._at

    def _retrace(self, call: Call, end: int | None) -> Wait:
        assert end is not None, "it was checked"
        positions, arm = self._positions, self._unit.arm
        while not arm.is_stationary:
            yield None
        if self._at is None:
            self._at = len(positions) - 1
            if positions[-1] != arm.planned:  # where the way back begins is where the way forth ends
                positions.append(arm.planned)
                self._at += 1
        step = 1 if end >= self._at else -1
        way = [arm.planned, *positions[self._at + step : end + step if end + step >= 0 else None : step]]
        offset = call.get("ToolOffs", (0.0, 0.0, 0.0))
        speed = self._motion.speed(call, call["Speed"]) if call.present("Speed") else _RETRACING_SPEED
        frames = self._motion.read_frames(call)

        def build(start: Joints, entry: Zone) -> Leg:
            joints = np.array(way if len(way) > 1 else way * 2)
            if any(offset):
                # The way back comes beside the path by even parts, so that it begins where the arm stands.
                shares = np.minimum(np.linspace(0.0, 1.0, len(joints)) / _OFFSET_SHARE, 1.0)
                points, rotations = frames.tip(*arm.kinematics.forward(joints))
                points = points + shares[:, None] * (rotations @ (np.array(offset) * 1e-3))
                joints = followed(arm.kinematics, points, rotations, arm.kinematics.angles(joints), frames, start)
            return retraced_leg(arm.kinematics, joints, frames, speed)

        self._is_retracing = True
        try:
            yield from self._motion.passed(call, build)
        finally:
            self._is_retracing = False
        self._at = end


def add_recorder(library: Library, motion: MotionInstructions) -> None:
    """Register the path recorder of one task."""
    own = PathRecorder(motion)
    library.object_type("pathrecid", PathIdentity)
    library.instruction("PathRecStart", "VAR pathrecid ID")(own.start)
    library.instruction("PathRecStop", r"\switch Clear")(own.stop)
    way = r"\VAR pathrecid ID, \pos ToolOffs, \speeddata Speed"
    library.instruction("PathRecMoveBwd", way)(own.back)
    library.instruction("PathRecMoveFwd", way)(own.forth)
    library.function("PathRecValidBwd", r"\VAR pathrecid ID", "bool")(own.is_valid_back)
    library.function("PathRecValidFwd", r"\VAR pathrecid ID", "bool")(own.is_valid_forth)


MOST_GENERATORS = 5
_CORRECTION_TIME = 0.08  # [s] in which most of a step is taken over
_CORRECTION_SPEED = 0.01  # [m/s] of the path, below which corrections come more slowly, and at standstill not at all
_NO_OFFSET = 1e-9  # [m]


@dataclass(eq=False, slots=True)
class CorrectionGenerator:
    """What a corrdescr stands for; its offset [m] is None until it is connected."""

    offset: Array | None = None


class PathCorrection:
    """The corrections of one task, and what becomes of the arm's path (`PathMotion.corrector`).

    Each leg of the path says where its offset comes from: the program's generators, or EGM's sensor.
    """

    def __init__(self, unit: ArmUnit, events: EventLog) -> None:
        self._unit, self._events = unit, events
        self._generators: list[CorrectionGenerator] = []
        self._offset, self._rate = np.zeros(3), np.zeros(3)
        self._point: Array | None = None
        self._axes: Array | None = None
        self._beside: Array | None = None  # corrected minus planned joint positions of the last cycle [rad]
        self._has_failed = False

    # Generators ---------------------------------------------------------------------------------------------------

    def connect(self, call: Call) -> None:
        """CorrCon."""
        generator = call["Descr"]
        if generator in self._generators:
            return
        if len(self._generators) >= MOST_GENERATORS:
            raise RapidRuntimeError("CORR_NOFREE", f"CorrCon: {MOST_GENERATORS} generators are connected already.")
        generator.offset = np.zeros(3)
        self._generators.append(generator)
        self.attach()
        self._unit.beginnings["path corrections"] = self.clear

    def disconnect(self, call: Call) -> None:
        """CorrDiscon."""
        generator = self._connected(call)
        self._generators.remove(generator)
        generator.offset = None

    def clear(self) -> None:
        """CorrClear, and the program begins at main."""
        for generator in self._generators:
            generator.offset = None
        self._generators.clear()

    def write(self, call: Call) -> None:
        """CorrWrite: the offset of one generator [mm]; it replaces the one before."""
        self._connected(call).offset = np.array(call["Data"]) * 1e-3
        self.attach()

    def read(self, call: Call) -> tuple[float, ...]:
        """CorrRead: the sum of all generators' offsets [mm]."""
        if not self._generators:
            raise RapidRuntimeError("CORR_NOOBJECT", "CorrRead: no correction generator is connected; use CorrCon.")
        return tuple((self.total() * 1e3).tolist())

    def _connected(self, call: Call) -> CorrectionGenerator:
        generator: CorrectionGenerator = call["Descr"]
        if generator not in self._generators:
            name = call.reference("Descr").name
            raise RapidRuntimeError("CORR_NOTCONN", f"{call.name}: {name} is not connected; use CorrCon before.")
        return generator

    def total(self) -> Array:
        """The sum of all generators' offsets [m], (3,)."""
        total = np.zeros(3)
        for each in self._generators:
            if each.offset is not None:
                total += each.offset
        return total

    # The path -----------------------------------------------------------------------------------------------------

    def attach(self) -> None:
        """Correct the arm's path from now on; what cannot be reached is reported once until this is called again."""
        self._unit.arm.path.corrector = self
        self._has_failed = False

    def restart(self) -> None:
        """The path begins anew where the arm stands: nothing is corrected there."""
        self._offset, self._rate = np.zeros(3), np.zeros(3)
        self._point = self._axes = self._beside = None

    @property
    def memory(self) -> object:
        """What a path that is put aside has to be restored with."""
        return self._offset, self._rate, self._point, self._axes, self._beside

    @memory.setter
    def memory(self, value: Any) -> None:
        self._offset, self._rate, self._point, self._axes, self._beside = value

    def corrected(self, position: Joints, passage: Passage, dt: float) -> Joints:
        """Where the arm is instead of a position on its path [rad], after ``dt`` [s]."""
        leg, wanted = passage.leg, np.zeros(3) if passage.offset is None else passage.offset()
        if not wanted.any() and not self._offset.any() and not self._rate.any():
            self._point = self._beside = None  # of where the arm is when it is corrected again they say nothing
            return position
        kinematics = self._unit.arm.kinematics
        point, rotation, angle = place_of(kinematics, position, leg.frames)
        along = np.zeros(3) if self._point is None else point - self._point
        self._point = point
        way = float(np.linalg.norm(along))
        if way > _NO_OFFSET:
            across = np.cross(rotation[:, 2], along / way)
            if np.linalg.norm(across) > 1e-3:  # the tool does not point along the path
                across = across / np.linalg.norm(across)
                self._axes = np.array([along / way, across, np.cross(along / way, across)])
        if self._axes is None:
            return position
        before = self._offset.copy(), self._rate.copy()
        passed = min(1.0, way / dt / _CORRECTION_SPEED) * dt  # a critically damped step, as far as the path moves
        self._rate = self._rate + ((wanted - self._offset) / _CORRECTION_TIME - 2.0 * self._rate) * (
            passed / _CORRECTION_TIME
        )
        self._offset = self._offset + self._rate * passed
        found = self._reached(point, rotation, angle, leg, position)
        if found is None:
            self._offset, self._rate = before[0], np.zeros(3)
            if not self._has_failed:
                code, title = MotionFault.OUT_OF_REACH.value
                sentence = "The path correction is out of reach: the arm keeps the one it has. Write a smaller one."
                self._events.append(code, title, sentence, EventType.ERROR)
            self._has_failed = True
            found = self._reached(point, rotation, angle, leg, position) or self._returning(point, leg, position, dt)
        if np.max(np.abs(wanted - self._offset)) < _NO_OFFSET and np.max(np.abs(self._rate)) < _NO_OFFSET:
            self._offset, self._rate = wanted, np.zeros(3)
        self._beside = np.subtract(found, position)
        return found

    def _reached(self, point: Array, rotation: Array, angle: float, leg: Leg, near: Joints) -> Joints | None:
        """The joint positions [rad] of the corrected place, None where there are none in the joints' range."""
        assert self._axes is not None, "it was found"
        kinematics = self._unit.arm.kinematics
        at, turned = leg.frames.tool0((point + self._offset @ self._axes)[None], rotation[None])
        try:
            found = kinematics.follow(at, turned, np.array([angle]), self._start(near))[0]
        except Lost:
            return None
        position = tuple(found.tolist())
        return None if kinematics.limits.outside(position) is not None else position

    def _start(self, near: Joints) -> Joints:
        """The posture [rad] that the corrected one is looked for from: as far beside the path as the last one was."""
        return near if self._beside is None else tuple((near + self._beside).tolist())

    def _returning(self, point: Array, leg: Leg, near: Joints, dt: float) -> Joints:
        """The joint positions [rad] on the way back to the path, where not even the correction before is in reach."""
        if self._beside is None:
            self._offset = np.zeros(3)
            return near
        assert self._axes is not None, "it was found"
        kinematics = self._unit.arm.kinematics
        beside = near + self._beside * max(0.0, 1.0 - dt / _CORRECTION_TIME)
        found = tuple(np.clip(beside, kinematics.limits.lower, kinematics.limits.upper).tolist())
        self._offset = self._axes @ (place_of(kinematics, found, leg.frames)[0] - point)
        return found


def add_corrections(library: Library, motion: MotionInstructions) -> PathCorrection:
    """Register the path corrections of one task."""
    own = PathCorrection(motion.unit, motion.events)
    motion.program_offset = own.total
    library.object_type("corrdescr", CorrectionGenerator)
    library.instruction("CorrCon", "VAR corrdescr Descr")(own.connect)
    library.instruction("CorrDiscon", "VAR corrdescr Descr")(own.disconnect)
    library.instruction("CorrClear", "")(lambda call: own.clear())
    library.instruction("CorrWrite", "VAR corrdescr Descr, pos Data")(own.write)
    library.function("CorrRead", "", "pos")(own.read)
    return own
