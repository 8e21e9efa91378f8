"""Operations on RAPID (``/rw/rapid``): its execution, tasks, programs, pointers, breakpoints and dialogs."""

from __future__ import annotations

from dataclasses import astuple, dataclass, field
from typing import Annotated

from abb_protocols.rws.documents import RwsState, member
from abb_protocols.rws.operations.motion import TURNS_OF_TARGET, joint_answer, target_answer
from abb_protocols.rws.operations.operation import get, post
from abb_protocols.rws.operations.operation_answer import TEXT, WHOLE, Spelling, flag, record, single
from abb_protocols.rws.values import ExecutionState, Grant, RunCycle, TaskExecution

_TASK = "/rw/rapid/tasks/{task}"
_TASKS = "/rw/rapid/tasks"
_EXECUTION = "/rw/rapid/execution"
_DIALOGS = "/rw/rapid/uiinstr"
_LOGGING = Spelling(
    lambda state, name: state.text(name).lower() == "logging",
    lambda name, is_on: {name: "Logging" if is_on else "Not Logging"},
)
_SIX: Spelling[tuple[str, ...]] = Spelling(
    lambda state, name: tuple(state.text(f"{name}{number}") for number in range(1, 7)),
    lambda name, texts: {f"{name}{number}": text for number, text in enumerate(texts, 1)},
)
_EXTERNAL = tuple(f"ej{number}" for number in range(1, 7))

_TASK_EXECUTION = Spelling(
    lambda state, name: member(TaskExecution, state.text(name)[:4].lower()), lambda name, value: {name: value.value}
)


@dataclass(frozen=True, slots=True)
class ExecutionAnswer:
    """Whether RAPID runs, and whether a program begins again at its end."""

    state: Annotated[ExecutionState, "ctrlexecstate"]
    cycle: RunCycle


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskInfo:
    """One RAPID task.

    Attributes:
        name: of the task.
        type_code: ``norm``, ``stat`` or ``semi``.
        links: ``link``, ``empt`` or ``init``: whether its program is linked.
        execution: its state.
        is_active: whether it is selected in the task panel.
        is_motion_task: whether it moves a mechanical unit.
    """

    name: str
    type_code: Annotated[str, "type"] = "norm"
    links: Annotated[str, "taskstate"] = ""
    execution: Annotated[TaskExecution, "excstate", _TASK_EXECUTION]
    is_active: Annotated[bool, "active", flag("On", "Off")]
    is_motion_task: Annotated[bool, "motiontask"]

    @property
    def starts_by_hand(self) -> bool:
        """Whether a person starts it; a static or semistatic one starts with the controller."""
        return self.type_code.lower().startswith("norm")


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskDetails(TaskInfo):
    """One RAPID task in full.

    Attributes:
        type: ``Normal``, ``Static`` or ``SemiStatic``.
        trust: what stops when the task does, such as ``SysFail``.
        number: of the task.
        level, mode, execution_type: of what is executed, as the controller calls them.
        entry: routine at which production begins.
    """

    type: Annotated[str, "tasktype"]
    trust: str = ""
    number: Annotated[str, "taskID"] = ""
    level: Annotated[str, "execlevel"] = ""
    mode: Annotated[str, "execmode"] = ""
    execution_type: Annotated[str, "exectype"] = ""
    entry: Annotated[str, "prodentrypt"] = ""


@dataclass(frozen=True, slots=True)
class Range:
    """A part of a module's text; rows and columns count from 1, the end included."""

    row: int
    column: int
    end_row: int
    end_column: int


def range_in(*names: str) -> Spelling[Range]:
    """A range in four fields."""
    return Spelling(
        lambda state, name: Range(*map(state.whole, names)),
        lambda name, value: dict(zip(names, map(str, astuple(value)), strict=True)),
    )


@dataclass(frozen=True, slots=True)
class StackFrame:
    """One call that is under way in a task; ``level`` is Normal, Trap, User or Service."""

    level: Annotated[str, "execlevel"]
    range: Annotated[Range, range_in("beg-row", "beg-col", "end-row", "end-col")]
    stack_url: str = ""
    routine_url: str = field(kw_only=True)

    @property
    def module(self) -> str:
        """Where the routine is."""
        return self.routine_url.rpartition("/")[0].rpartition("/")[2]

    @property
    def routine(self) -> str:
        """Name of it."""
        return self.routine_url.rpartition("/")[2]


def _read_range(state: RwsState, name: str) -> Range | None:
    parts = f"{state.fields.get('beginposition', '')},{state.fields.get('endposition', '')}".split(",")
    return Range(*map(int, parts)) if all(part.isdecimal() for part in parts) else None


def _write_range(name: str, at: Range | None) -> dict[str, str]:
    if at is None:
        return {}
    return {"beginposition": f"{at.row},{at.column}", "endposition": f"{at.end_row},{at.end_column}"}


