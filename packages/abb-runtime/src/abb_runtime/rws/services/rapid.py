"""The client's service for RAPID: its execution, tasks, programs, program pointers and dialogs."""

from __future__ import annotations

from abb_protocols.errors import ControllerRefused
from abb_protocols.robot.joints import Joints
from abb_protocols.rws.documents import RobTarget
from abb_protocols.rws.operations import rapid as table
from abb_protocols.rws.operations.rapid import (
    BuildError,
    Dialog,
    Pointer,
    ProgramInfo,
    StackFrame,
    TaskDetails,
    TaskInfo,
)
from abb_protocols.rws.values import ExecutionState, Regain, RunCycle, RwsCode, Step, StopMode
from abb_runtime.rws.services.service import Service


class RapidService(Service):
    """``/rw/rapid`` without its modules and symbols."""

    def execution(self) -> ExecutionState:
        """Whether RAPID runs."""
        return self._answer("reading the RAPID execution", table.EXECUTION).state

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
            table.START,
            regain=regain,
            execmode=step,
            cycle=cycle,
            condition="none",
            stopatbp="enabled" if stop_at_breakpoints else "disabled",
            alltaskbytsp=all_tasks,
        )

    def stop_rapid(self, mode: StopMode = StopMode.STOP, *, all_tasks: bool = False) -> None:
        """Stop RAPID in all selected tasks; ``all_tasks`` stops static ones, too."""
        self._call("stopping RAPID", table.STOP, stopmode=mode, usetsp="alltsk" if all_tasks else "normal")

    def move_pp_to_main(self) -> None:
        """Move the program pointer of every selected task to ``main``; RAPID must be stopped."""
        self._call("moving the program pointers to main", table.MOVE_PP_TO_MAIN)

    def run_cycle(self) -> RunCycle:
        """Whether a program begins again at its end."""
        return self._answer("reading the run cycle", table.EXECUTION).cycle

    def set_run_cycle(self, cycle: RunCycle) -> None:
        """Whether a program begins again at its end, from the next start on."""
        self._call("setting the run cycle", table.SET_CYCLE, cycle=cycle)

    def start_from_production_entry(self) -> None:
        """Start every normal task at its production entry."""
        self._call("starting RAPID at the production entries", table.START_PRODUCTION)

    def may_select_tasks(self) -> bool:
        """Whether the task panel lets its selection be changed."""
        return self._answer("reading the task selection", table.TASK_SELECTION)

    def alias_signals(self) -> dict[str, str]:
        """Signals by their alias names in RAPID (AliasIO)."""
        states = self._listed("reading the alias signals", table.ALIASES)
        return {state.title: state.fields.get("signal", state.fields.get("name", "")) for state in states}

    # Tasks

    def tasks(self) -> tuple[TaskInfo, ...]:
        """The RAPID tasks, in the controller's order."""
        return self._answers("reading the RAPID tasks", table.TASKS)

    def task(self, task: str) -> TaskDetails:
        """One task in full."""
        return self._answer(f"reading the task {task}", table.TASK, task)

    def select_task(self, task: str, is_selected: bool) -> None:
        """Switch a task on or off in the task panel; it starts with the others if it is on."""
        operation = table.ACTIVATE if is_selected else table.DEACTIVATE
        self._call(f"switching {task} {'on' if is_selected else 'off'}", operation, task)

    def select_all_tasks(self, are_selected: bool) -> None:
        """Switch all tasks on or off in the task panel."""
        operation = table.ACTIVATE_ALL if are_selected else table.DEACTIVATE_ALL
        self._call(f"switching all tasks {'on' if are_selected else 'off'}", operation)

    def task_change_count(self, task: str) -> int:
        """Rises with every change of the task's modules."""
        return self._answer(f"reading the change count of {task}", table.CHANGE_COUNT, task)

    def is_synchronized(self, task: str = "") -> bool:
        """Whether a task, or each of all, is in a synchronised motion (SyncMoveOn)."""
        where = (table.TASK_SYNC_STATE, task) if task else (table.SYNC_STATE,)
        return all(self._answers("reading the synchronisation", *where, type="program-pointer"))

    def is_spy_running(self) -> bool:
        """Whether RAPID Spy logs each instruction."""
        return self._answer("reading the spy", table.SPY)

    def stack_frame(self, task: str, number: int = 1) -> StackFrame:
        """A call that is under way in a task; 1 is the innermost."""
        return self._answer(f"reading the calls of {task}", table.STACK_FRAME, task, stackframe=number)

    def service_routines(self, task: str) -> tuple[str, ...]:
        """Routines without parameters, which can be called from the FlexPendant."""
        return self._answers(f"reading the routines of {task}", table.ROUTINES_OF_TASK, task, start=1, limit=100)

    def preferred_type(self, task: str, instruction: str, parameter: str) -> str:
        """The type of data that an instruction's parameter takes."""
        what, place = f"reading the type of {parameter} of {instruction}", table.PREFERRED_TYPES
        return self._answer(what, place, task, instruction=instruction, parameter=parameter)

    def abort_execution_level(self, task: str) -> None:
        """Leave a service routine or a call from outside that is under way in a task."""
        self._call(f"leaving the execution level of {task}", table.ABORT_LEVEL, task)

    def task_place(self, task: str) -> tuple[str, str, int]:
        """Module, routine and line that a task executes."""
        place = self._answer(f"reading where {task} is", table.TASK_EXECUTION, task)
        return place.module, place.routine, place.line

    def task_rob_target(self, task: str, tool: str = "", work_object: str = "") -> RobTarget:
        """Where the robot of a task stands; tool and work object are the active ones where none are named."""
        frames = {"tool": tool or None, "wobj": work_object or None}
        return self._answer(f"reading the position of {task}", table.MOTION_TARGET, task, **frames)

    def task_joint_target(self, task: str) -> Joints:
        """Where the arm of a task stands, chain order [rad]."""
        return self._answer(f"reading the joints of {task}", table.MOTION_JOINTS, task).chain()

    def task_units(self, task: str) -> tuple[str, ...]:
        """The mechanical units that a task moves."""
        states = self._listed(f"reading the units of {task}", table.MOTION_UNITS, task)
        return tuple(state.text("name") for state in states if state.type == "rapid-mechunit")

    def external_joints(self, task: str) -> tuple[str, ...]:
        """What each of the six external axes is: ``rotating``, ``linear`` or ``not_active``."""
        return self._answer(f"reading the external axes of {task}", table.EXTRA_JOINTS, task)

    # Programs

    def program(self, task: str) -> ProgramInfo | None:
        """The program of a task; None where there is none."""
        what = f"reading the program of {task}"
        reply = self._call(what, table.PROGRAM, task)
        return table.PROGRAM.answered.of(self._page(reply, what)) if reply.content else None

    def load_program(self, task: str, path: str, *, replace: bool = True) -> None:
        """Load a program file of the controller such as ``HOME:/pick.pgf``; RAPID must be stopped."""
        mode = "replace" if replace else "add"
        self._call(f"loading {path} into {task}", table.LOAD_PROGRAM, task, progpath=path, loadmode=mode)

    def unload_program(self, task: str) -> None:
        """Remove the program modules of a task; RAPID must be stopped."""
        self._call(f"unloading the program of {task}", table.UNLOAD_PROGRAM, task)

    def save_program(self, task: str, path: str) -> None:
        """Write the program of a task into a directory of the controller."""
        self._call(f"saving the program of {task}", table.SAVE_PROGRAM, task, path=path)

    def rename_program(self, task: str, name: str) -> None:
        """Give the program of a task another name."""
        self._call(f"renaming the program of {task}", table.SET_PROGRAM_NAME, task, name=name)

    def set_entry(self, task: str, routine: str) -> None:
        """Let the program of a task begin at another routine than ``main``."""
        self._call("setting the entry", table.SET_ENTRY, task, routine=routine)

    def build(self, task: str) -> tuple[BuildError, ...]:
        """Link the program of a task; its faults, none if it is free of them."""
        try:
            self._call(f"linking the program of {task}", table.BUILD, task)
        except ControllerRefused as error:
            if error.code not in (RwsCode.SEMANTIC, RwsCode.SYNTAX):
                raise
        return self.build_errors(task)

    def build_errors(self, task: str) -> tuple[BuildError, ...]:
        """Faults found when the program was linked."""
        return self._answers(f"reading the faults of {task}", table.BUILD_ERRORS, task)

    # Program pointers

    def pointers(self, task: str) -> tuple[Pointer, Pointer]:
        """Where the program pointer and the motion pointer of a task stand."""
        listed = self._listed(f"reading the pointers of {task}", table.POINTERS, task)
        states = {state.title: table.POINTERS.answered.read(state) for state in listed}
        nowhere = Pointer(None)
        return states.get("progpointer", nowhere), states.get("motionpointer", nowhere)

    def move_pp_to_cursor(self, task: str, module: str, routine: str, row: int, column: int = 1) -> None:
        """Move a task's program pointer to a place in a routine; RAPID must be stopped."""
        place = {"module": module, "routine": routine, "line": row, "column": column}
        self._call(f"moving the program pointer of {task}", table.SET_PP_CURSOR, task, **place)

    def move_pp_to_routine(self, task: str, module: str, routine: str, *, keeps_calls: bool = False) -> None:
        """Move a task's program pointer to a routine; RAPID must be stopped.

        Args:
            task: such as ``T_ROB_R``.
            module: in which the routine is.
            routine: its name, or its address such as ``RAPID/T_ROB_R/Pick/pick``.
            keeps_calls: as a call on the user level, from which execution returns to where it was.
        """
        operation = table.SET_PP_ROUTINE_FROM_URL if "/" in routine else table.SET_PP_ROUTINE
        place = {"module": module, "routine": routine, "userlevel": keeps_calls}
        self._call(f"moving the program pointer of {task}", operation, task, **place)

    # Dialogs

    def dialog(self) -> Dialog | None:
        """What a program asks on the FlexPendant (``TPReadNum``, ``UIMessageBox`` …); None where it asks nothing."""
        try:
            return self._answer("reading the dialog", table.ACTIVE_DIALOG)
        except ControllerRefused as error:
            if error.code != RwsCode.UI_NOT_ACTIVE:
                raise
            return None

    def dialog_parameters(self, stack: str) -> dict[str, str]:
        """The arguments of a dialog's instruction as RAPID literals."""
        states = self._listed("reading the dialog", table.DIALOG_PARAMETERS, stack)
        return {state.text("name"): state.text("value") for state in states}

    def dialog_parameter(self, stack: str, name: str) -> str:
        """One argument of a dialog's instruction as RAPID literal."""
        return self._answer("reading the dialog", table.DIALOG_PARAMETER, f"{stack}/{name}")

    def answer_dialog(self, stack: str, literal: str, name: str = "Result") -> None:
        """Answer a dialog: the literal of a number or a string, whatever it asks for."""
        self._call("answering the dialog", table.ANSWER_DIALOG, f"{stack}/{name}", value=literal)
