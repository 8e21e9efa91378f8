"""Operations on RAPID (``/rw/rapid``): execution, tasks, modules, pointers (PP), stack, breakpoints, dialogs.

With the client's calls of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from abb_protocols.errors import ControllerRefused
from abb_protocols.robot.joints import Joints
from abb_protocols.rws.documents import RwsState, member
from abb_protocols.rws.operations.modules import TextRange, text_range_in
from abb_protocols.rws.operations.motion import TURNS_OF_TARGET, RobTarget, joint_answer, target_answer
from abb_protocols.rws.operations.operation import get, post
from abb_protocols.rws.operations.operation_answer import TEXT, WHOLE, Spelling, flag, record, single
from abb_protocols.rws.operations.service import Service
from abb_protocols.rws.values import ExecutionState, Grant, Regain, RunCycle, RwsCode, Step, StopMode, TaskExecution

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
class StackFrame:
    """One call that is under way in a task; ``level`` is Normal, Trap, User or Service."""

    level: Annotated[str, "execlevel"]
    range: Annotated[TextRange, text_range_in("beg-row", "beg-col", "end-row", "end-col")]
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


def _read_range(state: RwsState, name: str) -> TextRange | None:
    parts = f"{state.fields.get('beginposition', '')},{state.fields.get('endposition', '')}".split(",")
    return TextRange(*map(int, parts)) if all(part.isdecimal() for part in parts) else None


def _write_range(name: str, at: TextRange | None) -> dict[str, str]:
    if at is None:
        return {}
    return {"beginposition": f"{at.row},{at.column}", "endposition": f"{at.end_row},{at.end_column}"}


@dataclass(frozen=True, slots=True)
class Pointer:
    """Where a program pointer or motion pointer stands; ``range`` is None where it is nowhere."""

    range: Annotated[TextRange | None, Spelling(_read_range, _write_range)]
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
    range: Annotated[TextRange, text_range_in("start-row", "start-col", "end-row", "end-col")]


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
START_EXECUTION = post(
    _EXECUTION,
    "start",
    "regain=continue|regain|clear, "
    "execmode=continue|stepin|stepover|stepout|stepback|steplast|stepmotion, "
    "cycle=forever|asis|once, condition=none|callchain, stopatbp=disabled|enabled, "
    "alltaskbytsp=true|false",
    grant=Grant.RAPID_EXECUTE,
)
STOP_EXECUTION = post(_EXECUTION, "stop", "stopmode=cycle|instr|stop|qstop, usetsp=normal|alltsk")
START_PRODUCTION = post(_EXECUTION, "startprodentry", grant=Grant.RAPID_EXECUTE)
MOVE_PP_TO_MAIN = post(_EXECUTION, "resetpp", grant=Grant.RAPID_EXECUTE)
SET_EXECUTION_CYCLE = post(_EXECUTION, "setcycle", "cycle=once|forever|asis", needs="rapid", grant=Grant.RAPID_EXECUTE)
HOLD_TO_RUN = post(_EXECUTION, "holdtorun-state", "state=press|held|release", grant=Grant.RAPID_DEBUG, status=403)
TASKS = get(_TASKS, "continue-on-err=0|1").shows(record("rap-task-li", TaskInfo))
TASK_SPY = get(_TASKS, resource="spy-status").shows(single("rap-spy-status", "status", _LOGGING))
POINTER_SYNC_STATE = get(_TASKS, "type=program-pointer|motion-pointer", resource="sync-state").shows(
    single("rap-sync-state", "Program-Pointer-State", flag("ON", "OFF"))
)
ACTIVATE_ALL_TASKS = post(_TASKS, "activate", respects="rapid", grant=Grant.RAPID_DEBUG)
DEACTIVATE_ALL_TASKS = post(_TASKS, "deactivate", respects="rapid", grant=Grant.RAPID_DEBUG)
START_SPY = post(_TASKS, "start-spy", "log-file", status=400)
STOP_SPY = post(_TASKS, "stop-spy", status=400)
TASK = get(_TASK, "continue-on-err=0|1").shows(record("rap-task", TaskDetails))
STACK_FRAME = get(_TASK, "stackframe", resource="activation-record").shows(record("rap-stackframe", StackFrame))
TASK_CHANGE_COUNT_TOO = get(_TASK, resource="task-struc-change-count")
PREFERRED_TYPES = get(_TASK, "instruction, parameter", resource="pref-data-types").shows(
    single("task-pref-data-types", "type-prefdattype", TEXT)
)
TASK_SYNC_STATE = get(_TASK, "type=program-pointer|motion-pointer", resource="task-sync-state").shows(
    POINTER_SYNC_STATE.answered
)
ACTIVATE_TASK = post(_TASK, "activate", respects="rapid", grant=Grant.RAPID_DEBUG)
DEACTIVATE_TASK = post(_TASK, "deactivate", respects="rapid", grant=Grant.RAPID_DEBUG)
LOAD_MODULE = post(_TASK, "loadmod", "modulepath, replace=true|false", needs="rapid", grant=Grant.RAPID_LOADPROGRAM)
UNLOAD_MODULE = post(_TASK, "unloadmod", "module", needs="rapid", grant=Grant.RAPID_LOADPROGRAM)
ABORT_EXECUTION_LEVEL = post(_TASK, "abortexeclevel", needs="rapid", grant=Grant.RAPID_EXECUTE)
BUILD_PROGRAM = post(_TASK, "build", needs="rapid")
HOLD_TASK_TO_RUN = post(_TASK, "holdtorun", "state=press|held|release", grant=Grant.RAPID_DEBUG, status=403)
TASK_CHANGE_COUNT = get(f"{_TASK}/structural-changecount").shows(
    single("task-struc-change-count", "struc-change-count", WHOLE)
)
ACTIVATION_RECORD = get(f"{_TASK}/activation-record", "stackframe")
ROUTINES_OF_TASK = get(f"{_TASK}/serviceroutine", "start, limit, allread=TRUE|FALSE").shows(
    single("rap-task-routine", "routine-name", TEXT)
)
TASK_EXECUTION = get(f"{_TASK}/execution").shows(record("rap-task-execution", TaskPlace))
TASK_MOTION = get(f"{_TASK}/motion")
TASK_TARGET = get(f"{_TASK}/motion", "tool, wobj", resource="robtarget").shows(
    target_answer("rapid-robtarget", TURNS_OF_TARGET, _EXTERNAL)
)
TASK_JOINTS = get(f"{_TASK}/motion", resource="jointtarget").shows(joint_answer("rapid-jointtarget", "j", _EXTERNAL))
TASK_UNITS = get(f"{_TASK}/motion", resource="mechunit")
TASK_EXTRA_JOINTS = get(f"{_TASK}/motion", resource="extjointstate").shows(single("rapid-extjointstate", "j", _SIX))
PROGRAM = get(f"{_TASK}/program", "continue-on-err=0|1").shows(record("rap-program", ProgramInfo))
LOAD_PROGRAM = post(
    f"{_TASK}/program", "loadprog", "progpath, loadmode=add|replace", needs="rapid", grant=Grant.RAPID_LOADPROGRAM
)
UNLOAD_PROGRAM = post(f"{_TASK}/program", "unloadprog", needs="rapid", grant=Grant.RAPID_LOADPROGRAM)
SAVE_PROGRAM = post(f"{_TASK}/program", "save", "path", grant=Grant.BACKUP)
SET_PROGRAM_NAME = post(f"{_TASK}/program", "setname", "name", respects="rapid", grant=Grant.RAPID_EDIT)
SET_PROGRAM_ENTRY = post(f"{_TASK}/program", "set-entrypoint", "routine", needs="rapid", grant=Grant.RAPID_EDIT)
PROGRAM_BUILD_ERRORS = get(f"{_TASK}/program/builderror", "start, limit").shows(record("rap-builderrs", BuildError))
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
RAPID_IO_ALIASES = get("/rw/rapid/aliasio", "start, limit")
DIALOGS = get(_DIALOGS)
ACTIVE_DIALOG = get(f"{_DIALOGS}/active").shows(record("rap-uiactive-li", Dialog))
DIALOG_PARAMETERS = get(f"{_DIALOGS}/active/params/{{stack:.+}}")
DIALOG_PARAMETER = get(f"{_DIALOGS}/active/param/{{stack:.+}}").shows(single("rap-uiparam", "value", TEXT))
ANSWER_DIALOG = post(f"{_DIALOGS}/active/param/{{stack:.+}}", "set", "value")


class RapidService(Service):
    """``/rw/rapid`` without the texts of modules, and symbols; RAPID must be stopped while modules are loaded.

    While it runs, a RAPID program loads modules itself (``runModuleLoad`` of the state machine).
    """

    def execution(self) -> ExecutionState:
        """Whether RAPID runs."""
        return self._answer("reading the RAPID execution", EXECUTION).state

    def start_rapid(
        self,
        *,
        cycle: RunCycle = RunCycle.FOREVER,
        step: Step = Step.CONTINUE,
        regain: Regain = Regain.CONTINUE,
        stop_at_breakpoints: bool = False,
        all_tasks: bool = False,
    ) -> None:
        """Start RAPID from where the program pointers are.

        Args:
            cycle: whether the program begins again at its end.
            step: how far it executes.
            regain: what happens first where a robot has left its path.
            stop_at_breakpoints: whether execution stops there.
            all_tasks: all that the task panel selects, not only the normal ones.
        """
        self._call(
            "starting RAPID",
            START_EXECUTION,
            regain=regain,
            execmode=step,
            cycle=cycle,
            condition="none",
            stopatbp="enabled" if stop_at_breakpoints else "disabled",
            alltaskbytsp=all_tasks,
        )

    def stop_rapid(self, mode: StopMode = StopMode.STOP, *, all_tasks: bool = False) -> None:
        """Stop RAPID in all selected tasks; ``all_tasks`` stops static ones, too."""
        self._call("stopping RAPID", STOP_EXECUTION, stopmode=mode, usetsp="alltsk" if all_tasks else "normal")

    def move_pp_to_main(self) -> None:
        """Move the program pointer of every selected task to ``main``; RAPID must be stopped."""
        self._call("moving the program pointers to main", MOVE_PP_TO_MAIN)

    def run_cycle(self) -> RunCycle:
        """Whether a program begins again at its end."""
        return self._answer("reading the run cycle", EXECUTION).cycle

    def set_run_cycle(self, cycle: RunCycle) -> None:
        """Whether a program begins again at its end, from the next start on."""
        self._call("setting the run cycle", SET_EXECUTION_CYCLE, cycle=cycle)

    def start_from_production_entry(self) -> None:
        """Start every normal task at its production entry."""
        self._call("starting RAPID at the production entries", START_PRODUCTION)

    def may_select_tasks(self) -> bool:
        """Whether the task panel lets its selection be changed."""
        return self._answer("reading the task selection", TASK_SELECTION)

    def alias_signals(self) -> dict[str, str]:
        """Signals by their alias names in RAPID (AliasIO)."""
        states = self._listed("reading the alias signals", RAPID_IO_ALIASES)
        return {state.title: state.fields.get("signal", state.fields.get("name", "")) for state in states}

    # Tasks

    def tasks(self) -> tuple[TaskInfo, ...]:
        """The RAPID tasks, in the controller's order."""
        return self._answers("reading the RAPID tasks", TASKS)

    def task(self, task: str) -> TaskDetails:
        """One task in full."""
        return self._answer(f"reading the task {task}", TASK, task)

    def select_task(self, task: str, is_selected: bool) -> None:
        """Switch a task on or off in the task panel; it starts with the others if it is on."""
        operation = ACTIVATE_TASK if is_selected else DEACTIVATE_TASK
        self._call(f"switching {task} {'on' if is_selected else 'off'}", operation, task)

    def select_all_tasks(self, are_selected: bool) -> None:
        """Switch all tasks on or off in the task panel."""
        operation = ACTIVATE_ALL_TASKS if are_selected else DEACTIVATE_ALL_TASKS
        self._call(f"switching all tasks {'on' if are_selected else 'off'}", operation)

    def task_change_count(self, task: str) -> int:
        """Rises with every change of the task's modules."""
        return self._answer(f"reading the change count of {task}", TASK_CHANGE_COUNT, task)

    def is_synchronized(self, task: str = "") -> bool:
        """Whether a task, or each of all, is in a synchronised motion (SyncMoveOn)."""
        where = (TASK_SYNC_STATE, task) if task else (POINTER_SYNC_STATE,)
        return all(self._answers("reading the synchronisation", *where, type="program-pointer"))

    def is_spy_running(self) -> bool:
        """Whether RAPID Spy logs each instruction."""
        return self._answer("reading the spy", TASK_SPY)

    def stack_frame(self, task: str, number: int = 1) -> StackFrame:
        """A call that is under way in a task; 1 is the innermost."""
        return self._answer(f"reading the calls of {task}", STACK_FRAME, task, stackframe=number)

    def service_routines(self, task: str) -> tuple[str, ...]:
        """Routines without parameters, which can be called from the FlexPendant."""
        return self._answers(f"reading the routines of {task}", ROUTINES_OF_TASK, task, start=1, limit=100)

    def preferred_type(self, task: str, instruction: str, parameter: str) -> str:
        """The type of data that an instruction's parameter takes."""
        what, place = f"reading the type of {parameter} of {instruction}", PREFERRED_TYPES
        return self._answer(what, place, task, instruction=instruction, parameter=parameter)

    def abort_execution_level(self, task: str) -> None:
        """Leave a service routine or a call from outside that is under way in a task."""
        self._call(f"leaving the execution level of {task}", ABORT_EXECUTION_LEVEL, task)

    def task_place(self, task: str) -> tuple[str, str, int]:
        """Module, routine and line that a task executes."""
        place = self._answer(f"reading where {task} is", TASK_EXECUTION, task)
        return place.module, place.routine, place.line

    def task_rob_target(self, task: str, tool: str = "", work_object: str = "") -> RobTarget:
        """Where the robot of a task stands; tool and work object are the active ones where none are named."""
        frames = {"tool": tool or None, "wobj": work_object or None}
        return self._answer(f"reading the position of {task}", TASK_TARGET, task, **frames)

    def task_joint_target(self, task: str) -> Joints:
        """Where the arm of a task stands, chain order [rad]."""
        return self._answer(f"reading the joints of {task}", TASK_JOINTS, task).chain()

    def task_units(self, task: str) -> tuple[str, ...]:
        """The mechanical units that a task moves."""
        states = self._listed(f"reading the units of {task}", TASK_UNITS, task)
        return tuple(state.text("name") for state in states if state.type == "rapid-mechunit")

    def external_joints(self, task: str) -> tuple[str, ...]:
        """What each of the six external axes is: ``rotating``, ``linear`` or ``not_active``."""
        return self._answer(f"reading the external axes of {task}", TASK_EXTRA_JOINTS, task)

    # Programs

    def program(self, task: str) -> ProgramInfo | None:
        """The program of a task; None where there is none."""
        what = f"reading the program of {task}"
        reply = self._call(what, PROGRAM, task)
        return PROGRAM.answered.of(self._page(reply, what)) if reply.content else None

    def load_program(self, task: str, path: str, *, replace: bool = True) -> None:
        """Load a program file of the controller such as ``HOME:/pick.pgf``; RAPID must be stopped."""
        mode = "replace" if replace else "add"
        self._call(f"loading {path} into {task}", LOAD_PROGRAM, task, progpath=path, loadmode=mode)

    def unload_program(self, task: str) -> None:
        """Remove the program modules of a task; RAPID must be stopped."""
        self._call(f"unloading the program of {task}", UNLOAD_PROGRAM, task)

    def save_program(self, task: str, path: str) -> None:
        """Write the program of a task into a directory of the controller."""
        self._call(f"saving the program of {task}", SAVE_PROGRAM, task, path=path)

    def rename_program(self, task: str, name: str) -> None:
        """Give the program of a task another name."""
        self._call(f"renaming the program of {task}", SET_PROGRAM_NAME, task, name=name)

    def set_entry(self, task: str, routine: str) -> None:
        """Let the program of a task begin at another routine than ``main``."""
        self._call("setting the entry", SET_PROGRAM_ENTRY, task, routine=routine)

    def build(self, task: str) -> tuple[BuildError, ...]:
        """Link the program of a task; its faults, none if it is free of them."""
        try:
            self._call(f"linking the program of {task}", BUILD_PROGRAM, task)
        except ControllerRefused as error:
            if error.code not in (RwsCode.SEMANTIC, RwsCode.SYNTAX):
                raise
        return self.build_errors(task)

    def build_errors(self, task: str) -> tuple[BuildError, ...]:
        """Faults found when the program was linked."""
        return self._answers(f"reading the faults of {task}", PROGRAM_BUILD_ERRORS, task)

    # Modules

    def load_module(self, task: str, path: str, replace: bool = True) -> None:
        """Load a file of the controller, such as ``HOME:/pick.mod``, as a module of ``task``.

        Args:
            task: such as ``T_ROB_R``.
            path: the file as RAPID names it.
            replace: whether it may take the place of a module of the same name.
        """
        self._call(f"loading {path} into {task}", LOAD_MODULE, task, modulepath=path, replace=replace)

    def unload_module(self, task: str, name: str) -> None:
        """Remove a module from ``task``."""
        self._call(f"unloading {name} from {task}", UNLOAD_MODULE, task, module=name)

    # Breakpoints

    def breakpoints(self, task: str) -> tuple[tuple[str, TextRange], ...]:
        """Module and place of each breakpoint."""
        found = self._answers(f"reading the breakpoints of {task}", BREAKPOINTS, task)
        return tuple((each.module, each.range) for each in found)

    def set_breakpoint(self, task: str, module: str, row: int, column: int = 1) -> None:
        """Let execution stop at a place of the text, if it is started with ``stop_at_breakpoints``."""
        self._call("setting a breakpoint", SET_BREAKPOINT, task, module=module, row=row, column=column)

    # Program pointers

    def pointers(self, task: str) -> tuple[Pointer, Pointer]:
        """Where the program pointer and the motion pointer of a task stand."""
        listed = self._listed(f"reading the pointers of {task}", POINTERS, task)
        states = {state.title: POINTERS.answered.read(state) for state in listed}
        nowhere = Pointer(None)
        return states.get("progpointer", nowhere), states.get("motionpointer", nowhere)

    def move_pp_to_cursor(self, task: str, module: str, routine: str, row: int, column: int = 1) -> None:
        """Move a task's program pointer to a place in a routine; RAPID must be stopped."""
        place = {"module": module, "routine": routine, "line": row, "column": column}
        self._call(f"moving the program pointer of {task}", SET_PP_CURSOR, task, **place)

    def move_pp_to_routine(self, task: str, module: str, routine: str, *, keeps_calls: bool = False) -> None:
        """Move a task's program pointer to a routine; RAPID must be stopped.

        Args:
            task: such as ``T_ROB_R``.
            module: in which the routine is.
            routine: its name, or its address such as ``RAPID/T_ROB_R/Pick/pick``.
            keeps_calls: as a call on the user level, from which execution returns to where it was.
        """
        operation = SET_PP_ROUTINE_FROM_URL if "/" in routine else SET_PP_ROUTINE
        place = {"module": module, "routine": routine, "userlevel": keeps_calls}
        self._call(f"moving the program pointer of {task}", operation, task, **place)

    # Dialogs

    def dialog(self) -> Dialog | None:
        """What a program asks on the FlexPendant (``TPReadNum``, ``UIMessageBox`` …); None where it asks nothing."""
        try:
            return self._answer("reading the dialog", ACTIVE_DIALOG)
        except ControllerRefused as error:
            if error.code != RwsCode.UI_NOT_ACTIVE:
                raise
            return None

    def dialog_parameters(self, stack: str) -> dict[str, str]:
        """The arguments of a dialog's instruction as RAPID literals."""
        states = self._listed("reading the dialog", DIALOG_PARAMETERS, stack)
        return {state.text("name"): state.text("value") for state in states}

    def dialog_parameter(self, stack: str, name: str) -> str:
        """One argument of a dialog's instruction as RAPID literal."""
        return self._answer("reading the dialog", DIALOG_PARAMETER, f"{stack}/{name}")

    def answer_dialog(self, stack: str, literal: str, name: str = "Result") -> None:
        """Answer a dialog: the literal of a number or a string, whatever it asks for."""
        self._call("answering the dialog", ANSWER_DIALOG, f"{stack}/{name}", value=literal)
