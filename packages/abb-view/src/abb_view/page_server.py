"""The web server of a page: who may open it, its files, and a WebSocket for each page that is open.

The files of the page are for everyone; what it shows is for a page of this machine, or with the token where there is
one. A page of a foreign origin, or under a host name that is not this machine's, is refused.
"""

from __future__ import annotations

import asyncio
import logging
import platform
import secrets
import ssl
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path
from threading import Event
from typing import Any, Generic, TypeVar

import msgspec
from aiohttp import WSCloseCode, WSMsgType, web

from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.errors import SettingsError, YumiError
from abb_runtime.faults import Fault
from abb_runtime.process.certificate import installation_certificate
from abb_runtime.process.command_process import PAGE_READY
from abb_runtime.udp import host_of_url, is_loopback
from abb_view.robot_model import MESH_FOLDER

_ALL_ADDRESSES = ("0.0.0.0", "::")
"""To listen on all of this machine."""

FORWARDED = ("Forwarded", "Via", "X-Forwarded-For", "X-Forwarded-Host", "X-Forwarded-Proto", "X-Real-IP")
"""Headers with which a proxy says that it forwards a request: of another machine, wherever the proxy runs."""

MAX_PAGES = 8
"""So many pages are served at once."""

_log = logging.getLogger(__name__)
_MAX_MESSAGE = 1 << 14  # of a page [bytes]
_PING = 30.0  # [s]
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
class PageSettings:
    """How a page is served.

    Attributes:
        host: address to listen on.
        port: to listen on; 0 takes a free one.
        tls: with which the page is served over HTTPS; None serves it over HTTP.
        token: what pages must show; needed where another machine can reach the server.
    """

    host: str = "127.0.0.1"
    port: int = 8090
    tls: ssl.SSLContext | None = None
    token: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        if not is_loopback(self.host) and not self.token:
            raise SettingsError(message("page_needs_token", host=self.host))


class OpenPage:
    """One page; what it is sent waits here: messages in order, of states the newest, once the one before is shown.

    A browser that is slow would else show states that are seconds old.

    Attributes:
        socket: to it.
        is_local: whether it is open on this machine.
    """

    def __init__(self, socket: web.WebSocketResponse, *, is_local: bool) -> None:
        self.socket, self.is_local = socket, is_local
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
        """What became of what a page sends again and again, in place of what waits of another one."""
        self._report = msgspec.json.encode(message)
        self._has_news.set()

    def seen(self) -> None:
        """The last state is shown."""
        self._sent_at = None
        self._has_news.set()

    def is_silent(self, longest: float) -> bool:
        """Whether a state has not been shown for longer than this [s]."""
        return self._sent_at is not None and asyncio.get_running_loop().time() - self._sent_at > longest

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


def is_of_this_machine(request: web.Request) -> bool:
    """Whether a page on this machine sends a request, and no proxy for one of another machine."""
    return is_loopback(request.remote or "") and not any(each in request.headers for each in FORWARDED)


_AnyPage = TypeVar("_AnyPage", bound=OpenPage)


