"""RAPID: its execution, its data, and message queues to and from its tasks.

:class:`Rapid` has execution, tasks, programs, modules and their text, program pointers and dialogs; :class:`Symbols`
values, types, properties and search of RAPID data; :class:`Queues` the messages between clients and tasks (DIPC, RMQ).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from yumi.errors import ControllerRefused
from yumi.robot.joints import Joints
from yumi.rws import documents
from yumi.rws.documents import ModuleInfo, RobTarget, State, TaskInfo, joint_target_of, member, rob_target_of
from yumi.rws.session import Request, Requests, get, given, post
from yumi.rws.types import Code, ExecutionState, RapidValue, TaskExecution, decode, encode

LONGEST_MESSAGE = 444
"""Of a queue's message [byte]."""

_EXECUTION = "/rw/rapid/execution"
_TASKS = "/rw/rapid/tasks"
_MODULES = "/rw/rapid/modules"
_SYMBOLS = "/rw/rapid/symbol"
_DIPC = "/rw/dipc"
_MS = 1000.0
_BAD_VALUE = 400


class Regain(Enum):
    """What happens first where a robot has left its path."""

    CONTINUE = "continue"
    REGAIN = "regain"
    CLEAR = "clear"


class Step(Enum):
    """How far a start executes."""

    CONTINUE = "continue"
    IN = "stepin"
    OVER = "stepover"
    OUT = "stepout"
    BACK = "stepback"
    LAST = "steplast"
    MOTION = "stepmotion"


class RunCycle(Enum):
    """Whether a program begins again at its end."""

    FOREVER = "forever"
    AS_IS = "asis"
    ONCE = "once"
    ONCE_DONE = "oncedone"


class StopMode(Enum):
    """Where execution stops: at the end of the cycle, of the instruction, at once on the path, or beside it."""

    CYCLE = "cycle"
    INSTRUCTION = "instr"
    STOP = "stop"
    QUICK = "qstop"


@dataclass(frozen=True, slots=True)
class TaskDetails:
    """One RAPID task in full.

    Attributes:
        name: of the task.
        type: ``Normal``, ``Static`` or ``SemiStatic``.
        trust: what stops when the task does, such as ``SysFail``.
        entry: routine at which production begins.
        execution: its state.
        is_active: whether it is selected in the task panel.
        is_motion_task: whether it moves a mechanical unit.
    """

    name: str
    type: str
    trust: str
    entry: str
    execution: TaskExecution
    is_active: bool
    is_motion_task: bool


@dataclass(frozen=True, slots=True)
class Range:
    """A part of a module's text; rows and columns count from 1, the end included."""

    row: int
    column: int
    end_row: int
    end_column: int


@dataclass(frozen=True, slots=True)
class Pointer:
    """Where a program pointer or motion pointer stands; ``range`` is None where it is nowhere."""

    module: str
    routine: str
    range: Range | None


@dataclass(frozen=True, slots=True)
class StackFrame:
    """One call that is under way in a task; ``level`` is Normal, Trap, User or Service."""

    module: str
    routine: str
    level: str
    range: Range


@dataclass(frozen=True, slots=True)
class ProgramInfo:
    """The program of a task."""

    name: str
    entry: str


@dataclass(frozen=True, slots=True)
class BuildError:
    """A fault in a module, found when the program was linked."""

    module: str
    row: int
    column: int
    message: str


@dataclass(frozen=True, slots=True)
class ModuleDetails:
    """One module: its file, and its attributes such as SYSMODULE."""

    name: str
    file: str
    attributes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Routine:
    """A routine; type is ``prc``, ``fun`` or ``trp``."""

    name: str
    type: str
    is_local: bool
    parameters: int


@dataclass(frozen=True, slots=True)
class Dialog:
    """A question of a program on the FlexPendant; ``stack`` names it for ``dialog_parameters``."""

    instruction: str
    message: str
    stack: str


