"""What a RAPID program sets for its motions (ConfL, AccSet, PDispOn ...), and how it stops them and goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf, radians
from typing import Any

from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import Pose
from abb_protocols.robot.kinematics import compose_poses, inverse_pose
from virtual_irc5.instructions.moves import FATAL, MOVES, MoveInstructions, check_may_move, standing
from virtual_irc5.instructions.robot_data import NOT_PRESENT, axis_index, jointtarget, rapid_from_pose, unit_quaternion
from virtual_irc5.mechanics.arm import ARM_STOPPED, VirtualArm
from virtual_irc5.mechanics.path import PathAcceleration
from virtual_irc5.mechanics.path_geometry import CircleMode, LegFrames
from virtual_irc5.mechanics.units import ArmUnit
from virtual_irc5.rapid import Call, Library, RapidRuntimeError, Wait
from virtual_irc5.rapid.states import SystemEvent
from virtual_irc5.rapid.task import task_of
from virtual_irc5.rapid.types import raised_as

_STOP_MOVE = "StopMove"
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


SETTINGS = Library(MOVES)
SETTINGS.alias("tunetype", "num")
for _number, _name in enumerate(_TUNING_TYPES):
    SETTINGS.data(f"TUNE_{_name}", "tunetype", float(_number))
SETTINGS.alias("motionprocessmode", "num")
_MODES = ("OPTIMAL_CYCLE_TIME_MODE", "LOW_SPEED_ACCURACY_MODE", "LOW_SPEED_STIFF_MODE", "ACCURACY_MODE")
for _number, _name in enumerate((*_MODES, *(f"MPM_USER_MODE_{each}" for each in range(1, 5))), start=1):
    SETTINGS.data(_name, "motionprocessmode", float(_number))
SETTINGS.accepted("MechUnitLoad", "mecunit MechUnit, num AxisNo, loaddata Load")
SETTINGS.accepted("MotionProcessModeSet", "motionprocessmode Mode")
_ON_OFF = r"\switch On | \switch Off"
_ALL_TASKS = r"\switch AllMotionTasks"


class MotionSettingInstructions:
    """The settings and stops of one task."""

    def __init__(self, motion: MoveInstructions, robots: Sequence[ArmUnit], *, is_motion_task: bool) -> None:
        self._motion = motion
        self._unit = motion.unit
        self._robots, self._is_motion_task = robots, is_motion_task

    # Settings -----------------------------------------------------------------------------------------------------

    @SETTINGS.instruction("ConfL", _ON_OFF)
    def check_lines(self, call: Call) -> None:
        self._unit.settings.checks_lines = not call.present("Off")

    @SETTINGS.instruction("ConfJ", _ON_OFF)
    def check_joints(self, call: Call) -> None:
        self._unit.settings.checks_joints = not call.present("Off")

    @SETTINGS.instruction("SingArea", r"\switch Wrist | \switch LockAxis4 | \switch Off")
    def singular_area(self, call: Call) -> None:
        r"""Accepted; the orientation is kept with \Wrist, too, and the arm slows down instead."""
        self._unit.settings.locks_axis4 = call.present("LockAxis4")
        self._unit.settings.wrist_may_turn = call.present("Wrist") or call.present("LockAxis4")

    @SETTINGS.instruction("AccSet", r"num Acc, num Ramp, \num FinePointRamp")
    def set_acceleration(self, call: Call) -> None:
        """Accelerations and how fast they build up, 20 to 100 %."""
        settings, ramp = self._unit.settings, max(call["Ramp"], 10.0)
        settings.accelerations = (call["Acc"], ramp, call.get("FinePointRamp", 100.0))
        self._accelerate(along=self._unit.arm.path.acceleration.along)

    @SETTINGS.instruction("PathAccLim", r"bool AccLim, \num AccMax, bool DecelLim, \num DecelMax")
    def limit_acceleration(self, call: Call) -> None:
        """The tool's acceleration along the path [m/s²]."""
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

    @SETTINGS.instruction("WorldAccLim", r"\num On | \switch Off")
    def limit_world_acceleration(self, call: Call) -> None:
        r"""The tool's acceleration [m/s²], with \Off the robot's own limit."""
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
        self._unit.arm.path.acceleration = PathAcceleration(min(factor, 1.0), along)

    @SETTINGS.instruction("VelSet", "num Override, num Max")
    def set_velocity(self, call: Call) -> None:
        """Factor on all programmed speeds [%], highest speed of the tool [mm/s]."""
        self._unit.settings.speed_percent, self._unit.settings.most_speed = call["Override"], call["Max"]

    @SETTINGS.instruction("SpeedRefresh", "num Override")
    def refresh_speed(self, call: Call) -> None:
        """Another override for the motions of this task, also for the one under way [%]."""
        if not 0.0 <= call["Override"] <= 100.0:
            sentence = f"SpeedRefresh takes 0 to 100 %, not {call['Override']:g}."
            raise RapidRuntimeError("ERR_SPEED_REFRESH_LIM", sentence)
        self._unit.settings.refreshed = call["Override"]
        self._motion.override_speed()

    @SETTINGS.instruction("SpeedLimCheckPoint", "num RobSpeed")
    def limit_tool_speed(self, call: Call) -> None:
        """Of the tool's point [mm/s], while the system input LimitSpeed is set."""
        self._limit(call, tool=self._limiting(call, "RobSpeed") * 1e-3)

    @SETTINGS.instruction("SpeedLimAxis", "mecunit MechUnit, num AxisNo, num AxisSpeed")
    def limit_axis_speed(self, call: Call) -> None:
        """Of one axis [deg/s], while the system input LimitSpeed is set."""
        kinematics, limit = self._unit.arm.kinematics, self._unit.settings.speed_limit
        axes = list(limit.axes or (inf,) * kinematics.joint_count)
        axes[axis_index(call, "AxisNo", kinematics)] = radians(self._limiting(call, "AxisSpeed"))
        self._limit(call, axes=tuple(axes))

    def _limiting(self, call: Call, name: str) -> float:
        value: float = call[name]
        if not 0.0 < value < inf:
            raise call.error("ERR_SPEEDLIM_VALUE", f"a speed limit is above 0, not {value:g}.")
        return value

    def _limit(self, call: Call, **changes: Any) -> None:
        self._unit.settings.speed_limit = replace(self._unit.settings.speed_limit, **changes)
        self._unit.limit_speed()

    @SETTINGS.instruction("PathResol", "num PathSampleTime")
    def set_resolution(self, call: Call) -> None:
        """Kept in C_MOTSET; the samples of paths are as close as they have to be."""
        if not 25.0 <= call["PathSampleTime"] <= 400.0:
            raise RapidRuntimeError("ERR_ARGVALERR", f"PathResol takes 25 to 400 %, not {call['PathSampleTime']:g}.")
        self._unit.settings.path_resolution = call["PathSampleTime"]

    @SETTINGS.instruction("ActEventBuffer")
    @SETTINGS.instruction("DeactEventBuffer")
    def buffer_events(self, call: Call) -> None:
        """Kept in C_MOTSET; the Event Preset Time is 0 here."""
        self._unit.settings.has_event_buffer = call.name == "ActEventBuffer"

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

    @SETTINGS.instruction("TuneServo", r"mecunit MecUnit, num Axis, num TuneValue, \tunetype Type")
    def tune(self, call: Call) -> None:
        r"""\Type:=TUNE_KP changes how closely an axis follows its plan, other types nothing."""
        value, kind = call["TuneValue"], call.get("Type", 0.0)
        index = axis_index(call, "Axis", self._unit.arm.kinematics)
        if not 1.0 <= value <= 500.0:
            raise RapidRuntimeError("ERR_ARGVALERR", f"TuneServo takes 1 to 500 %, not {value:g}.")
        if _TUNING_TYPES[int(kind)] == "KP":
            self._unit.settings.gains[index] = value / 100.0
            self._unit.arm.tune(self._unit.settings.gains)

    @SETTINGS.instruction("TuneReset")
    def reset_tuning(self, call: Call) -> None:
        """All axes are tuned as usual."""
        self._unit.settings.gains.clear()
        self._unit.arm.tune()

    @SETTINGS.instruction(
        "PDispOn", r"\switch Rot, \robtarget ExeP, robtarget ProgPoint, tooldata Tool, \wobjdata WObj"
    )
    def displace(self, call: Call) -> None:
        r"""What moves the programmed point to where the tool is, or to \ExeP; with \Rot it turns, too."""
        settings = self._unit.settings
        settings.displacement = None
        frames = self._motion.frames(call["Tool"], call.get("WObj"))
        here = call.get("ExeP") or self._motion.robtarget(self._unit.arm.planned, frames)
        there, origin = (_pose_of_target(each) for each in (here, call["ProgPoint"]))
        if not call.present("Rot"):
            there = Pose(there.position, origin.orientation)
        settings.displacement = rapid_from_pose(compose_poses(there, inverse_pose(origin)))

    @SETTINGS.instruction("PDispSet", "pose DispFrame")
    def set_displacement(self, call: Call) -> None:
        pose = call["DispFrame"]
        unit_quaternion(pose.rot)
        self._unit.settings.displacement = pose

    @SETTINGS.instruction("PDispOff")
    def end_displacement(self, call: Call) -> None:
        self._unit.settings.displacement = None

    @SETTINGS.instruction("EOffsOn", r"\robtarget ExeP, anytype ProgPoint")
    def offset_axes(self, call: Call) -> None:
        r"""What moves the external axes of the programmed point to where they are, or to those of \ExeP."""
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
        return self._motion.robtarget(planned, LegFrames())[3]  # the same with any tool

    @SETTINGS.instruction("EOffsSet", "extjoint EAxOffs")
    def set_offsets(self, call: Call) -> None:
        self._unit.settings.offsets = tuple(value if value < NOT_PRESENT else 0.0 for value in call["EAxOffs"])

    @SETTINGS.instruction("EOffsOff")
    def end_offsets(self, call: Call) -> None:
        self._unit.settings.offsets = (0.0,) * 6

    @SETTINGS.instruction("SoftAct", r"\mecunit MechUnit, num Axis, num Softness, \num Ramp")
    def soften(self, call: Call) -> None:
        """Accepted; the virtual arm has no servo that gives way."""
        axis, softness = call["Axis"], call["Softness"]
        if axis != int(axis) or not 1 <= axis <= self._unit.arm.kinematics.joint_count or not 0 <= softness <= 100:
            sentence = f"SoftAct takes an axis of the robot and 0 to 100 %, not {axis:g} and {softness:g}."
            raise RapidRuntimeError("ERR_ARGVALERR", sentence)
        self._unit.settings.softness[int(axis)] = softness

    @SETTINGS.instruction("SoftDeact", r"\num Ramp")
    def stiffen(self, call: Call) -> None:
        self._unit.settings.softness.clear()

    @SETTINGS.instruction("MotionSup", rf"{_ON_OFF}, \num TuneValue")
    def supervise(self, call: Call) -> None:
        r"""Whether arms that touch something stop the program; no forces are modelled that it could tune."""
        tune = call.get("TuneValue", 100.0)
        if not 1.0 <= tune <= 300.0:
            raise RapidRuntimeError("ERR_ARGVALERR", f"MotionSup takes a \\TuneValue of 1 to 300 %, not {tune:g}.")
        self._unit.settings.supervision = None if call.present("Off") else tune

    @SETTINGS.instruction("GripLoad", "loaddata Load")
    def grip_load(self, call: Call) -> None:
        if call["Load"].mass < 0.0:
            raise call.error("ERR_ARGVALERR", f"a load has no mass of {call['Load'].mass:g} kg.")
        self._unit.settings.load = call["Load"]

    @SETTINGS.instruction("CirPathMode", " | ".join(rf"\switch {name}" for name in _MODE_SWITCHES))
    def set_circle_mode(self, call: Call) -> None:
        chosen = next((mode for name, mode in _CIRCLE_MODES.items() if call.present(name)), CircleMode.PATH)
        self._unit.settings.circles = chosen

    @SETTINGS.instruction("CornerPathWarning", "bool Active")
    def warn_of_corners(self, call: Call) -> None:
        self._unit.settings.warns_of_corners = call["Active"]

    @SETTINGS.instruction("ActUnit", "mecunit MechUnit")
    def activate(self, call: Call) -> None:
        """All units are active."""

    @SETTINGS.instruction("DeactUnit", "mecunit MechUnit")
    def deactivate(self, call: Call) -> None:
        """The units of a robot stay active."""
        name = call["MechUnit"].name
        raise call.error(FATAL, f"{name} belongs to the robot and cannot be deactivated.")

    @SETTINGS.instruction("SetLeadThrough", rf"{_ON_OFF}, \switch NoStopMove, \switch NoClearPath, \switch NoStartMove")
    def lead(self, call: Call) -> Wait:
        r"""An arm that is led by hand stands on its path; \Off forgets the path, and goes on.

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

    @SETTINGS.instruction("StopMove", rf"\switch Quick, {_ALL_TASKS}")
    def stop_move(self, call: Call) -> Wait:
        r"""The arm slows down on its path and stays there; done when it stands.

        \AllMotionTasks means all arms, and so does a task without a robot.
        """
        arms = self._arms(call)
        for arm in arms:
            arm.path.hold(_STOP_MOVE)
        while not all(arm.is_stationary or arm.egm is not None for arm in arms):
            yield None

    @SETTINGS.instruction("StepBwdPath", "num StepLength, num StepTime")
    def step_back(self, call: Call) -> Wait:
        """Back along the path, at most to the last stop point, before it goes on after a stop."""
        if call.task.event is not SystemEvent.RESTART:
            raise call.error(FATAL, "it is an instruction of event routines of RESTART.")
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
        arm.path.holds.add(ARM_STOPPED)
        with raised_as("ERR_PATH_STOP", RobotNotReady):
            arm.regain_path()

    @SETTINGS.instruction("StartMove", _ALL_TASKS)
    def start_move(self, call: Call) -> None:
        """On along the path, unless the program that moves one of the arms is stopped."""
        check_may_move(call)
        units = self._units(call)
        for unit in units:
            if not unit.is_started() and not unit.arm.path.is_empty:
                sentence = f"{unit.task} is stopped, and its arm stays where it is until it is started."
                raise call.error("ERR_PROGSTOP", sentence)
        for arm in [unit.arm for unit in units]:
            arm.path.holds.discard(_STOP_MOVE)
            with raised_as("ERR_STARTMOVE", RobotNotReady):
                arm.follow_path()

    @SETTINGS.instruction("StartMoveRetry")
    def start_and_retry(self, call: Call) -> None:
        """StartMove and RETRY in one, so that nothing comes between them."""
        if task_of(call).frame.clause != "ERR":
            raise call.error(FATAL, "it is an instruction of error handlers.")
        self.start_move(call)
        task_of(call).frame.retry()

    @SETTINGS.instruction("StopMoveReset", _ALL_TASKS)
    def reset_stop(self, call: Call) -> None:
        """Forget a stop without going on now."""
        for arm in self._arms(call):
            arm.path.holds.discard(_STOP_MOVE)

    @SETTINGS.function("CSpeedOverride", r"\switch CTask", "num")
    def speed_override(self, call: Call) -> float:
        return self._unit.arm.path.override * 100.0

    @SETTINGS.function("MaxRobSpeed", "", "num")
    def most_speed(self, call: Call) -> float:
        return self._unit.arm.kinematics.tool_speed * 1e3

    @SETTINGS.function("IsLeadThrough", "", "bool")
    def is_led(self, call: Call) -> bool:
        return self._unit.mechanical_unit in self._unit.led

    @SETTINGS.function("RobName", "", "string")
    def robot_name(self, call: Call) -> str:
        return self._unit.mechanical_unit

    @SETTINGS.function("TaskRunMec", "", "bool")
    @SETTINGS.function("TaskRunRob", "", "bool")
    def has_robot(self, call: Call) -> bool:
        return self._is_motion_task

    def _units(self, call: Call) -> Sequence[ArmUnit]:
        return self._robots if call.get("AllMotionTasks", False) or not self._is_motion_task else [self._unit]

    def _arms(self, call: Call) -> list[VirtualArm]:
        return [unit.arm for unit in self._units(call)]

    @SETTINGS.instruction("ClearPath")
    def clear_path(self, call: Call) -> None:
        """Forget the rest of the path; the arm has to stand, as after StopMove."""
        arm = self._unit.arm
        if arm.path.is_empty:
            return
        if not arm.is_stationary:
            raise call.error("ERR_PATH", "stop the movements with StopMove before.")
        arm.path.restart_at(arm.planned)

    @SETTINGS.instruction("StorePath", r"\switch KeepSync")
    def store_path(self, call: Call) -> Wait:
        """Put the rest of the path aside, for other motions until RestoPath."""
        arm = self._unit.arm
        if self._unit.stored_paths:
            raise call.error(FATAL, "a path is stored already; RestoPath has to come before.")
        yield from standing(arm)
        self._unit.stored_paths.append(arm.path.store())

    @SETTINGS.instruction("RestoPath")
    def restore_path(self, call: Call) -> Wait:
        """The path that was stored is ahead again, and starts with StartMove."""
        arm = self._unit.arm
        if not self._unit.stored_paths:
            raise call.error(FATAL, "no path is stored.")
        yield from standing(arm)
        arm.leave_path()  # it may stand elsewhere than where the stored path goes on
        arm.path.restore(self._unit.stored_paths.pop())

    @SETTINGS.function("PathLevel", "", "num")
    def path_level(self, call: Call) -> float:
        """1, or 2 between StorePath and RestoPath."""
        return float(self._unit.path_level)

    @SETTINGS.function("IsStopMoveAct", r"\switch FromMoveTask | \switch FromNonMoveTask", "bool")
    def is_stopped(self, call: Call) -> bool:
        return any(_STOP_MOVE in arm.path.holds for arm in self._arms(call))

    @SETTINGS.instruction("ProcerrRecovery", r"\switch SyncOrgMoveInst | \switch SyncLastMoveInst, \switch ProcSignal")
    def recover(self, call: Call) -> Wait:
        """Stop the movements and let the error handler go on, with ERR_PATH_STOP."""
        arm = self._unit.arm
        arm.path.hold(_STOP_MOVE)
        yield from standing(arm)
        raise RapidRuntimeError("ERR_PATH_STOP", "ProcerrRecovery has stopped the movements.")


def _pose_of_target(target: Any) -> Pose:
    x, y, z = (value * 1e-3 for value in target[0])
    return Pose((x, y, z), unit_quaternion(target[1]))
