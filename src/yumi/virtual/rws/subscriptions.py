"""``/subscription`` and ``/poll``: events of what changes (reference/rws.md §14).

An event is sent at once when its resource has been quiet for as long as its priority asks, and else at the end of that
time, with the last value. A group whose client is not connected (yet, or any more) sends the latest values when the
client connects.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Protocol

from yumi.errors import ProtocolError
from yumi.rapid.task import Task
from yumi.rapid.types import UnknownSymbol
from yumi.rws.documents import Form, Link, Pairs, State, first_value
from yumi.rws.types import PROTOCOL, Code, Priority, Resource
from yumi.virtual.controller.irc5 import Irc5
from yumi.virtual.controller.signals import path_of, printed
from yumi.virtual.controller_log import Refused
from yumi.virtual.rws import system
from yumi.virtual.rws.http import HttpReply, write_event, write_group
from yumi.virtual.rws.io import MessageService
from yumi.virtual.rws.operations import Call, Failure, Mastership, Operation, Users, invalid
from yumi.virtual.rws.rapid import dialog_fields, execution_state, pointer_fields

Event = tuple[State, ...]
"""One event: a state, or two that belong together."""

_MOST_MESSAGES = 20

MAX_GROUPS = 2
"""Groups a session may have."""

MAX_RESOURCES = 1000
"""Resources a group may have."""

MAX_HIGH = 64
"""Resources with high priority, of all clients together."""


class Channel(Protocol):
    """The server's end of a WebSocket; its methods may be called from any thread."""

    @property
    def is_open(self) -> bool: ...

    @property
    def has_left(self) -> bool:
        """Whether the client has closed the connection in order."""

    def send(self, text: str) -> None:
        """Send a message; it is lost when the channel is closed."""

    def close(self) -> None:
        """End the connection in order."""

    def abort(self) -> None:
        """Break the connection."""


@dataclass(frozen=True, slots=True)
class Upgrade:
    """The answer to a request that opens a WebSocket.

    Attributes:
        protocol: the sub-protocol.
        attach: gets the channel before the client sees that it is open, on the server's thread.
        headers: names and values beside those of the protocol.
    """

    protocol: str
    attach: Callable[[Channel], None]
    headers: tuple[tuple[str, str], ...] = ()


# What can be subscribed to: one source per resource (reference/rws.md §14.4)


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
        Failure: there is none, or not with this priority.
    """
    found_own = (own or {}).get(resource.path.lower())
    if found_own is not None:
        if resource.priority > Priority.MEDIUM:
            raise Failure(400, Code.INVALIDARG, f"{resource.path} has no priority {int(resource.priority)}")
        return found_own
    for pattern, find, highest in _KINDS:
        found = re.fullmatch(pattern, resource.path if rws1 is None else rws1, re.IGNORECASE)
        if found is None:
            continue
        if resource.priority > highest:
            raise Failure(400, Code.INVALIDARG, f"{resource.path} has no priority {int(resource.priority)}")
        return find(controller, resource.path, found.groupdict())
    raise Failure(400, Code.INVALIDARG, f"Invalid resource URI in Create: {resource.path}")


def _field(path: str, type: str, name: str, title: str, read: Callable[[], str]) -> Source:
    """A source whose events are one field."""
    links = (Link("self", path),)
    return Source(read, lambda _, text: ((State(type, title, {name: text}, links),),))


def panel_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    name = names["name"].lower()
    title = "collisiondetectstate" if name == "coldetstate" else name
    return _field(path, f"pnl-{name}-ev", name, title, lambda: system.PANEL_VALUES[name](controller))


def execution_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    return _field(path, "rap-ctrlexecstate-ev", "ctrlexecstate", "ctrlexecstate", lambda: execution_state(controller))


def cycle_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    return _field(path, "rap-execcycle-ev", "rapidexeccycle", "rapidexeccycle", lambda: controller.cycle)


def task_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    task = _find_task(controller, path, names["task"])
    return _field(path, "rap-execstate-ev", "pgmtaskexec-state", task.name, lambda: task.execution.value)


def signal_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    signals = controller.signals
    try:
        signal = signals.get(names["signal"].rpartition("/")[2])
    except Refused as refused:
        raise Failure(400, Code.UNRESOLVED_URL, f"Invalid resource URI in Create: {path}") from refused

    def show(_: str | None, text: str) -> Sequence[Event]:
        fields = {"lvalue": text, "lstate": "simulated" if signals.get(signal.name).is_simulated else "not simulated"}
        return ((State("ios-signalstate-ev", path_of(signal), fields, (Link("self", path),)),),)

    return Source(lambda: printed(signals.get(signal.name).value), show)


def variable_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    task, name = _find_task(controller, path, names["task"]), names["name"]
    # A client may leave the module out.
    for module in [names["module"]] if names["module"] else [each.name for each in task.modules]:
        try:
            kind = task.kind_of(module, name)
        except UnknownSymbol:
            continue
        break
    else:
        raise Failure(400, Code.FAIL, f"Symbol not found: {path}")
    if kind != "per":
        raise Failure(400, Code.SYMBOL_NOT_PERSISTENT, f"{path} is not persistent; only PERS can be subscribed")

    def read() -> str | None:
        try:
            return task.read(module, name)
        except UnknownSymbol:
            return None  # its module has been unloaded

    def show(_: str | None, text: str) -> Sequence[Event]:
        event = State("rap-value-ev", "value", {}, (Link("self", path),))
        return ((event, State("rap-data", f"RAPID/{task.name}/{module}/{name}", {"value": text})),)

    return Source(read, show)


def event_log_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    domain = int(names["domain"])

    def read() -> str:
        return str(next((event.number for event in controller.events.entries(domain)), 0))

    def show(old: str | None, new: str) -> Sequence[Event]:
        """One event for each message since ``old``, at first for the newest; cleared messages are left out."""
        first = int(new) - 1 if old is None else int(old)
        numbers = [event.number for event in controller.events.entries(domain) if event.number > first]
        places = [(f"{path}/{number}", {"seqnum": str(number)}) for number in reversed(numbers[:_MOST_MESSAGES])]
        return [(State("elog-message-ev", place, fields, (Link("self", place),)),) for place, fields in places]

    return Source(read, show)


def hold_to_run_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    """This controller's button is never held: the event does not come."""
    return _field(path, "rap-hdtr-ev", "hdtr-State", "hdtrun", lambda: "HdTREvent WaitLeft")


