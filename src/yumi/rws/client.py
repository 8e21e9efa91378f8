"""Robot Web Services of a controller in typed calls, one method a resource; SI and chain order come out.

One client holds one session: build it, ``connect`` and ``close`` it, or use it as a context manager. The calls of
each service are in a module of :mod:`yumi.rws.services`; here are the session, subscriptions and restarts.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from queue import Queue
from threading import Lock
from types import TracebackType
from weakref import WeakSet

from yumi.clock import Clock, SystemClock
from yumi.errors import CommandRefused, ControllerRefused, LoginRefused, NoConnection, ProtocolError, YumiError
from yumi.rws import replies
from yumi.rws.documents import Page, Pairs, State, decode_form, read_page
from yumi.rws.events import Change, Interruption, OnChange, OnLost, Resource, Subscription, write_resources
from yumi.rws.replies import SystemInfo
from yumi.rws.services.configuration import Configuration
from yumi.rws.services.controller import Controller, EventLog, Panel
from yumi.rws.services.files import Files
from yumi.rws.services.io import Io
from yumi.rws.services.motion import Motion
from yumi.rws.services.queues import Queues
from yumi.rws.services.rapid import Rapid
from yumi.rws.services.symbols import Symbols
from yumi.rws.services.users import Users
from yumi.rws.session import BUSY, OnProgress, Request, RwsSession, Transport, get
from yumi.rws.transport import HttpTransport

DEFAULT_USER = "Default User"
DEFAULT_PASSWORD = "robotics"  # every controller leaves the factory with it; it is no secret
DEFAULT_TIMEOUT = 4.0  # [s]; a controller that switches many drives on takes up to one

RESTART_DEADLINE = 300.0
"""Longest time a restart may take [s]; a YuMi's takes about a minute."""

_RESTART_POLL = 1.0

log = logging.getLogger(__name__)


class RwsClient(Panel, Rapid, Symbols, Io, Motion, Configuration, Controller, Files, Users, Queues, EventLog):
    """A controller at ``address``: host name or IP address, with ``:port`` if not 80; or a transport to one.

    Every call waits for its turn (see :mod:`yumi.rws.session`), then ends within ``timeout`` [s], or so long
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
        timeout: float = DEFAULT_TIMEOUT,
        clock: Clock | None = None,
    ) -> None:
        self._clock = clock or SystemClock()
        transport = HttpTransport(address, self._clock) if isinstance(address, str) else address
        self.address = transport.address
        self._session = RwsSession(transport, user=user, password=password, timeout=timeout, clock=self._clock)
        self._mastership = Lock()
        self._held: Counter[str] = Counter()
        self._subscriptions: WeakSet[Subscription] = WeakSet()

    def __enter__(self) -> RwsClient:
        self.connect()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def connect(self) -> SystemInfo:
        """Log in, and return which controller answers."""
        try:
            reply = self._session.exchange(get("/rw/system"))
            if not self._session.is_open and reply.status_code != BUSY:
                raise self._session.not_a_controller(f"it answers HTTP {reply.status_code} without a session")
            return replies.system(self._page(reply, "reading the system"))
        except YumiError:
            self._session.close()
            raise

    def close(self) -> None:
        """Log out, if there is a session, and close the connections, those of subscriptions too."""
        for subscription in tuple(self._subscriptions):
            subscription.disconnect()
        try:
            self.log_out()
        except (NoConnection, LoginRefused, ProtocolError) as error:
            # The controller is gone; it forgets the session by itself after five minutes.
            log.debug("no log out: %s", error)
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
            self._session.exchange(get("/logout"))
            self._session.close()

    def call(self, method: str, path: str, query: Pairs = (), form: Pairs | None = None) -> Page | None:
        """Any request of Robot Web Services; the page it is answered with, or None where there is none.

        Args:
            method: of HTTP.
            path: such as ``/rw/panel/opmode``.
            query: parameters in the URL, such as the action.
            form: parameters in the body.
        """
        reply = self._session.exchange(Request(method.upper(), path, query, form))
        self._accepted(reply, f"{method.upper()} {path}")
        return read_page(reply.headers.get("Content-Type", ""), reply.content) if reply.content else None

    def entries(self, path: str) -> tuple[State, ...]:
        """What any list of Robot Web Services shows, on all its pages; ``path`` such as ``/rw/iosystem/signals``."""
        where, _, query = path.partition("?")
        return self._states(f"reading {where}", where, *decode_form(query))

    def wait_for_restart(self, on_progress: OnProgress = lambda text: None, deadline: float = RESTART_DEADLINE) -> None:
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
        while True:
            passed = self._clock.now() - start
            if passed > deadline:
                what = "come back" if has_gone else "restart"
                raise NoConnection(
                    f"The controller at {self.address} does not {what} in {deadline:.0f} s; look at its FlexPendant."
                )
            try:
                self.tasks()
                if has_gone:
                    return
            except (NoConnection, ControllerRefused, ProtocolError):  # gone, or starting: it answers 503 then
                has_gone = True
            on_progress(f"the controller restarts, {passed:.0f} s")
            self._clock.wait(_RESTART_POLL)

    def subscribe(self, resources: Sequence[Resource], on_change: OnChange, on_lost: OnLost) -> Subscription:
        """Receive every change of ``resources`` over a WebSocket, as soon as their priority allows.

        A controller gives a session two subscriptions at most; ``close`` one that is no longer needed.

        Args:
            resources: see :mod:`yumi.rws.events`.
            on_change: called with the present values before this call returns, then with each change on a thread of
                the subscription's own; it must not send requests there.
            on_lost: called once with the reason when nothing more will come since the connection or the session has
                ended; subscribe again. Not after ``close``.

        Raises:
            CommandRefused: there is no resource.
        """
        if not resources:
            raise CommandRefused("A subscription needs a resource; name at least one.")
        reply = self._session.exchange(Request("POST", "/subscription", form=write_resources(resources)))
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
            resources: see :mod:`yumi.rws.events`.
            retry: time between two attempts to subscribe again [s].

        Raises:
            CommandRefused: there is no resource.
            ControllerRefused, LoginRefused: the first subscription is refused; later ones are tried again.
        """
        received: Queue[Change | Interruption] = Queue()
        subscription: Subscription | None = self.subscribe(
            resources, received.put, lambda reason: received.put(Interruption(reason))
        )
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
                        subscription = self.subscribe(
                            resources, received.put, lambda reason: received.put(Interruption(reason))
                        )
                    except (NoConnection, LoginRefused, ControllerRefused, ProtocolError) as error:
                        log.debug("not subscribed again yet: %s", error)
                        self._clock.wait(retry)
        finally:
            if subscription is not None:
                subscription.close()