class Rapid(Requests):
    """``/rw/rapid`` without its symbols."""

    def execution(self) -> ExecutionState:
        """Whether RAPID runs."""
        return self._read(get(_EXECUTION), documents.read_execution, "reading the RAPID execution")

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
        form = (
            ("regain", regain.value),
            ("execmode", step.value),
            ("cycle", cycle.value),
            ("condition", "none"),
            ("stopatbp", "enabled" if stop_at_breakpoints else "disabled"),
            ("alltaskbytsp", "true" if all_tasks else "false"),
        )
        self._do(post(_EXECUTION, "start", *form), "starting RAPID")

    def stop_rapid(self, mode: StopMode = StopMode.STOP, *, all_tasks: bool = False) -> None:
        """Stop RAPID in all selected tasks; ``all_tasks`` stops static ones, too."""
        form = (("stopmode", mode.value), ("usetsp", "alltsk" if all_tasks else "normal"))
        self._do(post(_EXECUTION, "stop", *form), "stopping RAPID")

    def move_pp_to_main(self) -> None:
        """Move the program pointer of every selected task to ``main``; RAPID must be stopped."""
        self._do(post(_EXECUTION, "resetpp"), "moving the program pointers to main")

    def tasks(self) -> tuple[TaskInfo, ...]:
        """The RAPID tasks, in the controller's order."""
        return self._read(get(_TASKS), documents.read_tasks, "reading the RAPID tasks")

    def modules(self, task: str) -> tuple[ModuleInfo, ...]:
        """The RAPID modules loaded in ``task``."""
        states = self._states(f"reading the modules of {task}", _MODULES, ("task", task))
        return tuple(
            ModuleInfo(state.text("name"), state.text("type")) for state in states if state.type == "rap-module-info-li"
        )

    def module_text(self, task: str, module: str) -> str:
        """The text of a module that is loaded, as the controller writes it: PERS data have their present values."""
        request = get(f"{_MODULES}/{module}", ("resource", "module-text"), ("task", task))
        return self._read(request, documents.read_module_text, f"reading the module {module} of {task}")

    def load_module(self, task: str, path: str, replace: bool = True) -> None:
        """Load a file of the controller, such as ``HOME:/pick.mod``, as a module of ``task``.

        RAPID must be stopped; while it runs, a RAPID program loads modules itself (``runModuleLoad`` of the state
        machine).

        Args:
            task: such as ``T_ROB_R``.
            path: the file as RAPID names it.
            replace: whether it may take the place of a module of the same name.
        """
        with self.holding("rapid"):
            form = (("modulepath", path), ("replace", "true" if replace else "false"))
            self._do(post(f"{_TASKS}/{task}", "loadmod", *form), f"loading {path} into {task}")

    def unload_module(self, task: str, name: str) -> None:
        """Remove a module from ``task``; RAPID must be stopped."""
        with self.holding("rapid"):
            self._do(post(f"{_TASKS}/{task}", "unloadmod", ("module", name)), f"unloading {name} from {task}")

    def run_cycle(self) -> RunCycle:
        """Whether a program begins again at its end."""
        return self._state("reading the run cycle", _EXECUTION, "rap-execution").member(RunCycle, "cycle")

    def set_run_cycle(self, cycle: RunCycle) -> None:
        """Whether a program begins again at its end, from the next start on."""
        with self.holding("rapid"):
            self._do(post(_EXECUTION, "setcycle", ("cycle", cycle.value)), "setting the run cycle")

    def start_from_production_entry(self) -> None:
        """Start every normal task at its production entry."""
        self._do(post(_EXECUTION, "startprodentry"), "starting RAPID at the production entries")

    def may_select_tasks(self) -> bool:
        """Whether the task panel lets its selection be changed."""
        what = "reading the task selection"
        return self._state(what, "/rw/rapid/taskselection", "rap-taskselection").flag("user-modify")

    def alias_signals(self) -> dict[str, str]:
        """Signals by their alias names in RAPID (AliasIO)."""
        states = self._states("reading the alias signals", "/rw/rapid/aliasio")
        return {state.title: state.fields.get("signal", state.fields.get("name", "")) for state in states}

    # Tasks

    def task(self, task: str) -> TaskDetails:
        """One task in full."""
        state = self._state(f"reading the task {task}", f"{_TASKS}/{task}", "rap-task")
        return TaskDetails(
            name=state.text("name"),
            type=state.text("tasktype"),
            trust=state.fields.get("trust", ""),
            entry=state.fields.get("prodentrypt", ""),
            execution=member(TaskExecution, state.text("excstate")[:4].lower()),
            is_active=state.flag("active"),
            is_motion_task=state.flag("motiontask"),
        )

    def select_task(self, task: str, is_selected: bool) -> None:
        """Switch a task on or off in the task panel; it starts with the others if it is on."""
        action = "activate" if is_selected else "deactivate"
        self._do(post(f"{_TASKS}/{task}", action), f"switching {task} {'on' if is_selected else 'off'}")

    def select_all_tasks(self, are_selected: bool) -> None:
        """Switch all tasks on or off in the task panel."""
        action = "activate" if are_selected else "deactivate"
        self._do(post(_TASKS, action), f"switching all tasks {'on' if are_selected else 'off'}")

    def task_change_count(self, task: str) -> int:
        """Rises with every change of the task's modules."""
        what = f"reading the change count of {task}"
        path = f"{_TASKS}/{task}/structural-changecount"
        return self._state(what, path, "task-struc-change-count").whole("struc-change-count")

    def is_synchronized(self, task: str = "") -> bool:
        """Whether a task, or each of all, is in a synchronised motion (SyncMoveOn)."""
        where, resource = (f"{_TASKS}/{task}", "task-sync-state") if task else (_TASKS, "sync-state")
        states = self._states("reading the synchronisation", where, ("resource", resource), ("type", "program-pointer"))
        return all(state.flag("Program-Pointer-State") for state in states)

    def is_spy_running(self) -> bool:
        """Whether RAPID Spy logs each instruction."""
        state = self._state("reading the spy", _TASKS, "rap-spy-status", ("resource", "spy-status"))
        return state.text("status").lower() == "logging"

    def stack_frame(self, task: str, number: int = 1) -> StackFrame:
        """A call that is under way in a task; 1 is the innermost."""
        query = (("resource", "activation-record"), ("stackframe", str(number)))
        state = self._state(f"reading the calls of {task}", f"{_TASKS}/{task}", "rap-stackframe", *query)
        place = Range(*(state.whole(name) for name in ("beg-row", "beg-col", "end-row", "end-col")))
        url, _, routine = state.text("routine-url").rpartition("/")
        return StackFrame(url.rpartition("/")[2], routine, state.text("execlevel"), place)

    def service_routines(self, task: str) -> tuple[str, ...]:
        """Routines without parameters, which can be called from the FlexPendant."""
        what = f"reading the routines of {task}"
        states = self._states(what, f"{_TASKS}/{task}/serviceroutine", ("start", "1"), ("limit", "100"))
        return tuple(state.text("routine-name") for state in states)

    def preferred_type(self, task: str, instruction: str, parameter: str) -> str:
        """The type of data that an instruction's parameter takes."""
        query = (("resource", "pref-data-types"), ("instruction", instruction), ("parameter", parameter))
        what = f"reading the type of {parameter} of {instruction}"
        return self._state(what, f"{_TASKS}/{task}", "task-pref-data-types", *query).text("type-prefdattype")

    def abort_execution_level(self, task: str) -> None:
        """Leave a service routine or a call from outside that is under way in a task."""
        with self.holding("rapid"):
            self._do(post(f"{_TASKS}/{task}", "abortexeclevel"), f"leaving the execution level of {task}")

    def task_place(self, task: str) -> tuple[str, str, int]:
        """Module, routine and line that a task executes."""
        state = self._state(f"reading where {task} is", f"{_TASKS}/{task}/execution", "rap-task-execution")
        return state.text("module-name"), state.text("routine-name"), state.whole("line")

    def task_rob_target(self, task: str, tool: str = "", work_object: str = "") -> RobTarget:
        """Where the robot of a task stands; tool and work object are the active ones where none are named."""
        query = (("resource", "robtarget"), *given(tool=tool or None, wobj=work_object or None))
        path = f"{_TASKS}/{task}/motion"
        return rob_target_of(self._state(f"reading the position of {task}", path, "rapid-robtarget", *query))

    def task_joint_target(self, task: str) -> Joints:
        """Where the arm of a task stands, chain order [rad]."""
        query = ("resource", "jointtarget")
        state = self._state(f"reading the joints of {task}", f"{_TASKS}/{task}/motion", "rapid-jointtarget", query)
        return joint_target_of(state, "j", ("ej1", "ej2", "ej3", "ej4", "ej5", "ej6")).chain()

    def task_units(self, task: str) -> tuple[str, ...]:
        """The mechanical units that a task moves."""
        states = self._states(f"reading the units of {task}", f"{_TASKS}/{task}/motion", ("resource", "mechunit"))
        return tuple(state.text("name") for state in states if state.type == "rapid-mechunit")

    def external_joints(self, task: str) -> tuple[str, ...]:
        """What each of the six external axes is: ``rotating``, ``linear`` or ``not_active``."""
        path, query = f"{_TASKS}/{task}/motion", ("resource", "extjointstate")
        state = self._state(f"reading the external axes of {task}", path, "rapid-extjointstate", query)
        return tuple(state.text(f"j{number}") for number in range(1, 7))

    # Programs

    def program(self, task: str) -> ProgramInfo | None:
        """The program of a task; None where there is none."""
        reply = self._session.exchange(get(f"{_TASKS}/{task}/program"))
        self._accepted(reply, f"reading the program of {task}")
        if not reply.content:
            return None
        state = self._page(reply, f"reading the program of {task}").one("rap-program")
        return ProgramInfo(state.text("name"), state.text("entrypoint"))

    def load_program(self, task: str, path: str, *, replace: bool = True) -> None:
        """Load a program file of the controller such as ``HOME:/pick.pgf``; RAPID must be stopped."""
        form = (("progpath", path), ("loadmode", "replace" if replace else "add"))
        with self.holding("rapid"):
            self._do(post(f"{_TASKS}/{task}/program", "loadprog", *form), f"loading {path} into {task}")

    def unload_program(self, task: str) -> None:
        """Remove the program modules of a task; RAPID must be stopped."""
        with self.holding("rapid"):
            self._do(post(f"{_TASKS}/{task}/program", "unloadprog"), f"unloading the program of {task}")

    def save_program(self, task: str, path: str) -> None:
        """Write the program of a task into a directory of the controller."""
        self._do(post(f"{_TASKS}/{task}/program", "save", ("path", path)), f"saving the program of {task}")

    def rename_program(self, task: str, name: str) -> None:
        """Give the program of a task another name."""
        self._do(post(f"{_TASKS}/{task}/program", "setname", ("name", name)), f"renaming the program of {task}")

    def set_entry(self, task: str, routine: str) -> None:
        """Let the program of a task begin at another routine than ``main``."""
        with self.holding("rapid"):
            self._do(post(f"{_TASKS}/{task}/program", "set-entrypoint", ("routine", routine)), "setting the entry")

    def build(self, task: str) -> tuple[BuildError, ...]:
        """Link the program of a task; its faults, none if it is free of them."""
        try:
            with self.holding("rapid"):
                self._do(post(f"{_TASKS}/{task}", "build"), f"linking the program of {task}")
        except ControllerRefused as error:
            if error.code not in (Code.SEMANTIC, Code.SYNTAX):
                raise
        return self.build_errors(task)

    def build_errors(self, task: str) -> tuple[BuildError, ...]:
        """Faults found when the program was linked."""
        states = self._states(f"reading the faults of {task}", f"{_TASKS}/{task}/program/builderror")
        return tuple(
            BuildError(
                state.fields.get("ModuleName", ""), state.whole("row"), state.whole("column"), state.fields["error"]
            )
            for state in states
        )

    def breakpoints(self, task: str) -> tuple[tuple[str, Range], ...]:
        """Module and place of each breakpoint."""
        states = self._states(f"reading the breakpoints of {task}", f"{_TASKS}/{task}/program/breakpoint")
        return tuple(
            (
                state.text("module-name"),
                Range(*(state.whole(name) for name in ("start-row", "start-col", "end-row", "end-col"))),
            )
            for state in states
        )

    def set_breakpoint(self, task: str, module: str, row: int, column: int = 1) -> None:
        """Let execution stop at a place of the text, if it is started with ``stop_at_breakpoints``."""
        form = given(module=module, row=row, column=column)
        with self.holding("rapid"):
            self._do(post(f"{_TASKS}/{task}/program/breakpoint", "set", *form), "setting a breakpoint")

    def clear_breakpoint(self, task: str, module: str, place: Range) -> None:
        """Remove a breakpoint at a place of ``breakpoints``; RAPID must be stopped.

        Its text is replaced by itself, as RobotWare 6 has no request for it. A program pointer in that text is lost.
        """
        self.replace_text(task, module, place, self.module_part(task, module, place))

    # Program pointers

    def pointers(self, task: str) -> tuple[Pointer, Pointer]:
        """Where the program pointer and the motion pointer of a task stand."""
        states = {
            state.title: _pointer(state)
            for state in self._states(f"reading the pointers of {task}", f"{_TASKS}/{task}/pcp")
        }
        nowhere = Pointer("", "", None)
        return states.get("progpointer", nowhere), states.get("motionpointer", nowhere)

    def move_pp_to_cursor(self, task: str, module: str, routine: str, row: int, column: int = 1) -> None:
        """Move a task's program pointer to a place in a routine; RAPID must be stopped."""
        form = given(module=module, routine=routine, line=row, column=column)
        with self.holding("rapid"):
            self._do(post(f"{_TASKS}/{task}/pcp", "set-pp-cursor", *form), f"moving the program pointer of {task}")

    def move_pp_to_routine(self, task: str, module: str, routine: str, *, keeps_calls: bool = False) -> None:
        """Move a task's program pointer to a routine; RAPID must be stopped.

        Args:
            task: such as ``T_ROB_R``.
            module: in which the routine is.
            routine: its name, or its address such as ``RAPID/T_ROB_R/Pick/pick``.
            keeps_calls: as a call on the user level, from which execution returns to where it was.
        """
        action = "set-pp-routine-from-url" if "/" in routine else "set-pp-routine"
        form = given(module=module, routine=routine, userlevel=keeps_calls)
        with self.holding("rapid"):
            self._do(post(f"{_TASKS}/{task}/pcp", action, *form), f"moving the program pointer of {task}")

    # Modules

    def module(self, task: str, module: str) -> ModuleDetails:
        """File and attributes of a module that is loaded."""
        state = self._state(f"reading {module} of {task}", f"{_MODULES}/{module}", "rap-module", ("task", task))
        attributes = tuple(part for part in state.fields.get("attribute", "").replace(",", " ").split() if part)
        return ModuleDetails(state.text("modname"), state.text("filename"), attributes)

    def module_part(self, task: str, module: str, part: Range) -> str:
        """A part of a module's text; -1 as last column is the end of the row."""
        form = given(task=task, startrow=part.row, startcol=part.column, endrow=part.end_row, endcol=part.end_column)
        return self._state(f"reading {module} of {task}", f"{_MODULES}/{module}", "rap-mod-text", *form).text("text")

    def find_text(self, task: str, module: str, text: str, row: int = 1, column: int = 1) -> tuple[int, int]:
        """Row and column at which ``text`` is found from a place on."""
        query = given(task=task, startrow=row, startcol=column, text=text)
        state = self._state(f"searching {module}", f"{_MODULES}/{module}", "rap-text-position", *query)
        return state.whole("Row"), state.whole("Column")

    def module_object(self, task: str, module: str, row: int, column: int, destination: str = "Inner") -> Range:
        """Place of the statement or declaration at a place of the text, or of one beside it.

        Args:
            task: such as ``T_ROB_R``.
            module: its name.
            row: of the text, from 1.
            column: of the text, from 1.
            destination: ``Inner``, ``Outer``, ``First``, ``Last``, ``Next``, ``Previous`` …
        """
        query = given(task=task, startrow=row, startcol=column, destination=destination)
        state = self._state(f"reading {module}", f"{_MODULES}/{module}", "rap-object", *query)
        names = ("start-row", "start-column", "end-row", "end-column")
        return Range(*(state.whole(name) for name in names))

    def module_change_count(self, task: str, module: str) -> int:
        """Rises with every change of the module's text."""
        query = (("resource", "change-count"), ("task", task))
        state = self._state(f"reading {module}", f"{_MODULES}/{module}", "rap-module-changecount", *query)
        return state.whole("count")

    def module_size(self, task: str, module: str) -> tuple[int, int]:
        """Number of rows, and of columns of the longest."""
        query = (("resource", "module-extension"), ("task", task))
        state = self._state(f"reading {module}", f"{_MODULES}/{module}", "rap-module-extension", *query)
        return state.whole("num-of-lines"), state.whole("max-num-of-col")

    def are_initial_values_current(self, task: str, module: str) -> bool:
        """Whether the initial values in the text are the present values of its PERS data."""
        query = (("resource", "syncper-status"), ("task", task))
        state = self._state(f"reading {module}", f"{_MODULES}/{module}", "rap-syncper-status", *query)
        return state.whole("syncperstatus") == 0

    def symbol_at(self, task: str, module: str, row: int, column: int) -> str:
        """Name of the symbol at a place of the text."""
        query = given(resource="module-symbol", task=task, row=row, col=column)
        state = self._state(f"reading {module}", f"{_MODULES}/{module}", "rap-module-symbol", *query)
        return state.text("symbolname")

    def routine_at(self, task: str, module: str, row: int, column: int = 1) -> Routine:
        """The routine at a place of the text."""
        query = given(task=task, row=row, column=column)
        path = f"{_MODULES}/{module}/routine"
        return _routine(self._state(f"reading {module}", path, "rap-routine-prop", *query))

    def routines(self, task: str, module: str) -> tuple[Routine, ...]:
        """The routines of a module."""
        states = self._states(f"reading the routines of {module}", f"{_MODULES}/{task}/{module}/routines")
        return tuple(_routine(state) for state in states)

    def save_module(self, task: str, module: str, folder: str, name: str = "") -> None:
        """Write a module into a directory of the controller such as ``HOME:/``; ``.mod`` is appended to its name."""
        form = (("name", name or module), ("path", folder))
        request = Request("POST", f"{_MODULES}/{module}", (("task", task), ("action", "save")), form)
        self._do(request, f"saving {module} of {task}")

    def set_module_text(self, task: str, module: str, text: str) -> None:
        """Replace the whole text of a module that is loaded; RAPID must be stopped."""
        query = (("task", task), ("action", "set-module-text"))
        request = Request("POST", f"{_MODULES}/{module}", query, (("text", text),))
        with self.holding("rapid"):
            self._do(request, f"writing {module} of {task}")

    def replace_text(self, task: str, module: str, part: Range, text: str) -> None:
        """Replace a part of a module's text; RAPID must be stopped."""
        form = given(task=task, replace_mode="Replace", query_mode="Force")
        place = given(startrow=part.row, startcol=part.column, endrow=part.end_row, endcol=part.end_column, text=text)
        with self.holding("rapid"):
            self._do(post(f"{_MODULES}/{module}", "set-text-range", *form, *place), f"writing {module} of {task}")

    # Dialogs

    def dialog(self) -> Dialog | None:
        """What a program asks on the FlexPendant (``TPReadNum``, ``UIMessageBox`` …); None where it asks nothing."""
        try:
            state = self._state("reading the dialog", "/rw/rapid/uiinstr/active", "rap-uiactive-li")
        except ControllerRefused as error:
            if error.code != Code.UI_NOT_ACTIVE:
                raise
            return None
        return Dialog(state.text("instr"), state.text("msg"), state.text("stack"))

    def dialog_parameters(self, stack: str) -> dict[str, str]:
        """The arguments of a dialog's instruction as RAPID literals."""
        states = self._states("reading the dialog", f"/rw/rapid/uiinstr/active/params/{stack}")
        return {state.text("name"): state.text("value") for state in states}

    def dialog_parameter(self, stack: str, name: str) -> str:
        """One argument of a dialog's instruction as RAPID literal."""
        path = f"/rw/rapid/uiinstr/active/param/{stack}/{name}"
        return self._state("reading the dialog", path, "rap-uiparam").text("value")

    def answer_dialog(self, stack: str, literal: str, name: str = "Result") -> None:
        """Answer a dialog: the literal of a number or a string, whatever it asks for."""
        path = f"/rw/rapid/uiinstr/active/param/{stack}/{name}"
        self._do(post(path, "set", ("value", literal)), "answering the dialog")