def task_change_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    task = _find_task(controller, path, names["task"])

    def show(old: str | None, count: str) -> Sequence[Event]:
        fields = {
            "change-count": count,
            "task-name": task.name,
            "module-name": "",
            "program-name": "",
            "changetype": "struc",
        }
        return ((State("rap-task-ev", task.name, {} if old is None else fields, (Link("self", path),)),),)

    return Source(lambda: str(controller.program_changes(task.name)), show)


def sync_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    task = _find_task(controller, path, names["task"])
    return _field(path, "rap-syncstate-ev", "sync-state", task.name, lambda: "off")


def pointer_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    task = _find_task(controller, path, names["task"])

    def read() -> str:
        stack = task.call_stack
        return f"{stack[0].module} {stack[0].routine} {stack[0].line}" if stack else ""

    def show(_: str | None, text: str) -> Sequence[Event]:
        at, fields = pointer_fields(task), {}
        if text and at:
            (begin_line, begin_column), (end_line, end_column) = (
                at[n].split(",") for n in ("beginposition", "endposition")
            )
            fields = {
                "module-name": at["modulemame"],
                "routine-name": at["routinename"],
                "BegPosLine": begin_line,
                "BegPosCol": begin_column,
                "EndPosLine": end_line,
                "EndPosCol": end_column,
            }
        return ((State("rap-pp-ev", task.name, fields, (Link("self", path),)),),)

    return Source(read, show)


def build_log_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    """One event for each change of a program, with the state of its links."""

    def read() -> str:
        return " ".join(f"{name} {controller.program_changes(name)}" for name in controller.tasks)

    def show(_: str | None, text: str) -> Sequence[Event]:
        changed = text.split(" ")
        fields = {"task-name": changed[0], "build-count": changed[1], "build-log-change": "SYS_CTRL_S_OK"}
        return ((State("rap-rap-buildlog-ev", "buildlogchange", fields, (Link("self", path),)),),)

    return Source(read, show)


def task_panel_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    def read() -> str:
        return "".join(str(int(each.is_active)) for each in controller.execution.installed.values())

    def show(_: str | None, text: str) -> Sequence[Event]:
        fields = {"change-count": str(text.count("1"))}
        return ((State("rap-taskpanel-ev", "taskpanelchange", fields, (Link("self", path),)),),)

    return Source(read, show)


