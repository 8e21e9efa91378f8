"""The virtual controller in real time, on sockets: :class:`VirtualController` is its process.

The world is in the main thread, the HTTP server with its WebSockets in another, under one lock. What takes longer than
a cycle (parsing, linking and compiling RAPID) is done in a third, without the lock: the result is published at once.
:class:`HttpServer` owns the port and asks a function for every answer.

RAPID programs get real TCP and UDP sockets that never wait (:class:`ProgramNetwork`). Unless the user allows another
address, nothing leaves this machine: whatever address of its cell a program binds or connects to, it means this
machine, as the UDPUC devices of ``SIO.cfg`` do (docs/explanation/decisions/0036).
"""

from __future__ import annotations

import asyncio
import errno
import gc
import logging
import os
import re
import socket
import ssl
import struct
import time
import weakref
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from functools import partial
from ipaddress import ip_address
from pathlib import Path
from queue import Queue
from tempfile import TemporaryDirectory
from threading import Event as Flag
from threading import Lock, Thread
from types import TracebackType
from typing import TypeVar

from aiohttp import WSCloseCode, web

from yumi.catalogue import message
from yumi.clock import Clock, SystemClock
from yumi.egm.udp import UdpClient, is_loopback, resolve
from yumi.errors import NoConnection, SettingsError, missing_extra
from yumi.process.realtime import prefer_process, prefer_thread, release_process, short_switch_interval
from yumi.rapid.parser import LONGEST_MODULE
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import CYCLE, Side
from yumi.rws.types import GRANTS, EventType, Grant
from yumi.virtual.controller.installed_system import System
from yumi.virtual.faults import FAULTS_PATH
from yumi.virtual.mechanics.egm_network import Outgoing
from yumi.virtual.mechanics.parameters import EgmParameters, read_egm_parameters
from yumi.virtual.mechanics.path import PREFETCH
from yumi.virtual.mechanics.virtual_gripper import CupObject, Workpiece
from yumi.virtual.rws.call import Failure
from yumi.virtual.rws.http import HttpReply, HttpRequest
from yumi.virtual.rws.service import RwsService
from yumi.virtual.rws.subscriptions import Channel, Upgrade
from yumi.virtual.rws.version_2 import ROBOTWARE_7, RwsService2
from yumi.virtual.world import FaultInjection, World, WorldSettings

log = logging.getLogger(__name__)
T = TypeVar("T")


def world_settings(
    *,
    robot_name: str,
    egm_host: str,
    egm_ports: Mapping[Side, int],
    objects: Mapping[Side, float | None],
    grippers: Mapping[Side, GripperModules],
    leaks: Mapping[Side, float | None],
    are_calibrated: bool = False,
    system: System | None = None,
    dynamics: Path | None = None,
) -> WorldSettings:
    """A virtual robot whose clock shows the time of day.

    Args:
        robot_name: name of the controller's system.
        egm_host: where the arms send their datagrams.
        egm_ports: UDP port per arm.
        objects: width of what lies between each arm's fingers [m]; None for nothing.
        grippers: modules of each gripper.
        leaks: of the object under each gripper's cups, 0 (tight) to 1 (open); None for no object.
        are_calibrated: whether the grippers start calibrated.
        system: programs and system parameters; ours when it is None.
        dynamics: settings file with which the arms follow EGM; as delivered when it is None.

    Raises:
        SettingsError: the settings file is wrong.
    """
    workpieces = {side: Workpiece(width) for side, width in objects.items() if width is not None}
    return WorldSettings(
        robot_name=robot_name,
        egm_host=resolve(egm_host),  # once, since looking a name up takes longer than a cycle
        egm_ports=egm_ports,
        workpieces=workpieces,
        gripper_modules=grippers,
        cup_objects={side: CupObject(leak) for side, leak in leaks.items() if leak is not None},
        grippers_are_calibrated=are_calibrated,
        start_time=time.time(),
        system=system,
        egm_parameters=EgmParameters() if dynamics is None else read_egm_parameters(dynamics),
    )


_LARGEST_UPLOAD = 16 * 1024 * 1024  # bytes; RAPID modules and cfg files have thousands
_LARGEST_FORM = 256 * 1024  # bytes
_LARGEST_TEXT = 3 * LONGEST_MODULE + 1024  # bytes of a form with the text of a module, of which a character may take 3
LONGEST_BEGINNING = 2.0
"""How long programs may execute at the beginning before the controller is ready all the same; robot time [s]."""