def _pointer(state: State) -> Pointer:
    parts = f"{state.fields.get('beginposition', '')},{state.fields.get('endposition', '')}".split(",")
    place = Range(*map(int, parts)) if all(part.isdecimal() for part in parts) else None
    return Pointer(state.fields.get("modulemame", ""), state.fields.get("routinename", ""), place)


def _routine(state: State) -> Routine:
    return Routine(state.text("name"), state.text("symtyp"), state.flag("local"), state.whole("npar"))


class SymbolKind(Enum):
    """What a RAPID symbol is."""

    ATOMIC = "atm"
    RECORD = "rec"
    ALIAS = "ali"
    COMPONENT = "rcp"
    CONSTANT = "con"
    VARIABLE = "var"
    PERSISTENT = "per"
    PARAMETER = "par"
    LABEL = "lab"
    FOR = "for"
    FUNCTION = "fun"
    PROCEDURE = "prc"
    TRAP = "trp"
    MODULE = "mod"
    TASK = "tsk"
    ANY = "any"


@dataclass(frozen=True, slots=True)
class SymbolInfo:
    """A RAPID symbol.

    Attributes:
        address: such as ``RAPID/T_ROB_R/TRobMain/current_state``.
        name: as it is declared.
        kind: what it is.
        type: of its value, "" where it has none.
        dimensions: of an array, () otherwise.
        is_local: whether other modules do not see it.
        is_read_only: whether it cannot be written.
    """

    address: str
    name: str
    kind: SymbolKind
    type: str
    dimensions: tuple[int, ...]
    is_local: bool
    is_read_only: bool


