"""What clients can subscribe to: for each resource a source, with its value and its events (reference/rws.md §14.4)."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from abb_protocols.rws.documents import RwsLink, RwsState
from abb_protocols.rws.operations.modules import text_range_in
from abb_protocols.rws.operations.rapid import ACTIVE_DIALOG
from abb_protocols.rws.values import Priority, Resource, RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller.signals import printed_signal, signal_path
from virtual_irc5.controller_log import Refused
from virtual_irc5.rapid.task import Task
from virtual_irc5.rapid.types import UnknownSymbol
from virtual_irc5.rws.dialogs import shown_dialog
from virtual_irc5.rws.mastership import Mastership
from virtual_irc5.rws.panel import TITLES, panel_text
from virtual_irc5.rws.queues import DipcQueues
from virtual_irc5.rws.rapid import execution_of, pointer_of
from virtual_irc5.rws.rws_call import CallFailure
from virtual_irc5.rws.users import VirtualUsers

Event = tuple[RwsState, ...]
"""One event: a state, or two that belong together."""

_MOST_MESSAGES = 20
_PLACE = text_range_in("BegPosLine", "BegPosCol", "EndPosLine", "EndPosCol")


@dataclass(frozen=True, slots=True)
class Source:
    """One thing that changes.

    Attributes:
        read: its value at this moment as text; None when it no longer exists.
        show: the events of a change from one value to another.
    """

    read: Callable[[], str | None]
    show: Callable[[str | None, str], Sequence[Event]]


def find_source(
    controller: Irc5, resource: Resource, own: Mapping[str, Source] | None = None, rws1: str | None = None
) -> Source:
    """The source behind a resource.

    Args:
        controller: the virtual one.
        resource: what is asked for; its events have its path.
        own: sources by path of what belongs to the sessions of a server.
        rws1: its path in Robot Web Services 1.0, where it has another.

    Raises:
        CallFailure: there is none, or not with this priority.
    """
    found_own = (own or {}).get(resource.path.lower())
    if found_own is not None:
        if resource.priority > Priority.MEDIUM:
            raise CallFailure(400, RwsCode.INVALIDARG, f"{resource.path} has no priority {int(resource.priority)}")
        return found_own
    for pattern, find, highest in _KINDS:
        found = re.fullmatch(pattern, resource.path if rws1 is None else rws1, re.IGNORECASE)
        if found is None:
            continue
        if resource.priority > highest:
            raise CallFailure(400, RwsCode.INVALIDARG, f"{resource.path} has no priority {int(resource.priority)}")
        return find(controller, resource.path, found.groupdict())
    raise CallFailure(400, RwsCode.INVALIDARG, f"Invalid resource URI in Create: {resource.path}")


def _field(path: str, type: str, name: str, title: str, read: Callable[[], str]) -> Source:
    """A source whose events are one field."""
    links = (RwsLink("self", path),)
    return Source(read, lambda _, text: ((RwsState(type, title, {name: text}, links),),))


def _panel_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    name = names["name"].lower()
    return _field(path, f"pnl-{name}-ev", name, TITLES.get(name, name), lambda: panel_text(controller, name))


def _execution_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    name = "ctrlexecstate"
    return _field(path, f"rap-{name}-ev", name, name, lambda: execution_of(controller).state.value)


def _cycle_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    return _field(path, "rap-execcycle-ev", "rapidexeccycle", "rapidexeccycle", lambda: controller.cycle)


def _task_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    task = _find_task(controller, path, names["task"])
    return _field(path, "rap-execstate-ev", "pgmtaskexec-state", task.name, lambda: task.execution.value)


def _signal_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    signals = controller.signals
    try:
        signal = signals.get(names["signal"].rpartition("/")[2])
    except Refused as refused:
        raise CallFailure(400, RwsCode.UNRESOLVED_URL, f"Invalid resource URI in Create: {path}") from refused

    def show(_: str | None, text: str) -> Sequence[Event]:
        fields = {"lvalue": text, "lstate": "simulated" if signals.get(signal.name).is_simulated else "not simulated"}
        return ((RwsState("ios-signalstate-ev", signal_path(signal), fields, (RwsLink("self", path),)),),)

    return Source(lambda: printed_signal(signals.get(signal.name).value), show)


def _variable_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    task, name = _find_task(controller, path, names["task"]), names["name"]
    # A client may leave the module out.
    for module in [names["module"]] if names["module"] else [each.name for each in task.modules]:
        try:
            kind = task.kind_of(module, name)
        except UnknownSymbol:
            continue
        break
    else:
        raise CallFailure(400, RwsCode.FAIL, f"Symbol not found: {path}")
    if kind != "per":
        raise CallFailure(400, RwsCode.SYMBOL_NOT_PERSISTENT, f"{path} is not persistent; only PERS can be subscribed")

    def read() -> str | None:
        try:
            return task.read(module, name)
        except UnknownSymbol:
            return None  # its module has been unloaded

    def show(_: str | None, text: str) -> Sequence[Event]:
        event = RwsState("rap-value-ev", "value", {}, (RwsLink("self", path),))
        return ((event, RwsState("rap-data", f"RAPID/{task.name}/{module}/{name}", {"value": text})),)

    return Source(read, show)


def _event_log_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    domain = int(names["domain"])

    def read() -> str:
        return str(next((event.number for event in controller.events.entries(domain)), 0))

    def show(old: str | None, new: str) -> Sequence[Event]:
        """One event for each message since ``old``, at first for the newest; cleared messages are left out."""
        first = int(new) - 1 if old is None else int(old)
        numbers = [event.number for event in controller.events.entries(domain) if event.number > first]
        places = [(f"{path}/{number}", {"seqnum": str(number)}) for number in reversed(numbers[:_MOST_MESSAGES])]
        return [(RwsState("elog-message-ev", place, fields, (RwsLink("self", place),)),) for place, fields in places]

    return Source(read, show)


def _hold_to_run_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    """This controller's button is never held: the event does not come."""
    return _field(path, "rap-hdtr-ev", "hdtr-State", "hdtrun", lambda: "HdTREvent WaitLeft")


