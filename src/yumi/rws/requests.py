"""What a client may ask of Robot Web Services, as frozen values (reference/rws.md §4-12).

What a client may subscribe to, and what it is told then (reference/rws.md §14).

A controller tells of a change at once at most as often as the priority says: low every 5 s, medium every 200 ms, high
every 50 ms; what changes faster is told with its last value. High is for signals and persistent variables only.

Subscription groups and their events as documents: XHTML on one line, ASCII, short (reference/rws.md §14.1-14.2).

Clients cut them with regular expressions and receive into buffers of 1024 bytes, so spelling and length count.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from urllib.parse import quote

from yumi.errors import ProtocolError
from yumi.rws import documents as forms
from yumi.rws.documents import XHTML_CONTENT_TYPE, Page, Pairs, State, escaped, representations_read_page, write_item
from yumi.rws.types import ControllerState

PROTOCOL = "robapi2_subscription"
"""Sub-protocol of the WebSocket."""

MAX_GROUPS = 2
"""Groups a session may have."""

MAX_RESOURCES = 1000
"""Resources a group may have."""

MAX_HIGH = 64
"""Resources with high priority, of all clients together."""

_SYMBOL_DATA = "/rw/rapid/symbol/data/RAPID/"


class Priority(IntEnum):
    """How soon a change is told."""

    LOW = 0
    MEDIUM = 1
    HIGH = 2


@dataclass(frozen=True, slots=True)
class Resource:
    """One thing to be told about; ``path`` as the controller spells it, e.g. ``/rw/panel/opmode``."""

    path: str
    priority: Priority = Priority.MEDIUM


@dataclass(frozen=True, slots=True)
class Change:
    """What became of a resource.

    Attributes:
        path: of the resource, as it was subscribed.
        fields: the texts by name, e.g. ``{"opmode": "AUTO"}``; empty where the controller tells only that there is
            something new.
    """

    path: str
    fields: Mapping[str, str] = field(default_factory=dict)


CONTROLLER_STATE = Resource("/rw/panel/ctrlstate")
"""Field ``ctrlstate``."""

OPERATING_MODE = Resource("/rw/panel/opmode")
"""Field ``opmode``."""

SPEED_RATIO = Resource("/rw/panel/speedratio")
"""Field ``speedratio``."""

COLLISION_STATE = Resource("/rw/panel/coldetstate")
"""Field ``coldetstate``."""

EXECUTION = Resource("/rw/rapid/execution;ctrlexecstate")
"""Field ``ctrlexecstate``."""


def signal_state(name: str, priority: Priority = Priority.HIGH) -> Resource:
    """An I/O signal: fields ``lvalue`` and ``lstate``."""
    return Resource(f"/rw/iosystem/signals/{name};state", priority)


def variable_value(task: str, module: str, name: str, priority: Priority = Priority.HIGH) -> Resource:
    """A persistent variable (PERS; a VAR cannot be subscribed): field ``value``, its RAPID literal."""
    return Resource(f"{_SYMBOL_DATA}{task}/{module}/{name};value", priority)


def task_execution(task: str) -> Resource:
    """Execution of one RAPID task: field ``pgmtaskexec-state``."""
    return Resource(f"/rw/rapid/tasks/{task};excstate")


def event_log(domain: int = 0) -> Resource:
    """The event log: field ``seqnum``, the number of the newest message; domain 0 holds all."""
    return Resource(f"/rw/elog/{domain}")


def write_resources(resources: Sequence[Resource]) -> Pairs:
    """The form that asks for ``resources``."""
    pairs: list[tuple[str, str]] = []
    for number, resource in enumerate(resources):
        pairs += [
            ("resources", str(number)),
            (str(number), resource.path),
            (f"{number}-p", str(int(resource.priority))),
        ]
    return tuple(pairs)


def read_resources(form: Pairs) -> tuple[Resource, ...]:
    """The resources a form asks for.

    Raises:
        ProtocolError: a path or a priority is missing, or the priority is none.
    """
    numbers = [value for name, value in form if name == "resources"]
    if not numbers:
        raise ProtocolError("the body lacks resources")
    return tuple(_resource(form, number) for number in numbers)


def _resource(form: Pairs, number: str) -> Resource:
    path, priority = forms.first(form, number), forms.first(form, f"{number}-p")
    if not path or priority is None:
        raise ProtocolError(f"the body lacks {number if not path else f'{number}-p'}")
    if priority not in ("0", "1", "2"):
        raise ProtocolError(f"{number}-p is 0, 1 or 2, not {priority!r}")
    return Resource(path, Priority(int(priority)))


def read_changes(page: Page, paths: Iterable[str]) -> tuple[Change, ...]:
    """The changes in an event or in the answer to a subscription to ``paths``.

    A variable's value comes in a second state, right behind the one that names it.
    """
    known = tuple(paths)
    changes: list[Change] = []
    for state in page.states:
        href = next((link.href for link in state.links if link.rel == "self"), None)
        if href is not None:
            changes.append(Change(_subscribed(href, known), state.fields))
        elif changes:
            changes[-1] = _completed(changes[-1], state)
    return tuple(changes)


def _completed(change: Change, state: State) -> Change:
    return Change(change.path, {**change.fields, **state.fields})


def _subscribed(href: str, paths: tuple[str, ...]) -> str:
    """The path under which ``href`` was subscribed.

    Messages of the event log have paths below it; signals may be told with their network and device.
    """
    if href in paths:
        return href
    for path in paths:
        if href.startswith(f"{path}/") or _signal(path) == _signal(href) != "":
            return path
    return href


def _signal(path: str) -> str:
    """Name of the signal of a path, or ""."""
    return path.rpartition("/")[2] if "/iosystem/signals/" in path else ""


_PATH_SAFE = "/;:$@-._~"


@dataclass(frozen=True, slots=True)
class Request:
    """One request, free of connection and session.

    Attributes:
        method: of HTTP.
        path: resource, unescaped.
        query: parameters in the URL.
        form: parameters in the body; None for a request without a body.
        content: a file in the body instead of a form.
    """

    method: str
    path: str
    query: Pairs = ()
    form: Pairs | None = None
    content: bytes | None = None

    @property
    def target(self) -> str:
        """Path and query as on the request line."""
        path = quote(self.path, safe=_PATH_SAFE)
        return f"{path}?{forms.encode(self.query)}" if self.query else path

    @property
    def body(self) -> bytes:
        """The file, or the form, encoded."""
        return forms.encode(self.form or ()).encode("ascii") if self.content is None else self.content

    @property
    def content_type(self) -> str | None:
        """What the body is; None for a request without one."""
        if self.content is not None:
            return "application/octet-stream"
        return None if self.form is None else forms.CONTENT_TYPE

    @property
    def is_repeatable(self) -> bool:
        """Whether asking twice does no more than asking once."""
        return self.method in ("GET", "PUT")


def get(path: str, *query: tuple[str, str]) -> Request:
    """Read ``path``."""
    return Request("GET", path, query)


def post(path: str, action: str, *form: tuple[str, str]) -> Request:
    """Do ``action`` on ``path``."""
    return Request("POST", path, (("action", action),), form)


def get_system() -> Request:
    """Name, RobotWare version and options."""
    return get("/rw/system")


def get_clock() -> Request:
    return get("/ctrl/clock")


def get_controller_state() -> Request:
    return get("/rw/panel/ctrlstate")


def set_controller_state(state: ControllerState) -> Request:
    """Motors on or off; the controller accepts no other state."""
    return post("/rw/panel/ctrlstate", "setctrlstate", ("ctrl-state", state.value))


def get_operating_mode() -> Request:
    return get("/rw/panel/opmode")


def get_speed_ratio() -> Request:
    return get("/rw/panel/speedratio")


def set_speed_ratio(percent: int) -> Request:
    """Override of all speeds, 0 to 100 %."""
    return post("/rw/panel/speedratio", "setspeedratio", ("speed-ratio", str(percent)))


def get_execution() -> Request:
    return get("/rw/rapid/execution")


def start_rapid() -> Request:
    """Start from the program pointer, for ever, in the tasks selected on the task panel."""
    return post(
        "/rw/rapid/execution",
        "start",
        ("regain", "continue"),
        ("execmode", "continue"),
        ("cycle", "forever"),
        ("condition", "none"),
        ("stopatbp", "disabled"),
        ("alltaskbytsp", "false"),
    )


def stop_rapid() -> Request:
    return post("/rw/rapid/execution", "stop", ("stopmode", "stop"))


def move_pp_to_main() -> Request:
    return post("/rw/rapid/execution", "resetpp")


def get_tasks() -> Request:
    return get("/rw/rapid/tasks")


def get_modules(task: str) -> Request:
    return get("/rw/rapid/modules", ("task", task))


def get_module_text(task: str, module: str) -> Request:
    return get(f"/rw/rapid/modules/{module}", ("resource", "module-text"), ("task", task))


def get_symbol(task: str, module: str, name: str) -> Request:
    return get(f"/rw/rapid/symbol/data/RAPID/{task}/{module}/{name}")


def get_symbol_properties(task: str, module: str, name: str) -> Request:
    return get(f"/rw/rapid/symbol/properties/RAPID/{task}/{module}/{name}")


def set_symbol(task: str, module: str, name: str, literal: str) -> Request:
    """Write a symbol; ``literal`` is the RAPID text of the value."""
    return post(f"/rw/rapid/symbol/data/RAPID/{task}/{module}/{name}", "set", ("value", literal))


def get_signal(name: str) -> Request:
    return get(f"/rw/iosystem/signals/{name}")


def get_signals(*query: tuple[str, str]) -> Request:
    """All signals, or the page of them that ``query`` names."""
    return get("/rw/iosystem/signals", *query)


def set_signal(name: str, value: float) -> Request:
    """Write a signal's logical value; whole numbers are written without decimals."""
    text = str(int(value)) if float(value).is_integer() else repr(value)
    return post(f"/rw/iosystem/signals/{name}", "set", ("lvalue", text))