class Symbols(Requests):
    """``/rw/rapid/symbol`` and ``/rw/rapid/symbols``.

    Where a module is asked for, data of a routine under way are found with ``Hello/wave``, module and routine.
    """

    def symbol(self, task: str, module: str, name: str) -> str:
        """Value of a RAPID symbol as its literal; ``yumi.rws.types`` decodes it."""
        what = f"reading {module}/{name} of {task}"
        return self._read(get(f"{_SYMBOLS}/data/RAPID/{task}/{module}/{name}"), documents.read_symbol, what)

    def value(self, task: str, module: str, name: str) -> RapidValue:
        """Value of a RAPID symbol: a number, bool, string, or a tuple for a record or an array."""
        return decode(self.symbol(task, module, name))

    def set_value(self, task: str, module: str, name: str, value: RapidValue) -> None:
        """Write a RAPID symbol; a record or an array is a tuple.

        Raises:
            CommandRefused: the value has a number that is not finite.
        """
        self.set_symbol(task, module, name, encode(value))

    def symbol_type(self, task: str, module: str, name: str) -> str:
        """Name of a RAPID symbol's type."""
        what = f"reading the type of {module}/{name} of {task}"
        return self._read(get(f"{_SYMBOLS}/properties/RAPID/{task}/{module}/{name}"), documents.read_symbol_type, what)

    def set_symbol(self, task: str, module: str, name: str, literal: str) -> None:
        """Write a RAPID symbol; ``yumi.rws.types`` encodes a literal."""
        self._do(
            post(f"{_SYMBOLS}/data/RAPID/{task}/{module}/{name}", "set", ("value", literal)),
            f"writing {module}/{name} of {task}",
        )

    def symbol_properties(self, task: str, module: str, name: str) -> SymbolInfo:
        """What a symbol is, and of which type."""
        what = f"reading the properties of {module}/{name} of {task}"
        request = get(f"{_SYMBOLS}/properties/RAPID/{task}/{module}/{name}")
        return self._read(request, lambda page: _symbol_info(page.states[0]), what)

    def set_initial_value(self, task: str, module: str, name: str, value: RapidValue) -> None:
        """Write the value that a symbol has in the text of its module."""
        request = post(f"{_SYMBOLS}/data/RAPID/{task}/{module}/{name}", "setInitValue", ("value", encode(value)))
        self._do(request, f"writing the initial value of {module}/{name} of {task}")

    def is_value_of(self, task: str, literal: str, type: str) -> bool:
        """Whether a literal is a value of a RAPID type that is known in a task."""
        try:
            form = given(task=task, value=literal, datatype=type)
            self._do(post(f"{_SYMBOLS}/data", "validate", *form), f"checking a value of {type}")
        except ControllerRefused as error:
            if error.status != _BAD_VALUE:
                raise
            return False
        return True

    def find_symbols(
        self,
        block: str,
        *,
        kind: SymbolKind = SymbolKind.ANY,
        type: str = "",
        pattern: str = "",
        recursive: bool = True,
        only_used: bool = False,
        skips_shared: bool = False,
        view: str = "block",
        stack: int | None = None,
    ) -> tuple[SymbolInfo, ...]:
        """Search for symbols.

        Args:
            block: where, such as ``RAPID/T_ROB_R`` or ``RAPID/T_ROB_R/TRobMain``.
            kind: only those of this kind.
            type: only data of this type.
            pattern: only those whose name it describes, a regular expression.
            recursive: in blocks within the block, too.
            only_used: only what is used.
            skips_shared: without what is loaded in all tasks.
            view: ``block``, ``scope`` for all that is seen from there, or ``stack`` for a routine under way.
            stack: number of the routine under way, 1 for the innermost, as ``stack_frame`` has it.
        """
        form = given(
            view=view,
            vartyp="any",
            blockurl=block,
            recursive=recursive,
            onlyused=only_used,
            skipshared=skips_shared,
            symtyp=kind.value,
            regexp=pattern or None,
            dattyp=type or None,
            stack=stack,
        )
        request = Request("POST", "/rw/rapid/symbols", (("action", "search-symbols"),), form)
        return self._read(request, lambda page: tuple(map(_symbol_info, page.states)), f"searching {block}")


