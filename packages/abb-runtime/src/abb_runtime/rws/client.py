"""The client of Robot Web Services: typed calls, and changes by subscription; SI and chain order come out.

One client holds one session: build it, ``connect`` and ``close`` it, or use it as a context manager. The calls of
each service are beside their operations in :mod:`abb_protocols.rws.operations`; here are the session, subscriptions,
masterships that are held, and restarts.

A subscription is a group of resources at the controller, a WebSocket, and the changes on it. A controller sends a
change at once, but at most as often as the priority permits: low every 5 s, medium every 200 ms, high every 50 ms; of a
resource that changes faster, the last value is sent. High is for signals and persistent variables only. Source:
reference/rws.md §14.
"""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from queue import Queue
from threading import Lock
from typing import TypeVar
from weakref import WeakSet

import httpx

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, ControllerRefused, LoginRefused, NoConnection, ProtocolError, YumiError
from abb_protocols.rws.documents import Form, Page, Pairs, RwsState, decode_form, read_page
from abb_protocols.rws.operations import io, mastership, panel, rapid, symbols
from abb_protocols.rws.operations import subscriptions as table
from abb_protocols.rws.operations.configuration import ConfigurationService
from abb_protocols.rws.operations.ctrl import ControllerService
from abb_protocols.rws.operations.event_log import EVENTS, EventLogService
from abb_protocols.rws.operations.files import FilesService
from abb_protocols.rws.operations.io import IoService
from abb_protocols.rws.operations.mastership import MastershipService
from abb_protocols.rws.operations.modules import ModulesService
from abb_protocols.rws.operations.motion import MotionService
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.operations.panel import PanelService
from abb_protocols.rws.operations.queues import QueuesService
from abb_protocols.rws.operations.rapid import RapidService
from abb_protocols.rws.operations.service import OnProgress
from abb_protocols.rws.operations.symbols import SymbolsService
from abb_protocols.rws.operations.system import SYSTEM, SystemInfo, SystemService, read_system
from abb_protocols.rws.operations.users import LOGOUT, UsersService
from abb_protocols.rws.request import BUSY_STATUS, RwsRequest
from abb_protocols.rws.values import PROTOCOL, Priority, Resource, RwsCode
from abb_runtime.clock import Clock, SystemClock
from abb_runtime.rws.session import RwsSession
from abb_runtime.rws.transport import HttpTransport, Transport
from abb_runtime.rws.web_socket import Listener, OpenWebSocket

_log = logging.getLogger(__name__)

_T = TypeVar("_T")

DEFAULT_USER = "Default User"
DEFAULT_PASSWORD = "robotics"  # every controller leaves the factory with it; it is no secret
_DEFAULT_TIMEOUT = 4.0  # [s]; a controller that switches many drives on takes up to one

_RESTART_DEADLINE = 300.0
"""Longest time a restart may take [s]; a YuMi's takes about a minute."""

_RESTART_POLL = 1.0  # [s]

_GROUP = re.compile(r"/poll/(\d+)")


