"""The web server of ``yumi view``: the page and its files, and a WebSocket for each page.

Who may do what: a page of this machine sees the robot; through another interface, and where a real robot is operated,
only with the token. The files of the page are for everyone, the robot and a recording are not. A page of a foreign
origin, or under a host name that is not this machine's, is refused. One page at a time operates the robot, after it has
taken control: a virtual one always, a real one where the server was started to operate it and the page is opened on
the same machine, or on another one over HTTPS after it was paired (:mod:`yumi.web.pairing`). What a proxy forwards is
of another machine, wherever the proxy runs. Every page that shows a driver's robot may stop it.

A page draws the robot's description, which it gets as JSON (:mod:`yumi.web.robot_model`), and moves it as the driver's
state, a controller without a driver (:mod:`yumi.web.controller_view`) or a recording (:mod:`yumi.web.page_recording`)
says.
"""

from __future__ import annotations

import asyncio
import platform
import secrets
import ssl
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import msgspec
from aiohttp import WSCloseCode, WSMsgType, web

import yumi
from abb_protocols.catalogue import Message, message, said_by, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, SettingsError, YumiError
from abb_runtime.faults import Fault
from abb_runtime.udp import host_of_url, is_loopback
from yumi.driver.commands import StopEgm
from yumi.driver.reports import EventReport
from yumi.planning.planning_process import PlanningProcess
from yumi.web.controller_view import ControllerReader, ControllerView, LogMessage
from yumi.web.live import LiveRobot
from yumi.web.page_build import page_folder
from yumi.web.page_device import refused_report
from yumi.web.page_messages import (
    AnyMessage,
    Ask,
    DeviceMessage,
    ForOperator,
    GiveBackMessage,
    JointsJog,
    Pair,
    Seen,
    TakeControl,
    ToolJog,
)
from yumi.web.page_operator import Operator
from yumi.web.page_words import failure_for_page
from yumi.web.pairing import Pairing
from yumi.web.robot_model import controller_model, robot_model

ALL_ADDRESSES = ("0.0.0.0", "::")
"""To listen on all of this machine."""

FORWARDED = ("Forwarded", "Via", "X-Forwarded-For", "X-Forwarded-Host", "X-Forwarded-Proto", "X-Real-IP")
"""Headers with which a proxy says that it forwards a request."""

MAX_PAGES = 8
"""So many pages are served at once."""

_MESHES = Path(next(iter(yumi.__path__))) / "meshes"
_message_decoder = msgspec.json.Decoder(AnyMessage)
_NO_TOKEN = "Open the page by the address with the token that `yumi view` printed."
_MAX_MESSAGE = 1 << 14  # of a page [bytes]
_PING = 30.0  # [s]
_ANSWER = 5.0  # [s] a page that has control and shows no state for so long loses it
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "form-action 'none'; base-uri 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}


@dataclass(frozen=True, slots=True)
class ViewSettings:
    """How the page is served.

    Attributes:
        robot: address or namespace, where several drivers run.
        host: address to listen on.
        port: to listen on; 0 takes a free one.
        may_operate: whether a real robot may be operated from this machine.
        tls: with which the page is served over HTTPS; None serves it over HTTP.
        show_code: takes each code with which a page on another machine is paired, for a person at this machine.
        token: what pages must show; needed where another machine can reach the server, or a real robot is operated.
        recording: to be shown instead of a robot.
        controller: to be shown instead of a driver's robot: nothing on it can be operated.
    """

    robot: str = ""
    host: str = "127.0.0.1"
    port: int = 8090
    may_operate: bool = False
    tls: ssl.SSLContext | None = None
    show_code: Callable[[str], None] = lambda code: None
    token: str = field(default="", repr=False)
    recording: Mapping[str, Any] | None = None
    controller: ControllerReader | None = None

    def __post_init__(self) -> None:
        if not is_loopback(self.host) and not self.token:
            raise SettingsError(message("page_needs_token", host=self.host))
        if self.may_operate and not self.token:
            raise SettingsError(message("operating_page_needs_token"))