def dialog_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    """One event when a program asks something, and one when the question has gone."""

    def read() -> str:
        dialog = controller.devices.pendant.active
        return "" if dialog is None else str(dialog.number)

    def show(_: str | None, text: str) -> Sequence[Event]:
        dialog = controller.devices.pendant.active
        fields = {} if dialog is None else dialog_fields(dialog)
        return ((State("rap-ui-ev", "uievent", fields, (Link("self", path),)),),)

    return Source(read, show)


def network_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    name, stopped = names["network"], controller.signals.stopped

    def show(_: str | None, text: str) -> Sequence[Event]:
        fields = {"lstate": text, "pstate": "running" if text == "started" else "halted"}
        return ((State("ios-networkstate-ev", name, fields, (Link("self", path),)),),)

    return Source(lambda: "stopped" if name in stopped else "started", show)


def device_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    name, disabled = names["device"].rpartition("/")[2], controller.signals.disabled

    def show(_: str | None, text: str) -> Sequence[Event]:
        fields = {"lstate": text, "pstate": "running" if text == "enabled" else "deact"}
        return ((State("ios-devicestate-ev", name, fields, (Link("self", path),)),),)

    return Source(lambda: "disabled" if name in disabled else "enabled", show)


def cfg_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    return _field(path, "cfg-prop-ev", "cc", "cfg", lambda: str(controller.configuration.changes))


def motion_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    return _field(path, "motionsystem-ev", "change-count", "mechunits", lambda: str(controller.motion.changes))


def error_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    return _field(path, "ms-errorstate-ev", "err-count", "errorstate", lambda: "0")


def energy_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    return _field(path, "sys-energy-ev", "change-count", "energy", lambda: "0")


def job_source(controller: Irc5, path: str, names: Mapping[str, str]) -> Source:
    job = controller.jobs.find(names["job"])
    if job is None:
        raise Failure(400, Code.UNRESOLVED_URL, f"Invalid resource URI in Create: {path}")
    found = job

    def read() -> str:
        return "Pending" if not found.is_done else f"Error: {found.failure}" if found.failure else "Ready"

    return _field(path, "progress-ev", "state", str(found.number), read)


def _find_task(controller: Irc5, path: str, name: str) -> Task:
    task = controller.tasks.get(name.upper())
    if task is None:
        raise Failure(400, Code.FAIL, f"Invalid resource URI in Create: {path}")
    return task


def _mastership_source(mastership: Mastership, path: str, domains: Sequence[str]) -> Source:
    def show(_: str | None, text: str) -> Sequence[Event]:
        events = []
        for domain in domains:
            fields = mastership.fields(domain)
            held = "0" if fields["mastership"] == "nomaster" else "1"
            events.append(
                (State("msh-resource-value", domain, {"holdmastership": held, **fields}, (Link("self", path),)),)
            )
        return events

    return Source(lambda: str([mastership.fields(domain) for domain in domains]), show)


def _rmmp_source(users: Users, path: str) -> Source:
    return _field(path, "user-rmmp-ev", "state", "rmmp", lambda: users.state)


def _queue_source(messages: MessageService, path: str, name: str, *, with_message: bool) -> Source:
    """An event for the oldest message; with its data it is taken from the queue."""

    def read() -> str | None:
        queue = messages.find(name)
        return None if queue is None or not queue.messages else f"{queue.taken}"

    def show(old: str | None, _: str) -> Sequence[Event]:
        queue = messages.find(name)
        if queue is None or not queue.messages:
            return ()
        if not with_message:
            return ((State("dipc-msg-ev", name, {}, (Link("self", path),)),),)
        message = queue.take()
        fields = {
            "dipc-data": message.data,
            "dipc-cmd": message.command,
            "dipc-msgtype": message.kind,
            "dipc-userdef": message.user_def,
        }
        return ((State("dipc-msg-ev", name, fields, (Link("self", path),)),),)

    return Source(read, show)