_RARELY = 1000  # young collections for each full one; 10 by default


class VirtualController:
    """A virtual IRC5 on the network: RWS over HTTP or HTTPS, EGM over UDP, advancing in real time.

    Args:
        settings: what the virtual robot is like.
        rws_port: port of the HTTP server, 0 for any.
        user: user name that may log in.
        password: its password.
        granted: what the user may do.
        host: address to listen on.
        speed: how many times faster than real time it runs.
        is_started: whether the motors are on and RAPID runs from the beginning.
        runs_once: whether the programs then end with main, instead of beginning it again.
        show: called with a task and each line that its program writes to the FlexPendant.
        link: makes the sockets of the arms, to an address and port.
        rapid_sockets: the address RAPID programs may use, ``host`` without it (:class:`ProgramNetwork`).
        is_robotware_7: whether Robot Web Services are those of RobotWare 7: 2.0, over HTTPS.
    """

    def __init__(
        self,
        settings: WorldSettings,
        *,
        rws_port: int,
        user: str,
        password: str,
        granted: Collection[Grant] = GRANTS,
        host: str,
        speed: float = 1.0,
        is_started: bool = False,
        runs_once: bool = False,
        show: Callable[[str, str], None] | None = None,
        link: Callable[[str, int], UdpClient] = UdpClient,
        rapid_sockets: str | None = None,
        is_robotware_7: bool = False,
    ) -> None:
        self._speed = speed
        self._is_started, self._runs_once = is_started, runs_once
        self._clock = SystemClock()
        self._lock = Lock()
        self.world = World(replace(settings, robotware=ROBOTWARE_7) if is_robotware_7 else settings)
        self.world.controller.devices.network = ProgramNetwork(rapid_sockets or host)
        if show is not None:
            for installed in self.world.controller.execution.installed.values():
                installed.host.show = show
        self._server = HttpServer(
            self._handle,
            host=host,
            port=rws_port,
            body_limit=self._body_limit,
            prepare=self._prepare,
            tls=self_signed_context(host) if is_robotware_7 else None,
        )
        service = RwsService2 if is_robotware_7 else RwsService
        self._service = service(
            self.world.controller, user=user, password=password, granted=granted, hang_up=self._server.hang_up
        )
        self._faults = FaultInjection(self.world, self._service)
        self._background, self._planning = Background(), Background("planning")
        self._last_fault = ""
        for task in self.world.controller.tasks.values():
            task.clock = time.thread_time  # without the time of other threads and processes
            task.background, task.planning = self._background.submit, self._planning.submit
        for arm in self.world.arms.values():  # planning takes its time however fast the robot is
            arm.path.prefetch = PREFETCH * max(speed, 1.0)
        self._link_to = link
        self._destinations: dict[Side, tuple[str, int]] = {}
        self._links: dict[Side, UdpClient] = {}
        self._foreign_links: dict[Side, UdpClient] = {}
        self._no_destination: dict[Side, tuple[object, ...]] = {}
        for side in self.world.arms:
            self._follow_device(side)

    def run(self, is_over: Flag, on_ready: Callable[[int], None]) -> None:
        """Serve until ``is_over``.

        ``on_ready`` gets the HTTP port once every task that runs has come to an instruction that waits: what a program
        does first, such as listening on a socket, is done by then. A task that executes for longer than
        :data:`LONGEST_BEGINNING` without waiting is not waited for.

        Raises:
            NoConnection: the port is taken.
            Refused: RAPID is to be started and cannot be.
        """
        prefer_process()
        gc.set_threshold(700, 10, _RARELY)  # a full collection takes longer than a cycle once programs are long
        self._background.start()
        self._planning.start()
        try:
            with short_switch_interval(), self._server as server:
                prefer_thread()  # the robot's; those of the server and of the background have begun and stay ordinary
                if self._is_started:
                    with self._lock:
                        self.world.controller.set_motors(True)
                        cycle = "once" if self._runs_once else ""
                        self.world.controller.start_rapid(cycle, stop_at_breakpoints=True)  # as RobotStudio starts it
                until_ready = round(LONGEST_BEGINNING / CYCLE)  # cycles
                pace = Pace(self._clock, self._speed)
                while not is_over.is_set():
                    if until_ready:
                        with self._lock:
                            has_begun = all(task.is_waiting for task in self.world.controller.tasks.values())
                        until_ready = 0 if has_begun else until_ready - 1
                        if not until_ready:
                            on_ready(server.port)
                    inboxes = {side: link.receive() for side, link in self._links.items()}
                    with self._lock:
                        departures = self._cycle(inboxes)
                    for side, datagram, is_foreign in departures:
                        if not self._has_destination(side):
                            continue
                        (self._foreign_links if is_foreign else self._links)[side].send(datagram)
                    pace.wait()
        finally:
            self._background.stop()
            self._planning.stop()
            release_process()
            for link in (*self._links.values(), *self._foreign_links.values()):
                link.close()

    def _cycle(self, inboxes: Mapping[Side, Sequence[bytes]]) -> list[Outgoing]:
        """One cycle; a fault of this program stops RAPID, and the controller goes on."""
        try:
            departures = self.world.exchange(inboxes)
            self._service.advance(self._clock.now())
        except Exception as error:
            controller, sentence = self.world.controller, f"{type(error).__name__}: {error}"
            if sentence == self._last_fault and not controller.execution.is_running:  # in every cycle
                return []
            self._last_fault = sentence
            log.exception("A fault of the virtual controller stops RAPID.")
            controller.events.append(20999, "System error", sentence, EventType.ERROR)
            with suppress(Exception):  # what is broken may be what stops
                controller.execution.stop("RAPID has been stopped by a fault of the virtual controller.")
            return []
        return departures

    def _has_destination(self, side: Side) -> bool:
        """Follow an arm's device; why nothing can be sent is logged once."""
        try:
            self._follow_device(side)
        except (NoConnection, OSError, ValueError, OverflowError) as error:
            if self._no_destination.get(side) != error.args:
                self._no_destination[side] = error.args
                with self._lock:
                    self.world.controller.events.append(
                        41830, "Not possible to open the UdpUc device", str(error), EventType.ERROR
                    )
            return False
        self._no_destination.pop(side, None)
        return True

    def _follow_device(self, side: Side) -> None:
        """Send an arm's datagrams where its UDPUC device says: another one may be chosen, or act after a restart.

        Raises:
            NoConnection: the device names no address or port, or there is no way to it.
        """
        destination = self.world.egm_destination(side)
        if destination == self._destinations.get(side):
            return
        for links in (self._links, self._foreign_links):
            link = self._link_to(*destination)
            if side in links:
                links[side].close()
            links[side] = link
        self._destinations[side] = destination

    def _handle(self, request: HttpRequest) -> HttpReply | Upgrade | None:
        with self._lock:
            if request.target.startswith(FAULTS_PATH):
                return self._faults.answer(request)
            answer = self._service.handle(request, self._clock.now())
        if not isinstance(answer, Upgrade):
            return answer
        attach = answer.attach

        def attach_locked(channel: Channel) -> None:
            with self._lock:
                attach(channel)

        return replace(answer, attach=attach_locked)

    def _body_limit(self, request: HttpRequest) -> int:
        """The body of a request without a session or a login is not read."""
        if request.target.startswith(FAULTS_PATH):
            return _LARGEST_FORM
        with self._lock:
            if not self._service.may_enter(request, self._clock.now()):
                return 0
        if request.method == "PUT":
            return _LARGEST_UPLOAD
        try:
            has_module = self._service.find(request)[0].prepare is not None
        except Failure:  # the answer says what is wrong
            return _LARGEST_FORM
        return _LARGEST_TEXT if has_module else _LARGEST_FORM

    def _prepare(self, request: HttpRequest) -> Future[object] | None:
        """Begin what is too long for the world to stand still: parsing a module or a long value, compiling.

        The answer then finds it done, and raises its errors again.
        """
        if request.method != "POST":
            return None
        with self._lock:  # first: nothing of a request is kept that belongs to no session
            if not self._service.may_enter(request, self._clock.now()):
                return None
        try:
            route, call = self._service.find(request)
            if route.prepare is None:
                return None
            with self._lock:
                work = route.prepare(self.world.controller, call)
        except Failure:  # the answer says what is wrong
            return None
        return None if work is None else self._background.submit(partial(_try_to_prepare, work))


