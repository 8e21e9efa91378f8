"""RAPID's instructions about the controller and its options: units, configuration, tasks, world zones, the gripper.

World zones (option 608-1) watch the point of the last motion's tool. A zone that stops the arm does so where it is: on
the path, within the braking distance. The Smart Gripper's instructions are ``g_...`` and ``Hand_...``
(reference/statemachine.md §5).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from math import radians
from typing import Any, cast

from yumi.errors import CommandRefused, RobotNotReady
from yumi.rapid.library import Call, Library, Wait
from yumi.rapid.types import BOOL, UNSET, RapidRuntimeError, is_numeric, resolved
from yumi.robot.gripper import MAX_FORCE, TOP_SPEED, TRAVEL, ServoState
from yumi.robot.joints import JOINT_COUNT, Joints, Vector, abb_from_chain, chain_from_abb
from yumi.rws.types import EventType
from yumi.virtual.controller.events import EventLog
from yumi.virtual.controller.files import SystemParameters
from yumi.virtual.controller.signals import Configuration
from yumi.virtual.controller.units import ArmUnit, MechanicalUnit, SyncPoints, unit_of
from yumi.virtual.instructions.motion import FATAL
from yumi.virtual.mechanics.virtual_gripper import CHANNELS, SETTLING_TIME, VirtualGripper
from yumi.virtual.mechanics.watched_zones import Box, JointRange, Outside, Shape, Sphere, UprightCylinder, WorldZone


class SystemInstructions:
    """The system instructions of one task."""

    def __init__(
        self,
        unit: ArmUnit,
        units: Sequence[MechanicalUnit],
        configuration: Configuration,
        sync_points: SyncPoints,
        robots: Sequence[ArmUnit] = (),
    ) -> None:
        self._unit = unit
        self._robots = robots
        self._units = units
        self._configuration = configuration
        self._sync_points = sync_points
        self._active: dict[str, tuple[str, Any]] = {}

    def unit_name(self, call: Call) -> str:
        """GetMecUnitName."""
        name: str = call["MechUnit"].name
        return name

    def next_unit(self, call: Call) -> bool:
        """GetNextMechUnit: the unit at the list number, which moves on; FALSE at the end of the list."""
        index = int(call["ListNumber"])
        if index >= len(self._units):
            return False
        unit = self._units[index]
        call["ListNumber"] = index + 1
        call["UnitName"] = unit.name
        facts = {
            "MecRef": unit,
            "TCPRob": unit.type == "TCPRobot",
            "NoOfAxes": unit.axes,
            "MecTaskNo": 1 if unit.task == self._units[0].task else 2,
            "MotPlanNo": 1 if unit.task == self._units[0].task else 2,
            "Active": unit.mode == "Activated",
            "DriveModule": unit.drive_module,
            "OKToDeact": False,
        }
        for name, value in facts.items():
            if call.present(name):
                call[name] = value
        return True

    def is_active(self, call: Call) -> bool:
        """IsMechUnitActive."""
        active: bool = call["MechUnit"].mode == "Activated"
        return active

    def motor_torque(self, call: Call) -> float:
        """GetMotorTorque: of an axis, in ABB's numbering [N m]: what holds the arm where it is.

        RAPID reference manual: of the motor; gear ratios are not published, so that it is that of the joint.
        """
        unit = unit_of(call["MecUnit"].name, self._unit, self._robots) if call.present("MecUnit") else self._unit
        if not unit.arm.kinematics.is_of_yumi:
            raise RapidRuntimeError("ERR_AXIS_PAR", f"{call.name}: the torques of this robot are not known.")
        axis = int(call["AxisNo"])
        if call["AxisNo"] != axis or not 1 <= axis <= JOINT_COUNT:
            raise RapidRuntimeError("ERR_AXIS_PAR", f"GetMotorTorque: the arm has the axes 1 to {JOINT_COUNT}.")
        robax, eax_a = abb_from_chain(unit.dynamics.torque(unit.arm.position))
        return (*robax, eax_a)[axis - 1]

    def get_system_data(self, call: Call) -> None:
        r"""GetSysData: the tool or work object that is active, with its name in \ObjectName."""
        type_name = call.reference("DestObject").type.name
        value, name = self._system_data(call, type_name)
        call["DestObject"] = value
        if call.present("ObjectName"):
            call["ObjectName"] = name

    def set_system_data(self, call: Call) -> None:
        """SetSysData: the tool or work object that is active until the next motion."""
        reference = call.reference("SourceObject")
        type_name = reference.type.name
        self._system_data(call, type_name)  # whether there is such
        setattr(self._unit, {"tooldata": "tool", "wobjdata": "wobj"}[type_name], reference.value)
        self._active[type_name] = call.get("ObjectName", ""), reference.value

    def _system_data(self, call: Call, type_name: str) -> tuple[Any, str]:
        predefined = {"tooldata": "tool0", "wobjdata": "wobj0"}.get(type_name)
        if predefined is None:
            raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name} takes a tooldata or wobjdata, not a {type_name}.")
        value = self._unit.tool if type_name == "tooldata" else self._unit.wobj
        if value is None:
            datum = call.task.library.datum(predefined)
            assert datum is not None, f"RAPID predefines {predefined}"
            return datum.value, predefined
        name, known = self._active.get(type_name, ("", None))
        return value, name if name and known == value else self._name_of(call, type_name, value, predefined)

    @staticmethod
    def _name_of(call: Call, type_name: str, value: Any, predefined: str) -> str:
        """The datum of the task that has the value."""
        for module in call.task.program.modules.values():
            for variable in module.data:
                if variable.type is not UNSET and variable.type.name == type_name and variable.value == value:
                    return variable.name
        return predefined

    def task_status(self, call: Call) -> float:
        """GetTSPStatus: of a task on the task selection panel, where all are selected."""
        if call["TaskName"].lower() not in (name.lower() for name in call.task.host.devices.tasks()):
            raise RapidRuntimeError("ERR_TASKNAME", f"GetTSPStatus: there is no task '{call['TaskName']}'.")
        return 3.0  # TSP_STATUS_ACT

    def payload_mode(self, call: Call) -> float:
        """GetModalPayLoadMode: 1 when the load of the arm is set by GripLoad."""
        found = self._configuration.find("SYS", "SYS_MISC", "ModalPayLoadMode")
        return 0.0 if found is None else float(found.attributes["Value"])

    def read_cfg(self, call: Call) -> None:
        """ReadCfgData: one attribute of one instance, as number, text or truth value."""
        path, attribute = call["InstancePath"], call["Attribute"]
        try:
            text = SystemParameters(self._configuration).read(path, attribute)
        except KeyError as error:
            raise RapidRuntimeError("ERR_CFG_NOTFND", f"The configuration has no {attribute} at {path}.") from error
        type_ = resolved(call.reference("CfgData").type)
        if is_numeric(type_):
            try:
                call["CfgData"] = float(text)
            except ValueError as error:
                raise RapidRuntimeError("ERR_CFG_ILLTYPE", f"{attribute} is '{text}', not a number.") from error
        elif type_ == BOOL:
            call["CfgData"] = text.upper() == "TRUE"
        else:
            call["CfgData"] = text

    def wait_sync(self, call: Call) -> Wait:
        """WaitSyncTask: until every task of the list is here, or ERR_WAITSYNCTASK after the time-out."""
        while call.present("InPos") and not self._unit.arm.is_stationary:
            yield None
        tasks = [task.taskname for task in call["TaskList"]]
        yield from self._meet(call, call.reference("SyncID").name.lower(), tasks, "ERR_WAITSYNCTASK")

    def _meet(self, call: Call, point: str, tasks: Sequence[str], error: str) -> Wait:
        """Until every task is at a point; raises the error after the call's time-out."""
        arrival = self._sync_points.arrive(point, call.task.name)
        deadline = call.task.now + call.get("TimeOut", float("inf"))
        try:
            while not self._sync_points.have_met(point, arrival, tasks):
                if call.task.now >= deadline:
                    raise RapidRuntimeError(error, f"The other tasks did not come to {point} in time.")
                yield None
        except (GeneratorExit, RapidRuntimeError):
            self._sync_points.leave(point, call.task.name)
            raise

    # Synchronized movements (application manual MultiMove): moves with the same ID begin together.

    def sync_move_on(self, call: Call) -> Wait:
        """SyncMoveOn: when every task of the list is here and stands, their moves are synchronized."""
        while not self._unit.arm.is_stationary:
            yield None
        tasks = tuple(task.taskname for task in call["TaskList"])
        if call.task.name.upper() not in (name.upper() for name in tasks):
            raise RapidRuntimeError("ERR_SYNCMOVEON", f"{call.task.name} is not in the list of {call.name}.")
        yield from self._meet(call, call.reference("SyncID").name.lower(), tasks, "ERR_SYNCMOVEON")
        self._unit.synchronized_tasks = tasks

    def sync_move_off(self, call: Call) -> Wait:
        """SyncMoveOff: when every synchronized task is here and stands, each moves by itself again."""
        while not self._unit.arm.is_stationary:
            yield None
        tasks = self._unit.synchronized_tasks or (call.task.name,)
        yield from self._meet(call, call.reference("SyncID").name.lower(), tasks, "ERR_SYNCMOVEOFF")
        self._unit.synchronized_tasks = ()

    def sync_move_undo(self, call: Call) -> None:
        """SyncMoveUndo: moves of this task are not synchronized any more, wherever the others are."""
        self._unit.synchronized_tasks = ()

    def suspend_sync(self, call: Call) -> Wait:
        r"""SyncMoveSuspend: until SyncMoveResume each task moves by itself, after StorePath\KeepSync."""
        if not self._unit.synchronized_tasks or self._unit.path_level == 1:
            sentence = f"{call.name} comes after StorePath\\KeepSync of synchronized movements."
            raise RapidRuntimeError("ERR_SYNCMOVEOFF", sentence)
        yield from self._meet(call, "SyncMoveSuspend", self._unit.synchronized_tasks, "ERR_SYNCMOVEOFF")
        self._unit.suspended_tasks, self._unit.synchronized_tasks = self._unit.synchronized_tasks, ()

    def resume_sync(self, call: Call) -> Wait:
        """SyncMoveResume: the movements are synchronized again."""
        if not self._unit.suspended_tasks:
            raise RapidRuntimeError("ERR_SYNCMOVEON", f"{call.name} comes after SyncMoveSuspend.")
        while not self._unit.arm.is_stationary:
            yield None
        yield from self._meet(call, "SyncMoveResume", self._unit.suspended_tasks, "ERR_SYNCMOVEON")
        self._unit.synchronized_tasks, self._unit.suspended_tasks = self._unit.suspended_tasks, ()

    def is_synchronized(self, call: Call) -> bool:
        """IsSyncMoveOn."""
        return bool(self._unit.synchronized_tasks)

    def tasks_in_sync(self, call: Call) -> float:
        """TasksInSync: writes the tasks whose moves are synchronized, and how many they are."""
        reference = call.reference("TaskList")
        names = self._unit.synchronized_tasks
        rows = [(name,) for name in names] + [("",)] * len(reference.value)
        call["TaskList"] = reference.type.convert(rows[: len(reference.value)])
        return len(names)

    def synchronized(self, move: Callable[[Call], Wait]) -> Callable[[Call], Wait]:
        """A move that waits for the moves of the same ID where movements are synchronized."""

        def meet_and_move(call: Call) -> Wait:
            tasks = self._unit.synchronized_tasks
            if tasks:
                if not call.present("ID"):
                    sentence = f"{call.name} needs \\ID while movements are synchronized."
                    raise RapidRuntimeError("ERR_ARGVALERR", sentence)
                yield from self._meet(call, f"the move {call['ID']:g}", tasks, "ERR_SYNCMOVEON")
            yield from move(call)

        return meet_and_move


