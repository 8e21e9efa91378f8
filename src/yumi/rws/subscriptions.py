"""What a client may subscribe to, and what it is told then (reference/rws.md §14).

A controller tells of a change at once at most as often as the priority says: low every 5 s, medium every 200 ms, high
every 50 ms; what changes faster is told with its last value. High is for signals and persistent variables only.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from yumi.errors import ProtocolError
from yumi.rws import forms
from yumi.rws.forms import Pairs
from yumi.rws.pages import Page, State

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
