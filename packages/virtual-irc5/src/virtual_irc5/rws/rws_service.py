"""The virtual controller's side of Robot Web Services as a calculation: logins, formats, and the table of operations.

A request comes in as a value and an answer goes out as one. ``virtual_irc5.server`` owns the port, the controller the
behaviour.
"""

from __future__ import annotations

import logging
import re
import secrets
from collections.abc import Callable, Collection
from dataclasses import replace
from functools import lru_cache
from math import inf
from typing import Any

from abb_protocols.errors import ProtocolError, RapidError, SettingsError
from abb_protocols.rws.documents import FORM_TYPE, Form, Page, Pairs, RwsState, Status, first_value
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.operations.users import LOGOUT
from abb_protocols.rws.values import GRANTS, Grant, RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller_log import Refused
from virtual_irc5.rws import (
    configuration,
    ctrl,
    dialogs,
    event_log,
    files,
    io,
    modules,
    motion,
    panel,
    rapid,
    symbols,
    system,
)
from virtual_irc5.rws.http import (
    NONCE_LIFE,
    HttpReply,
    HttpRequest,
    HttpSession,
    SessionTable,
    TooManySessions,
    digest_challenge,
    is_genuine,
    make_nonce,
    nonce_age,
    read_cookies,
    read_credentials,
)
from virtual_irc5.rws.mastership import OWN_DOMAINS, Mastership
from virtual_irc5.rws.queues import DipcQueues
from virtual_irc5.rws.render import page_at, write_page, write_status
from virtual_irc5.rws.router import Route, Router
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, Shown, bad_call, call_refusal
from virtual_irc5.rws.subscriptions import SubscriptionRules, Subscriptions, Upgrade
from virtual_irc5.rws.users import VirtualUsers

ROUTES = (
    *system.ROUTES,
    *panel.ROUTES,
    *event_log.ROUTES,
    *ctrl.ROUTES,
    *rapid.ROUTES,
    *dialogs.ROUTES,
    *modules.ROUTES,
    *symbols.ROUTES,
    *io.ROUTES,
    *motion.ROUTES,
    *configuration.ROUTES,
    *files.ROUTES,
)
"""All that depend on the controller alone; mastership and subscriptions belong to the sessions of one server."""

_NO_CONTENT = 204

log = logging.getLogger(__name__)