class RwsClient(
    PanelService,
    RapidService,
    ModulesService,
    SymbolsService,
    IoService,
    MotionService,
    ConfigurationService,
    ControllerService,
    SystemService,
    FilesService,
    UsersService,
    MastershipService,
    QueuesService,
    EventLogService,
):
    """A controller at ``address``: host name or IP address, with ``:port`` if not 80; or a transport to one.

    Every call waits for its turn (see :mod:`abb_runtime.rws.session`), then ends within ``timeout`` [s], or so long
    after the last byte of a file, and is safe from any thread. Every call may raise:

    * NoConnection: nothing answers;
    * LoginRefused: user or password are wrong;
    * ControllerRefused: the controller refused; it has ABB's code;
    * ProtocolError: what answers is not a controller, or says something without meaning.
    """

    def __init__(
        self,
        address: str | Transport,
        *,
        user: str = DEFAULT_USER,
        password: str = DEFAULT_PASSWORD,
        timeout: float = _DEFAULT_TIMEOUT,
        clock: Clock | None = None,
    ) -> None:
        self._clock = clock or SystemClock()
        transport = HttpTransport(address, self._clock) if isinstance(address, str) else address
        self.address = transport.address
        self._session = RwsSession(transport, user=user, password=password, timeout=timeout, clock=self._clock)
        self._mastership = Lock()  # while one is requested or released: no thread releases what another is about to use
        self._held: Counter[str] = Counter()
        self._subscriptions: WeakSet[Subscription] = WeakSet()

    def __enter__(self) -> RwsClient:
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def connect(self) -> SystemInfo:
        """Log in, and return which controller answers."""
        try:
            reply = self._session.exchange(SYSTEM.request())
            if not self._session.is_open and reply.status_code != BUSY_STATUS:
                reason = message("answers_without_session", status=reply.status_code)
                raise self._session.not_a_controller(reason)
            return read_system(self._page(reply, "reading the system"))
        except YumiError:
            self._session.close()
            raise

    @property
    def login_count(self) -> int:
        """How often the controller has let us in; after another login it may have restarted, or be another one."""
        return self._session.login_count

    def lift_rate_limit(self) -> None:
        """Send requests as fast as they come until the next login: a virtual controller takes any number a second."""
        self._session.lift_rate_limit()

    def close(self) -> None:
        """Log out, if there is a session, and close the connections, those of subscriptions too."""
        for subscription in tuple(self._subscriptions):
            subscription.disconnect()
        try:
            self.log_out()
        except (NoConnection, LoginRefused, ProtocolError) as error:
            # The controller is gone; it forgets the session by itself after five minutes.
            _log.debug("no log out: %s", error)
        finally:
            self._session.close()

    def abandon(self) -> None:
        """End every call that is under way, and refuse later ones at once, for a program that has to end now.

        They raise NoConnection. ``close`` is still due; the controller forgets the session after five minutes.
        """
        self._session.abandon()

    def log_out(self) -> None:
        """End the session at the controller; the next call opens another."""
        if self._session.is_open:
            self._session.exchange(LOGOUT.request())
            self._session.close()

    def _exchange(self, called: RwsRequest) -> httpx.Response:
        return self._session.exchange(called)

    def _polls(self, period: float, longest: float) -> Iterator[None]:
        end = self._clock.now() + longest
        yield
        while self._clock.now() < end:
            self._clock.wait(period)
            yield

    @contextmanager
    def holding(self, domain: str) -> Iterator[None]:
        """The mastership of ``cfg``, ``rapid`` or ``motion`` for the time of the block.

        A client that keeps it locks the FlexPendant out. A block within another one of the same domain keeps it, in
        any thread.

        Raises:
            ControllerRefused: another client has it, or its release was refused after the block.
        """
        with self._mastership:
            if not self._held[domain]:
                self._call(f"requesting the mastership of {domain}", mastership.REQUEST_MASTERSHIP, domain)
            self._held[domain] += 1
        try:
            yield
        except BaseException:
            try:
                self._release(domain)
            except YumiError as error:  # what failed in the block says more
                _log.warning(
                    "The mastership of %s may still be held, which locks the FlexPendant out: %s", domain, error
                )
            raise
        self._release(domain)

    def _release(self, domain: str) -> None:
        """End one block that holds a mastership; the last one gives it back."""
        with self._mastership:
            self._held[domain] -= 1
            if self._held[domain]:
                return
            try:
                self._call(f"releasing the mastership of {domain}", mastership.RELEASE_MASTERSHIP, domain)
            except ControllerRefused as error:
                if error.code != RwsCode.RESOURCE_NOT_HELD:  # a new session or another mode has ended it already
                    raise

    def call(self, method: str, path: str, query: Pairs = (), form: Pairs | None = None) -> Page | None:
        """Any request of Robot Web Services; the page it is answered with, or None where there is none.

        Args:
            method: of HTTP.
            path: such as ``/rw/panel/opmode``.
            query: parameters in the URL, such as the action.
            form: parameters in the body.
        """
        reply = self._session.exchange(RwsRequest(method.upper(), path, query, form))
        self._accepted(reply, f"{method.upper()} {path}")
        return read_page(reply.headers.get("Content-Type", ""), reply.content) if reply.content else None

    def perform(self, operation: Operation[_T], /, *places: str, **arguments: object) -> _T | None:
        """Any operation of :mod:`abb_protocols.rws.operations`; the value that it shows, or None where it shows none.

        Args:
            operation: such as ``motion.UNIT_LEAD_THROUGH``.
            places: texts for the placeholders in its path, in order.
            arguments: of URL and body by name, with ``_`` for ``-``.
        """
        what = f"{operation.method} {operation.path_of(*places)}"
        reply = self._call(what, operation, *places, **arguments)
        return None if operation.answer is None else operation.answered.of(self._page(reply, what))

    def entries(self, path: str) -> tuple[RwsState, ...]:
        """What any list of Robot Web Services shows, on all its pages; ``path`` such as ``/rw/iosystem/signals``."""
        where, _, query = path.partition("?")
        return self._states(f"reading {where}", RwsRequest("GET", where, decode_form(query)))

    def wait_for_restart(
        self, on_progress: OnProgress = lambda text: None, deadline: float = _RESTART_DEADLINE
    ) -> None:
        """Restart, wait until the controller is gone, and until it answers again.

        Args:
            on_progress: gets what is waited for, with the seconds since the restart.
            deadline: longest wait for either [s].

        Raises:
            NoConnection: it does not go down, or does not come back, in time.
        """
        self.restart()
        start = self._clock.now()
        has_gone = False
        for _ in self._polls(_RESTART_POLL, deadline):
            passed = self._clock.now() - start
            try:
                self.tasks()
                if has_gone:
                    return
            except (NoConnection, ControllerRefused, ProtocolError):  # gone, or starting: it answers 503 then
                has_gone = True
            on_progress(f"the controller restarts, {passed:.0f} s")
        said = message(
            "restart_not_ended" if has_gone else "restart_not_begun", address=self.address, deadline=deadline
        )
        raise NoConnection(said)

    def subscribe(self, resources: Sequence[Resource], on_change: OnChange, on_lost: OnLost) -> Subscription:
        """Receive every change of ``resources`` over a WebSocket, as soon as their priority allows.

        A controller gives a session two subscriptions at most; ``close`` one that is no longer needed.

        Args:
            resources: see :mod:`abb_runtime.rws.client`.
            on_change: called with the present values before this call returns, then with each change on a thread of
                the subscription's own; it must not send requests there.
            on_lost: called once with the reason when nothing more will come since the connection or the session has
                ended; subscribe again. Not after ``close``.

        Raises:
            CommandRefused: there is no resource.
        """
        if not resources:
            raise CommandRefused(message("no_resource_named"))
        reply = self._session.exchange(replace(table.CREATE_SUBSCRIPTION.request(), form=write_resources(resources)))
        self._accepted(reply, "subscribing")
        subscription = Subscription(self._session, resources, on_change, on_lost)
        subscription.open(reply)
        self._subscriptions.add(subscription)
        return subscription

    def watch(self, resources: Sequence[Resource], retry: float = 1.0) -> Iterator[Change | Interruption]:
        """The present values of ``resources`` and then each change, for as long as it is iterated over.

        After a break (the link, the session, a restart of the controller) it subscribes again by itself: an
        :class:`Interruption` says so, and the present values come again, as changes may have been missed.

        Args:
            resources: see :mod:`abb_runtime.rws.client`.
            retry: time between two attempts to subscribe again [s].

        Raises:
            CommandRefused: there is no resource.
            ControllerRefused, LoginRefused: the first subscription is refused; later ones are tried again.
        """
        received: Queue[Change | Interruption] = Queue()

        def subscribed() -> Subscription:
            return self.subscribe(resources, received.put, lambda reason: received.put(Interruption(reason)))

        subscription: Subscription | None = subscribed()
        try:
            while True:
                item = received.get()
                yield item
                if isinstance(item, Change):
                    continue
                if subscription is not None:
                    subscription.disconnect()
                subscription = None
                while subscription is None:
                    try:
                        subscription = subscribed()
                    except (NoConnection, LoginRefused, ControllerRefused, ProtocolError) as error:
                        _log.debug("not subscribed again yet: %s", error)
                        self._clock.wait(retry)
        finally:
            if subscription is not None:
                subscription.close()


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