def get_cfg(domain: str, type: str) -> Request:
    """All instances of a configuration type."""
    return get(f"/rw/cfg/{domain}/{type}/instances")


def get_joint_target(unit: str) -> Request:
    return get(f"/rw/motionsystem/mechunits/{unit}/jointtarget")


def get_events(domain: int, limit: int, page: int = 1) -> Request:
    """The event log, newest first, in English; pages count from 1 and hold ``limit`` (up to 50) messages."""
    return get(
        f"/rw/elog/{domain}",
        ("lang", "en"),
        ("order", "lifo"),
        ("start", str(page)),
        ("limit", str(limit)),
    )


def clear_events(domain: int) -> Request:
    """Empty one event log; domain 0 holds all."""
    return post(f"/rw/elog/{domain}", "clear")


def restart() -> Request:
    """Warm restart: everybody is cut off, programs and configuration stay."""
    return post("/rw/panel", "restart", ("restart-mode", "restart"))


def get_mastership(domain: str) -> Request:
    return get(f"/rw/mastership/{domain}")


def request_mastership(domain: str) -> Request:
    """The right to change what ``domain`` stands for: ``cfg``, ``motion`` or ``rapid``."""
    return post(f"/rw/mastership/{domain}", "request")


def release_mastership(domain: str) -> Request:
    return post(f"/rw/mastership/{domain}", "release")