class RwsService:
    """Answers requests for ``controller`` from clients that know ``user`` and ``password``.

    ``granted`` is what the user may do; ``hang_up`` breaks every connection to the server.

    Attributes:
        scheme, default_port: of its addresses.
        domains: of mastership.
        rules: of subscriptions.
        routes: of all its operations.
    """

    scheme = "http"
    default_port = 80
    domains = OWN_DOMAINS
    rules = SubscriptionRules()

    def __init__(
        self,
        controller: Irc5,
        *,
        user: str,
        password: str,
        granted: Collection[Grant] = GRANTS,
        hang_up: Callable[[], None] = lambda: None,
    ) -> None:
        self._controller = controller
        self._user = user
        self._password = password
        self._sessions = SessionTable()
        self._nonce_secret = secrets.token_hex()[:16]
        self._nonces = 0
        self._users = VirtualUsers(granted)
        self._mastership = Mastership(self._users, self.domains)
        self._messages = DipcQueues(controller)
        self._subscriptions = Subscriptions(self._mastership, self._users, self._messages, self.rules)
        self.routes: tuple[Route, ...] = (
            *ROUTES,
            *self._users.routes,
            *self._mastership.routes,
            *self._messages.routes,
            *self._subscriptions.routes,
            Route(LOGOUT, lambda *_: None),
        )
        self._router = self._build_router()
        self._hang_up = hang_up
        self._was_restarting = False
        self._now = -inf
        self._busy_until = -inf

    @property
    def operations(self) -> tuple[Operation[Any], ...]:
        """All that clients may ask for."""
        return tuple(route.operation for route in self.routes)

    def _build_router(self) -> Router:
        return Router(self.routes)

    def handle(self, request: HttpRequest, now: float) -> HttpReply | Upgrade | None:
        """The answer to ``request``, which arrived at ``now`` [s]; None while the controller restarts."""
        self._now = now
        if self._controller.is_restarting:
            return None
        busy = _plain(503, "The controller is busy.")
        return busy if now < self._busy_until else self._authorized(request, now)

    def may_enter(self, request: HttpRequest, now: float) -> bool:
        """Whether a request belongs to a session, or has credentials that open one."""
        if self._sessions.find(_cookies(request), now) is not None:
            return True
        age = self._proven_age(request, now)
        return age is not None and age <= NONCE_LIFE

    def advance(self, now: float) -> None:
        """Send events of what has changed, and forget what belongs to sessions that have ended."""
        self._now = now
        if self._controller.is_restarting and not self._was_restarting:
            self.drop_web_sockets()
            self.expire_sessions()
            self._hang_up()
        self._was_restarting = self._controller.is_restarting
        for session in self._subscriptions.listening():
            self._sessions.keep_alive(session, now)
        self._forget_ended()
        self._subscriptions.advance(now)

    # Faults

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
        self._subscriptions.drop_channels()

    def _forget_ended(self) -> None:
        sessions = self._sessions.alive(self._now)
        self._subscriptions.keep(sessions)
        self._mastership.keep(sessions)
        self._messages.keep(sessions)
        self._users.keep(sessions, self._now)

    # Logging in

    def _authorized(self, request: HttpRequest, now: float) -> HttpReply | Upgrade:
        """The answer to a request of a session; a challenge, or 503, to any other."""
        found = self._sessions.find(_cookies(request), now) or self._log_in(request, now)
        if isinstance(found, HttpReply):
            return replace(found, status=403) if _is_upgrade(request) else found
        set_cookies = self._sessions.touch(found, request.peer, now)
        reply = self._answer(request, found)
        if not set_cookies:
            return reply
        headers = tuple(("Set-Cookie", line) for line in set_cookies)
        return replace(reply, headers=(*headers, *reply.headers))

    def _log_in(self, request: HttpRequest, now: float) -> HttpSession | HttpReply:
        """The session of a request with genuine credentials, or the challenge for one without."""
        age = self._proven_age(request, now)
        if age is None or age > NONCE_LIFE:
            header = ("WWW-Authenticate", self._challenge(now, is_stale=age is not None))
            reply = _plain(401, "Access denied: log in with user and password.")
            return replace(reply, headers=(header, *reply.headers))
        known = self._sessions.find_by_connection(_cookies(request))
        try:
            return known or self._sessions.open(now)
        except TooManySessions as error:
            return _plain(503, str(error))

    def _challenge(self, now: float, *, is_stale: bool) -> str:
        """What a client without a session is asked for."""
        self._nonces += 1
        return digest_challenge(make_nonce(self._nonce_secret, now, self._nonces), is_stale=is_stale)

    def _proven_age(self, request: HttpRequest, now: float) -> float | None:
        """Age of the nonce in genuine credentials [s]; None without such."""
        try:
            credentials = read_credentials(request.header("Authorization") or "")
        except ProtocolError:
            return None  # not readable: the answer is a challenge
        if not is_genuine(
            credentials, user=self._user, password=self._password, method=request.method, target=request.target
        ):
            return None
        return nonce_age(credentials.nonce, self._nonce_secret, now)

    # Answering

    def find(self, request: HttpRequest) -> tuple[Route, RwsCall]:
        """The route of a request, and its call, neither authorized nor checked; its form only where work is prepared.

        Raises:
            CallFailure: there is none.
        """
        route, names = self._router.find(request.method, request.path, request.query)
        form = () if route.prepare is None else request.form()
        return route, RwsCall(request.method, request.path, request.query, form, names)

    def _answer(self, request: HttpRequest, session: HttpSession) -> HttpReply | Upgrade:
        form = Form.XHTML
        try:
            if request.path[:1] == ("poll",) and _is_upgrade(request):
                protocols = request.header("Sec-WebSocket-Protocol") or ""
                return self._subscriptions.upgrade(request.path, session.id, protocols)
            form = self._form(request)
            return self._operate(request, form, session)
        except CallFailure as error:
            failure = error
        except Refused as error:
            failure = call_refusal(error)
        except RapidError as error:
            failure = CallFailure(400, RwsCode.TASK_STATE, str(error))
        except SettingsError as error:
            failure = bad_call(str(error))
        except Exception:  # whatever a client sends, the controller goes on
            log.exception("%s /%s met a fault of the virtual controller", request.method, "/".join(request.path))
            failure = CallFailure(400, RwsCode.FAIL, "a fault of the virtual controller")
        service = next((part for part in request.path if part != "rw"), "rw")
        title = "Error" if service == "fileservice" else "rw"
        host = request.header("Host") or ""
        content_type = (("Content-Type", self._content_type(form)),)
        return HttpReply(failure.status, content_type, self._status(failure.document(service), form, host, title))

    def _operate(self, request: HttpRequest, form: Form, session: HttpSession) -> HttpReply:
        """Check a request against the table, carry it out, and show its result in the client's format."""
        pairs = self._pairs(request)
        host = request.header("Host") or ""
        method, path, query = request.method, request.path, request.query
        status = 200
        answer: Shown
        if self._wants_forms(request):
            answer = self._forms(path)
        else:
            route, names = self._router.find(method, path, query)
            operation = route.operation
            privilege = self._users.privilege(session.id)
            own = _with_port(host, self.default_port)
            call = RwsCall(method, path, query, pairs, names, request.body, session.id, own, privilege)
            self._users.check(operation, self._controller, call)
            self._check_mastership(operation, call)
            call.check(operation)
            answer = route.answer(self._controller, call)
            status = operation.success
            if operation.path == LOGOUT.path:
                self._sessions.close(session)
                self._forget_ended()
        if isinstance(answer, HttpReply):
            return answer
        content_type = (("Content-Type", self._content_type(form)),)
        if answer is None:
            return HttpReply(status, () if status == _NO_CONTENT else content_type)
        return HttpReply(status, content_type, self._page(answer, form, host))

    def _form(self, request: HttpRequest) -> Form:
        """The representation a client asks for."""
        return Form.JSON if first_value(request.query, "json") == "1" else Form.XHTML

    def _pairs(self, request: HttpRequest) -> Pairs:
        """The form in the body.

        Raises:
            CallFailure: 415, the body is of another type.
        """
        if request.method == "PUT" and request.path[:1] == ("fileservice",):  # which is a file
            return ()
        kind = (request.header("Content-Type") or "").partition(";")[0].strip().lower()
        if request.body and kind != FORM_TYPE:  # only a body that is there must have its type
            raise CallFailure(415, RwsCode.INVALIDARG, f"a body is {FORM_TYPE}, not {kind or 'of no type'}")
        return request.form()

    def _wants_forms(self, request: HttpRequest) -> bool:
        """Whether a client asks what it can do with a resource."""
        is_group = request.path[:1] == ("subscription",) and len(request.path) > 1  # which shows its values
        return request.method == "GET" and first_value(request.query, "action") == "show" and not is_group

    def _check_mastership(self, operation: Operation[Any], call: RwsCall) -> None:
        self._mastership.check(operation, self._controller, call)

    def _content_type(self, form: Form) -> str:
        return form.value

    def _page(self, page: Page, form: Form, host: str) -> bytes:
        base = f"{self.scheme}://{host}{page.base}"
        return write_page(Page(page.title, base, page.states, page.links), form)

    def _status(self, status: Status, form: Form, host: str, title: str) -> bytes:
        return write_status(status, form, base=f"{self.scheme}://{host}/", title=title)

    def _forms(self, path: tuple[str, ...]) -> Page:
        """What can be done with a resource, as a form for each of its actions."""
        operations = self._router.actions(path)
        if not operations:
            raise CallFailure(404, RwsCode.FAIL, f"there is nothing to do with /{'/'.join(path)}")
        states = []
        for each in operations:
            fields = {name: "|".join(allowed) for name, allowed in each.values.items()}
            states.append(RwsState("form", each.action or each.method.lower(), {"method": each.method, **fields}))
        return page_at(path[0], "/", "/".join(path), *states)


@lru_cache(64)
def _with_port(host: str, port: int) -> str:
    return host if re.search(r":\d+$", host) else f"{host}:{port}"


def _cookies(request: HttpRequest) -> dict[str, str]:
    return read_cookies(request.header_values("Cookie"))


def _is_upgrade(request: HttpRequest) -> bool:
    return (request.header("Upgrade") or "").lower() == "websocket"


def _plain(status: int, sentence: str) -> HttpReply:
    """An answer from before any resource is reached."""
    return HttpReply(status, (("Content-Type", "text/html"),), f"<html><body>{sentence}</body></html>".encode())
