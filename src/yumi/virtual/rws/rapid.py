"""``/rw/rapid``: execution, tasks, modules and symbols (reference/rws.md §6)."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import TypeVar
from urllib.parse import quote

from yumi.rapid.errors import RapidValueError, UnknownSymbol
from yumi.rapid.task import Task
from yumi.rws.documents import Link, Page, State
from yumi.rws.types import Code
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.rws.operations import Call, Failure, Operation, entry, invalid, resource

T = TypeVar("T")

_BASE = "/rw/rapid/"
_SYMBOL_TYPES = {"con": "rap-sympropconstant", "var": "rap-sympropvar", "per": "rap-symproppers"}
_OWNERS: Mapping[str, Mapping[str, str]] = {
    "con": {},
    "var": {"taskvar": "true"},
    "per": {"taskpers": "true"},
}


def execution_state(controller: Irc5) -> str:
    """``ctrlexecstate``."""
    return "running" if controller.is_running else "stopped"


def get_rapid(controller: Irc5, call: Call) -> Page:
    names = ("execution", "modules", "tasks")
    return resource("rapid", "/rw/", "rapid", *(entry(f"rap-{name}-li", name, f"rapid/{name}") for name in names))


def get_execution(controller: Irc5, call: Call) -> Page:
    fields = {"ctrlexecstate": execution_state(controller), "cycle": controller.cycle}
    return resource("rapid", _BASE, "execution", State("rap-execution", "execution", fields))


def get_tasks(controller: Irc5, call: Call) -> Page:
    tasks = controller.tasks.values()
    links = {task.name: (Link("self", f"tasks/{task.name}"),) for task in tasks}
    states = (State("rap-task-li", task.name, _task_fields(task), links[task.name]) for task in tasks)
    return resource("rapid", _BASE, "tasks", *states)


def get_task(controller: Irc5, call: Call) -> Page:
    task = _find_task(controller, call.names["task"])
    links = (Link("self", task.name), Link("modules", f"../modules?task={task.name}"))
    return resource("rapid", f"{_BASE}tasks/", task.name, State("rap-task", task.name, _task_fields(task), links))


def _task_fields(task: Task) -> dict[str, str]:
    return {
        "name": task.name,
        "type": "norm",
        "taskstate": "link",
        "excstate": task.execution.value,
        "active": "On",
        "motiontask": "TRUE",
    }


def activate(controller: Irc5, call: Call) -> None:
    """Both tasks are selected on the task panel at all times."""
    if "task" in call.names:
        _find_task(controller, call.names["task"])


def load_module(controller: Irc5, call: Call) -> None:
    task = _find_task(controller, call.names["task"])
    is_replacing = call.parameter("replace", "false") == "true"
    controller.load_module(task.name, call.required("modulepath"), replace=is_replacing)


def unload_module(controller: Irc5, call: Call) -> None:
    controller.unload_module(_find_task(controller, call.names["task"]).name, call.required("module"))


def get_modules(controller: Irc5, call: Call) -> Page:
    task = _find_task(controller, call.option("task") or "")
    states = (
        entry(
            "rap-module-info-li",
            module.name,
            f"modules/{module.name}?task={task.name}",
            name=module.name,
            type="SysMod" if module.is_system else "ProgMod",
        )
        for module in task.modules
    )
    return resource("rapid", _BASE, f"modules?task={task.name}", *states)


def get_module_text(controller: Irc5, call: Call) -> Page:
    """The text, URL-encoded; no known client reads other properties of a module."""
    if call.option("resource") != "module-text":
        raise invalid("of a module its text alone is given: resource=module-text")
    task = _find_task(controller, call.option("task") or "")
    name = call.names["module"]
    module = next((each for each in task.modules if each.name.lower() == name.lower()), None)
    if module is None:
        raise Failure(404, Code.FAIL, f"the task {task.name} has no module {name!r}")
    fields = {
        "change-count": "0",
        "module-text": quoted(module.text),
        "module-length": str(len(module.text)),
    }
    return resource("rapid", f"{_BASE}modules/", module.name, State("rap-module-text", module.name, fields))


@functools.lru_cache(maxsize=32)
def quoted(text: str) -> str:
    """A module's text, URL-encoded; a long one takes longer than a cycle the first time."""
    return quote(text, encoding="latin-1")


def get_symbol(controller: Irc5, call: Call) -> Page:
    url = call.names["symbol"]
    value = _at(controller, url, lambda task, module, name: task.read(module, name), missing=400)
    state = State("rap-data", f"RAPID/{url}", {"value": value})
    return resource("rapid", _BASE, f"symbol/data/RAPID/{url}", state)