@dataclass(frozen=True, slots=True)
class Pointer:
    """Where a program pointer or motion pointer stands; ``range`` is None where it is nowhere."""

    range: Annotated[Range | None, Spelling(_read_range, _write_range)]
    module: Annotated[str, "modulemame"] = ""
    routine: Annotated[str, "routinename"] = ""


@dataclass(frozen=True, slots=True)
class ProgramInfo:
    """The program of a task."""

    name: str
    entry: Annotated[str, "entrypoint"]


@dataclass(frozen=True, slots=True)
class BuildError:
    """A fault in a module, found when the program was linked."""

    module: Annotated[str, "ModuleName"] = ""
    row: int = field(kw_only=True)
    column: int = field(kw_only=True)
    message: Annotated[str, "error"] = field(kw_only=True)


@dataclass(frozen=True, slots=True)
class TaskPlace:
    """What a task with a program pointer executes."""

    module: Annotated[str, "module-name"]
    routine: Annotated[str, "routine-name"]
    line: int


@dataclass(frozen=True, slots=True)
class Breakpoint:
    """Where execution may stop."""

    module: Annotated[str, "module-name"]
    range: Annotated[Range, range_in("start-row", "start-col", "end-row", "end-col")]


@dataclass(frozen=True, slots=True)
class Dialog:
    """A question of a program on the FlexPendant; ``stack`` names it for ``dialog_parameters``."""

    instruction: Annotated[str, "instr"]
    event: str = field(default="POST", kw_only=True)
    stack: str
    level: Annotated[str, "execlv"] = field(default="User", kw_only=True)
    message: Annotated[str, "msg"]


