"""The local endpoint's server: one thread that talks to all clients, and workers that carry out their commands.

Nothing here runs in the control process. The state is made from what the driver knows already: shared memory, the
monitor, subscribed signals. A client that reads too slowly, sends too much or breaks the protocol is disconnected.
"""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import struct
import time
from collections.abc import Callable, Hashable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import reduce
from operator import or_
from pathlib import Path
from threading import Event as Flag
from threading import Lock
from typing import Any

import msgspec

from abb_protocols.catalogue import Message, cut, message, said_by
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import RobotNotReady, YumiError
from abb_protocols.robot.joints import Side
from abb_runtime.process.supervision import SupervisedThread
from yumi.control.loop_events import Event, is_logged, is_warning
from yumi.driver.command import Caller, Command, CommandedRobot, EndpointRequest, Lane
from yumi.driver.commands import carry_out, offered_to
from yumi.driver.endpoint import (
    FIRST_REQUEST,
    MAX_REQUEST,
    Attach,
    EndpointAnswer,
    EndpointFailure,
    Subscribe,
    endpoint_path,
    failure_of,
)
from yumi.driver.reports import RECENT_EVENTS, Said

MAX_CLIENTS = 16
"""So many clients are served at once; one more is served when it asks for a stop."""

MAX_SILENT = 32
"""So many connections may have sent no request; then the oldest of them is closed."""

MAX_WORK = 8
"""So many requests that change something are carried out at once, or wait for their turn; then they are refused."""

MAX_PENDING = 8
"""So many requests of one client may wait for their answers."""

MAX_BACKLOG = 1 << 20
"""A client for which so much waits does not read, and is disconnected [bytes]."""

_FRESH = 0.010  # [s] a state that was made for one client serves another one for so long
_POLL_PERIOD = 0.1  # [s] between two attempts to end what is left of clients
_CREDENTIALS = struct.Struct("3i")

_FULL = message("too_many_clients", most=MAX_CLIENTS)
_SILENT = message("silent_client", duration=FIRST_REQUEST)

_ENDPOINT = (FrontEnd.SCRIPT, FrontEnd.SHELL, FrontEnd.PAGE)  # what reaches a driver over it
decode_request: Callable[[bytes], EndpointRequest] = msgspec.json.Decoder(
    reduce(or_, offered_to(*_ENDPOINT), Attach | Subscribe)
).decode
_log = logging.getLogger(__name__)


class _Client:
    """One connection, on the server's event loop."""

    def __init__(self, writer: asyncio.StreamWriter, loop: asyncio.AbstractEventLoop) -> None:
        self.writer = writer
        self.is_gone = False
        self.is_served = False  # one of MAX_CLIENTS
        self.is_attached = False
        self.front_end: FrontEnd | None = None
        self.silence: asyncio.TimerHandle | None = None  # what disconnects it unless it asks for something
        self.pending = 0
        self.subscription: asyncio.Task[None] | None = None
        self.held: dict[Hashable, Callable[[], object]] = {}  # what ends with it, such as a jog
        self.timers: dict[Hashable, asyncio.TimerHandle] = {}  # of what ends earlier
        self._loop = loop

    def send(self, answer: EndpointAnswer) -> None:
        """From the loop's thread."""
        if self.is_gone:
            return
        self.writer.write(msgspec.json.encode(answer) + b"\n")
        if self.writer.transport.get_write_buffer_size() > MAX_BACKLOG:
            self.is_gone = True
            self.writer.transport.abort()

    def end_silence(self) -> None:
        """It has asked for something, or is gone."""
        if self.silence is not None:
            self.silence.cancel()
            self.silence = None

    def send_soon(self, answer: EndpointAnswer) -> None:
        """From any thread."""
        self.call_soon(self.send, answer)

    def call_soon(self, call: Callable[..., object], *args: Any) -> None:
        """Have the loop's thread call something; from any thread."""
        with suppress(RuntimeError):  # the loop has ended meanwhile
            self._loop.call_soon_threadsafe(call, *args)