def add_system(
    library: Library,
    unit: ArmUnit,
    units: Sequence[MechanicalUnit],
    configuration: Configuration,
    sync_points: SyncPoints,
    robots: Sequence[ArmUnit] = (),
) -> None:
    """Register the system instructions of one task."""
    system = SystemInstructions(unit, units, configuration, sync_points, robots)
    library.function("GetMecUnitName", "mecunit MechUnit", "string")(system.unit_name)
    library.function(
        "GetNextMechUnit",
        r"VAR num ListNumber, VAR string UnitName, \VAR mecunit MecRef, \VAR bool TCPRob, \VAR num NoOfAxes, "
        r"\VAR num MecTaskNo, \VAR num MotPlanNo, \VAR bool Active, \VAR num DriveModule, \VAR bool OKToDeact",
        "bool",
    )(system.next_unit)
    library.function("IsMechUnitActive", "mecunit MechUnit", "bool")(system.is_active)
    library.function("GetModalPayLoadMode", "", "num")(system.payload_mode)
    library.function("GetMotorTorque", r"\mecunit MecUnit, num AxisNo", "num")(system.motor_torque)
    library.instruction("GetSysData", r"INOUT anytype DestObject, \VAR string ObjectName")(system.get_system_data)
    library.instruction("SetSysData", r"anytype SourceObject, \string ObjectName")(system.set_system_data)
    library.function("GetTSPStatus", "string TaskName", "tsp_status")(system.task_status)
    planner = float(units[0].task != unit.side.task) + 1.0
    library.function("MotionPlannerNo", "", "num")(lambda call: planner)
    library.instruction("ReadCfgData", r"string InstancePath, string Attribute, INOUT anytype CfgData, \num ListNo")(
        system.read_cfg
    )
    library.instruction("SyncMoveOn", r"VAR syncident SyncID, anytype TaskList, \num TimeOut")(system.sync_move_on)
    library.instruction("SyncMoveOff", r"VAR syncident SyncID, \num TimeOut")(system.sync_move_off)
    library.instruction("SyncMoveUndo")(system.sync_move_undo)
    library.instruction("SyncMoveSuspend")(system.suspend_sync)
    library.instruction("SyncMoveResume")(system.resume_sync)
    library.function("IsSyncMoveOn", "", "bool")(system.is_synchronized)
    library.function("TasksInSync", "INOUT tasks TaskList{*}", "num")(system.tasks_in_sync)
    moves = [f"Move{letter}{kind}" for letter in "JLC" for kind in ("", "AO", "DO", "GO", "Sync")]
    triggers = ("TriggAbsJ", "TriggJ", "TriggL", "TriggC", "TriggJIOs", "TriggLIOs", "SearchL", "SearchC")
    for name in ("MoveAbsJ", "MoveExtJ", *moves, *triggers):
        move = library.routine(name)
        if move is not None and move.may_wait:
            library.replace_implementations((name,), system.synchronized(move.implementation))
    library.instruction("WaitSyncTask", r"\switch InPos, VAR syncident SyncID, anytype TaskList, \num TimeOut")(
        system.wait_sync
    )


