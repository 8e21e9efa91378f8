"""The virtual controller's answers on ``/rw/rapid``: execution, tasks, programs, pointers (reference/rws.md §6).

Modules and symbols are in ``symbols``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, astuple
from functools import partial
from xml.etree import ElementTree

from abb_protocols.errors import RapidError
from abb_protocols.rws.documents import Page, RwsLink, RwsState
from abb_protocols.rws.operations import rapid as table
from abb_protocols.rws.operations.modules import TextRange, quoted_module_text
from abb_protocols.rws.operations.motion import UNIT, JointTarget, RobTarget
from abb_protocols.rws.values import ExecutionState, RunCycle, RwsCode, TaskExecution
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller.tasks import InstalledTask
from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.loaded_modules import UserRoutine
from virtual_irc5.rapid.parser import parse_module
from virtual_irc5.rapid.pauses import StackEntry, StepKind
from virtual_irc5.rapid.states import Execution
from virtual_irc5.rapid.task import Task
from virtual_irc5.rapid.types import RapidReferenceError
from virtual_irc5.rws.files import path_of_file
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.motion import unit_joint_target, unit_target
from virtual_irc5.rws.render import page_at, page_entry
from virtual_irc5.rws.router import Routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, bad_call

_BASE = "/rw/rapid/"

_NO_CONTENT = 204
_MOST_PAGE = 30


ROUTES = Routes()


def execution_of(controller: Irc5) -> table.ExecutionAnswer:
    """Whether RAPID runs, and its cycle."""
    state = ExecutionState.RUNNING if controller.is_running else ExecutionState.STOPPED
    return table.ExecutionAnswer(state, RunCycle(controller.cycle))


def rws_task(controller: Irc5, name: str) -> Task:
    """The task of that name; raises CallFailure."""
    task = controller.tasks.get(name.upper())
    if task is None:
        raise CallFailure(404, RwsCode.FAIL, f"there is no task {name[:50]!r}")
    return task


def _task(controller: Irc5, call: RwsCall) -> Task:
    return rws_task(controller, call.names["task"])


def _installed(controller: Irc5, call: RwsCall) -> InstalledTask:
    return controller.execution.installed[_task(controller, call).name]


@ROUTES.answer(table.RAPID)
def _get_rapid(controller: Irc5, call: RwsCall) -> Page:
    names = ("tasks", "modules", "symbols", "execution", "uiinstr", "taskselection", "aliasio")
    return page_at("rapid", "/rw/", "rapid", *(page_entry(f"rap-{name}-li", name, f"rapid/{name}") for name in names))


# Execution


@ROUTES.answer(table.EXECUTION)
def _get_execution(controller: Irc5, call: RwsCall) -> table.ExecutionAnswer:
    return execution_of(controller)


@ROUTES.answer(table.START_EXECUTION)
def _start(controller: Irc5, call: RwsCall) -> None:
    cycle, mode = call.parameter("cycle", "asis"), call.parameter("execmode", "continue")
    step = None
    if mode != "continue":
        step = next((kind for kind in StepKind if kind.value == mode), None)
        if step is None:
            raise CallFailure(400, RwsCode.NOTIMPL, f"a step {mode} is not possible; stepin, stepover and stepout are")
    is_stopping = call.parameter("stopatbp", "disabled") == "enabled"
    controller.start_rapid("" if cycle == "asis" else cycle, step, stop_at_breakpoints=is_stopping)


def _prepare_compiled(controller: Irc5, call: RwsCall) -> Callable[[], None]:
    """Compile the programs of all tasks, which moving a program pointer then finds done."""
    tasks = tuple(controller.tasks.values())

    def compile_all() -> None:
        for task in tasks:
            task.compile()

    return compile_all


@ROUTES.answer(table.START_PRODUCTION, prepare=_prepare_compiled)
def _start_production(controller: Irc5, call: RwsCall) -> None:
    """Start from the production entry, which is the main of each task."""
    controller.move_pp_to_main()
    controller.start_rapid()


@ROUTES.answer(table.SET_EXECUTION_CYCLE)
def _set_cycle(controller: Irc5, call: RwsCall) -> None:
    cycle = call.required("cycle")
    if cycle != "asis":
        controller.execution.cycle = cycle
        for each in controller.execution.installed.values():
            if each.is_normal:
                each.task.repeats = cycle == "forever"


@ROUTES.answer(table.HOLD_TO_RUN, table.HOLD_TASK_TO_RUN)
def _hold_to_run(controller: Irc5, call: RwsCall) -> None:
    call.required("state")
    raise CallFailure(
        403, RwsCode.MODE_REJECT, "hold-to-run is pressed on the FlexPendant; RobotStudio alone has it here"
    )


# Tasks


@ROUTES.answer(table.TASKS)
def _get_tasks(controller: Irc5, call: RwsCall) -> Page:
    states = (
        table.TASKS.answered.state(name, _task_info(each), RwsLink("self", f"tasks/{name}"))
        for name, each in controller.execution.installed.items()
    )
    return page_at("rapid", _BASE, "tasks", *states)


@ROUTES.answer(table.TASK)
def _get_task(controller: Irc5, call: RwsCall) -> Page:
    installed = _installed(controller, call)
    name, settings = installed.task.name, installed.settings
    links = (
        RwsLink("self", name),
        RwsLink("program", f"{name}/program"),
        RwsLink("modules", f"../modules?task={name}"),
    )
    level = "Normal" if installed.task.call_stack else "None"
    details = table.TaskDetails(
        **asdict(_task_info(installed)),
        type=settings.type.name.capitalize().replace("Semistatic", "SemiStatic"),
        trust="None" if settings.trust.value == "NoSafety" else settings.trust.value,
        number=str(list(controller.tasks).index(name) + 1),
        level=level,
        mode="Continous",
        execution_type=level,
        entry=settings.entry,
    )
    rest = {"bind_ref": "False", "task_in_forgnd": str(not settings.foreground)}
    state = RwsState("rap-task", name, {**table.TASK.answered.write(details), **rest}, links)
    return page_at("rapid", f"{_BASE}tasks/", name, state)


def _task_info(installed: InstalledTask) -> table.TaskInfo:
    task = installed.task
    return table.TaskInfo(
        name=task.name,
        type_code=installed.settings.type.value,
        links="empt" if task.is_empty else "init" if task.execution is Execution.UNINITIALIZED else "link",
        execution=TaskExecution(task.execution.value),
        is_active=installed.is_active,
        is_motion_task=installed.settings.is_motion_task,
    )


@ROUTES.answer(table.ACTIVATE_ALL_TASKS, table.DEACTIVATE_ALL_TASKS, table.ACTIVATE_TASK, table.DEACTIVATE_TASK)
def _activate(controller: Irc5, call: RwsCall) -> None:
    """Select a task on the task panel, or all."""
    tasks = [_installed(controller, call)] if "task" in call.names else controller.execution.installed.values()
    for each in tasks:
        if each.is_normal or "task" in call.names:
            controller.execution.select(each.task.name, is_active=call.option("action") == "activate")


def _prepare_module(controller: Irc5, call: RwsCall) -> Callable[[], None] | None:
    path = path_of_file(call.required("modulepath"))
    text = controller.files.get(path)
    return None if text is None else partial(prepare_modules, _task(controller, call), {path: text})


@ROUTES.answer(table.LOAD_MODULE, prepare=_prepare_module)
def _load_module(controller: Irc5, call: RwsCall) -> None:
    is_replacing = call.parameter("replace", "false") == "true"
    path = path_of_file(call.required("modulepath"))
    controller.load_module(_task(controller, call).name, path, replace=is_replacing)


def prepare_modules(task: Task, texts: Mapping[str, str], *, replaces_program: bool = False) -> None:
    """Parse, link and compile modules that are about to be loaded, in any thread; loading raises the same errors."""
    with suppress(RapidError):
        task.prepare(*(_parsed(text, path) for path, text in texts.items()), replaces_program=replaces_program)


def _parsed(text: str, path: str) -> s.Module:
    """The module, with its text encoded for clients that read it."""
    quoted_module_text(text)
    return parse_module(text, path)


@ROUTES.answer(table.UNLOAD_MODULE)
def _unload_module(controller: Irc5, call: RwsCall) -> None:
    controller.execution.unload_module(_task(controller, call).name, call.required("module"))


@ROUTES.answer(table.ABORT_EXECUTION_LEVEL)
def _abort_level(controller: Irc5, call: RwsCall) -> None:
    """Leave the execution level that a service routine or trap has: the normal one stays, as nothing is above it."""
    task = _task(controller, call)
    if task.execution is Execution.STARTED:
        raise CallFailure(400, RwsCode.EXEC_STATE, f"{task.name} runs: stop RAPID first")
    if not task.call_stack:
        raise CallFailure(400, RwsCode.NO_PP, f"{task.name} has no program pointer")


@ROUTES.answer(table.BUILD_PROGRAM)
def _build(controller: Irc5, call: RwsCall) -> None:
    """Link a task; its errors are at ``program/builderror``."""
    faults = _task(controller, call).faults()
    if faults:
        raise CallFailure(400, RwsCode.SEMANTIC, str(faults[0]))


@ROUTES.answer(table.POINTER_SYNC_STATE, table.TASK_SYNC_STATE)
def _get_sync_state(controller: Irc5, call: RwsCall) -> Page:
    """Whether the pointers of motion tasks are on synchronized motion, which this robot does not have."""
    states = (
        RwsState("rap-sync-state", task, {"Program-Pointer-State": "OFF", "Motion-Pointer-State": "OFF"})
        for task in ([_task(controller, call).name] if "task" in call.names else controller.tasks)
    )
    return page_at("rapid", _BASE, "tasks", *states)


@ROUTES.answer(table.TASK_SPY)
def _get_spy(controller: Irc5, call: RwsCall) -> Mapping[str, bool]:
    return {"spy-status": False}


@ROUTES.answer(table.START_SPY, table.STOP_SPY)
def _refuse_spy(controller: Irc5, call: RwsCall) -> None:
    raise CallFailure(400, RwsCode.SERVICE_NOT_SUPPORTED, "execution is not logged statement by statement here")


@ROUTES.answer(table.STACK_FRAME, table.ACTIVATION_RECORD)
def _get_stack_frame(controller: Irc5, call: RwsCall) -> Page:
    """A routine under way: 1 is that of the program pointer."""
    task = _task(controller, call)
    number = call.number_option("stackframe", 1)
    stack = task.call_stack
    if not 1 <= number <= len(stack):
        raise CallFailure(404, RwsCode.NO_PP, f"{task.name} has {len(stack)} stack frames, not {number}")
    at = stack[number - 1]
    url = f"RAPID/{task.name}"
    frame = table.StackFrame(
        "Normal", _range(task, at), f"{url}/%{number}", routine_url=f"{url}/{at.module}/{at.routine}"
    )
    state = table.STACK_FRAME.answered.state(str(number), frame)
    return page_at("rapid", f"{_BASE}tasks/", task.name, state)


def _text_of(task: Task, module: str) -> str:
    """The text of a module of a task; raises CallFailure."""
    for each in task.modules:
        if each.name.lower() == module.lower():
            return each.text
    raise CallFailure(404, RwsCode.FAIL, f"the task {task.name} has no module {module[:50]!r}")


def _range(task: Task, at: StackEntry) -> TextRange:
    """Where a statement begins and ends: rows and columns from 1, the end of its line being its end."""
    lines = _text_of(task, at.module).splitlines()
    line = lines[at.line - 1] if 0 < at.line <= len(lines) else ""
    begin = len(line) - len(line.lstrip()) + 1
    return TextRange(at.line, begin, at.line, max(len(line.rstrip()), begin))


@ROUTES.answer(table.TASK_CHANGE_COUNT_TOO, table.TASK_CHANGE_COUNT)
def _get_change_count(controller: Irc5, call: RwsCall) -> Page:
    task = _task(controller, call)
    count = controller.program_changes(task.name)
    fields = {"change-count": str(count), **table.TASK_CHANGE_COUNT.answered.write(count)}
    state = RwsState("task-struc-change-count", task.name, fields)
    return page_at("rapid", f"{_BASE}tasks/", task.name, state)


@ROUTES.answer(table.PREFERRED_TYPES)
def _get_preferred_types(controller: Irc5, call: RwsCall) -> Page:
    """The data types a parameter of an instruction takes."""
    task = _task(controller, call)
    instruction, parameter = call.option("instruction") or "", call.option("parameter") or ""
    routine = task.library.routine(instruction)
    found = [each for each in routine.parameters if each.name.lower() == parameter.lower()] if routine else []
    if not found:
        raise bad_call(f"the instruction {instruction[:50]!r} has no parameter {parameter[:50]!r}")
    fields = {"name-prefdattype": parameter, **table.PREFERRED_TYPES.answered.write(found[0].type.name)}
    return page_at("rapid", f"{_BASE}tasks/", task.name, RwsState("task-pref-data-types", parameter, fields))


@ROUTES.answer(table.ROUTINES_OF_TASK)
def _get_routines_of_task(controller: Irc5, call: RwsCall) -> Page:
    """The procedures that may be called as service routines: those without parameters."""
    task = _task(controller, call)
    routines = [each for each in task.program.routines if _is_entry(each)]
    start, limit = max(call.number_option("start", 1), 1), max(call.number_option("limit", _MOST_PAGE), 1)
    shown = routines[(start - 1) * limit : start * limit]
    more = f"{task.name}/serviceroutine?start={start + 1}&limit={limit}" if start * limit < len(routines) else None
    states = (
        RwsState(
            "rap-task-routine",
            each.name,
            {
                **table.ROUTINES_OF_TASK.answered.write(each.name),
                "url-to-routine": f"RAPID/{task.name}/{each.module.name}/{each.name}",
                "service-routine": "FALSE",
            },
        )
        for each in shown
    )
    return page_at("rapid", f"{_BASE}tasks/", f"{task.name}/serviceroutine", *states, next_href=more)


def _is_entry(routine: UserRoutine) -> bool:
    return routine.syntax.kind is s.RoutineKind.PROC and not routine.syntax.parameters


@ROUTES.answer(table.TASK_EXECUTION)
def _get_task_execution(controller: Irc5, call: RwsCall) -> Page:
    task = _task(controller, call)
    fields = {"excstate": task.execution.value}
    if task.call_stack:
        fields |= table.TASK_EXECUTION.answered.write(table.TaskPlace(*astuple(task.call_stack[0])))
    return page_at(
        "rapid", f"{_BASE}tasks/", f"{task.name}/execution", RwsState("rap-task-execution", task.name, fields)
    )


# Pointers


def pointer_of(task: Task) -> table.Pointer | None:
    """Where the program pointer stands; None where it is lost."""
    if not task.call_stack:
        return None
    at = task.call_stack[0]
    return table.Pointer(_range(task, at), at.module, at.routine)


@ROUTES.answer(table.POINTERS)
def _get_pointers(controller: Irc5, call: RwsCall) -> Page:
    """Both pointers: the motion pointer is where the program pointer is, as no motion runs ahead of it."""
    task = _task(controller, call)
    fields: Mapping[str, str] = {}
    lost: tuple[RwsLink, ...] = (RwsLink("error", f"/rw/retcode?code={int(RwsCode.UNEXPECTED)}"),)
    if (at := pointer_of(task)) is not None:
        fields, lost = {**table.POINTERS.answered.write(at), "changecount": "0", "executiontype": "Normal"}, ()
    states = (RwsState("pcp-info", name, fields, lost) for name in ("progpointer", "motionpointer"))
    return page_at("rapid", f"{_BASE}tasks/{task.name}/", "pcp", *states)


@ROUTES.answer(table.SET_PP_CURSOR, table.SET_PP_ROUTINE, table.SET_PP_ROUTINE_FROM_URL, prepare=_prepare_compiled)
def _move_pp(controller: Irc5, call: RwsCall) -> None:
    """Set the program pointer to a procedure; a line has to be one of its beginning, or it is refused."""
    task = _task(controller, call)
    module, routine = call.parameter("module", ""), call.required("routine").rpartition("/")[2]
    if call.option("action") == "set-pp-cursor":
        name = call.required("module")
        loaded = task.program.modules.get(name.lower())
        found = loaded.symbols.get(routine.lower()) if loaded is not None else None
        if not isinstance(found, UserRoutine):
            sentence = f"the task {task.name} has no routine {name[:50]}/{routine[:50]}"
            raise CallFailure(400, RwsCode.NO_SUCH_SYMBOL, sentence)
        line = int(call.number("line"))
        call.number("column")
        first = found.syntax.body[0].line if found.syntax.body else found.syntax.line
        if not found.syntax.line <= line <= first:
            raise CallFailure(
                400, RwsCode.ILLEGAL_PCP_MOVE, f"the pointer moves to the first statement of {routine}, line {first}"
            )
    controller.execution.move_pp_to_routine(task.name, routine, module)


@ROUTES.answer(table.SET_PP_PREV_INST, table.SET_PP_NEXT_INST)
def _refuse_pp_step(controller: Irc5, call: RwsCall) -> None:
    _task(controller, call)
    raise CallFailure(
        400, RwsCode.ILLEGAL_PCP_MOVE, "the pointer moves by steps of execution: start with execmode=stepover"
    )


# Motion of a task


@ROUTES.answer(table.TASK_MOTION)
def _get_motion(controller: Irc5, call: RwsCall) -> Page:
    task = _task(controller, call)
    unit = _unit_of(controller, task)
    names = ("robtarget", "jointtarget", "mechunit", "extjointstate")
    states = (page_entry(f"rap-{name}-li", name, f"motion?resource={name}") for name in names)
    state = RwsState("rap-motion", task.name, {"mechunit-name": unit})
    return page_at("rapid", f"{_BASE}tasks/{task.name}/", "motion", state, *states)


def _unit_of(controller: Irc5, task: Task) -> str:
    found = next((unit.name for unit in controller.units if unit.task == task.name), None)
    if found is None:
        raise CallFailure(400, RwsCode.NO_TCPROBOT_ACTIVE, f"{task.name} moves no robot")
    return found


@ROUTES.answer(table.TASK_TARGET)
def _get_motion_target(controller: Irc5, call: RwsCall) -> Mapping[str, RobTarget]:
    task = _task(controller, call)
    unit = next(each for each in controller.units if each.name == _unit_of(controller, task))
    return {unit.name: unit_target(controller, call, unit)}


@ROUTES.answer(table.TASK_JOINTS)
def _get_motion_joints(controller: Irc5, call: RwsCall) -> Mapping[str, JointTarget]:
    unit = _unit_of(controller, _task(controller, call))
    return {unit: unit_joint_target(controller, unit)}


@ROUTES.answer(table.TASK_UNITS)
def _get_motion_units(controller: Irc5, call: RwsCall) -> Page:
    task = _task(controller, call)
    states = (
        RwsState(
            "rapid-mechunit",
            unit.name,
            {"name": unit.name, "mode": UNIT.answered.write(unit)["mode"], "type": unit.type},
        )
        for unit in controller.units
        if unit.task == task.name
    )
    return page_at("rapid", f"{_BASE}tasks/{task.name}/", "motion", *states)


@ROUTES.answer(table.TASK_EXTRA_JOINTS)
def _get_extra_joints(controller: Irc5, call: RwsCall) -> Mapping[str, tuple[str, ...]]:
    task = _task(controller, call)
    _unit_of(controller, task)
    return {task.name: ("rotating", *("not_active",) * 5)}


# Program


@ROUTES.answer(table.PROGRAM)
def _get_program(controller: Irc5, call: RwsCall) -> Page | HttpReply:
    task = _task(controller, call)
    if not task.modules:
        return HttpReply(_NO_CONTENT)
    state = table.PROGRAM.answered.state("program", table.ProgramInfo(controller.program_name(task.name), task.entry))
    links = (
        page_entry("rap-program-breakpoint-li", "breakpoint", "program/breakpoint"),
        page_entry("rap-builderrs-li", "builderror", "program/builderror"),
    )
    return page_at("rapid", f"{_BASE}tasks/{task.name}/", "program", state, *links)


def _prepare_program(controller: Irc5, call: RwsCall) -> Callable[[], None]:
    texts = _program_files(controller, path_of_file(call.required("progpath")))
    return partial(prepare_modules, _task(controller, call), texts, replaces_program=_is_replacing(call))


@ROUTES.answer(table.LOAD_PROGRAM, prepare=_prepare_program)
def _load_program(controller: Irc5, call: RwsCall) -> None:
    """Load the modules that a program file (.pgf) lists, all or none, for the program modules or beside them."""
    task, path = _task(controller, call), path_of_file(call.required("progpath"))
    texts = _program_files(controller, path)
    controller.execution.load_program(task.name, texts, replace=_is_replacing(call))
    controller.name_program(task.name, path.rpartition("/")[2].rpartition(".")[0])
    controller.program_loaded(task.name)


def _is_replacing(call: RwsCall) -> bool:
    return call.parameter("loadmode", "replace") == "replace"


def _program_files(controller: Irc5, path: str) -> dict[str, str]:
    """The texts of the modules of a program file, by path; raises CallFailure."""
    text = controller.files.get(path)
    if text is None:
        raise CallFailure(400, RwsCode.FILE_NOT_FOUND, f"there is no file {path}")
    try:
        names = [(each.text or "").strip() for each in ElementTree.fromstring(text.encode()).iter("Module")]
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise bad_call(f"{path} is not a program file: {error}") from error
    paths = [f"{path.rpartition('/')[0]}/{name}" for name in names if name]
    texts = {each: controller.files.get(each) for each in paths}
    missing = [each for each, module in texts.items() if module is None]
    if not paths or missing:
        raise CallFailure(400, RwsCode.FILE_NOT_FOUND, f"the program lists {missing[0] if missing else 'no modules'}")
    return {each: module for each, module in texts.items() if module is not None}


@ROUTES.answer(table.UNLOAD_PROGRAM)
def _unload_program(controller: Irc5, call: RwsCall) -> None:
    task = _task(controller, call)
    for module in task.modules:
        if not module.is_system:
            controller.execution.unload_module(task.name, module.name)


@ROUTES.answer(table.SAVE_PROGRAM)
def _save_program(controller: Irc5, call: RwsCall) -> None:
    """Write the program modules and the program file that lists them into a directory."""
    task, folder = _task(controller, call), path_of_file(call.required("path"))
    name = controller.program_name(task.name)
    modules = [module for module in task.modules if not module.is_system]
    listed = "".join(f"\t<Module>{module.name}.mod</Module>\r\n" for module in modules)
    text = f'<?xml version="1.0" encoding="ISO-8859-1" ?>\r\n<Program>\r\n{listed}</Program>\r\n'
    controller.files.write(f"{folder}/{name}.pgf", text.encode("latin-1"))
    for module in modules:
        controller.files.write(f"{folder}/{module.name}.mod", module.text.encode("latin-1", "replace"))


@ROUTES.answer(table.SET_PROGRAM_NAME)
def _set_program_name(controller: Irc5, call: RwsCall) -> None:
    controller.name_program(_task(controller, call).name, call.required("name"))


@ROUTES.answer(table.SET_PROGRAM_ENTRY)
def _set_entry(controller: Irc5, call: RwsCall) -> None:
    task, name = _task(controller, call), call.required("routine")
    if not any(_is_entry(each) and each.name.lower() == name.lower() for each in task.program.routines):
        raise CallFailure(
            400, RwsCode.ILLEGAL_ENTRYPOINT, f"{task.name} has no procedure {name[:50]}() without parameters"
        )
    task.entry = name


@ROUTES.answer(table.PROGRAM_BUILD_ERRORS)
def _get_build_errors(controller: Irc5, call: RwsCall) -> Page:
    task = _task(controller, call)
    faults = task.faults()
    start = max(call.number_option("start", 1), 1)
    limit = max(min(call.number_option("limit", _MOST_PAGE), _MOST_PAGE), 1)
    shown = faults[(start - 1) * limit : start * limit]
    more = f"builderror?start={start + 1}&limit={limit}" if start * limit < len(faults) else None
    states = (
        table.PROGRAM_BUILD_ERRORS.answered.state(
            str(number),
            table.BuildError(str(fault).partition(",")[0], row=fault.line, column=fault.column, message=str(fault)),
        )
        for number, fault in enumerate(shown, (start - 1) * limit + 1)
    )
    return page_at("rapid", f"{_BASE}tasks/{task.name}/program/", "builderror", *states, next_href=more)


@ROUTES.answer(table.BREAKPOINTS, table.TASK_BREAKPOINTS)
def _get_breakpoints(controller: Irc5, call: RwsCall) -> Page:
    task = _task(controller, call)
    names = {module.name.lower(): module.name for module in task.modules}
    places = [(names[module], line) for module, line in task.breakpoints if module in names]
    states = (
        table.BREAKPOINTS.answered.state(
            str(number), table.Breakpoint(module, _range(task, StackEntry(module, "", line)))
        )
        for number, (module, line) in enumerate(places, 1)
    )
    return page_at("rapid", f"{_BASE}tasks/{task.name}/program/", "breakpoint", *states)


@ROUTES.answer(table.SET_BREAKPOINT)
def _set_breakpoint(controller: Irc5, call: RwsCall) -> None:
    """Set a breakpoint on a line; one that is there stays."""
    task, module, row = _task(controller, call), call.required("module"), int(call.number("row"))
    call.number("column")
    _text_of(task, module)
    try:
        task.set_breakpoint(module, row)
    except RapidReferenceError as error:
        raise CallFailure(400, RwsCode.SOURCEPOS, str(error)) from error


# Task panel, alias I/O


@ROUTES.answer(table.TASK_SELECTION)
def _get_task_selection(controller: Irc5, call: RwsCall) -> bool:
    return True


@ROUTES.answer(table.RAPID_IO_ALIASES)
def _get_aliases(controller: Irc5, call: RwsCall) -> Page:
    """Signals that programs call by other names (AliasIO); none is listed, as an alias is a name of one program."""
    return page_at("rapid", _BASE, "aliasio")


@ROUTES.answer(table.STOP_EXECUTION)
def _stop(controller: Irc5, call: RwsCall) -> None:
    controller.stop_rapid()


@ROUTES.answer(table.MOVE_PP_TO_MAIN, prepare=_prepare_compiled)
def _move_pp_to_main(controller: Irc5, call: RwsCall) -> None:
    controller.move_pp_to_main()
