"""What a client may subscribe to, and its subscription: a group at the controller, a WebSocket, the changes on it.

A controller sends a change at once, but at most as often as the priority permits: low every 5 s, medium every 200 ms,
high every 50 ms; of a resource that changes faster, the last value is sent. High is for signals and persistent
variables only. Source: reference/rws.md §14.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import httpx

from yumi.errors import LoginRefused, NoConnection, ProtocolError, YumiError
from yumi.rws.documents import Form, Page, Pairs, read_page
from yumi.rws.session import Request, RwsSession
from yumi.rws.transport import Listener, Socket

PROTOCOL = "robapi2_subscription"
"""Sub-protocol of the WebSocket."""

_SYMBOL_DATA = "/rw/rapid/symbol/data/RAPID/"


class Priority(IntEnum):
    """How soon a change is sent."""

    LOW = 0
    MEDIUM = 1
    HIGH = 2


@dataclass(frozen=True, slots=True)
class Resource:
    """One thing that can be subscribed; ``path`` as the controller spells it, e.g. ``/rw/panel/opmode``."""

    path: str
    priority: Priority = Priority.MEDIUM


@dataclass(frozen=True, slots=True)
class Change:
    """The new value of a resource.

    Attributes:
        path: of the resource, as it was subscribed.
        fields: the texts by name, e.g. ``{"opmode": "AUTO"}``; empty where the controller says only that there is
            something new.
    """

    path: str
    fields: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Interruption:
    """Changes may have been missed from here on, until the present values come again; ``reason`` says why."""

    reason: str


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


def read_changes(page: Page, paths: Iterable[str]) -> tuple[Change, ...]:
    """The changes in an event or in the answer to a subscription to ``paths``.

    A variable's value comes in a second state, right behind the one that names it.
    """
    known = tuple(paths)
    changes: list[Change] = []
    for state in page.states:
        href = next((link.href for link in state.links if link.rel == "self"), None)
        if href is not None:
            # Messages of the event log have paths below it; signals may come with their network and device.
            near = (path for path in known if href.startswith(f"{path}/") or _signal(path) == _signal(href) != "")
            changes.append(Change(href if href in known else next(near, href), state.fields))
        elif changes:
            change = changes.pop()
            changes.append(Change(change.path, {**change.fields, **state.fields}))
    return tuple(changes)


def _signal(path: str) -> str:
    """Name of the signal of a path, or ""."""
    return path.rpartition("/")[2] if "/iosystem/signals/" in path else ""


_POLL = re.compile(r"/poll/(\d+)")


def read_event(text: str) -> Page:
    """The page in a message or in the answer to a subscription.

    Raises:
        ProtocolError: it is not the XHTML of Robot Web Services.
    """
    return read_page(Form.XHTML.value, text.encode())


def group_of(text: str) -> int | None:
    """Number of the group in an address such as ``ws://192.168.125.1:80/poll/5``."""
    found = _POLL.search(text)
    return None if found is None else int(found[1])


OnChange = Callable[[Change], None]
OnLost = Callable[[str], None]

log = logging.getLogger(__name__)


class Subscription:
    """What ``RwsClient.subscribe`` returns; ``close`` it when it is no longer needed."""

    def __init__(
        self, session: RwsSession, resources: Sequence[Resource], on_change: OnChange, on_lost: OnLost
    ) -> None:
        self._session = session
        self._paths = tuple(resource.path for resource in resources)
        self._on_change = on_change
        self._on_lost = on_lost
        self._group = 0
        self._socket: Socket | None = None

    def open(self, reply: httpx.Response) -> None:
        """Pass on the values that ``reply`` holds, and open the WebSocket it names.

        Raises:
            NoConnection: the WebSocket cannot be reached.
            ControllerRefused: the controller does not open it.
            ProtocolError: the reply names none.
        """
        text = reply.content.decode("utf-8", "replace")
        group = group_of(f"{reply.headers.get('Location', '')} {text}")
        if group is None:
            raise ProtocolError(f"The answer of {self._session.address} to a subscription names no WebSocket.")
        self._group = group
        self._pass_on(text)
        try:
            self._socket = self._session.open_socket(f"/poll/{group}", Listener(PROTOCOL, self._pass_on, self._on_lost))
        except YumiError:
            self._unsubscribe()
            raise

    def close(self) -> None:
        """End the subscription; no callback is called any more. A controller that is gone is not an error."""
        if self.disconnect():
            self._unsubscribe()

    def disconnect(self) -> bool:
        """Close the WebSocket without a request to the controller; whether there was one."""
        socket, self._socket = self._socket, None
        if socket is not None:
            socket.close()
        return socket is not None

    def _unsubscribe(self) -> None:
        try:
            self._session.exchange(Request("DELETE", f"/subscription/{self._group}"))
        except (NoConnection, LoginRefused, ProtocolError) as error:
            log.debug("no end of a subscription: %s", error)

    def _pass_on(self, text: str) -> None:
        """Report the changes in a message; one that cannot be read ends nothing."""
        try:
            changes = read_changes(read_event(text), self._paths)
        except YumiError as error:
            log.warning("a message of %s cannot be read: %s", self._session.address, error)
            return
        for change in changes:
            self._on_change(change)