_SMALLEST_ZONE_M = 0.01  # ABB's limit
_MOST_ZONES = 20


@dataclass(eq=False, slots=True)
class ShapeData:
    """A shapedata; None until it is defined."""

    shape: Shape | None = None


@dataclass(eq=False, slots=True)
class ZoneData:
    """A wztemporary or wzstationary; None until it is defined, or when it is freed."""

    zone: WorldZone | None = None


class WorldZoneInstructions:
    """The world zones of one task."""

    def __init__(self, unit: ArmUnit) -> None:
        self._unit = unit

    def define_box(self, call: Call) -> None:
        """WZBoxDef."""
        low, high = (_metres(call[name]) for name in ("LowPoint", "HighPoint"))
        pairs = list(zip(low, high, strict=True))
        corners = [tuple(min(pair) for pair in pairs), tuple(max(pair) for pair in pairs)]
        self._check_size(call, min(abs(a - b) for a, b in pairs))
        self._define(call, Box(*(cast("Vector", corner) for corner in corners)))

    def define_sphere(self, call: Call) -> None:
        """WZSphDef."""
        self._check_size(call, call["Radius"] * 1e-3)
        self._define(call, Sphere(_metres(call["CentrePoint"]), call["Radius"] * 1e-3))

    def define_cylinder(self, call: Call) -> None:
        """WZCylDef."""
        radius, height = call["Radius"] * 1e-3, call["Height"] * 1e-3
        self._check_size(call, min(radius, abs(height)))
        self._define(call, UprightCylinder(_metres(call["CentrePoint"]), radius, height))

    def define_home(self, call: Call) -> None:
        """WZHomeJointDef: joints beside a middle."""
        middle, delta = (self._joints(call[name]) for name in ("MiddleJointVal", "DeltaJointVal"))
        low, high = (tuple(m + sign * abs(d) for m, d in zip(middle, delta, strict=True)) for sign in (-1.0, 1.0))
        self._define(call, JointRange(low, high))

    def define_limits(self, call: Call) -> None:
        """WZLimJointDef: joints between two positions."""
        low, high = (self._joints(call[name]) for name in ("LowJointVal", "HighJointVal"))
        self._define(call, JointRange(low, high))

    def supervise(self, call: Call) -> None:
        """WZLimSup: the arm stops when its tool comes into the zone."""
        unit, name = self._unit, call.reference("WorldZone").name

        def changed(is_inside: bool) -> None:
            if is_inside:
                unit.zone_fault = f"{unit.mechanical_unit} has come into the world zone {name}, which WZLimSup forbids."

        self._add(call, changed)

    def set_output(self, call: Call) -> None:
        """WZDOSet: a signal has a value in the zone, and the other one outside."""
        task, signal, value = call.task, call["Signal"].name, 1.0 if call["SetValue"] else 0.0
        self._add(call, lambda is_inside: task.write_signal(signal, value if is_inside else 1.0 - value))

    def enable(self, call: Call) -> None:
        """WZEnable."""
        self._zone(call).is_enabled = True

    def disable(self, call: Call) -> None:
        """WZDisable."""
        self._zone(call).is_enabled = False

    def free(self, call: Call) -> None:
        """WZFree."""
        self._unit.zones.remove(self._zone(call))
        call["WorldZone"].zone = None

    def _define(self, call: Call, shape: Shape) -> None:
        call["Shape"].shape = Outside(shape) if call.present("Outside") else shape

    @staticmethod
    def _check_size(call: Call, smallest: float) -> None:
        if smallest < _SMALLEST_ZONE_M:
            sentence = f"{call.name}: a zone is at least {_SMALLEST_ZONE_M * 1e3:g} mm wide, not {smallest * 1e3:g} mm."
            raise RapidRuntimeError(FATAL, sentence)

    def _joints(self, target: Any) -> Joints:
        """Joint positions [rad] of a jointtarget in chain order."""
        if self._unit.arm.kinematics.reference is None:
            return tuple(map(radians, target.robax))
        return tuple(map(radians, chain_from_abb(target.robax, target.extax[0])))

    def _add(self, call: Call, changed: Callable[[bool], None]) -> None:
        shape, data = call["Shape"].shape, call["WorldZone"]
        if shape is None:
            raise RapidRuntimeError(FATAL, f"{call.name}: the shape has to be defined before, by WZBoxDef or its like.")
        if data.zone is not None:
            raise RapidRuntimeError(FATAL, f"{call.name}: the zone is in use already; WZFree gives it back.")
        if len(self._unit.zones) >= _MOST_ZONES:
            raise RapidRuntimeError(FATAL, f"{call.name}: {_MOST_ZONES} world zones are in use.")
        data.zone = WorldZone(shape, changed)
        self._unit.zones.append(data.zone)

    @staticmethod
    def _zone(call: Call) -> WorldZone:
        zone: WorldZone | None = call["WorldZone"].zone
        if zone is None:
            raise RapidRuntimeError(FATAL, f"{call.name}: the zone is not defined, by WZDOSet or WZLimSup.")
        return zone