# ---- its pace, and work beside it

TIME_TO_ANSWER = 0.3 * CYCLE
"""Shortest time from a datagram to the next cycle, for its answer to arrive [s]."""

LONGEST_LAG = 5 * CYCLE
"""A machine that has fallen behind by more skips cycles [s]."""


class Pace:
    """When the cycles of a robot that keeps real time begin.

    A machine that has fallen behind catches up, but not at once: the answer to one datagram has to be there for the
    next cycle. Of answers that come two at a time only the newer one counts (reference/egm.md §4.3). On a machine whose
    cycles take longer than what is left beside that, the robot is slower than real time.

    Args:
        clock: the machine's.
        speed: how many times faster than real time the robot is; whatever this is, one cycle is 4.032 ms to it.
    """

    def __init__(self, clock: Clock, speed: float = 1.0) -> None:
        self._clock = clock
        self._speed = speed
        self._due = clock.now()

    def wait(self) -> None:
        """From the end of a cycle, when its datagrams have left, until the next one begins."""
        self._due += CYCLE / self._speed
        self._clock.wait(max(self._due - self._clock.now(), TIME_TO_ANSWER / self._speed))
        if self._clock.now() - self._due > LONGEST_LAG:
            self._due = self._clock.now()


class Background:
    """Does long work in a thread of its own, one piece after another, while the robot goes on."""

    def __init__(self, name: str = "background") -> None:
        self._work: Queue[Callable[[], None] | None] = Queue()
        # A daemon, since parsing a long module takes seconds, and the process must end before.
        self._thread = Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Do nothing more; what is under way goes on."""
        self._work.put(None)

    def submit(self, work: Callable[[], T]) -> Future[T]:
        """What ``work`` will have returned or raised."""
        result: Future[T] = Future()
        self._work.put(partial(_run_for, work, result))
        return result

    def _run(self) -> None:
        while (work := self._work.get()) is not None:
            work()
            del work  # a thread that waits holds nothing: what it held would be freed after the libraries it came from


def _run_for(work: Callable[[], T], result: Future[T]) -> None:
    if not result.set_running_or_notify_cancel():  # the client is gone
        return
    try:
        result.set_result(work())
    except Exception as error:  # raised where the result is awaited
        result.set_exception(error)
    finally:
        del work, result  # the error's traceback leads here, and from here a result would lead back to it


def _try_to_prepare(work: Callable[[], object]) -> None:
    """Do the preparation of a call; what fails in it fails in the handler again, which answers it."""
    try:
        work()
    except Exception as error:
        log.info("A call could not be prepared (%s: %s); its answer says why.", type(error).__name__, error)


# ---- the HTTP server

Handler = Callable[[HttpRequest], HttpReply | Upgrade | None]
"""Answers with a reply, with a WebSocket, or with None: the connection is broken without an answer."""

PING = 30.0
"""Period of the WebSocket's pings (reference/rws.md §14.2) [s]."""

