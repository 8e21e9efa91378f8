"""Robot Web Services of a controller in typed calls, one method a resource; SI and chain order come out.

One client holds one session: build it, ``connect`` and ``close`` it, or use it as a context manager. Paths, queries and
forms are in reference/rws.md §4-12; what a page holds is read in :mod:`yumi.rws.replies`.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from queue import Queue
from types import TracebackType
from typing import TypeVar
from weakref import WeakSet

import httpx

from yumi.clock import Clock, SystemClock
from yumi.errors import CommandRefused, ControllerRefused, LoginRefused, NoConnection, ProtocolError, YumiError
from yumi.robot.joints import Joints
from yumi.rws import replies
from yumi.rws.documents import Page, Pairs, read_page
from yumi.rws.events import Change, Interruption, OnChange, OnLost, Resource, Subscription, write_resources
from yumi.rws.replies import CfgInstance, ControllerIdentity, Event, FileInfo, ModuleInfo, Signal, SystemInfo, TaskInfo
from yumi.rws.session import BUSY, Request, RwsSession, Transport
from yumi.rws.transport import HttpTransport
from yumi.rws.types import CollisionState, ControllerState, ExecutionState, OperatingMode, RapidValue, decode, encode

T = TypeVar("T")

DEFAULT_USER = "Default User"
DEFAULT_PASSWORD = "robotics"  # every controller leaves the factory with it; it is no secret
DEFAULT_TIMEOUT = 4.0  # [s]; a controller that switches many drives on takes up to one

RESTART_DEADLINE = 300.0
"""Longest time a restart may take [s]; a YuMi's takes about a minute."""

_RESTART_POLL = 1.0
_BACKUP_POLL = 0.5
_BACKUP_DEADLINE = 600.0
_PROGRESS = re.compile(r"/progress/[\w-]+")

OnProgress = Callable[[str], None]
"""Called with what is being done, in a few words."""

_SIGNALS = "/rw/iosystem/signals"
_SYMBOLS = "/rw/rapid/symbol"
_EVENTS_PER_PAGE = 50

log = logging.getLogger(__name__)