RAPID = get("/rw/rapid")
EXECUTION = get(_EXECUTION, "continue-on-err=0|1").shows(record("rap-execution", ExecutionAnswer))
START = post(
    _EXECUTION,
    "start",
    "regain=continue|regain|clear, "
    "execmode=continue|stepin|stepover|stepout|stepback|steplast|stepmotion, "
    "cycle=forever|asis|once, condition=none|callchain, stopatbp=disabled|enabled, "
    "alltaskbytsp=true|false",
    grant=Grant.RAPID_EXECUTE,
)
STOP = post(_EXECUTION, "stop", "stopmode=cycle|instr|stop|qstop, usetsp=normal|alltsk")
START_PRODUCTION = post(_EXECUTION, "startprodentry", grant=Grant.RAPID_EXECUTE)
MOVE_PP_TO_MAIN = post(_EXECUTION, "resetpp", grant=Grant.RAPID_EXECUTE)
SET_CYCLE = post(_EXECUTION, "setcycle", "cycle=once|forever|asis", needs="rapid", grant=Grant.RAPID_EXECUTE)
HOLD_TO_RUN = post(_EXECUTION, "holdtorun-state", "state=press|held|release", grant=Grant.RAPID_DEBUG, status=403)
TASKS = get(_TASKS, "continue-on-err=0|1").shows(record("rap-task-li", TaskInfo))
SPY = get(_TASKS, resource="spy-status").shows(single("rap-spy-status", "status", _LOGGING))
SYNC_STATE = get(_TASKS, "type=program-pointer|motion-pointer", resource="sync-state").shows(
    single("rap-sync-state", "Program-Pointer-State", flag("ON", "OFF"))
)
ACTIVATE_ALL = post(_TASKS, "activate", respects="rapid", grant=Grant.RAPID_DEBUG)
DEACTIVATE_ALL = post(_TASKS, "deactivate", respects="rapid", grant=Grant.RAPID_DEBUG)
START_SPY = post(_TASKS, "start-spy", "log-file", status=400)
STOP_SPY = post(_TASKS, "stop-spy", status=400)
TASK = get(_TASK, "continue-on-err=0|1").shows(record("rap-task", TaskDetails))
STACK_FRAME = get(_TASK, "stackframe", resource="activation-record").shows(record("rap-stackframe", StackFrame))
CHANGE_COUNT_TOO = get(_TASK, resource="task-struc-change-count")
PREFERRED_TYPES = get(_TASK, "instruction, parameter", resource="pref-data-types").shows(
    single("task-pref-data-types", "type-prefdattype", TEXT)
)
TASK_SYNC_STATE = get(_TASK, "type=program-pointer|motion-pointer", resource="task-sync-state").shows(
    SYNC_STATE.answered
)
ACTIVATE = post(_TASK, "activate", respects="rapid", grant=Grant.RAPID_DEBUG)
DEACTIVATE = post(_TASK, "deactivate", respects="rapid", grant=Grant.RAPID_DEBUG)
LOAD_MODULE = post(_TASK, "loadmod", "modulepath, replace=true|false", needs="rapid", grant=Grant.RAPID_LOADPROGRAM)
UNLOAD_MODULE = post(_TASK, "unloadmod", "module", needs="rapid", grant=Grant.RAPID_LOADPROGRAM)
ABORT_LEVEL = post(_TASK, "abortexeclevel", needs="rapid", grant=Grant.RAPID_EXECUTE)
BUILD = post(_TASK, "build", needs="rapid")
HOLD_TASK_TO_RUN = post(_TASK, "holdtorun", "state=press|held|release", grant=Grant.RAPID_DEBUG, status=403)
CHANGE_COUNT = get(f"{_TASK}/structural-changecount").shows(
    single("task-struc-change-count", "struc-change-count", WHOLE)
)
ACTIVATION_RECORD = get(f"{_TASK}/activation-record", "stackframe")
ROUTINES_OF_TASK = get(f"{_TASK}/serviceroutine", "start, limit, allread=TRUE|FALSE").shows(
    single("rap-task-routine", "routine-name", TEXT)
)
TASK_EXECUTION = get(f"{_TASK}/execution").shows(record("rap-task-execution", TaskPlace))
MOTION = get(f"{_TASK}/motion")
MOTION_TARGET = get(f"{_TASK}/motion", "tool, wobj", resource="robtarget").shows(
    target_answer("rapid-robtarget", TURNS_OF_TARGET, _EXTERNAL)
)
MOTION_JOINTS = get(f"{_TASK}/motion", resource="jointtarget").shows(joint_answer("rapid-jointtarget", "j", _EXTERNAL))
MOTION_UNITS = get(f"{_TASK}/motion", resource="mechunit")
EXTRA_JOINTS = get(f"{_TASK}/motion", resource="extjointstate").shows(single("rapid-extjointstate", "j", _SIX))
PROGRAM = get(f"{_TASK}/program", "continue-on-err=0|1").shows(record("rap-program", ProgramInfo))
LOAD_PROGRAM = post(
    f"{_TASK}/program", "loadprog", "progpath, loadmode=add|replace", needs="rapid", grant=Grant.RAPID_LOADPROGRAM
)
UNLOAD_PROGRAM = post(f"{_TASK}/program", "unloadprog", needs="rapid", grant=Grant.RAPID_LOADPROGRAM)
SAVE_PROGRAM = post(f"{_TASK}/program", "save", "path", grant=Grant.BACKUP)
SET_PROGRAM_NAME = post(f"{_TASK}/program", "setname", "name", respects="rapid", grant=Grant.RAPID_EDIT)
SET_ENTRY = post(f"{_TASK}/program", "set-entrypoint", "routine", needs="rapid", grant=Grant.RAPID_EDIT)
BUILD_ERRORS = get(f"{_TASK}/program/builderror", "start, limit").shows(record("rap-builderrs", BuildError))
BREAKPOINTS = get(f"{_TASK}/program/breakpoint", "start, limit").shows(record("rap-program-breakpoint", Breakpoint))
SET_BREAKPOINT = post(
    f"{_TASK}/program/breakpoint", "set", "module, row, column", needs="rapid", grant=Grant.RAPID_DEBUG
)
TASK_BREAKPOINTS = get(f"{_TASK}/breakpoints")
POINTERS = get(f"{_TASK}/pcp").shows(record("pcp-info", Pointer))
SET_PP_CURSOR = post(
    f"{_TASK}/pcp", "set-pp-cursor", "module, routine, line, column", needs="rapid", grant=Grant.RAPID_DEBUG
)
SET_PP_ROUTINE = post(
    f"{_TASK}/pcp", "set-pp-routine", "module, routine, userlevel=true|false", needs="rapid", grant=Grant.RAPID_DEBUG
)
SET_PP_ROUTINE_FROM_URL = post(
    f"{_TASK}/pcp",
    "set-pp-routine-from-url",
    "module, routine, userlevel=true|false",
    needs="rapid",
    grant=Grant.RAPID_DEBUG,
)
SET_PP_PREV_INST = post(f"{_TASK}/pcp", "set-pp-prev-inst", grant=Grant.RAPID_DEBUG, status=400)
SET_PP_NEXT_INST = post(f"{_TASK}/pcp", "set-pp-next-inst", grant=Grant.RAPID_DEBUG, status=400)
TASK_SELECTION = get("/rw/rapid/taskselection").shows(single("rap-taskselection", "user-modify", flag()))
ALIASES = get("/rw/rapid/aliasio", "start, limit")
DIALOGS = get(_DIALOGS)
ACTIVE_DIALOG = get(f"{_DIALOGS}/active").shows(record("rap-uiactive-li", Dialog))
DIALOG_PARAMETERS = get(f"{_DIALOGS}/active/params/{{stack:.+}}")
DIALOG_PARAMETER = get(f"{_DIALOGS}/active/param/{{stack:.+}}").shows(single("rap-uiparam", "value", TEXT))
ANSWER_DIALOG = post(f"{_DIALOGS}/active/param/{{stack:.+}}", "set", "value")