def _symbol_info(state: State) -> SymbolInfo:
    dimensions = tuple(int(part) for part in state.fields.get("dim", "").replace(",", " ").split())
    return SymbolInfo(
        address=state.fields.get("symburl") or state.title,
        name=state.text("name"),
        kind=state.member(SymbolKind, "symtyp"),
        type=state.fields.get("dattyp", ""),
        dimensions=dimensions,
        is_local=state.flag("local"),
        is_read_only=state.flag("rdonly"),
    )


@dataclass(frozen=True, slots=True)
class QueueMessage:
    """One message.

    Attributes:
        data: type and value as RAPID writes them, such as ``num;5`` or ``string;"go"``.
        user_def: number that sender and receiver agree on.
        sender: name of its queue.
    """

    data: str
    user_def: int
    sender: str


@dataclass(frozen=True, slots=True)
class QueueInfo:
    """A queue: messages it holds at most, and their longest [byte]."""

    name: str
    size: int
    longest: int


class Queues(Requests):
    """``/rw/dipc``; a RAPID task's queue is ``RMQ_`` and its name."""

    def queues(self) -> tuple[str, ...]:
        """Names of the queues, those of RAPID tasks too."""
        states = self._states("reading the queues", _DIPC)
        return tuple(state.title for state in states if state.type == "dipc-queue-li")

    def queue(self, name: str) -> QueueInfo:
        """One queue of this client."""
        state = self._state(f"reading the queue {name}", f"{_DIPC}/{name}", "dipc-queue")
        return QueueInfo(state.text("queue-name"), state.whole("queue-size"), state.whole("queue-max-msg-size"))

    def create_queue(self, name: str, size: int = 100, longest: int = LONGEST_MESSAGE) -> None:
        """Make a queue to which RAPID tasks can send; it goes with the session.

        Args:
            name: of it.
            size: messages it holds, 1 to 32767.
            longest: message in it [byte], 1 to 444.
        """
        form = given(dipc_queue_name=name, dipc_queue_size=size, dipc_max_msg_size=longest)
        self._do(post(_DIPC, "dipc-create", *form), f"making the queue {name}")

    def remove_queue(self, name: str) -> None:
        """Remove a queue of this client."""
        self._do(Request("DELETE", f"{_DIPC}/{name}"), f"removing the queue {name}")

    def send_message(self, to: str, data: str, *, sender: str, user_def: int = 0) -> None:
        """Send to a queue such as ``RMQ_T_ROB_R``.

        Args:
            to: name of the queue.
            data: type and value as RAPID writes them, such as ``num;5``.
            sender: name of a queue of this client, to which the task may answer.
            user_def: number that both agree on.
        """
        form = given(dipc_src_queue_name=sender, dipc_cmd=111, dipc_userdef=user_def, dipc_msgtype=1, dipc_data=data)
        self._do(post(f"{_DIPC}/{to}", "dipc-send", *form), f"sending to {to}")

    def read_message(self, name: str, timeout: float = 0.0) -> QueueMessage | None:
        """The oldest message of a queue of this client; None where none comes within ``timeout`` [s]."""
        query = (("action", "dipc-read"), ("timeout", str(round(timeout * _MS))))
        what = f"reading from {name}"
        page = self._page(self._session.exchange(get(f"{_DIPC}/{name}", *query)), what)
        for state in page.of_type("dipc-read-li"):
            return QueueMessage(state.text("dipc-data"), state.whole("dipc-userdef"), state.fields["queue-name"])
        return None