BodyLimit = Callable[[HttpRequest], int]
"""How long the body of a request may be [bytes], decided from its head; 0 leaves it unread."""

BackgroundWork = Callable[[HttpRequest], "Future[object] | None"]
"""Begins long work that a request needs; the handler is called when it is done. None for none."""

_ORIGIN = re.compile(r"https?://[^/?]*", re.IGNORECASE)
_MAX_BODY = 64 * 1024 * 1024
_KEEP_ALIVE = 300.0  # [s]
_HANG_UP_DELAY = 0.02  # [s]
_GRACE = 0.2  # [s] an answer under way may take when the server stops


class HttpServer:
    """Serves ``handler`` at ``host:port`` between ``start`` and ``stop``; a context manager does both.

    The handler is called on the server's thread, one request at a time; it must answer at once. Port 0 lets
    the system choose: read ``port`` after the start. A server starts once.

    Args:
        handler: answers.
        port: to listen on.
        host: address to listen on.
        body_limit: asked before a body is read; a longer one is answered with 413.
        prepare: called before the handler.
        tls: of HTTPS; None for HTTP.
    """

    def __init__(
        self,
        handler: Handler,
        port: int,
        host: str = "127.0.0.1",
        *,
        body_limit: BodyLimit = lambda request: _MAX_BODY,
        prepare: BackgroundWork = lambda request: None,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self.port = port
        self._handler = handler
        self._body_limit = body_limit
        self._prepare = prepare
        self._host = host
        self._tls = tls
        self._listening: Future[tuple[asyncio.AbstractEventLoop, asyncio.Event]] = Future()
        self._thread = Thread(target=lambda: asyncio.run(self._serve()), name="http-server", daemon=True)

    @property
    def address(self) -> str:
        """Host and port, as a client gives them."""
        return f"{self._host}:{self.port}"

    def start(self) -> None:
        """Listen.

        Raises:
            SettingsError: the port is not free or not allowed; choose another.
        """
        self._thread.start()
        try:
            self._listening.result()
        except (OSError, OverflowError) as error:
            self._thread.join()
            reason = (isinstance(error, OSError) and error.strerror) or error
            raise SettingsError(
                f"Port {self.port} on {self._host} cannot be opened ({reason}); choose another port."
            ) from error

    def stop(self) -> None:
        """Close all connections and end the thread."""
        loop, ending = self._listening.result()
        loop.call_soon_threadsafe(ending.set)
        self._thread.join()

    def hang_up(self) -> None:
        """Break all connections, as a machine does that goes down; the port stays open.

        An answer that is under way is still sent.
        """
        loop, _ = self._listening.result()
        loop.call_soon_threadsafe(loop.call_later, _HANG_UP_DELAY, self._abort_all)

    def __enter__(self) -> HttpServer:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    async def _serve(self) -> None:
        ending = asyncio.Event()
        self._calls = Calls()
        # Without aiohttp's application, whose routes, middlewares and signals cost time in each request.
        server = web.Server(self._answer, access_log=None, keepalive_timeout=_KEEP_ALIVE)
        runner = web.ServerRunner(server, shutdown_timeout=_GRACE)
        self._runner = runner
        try:
            await runner.setup()
            site = web.TCPSite(runner, self._host, self.port, ssl_context=self._tls, reuse_address=True)
            await site.start()
            self.port = runner.addresses[0][1]
            self._listening.set_result((asyncio.get_running_loop(), ending))
            await ending.wait()
        except Exception as error:  # start() raises it
            self._listening.set_exception(error)
        finally:
            await runner.cleanup()

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        # Only the head is read so far: a request that may not enter is answered without its body.
        headers = tuple(request.headers.items())
        if "Host" not in request.headers:  # of HTTP/1.0; documents name the address that was asked
            headers += (("Host", _address(request, "sockname")),)
        target = request.raw_path
        if not target.startswith("/"):  # through a proxy: the whole URL
            target = _ORIGIN.sub("", target) or "/"
        incoming = HttpRequest(request.method, target, headers, b"", _address(request, "peername"))
        if request.can_read_body:
            incoming = replace(incoming, body=await _body(request, self._body_limit(incoming)))
        preparation = self._prepare(incoming)
        if preparation is not None:
            await asyncio.wrap_future(preparation)
        answer = self._handler(incoming)
        if isinstance(answer, Upgrade):
            websocket = web.WebSocketResponse(protocols=(answer.protocol,), heartbeat=PING, compress=False)
            for name, value in answer.headers:
                websocket.headers.add(name, value)
            channel = SocketChannel(websocket, request, self._calls)
            answer.attach(channel)  # before the client sees it open: it gets every event from then on
            await channel.serve()
            return websocket
        if answer is None:
            cut_off(request.transport)
            return web.Response()
        connection = "Keep-Alive" if request.keep_alive else "close"  # said in both cases, as a controller does
        headers = (*answer.headers, ("Connection", connection))
        return web.Response(status=answer.status, body=answer.body or None, headers=headers)

    def _abort_all(self) -> None:
        server = self._runner.server
        for connection in server.connections if server is not None else ():
            cut_off(connection.transport)


def _address(request: web.BaseRequest, end: str) -> str:
    """Host and port of one end of a request's connection: ``peername`` or ``sockname``."""
    transport = request.transport
    host, port, *_ = (transport.get_extra_info(end) if transport is not None else None) or ("", 0)
    return f"{host}:{port}"


async def _body(request: web.BaseRequest, limit: int) -> bytes:
    """The body, if it is within the limit; the server discards what is not read.

    A client that waits for permission to send it (``Expect: 100-continue``) gets it only if the body is wanted.

    Raises:
        HTTPRequestEntityTooLarge: it is longer.
    """
    if limit == 0:
        return b""
    body, length = bytearray(), request.content_length or 0
    if length <= limit and request.headers.get("Expect", "").lower() == "100-continue":
        await request.writer.write(b"HTTP/1.1 100 Continue\r\n\r\n")
        request.writer.output_size = 0  # that was not the answer
    while length <= limit:
        part = await request.content.readany()
        if not part:
            return bytes(body)
        body += part
        length = max(length, len(body))
    raise web.HTTPRequestEntityTooLarge(limit, length, text=f"A body may have {limit} bytes here.")


def cut_off(transport: asyncio.BaseTransport | None) -> None:
    """Break a connection with a reset; what is under way on it is lost."""
    if isinstance(transport, asyncio.Transport):
        end = transport.get_extra_info("socket")
        if end is not None:
            end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        transport.abort()


class Calls:
    """Calls from other threads to the event loop; so many as come together wake it once, since that takes longest."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: deque[Callable[[], None]] = deque()
        self._is_woken = False

    def submit(self, call: Callable[[], None]) -> None:
        """Have it called soon, after all that were submitted before."""
        self._waiting.append(call)
        if not self._is_woken:
            self._is_woken = True
            self._loop.call_soon_threadsafe(self._run)

    def _run(self) -> None:
        self._is_woken = False  # first: what is submitted from now on wakes the loop again
        while self._waiting:
            self._waiting.popleft()()


class SocketChannel:
    """The server's end of a WebSocket; messages from before it is open wait until it is."""

    def __init__(self, response: web.WebSocketResponse, request: web.BaseRequest, calls: Calls) -> None:
        self._calls = calls
        self._response = response
        self._request = request
        self._outbox: asyncio.Queue[str | None] = asyncio.Queue()
        self.is_open = True
        self.has_left = False

    def send(self, text: str) -> None:
        self._submit(partial(self._outbox.put_nowait, text))

    def close(self) -> None:
        self._submit(partial(self._outbox.put_nowait, None))

    def abort(self) -> None:
        self._submit(partial(cut_off, self._request.transport))

    async def serve(self) -> None:
        """Open the WebSocket and send messages until it ends; messages of the client are ignored."""
        try:
            await self._response.prepare(self._request)
            sending = asyncio.create_task(self._send_all())
            try:
                async for _ in self._response:
                    continue
            finally:
                self.has_left = self._response.close_code not in (None, WSCloseCode.ABNORMAL_CLOSURE)
                sending.cancel()
        finally:
            self.is_open = False

    async def _send_all(self) -> None:
        while (text := await self._outbox.get()) is not None:
            try:
                await self._response.send_str(text)
            except ConnectionError:
                return  # the client has gone; the receiving side ends too
        await self._response.close()

    def _submit(self, call: Callable[[], None]) -> None:
        if self.is_open:
            self._calls.submit(call)


def self_signed_context(host: str) -> ssl.SSLContext:
    """TLS for a server at ``host``, with a new key and a certificate that it has signed itself, as a controller's.

    Raises:
        MissingPrerequisite: the package ``cryptography`` is not installed.
    """
    try:
        from cryptography import x509  # noqa: PLC0415 - of an extra, for this one use
        from cryptography.hazmat.primitives import hashes, serialization  # noqa: PLC0415
        from cryptography.hazmat.primitives.asymmetric import ec  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise missing_extra(message("https_needs_cryptography"), "robotware7") from error
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "Virtual controller")])
    hosts: list[x509.GeneralName] = [x509.DNSName("localhost")]
    try:
        hosts.append(x509.IPAddress(ip_address(host)))
    except ValueError:
        hosts.append(x509.DNSName(host))
    now = datetime.now(timezone.utc)
    builder = x509.CertificateBuilder(
        name, name, key.public_key(), x509.random_serial_number(), now, now + timedelta(days=365)
    )
    certificate = builder.add_extension(x509.SubjectAlternativeName(hosts), critical=False).sign(key, hashes.SHA256())
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    # Python reads a key from a file alone; only its user can open this folder, and it is gone at once.
    with TemporaryDirectory() as folder:
        path = Path(folder) / "controller.pem"
        path.write_bytes(
            key.private_bytes(
                serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
            )
            + certificate.public_bytes(serialization.Encoding.PEM)
        )
        context.load_cert_chain(path)
    return context


