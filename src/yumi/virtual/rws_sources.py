"""What a client may be told of when it changes: one source per resource (reference/rws.md §14.4)."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from yumi.rapid.errors import UnknownSymbol
from yumi.rws.codes import Code
from yumi.rws.pages import Link, State
from yumi.rws.subscriptions import Priority, Resource
from yumi.virtual.refusal import Refused
from yumi.virtual.rws_port import Controller, RapidTask
from yumi.virtual.rws_routes import Failure
from yumi.virtual.signals import path_of, printed

Event = tuple[State, ...]
"""One event: a state, or two that belong together."""

_MOST_MESSAGES = 20


@dataclass(frozen=True, slots=True)
class Source:
    """One thing that changes.

    Attributes:
        read: its value at this moment as text; None when it is there no more.
        show: the events that tell of a change from one value to another.
    """

    read: Callable[[], str | None]
    show: Callable[[str | None, str], Sequence[Event]]


def find_source(controller: Controller, resource: Resource) -> Source:
    """The source behind a resource.

    Raises:
        Failure: there is none, or not with this priority.
    """
    for pattern, find, highest in _KINDS:
        found = re.fullmatch(pattern, resource.path, re.IGNORECASE)
        if found is None:
            continue
        if resource.priority > highest:
            raise Failure(400, Code.INVALIDARG, f"{resource.path} has no priority {int(resource.priority)}")
        return find(controller, resource.path, found.groupdict())
    raise Failure(400, Code.INVALIDARG, f"Invalid resource URI in Create: {resource.path}")


def _plain(path: str, type: str, field: str, title: str, read: Callable[[], str]) -> Source:
    links = (Link("self", path),)
    return Source(read, lambda _, text: ((State(type, title, {field: text}, links),),))


def _panel(controller: Controller, path: str, names: Mapping[str, str]) -> Source:
    name = names["name"].lower()
    reads: Mapping[str, Callable[[], str]] = {
        "ctrlstate": lambda: controller.controller_state.value,
        "opmode": lambda: controller.mode.value,
        "speedratio": lambda: str(controller.speed_ratio),
        "coldetstate": lambda: controller.collision_state.value,
    }
    title = "collisiondetectstate" if name == "coldetstate" else name
    return _plain(path, f"pnl-{name}-ev", name, title, reads[name])


def _execution(controller: Controller, path: str, names: Mapping[str, str]) -> Source:
    def read() -> str:
        return "running" if controller.is_running else "stopped"

    return _plain(path, "rap-ctrlexecstate-ev", "ctrlexecstate", "ctrlexecstate", read)


def _cycle(controller: Controller, path: str, names: Mapping[str, str]) -> Source:
    return _plain(path, "rap-execcycle-ev", "rapidexeccycle", "rapidexeccycle", lambda: controller.cycle)


def _task(controller: Controller, path: str, names: Mapping[str, str]) -> Source:
    task = _find_task(controller, path, names["task"])
    return _plain(path, "rap-execstate-ev", "pgmtaskexec-state", task.name, lambda: task.execution.value)


def _signal(controller: Controller, path: str, names: Mapping[str, str]) -> Source:
    signals = controller.signals
    try:
        signal = signals.get(names["signal"].rpartition("/")[2])
    except Refused as refused:
        raise Failure(400, Code.UNRESOLVED_URL, f"Invalid resource URI in Create: {path}") from refused

    def show(_: str | None, text: str) -> Sequence[Event]:
        fields = {"lvalue": text, "lstate": "not simulated"}
        return ((State("ios-signalstate-ev", path_of(signal), fields, (Link("self", path),)),),)

    return Source(lambda: printed(signals.get(signal.name).value), show)


def _variable(controller: Controller, path: str, names: Mapping[str, str]) -> Source:
    task = _find_task(controller, path, names["task"])
    module, name = _module_of(task, path, names), names["name"]
    if task.kind_of(module, name) != "per":
        raise Failure(400, Code.SYMBOL_NOT_PERSISTENT, f"{path} is not persistent; only PERS can be subscribed")

    def read() -> str | None:
        try:
            return task.read(module, name)
        except UnknownSymbol:
            return None  # its module has been unloaded

    def show(_: str | None, text: str) -> Sequence[Event]:
        told = State("rap-value-ev", "value", {}, (Link("self", path),))
        return ((told, State("rap-data", f"RAPID/{task.name}/{module}/{name}", {"value": text})),)

    return Source(read, show)


def _module_of(task: RapidTask, path: str, names: Mapping[str, str]) -> str:
    """The module a variable is in; a client may leave it out."""
    for module in [names["module"]] if names["module"] else [each.name for each in task.modules]:
        try:
            task.kind_of(module, names["name"])
        except UnknownSymbol:
            continue
        return module
    raise Failure(400, Code.FAIL, f"Symbol not found: {path}")


def _event_log(controller: Controller, path: str, names: Mapping[str, str]) -> Source:
    domain = int(names["domain"])

    def read() -> str:
        return str(next((event.number for event in controller.events.entries(domain)), 0))

    def show(old: str | None, new: str) -> Sequence[Event]:
        """One event for each message that came since, at first for the newest; cleared messages are told no more."""
        first = int(new) - 1 if old is None else int(old)
        numbers = [event.number for event in controller.events.entries(domain) if event.number > first]
        return [_message(path, number) for number in reversed(numbers[:_MOST_MESSAGES])]

    return Source(read, show)


def _message(path: str, number: int) -> Event:
    place = f"{path}/{number}"
    return (State("elog-message-ev", place, {"seqnum": str(number)}, (Link("self", place),)),)


def _find_task(controller: Controller, path: str, name: str) -> RapidTask:
    task = controller.tasks.get(name.upper())
    if task is None:
        raise Failure(400, Code.FAIL, f"Invalid resource URI in Create: {path}")
    return task


_Find = Callable[[Controller, str, Mapping[str, str]], Source]
_KINDS: Sequence[tuple[str, _Find, Priority]] = (
    (r"/rw/panel/(?P<name>ctrlstate|opmode|speedratio|coldetstate)(;\w+)?", _panel, Priority.MEDIUM),
    (r"/rw/rapid/execution;ctrlexecstate", _execution, Priority.MEDIUM),
    (r"/rw/rapid/execution;rapidexeccycle", _cycle, Priority.MEDIUM),
    (r"/rw/rapid/tasks/(?P<task>\w+);excstate", _task, Priority.MEDIUM),
    (r"/rw/iosystem/signals/(?P<signal>.+);state", _signal, Priority.HIGH),
    (
        r"/rw/rapid/symbol/data/RAPID/(?P<task>\w+)/((?P<module>\w+)/)?(?P<name>[\w{},]+);value",
        _variable,
        Priority.HIGH,
    ),
    (r"/rw/elog/(?P<domain>\d{1,3})", _event_log, Priority.MEDIUM),
)
"""Path, how its source is found, highest priority."""