_Find = Callable[[Irc5, str, Mapping[str, str]], Source]
_KINDS: Sequence[tuple[str, _Find, Priority]] = (
    (r"/rw/panel/(?P<name>ctrlstate|opmode|speedratio|coldetstate)(;\w+)?", panel_source, Priority.MEDIUM),
    (r"/rw/rapid/execution;ctrlexecstate", execution_source, Priority.MEDIUM),
    (r"/rw/rapid/execution;rapidexeccycle", cycle_source, Priority.MEDIUM),
    (r"/rw/rapid/tasks/(?P<task>\w+);excstate", task_source, Priority.MEDIUM),
    (r"/rw/iosystem/signals/(?P<signal>.+);state", signal_source, Priority.HIGH),
    (
        r"/rw/rapid/symbol/data/RAPID/(?P<task>\w+)/((?P<module>\w+)/)?(?P<name>[\w{},]+);value",
        variable_source,
        Priority.HIGH,
    ),
    (r"/rw/elog/(?P<domain>\d{1,3})", event_log_source, Priority.MEDIUM),
    (r"/rw/rapid/execution;hdtrun", hold_to_run_source, Priority.MEDIUM),
    (r"/rw/rapid/tasks/(?P<task>\w+);taskchange", task_change_source, Priority.MEDIUM),
    (r"/rw/rapid/tasks/(?P<task>\w+);syncstatechange", sync_source, Priority.MEDIUM),
    (r"/rw/rapid/tasks/(?P<task>\w+)/pcp;(program|motion)pointerchange", pointer_source, Priority.MEDIUM),
    (r"/rw/rapid/tasks;buildlogchange", build_log_source, Priority.MEDIUM),
    (r"/rw/rapid/taskselection;taskpanelchange", task_panel_source, Priority.MEDIUM),
    (r"/rw/rapid/uiinstr;uievent", dialog_source, Priority.MEDIUM),
    (r"/rw/iosystem/networks/(?P<network>\w+);state", network_source, Priority.MEDIUM),
    (r"/rw/iosystem/devices/(?P<device>[\w/]+);state", device_source, Priority.MEDIUM),
    (r"/rw/cfg", cfg_source, Priority.MEDIUM),
    (r"/rw/motionsystem/mechunits;mechunitmodechangecount", motion_source, Priority.MEDIUM),
    (r"/rw/motionsystem/errorstate;erroreventchange", error_source, Priority.MEDIUM),
    (r"/rw/system/energy", energy_source, Priority.MEDIUM),
    (r"/progress/(?P<job>\d+)(;state)?", job_source, Priority.MEDIUM),
)
"""Path, how its source is found, highest priority."""


def read_resources(form: Pairs) -> tuple[Resource, ...]:
    """The resources a form asks for.

    Raises:
        ProtocolError: a path or a priority is missing, or the priority is none.
    """
    numbers = [value for name, value in form if name == "resources"]
    if not numbers:
        raise ProtocolError("the body lacks resources")
    resources: list[Resource] = []
    for number in numbers:
        path, priority = first_value(form, number), first_value(form, f"{number}-p")
        if not path or priority is None:
            raise ProtocolError(f"the body lacks {number if not path else f'{number}-p'}")
        if priority not in ("0", "1", "2"):
            raise ProtocolError(f"{number}-p is 0, 1 or 2, not {priority!r}")
        resources.append(Resource(path, Priority(int(priority))))
    return tuple(resources)


# Groups: what a client has subscribed to, and the channel its events go to


SPACING: Mapping[Priority, float] = {Priority.LOW: 5.0, Priority.MEDIUM: 0.2, Priority.HIGH: 0.05}
"""Shortest time between two events of a resource [s]."""

POLL_PERIOD = 0.012
"""Time after which all resources of a group are read again [s]."""


@dataclass(frozen=True, slots=True)
class Rules:
    """What differs between the versions of Robot Web Services.

    Attributes:
        protocol: sub-protocol of the WebSocket.
        is_secure: whether addresses are those of TLS.
        max_groups: groups a session may have.
        rws1_resource: the path of a resource in 1.0; "" for one that there is not.
        is_adding: whether a change of a group adds to its resources; else it replaces them.
        outlives_connection: whether a group whose WebSocket breaks waits for the next one.
    """

    protocol: str = PROTOCOL
    is_secure: bool = False
    max_groups: int = MAX_GROUPS
    rws1_resource: Callable[[str], str] = str
    is_adding: bool = False
    outlives_connection: bool = True