CONTROLLER_STATE = Resource(panel.CONTROLLER_STATE.path)
"""Field ``ctrlstate``."""

OPERATING_MODE = Resource(panel.OPERATING_MODE.path)
"""Field ``opmode``."""

SPEED_RATIO = Resource(panel.SPEED_RATIO.path)
"""Field ``speedratio``."""

COLLISION_STATE = Resource(panel.COLLISION_STATE.path)
"""Field ``coldetstate``."""

EXECUTION = Resource(f"{rapid.EXECUTION.path};ctrlexecstate")
"""Field ``ctrlexecstate``."""


def signal_state(name: str, priority: Priority = Priority.HIGH) -> Resource:
    """An I/O signal: fields ``lvalue`` and ``lstate``."""
    return Resource(f"{io.SIGNAL.path_of(name)};state", priority)


def variable_value(task: str, module: str, name: str, priority: Priority = Priority.HIGH) -> Resource:
    """A persistent variable (PERS; a VAR cannot be subscribed): field ``value``, its RAPID literal."""
    return Resource(f"{symbols.SYMBOL.path_of(f'{task}/{module}/{name}')};value", priority)


def task_execution(task: str) -> Resource:
    """Execution of one RAPID task: field ``pgmtaskexec-state``."""
    return Resource(f"{rapid.TASK.path_of(task)};excstate")


