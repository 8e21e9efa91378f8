"""The virtual controller's side of Robot Web Services: logins, formats, and the table of all resources.

A request comes in as a value and an answer goes out as one; the port belongs to ``yumi.virtual.rws.http_server``, the
behaviour to the controller.
"""

from __future__ import annotations

import logging
import re
import secrets
from collections.abc import Callable
from dataclasses import replace
from math import inf
from urllib.parse import unquote

from yumi.errors import ProtocolError, RapidError
from yumi.rws import auth as cookies
from yumi.rws import auth as digest
from yumi.rws import documents as forms
from yumi.rws.documents import Form, write_page, write_status
from yumi.rws.http import HttpReply, HttpRequest
from yumi.rws.types import Code
from yumi.virtual.controller.errors import Refused
from yumi.virtual.rws import files as rws_cfg
from yumi.virtual.rws import files as rws_elog
from yumi.virtual.rws import files as rws_files
from yumi.virtual.rws import io as rws_io
from yumi.virtual.rws import io as rws_motion
from yumi.virtual.rws import panel as rws_panel
from yumi.virtual.rws import panel as rws_system
from yumi.virtual.rws import rapid as rws_rapid
from yumi.virtual.rws import routes as rws_refusals
from yumi.virtual.rws.http_server import Upgrade
from yumi.virtual.rws.mastership import Mastership
from yumi.virtual.rws.routes import Call, Controller, Failure, answer
from yumi.virtual.rws.sessions import Session, SessionTable, TooManySessions
from yumi.virtual.rws.subscriptions import Subscriptions

ROUTES = (
    *rws_system.RWS_SYSTEM_ROUTES,
    *rws_panel.ROUTES,
    *rws_rapid.ROUTES,
    *rws_io.ROUTES,
    *rws_motion.RWS_MOTION_ROUTES,
    *rws_cfg.RWS_CFG_ROUTES,
    *rws_elog.RWS_ELOG_ROUTES,
    *rws_files.ROUTES,
)

log = logging.getLogger(__name__)

_OK = 200
_NO_CONTENT = 204
_BUSY = "The controller is busy."