def _metres(position: Any) -> Vector:
    x, y, z = (value * 1e-3 for value in position)
    return (x, y, z)


def add_world_zones(library: Library, unit: ArmUnit) -> None:
    """Register the world zones of one task."""
    own = WorldZoneInstructions(unit)
    library.object_type("shapedata", ShapeData)
    library.object_type("wztemporary", ZoneData)
    library.object_type("wzstationary", ZoneData)
    shape = r"\switch Inside | \switch Outside, VAR shapedata Shape"
    zone = r"\switch Temp | \switch Stat, INOUT anytype WorldZone"
    for name, signature, implementation in (
        ("WZBoxDef", f"{shape}, pos LowPoint, pos HighPoint", own.define_box),
        ("WZSphDef", f"{shape}, pos CentrePoint, num Radius", own.define_sphere),
        ("WZCylDef", f"{shape}, pos CentrePoint, num Radius, num Height", own.define_cylinder),
        ("WZHomeJointDef", f"{shape}, jointtarget MiddleJointVal, jointtarget DeltaJointVal", own.define_home),
        ("WZLimJointDef", f"{shape}, jointtarget LowJointVal, jointtarget HighJointVal", own.define_limits),
        ("WZLimSup", f"{zone}, VAR shapedata Shape", own.supervise),
        (
            "WZDOSet",
            rf"{zone}, \switch Inside | \switch Before, VAR shapedata Shape, VAR signaldo Signal, num SetValue",
            own.set_output,
        ),
        ("WZEnable", "INOUT anytype WorldZone", own.enable),
        ("WZDisable", "INOUT anytype WorldZone", own.disable),
        ("WZFree", "INOUT anytype WorldZone", own.free),
    ):
        library.instruction(name, signature)(implementation)


