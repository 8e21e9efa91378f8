"""What the driver asks a controller over Robot Web Services, in typed calls; SI and chain order come out.

One client holds one session: build it, ``connect`` and ``close`` it, or use it as a context manager.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from types import TracebackType
from typing import TypeVar
from weakref import WeakSet

from yumi.clock import Clock, SystemClock
from yumi.errors import CommandRefused, ControllerRefused, LoginRefused, NoConnection, ProtocolError, YumiError
from yumi.robot.joints import Joints
from yumi.rws import replies, requests
from yumi.rws.documents import Page, Pairs, representations_read_page
from yumi.rws.http import HttpLink, HttpReply
from yumi.rws.replies import CfgInstance, Event, FileInfo, ModuleInfo, Signal, SystemInfo, TaskInfo
from yumi.rws.requests import Request, Resource
from yumi.rws.session import Link, RwsSession
from yumi.rws.subscription import OnChange, OnLost, Subscription
from yumi.rws.types import ControllerState, ExecutionState, OperatingMode

T = TypeVar("T")

DEFAULT_USER = "Default User"
DEFAULT_PASSWORD = "robotics"  # every controller leaves the factory with it; it is no secret
DEFAULT_TIMEOUT = 4.0  # [s]; a controller that switches many drives on takes up to one

_EVENTS_PER_PAGE = 50
_BUSY = 503
_SUCCESS = range(200, 300)

log = logging.getLogger(__name__)


class RwsClient:
    """A controller at ``address``: host name or IP address, with ``:port`` if not 80; or a link to one.

    Every call waits for its turn (see :mod:`yumi.rws.session`), then ends within ``timeout`` [s], and is safe
    from any thread. Every call may raise:

    * NoConnection: nothing answers;
    * LoginRefused: user or password are wrong;
    * ControllerRefused: the controller said no; it has ABB's code;
    * ProtocolError: what answers is not a controller, or says something without meaning.
    """

    def __init__(
        self,
        address: str | Link,
        *,
        user: str = DEFAULT_USER,
        password: str = DEFAULT_PASSWORD,
        timeout: float = DEFAULT_TIMEOUT,
        clock: Clock | None = None,
    ) -> None:
        time = clock or SystemClock()
        link = HttpLink(address, time) if isinstance(address, str) else address
        self.address = link.address
        self._session = RwsSession(link, user=user, password=password, timeout=timeout, clock=time)
        self._subscriptions: WeakSet[Subscription] = WeakSet()

    def __enter__(self) -> RwsClient:
        self.connect()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def connect(self) -> SystemInfo:
        """Log in, make sure that a controller answers, and tell which."""
        try:
            reply = self._session.exchange(requests.get_system())
            if not self._session.is_open and reply.status != _BUSY:
                raise self._session.not_a_controller(f"it answers HTTP {reply.status} without a session")
            return replies.system(self._page(reply, "reading the system"))
        except YumiError:
            self._session.close()
            raise

    def close(self) -> None:
        """Log out, if there is a session, and close the connections, those of subscriptions, too."""
        for subscription in tuple(self._subscriptions):
            subscription.hang_up()
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
            self._session.exchange(requests.log_out())
            self._session.close()

    def system(self) -> SystemInfo:
        """Name, RobotWare version and options."""
        return self._read(requests.get_system(), replies.system, "reading the system")

    def clock(self) -> datetime:
        """Its local time; the controller does not say in which zone."""
        return self._read(requests.get_clock(), replies.clock, "reading the clock")

    def controller_state(self) -> ControllerState:
        """Motors on or off, or the stop that keeps them off."""
        return self._read(requests.get_controller_state(), replies.controller_state, "reading the state of the motors")

    def operating_mode(self) -> OperatingMode:
        """Position of the mode switch."""
        return self._read(requests.get_operating_mode(), replies.operating_mode, "reading the operating mode")

    def set_motors(self, on: bool) -> None:
        """Switch the motors; they may need a moment after the call until ``controller_state`` says so."""
        state = ControllerState.MOTORS_ON if on else ControllerState.MOTORS_OFF
        self._do(requests.set_controller_state(state), f"switching the motors {'on' if on else 'off'}")

    def speed_ratio(self) -> int:
        """Override of all speeds [%]."""
        return self._read(requests.get_speed_ratio(), replies.speed_ratio, "reading the speed ratio")

    def set_speed_ratio(self, percent: int) -> None:
        """Set the override of all speeds, 0 to 100 %.

        Raises:
            CommandRefused: outside that range.
        """
        if not 0 <= percent <= 100:
            raise CommandRefused(f"A speed ratio of {percent} % is not possible; give 0 to 100.")
        self._do(requests.set_speed_ratio(percent), f"setting the speed ratio to {percent} %")

    def execution(self) -> ExecutionState:
        """Whether RAPID runs."""
        return self._read(requests.get_execution(), replies.execution, "reading the RAPID execution")

    def start_rapid(self) -> None:
        """Start RAPID in all selected tasks from where their program pointers are."""
        self._do(requests.start_rapid(), "starting RAPID")

    def stop_rapid(self) -> None:
        """Stop RAPID in all selected tasks."""
        self._do(requests.stop_rapid(), "stopping RAPID")

    def move_pp_to_main(self) -> None:
        """Move the program pointer of every selected task to ``main``; RAPID must be stopped."""
        self._do(requests.move_pp_to_main(), "moving the program pointers to main")

    def restart(self) -> None:
        """Warm restart: every connection and session ends, and the controller does not answer for some time."""
        self._do(requests.restart(), "restarting the controller")

    def tasks(self) -> tuple[TaskInfo, ...]:
        """The RAPID tasks, in the controller's order."""
        return self._read(requests.get_tasks(), replies.tasks, "reading the RAPID tasks")

    def modules(self, task: str) -> tuple[ModuleInfo, ...]:
        """The RAPID modules loaded in ``task``."""
        return self._read(requests.get_modules(task), replies.modules, f"reading the modules of {task}")

    def module_text(self, task: str, module: str) -> str:
        """The text of a module that is loaded, as the controller writes it: PERS data have their present values."""
        request = requests.get_module_text(task, module)
        return self._read(request, replies.module_text, f"reading the module {module} of {task}")

    def load_module(self, task: str, path: str, replace: bool = True) -> None:
        """Load a file of the controller, such as ``HOME:/pick.mod``, as a module of ``task``.

        RAPID must be stopped; while it runs, a RAPID program loads modules itself (``runModuleLoad`` of the state
        machine).

        Args:
            task: such as ``T_ROB_R``.
            path: the file as RAPID names it.
            replace: whether it may take the place of a module of the same name.
        """
        with self._mastership("rapid"):
            self._do(requests.load_module(task, path, replace=replace), f"loading {path} into {task}")

    def unload_module(self, task: str, name: str) -> None:
        """Remove a module from ``task``; RAPID must be stopped."""
        with self._mastership("rapid"):
            self._do(requests.unload_module(task, name), f"unloading {name} from {task}")

    def upload(self, path: str, text: str) -> None:
        """Create or replace a file such as ``HOME:/pick.mod``; RAPID's files are Latin-1.

        Raises:
            CommandRefused: the text has characters that such a file cannot hold.
        """
        try:
            content = text.encode("latin-1")
        except UnicodeEncodeError as error:
            wrong = text[error.start]
            raise CommandRefused(f"RAPID files hold Latin-1 only; {path} cannot have {wrong!r} in it.") from error
        self._do(requests.put_file(path, content), f"writing {path}")

    def download(self, path: str) -> str:
        """Content of a file such as ``HOME:/pick.mod``."""
        reply = self._session.exchange(requests.get_file(path))
        self._accepted(reply, f"reading {path}")
        return reply.body.decode("latin-1")

    def files(self, path: str) -> tuple[FileInfo, ...]:
        """What is in a directory such as ``HOME:/yumi``."""
        return self._read(requests.get_file(path.rstrip("/") + "/"), replies.files, f"listing {path}")

    def delete_file(self, path: str) -> None:
        """Remove a file, or a directory with all that is in it."""
        self._do(requests.delete_file(path), f"removing {path}")

    def symbol(self, task: str, module: str, name: str) -> str:
        """Value of a RAPID symbol as its literal; ``yumi.rws.types`` decodes it."""
        what = f"reading {module}/{name} of {task}"
        return self._read(requests.get_symbol(task, module, name), replies.symbol, what)

    def symbol_type(self, task: str, module: str, name: str) -> str:
        """Name of a RAPID symbol's type."""
        what = f"reading the type of {module}/{name} of {task}"
        return self._read(requests.get_symbol_properties(task, module, name), replies.symbol_type, what)

    def set_symbol(self, task: str, module: str, name: str, literal: str) -> None:
        """Write a RAPID symbol; ``yumi.rws.types`` encodes a literal."""
        self._do(requests.set_symbol(task, module, name, literal), f"writing {module}/{name} of {task}")

    def signal(self, name: str) -> Signal:
        """One I/O signal."""
        return self._read(requests.get_signal(name), replies.signal, f"reading signal {name}")

    def signals(self) -> Mapping[str, float]:
        """The values of all I/O signals by their names, in one request where the controller does not make pages."""
        found: dict[str, float] = {}
        query: Pairs | None = ()
        while query is not None:
            page = self._page(self._session.exchange(requests.get_signals(*query)), "reading all signals")
            found |= replies.signals(page)
            query = page.next_query if page.states else None
        return found

    def set_signal(self, name: str, value: float) -> None:
        """Write the logical value of an I/O signal; group signals take whole numbers."""
        self._do(requests.set_signal(name, value), f"writing signal {name}")

    def pulse_signal(self, name: str) -> None:
        """Give a rising edge, which is what RAPID interrupts wait for; the signal stays high.

        Each level is read back, since a cross connection or another client may hold the signal
        (reference/statemachine.md §2.2).

        Raises:
            CommandRefused: the signal does not keep what is written.
        """
        for level in (0, 1):
            self.set_signal(name, level)
            if self.signal(name).value != level:
                raise CommandRefused(
                    f"Signal {name} of {self.address} does not keep the value {level}; find what else writes it."
                )

    def subscribe(self, resources: Sequence[Resource], on_change: OnChange, on_lost: OnLost) -> Subscription:
        """Be told of every change of ``resources``, over a WebSocket, as soon as their priority allows.

        A controller gives a session two subscriptions at most; ``close`` one that is no longer needed.

        Args:
            resources: see :mod:`yumi.rws.requests`.
            on_change: told the present values before this call returns, then each change on a thread of the
                subscription's own; it must not ask the controller anything there.
            on_lost: told once, in a sentence, when nothing more will come since the connection or the session has
                ended; subscribe again. Not after ``close``.

        Raises:
            CommandRefused: there is no resource.
        """
        if not resources:
            raise CommandRefused("A subscription needs a resource; name at least one.")
        reply = self._session.exchange(requests.subscribe(resources))
        self._accepted(reply, "subscribing")
        subscription = Subscription(self._session, resources, on_change, on_lost)
        subscription.open(reply)
        self._subscriptions.add(subscription)
        return subscription

    def cfg(self, domain: str, type: str) -> tuple[CfgInstance, ...]:
        """All instances of a configuration type, such as ``SIO`` and ``COM_TRP``."""
        return self._read(requests.get_cfg(domain, type), replies.cfg, f"reading the configuration {domain}/{type}")

    def joint_target(self, unit: str) -> Joints:
        """Where the arm ``ROB_R`` or ``ROB_L`` stands, chain order [rad]."""
        target = self._read(requests.get_joint_target(unit), replies.joint_target, f"reading the joints of {unit}")
        return target.chain()

    def events(self, domain: int = 0, count: int = _EVENTS_PER_PAGE) -> tuple[Event, ...]:
        """The newest ``count`` messages of the event log, newest first; domain 0 holds all domains."""
        size = min(count, _EVENTS_PER_PAGE)
        found: tuple[Event, ...] = ()
        while len(found) < count:
            number = len(found) // size + 1
            request = requests.get_events(domain, size, number)
            page = self._read(request, replies.events, f"reading the event log {domain}")
            found += page
            if len(page) < size:
                break
        return found[:count]

    def clear_events(self, domain: int = 0) -> None:
        """Empty an event log; domain 0 empties all."""
        self._do(requests.clear_events(domain), f"clearing the event log {domain}")

    @contextmanager
    def _mastership(self, domain: str) -> Iterator[None]:
        """The right to change programs; whoever forgets to give it back locks the FlexPendant out."""
        self._do(requests.request_mastership(domain), f"requesting the mastership of {domain}")
        try:
            yield
        finally:
            self._session.exchange(requests.release_mastership(domain))

    def _read(self, request: Request, parse: Callable[[Page], T], what: str) -> T:
        return parse(self._page(self._session.exchange(request), what))

    def _do(self, request: Request, what: str) -> None:
        self._accepted(self._session.exchange(request), what)

    def _page(self, reply: HttpReply, what: str) -> Page:
        self._accepted(reply, what)
        return representations_read_page(reply.header("Content-Type") or "", reply.body)

    def _accepted(self, reply: HttpReply, what: str) -> None:
        """Raise unless the controller carried the request out."""
        if reply.status == _BUSY:
            raise ControllerRefused(
                f"The controller at {self.address} is starting, or all its 70 sessions are taken (an idle "
                "one ends after five minutes); try again later.",
                status=reply.status,
            )
        if reply.status not in _SUCCESS:
            kind = reply.header("Content-Type") or ""
            raise replies.refusal(f"{self.address}: {what}", reply.status, kind, reply.body)