class RwsAdapter:
    """Answers requests for ``controller`` from clients that know ``user`` and ``password``.

    Args:
        controller: what the requests are about.
        user: the one user.
        password: of the user.
        make_secret: gives 64 hexadecimal digits nobody can guess.
        hang_up: cuts off every connection to the server.
    """

    def __init__(
        self,
        controller: Controller,
        *,
        user: str,
        password: str,
        make_secret: Callable[[], str] = secrets.token_hex,
        hang_up: Callable[[], None] = lambda: None,
    ) -> None:
        self._controller = controller
        self._user = user
        self._password = password
        self._sessions = SessionTable(make_secret)
        self._nonce_secret = make_secret()[:16]
        self._nonces = 0
        self._mastership = Mastership()
        self._subscriptions = Subscriptions()
        self._routes = (*ROUTES, *self._mastership.routes(), *self._subscriptions.routes())
        self._hang_up = hang_up
        self._was_dark = False
        self._now = -inf
        self._busy_until = -inf

    def handle(self, request: HttpRequest, now: float) -> HttpReply | Upgrade | None:
        """The answer to ``request``, which arrived at ``now`` [s]; None when nobody is there to answer."""
        self._now = now
        if self._controller.is_dark:
            return None
        reply = _plain(503, _BUSY) if now < self._busy_until else self._authorized(request, now)
        if isinstance(reply, Upgrade):
            return reply
        return replace(reply, headers=(*reply.headers, _connection(request)))

    def knows(self, request: HttpRequest, now: float) -> bool:
        """Whether a request is of a session, or has credentials that open one."""
        if self._sessions.find(cookies.read_cookies(request.header_values("Cookie")), now) is not None:
            return True
        age = self._proven_age(request, now)
        return age is not None and age <= digest.NONCE_LIFE

    def advance(self, now: float) -> None:
        """Tell subscribers what has changed, and forget what belongs to sessions that have ended."""
        self._now = now
        if self._controller.is_dark and not self._was_dark:
            self.drop_web_sockets()
            self.expire_sessions()
            self._hang_up()
        self._was_dark = self._controller.is_dark
        groups = self._subscriptions.groups
        for session in groups.listening():
            self._sessions.keep_alive(session, now)
        self._forget_ended()
        groups.advance(now)

    # What can happen to it

    def reset_connections(self) -> None:
        """Every TCP connection breaks; sessions stay."""
        self._hang_up()

    def be_busy(self, duration: float) -> None:
        """Answer everything with status 503 for ``duration`` [s]."""
        self._busy_until = self._now + duration

    def expire_sessions(self) -> None:
        """All sessions end, and with them subscriptions and masterships."""
        self._sessions.clear()
        self._forget_ended()

    def drop_web_sockets(self) -> None:
        """Every WebSocket breaks; the subscriptions stay."""
        self._subscriptions.groups.drop_channels()

    def _forget_ended(self) -> None:
        """Take back what belongs to sessions that have ended."""
        sessions = self._sessions.alive(self._now)
        self._subscriptions.groups.keep(sessions)
        self._mastership.keep(sessions)

    # Logging in and answering

    def _authorized(self, request: HttpRequest, now: float) -> HttpReply | Upgrade:
        session = self._sessions.find(cookies.read_cookies(request.header_values("Cookie")), now)
        found = self._log_in(request, now) if session is None else session
        if isinstance(found, HttpReply):
            return replace(found, status=403) if _is_upgrade(request) else found
        set_cookies = self._sessions.touch(found, request.peer, now)
        reply = self._answer(request, found)
        headers = tuple(("Set-Cookie", line) for line in set_cookies)
        return replace(reply, headers=(*headers, *reply.headers))

    def _log_in(self, request: HttpRequest, now: float) -> Session | HttpReply:
        """The session of a request with genuine credentials, or the challenge for one without."""
        age = self._proven_age(request, now)
        if age is None or age > digest.NONCE_LIFE:
            return self._challenge(now, is_stale=age is not None)
        known = self._sessions.find_by_connection(cookies.read_cookies(request.header_values("Cookie")))
        try:
            return known or self._sessions.open(now)
        except TooManySessions as error:
            return _plain(503, str(error))

    def _proven_age(self, request: HttpRequest, now: float) -> float | None:
        """Age of the nonce in genuine credentials [s]; None without such."""
        try:
            credentials = digest.read_credentials(request.header("Authorization") or "")
        except ProtocolError:
            return None  # whoever cannot say who they are is asked
        is_genuine = digest.is_genuine(
            credentials,
            user=self._user,
            password=self._password,
            method=request.method,
            target=request.target,
        )
        return digest.nonce_age(credentials.nonce, self._nonce_secret, now) if is_genuine else None

    def _challenge(self, now: float, *, is_stale: bool) -> HttpReply:
        self._nonces += 1
        nonce = digest.make_nonce(self._nonce_secret, now, self._nonces)
        header = ("WWW-Authenticate", digest.Challenge(nonce, is_stale=is_stale).header())
        reply = _plain(401, "Access denied: log in with user and password.")
        return replace(reply, headers=(header, *reply.headers))

    def _answer(self, request: HttpRequest, session: Session) -> HttpReply | Upgrade:
        path, _, query = request.target.partition("?")
        call = Call(request.method, _segments(path), forms.decode(query), session=session.id, host=_host(request))
        form = Form.JSON if call.option("json") == "1" else Form.XHTML
        root = f"http://{request.header('Host') or ''}"
        try:
            if call.path[:1] == ("poll",) and _is_upgrade(request):
                return self._subscriptions.upgrade(call, request.header("Sec-WebSocket-Protocol") or "")
            return self._done(_with_body(call, request), session, form, root)
        except Refused as refused:
            return _failed(rws_refusals.failure(refused), call, form, root)
        except RapidError as error:
            return _failed(Failure(400, Code.TASK_STATE, str(error)), call, form, root)
        except Failure as failure:
            return _failed(failure, call, form, root)
        except Exception:  # whatever a client asks, the controller goes on
            log.exception("%s %s met a fault of the virtual controller", call.method, path)
            return _failed(Failure(400, Code.FAIL, "a fault of the virtual controller"), call, form, root)

    def _done(self, call: Call, session: Session, form: Form, root: str) -> HttpReply:
        if call.path == ("logout",):
            self._sessions.close(session)
            self._forget_ended()
            return HttpReply(_NO_CONTENT)
        self._mastership.check(call)
        page = answer(self._routes, self._controller, call)
        if page is None:
            return HttpReply(_NO_CONTENT)
        if isinstance(page, HttpReply):
            return page
        body = write_page(replace(page, base=root + page.base), form)
        return HttpReply(_OK, (("Content-Type", form.value),), body)


def _segments(path: str) -> tuple[str, ...]:
    """The parts of a path; a sub-property behind ``;`` shows in the page of its resource anyway."""
    return tuple(unquote(part).partition(";")[0] for part in path.split("/") if part)


def _host(request: HttpRequest) -> str:
    """Host and port as the client calls them; the port is told even where it goes without saying."""
    host = request.header("Host") or ""
    return host if re.search(r":\d+$", host) else f"{host}:80"


def _is_upgrade(request: HttpRequest) -> bool:
    return (request.header("Upgrade") or "").lower() == "websocket"


def _with_body(call: Call, request: HttpRequest) -> Call:
    """The call with its form, or with the file it carries."""
    is_file = call.method == "PUT" and call.path[:1] == ("fileservice",)
    return replace(call, content=request.body, form=() if is_file else _form(request))


def _form(request: HttpRequest) -> forms.Pairs:
    """The form in the body; only a body that is there must say that it is one."""
    kind = (request.header("Content-Type") or "").partition(";")[0].strip().lower()
    if request.body and kind != forms.CONTENT_TYPE:
        raise Failure(415, Code.INVALIDARG, f"a body is {forms.CONTENT_TYPE}, not {kind or 'of no type'}")
    return forms.decode(request.body.decode("utf-8", "replace"))


def _failed(failure: Failure, call: Call, form: Form, root: str) -> HttpReply:
    service = call.path[1] if len(call.path) > 1 else "rw"
    body = write_status(rws_refusals.status_of(failure, service), form, base=f"{root}/")
    return HttpReply(failure.status, (("Content-Type", form.value),), body)


def _plain(status: int, sentence: str) -> HttpReply:
    """An answer from before any resource is reached."""
    return HttpReply(status, (("Content-Type", "text/html"),), f"<html><body>{sentence}</body></html>".encode())


def _connection(request: HttpRequest) -> tuple[str, str]:
    is_last = (request.header("Connection") or "").lower() == "close"
    return ("Connection", "close" if is_last else "Keep-Alive")