class ViewServer:
    """Serves the page from :meth:`start` to :meth:`stop`, on the event loop of its caller.

    Args:
        settings: how.

    Raises:
        MissingPrerequisite: the page must be built first, and cannot be.

    Attributes:
        port: it listens on, once it has started.
    """

    def __init__(self, settings: ViewSettings) -> None:
        self.port = settings.port
        self._settings = settings
        self._live = LiveRobot(settings.robot, self._publish, self._publish_events, self._note_driver)
        reader = settings.controller
        self._controller = None
        if reader is not None:
            self._controller = ControllerView(reader, self._publish, self._publish_log, self._introduce_all)
        self._shown: LiveRobot | ControllerView = self._controller or self._live
        self._planning = PlanningProcess()
        self._pairing = Pairing(settings.show_code)
        self._pages: set[_Page] = set()
        self._operator: tuple[_Page, Operator] | None = None
        self._switching = asyncio.Lock()  # one change of control at a time
        self._files = page_folder()
        self._model = msgspec.json.encode(robot_model() if reader is None else controller_model(reader))
        self._following: asyncio.Task[None] | None = None
        self._taking: asyncio.Task[None] | None = None
        self._giving_back: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[object]] = set()
        application = web.Application(middlewares=[self._guard])
        application.router.add_get("/", self._index)
        application.router.add_get("/model.json", self._send_model)
        application.router.add_get("/recording.json", self._send_recording)
        application.router.add_get("/ws", self._serve_page)
        application.router.add_static("/static", self._files)
        if _MESHES.is_dir():
            application.router.add_static("/meshes", _MESHES)
        self._runner = web.AppRunner(application, access_log=None, shutdown_timeout=0.5)

    @property
    def url(self) -> str:
        """Where a browser finds it; by this machine's name where it listens on all addresses."""
        host = platform.node() if self._settings.host in ALL_ADDRESSES else self._settings.host
        host = f"[{host}]" if ":" in host else host
        # Behind a #, a browser sends it to no server.
        token = f"#token={self._settings.token}" if self._settings.token else ""
        scheme = "https" if self._settings.tls is not None else "http"
        return f"{scheme}://{host}:{self.port}/{token}"

    async def start(self) -> None:
        """Listen.

        Raises:
            SettingsError: the port is not free or not allowed.
        """
        await self._runner.setup()
        try:
            site = web.TCPSite(self._runner, self._settings.host, self.port, ssl_context=self._settings.tls)
            await site.start()
        except (OSError, OverflowError) as error:
            await self._runner.cleanup()
            reason = (isinstance(error, OSError) and error.strerror) or error
            raise SettingsError(
                message("port_cannot_be_opened", port=self.port, host=self._settings.host, why=str(reason))
            ) from error
        self.port = self._runner.addresses[0][1]
        if self._settings.may_operate and self._settings.tls is not None and not is_loopback(self._settings.host):
            self._pairing.begin()
        if self._settings.recording is None:
            self._following = asyncio.create_task(self._shown.run())

    async def stop(self) -> None:
        """Give control back, close all pages and end."""
        self._cancel_giving_back()
        await self._release(None, message("view_has_ended"))
        if self._tasks:  # such as a Stop EGM
            await asyncio.wait(self._tasks, timeout=_ANSWER)
        self._planning.close()
        if self._following is not None:
            self._following.cancel()
            if self._controller is not None:  # a request under way ends before the session does
                await asyncio.wait([self._following])
        for page in tuple(self._pages):
            await page.socket.close()
        await self._runner.cleanup()

    @web.middleware
    async def _guard(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        """Refuse foreign origins and host names."""
        if not self._is_own_name(host_of_url(f"http://{request.host}")):
            raise web.HTTPForbidden(
                text="This page is served under the names and addresses of this machine only: use the address that "
                "`yumi view` printed."
            )
        origin = request.headers.get("Origin")
        # Of https where a proxy encrypts: then this server sees http.
        if origin is not None and origin not in (f"http://{request.host}", f"https://{request.host}"):
            raise web.HTTPForbidden(text="Pages of other origins may not use this server.")
        response = await handler(request)
        if not response.prepared:
            response.headers.update(_HEADERS)
        return response

    def _is_own_name(self, host: str) -> bool:
        """Whether a page may be opened under ``host``; another name may be a foreign one that leads here.

        A page that listens on loopback is opened under its names and addresses; another one by any address, by the name
        that it listens on, and by this machine's names.
        """
        if is_loopback(host):
            return True
        if is_loopback(self._settings.host):
            return False
        node, own = platform.node().lower(), platform.node().partition(".")[0].lower()
        names = {self._settings.host.lower(), node, own, f"{own}.local"}
        return bool(host) and (_is_address(host) or host in names)

    def _has_token(self, request: web.Request) -> bool:
        # Not in a cookie: a browser sends cookies to every port of a host, so to servers of other users, too.
        given = request.query.get("token", "").encode(errors="surrogateescape")
        return secrets.compare_digest(given, self._settings.token.encode()) or not self._settings.token

    async def _index(self, request: web.Request) -> web.StreamResponse:
        return web.FileResponse(self._files / "index.html")

    async def _send_model(self, request: web.Request) -> web.StreamResponse:
        return web.Response(body=self._model, content_type="application/json")

    async def _send_recording(self, request: web.Request) -> web.StreamResponse:
        if self._settings.recording is None:
            raise web.HTTPNotFound(text="There is no recording; the page shows a robot.")
        if not self._has_token(request):
            raise web.HTTPForbidden(text=_NO_TOKEN)
        return web.Response(body=msgspec.json.encode(self._settings.recording), content_type="application/json")

    async def _serve_page(self, request: web.Request) -> web.StreamResponse:
        if "Origin" not in request.headers:  # every browser sends one; other programs have the driver's endpoint
            raise web.HTTPForbidden(text="Only the page may open this connection.")
        socket = web.WebSocketResponse(heartbeat=_PING, max_msg_size=_MAX_MESSAGE, compress=False)
        await socket.prepare(request)
        # A page can read why a connection was closed, not why there is none.
        if not self._has_token(request):
            await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=_NO_TOKEN.encode())
            return socket
        if len(self._pages) >= MAX_PAGES:
            await socket.close(
                code=WSCloseCode.TRY_AGAIN_LATER, message=f"{MAX_PAGES} pages are open already; close one.".encode()
            )
            return socket
        page = self._page(
            socket,
            request.remote or "",
            request.query.get("paired", ""),
            is_forwarded=any(each in request.headers for each in FORWARDED),
            is_encrypted=request.secure,
        )
        self._pages.add(page)
        self._shown.watch(True)
        self._introduce(page)
        sending = asyncio.create_task(page.send_all())
        try:
            async for received in socket:
                if received.type is WSMsgType.TEXT:
                    await self._take(page, received.data)
        finally:
            self._pages.discard(page)
            self._shown.watch(bool(self._pages))
            sending.cancel()
            await self._release(page, message("page_closed"))
            with suppress(asyncio.CancelledError, ConnectionError):
                await sending
        return socket

    def _page(
        self, socket: web.WebSocketResponse, remote: str, key: str, *, is_forwarded: bool, is_encrypted: bool
    ) -> _Page:
        """A page at an address, with the key of a pairing, which over HTTP counts for nothing: others may read it."""
        is_local = is_loopback(remote) and not is_forwarded
        is_paired = is_encrypted and self._pairing.is_paired(key)
        return _Page(socket, is_local=is_local, is_encrypted=is_encrypted, is_paired=is_paired)

    async def _take(self, page: _Page, data: str) -> None:
        """Carry out a message of a page, or have its operator do so."""
        try:
            request = _message_decoder.decode(data)
        except (msgspec.DecodeError, RecursionError) as error:
            is_nested = isinstance(error, RecursionError)
            why = message("request_nested_too_deeply") if is_nested else said_by(error)
            self._refuse(page, message("request_not_understood", why=why))
            return
        if isinstance(request, Seen):
            page.seen()
        elif isinstance(request, Pair):
            self._pair(page, request)
        elif isinstance(request, TakeControl):
            await self._take_control(page)
        elif isinstance(request, GiveBackMessage):
            if await self._release(page, None):  # the rest may take seconds: a Stop EGM must be read meanwhile
                self._giving_back = asyncio.create_task(self._live.give_back())
        else:
            self._operate(page, request)

    def _operate(self, page: _Page, request: ForOperator) -> None:
        """Have the page's operator take a request, or stop the robot for any page."""
        why_not = self._why_not_operated(page)
        operator = self._operator[1] if self._operator is not None and self._operator[0] is page else None
        may_stop = operator is not None or self._may_stop
        if may_stop and isinstance(request, Ask) and isinstance(request.request, StopEgm):
            self._cancel_giving_back()
            self._begin(self._stop_egm(page, request))
        elif operator is None or why_not:
            self._refuse_request(page, request, CommandRefused(why_not or message("control_not_taken")))
        else:
            operator.take(request)

    def _refuse_request(self, page: _Page, request: ForOperator | Pair, refusal: CommandRefused) -> None:
        failure = failure_for_page(refusal, is_virtual=self._live.is_virtual)
        if isinstance(request, DeviceMessage):
            page.send_report(refused_report(request, failure))
        elif isinstance(request, JointsJog | ToolJog):
            page.send({"type": "jog_refused", "hold": request.hold, "error": failure})
        else:
            page.send({"type": "failed", "id": request.id, "error": failure})

    def _pair(self, page: _Page, request: Pair) -> None:
        """Give a page the key of a pairing, with which it connects anew."""
        try:
            if not self._may_pair(page):
                raise CommandRefused(message("pairing_not_needed"))
            result = {"key": self._pairing.pair(request.code)}
        except CommandRefused as error:
            self._refuse_request(page, request, error)
        else:
            page.send({"type": "done", "id": request.id, "result": result})

    async def _take_control(self, page: _Page) -> None:
        why_not = self._why_not_operated(page)
        if why_not is not None:
            self._refuse(page, why_not)
            return
        await self._release(None, message("control_taken_by_other"), unless=page)
        async with self._switching:
            if self._operator is not None or page not in self._pages:
                return  # it has it already, another one was faster, or it is gone
            self._cancel_giving_back()
            operator = Operator(self._live, page.send, page.send_report, self._planning)
            try:
                await operator.open()
            except YumiError as error:
                self._refuse(page, error.said)
                return
            self._operator = page, operator
        self._introduce_all()

    async def _release(self, page: _Page | None, why: Message | None, unless: _Page | None = None) -> bool:
        """Take control from a page, or from the one that has it; what moves for it is stopped. Whether it had it."""
        async with self._switching:
            if self._operator is None or self._operator[0] is unless or page not in (None, self._operator[0]):
                return False
            holder, operator = self._operator
            self._operator = None
            if why is not None and holder in self._pages:
                self._refuse(holder, why)
            await operator.close()
        self._introduce_all()
        return True

    async def _stop_egm(self, page: _Page, request: Ask) -> None:
        """Over a connection of its own: that of a page that has control may be to a driver that has ended."""
        async with page.stopping:
            operator = Operator(self._live, page.send, page.send_report, self._planning)

            async def stop() -> object:
                await operator.open()
                return await operator.carry_out(request.id, request.request)

            try:
                await operator.answer(request.id, stop)
            finally:
                await operator.close()

    def _cancel_giving_back(self) -> None:
        if self._giving_back is not None:
            self._giving_back.cancel()

    def _begin(self, work: Coroutine[Any, Any, object]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _why_not_operated(self, page: _Page) -> Message | None:
        """Why a page may only look; None when it may operate the robot."""
        if (why_not := self._why_none_operates()) is not None:
            return why_not
        if self._live.is_virtual or page.is_local or page.is_paired:
            return None
        return message("operated_once_paired" if page.is_encrypted else "operated_elsewhere_over_https")

    def _why_none_operates(self) -> Message | None:
        """Why no page may operate the robot; None where one may."""
        if self._settings.recording is not None:
            return message("is_a_recording")
        if self._controller is not None:
            return message("no_driver_for_controller")
        if self._live.why_not is not None:
            return self._live.why_not
        return None if self._live.is_virtual or self._settings.may_operate else message("page_only_shows")

    @property
    def _may_stop(self) -> bool:
        """Whether every page may stop the robot: one without control, not paired, where none may operate, too."""
        return self._settings.recording is None and self._controller is None and self._live.why_not is None

    def _may_pair(self, page: _Page) -> bool:
        why_not = self._why_not_operated(page)
        return why_not is not None and why_not.code == "operated_once_paired"

    def _words(self, said: Message | None) -> str:
        """In the page's words; empty where there is nothing to say."""
        if said is None:
            return ""
        return sentence(said, FrontEnd.VIRTUAL_PAGE if self._live.is_virtual else FrontEnd.PAGE)

    def _refuse(self, page: _Page, said: Message) -> None:
        page.send({"type": "refused", "sentence": self._words(said)})

    def _publish(self, state: bytes) -> None:
        for page in self._pages:
            page.send_state(state)
        if self._operator is not None and self._operator[0].is_silent and self._taking is None:
            self._taking = asyncio.create_task(self._take_from_silent(self._operator[0]))

    def _publish_events(self, events: tuple[EventReport, ...]) -> None:
        """Apart from the states, of which a slow page gets only some."""
        for page in self._pages:
            page.send({"type": "events", "events": self._live.words_of_events(events)})

    def _publish_log(self, message: LogMessage) -> None:
        data = msgspec.json.encode(message)
        for page in self._pages:
            page.send_bytes(data)

    async def _take_from_silent(self, page: _Page) -> None:
        try:
            await self._release(page, message("page_was_silent"))
        finally:
            self._taking = None

    def _note_driver(self) -> None:
        """A driver was found or lost: the page that has control loses it together with the driver."""
        self._introduce_all()
        if self._live.why_not is not None:
            self._begin(self._release(None, message("driver_has_ended")))

    def _introduce_all(self) -> None:
        for page in self._pages:
            self._introduce(page)

    def _introduce(self, page: _Page) -> None:
        """What a page must know beside the state: whether there is a robot or a recording, and who operates the robot.

        Of a recording its name and date, so that the page says of a state when it was so.
        """
        holder = self._operator[0] if self._operator is not None else None
        recording = self._settings.recording
        page.send(
            {
                "type": "view",
                "is_recording": recording is not None,
                "recording": None if recording is None else {"name": recording["name"], "date": recording["date"]},
                "controller": None if self._controller is None else self._controller.reader.kind,
                "log": () if self._controller is None else tuple(self._controller.lines),
                "why_no_robot": "" if recording is not None else self._words(self._shown.why_not),
                "is_virtual": self._shown.is_virtual,
                "why_not_operated": self._words(self._why_not_operated(page)),
                "may_stop": self._may_stop,
                "may_pair": self._may_pair(page),
                "control": "none" if holder is None else "here" if holder is page else "elsewhere",
                "events": self._live.words_of_events(self._shown.events),
                "surroundings": self._shown.surroundings,
                "faults": [_fault_for_page(each) for each in Fault] if self._live.is_virtual else [],
            }
        )


class _Page:
    """One page; what it is sent waits here: messages in order, of states the newest, once the one before is shown.

    A browser that is slow would else show states that are seconds old.
    """

    def __init__(self, socket: web.WebSocketResponse, *, is_local: bool, is_encrypted: bool, is_paired: bool) -> None:
        self.socket, self.is_local, self.is_encrypted, self.is_paired = socket, is_local, is_encrypted, is_paired
        self.stopping = asyncio.Lock()  # one Stop EGM at a time
        self._messages: deque[bytes] = deque(maxlen=200)
        self._state = self._report = b""
        self._sent_at: float | None = None  # of a state that is not shown yet, on the loop's clock [s]
        self._has_news = asyncio.Event()

    def send(self, message: Mapping[str, Any]) -> None:
        self.send_bytes(msgspec.json.encode(message))

    def send_bytes(self, message: bytes) -> None:
        self._messages.append(message)
        self._has_news.set()

    def send_state(self, state: bytes) -> None:
        self._state = state
        self._has_news.set()

    def send_report(self, message: Mapping[str, Any]) -> None:
        """What became of a frame of the page's device, in place of what waits of another one."""
        self._report = msgspec.json.encode(message)
        self._has_news.set()

    def seen(self) -> None:
        """The last state is shown."""
        self._sent_at = None
        self._has_news.set()

    @property
    def is_silent(self) -> bool:
        """Whether a state has not been shown for too long."""
        return self._sent_at is not None and asyncio.get_running_loop().time() - self._sent_at > _ANSWER

    async def send_all(self) -> None:
        """Until the socket is closed."""
        while not self.socket.closed:
            await self._has_news.wait()
            self._has_news.clear()
            while self._messages:
                await self.socket.send_str(self._messages.popleft().decode())
            if self._report:
                report, self._report = self._report, b""
                await self.socket.send_str(report.decode())
            if self._state and self._sent_at is None:
                state, self._state = self._state, b""
                self._sent_at = asyncio.get_running_loop().time()
                await self.socket.send_str(state.decode())


def _fault_for_page(fault: Fault) -> dict[str, Any]:
    kind = fault.value
    return {
        "name": kind.name,
        "meaning": kind.meaning.partition("; with --")[0],  # an option of the command
        "has_side": kind.has_side,
        "has_duration": kind.has_duration,
        "default_duration": kind.default_duration,
        "unit": "" if kind.amount is None else kind.amount.unit,
        "default": None if kind.amount is None else kind.amount.default,
    }


def _is_address(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True
