"""The tasks of the configuration: type, trust level, entry routine, event routines and modules of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from operator import itemgetter

from abb_protocols.errors import SettingsError
from virtual_irc5.rapid.states import SystemEvent
from virtual_irc5.system_parameters import SystemConfiguration


class TaskType(Enum):
    """How a task is started; the values are those of RWS.

    NORMAL tasks are started and stopped by users. STATIC and SEMISTATIC ones run whenever the controller does, the
    latter from their beginning after each restart (technical reference manual, system parameters: topic Controller).
    """

    NORMAL = "norm"
    STATIC = "stat"
    SEMISTATIC = "semi"


class TrustLevel(Enum):
    """What an error in a STATIC or SEMISTATIC task stops; the values are those of the system parameter."""

    SYS_FAIL = "SysFail"
    SYS_HALT = "SysHalt"
    SYS_STOP = "SysStop"
    NO_SAFETY = "NoSafety"  # "None" in the cfg files of controllers


@dataclass(frozen=True, slots=True)
class TaskSettings:
    """One instance of CAB_TASKS.

    Attributes:
        name: of the task.
        type: how it is started.
        is_motion_task: whether its instructions may move a robot.
        robot: name of the robot of its mechanical unit group, ``ROB_L``; empty without one.
        entry: the procedure it begins with.
        trust: what an error in it stops; NORMAL tasks stop together in any case.
        foreground: the task it waits for: it executes while that one is idle only; empty without one.
    """

    name: str
    type: TaskType = TaskType.NORMAL
    is_motion_task: bool = False
    robot: str = ""
    entry: str = "main"
    trust: TrustLevel = TrustLevel.SYS_FAIL
    foreground: str = ""


def task_settings(configuration: SystemConfiguration) -> tuple[TaskSettings, ...]:
    """The tasks of a configuration in their order; raises SettingsError."""
    tasks = []
    for instance in configuration.instances("SYS", "CAB_TASKS"):
        given = {name.lower(): value for name, value in instance.attributes.items()}
        is_motion_task = given.get("motiontask", "").lower() in ("true", "yes", "1")
        group = configuration.find("SYS", "MECHANICAL_UNIT_GROUP", given.get("usemechanicalunitgroup", ""))
        # "Task in foreground" of the system parameters; its name in cfg files differs between RobotWare's releases.
        behind = (value for name, value in given.items() if name.replace("_", "").startswith("taskinfor"))
        trust = given.get("trustlevel", "").lower().replace("none", TrustLevel.NO_SAFETY.value.lower())
        tasks.append(
            TaskSettings(
                instance.name,
                _task_type(instance.name, given.get("type", TaskType.SEMISTATIC.name)),
                is_motion_task,
                group.attributes.get("Robot", "") if group else "",
                given.get("entry") or "main",
                next((each for each in TrustLevel if each.value.lower() == trust), TrustLevel.SYS_FAIL),
                next(behind, "").removeprefix("-1"),
            )
        )
    return tuple(tasks)


def _task_type(task: str, given: str) -> TaskType:
    try:
        return TaskType[given.upper().replace("-", "").replace("_", "")]
    except KeyError:
        allowed = ", ".join(each.name for each in TaskType)
        raise SettingsError(f"the task {task} has the type {given!r}; there are {allowed}.") from None


_TRUE = ("TRUE", "YES", "1", "")  # an attribute without a value is set


def event_routines(configuration: SystemConfiguration, task: TaskSettings) -> Mapping[SystemEvent, tuple[str, ...]]:
    """The event routines of a task in the order of their sequence numbers (CAB_EXEC_HOOKS)."""
    found: dict[SystemEvent, list[tuple[int, str]]] = {}
    for instance in configuration.instances("SYS", "CAB_EXEC_HOOKS"):
        given = {name.lower(): value for name, value in instance.attributes.items()}
        event = next((each for each in SystemEvent if each.name == given.get("shelf", "").upper()), None)
        of_all = given.get("alltask", given.get("alltasks", "no")).upper() in _TRUE
        of_motion = given.get("allmotiontask", given.get("allmotiontasks", "no")).upper() in _TRUE
        is_here = of_all or (of_motion and task.is_motion_task) or given.get("task", "").upper() == task.name.upper()
        if event is None or not given.get("routine") or not is_here:
            continue
        number = given.get("seqno", given.get("sequenceno", "0"))
        found.setdefault(event, []).append((int(number) if number.isdecimal() else 0, given["routine"]))
    return {event: tuple(name for _, name in sorted(each, key=itemgetter(0))) for event, each in found.items()}