class RwsClient:
    """A controller at ``address``: host name or IP address, with ``:port`` if not 80; or a transport to one.

    Every call waits for its turn (see :mod:`yumi.rws.session`), then ends within ``timeout`` [s], and is safe
    from any thread. Every call may raise:

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
            reply = self._session.exchange(_get("/rw/system"))
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
            self._session.exchange(_get("/logout"))
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

    def identity(self) -> ControllerIdentity:
        """Name, serial number and kind of the controller."""
        return self._read(_get("/ctrl/identity"), replies.identity, "reading the identity")

    def system(self) -> SystemInfo:
        """Name, RobotWare version and options."""
        return self._read(_get("/rw/system"), replies.system, "reading the system")

    def clock(self) -> datetime:
        """Its local time; the controller does not say in which zone."""
        return self._read(_get("/ctrl/clock"), replies.clock, "reading the clock")

    def controller_state(self) -> ControllerState:
        """Motors on or off, or the stop that keeps them off."""
        return self._read(_get("/rw/panel/ctrlstate"), replies.controller_state, "reading the state of the motors")

    def operating_mode(self) -> OperatingMode:
        """Position of the mode switch."""
        return self._read(_get("/rw/panel/opmode"), replies.operating_mode, "reading the operating mode")

    def collision_state(self) -> CollisionState:
        """State of the collision detection."""
        return self._read(_get("/rw/panel/coldetstate"), replies.collision_state, "reading the collision state")

    def mastership(self, domain: str) -> str:
        """Which other client holds the right to change ``cfg``, ``rapid`` or ``motion``; empty where none does."""
        return self._read(_get(f"/rw/mastership/{domain}"), replies.mastership, f"reading the mastership of {domain}")

    def set_motors(self, on: bool) -> None:
        """Switch the motors; they may need a moment after the call until ``controller_state`` says so."""
        state = ControllerState.MOTORS_ON if on else ControllerState.MOTORS_OFF
        self._do(
            _post("/rw/panel/ctrlstate", "setctrlstate", ("ctrl-state", state.value)),
            f"switching the motors {'on' if on else 'off'}",
        )

    def speed_ratio(self) -> int:
        """Override of all speeds [%]."""
        return self._read(_get("/rw/panel/speedratio"), replies.speed_ratio, "reading the speed ratio")

    def set_speed_ratio(self, percent: int) -> None:
        """Set the override of all speeds, 0 to 100 %.

        Raises:
            CommandRefused: outside that range.
        """
        if not 0 <= percent <= 100:
            raise CommandRefused(f"A speed ratio of {percent} % is not possible; give 0 to 100.")
        self._do(
            _post("/rw/panel/speedratio", "setspeedratio", ("speed-ratio", str(percent))),
            f"setting the speed ratio to {percent} %",
        )

    def execution(self) -> ExecutionState:
        """Whether RAPID runs."""
        return self._read(_get("/rw/rapid/execution"), replies.execution, "reading the RAPID execution")

    def start_rapid(self) -> None:
        """Start RAPID in all selected tasks from where their program pointers are."""
        form = (
            ("regain", "continue"),
            ("execmode", "continue"),
            ("cycle", "forever"),
            ("condition", "none"),
            ("stopatbp", "disabled"),
            ("alltaskbytsp", "false"),
        )
        self._do(_post("/rw/rapid/execution", "start", *form), "starting RAPID")

    def stop_rapid(self) -> None:
        """Stop RAPID in all selected tasks."""
        self._do(_post("/rw/rapid/execution", "stop", ("stopmode", "stop")), "stopping RAPID")

    def move_pp_to_main(self) -> None:
        """Move the program pointer of every selected task to ``main``; RAPID must be stopped."""
        self._do(_post("/rw/rapid/execution", "resetpp"), "moving the program pointers to main")

    def restart(self) -> None:
        """Warm restart: every connection and session ends, and the controller does not answer for some time."""
        self._do(_post("/rw/panel", "restart", ("restart-mode", "restart")), "restarting the controller")

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

    def backup(self, name: str, on_progress: OnProgress = lambda text: None) -> str:
        """Have the controller back itself up; where the backup is, such as ``BACKUP:/before_yumi``.

        Args:
            name: of the directory of the backup.
            on_progress: gets the state of it as the controller says it.

        Raises:
            ControllerRefused: it cannot, or the backup failed.
            NoConnection: it does not end in time.
            ProtocolError: the controller does not say where its progress is.
        """
        what = f"making the backup {name}"
        reply = self._session.exchange(_post("/ctrl/backup", "backup", ("backup", f"/fileservice/$BACKUP/{name}")))
        self._accepted(reply, what)
        found = _PROGRESS.search(reply.headers.get("Location", ""))
        if found is None and reply.status_code == httpx.codes.ACCEPTED:
            raise ProtocolError(f"{self.address}: {what} was begun, but the controller does not say how far it is.")
        start = self._clock.now()
        while found is not None:
            state = self._read(_get(found[0]), replies.progress, what)
            on_progress(state.state)
            if not state.is_pending:
                if state.code not in (0, replies.DONE):
                    raise ControllerRefused(f"{self.address}: {what} failed: {state.state}.", status=0, code=state.code)
                break
            if self._clock.now() - start > _BACKUP_DEADLINE:
                raise NoConnection(f"{self.address}: {what} does not end within {_BACKUP_DEADLINE:.0f} s.")
            self._clock.wait(_BACKUP_POLL)
        return f"BACKUP:/{name}"

    def restore(self, name: str) -> None:
        """Have the controller become as in the backup ``name`` in BACKUP; it restarts, see ``wait_for_restart``."""
        form = ("backup", f"/fileservice/$BACKUP/{name}")
        self._do(_post("/ctrl/backup", "restore", form), f"restoring the backup {name}")

    def tasks(self) -> tuple[TaskInfo, ...]:
        """The RAPID tasks, in the controller's order."""
        return self._read(_get("/rw/rapid/tasks"), replies.tasks, "reading the RAPID tasks")

    def modules(self, task: str) -> tuple[ModuleInfo, ...]:
        """The RAPID modules loaded in ``task``."""
        return self._read(_get("/rw/rapid/modules", ("task", task)), replies.modules, f"reading the modules of {task}")

    def module_text(self, task: str, module: str) -> str:
        """The text of a module that is loaded, as the controller writes it: PERS data have their present values."""
        request = _get(f"/rw/rapid/modules/{module}", ("resource", "module-text"), ("task", task))
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
            form = (("modulepath", path), ("replace", "true" if replace else "false"))
            self._do(_post(f"/rw/rapid/tasks/{task}", "loadmod", *form), f"loading {path} into {task}")

    def unload_module(self, task: str, name: str) -> None:
        """Remove a module from ``task``; RAPID must be stopped."""
        with self._mastership("rapid"):
            self._do(_post(f"/rw/rapid/tasks/{task}", "unloadmod", ("module", name)), f"unloading {name} from {task}")

    def write_file(self, path: str, content: bytes) -> None:
        """Create or replace a file such as ``HOME:/logo.png``."""
        self._do(Request("PUT", _file(path), content=content), f"writing {path}")

    def read_file(self, path: str) -> bytes:
        """Content of a file such as ``HOME:/pick.mod``."""
        reply = self._session.exchange(_get(_file(path)))
        self._accepted(reply, f"reading {path}")
        return reply.content

    def read_tree(self, path: str, on_progress: OnProgress = lambda text: None) -> dict[str, bytes]:
        """Every file in a directory and those below it, by its path behind ``path``."""
        found: dict[str, bytes] = {}
        folders = [""]
        while folders:
            folder = folders.pop()
            for entry in self.files(f"{path}{folder}"):
                name = f"{folder}/{entry.name}"
                if entry.size is None:
                    folders.append(name)
                else:
                    found[name.lstrip("/")] = self.read_file(f"{path}{name}")
                    on_progress(f"{path}{name}")
        return found

    def make_directory(self, path: str) -> None:
        """Create a directory such as ``HOME:/yumi``; the one above it must be there."""
        above, _, name = path.rstrip("/").rpartition("/")
        form = (("fs-action", "create"), ("fs-newname", name))
        self._do(Request("POST", _file(f"{above}/").rstrip("/"), form=form), f"creating {path}")

    def copy_file(self, path: str, name: str, *, replace: bool = False) -> None:
        """Copy a file within its directory, to the name ``name``."""
        form = (("fs-action", "copy"), ("fs-newname", name), ("fs-overwrite", "true" if replace else "false"))
        self._do(Request("POST", _file(path), form=form), f"copying {path}")

    def rename_file(self, path: str, name: str) -> None:
        """Give a file or directory another name in its directory."""
        form = (("fs-action", "rename"), ("fs-newname", name))
        self._do(Request("POST", _file(path), form=form), f"renaming {path}")

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
        self.write_file(path, content)

    def download(self, path: str) -> str:
        """Content of a file such as ``HOME:/pick.mod``."""
        return self.read_file(path).decode("latin-1")

    def files(self, path: str) -> tuple[FileInfo, ...]:
        """What is in a directory such as ``HOME:/yumi``."""
        return self._read(_get(_file(path.rstrip("/") + "/")), replies.files, f"listing {path}")

    def delete_file(self, path: str) -> None:
        """Remove a file, or a directory with all that is in it."""
        self._do(Request("DELETE", _file(path)), f"removing {path}")

    def symbol(self, task: str, module: str, name: str) -> str:
        """Value of a RAPID symbol as its literal; ``yumi.rws.types`` decodes it."""
        what = f"reading {module}/{name} of {task}"
        return self._read(_get(f"{_SYMBOLS}/data/RAPID/{task}/{module}/{name}"), replies.symbol, what)

    def value(self, task: str, module: str, name: str) -> RapidValue:
        """Value of a RAPID symbol: a number, bool, string, or a tuple for a record or an array."""
        return decode(self.symbol(task, module, name))

    def set_value(self, task: str, module: str, name: str, value: RapidValue) -> None:
        """Write a RAPID symbol; a record or an array is a tuple.

        Raises:
            CommandRefused: the value has a number that is not finite.
        """
        self.set_symbol(task, module, name, encode(value))

    def symbol_type(self, task: str, module: str, name: str) -> str:
        """Name of a RAPID symbol's type."""
        what = f"reading the type of {module}/{name} of {task}"
        return self._read(_get(f"{_SYMBOLS}/properties/RAPID/{task}/{module}/{name}"), replies.symbol_type, what)

    def set_symbol(self, task: str, module: str, name: str, literal: str) -> None:
        """Write a RAPID symbol; ``yumi.rws.types`` encodes a literal."""
        self._do(
            _post(f"{_SYMBOLS}/data/RAPID/{task}/{module}/{name}", "set", ("value", literal)),
            f"writing {module}/{name} of {task}",
        )

    def signal(self, name: str) -> Signal:
        """One I/O signal."""
        return self._read(_get(f"{_SIGNALS}/{name}"), replies.signal, f"reading signal {name}")

    def signals(self) -> Mapping[str, float]:
        """The values of all I/O signals by their names, in one request where the controller does not make pages."""
        found: dict[str, float] = {}
        query: Pairs | None = ()
        while query is not None:
            page = self._page(self._session.exchange(_get(_SIGNALS, *query)), "reading all signals")
            found |= replies.signals(page)
            query = page.next_query if page.states else None
        return found

    def set_signal(self, name: str, value: float) -> None:
        """Write the logical value of an I/O signal; group signals take whole numbers."""
        text = str(int(value)) if float(value).is_integer() else repr(value)
        self._do(_post(f"{_SIGNALS}/{name}", "set", ("lvalue", text)), f"writing signal {name}")

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

    def cfg(self, domain: str, type: str) -> tuple[CfgInstance, ...]:
        """All instances of a configuration type, such as ``SIO`` and ``COM_TRP``."""
        found: tuple[CfgInstance, ...] = ()
        query: Pairs | None = ()
        while query is not None:
            request = _get(f"/rw/cfg/{domain}/{type}/instances", *query)
            page = self._page(self._session.exchange(request), f"reading the configuration {domain}/{type}")
            found += replies.cfg(page)
            query = page.next_query if page.states else None
        return found

    def set_cfg(self, domain: str, type: str, name: str, attributes: Mapping[str, str]) -> None:
        """Change attributes of an instance of the configuration; they act after the next restart."""
        with self._mastership("cfg"):
            request = _post(f"/rw/cfg/{domain}/{type}/instances/{name}", "set", *attributes.items())
            self._do(request, f"changing {domain}/{type}/{name}")

    def create_cfg(self, domain: str, type: str, name: str) -> None:
        """Add an instance with default values to the configuration; it acts after the next restart."""
        with self._mastership("cfg"):
            request = _post(f"/rw/cfg/{domain}/{type}/instances", "create-default", ("name", name))
            self._do(request, f"adding {domain}/{type}/{name}")

    def remove_cfg(self, domain: str, type: str, name: str) -> None:
        """Remove an instance of the configuration; it is gone after the next restart."""
        with self._mastership("cfg"):
            request = Request("DELETE", f"/rw/cfg/{domain}/{type}/instances/{name}")
            self._do(request, f"removing {domain}/{type}/{name}")

    def load_cfg(self, path: str, *, replace: bool = False) -> None:
        """Load a cfg file of the controller such as ``HOME:/SIO.cfg``; it acts after the next restart.

        Args:
            path: the file as RAPID names it.
            replace: whether its instances take the place of those of the same names, which are an error otherwise.
        """
        form = (("filepath", _file(path)), ("action-type", "replace" if replace else "add"))
        with self._mastership("cfg"):
            self._do(_post("/rw/cfg", "load", *form), f"loading {path}")

    def save_cfg(self, domain: str, path: str) -> None:
        """Write a domain of the configuration, such as ``SIO``, to a file of the controller."""
        self._do(_post(f"/rw/cfg/{domain}", "saveas", ("filepath", _file(path))), f"saving {domain} to {path}")

    def joint_target(self, unit: str) -> Joints:
        """Where the arm ``ROB_R`` or ``ROB_L`` stands, chain order [rad]."""
        target = self._read(
            _get(f"/rw/motionsystem/mechunits/{unit}/jointtarget"),
            replies.joint_target,
            f"reading the joints of {unit}",
        )
        return target.chain()

    def events(self, domain: int = 0, count: int = _EVENTS_PER_PAGE) -> tuple[Event, ...]:
        """The newest ``count`` messages of the event log, newest first; domain 0 holds all domains."""
        size = min(count, _EVENTS_PER_PAGE)
        found: tuple[Event, ...] = ()
        while len(found) < count:
            number = len(found) // size + 1
            query = (("lang", "en"), ("order", "lifo"), ("start", str(number)), ("limit", str(size)))
            page = self._read(_get(f"/rw/elog/{domain}", *query), replies.events, f"reading the event log {domain}")
            found += page
            if len(page) < size:
                break
        return found[:count]

    def clear_events(self, domain: int = 0) -> None:
        """Empty an event log; domain 0 empties all."""
        self._do(_post(f"/rw/elog/{domain}", "clear"), f"clearing the event log {domain}")

    @contextmanager
    def _mastership(self, domain: str) -> Iterator[None]:
        """The right to change programs; a client that keeps it locks the FlexPendant out."""
        self._do(_post(f"/rw/mastership/{domain}", "request"), f"requesting the mastership of {domain}")
        try:
            yield
        finally:
            self._session.exchange(_post(f"/rw/mastership/{domain}", "release"))

    def _read(self, request: Request, parse: Callable[[Page], T], what: str) -> T:
        return parse(self._page(self._session.exchange(request), what))

    def _do(self, request: Request, what: str) -> None:
        self._accepted(self._session.exchange(request), what)

    def _page(self, reply: httpx.Response, what: str) -> Page:
        self._accepted(reply, what)
        return read_page(reply.headers.get("Content-Type", ""), reply.content)

    def _accepted(self, reply: httpx.Response, what: str) -> None:
        """Raise unless the controller carried the request out."""
        if reply.status_code == BUSY:
            raise ControllerRefused(
                f"The controller at {self.address} is starting, or all its 70 sessions are taken (an idle "
                "one ends after five minutes); try again later.",
                status=reply.status_code,
            )
        if not reply.is_success:
            kind = reply.headers.get("Content-Type", "")
            raise replies.refusal(f"{self.address}: {what}", reply.status_code, kind, reply.content)


def _get(path: str, *query: tuple[str, str]) -> Request:
    return Request("GET", path, query)


def _post(path: str, action: str, *form: tuple[str, str]) -> Request:
    return Request("POST", path, (("action", action),), form)


def _file(path: str) -> str:
    """Where RAPID's ``HOME:/pick.mod`` is on the network; the device's name stands behind ``$`` there."""
    device, _, rest = path.partition(":")
    return f"/fileservice/${device.lower()}/{rest.lstrip('/')}"