def load_module(task: str, path: str, *, replace: bool) -> Request:
    """Load a file such as ``HOME:/yumi/pick.mod`` as a module of ``task``."""
    place = f"/rw/rapid/tasks/{task}"
    return post(place, "loadmod", ("modulepath", path), ("replace", "true" if replace else "false"))


def unload_module(task: str, module: str) -> Request:
    return post(f"/rw/rapid/tasks/{task}", "unloadmod", ("module", module))


def get_file(path: str) -> Request:
    """The content of a file, or the list of a directory; ``path`` such as ``HOME:/yumi/pick.mod``."""
    return get(_file_service(path))


def put_file(path: str, content: bytes) -> Request:
    """Create a file, or replace its content."""
    return Request("PUT", _file_service(path), content=content)


def delete_file(path: str) -> Request:
    """Remove a file or a directory."""
    return Request("DELETE", _file_service(path))


def _file_service(path: str) -> str:
    """Where RAPID's ``HOME:/pick.mod`` is on the network; the device's name stands behind ``$`` there."""
    device, _, rest = path.partition(":")
    return f"/fileservice/${device.lower()}/{rest.lstrip('/')}"


def subscribe(resources: Sequence[Resource]) -> Request:
    """A new group of resources to be told about."""
    return Request("POST", "/subscription", form=write_resources(resources))


def unsubscribe(group: int) -> Request:
    return Request("DELETE", f"/subscription/{group}")


def log_out() -> Request:
    return get("/logout")


MAX_EVENT = 1024
"""What the receive buffers of common clients hold [byte]."""

_POLL = re.compile(r"/poll/(\d+)")


def write_group(root: str, group: int, events: Sequence[Sequence[State]]) -> bytes:
    """The answer to a subscription, with the values of this moment; ``root`` is ``host:port`` of the controller."""
    links = (
        f'<a href="subscription/{group}" rel="group"></a>'
        f'<a href="ws://{escaped(root)}/poll/{group}" rel="self"></a>'
        f'<a href="subscription/{group}?action=show" rel="action"></a>'
    )
    return _document(root, links, (state for event in events for state in event))


def write_event(root: str, group: int, event: Sequence[State]) -> str:
    """The message that tells of one event; common clients look for one only in each.

    What is too long for their buffers is told without its value, which a client can read where the link leads.
    """
    link = f'<a href="subscription/{group}" rel="group"></a>'
    text = _document(root, link, event)
    if len(text) > MAX_EVENT:
        text = _document(root, link, [replace(event[0], fields={})])
    return text.decode("ascii")


def read_event(text: str) -> Page:
    """The page in a message or in the answer to a subscription.

    Raises:
        ProtocolError: it is not the XHTML of Robot Web Services.
    """
    return representations_read_page(XHTML_CONTENT_TYPE, text.encode())


def group_of(text: str) -> int | None:
    """Number of the group in an address such as ``ws://192.168.125.1:80/poll/5``."""
    found = _POLL.search(text)
    return None if found is None else int(found[1])


def _document(root: str, links: str, states: Iterable[State]) -> bytes:
    items = "".join(map(write_item, states))
    text = (
        '<?xml version="1.0" encoding="UTF-8"?><html xmlns="http://www.w3.org/1999/xhtml">'
        f'<head><title>Event</title><base href="http://{escaped(root)}/"/></head>'
        f'<body><div class="state">{links}<ul>{items}</ul></div></body></html>'
    )
    return text.encode("ascii", "xmlcharrefreplace")
