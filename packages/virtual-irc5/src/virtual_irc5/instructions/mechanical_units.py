"""RAPID's questions about the mechanical units of a controller, their tools and work objects, and system parameters."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from virtual_irc5.instructions.robot_data import ROBOT_DATA
from virtual_irc5.mechanics.units import ArmUnit, MechanicalUnit
from virtual_irc5.rapid import Call, Library
from virtual_irc5.rapid.task import task_of
from virtual_irc5.rapid.types import UNSET_DATA, RapidRuntimeError

UNITS = Library(ROBOT_DATA)


class UnitInstructions:
    """The instructions of one task about the robot and its settings."""

    def __init__(self, unit: ArmUnit, units: Sequence[MechanicalUnit]) -> None:
        self._unit, self._units = unit, units
        self._active: dict[str, tuple[str, Any]] = {}

    @UNITS.function("GetMecUnitName", "mecunit MechUnit", "string")
    def unit_name(self, call: Call) -> str:
        name: str = call["MechUnit"].name
        return name

    @UNITS.function(
        "GetNextMechUnit",
        r"VAR num ListNumber, VAR string UnitName, \VAR mecunit MecRef, \VAR bool TCPRob, \VAR num NoOfAxes, "
        r"\VAR num MecTaskNo, \VAR num MotPlanNo, \VAR bool Active, \VAR num DriveModule, \VAR bool OKToDeact",
        "bool",
    )
    def next_unit(self, call: Call) -> bool:
        """The unit at the list number, which moves on; FALSE at the end of the list."""
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
            "MecTaskNo": self._planner_of(unit.task),
            "MotPlanNo": self._planner_of(unit.task),
            "Active": unit.is_active,
            "DriveModule": unit.drive_module,
            "OKToDeact": False,
        }
        for name, value in facts.items():
            call.give(name, value)
        return True

    @UNITS.function("IsMechUnitActive", "mecunit MechUnit", "bool")
    def is_active(self, call: Call) -> bool:
        active: bool = call["MechUnit"].is_active
        return active

    @UNITS.instruction("GetSysData", r"INOUT anytype DestObject, \VAR string ObjectName")
    def get_system_data(self, call: Call) -> None:
        r"""The tool or work object that is active, with its name in \ObjectName."""
        type_name = call.reference("DestObject").type.name
        value, name = self._system_data(call, type_name)
        call["DestObject"] = value
        call.give("ObjectName", name)

    @UNITS.instruction("SetSysData", r"anytype SourceObject, \string ObjectName")
    def set_system_data(self, call: Call) -> None:
        """The tool or work object that is active until the next motion."""
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
            return call.task.library.value(predefined), predefined
        name, known = self._active.get(type_name, ("", None))
        return value, name if name and known == value else self._name_of(call, type_name, value, predefined)

    @staticmethod
    def _name_of(call: Call, type_name: str, value: Any, predefined: str) -> str:
        """The datum of the task that has the value."""
        for module in task_of(call).program.modules.values():
            for variable in module.data:
                if variable.type is not UNSET_DATA and variable.type.name == type_name and variable.value == value:
                    return variable.name
        return predefined

    @UNITS.function("MotionPlannerNo", "", "num")
    def motion_planner(self, call: Call) -> float:
        return self._planner_of(self._unit.side.task)

    def _planner_of(self, task: str) -> float:
        return 1.0 if task == self._units[0].task else 2.0

    @UNITS.function("GetTSPStatus", "string TaskName", "tsp_status")
    def task_status(self, call: Call) -> float:
        """Of a task on the task selection panel, where all are selected."""
        if call["TaskName"].lower() not in (name.lower() for name in call.task.host.devices.tasks()):
            raise call.error("ERR_TASKNAME", f"there is no task '{call['TaskName']}'.")
        return 3.0  # TSP_STATUS_ACT

    @UNITS.function("GetModalPayLoadMode", "", "num")
    def payload_mode(self, call: Call) -> float:
        """1 when the load of the arm is set by GripLoad."""
        configuration = call.task.host.devices.configuration
        with suppress(KeyError):
            return float(configuration.read("/SYS/SYS_MISC/ModalPayLoadMode", "Value")) if configuration else 0.0
        return 0.0