def event_log(domain: int = 0) -> Resource:
    """The event log: field ``seqnum``, the number of the newest message; domain 0 holds all."""
    return Resource(EVENTS.path_of(str(domain)))


OnChange = Callable[[Change], None]
OnLost = Callable[[str], None]


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
        self._socket: OpenWebSocket | None = None

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
            raise ProtocolError(message("subscription_without_websocket", address=self._session.address))
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
            self._session.exchange(table.DELETE_SUBSCRIPTION.request(str(self._group)))
        except (NoConnection, LoginRefused, ProtocolError) as error:
            _log.debug("no end of a subscription: %s", error)

    def _pass_on(self, text: str) -> None:
        """Report the changes in a message; one that cannot be read ends nothing."""
        try:
            changes = read_changes(text, self._paths)
        except YumiError as error:
            _log.warning("a message of %s cannot be read: %s", self._session.address, error)
            return
        for change in changes:
            self._on_change(change)


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


def read_changes(text: str, paths: Iterable[str]) -> tuple[Change, ...]:
    """The changes in an event or in the answer to a subscription to ``paths``.

    A variable's value comes in a second state, right behind the one that names it.

    Raises:
        ProtocolError: the text is not the XHTML of Robot Web Services.
    """
    known = tuple(paths)
    changes: list[Change] = []
    for state in read_page(Form.XHTML.value, text.encode()).states:
        href = next((link.href for link in state.links if link.rel == "self"), None)
        if href is not None:
            # Messages of the event log have paths below it; signals may come with their network and device.
            near = (path for path in known if href.startswith(f"{path}/") or _signal_of(path) == _signal_of(href) != "")
            changes.append(Change(href if href in known else next(near, href), state.fields))
        elif changes:
            change = changes.pop()
            changes.append(Change(change.path, {**change.fields, **state.fields}))
    return tuple(changes)


def _signal_of(path: str) -> str:
    """Name of the signal of a path, or ""."""
    return path.rpartition("/")[2] if "/iosystem/signals/" in path else ""


def group_of(text: str) -> int | None:
    """Number of the group in an address such as ``ws://192.168.125.1:80/poll/5``."""
    found = _GROUP.search(text)
    return None if found is None else int(found[1])