class EndpointServer:
    """Serves the local endpoint of a driver, from :meth:`start` to :meth:`stop`.

    Args:
        robot: what the clients' commands act on.
        log: takes a level of :mod:`logging` and a sentence.

    Attributes:
        path: of its socket, while it serves.
    """

    def __init__(
        self, robot: CommandedRobot, log: Callable[[int, Message | str], None] = lambda level, said: None
    ) -> None:
        self.path = Path()
        self._robot = robot
        self._log = log
        self._clients: dict[_Client, None] = {}  # all that are connected, the oldest first
        self._work = 0
        self._made = (0.0, msgspec.Raw())
        self._making = Lock()
        self._is_over = Flag()
        self._is_listening = Flag()
        self._end: Callable[[], None] = lambda: None
        self._thread = SupervisedThread("endpoint", self._run, self._is_over)
        self._workers = ThreadPoolExecutor(MAX_CLIENTS, "endpoint-work")
        self._stops = ThreadPoolExecutor(2, "endpoint-stop")  # a stop waits for no other request
        # The end of a jog waits neither for requests nor on the loop's thread, which all clients need.
        self._ends = ThreadPoolExecutor(len(Side), "endpoint-end")

    def note(self, level: int, said: Message | str) -> None:
        """Keep a line of the driver's log for the clients, with a level of :mod:`logging`; from any thread."""
        self._robot.events.note(level, said)

    def note_event(self, event: Event) -> None:
        """Keep an event of the control process, unless it is a controller's own."""
        if is_logged(event):
            self._robot.events.note(logging.WARNING if is_warning(event) else logging.INFO, event.said)

    @property
    def client_count(self) -> int:
        """How many clients are served."""
        return sum(client.is_served for client in self._clients)

    def start(self) -> None:
        """Serve from now on; the socket is there when this returns. A driver without a place for it goes on without."""
        try:
            self.path = endpoint_path(self._robot.address, self._robot.namespace)
        except RobotNotReady as error:
            self._log(logging.WARNING, f"No command and no second script finds this driver: {error}")
            return
        self._thread.start()
        if not self._is_listening.wait(5.0):
            self._log(
                logging.ERROR, f"The local endpoint {self.path} does not listen; the commands do not find the driver."
            )

    def stop(self) -> None:
        """Disconnect all clients, end what they have asked for at its next step, and remove the socket."""
        self._is_over.set()
        self._robot.manager.interrupt()
        self._end()
        self._thread.join()
        self._workers.shutdown()
        self._stops.shutdown()
        self._ends.shutdown()

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        loop, is_over = asyncio.get_running_loop(), asyncio.Event()

        def end() -> None:
            with suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(is_over.set)

        server = await asyncio.start_unix_server(self._connect, self.path, limit=MAX_REQUEST)
        try:
            self.path.chmod(0o600)
            self._end = end
            self._is_listening.set()
            if not self._is_over.is_set():
                await is_over.wait()
        finally:
            self.path.unlink(missing_ok=True)
            # The server last: asyncio would leave a connection open that it has accepted and not handed over yet.
            while others := asyncio.all_tasks() - {asyncio.current_task()}:
                for client in tuple(self._clients):
                    client.is_gone = True
                    client.writer.transport.abort()
                await asyncio.wait(others, timeout=_POLL_PERIOD)
            server.close()

    async def _connect(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client = _Client(writer, asyncio.get_running_loop())
        peer: socket.socket = writer.get_extra_info("socket")
        _, user, _ = _CREDENTIALS.unpack(peer.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))
        try:
            if user != os.getuid() or self._is_over.is_set():
                writer.transport.abort()
            else:
                self._clients[client] = None
                self._expect_request(client)
                await self._read(reader, client)
        except ConnectionError:
            return  # the client has gone
        finally:
            client.is_gone = True
            client.end_silence()
            self._clients.pop(client, None)
            if client.subscription is not None:
                client.subscription.cancel()
            for timer in client.timers.values():
                timer.cancel()
            ends = [self._end_held(end) for end in client.held.values()]
            writer.close()
            with suppress(ConnectionError):
                await writer.wait_closed()
            await asyncio.gather(*ends)

    def _expect_request(self, client: _Client) -> None:
        """Disconnect a client that is not served unless it asks for something."""
        client.silence = asyncio.get_running_loop().call_later(FIRST_REQUEST, self._end_silent, client)
        silent = [each for each in self._clients if each.silence is not None]
        if len(silent) > MAX_SILENT:
            self._end_silent(silent[0])

    def _end_silent(self, client: _Client) -> None:
        """Disconnect a client that has asked for nothing, or has only attached while others had all places."""
        client.end_silence()
        client.send(_refused(0, _FULL if client.is_attached else _SILENT))
        client.is_gone = True
        client.writer.close()

    def _serves(self, client: _Client) -> bool:
        """Whether a client that has sent a request is one of those that are served."""
        client.is_served = client.is_served or self.client_count < MAX_CLIENTS
        if client.is_served:
            client.end_silence()
        return client.is_served

    async def _read(self, reader: asyncio.StreamReader, client: _Client) -> None:
        while True:
            try:
                line = await reader.readline()
            except ValueError:
                client.send(_refused(0, message("request_too_long", most=MAX_REQUEST)))
                return
            if not line.endswith(b"\n") or not await self._take(line, client):
                return

    async def _take(self, line: bytes, client: _Client) -> bool:
        """Serve what a client asks for in a line; whether the client may ask for more."""
        try:
            request = decode_request(line)
        except (ValueError, RecursionError) as error:  # also of a document that is no request, or not in UTF-8
            client.send(_not_understood(line, error))
            return True
        if client.is_gone and not request.is_stop:
            return False  # it came while the connection was being closed
        if isinstance(request, Attach) and request.is_page:
            client.front_end = FrontEnd.PAGE
        if not self._serves(client):
            return await self._serve_beyond_limit(client, request)
        if isinstance(request, Subscribe):
            if client.subscription is not None:
                client.subscription.cancel()
            client.subscription = asyncio.create_task(self._publish(client, request))
        elif isinstance(request, Command):
            self._begin_unless_full(client, request)
        return True

    async def _serve_beyond_limit(self, client: _Client, request: EndpointRequest) -> bool:
        """Serve a stop of a client that is none of those served; whether the client may ask for another one."""
        if isinstance(request, Attach):
            client.is_attached = True
        elif isinstance(request, Command) and request.is_stop:
            client.end_silence()
            await self._begin(client, request)
            self._expect_request(client)
        else:
            client.send(_refused(request.id, _FULL))
            return False
        return True

    def _begin_unless_full(self, client: _Client, command: Command[Any]) -> None:
        is_work = command.lane is Lane.CHANGE and not command.is_stop  # the others wait for nothing that others ask for
        is_full = client.pending >= MAX_PENDING or (is_work and self._work >= MAX_WORK)
        if is_full and not command.is_stop:
            client.send(_refused(command.id, message("too_many_requests")))
        else:
            self._begin(client, command, is_work=is_work)

    def _begin(self, client: _Client, command: Command[Any], *, is_work: bool = False) -> asyncio.Future[None]:
        client.pending += 1
        self._work += is_work

        def end(_: object) -> None:
            client.pending -= 1
            self._work -= is_work

        workers = self._stops if command.is_stop else self._workers
        work = asyncio.get_running_loop().run_in_executor(workers, self._answer, client, command)
        work.add_done_callback(end)
        return work

    def _answer(self, client: _Client, command: Command[Any]) -> None:
        """On a worker's thread."""
        caller = Caller(
            client,
            client.front_end,
            lambda step: client.send_soon(EndpointAnswer(id=command.id, step=step)),
            lambda motions: client.send_soon(EndpointAnswer(id=command.id, motions=motions)),
            lambda: client.is_gone or self._is_over.is_set(),
            lambda name, end, after: client.call_soon(self._hold, client, name, end, after),
            self.elsewhere,
        )
        try:
            result = msgspec.Raw(msgspec.json.encode(carry_out(command, self._robot, caller)))
            answer = EndpointAnswer(id=command.id, result=result)
        except Exception as error:  # a fault of ours, too: the client must not wait for ever
            answer = _failed(command, error)
        client.send_soon(answer)

    def elsewhere(self, work: Callable[[], None]) -> None:
        """Have a worker do something for a client who does not wait for it; not once the driver ends."""
        with suppress(RuntimeError):  # the workers have ended
            self._workers.submit(work).add_done_callback(_log_failure)

    def _hold(self, client: _Client, name: Hashable, end: Callable[[], object], after: float | None) -> None:
        """Keep what a client has begun until the client is gone, or for ``after`` [s] unless it is held anew."""
        if name in client.timers:
            client.timers.pop(name).cancel()
        if client.is_gone:
            self._end_held(end)
            return
        client.held[name] = end
        if after is not None:
            client.timers[name] = asyncio.get_running_loop().call_later(after, self._end_held, end)

    def _end_held(self, end: Callable[[], object]) -> asyncio.Future[None]:
        def run() -> None:
            with suppress(YumiError):  # the others end all the same
                end()

        return asyncio.get_running_loop().run_in_executor(self._ends, run)

    async def _publish(self, client: _Client, request: Subscribe) -> None:
        self._robot.on_subscription()
        loop, known = asyncio.get_running_loop(), max(0, self._robot.events.count - RECENT_EVENTS)
        due = loop.time()
        while not client.is_gone:
            try:
                state = await loop.run_in_executor(self._workers, self._state)
            except Exception as error:  # as of other requests; the subscription has ended
                client.send(_failed(request, error))
                return
            events = self._robot.events.since(known)
            known = events[-1].number if events else known
            client.send(EndpointAnswer(id=request.id, state=state, events=events))
            due = max(due + 1.0 / request.rate, loop.time())
            await asyncio.sleep(due - loop.time())

    def _state(self) -> msgspec.Raw:
        """The state as JSON, made once for all who want it at the same time."""
        with self._making:
            now = time.monotonic()
            if now - self._made[0] > _FRESH:
                self._made = now, msgspec.Raw(msgspec.json.encode(self._robot.state()))
            return self._made[1]