@dataclass(slots=True)
class Watch:
    """One resource of a group.

    Attributes:
        resource: what it is.
        source: where its value comes from.
        known: the value the client knows.
        quiet_until: no event before this time [s].
    """

    resource: Resource
    source: Source
    known: str | None
    quiet_until: float = -inf

    def due_events(self, now: float) -> Sequence[Event]:
        """The events to send now."""
        if now < self.quiet_until:
            return ()
        value = self.source.read()
        if value is None or value == self.known:
            return ()
        events = self.source.show(self.known, value)
        self.known = value
        # What changes all the time keeps its rate: a poll that comes late does not delay the next event.
        begin = self.quiet_until if now - self.quiet_until <= 2.0 * POLL_PERIOD else now
        self.quiet_until = begin + SPACING[self.resource.priority]
        return events


@dataclass(slots=True)
class Group:
    """What one client has subscribed to together.

    Attributes:
        number: as in its address.
        session: of the client.
        root: host and port as the client calls them.
        is_secure: whether the client comes by TLS.
        watches: by the path of the resource.
        channel: where its events go; None before the client has connected.
    """

    number: int
    session: str
    root: str
    is_secure: bool = False
    watches: dict[str, Watch] = field(default_factory=dict)
    channel: Channel | None = None
    _polled_at: float = -inf

    def advance(self, now: float) -> None:
        """Send the events that are due."""
        if self.channel is None or not self.channel.is_open or now < self._polled_at + POLL_PERIOD:
            return
        self._polled_at = now
        for watch in self.watches.values():
            for event in watch.due_events(now):
                self.channel.send(write_event(self.root, self.number, event, is_secure=self.is_secure))

    def disconnect(self, *, in_order: bool) -> None:
        """End the connection to the client."""
        if self.channel is not None:
            self.channel.close() if in_order else self.channel.abort()
            self.channel = None