_FINGER_TIMEOUT = 5.0
"""How long an instruction waits for the fingers [s] (reference/statemachine.md §5.3)."""

_GRIP_ARGUMENTS = r"\num holdForce, \num targetPos, \num posAllowance, \switch NoWait"


class _GripperFailure(Enum):
    """What the gripper's driver logs in domain 11, and the RAPID error it raises."""

    NOT_CALIBRATED = (112755, "ERR_HAND_NOTCALIBRATED")
    OUT_OF_RANGE = (112757, "ERR_HAND_AUGOUTOFRANGE")
    WRONG_STATE = (112751, "ERR_HAND_WRONGSTATE")
    FAILED_MOVE = (112753, "ERR_HAND_FAILEDMOVEPOS")
    FAILED_GRIP_IN = (112754, "ERR_HAND_FAILEDGRIPINWARD")
    FAILED_GRIP_OUT = (112760, "ERR_HAND_FAILEDGRIPOUTWARD")
    FAILED_GRIP_POSITION = (112759, "ERR_HAND_FAILEDGRIPPOS")
    FAILED_VACUUM = (112756, "ERR_HAND_FAILEDVACUUM")


class GripperInstructions:
    """The gripper's instructions of one task."""

    def __init__(self, gripper: VirtualGripper, events: EventLog) -> None:
        self._gripper = gripper
        self._events = events

    def init(self, call: Call) -> Wait:
        """g_Init."""
        speed, force = call.get("maxSpd", TOP_SPEED * 1e3) * 1e-3, call.get("holdForce", MAX_FORCE)
        limit = call.get("phyLimit", TRAVEL * 1e3) * 1e-3
        self._do(lambda: self._gripper.initialize(speed, force, limit))
        if call.present("Calibrate"):
            yield from self._calibrated(jog=True)

    def calibrate(self, call: Call) -> Wait:
        """g_Calibrate: done when the gripper knows its zero."""
        yield from self._calibrated(jog=call.present("Jog"))

    def move_to(self, call: Call) -> Wait:
        r"""g_MoveTo: done when the fingers are there, or at once with \NoWait."""
        position = call["TargetPos"] * 1e-3
        yield from self._readied(call)
        self._do(lambda: self._gripper.move_to(position))
        if not call.present("NoWait"):
            yield from self._standing(call, _GripperFailure.FAILED_MOVE)

    def grip_in(self, call: Call) -> Wait:
        r"""g_GripIn: done when the fingers stand, at something or at their end, or at once with \NoWait."""
        yield from self._readied(call)
        self._do(lambda: self._gripper.grip_in(call.get("holdForce", MAX_FORCE)))
        yield from self._held(call, _GripperFailure.FAILED_GRIP_IN)

    def grip_out(self, call: Call) -> Wait:
        r"""g_GripOut: done when the fingers stand, at something or at their end, or at once with \NoWait."""
        yield from self._readied(call)
        self._do(lambda: self._gripper.grip_out(call.get("holdForce", MAX_FORCE)))
        yield from self._held(call, _GripperFailure.FAILED_GRIP_OUT)

    def jog(self, call: Call, *, opens: bool) -> Wait:
        """g_JogIn, g_JogOut: done when the fingers stand; the motor then lets go."""
        yield from self._readied(call)
        self._gripper.jog(opens=opens)
        begin = call.task.now
        while call.task.now - begin < SETTLING_TIME or self._gripper.speed != 0.0:
            if call.task.now - begin >= _FINGER_TIMEOUT:
                self._fail(_GripperFailure.WRONG_STATE, f"The fingers have been moving for {_FINGER_TIMEOUT:g} s.")
            yield None
        self._gripper.stop()

    def vacuum_on(self, call: Call, channel: int) -> Wait:
        """g_VacuumOn: done at once, or with a threshold [kPa] when the pressure is below it."""
        self._gripper.set_vacuum(channel, is_on=True)
        deadline = call.task.now + _FINGER_TIMEOUT
        while call.present("threshold") and self.pressure(call, channel) > call["threshold"]:
            if call.task.now >= deadline:
                self._fail(
                    _GripperFailure.FAILED_VACUUM, f"Vacuum {channel} does not get below {call['threshold']:g} kPa."
                )
            yield None

    def pressure(self, call: Call, channel: int) -> float:
        """g_GetPressure [kPa]; 0 where there is no such module."""
        return self._gripper.cups[channel].pressure * 1e-3 if channel in self._gripper.cups else 0.0

    def wait_for_fingers(self, call: Call) -> Wait:
        """Hand_WaitMovingCompleted: until the fingers stand."""
        yield from self._standing(call, _GripperFailure.FAILED_MOVE)

    def _readied(self, call: Call) -> Wait:
        """Bring the gripper to READY for one cycle before the next command, as the gripper's own driver does.

        ``hand_SysState`` then shows where one command ends and the next begins.
        """
        self._gripper.stop()
        begin = call.task.now
        while call.task.now == begin:
            yield None

    def _calibrated(self, *, jog: bool) -> Wait:
        self._gripper.calibrate(jog=jog)
        while self._gripper.is_moving:
            yield None
        if not self._gripper.is_calibrated:
            self._fail(_GripperFailure.WRONG_STATE, "The gripper could not be calibrated.")

    def _held(self, call: Call, failure: _GripperFailure) -> Wait:
        if call.present("NoWait"):
            return
        # ABB's driver waits for the state that force is held, which the end of the fingers' travel brings about, too:
        # programs open fingers by gripping outward on nothing.
        yield from self._standing(call, failure)
        allowance_mm = call.get("posAllowance", call.get("posAlowance"))
        position_mm = self._gripper.position * 1e3
        if (
            call.present("targetPos")
            and allowance_mm is not None
            and abs(position_mm - call["targetPos"]) > allowance_mm
        ):
            sentence = f"The fingers stand at {position_mm:.1f} mm each, not within {allowance_mm:g} mm of the target."
            self._fail(_GripperFailure.FAILED_GRIP_POSITION, sentence)

    def _standing(self, call: Call, failure: _GripperFailure) -> Wait:
        deadline = call.task.now + _FINGER_TIMEOUT
        while self._gripper.is_moving:
            if call.task.now >= deadline:
                self._fail(failure, f"The fingers have been moving for {_FINGER_TIMEOUT:g} s.")
            yield None
        if self._gripper.state is ServoState.ERROR:
            self._fail(failure, "The gripper reports an error.")

    def _do(self, action: Callable[[], None]) -> None:
        try:
            action()
        except RobotNotReady as error:
            self._fail(_GripperFailure.NOT_CALIBRATED, str(error))
        except CommandRefused as error:
            self._fail(_GripperFailure.OUT_OF_RANGE, str(error))

    def _fail(self, failure: _GripperFailure, sentence: str) -> None:
        code, name = failure.value
        self._events.append(code, "Smart Gripper", sentence, EventType.ERROR)
        raise RapidRuntimeError(name, sentence)