# ---- sockets of RAPID programs

LOOPBACK = "127.0.0.1"

MOST_SOCKETS = 32
"""Sockets that are open at a time (RAPID reference manual, SocketCreate)."""

_PEEKED = 65536  # bytes


class ProgramNetwork:
    """Makes the sockets of all tasks.

    Args:
        address: this machine's, which programs may use; 127.0.0.1 keeps them on this machine, 0.0.0.0 allows all.

    Attributes:
        count: how many sockets are open.
    """

    def __init__(self, address: str = LOOPBACK) -> None:
        self.address = address
        self.count = 0

    @property
    def is_local(self) -> bool:
        """Whether nothing leaves this machine."""
        return is_loopback(self.address)

    def tcp(self) -> ProgramSocket:
        """A TCP socket."""
        return self._made(socket.SOCK_STREAM)

    def udp(self) -> ProgramSocket:
        """A UDP socket."""
        return self._made(socket.SOCK_DGRAM)

    def _made(self, kind: socket.SocketKind) -> ProgramSocket:
        self.check_room()
        return ProgramSocket(self, socket.socket(socket.AF_INET, kind))

    def check_room(self) -> None:
        """Raise OSError where there are too many sockets."""
        if self.count >= MOST_SOCKETS:
            raise OSError(errno.ENOBUFS, f"{MOST_SOCKETS} sockets are open already")

    def remote(self, address: str, port: int) -> tuple[str, int]:
        """Where a program's address leads to."""
        return (self.address if self.is_local else address), port