class Subscriptions:
    """The groups of all clients of a server, and the operations on them.

    Args:
        mastership: of the server's sessions.
        users: of them.
        messages: their message queues.
        rules: of the version that the server speaks.
    """

    def __init__(self, mastership: Mastership, users: Users, messages: MessageService, rules: Rules) -> None:
        self._rules = rules
        self._mastership = mastership
        self._users = users
        self._messages = messages
        self._groups: dict[int, Group] = {}
        self._opened = 0
        self.operations = (
            Operation("POST", "/subscription", self.create, values={"resources": ()}, status=201),
            Operation("GET", "/subscription/{group}", lambda _, call: _shown(self._find(call), 200)),
            Operation("PUT", "/subscription/{group}", self.replace, values={"resources": ()}),
            Operation("DELETE", "/subscription/{group}", self.delete, status=200),
            Operation("DELETE", "/subscription/{group}/{resource:.+}", self.delete_resource, status=200),
        )

    def listening(self) -> set[str]:
        """The sessions whose clients are connected."""
        groups = self._groups.values()
        return {group.session for group in groups if group.channel is not None and group.channel.is_open}

    def keep(self, sessions: Collection[str]) -> None:
        """Forget the groups of all other sessions, and those whose client has left."""
        for group in tuple(self._groups.values()):
            channel = group.channel
            has_left = channel is not None and channel.has_left
            is_lost = channel is not None and not channel.is_open and not self._rules.outlives_connection
            if group.session not in sessions or has_left or is_lost:
                self._close(group)

    def drop_channels(self) -> None:
        """Break all connections; clients may connect again where a group outlives its connection."""
        for group in tuple(self._groups.values()):
            if group.channel is not None and not self._rules.outlives_connection:
                del self._groups[group.number]
            group.disconnect(in_order=False)

    def advance(self, now: float) -> None:
        """Send the events that are due to every client."""
        for group in self._groups.values():
            group.advance(now)

    def upgrade(self, call: Call, protocols: str) -> Upgrade:
        """The WebSocket of ``/poll/{group}``; a client that leaves the number out gets its latest group.

        Raises:
            Failure: the group is another client's, or there is none, or the sub-protocol is another.
        """
        protocol = self._rules.protocol
        if protocol not in (each.strip() for each in protocols.split(",")):
            raise invalid(f"Unsupported Sec-WebSocket-Protocol {protocols!r}; it is {protocol}")
        if len(call.path) > 1:
            group = self._find(call, call.path[1])
        else:
            own = [group for group in self._groups.values() if group.session == call.session]
            if not own:
                raise Failure(404, Code.FAIL, "there is no subscription of this client")
            group = own[-1]

        def attach(channel: Channel) -> None:
            group.disconnect(in_order=True)  # a client that connects again leaves its old connection
            group.channel = channel
            if self._groups.get(group.number) is not group:
                group.disconnect(in_order=True)  # the group was closed while the connection was made

        return Upgrade(protocol, attach)

    def create(self, controller: Irc5, call: Call) -> HttpReply:
        most = self._rules.max_groups
        if sum(group.session == call.session for group in self._groups.values()) >= most:
            raise Failure(400, Code.MAX_LIMIT_REACHED, f"a client has {most} subscriptions at most")
        watches = self._watches(controller, call)
        self._opened += 1
        group = self._groups[self._opened] = Group(
            self._opened, call.session, call.host, self._rules.is_secure, watches
        )
        return _shown(group, 201)

    def replace(self, controller: Irc5, call: Call) -> HttpReply:
        group = self._find(call)
        watches = self._watches(controller, call, group)
        group.watches = {**group.watches, **watches} if self._rules.is_adding else watches
        return _shown(group, 200)

    def delete(self, controller: Irc5, call: Call) -> HttpReply:
        self._close(self._find(call))
        return HttpReply(200, (("Content-Type", Form.XHTML.value),))

    def delete_resource(self, controller: Irc5, call: Call) -> HttpReply:
        group = self._find(call)
        deleted = f"/{call.names['resource'].strip('/')}".lower()
        for path in [path for path in group.watches if path.partition(";")[0].lower() == deleted]:
            del group.watches[path]
        return HttpReply(200, (("Content-Type", Form.XHTML.value),))

    def _watches(self, controller: Irc5, call: Call, old: Group | None = None) -> dict[str, Watch]:
        """What a form asks for, within the limits of a group and of all clients together."""
        try:
            resources = read_resources(call.form)
        except ProtocolError as error:
            raise invalid(str(error)) from error
        if len(resources) > MAX_RESOURCES:
            raise Failure(400, Code.MAX_LIMIT_REACHED, f"a subscription has {MAX_RESOURCES} resources at most")
        others = (group for group in self._groups.values() if group is not old)
        present = [watch.resource for group in others for watch in group.watches.values()]
        if sum(each.priority is Priority.HIGH for each in (*present, *resources)) > MAX_HIGH:
            raise Failure(400, Code.MAX_LIMIT_REACHED, f"{MAX_HIGH} resources have high priority at most")
        sources = {}
        for resource in resources:
            rws1 = self._rules.rws1_resource(resource.path)
            sources[resource] = find_source(controller, resource, self._own_sources(resource), rws1)
        return {resource.path: Watch(resource, source, source.read()) for resource, source in sources.items()}

    def _own_sources(self, resource: Resource) -> Mapping[str, Source]:
        """Sources of what belongs to sessions: masterships, the privilege of manual mode, message queues."""
        path = resource.path
        sources = {"/users/rmmp": _rmmp_source(self._users, path), "/users/remoteuser": _rmmp_source(self._users, path)}
        for domain in self._mastership.names:
            sources[f"/rw/mastership/{domain}"] = _mastership_source(self._mastership, path, (domain,))
        sources["/rw/mastership"] = _mastership_source(self._mastership, path, self._mastership.names)
        queue = re.fullmatch(r"/rw/dipc/([^/;]+)(;nomessage)?", path, re.IGNORECASE)
        if queue is not None and self._messages.find(queue[1]) is not None:
            sources[path.lower()] = _queue_source(self._messages, path, queue[1], with_message=queue[2] is None)
        return sources

    def _find(self, call: Call, number: str | None = None) -> Group:
        number = call.names["group"] if number is None else number
        group = next((group for known, group in self._groups.items() if str(known) == number), None)
        if group is None:
            raise Failure(404, Code.FAIL, f"there is no subscription {number}")
        if group.session != call.session:
            raise Failure(403, Code.DENIED, f"Group {number} does not belong to this client")
        return group

    def _close(self, group: Group) -> None:
        self._groups.pop(group.number, None)
        group.disconnect(in_order=True)


def _shown(group: Group, status: int) -> HttpReply:
    """The group with the values its client knows from now on."""
    events: list[Event] = []
    for watch in group.watches.values():
        if watch.known is not None:
            events += watch.source.show(None, watch.known)
    scheme = "wss" if group.is_secure else "ws"
    headers = (("Location", f"{scheme}://{group.root}/poll/{group.number}"), ("Content-Type", Form.XHTML.value))
    return HttpReply(status, headers, write_group(group.root, group.number, events, is_secure=group.is_secure))