def _task_change_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    task = _find_task(controller, path, names["task"])

    def show(old: str | None, count: str) -> Sequence[Event]:
        fields = {
            "change-count": count,
            "task-name": task.name,
            "module-name": "",
            "program-name": "",
            "changetype": "struc",
        }
        return ((RwsState("rap-task-ev", task.name, {} if old is None else fields, (RwsLink("self", path),)),),)

    return Source(lambda: str(controller.program_changes(task.name)), show)


def _sync_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    task = _find_task(controller, path, names["task"])
    return _field(path, "rap-syncstate-ev", "sync-state", task.name, lambda: "off")


def _pointer_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    task = _find_task(controller, path, names["task"])

    def read() -> str:
        stack = task.call_stack
        return f"{stack[0].module} {stack[0].routine} {stack[0].line}" if stack else ""

    def show(_: str | None, text: str) -> Sequence[Event]:
        at = pointer_of(task) if text else None
        fields = {}
        if at is not None and at.range is not None:
            fields = {"module-name": at.module, "routine-name": at.routine, **_PLACE.write("", at.range)}
        return ((RwsState("rap-pp-ev", task.name, fields, (RwsLink("self", path),)),),)

    return Source(read, show)


def _build_log_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    """One event for each change of a program, with the state of its links."""

    def read() -> str:
        return " ".join(f"{name} {controller.program_changes(name)}" for name in controller.tasks)

    def show(_: str | None, text: str) -> Sequence[Event]:
        changed = text.split(" ")
        fields = {"task-name": changed[0], "build-count": changed[1], "build-log-change": "SYS_CTRL_S_OK"}
        return ((RwsState("rap-rap-buildlog-ev", "buildlogchange", fields, (RwsLink("self", path),)),),)

    return Source(read, show)


def _task_panel_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    def read() -> str:
        return "".join(str(int(each.is_active)) for each in controller.execution.installed.values())

    def show(_: str | None, text: str) -> Sequence[Event]:
        fields = {"change-count": str(text.count("1"))}
        return ((RwsState("rap-taskpanel-ev", "taskpanelchange", fields, (RwsLink("self", path),)),),)

    return Source(read, show)


def _dialog_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    """One event when a program asks something, and one when the question has gone."""

    def read() -> str:
        dialog = controller.devices.pendant.active
        return "" if dialog is None else str(dialog.number)

    def show(_: str | None, text: str) -> Sequence[Event]:
        dialog = controller.devices.pendant.active
        fields = {} if dialog is None else ACTIVE_DIALOG.answered.write(shown_dialog(dialog))
        return ((RwsState("rap-ui-ev", "uievent", fields, (RwsLink("self", path),)),),)

    return Source(read, show)


def _network_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    name, stopped = names["network"], controller.signals.stopped

    def show(_: str | None, text: str) -> Sequence[Event]:
        fields = {"lstate": text, "pstate": "running" if text == "started" else "halted"}
        return ((RwsState("ios-networkstate-ev", name, fields, (RwsLink("self", path),)),),)

    return Source(lambda: "stopped" if name in stopped else "started", show)


def _device_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    name, disabled = names["device"].rpartition("/")[2], controller.signals.disabled

    def show(_: str | None, text: str) -> Sequence[Event]:
        fields = {"lstate": text, "pstate": "running" if text == "enabled" else "deact"}
        return ((RwsState("ios-devicestate-ev", name, fields, (RwsLink("self", path),)),),)

    return Source(lambda: "disabled" if name in disabled else "enabled", show)


def _cfg_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    return _field(path, "cfg-prop-ev", "cc", "cfg", lambda: str(controller.configuration.changes))


def _motion_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    return _field(path, "motionsystem-ev", "change-count", "mechunits", lambda: str(controller.motion.changes))