class PageServer(ABC, Generic[_AnyPage]):
    """Serves a page from :meth:`start` to :meth:`stop`, on the event loop of its caller.

    Args:
        settings: how.
        program: the command that serves it, for sentences.
        files: the built page.
        model: what the page draws, see :mod:`abb_view.robot_model`.

    Attributes:
        port: it listens on, once it has started.
        pages: those that are open.
    """

    def __init__(self, settings: PageSettings, program: str, files: Path, model: Mapping[str, Any]) -> None:
        self.port = settings.port
        self.pages: set[_AnyPage] = set()
        self._served, self._program, self._files = settings, program, files
        self._no_token = f"Open the page by the address with the token that `{program}` printed."
        self.draw(model)
        application = web.Application(middlewares=[self._guard])
        application.router.add_get("/", self._index)
        application.router.add_get("/model.json", self._send_model)
        application.router.add_get("/ws", self._serve_page)
        application.router.add_static("/static", self._files)
        if MESH_FOLDER.is_dir():
            application.router.add_static("/meshes", MESH_FOLDER)
        self._application = application
        self._runner = web.AppRunner(application, access_log=None, shutdown_timeout=0.5)

    @abstractmethod
    def open_page(self, socket: web.WebSocketResponse, request: web.Request) -> _AnyPage:
        """The page at the other end of a WebSocket."""

    @abstractmethod
    def introduce(self, page: _AnyPage) -> None:
        """Send a page what it must know beside the state."""

    @abstractmethod
    async def take(self, page: _AnyPage, data: str) -> None:
        """Carry out a message of a page."""

    @abstractmethod
    def watch(self, is_watched: bool) -> None:
        """Whether a page is open."""

    def draw(self, model: Mapping[str, Any]) -> None:
        """What pages that are opened from now on draw, see :mod:`abb_view.robot_model`."""
        self._model = msgspec.json.encode({"program": self._program, **model})

    async def forget(self, page: _AnyPage) -> None:
        """A page was closed."""

    @property
    def url(self) -> str:
        """Where a browser finds it; by this machine's name where it listens on all addresses."""
        host = platform.node() if self._served.host in _ALL_ADDRESSES else self._served.host
        host = f"[{host}]" if ":" in host else host
        # Behind a #, a browser sends it to no server.
        token = f"#token={self._served.token}" if self._served.token else ""
        scheme = "https" if self._served.tls is not None else "http"
        return f"{scheme}://{host}:{self.port}/{token}"

    async def start(self) -> None:
        """Listen.

        Raises:
            SettingsError: the port is not free or not allowed.
        """
        await self._runner.setup()
        try:
            site = web.TCPSite(self._runner, self._served.host, self.port, ssl_context=self._served.tls)
            await site.start()
        except (OSError, OverflowError) as error:
            await self._runner.cleanup()
            reason = (isinstance(error, OSError) and error.strerror) or error
            raise SettingsError(
                message("port_cannot_be_opened", port=self.port, host=self._served.host, why=str(reason))
            ) from error
        self.port = self._runner.addresses[0][1]

    async def stop(self) -> None:
        """Close all pages and end."""
        for page in tuple(self.pages):
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
                f"`{self._program}` printed."
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
        if is_loopback(self._served.host):
            return False
        node, own = platform.node().lower(), platform.node().partition(".")[0].lower()
        names = {self._served.host.lower(), node, own, f"{own}.local"}
        return bool(host) and (_is_address(host) or host in names)

    def _has_token(self, request: web.Request) -> bool:
        # Not in a cookie: a browser sends cookies to every port of a host, so to servers of other users, too.
        given = request.query.get("token", "").encode(errors="surrogateescape")
        return secrets.compare_digest(given, self._served.token.encode()) or not self._served.token

    async def _index(self, request: web.Request) -> web.StreamResponse:
        return web.FileResponse(self._files / "index.html")

    async def _send_model(self, request: web.Request) -> web.StreamResponse:
        return web.Response(body=self._model, content_type="application/json")

    async def _serve_page(self, request: web.Request) -> web.StreamResponse:
        if "Origin" not in request.headers:  # every browser sends one; other programs have interfaces of their own
            raise web.HTTPForbidden(text="Only the page may open this connection.")
        socket = web.WebSocketResponse(heartbeat=_PING, max_msg_size=_MAX_MESSAGE, compress=False)
        await socket.prepare(request)
        # A page can read why a connection was closed, not why there is none.
        if not self._has_token(request):
            await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=self._no_token.encode())
            return socket
        if len(self.pages) >= MAX_PAGES:
            await socket.close(
                code=WSCloseCode.TRY_AGAIN_LATER, message=f"{MAX_PAGES} pages are open already; close one.".encode()
            )
            return socket
        page = self.open_page(socket, request)
        self.pages.add(page)
        self.watch(True)
        self.introduce(page)
        sending = asyncio.create_task(page.send_all())
        try:
            async for received in socket:
                if received.type is WSMsgType.TEXT:
                    await self.take(page, received.data)
        finally:
            self.pages.discard(page)
            self.watch(bool(self.pages))
            sending.cancel()
            await self.forget(page)
            with suppress(asyncio.CancelledError, ConnectionError):
                await sending
        return socket


def serve_pages(server: PageServer[Any], is_over: Event, show: Callable[[str], None]) -> None:
    """Serve pages until ``is_over``; ``show`` takes the line that says where a browser finds them."""

    async def run() -> None:
        await server.start()
        show(f"{PAGE_READY}{server.url}")
        try:
            await asyncio.to_thread(is_over.wait)
        finally:
            await server.stop()

    asyncio.run(run())


def page_tls(listen: str, product: str, show: Callable[[str], None]) -> ssl.SSLContext:
    """TLS with the certificate of this installation, for the names and addresses under which a page is opened.

    Args:
        listen: address to listen on.
        product: the package that serves the page.
        show: takes the lines by which a person knows the certificate again in a browser.

    Raises:
        MissingPrerequisite: the package ``cryptography`` is not installed.
        SettingsError: the certificate cannot be read or written.
    """
    node = platform.node()
    own = node.partition(".")[0]
    hosts = ["127.0.0.1", "::1", node, own, f"{own}.local", *(() if listen in _ALL_ADDRESSES else (listen,))]
    certificate = installation_certificate([host for host in hosts if host], product)
    show(f"Certificate of this installation, SHA-256 {certificate.fingerprint}")
    if certificate.is_new:
        show("It was made now, for a year: a device that has accepted an older one is asked again.")
    show("A browser warns of it until it is trusted: compare the fingerprint there.")
    return certificate.context


def error_on_page(error: Exception, program: str) -> Message:
    """What an exception says; what is no refusal is a fault of ours, which the log of ``program`` shows whole."""
    if isinstance(error, YumiError):
        return error.said
    _log.error("What a page has asked for failed with %s: %s", type(error).__name__, error, exc_info=error)
    return message("view_failed", program=program, kind=type(error).__name__, why=said_by(error))


def fault_for_page(fault: Fault) -> dict[str, Any]:
    """What a page must know of a fault that a virtual controller takes."""
    kind = fault.value
    return {
        "name": kind.name,
        "meaning": kind.meaning,
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