def set_symbol(controller: Irc5, call: Call) -> None:
    if controller.mode.value != "AUTO":
        raise Failure(403, Code.MASTER_REJECT, "in manual mode the FlexPendant holds the mastership")
    literal = call.required("value")
    try:
        _at(controller, call.names["symbol"], lambda task, module, name: task.write(module, name, literal), 404)
    except RapidValueError as error:
        raise Failure(400, Code.SYNTAX, str(error)) from error
    controller.settle()


def get_symbol_properties(controller: Irc5, call: Call) -> Page:
    state = _at(controller, call.names["symbol"], _symbol_state, missing=400)
    return resource("rapid", _BASE, f"symbol/properties/{state.title}", state)


def _symbol_state(task: Task, module: str, name: str) -> State:
    kind, sizes = task.kind_of(module, name), task.dimensions_of(module, name)
    url = f"RAPID/{task.name}/{module}/{name}"
    fields = {
        "symburl": url,
        "name": name,
        "symtyp": kind,
        "named": "true",
        "dattyp": task.type_of(module, name),
        "ndim": str(len(sizes)),
        "dim": ",".join(map(str, sizes)),
        "heap": "false",
        "linked": "true",
        "local": "false",
        "rdonly": "true" if kind == "con" else "false",
        **_OWNERS[kind],
        "typurl": f"RAPID/{task.name}/{module}/{task.type_of(module, name)}",
    }
    return State(_SYMBOL_TYPES[kind], url, fields)


def _at(controller: Irc5, url: str, act: Callable[[Task, str, str], T], missing: int) -> T:
    """What ``act`` finds at ``task/module/symbol`` or ``task/symbol``; status ``missing`` when there is nothing."""
    task_name, *module, name = url.split("/") if url.count("/") in (1, 2) else ("", "")
    task = controller.tasks.get(task_name.upper())
    if task is not None:
        for place in module or [each.name for each in task.modules]:
            try:
                return act(task, place, name)
            except UnknownSymbol:
                continue
    code = Code.FAIL if missing == 400 else Code.NO_SUCH_SYMBOL
    raise Failure(missing, code, f"Symbol not found: RAPID/{url}")


def _find_task(controller: Irc5, name: str) -> Task:
    task = controller.tasks.get(name.upper())
    if task is None:
        raise Failure(404, Code.FAIL, f"there is no task {name!r}")
    return task


_EXECUTION = "/rw/rapid/execution"
_TASK = "/rw/rapid/tasks/{task}"
_SYMBOL = "/rw/rapid/symbol/data/RAPID/{symbol:.+}"
_START_VALUES: Mapping[str, tuple[str, ...]] = {
    "regain": ("continue", "regain", "clear"),
    "execmode": ("continue",),
    "cycle": ("forever", "asis"),
    "condition": ("none", "callchain"),
    "stopatbp": ("disabled", "enabled"),
    "alltaskbytsp": ("true", "false"),
}
_STOP_VALUES: Mapping[str, tuple[str, ...]] = {
    "stopmode": ("cycle", "instr", "stop", "qstop"),
    "usetsp": ("normal", "alltsk"),
}
OPERATIONS = (
    Operation("GET", "/rw/rapid", get_rapid),
    Operation("GET", _EXECUTION, get_execution),
    Operation("POST", _EXECUTION, lambda controller, _: controller.start_rapid(), "start", _START_VALUES),
    Operation("POST", _EXECUTION, lambda controller, _: controller.stop_rapid(), "stop", _STOP_VALUES),
    Operation("POST", _EXECUTION, lambda controller, _: controller.move_pp_to_main(), "resetpp"),
    Operation("GET", "/rw/rapid/tasks", get_tasks),
    Operation("POST", "/rw/rapid/tasks", activate, "activate"),
    Operation("GET", _TASK, get_task),
    Operation("POST", _TASK, activate, "activate"),
    Operation("POST", _TASK, load_module, "loadmod", {"replace": ("true", "false")}, needs_mastership="rapid"),
    Operation("POST", _TASK, unload_module, "unloadmod", needs_mastership="rapid"),
    Operation("GET", "/rw/rapid/modules", get_modules),
    Operation("GET", "/rw/rapid/modules/{module}", get_module_text),
    Operation("GET", _SYMBOL, get_symbol),
    Operation("POST", _SYMBOL, set_symbol, "set", respects_mastership="rapid"),
    Operation("GET", "/rw/rapid/symbol/properties/RAPID/{symbol:.+}", get_symbol_properties),
)
