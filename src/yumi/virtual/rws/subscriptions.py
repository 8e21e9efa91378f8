"""``/subscription`` and ``/poll``: clients that want to be told (reference/rws.md §14).

Subscription groups: who is to be told of what, what has been told, and on which channel (reference/rws.md §14).

A change is told at once when the resource has been quiet for as long as its priority asks, and else at the end of that
time, with its last value. A group whose client is not connected yet, or not any more, tells the latest values when it
comes.

What a client may be told of when it changes: one source per resource (reference/rws.md §14.4).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

from yumi.errors import ProtocolError
from yumi.rapid.errors import UnknownSymbol
from yumi.rws.documents import Form, Link, State
from yumi.rws.events import (
    MAX_GROUPS,
    MAX_HIGH,
    MAX_RESOURCES,
    PROTOCOL,
    Priority,
    Resource,
    read_resources,
    write_event,
    write_group,
)
from yumi.rws.http import HttpReply
from yumi.rws.types import Code
from yumi.virtual.controller.errors import Refused
from yumi.virtual.controller.signals import path_of, printed
from yumi.virtual.rws.http_server import Channel, Upgrade
from yumi.virtual.rws.routes import Call, Controller, Failure, RapidTask, Route, invalid

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


SPACING: Mapping[Priority, float] = {Priority.LOW: 5.0, Priority.MEDIUM: 0.2, Priority.HIGH: 0.05}
"""Shortest time between two events of a resource [s]."""

GLANCE = 0.012
"""Time between two looks at all resources of a group [s]."""


@dataclass(slots=True)
class Watch:
    """One resource of a group.

    Attributes:
        resource: what it is.
        source: where its value comes from.
        told: the value the client knows.
        quiet_until: no event before this time [s].
    """

    resource: Resource
    source: Source
    told: str | None
    quiet_until: float = -inf

    def news(self, now: float) -> Sequence[Event]:
        """The events that are due."""
        if now < self.quiet_until:
            return ()
        value = self.source.read()
        if value is None or value == self.told:
            return ()
        events = self.source.show(self.told, value)
        self.told = value
        # What changes all the time keeps its pace: a look that comes late does not put off the next.
        begin = self.quiet_until if now - self.quiet_until <= 2.0 * GLANCE else now
        self.quiet_until = begin + SPACING[self.resource.priority]
        return events


@dataclass(slots=True)
class Group:
    """What one client wants to be told of.

    Attributes:
        number: as in its address.
        session: who it belongs to.
        root: host and port as the client calls them.
        watches: by the path of the resource.
        channel: where its events go; None before the client has come.
    """

    number: int
    session: str
    root: str
    watches: dict[str, Watch] = field(default_factory=dict)
    channel: Channel | None = None
    _looked_at: float = -inf

    def advance(self, now: float) -> None:
        """Tell what has changed."""
        if self.channel is None or not self.channel.is_open or now < self._looked_at + GLANCE:
            return
        self._looked_at = now
        for watch in self.watches.values():
            for event in watch.news(now):
                self.channel.send(write_event(self.root, self.number, event))

    def end(self, *, in_order: bool) -> None:
        """Part from the client."""
        if self.channel is not None:
            self.channel.close() if in_order else self.channel.abort()
            self.channel = None


class Groups:
    """All groups of a server."""

    def __init__(self) -> None:
        self._groups: dict[int, Group] = {}
        self._opened = 0

    def of_session(self, session: str) -> list[Group]:
        """The groups of one client."""
        return [group for group in self._groups.values() if group.session == session]

    def listening(self) -> set[str]:
        """The sessions whose clients are connected."""
        groups = self._groups.values()
        return {group.session for group in groups if group.channel is not None and group.channel.is_open}

    def find(self, number: str) -> Group | None:
        """The group of a number as it is written in an address."""
        return next((group for known, group in self._groups.items() if str(known) == number), None)

    def count(self, priority: Priority) -> int:
        """How many resources have a priority, of all clients."""
        watches = (watch for group in self._groups.values() for watch in group.watches.values())
        return sum(watch.resource.priority is priority for watch in watches)

    def open(self, session: str, root: str, watches: Mapping[str, Watch]) -> Group:
        self._opened += 1
        group = Group(self._opened, session, root, dict(watches))
        self._groups[group.number] = group
        return group

    def close(self, group: Group, *, in_order: bool = True) -> None:
        """Forget a group."""
        self._groups.pop(group.number, None)
        group.end(in_order=in_order)

    def keep(self, sessions: Sequence[str]) -> None:
        """Forget the groups of all other sessions, and those whose client has left."""
        for group in tuple(self._groups.values()):
            if group.session not in sessions or (group.channel is not None and group.channel.has_left):
                self.close(group)

    def drop_channels(self) -> None:
        """Cut all clients off; they may come again."""
        for group in self._groups.values():
            group.end(in_order=False)

    def advance(self, now: float) -> None:
        """Tell every client what has changed."""
        for group in self._groups.values():
            group.advance(now)


_CREATED = 201
_OK = 200


class Subscriptions:
    """The groups of all clients, as clients see them."""

    def __init__(self) -> None:
        self.groups = Groups()

    def routes(self) -> tuple[Route, ...]:
        return (
            Route("POST", "/subscription", self._create),
            Route("GET", "/subscription/{group}", self._show),
            Route("PUT", "/subscription/{group}", self._replace),
            Route("DELETE", "/subscription/{group}", self._delete),
            Route("DELETE", "/subscription/{group}/{resource*}", self._delete_resource),
        )

    def upgrade(self, call: Call, protocols: str) -> Upgrade:
        """The WebSocket of ``/poll/{group}``; a client that leaves the number out gets its latest group.

        Raises:
            Failure: the group is somebody else's, or none, or the client does not speak the sub-protocol.
        """
        if PROTOCOL not in (each.strip() for each in protocols.split(",")):
            raise invalid(f"Unsupported Sec-WebSocket-Protocol {protocols!r}; it is {PROTOCOL}")
        own = self.groups.of_session(call.session)
        group = self._find(call, call.path[1]) if len(call.path) > 1 else next(reversed(own), None)
        if group is None:
            raise Failure(404, Code.FAIL, "there is no subscription of this client")
        found = group

        def attach(channel: Channel) -> None:
            found.end(in_order=True)  # a client that comes again leaves its old connection
            found.channel = channel
            if self.groups.find(str(found.number)) is not found:
                found.end(in_order=True)  # the group has ended while the connection was made

        return Upgrade(PROTOCOL, attach)

    def _create(self, controller: Controller, call: Call) -> HttpReply:
        if len(self.groups.of_session(call.session)) >= MAX_GROUPS:
            raise Failure(400, Code.MAX_LIMIT_REACHED, f"a client has {MAX_GROUPS} subscriptions at most")
        watches = self._watches(controller, call)
        return _shown(self.groups.open(call.session, call.host, watches), _CREATED)

    def _replace(self, controller: Controller, call: Call) -> HttpReply:
        group = self._find(call)
        group.watches = self._watches(controller, call, group)
        return _shown(group, _OK)

    def _show(self, controller: Controller, call: Call) -> HttpReply:
        return _shown(self._find(call), _OK)

    def _delete(self, controller: Controller, call: Call) -> HttpReply:
        self.groups.close(self._find(call))
        return HttpReply(_OK, (("Content-Type", Form.XHTML.value),))

    def _delete_resource(self, controller: Controller, call: Call) -> HttpReply:
        group = self._find(call)
        wanted = f"/{call.names['resource'].strip('/')}".lower()
        for path in [path for path in group.watches if path.partition(";")[0].lower() == wanted]:
            del group.watches[path]
        return HttpReply(_OK, (("Content-Type", Form.XHTML.value),))

    def _watches(self, controller: Controller, call: Call, old: Group | None = None) -> dict[str, Watch]:
        resources = _wanted(call)
        high = sum(each.priority is Priority.HIGH for each in resources)
        taken = self.groups.count(Priority.HIGH)
        freed = sum(each.resource.priority is Priority.HIGH for each in old.watches.values()) if old else 0
        if taken - freed + high > MAX_HIGH:
            raise Failure(400, Code.MAX_LIMIT_REACHED, f"{MAX_HIGH} resources have high priority at most")
        return {resource.path: _watch(controller, resource) for resource in resources}

    def _find(self, call: Call, number: str | None = None) -> Group:
        number = call.names["group"] if number is None else number
        group = self.groups.find(number)
        if group is None:
            raise Failure(404, Code.FAIL, f"there is no subscription {number}")
        if group.session != call.session:
            raise Failure(403, Code.DENIED, f"Group {number} does not belong to this client")
        return group


def _wanted(call: Call) -> tuple[Resource, ...]:
    try:
        resources = read_resources(call.form)
    except ProtocolError as error:
        raise invalid(str(error)) from error
    if len(resources) > MAX_RESOURCES:
        raise Failure(400, Code.MAX_LIMIT_REACHED, f"a subscription has {MAX_RESOURCES} resources at most")
    return resources


def _watch(controller: Controller, resource: Resource) -> Watch:
    source = find_source(controller, resource)
    return Watch(resource, source, source.read())


def _shown(group: Group, status: int) -> HttpReply:
    """The group with the values its client knows from now on."""
    events: list[Event] = []
    for watch in group.watches.values():
        if watch.told is not None:
            events += watch.source.show(None, watch.told)
    headers = (("Location", f"ws://{group.root}/poll/{group.number}"), ("Content-Type", Form.XHTML.value))
    return HttpReply(status, headers, write_group(group.root, group.number, events))