def _log_failure(work: Future[None]) -> None:
    """What no client waits for is a fault of ours when it fails: what may fail is reported by who does it."""
    if not work.cancelled() and (error := work.exception()) is not None:
        _log.error("Work for a client of the local endpoint failed", exc_info=error)


def _refused(number: int, said: Message) -> EndpointAnswer:
    return EndpointAnswer(id=number, error=EndpointFailure("CommandRefused", Said.of(said)))


def _failed(request: EndpointRequest, error: Exception) -> EndpointAnswer:
    """Why a request failed; what is no refusal is a fault of the driver, which its log shows whole."""
    if isinstance(error, YumiError):
        return EndpointAnswer(id=request.id, error=failure_of(error))
    _log.error("A request of the local endpoint failed: %s", request, exc_info=error)
    return _refused(request.id, message("driver_failed", kind=type(error).__name__, why=said_by(error)))


def _not_understood(line: bytes, error: Exception) -> EndpointAnswer:
    """Of what is no request, with the number that it has, so that its client knows which one it was."""
    try:
        number = msgspec.json.decode(line)["id"]
    except (ValueError, RecursionError, KeyError, TypeError):
        number = 0
    if isinstance(error, RecursionError):
        why = message("request_nested_too_deeply")
    elif isinstance(error, UnicodeDecodeError):
        why = message("request_not_utf_8")
    else:
        why = message("text", text=cut(str(error)))
    return _refused(number if isinstance(number, int) else 0, message("request_not_understood", why=why))