class ProgramSocket:
    """A socket of this machine that never waits; see :class:`yumi.rapid.devices.Socket`."""

    def __init__(self, network: ProgramNetwork, made: socket.socket) -> None:
        self._network = network
        self._socket = made
        network.count += 1
        # Also closed when nothing refers to it any more: the program pointer went to main, a routine ended.
        self._close = weakref.finalize(self, _close_and_count, network, made)
        made.setblocking(False)
        if made.type == socket.SOCK_STREAM:
            made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def bind(self, address: str, port: int) -> None:
        """Take a port of the address this controller may use."""
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, self._socket.type == socket.SOCK_STREAM)
        self._socket.bind((self._network.address, port))

    def listen(self) -> None:
        """Let others connect."""
        self._socket.listen()

    def accept(self) -> tuple[ProgramSocket, str] | None:
        """The next connection with the other side's address."""
        self._network.check_room()
        try:
            connection, (address, _) = self._socket.accept()
        except BlockingIOError:
            return None
        return ProgramSocket(self._network, connection), address

    def connect(self, address: str, port: int) -> None:
        """Begin to connect."""
        failure = self._socket.connect_ex(self._network.remote(address, port))
        if failure not in (0, errno.EINPROGRESS):
            raise OSError(failure, os.strerror(failure))

    def is_connected(self) -> bool:
        """Whether the connection is there."""
        failure = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if failure:
            raise OSError(failure, os.strerror(failure))
        try:
            self._socket.getpeername()
        except OSError as error:
            if error.errno == errno.ENOTCONN:
                return False
            raise
        return True

    def send(self, data: bytes) -> int:
        """Send what the other side takes."""
        try:
            return self._socket.send(data, socket.MSG_NOSIGNAL)
        except BlockingIOError:
            return 0

    def receive(self, size: int) -> bytes | None:
        """What is there."""
        try:
            return self._socket.recv(size)
        except BlockingIOError:
            return None

    def send_to(self, data: bytes, address: str, port: int) -> None:
        """Send a datagram."""
        self._socket.sendto(data, self._network.remote(address, port))

    def receive_from(self, size: int) -> tuple[bytes, str, int] | None:
        """The next datagram and its sender."""
        try:
            data, (address, port) = self._socket.recvfrom(size)
        except BlockingIOError:
            return None
        return data, address, port

    def waiting(self) -> int:
        """How much can be received at once."""
        try:
            found = self._socket.recv(_PEEKED, socket.MSG_PEEK)
        except BlockingIOError:
            return 0
        if not found and self._socket.type == socket.SOCK_STREAM:
            raise ConnectionResetError(errno.ECONNRESET, "the other side has closed the connection")
        return len(found)

    def close(self) -> None:
        """Close it; nothing happens where it is closed."""
        self._close()


def _close_and_count(network: ProgramNetwork, made: socket.socket) -> None:
    network.count -= 1
    made.close()