def _error_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    return _field(path, "ms-errorstate-ev", "err-count", "errorstate", lambda: "0")


def _energy_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    return _field(path, "sys-energy-ev", "change-count", "energy", lambda: "0")


def _job_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    job = controller.jobs.find(names["job"])
    if job is None:
        raise CallFailure(400, RwsCode.UNRESOLVED_URL, f"Invalid resource URI in Create: {path}")
    found = job
    return _field(path, "progress-ev", "state", str(found.number), lambda: found.state)


def _find_task(controller: Irc5, path: str, name: str) -> Task:
    task = controller.tasks.get(name.upper())
    if task is None:
        raise CallFailure(400, RwsCode.FAIL, f"Invalid resource URI in Create: {path}")
    return task


def mastership_source(mastership: Mastership, path: str, domains: Sequence[str]) -> Source:
    def show(_: str | None, text: str) -> Sequence[Event]:
        events = []
        for domain in domains:
            fields = mastership.fields(domain)
            held = "0" if fields["mastership"] == "nomaster" else "1"
            events.append(
                (RwsState("msh-resource-value", domain, {"holdmastership": held, **fields}, (RwsLink("self", path),)),)
            )
        return events

    return Source(lambda: str([mastership.fields(domain) for domain in domains]), show)


def rmmp_source(users: VirtualUsers, path: str) -> Source:
    return _field(path, "user-rmmp-ev", "state", "rmmp", lambda: users.state)


def queue_source(messages: DipcQueues, path: str, name: str, *, with_message: bool) -> Source:
    """An event for the oldest message; with its data it is taken from the queue."""

    def read() -> str | None:
        queue = messages.find(name)
        return None if queue is None or not queue.messages else f"{queue.taken}"

    def show(old: str | None, _: str) -> Sequence[Event]:
        queue = messages.find(name)
        if queue is None or not queue.messages:
            return ()
        if not with_message:
            return ((RwsState("dipc-msg-ev", name, {}, (RwsLink("self", path),)),),)
        message = queue.take()
        fields = {
            "dipc-data": message.data,
            "dipc-cmd": message.command,
            "dipc-msgtype": message.kind,
            "dipc-userdef": message.user_def,
        }
        return ((RwsState("dipc-msg-ev", name, fields, (RwsLink("self", path),)),),)

    return Source(read, show)


_Find = Callable[[Irc5, str, Mapping[str, str]], Source]
_KINDS: Sequence[tuple[str, _Find, Priority]] = (
    (r"/rw/panel/(?P<name>ctrlstate|opmode|speedratio|coldetstate)(;\w+)?", _panel_source, Priority.MEDIUM),
    (r"/rw/rapid/execution;ctrlexecstate", _execution_source, Priority.MEDIUM),
    (r"/rw/rapid/execution;rapidexeccycle", _cycle_source, Priority.MEDIUM),
    (r"/rw/rapid/tasks/(?P<task>\w+);excstate", _task_source, Priority.MEDIUM),
    (r"/rw/iosystem/signals/(?P<signal>.+);state", _signal_source, Priority.HIGH),
    (
        r"/rw/rapid/symbol/data/RAPID/(?P<task>\w+)/((?P<module>\w+)/)?(?P<name>[\w{},]+);value",
        _variable_source,
        Priority.HIGH,
    ),
    (r"/rw/elog/(?P<domain>\d{1,3})", _event_log_source, Priority.MEDIUM),
    (r"/rw/rapid/execution;hdtrun", _hold_to_run_source, Priority.MEDIUM),
    (r"/rw/rapid/tasks/(?P<task>\w+);taskchange", _task_change_source, Priority.MEDIUM),
    (r"/rw/rapid/tasks/(?P<task>\w+);syncstatechange", _sync_source, Priority.MEDIUM),
    (r"/rw/rapid/tasks/(?P<task>\w+)/pcp;(program|motion)pointerchange", _pointer_source, Priority.MEDIUM),
    (r"/rw/rapid/tasks;buildlogchange", _build_log_source, Priority.MEDIUM),
    (r"/rw/rapid/taskselection;taskpanelchange", _task_panel_source, Priority.MEDIUM),
    (r"/rw/rapid/uiinstr;uievent", _dialog_source, Priority.MEDIUM),
    (r"/rw/iosystem/networks/(?P<network>\w+);state", _network_source, Priority.MEDIUM),
    (r"/rw/iosystem/devices/(?P<device>[\w/]+);state", _device_source, Priority.MEDIUM),
    (r"/rw/cfg", _cfg_source, Priority.MEDIUM),
    (r"/rw/motionsystem/mechunits;mechunitmodechangecount", _motion_source, Priority.MEDIUM),
    (r"/rw/motionsystem/errorstate;erroreventchange", _error_source, Priority.MEDIUM),
    (r"/rw/system/energy", _energy_source, Priority.MEDIUM),
    (r"/progress/(?P<job>\d+)(;state)?", _job_source, Priority.MEDIUM),
)
"""Path, how its source is found, highest priority."""