def add_gripper(library: Library, gripper: VirtualGripper, events: EventLog) -> None:
    """Register the gripper's instructions of one task."""
    commands = GripperInstructions(gripper, events)
    for failure in _GripperFailure:
        library.error(failure.value[1])
    library.instruction("g_Init", r"\num maxSpd, \num holdForce, \num phyLimit, \switch Calibrate")(commands.init)
    library.instruction("g_Calibrate", r"\switch Jog")(commands.calibrate)
    library.instruction("g_MoveTo", r"num TargetPos, \switch NoWait")(commands.move_to)
    library.instruction("g_GripIn", _GRIP_ARGUMENTS)(commands.grip_in)
    library.instruction("g_GripOut", _GRIP_ARGUMENTS)(commands.grip_out)
    library.instruction("g_JogIn")(partial(commands.jog, opens=False))
    library.instruction("g_JogOut")(partial(commands.jog, opens=True))
    library.instruction("g_Stop")(lambda call: gripper.stop())
    library.instruction("g_SetMaxSpd", "num maxSpd")(lambda call: gripper.set_max_speed(call["maxSpd"] * 1e-3))
    library.instruction("g_SetForce", "num holdForce")(lambda call: gripper.set_hold_force(call["holdForce"]))
    library.function("g_IsCalibrated", "", "bool")(lambda call: gripper.is_calibrated)
    library.function("g_GetPos", "", "num")(lambda call: gripper.position * 1e3)  # of each finger [mm]
    library.function("g_GetSpd", "", "num")(lambda call: abs(gripper.speed) * 1e3)  # of each finger [mm/s]
    # The names of the add-in's first generation (reference/statemachine.md), with its spelling.
    grip = rf"{_GRIP_ARGUMENTS.replace('posAllowance', 'posAlowance')}, \switch NotLimitDriveForce"
    older: tuple[tuple[str, str, Callable[[Call], Any]], ...] = (
        ("Hand_Initialize", r"\num maxSpd, \num holdForce, \num phyLimit, \switch Calibrate", commands.init),
        ("Hand_DoCalibrate", r"\switch Jog", commands.calibrate),
        ("Hand_MoveTo", r"num TargetPos, \switch NoWait", commands.move_to),
        ("Hand_GripInward", grip, commands.grip_in),
        ("Hand_GripOutward", grip, commands.grip_out),
        ("Hand_JogInward", "", partial(commands.jog, opens=False)),
        ("Hand_JogOutward", "", partial(commands.jog, opens=True)),
        ("Hand_Stop", "", lambda call: gripper.stop()),
        ("Hand_WaitMovingCompleted", "", commands.wait_for_fingers),
        ("Hand_SetMaxSpeed", "num maxSpd", lambda call: gripper.set_max_speed(call["maxSpd"] * 1e-3)),
        ("Hand_SetHoldForce", "num holdForce", lambda call: gripper.set_hold_force(call["holdForce"])),
    )
    for name, signature, implementation in older:
        library.instruction(name, signature)(implementation)
    library.function("Hand_IsCalibrated", "", "bool")(lambda call: gripper.is_calibrated)
    library.function("Hand_IsCamConnected", "", "bool")(lambda call: False)
    library.function("Hand_GetActualPos", "", "num")(lambda call: gripper.position * 1e3)
    library.function("Hand_GetActualSpd", "", "num")(lambda call: abs(gripper.speed) * 1e3)
    library.function("Hand_GetFingerState", "", "num")(lambda call: float(gripper.state.value))
    for channel in CHANNELS:
        for name, switch, is_on in (
            ("TurnOffVacuum", gripper.set_vacuum, False),
            ("TurnOnBlow", gripper.set_blow, True),
            ("TurnOffBlow", gripper.set_blow, False),
        ):
            library.instruction(f"Hand_{name}{channel}")(partial(_switch_channel, switch, channel, is_on))
        library.instruction(f"Hand_TurnOnVacuum{channel}", r"\num threshold")(
            partial(commands.vacuum_on, channel=channel)
        )
        library.function(f"Hand_GetVacuumPressure{channel}", "", "num")(partial(commands.pressure, channel=channel))
        switches = (
            ("VacuumOff", gripper.set_vacuum, False),
            ("BlowOn", gripper.set_blow, True),
            ("BlowOff", gripper.set_blow, False),
        )
        for name, switch, is_on in switches:
            library.instruction(f"g_{name}{channel}")(partial(_switch_channel, switch, channel, is_on))
        library.instruction(f"g_VacuumOn{channel}", r"\num threshold")(partial(commands.vacuum_on, channel=channel))
        library.function(f"g_GetPressure{channel}", "", "num")(partial(commands.pressure, channel=channel))


def _switch_channel(set_channel: Callable[..., None], channel: int, is_on: bool, call: Call) -> None:
    set_channel(channel, is_on=is_on)
