"""One session with a controller: login, retries, rate limit and deadline, one policy for every request.

* A session is opened by digest once and then kept by its cookies; credentials are never sent unasked. When the
  controller has forgotten the session, the request is answered 401, was not carried out, and is sent again with a new
  login.
* A request that only reads is repeated, at most twice, when the connection breaks or the controller is busy (503).
* Any other request is never repeated after it may have been carried out.
* The content of a file may take longer than the timeout, as long as it goes on (``_LONGEST_TRANSFER``).
* Requests keep the rate a controller asks for; waiting for it is not part of a request's timeout.
* One request at a time; but one that a peer lets wait delays another one only shortly: that goes on a second
  connection, which belongs to the same session (reference/rws.md §2.2: cookies hold on every connection).

Source: reference/rws.md §1.1-1.2, §2.2.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from threading import Condition, Lock

import httpx

from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.errors import LoginRefused, NoConnection, ProtocolError
from abb_protocols.rws.request import BUSY_STATUS, RwsRequest
from abb_protocols.rws.values import CONNECTION_COOKIE, REALM, SESSION_COOKIE
from abb_runtime.clock import Clock
from abb_runtime.rws.transport import EXCHANGE_INTERVAL, ConnectionLost, ExchangeDeadline, Transport
from abb_runtime.rws.web_socket import Listener, OpenWebSocket

REQUEST_BURST = 15
"""So many requests may come at once after a rest, so that a short task such as bring-up need not wait."""

_LONGEST_TRANSFER = 600.0
"""Longest time a file may take [s], however steadily it goes or comes."""

_UNAUTHORIZED = 401
_REPEATS = 2
_CONNECTIONS = 2
_PATIENCE = 0.5  # [s] a request waits so long for the one before it; a controller answers within some 10 ms

_REALM = re.compile(r'realm="([^"]*)"')

# A controller's own cookies: visible ASCII; the longest that was seen has 55 characters. All others are dropped: they
# would make the next requests longer than the controller reads.
_COOKIE = re.compile(rf"({SESSION_COOKIE}|{CONNECTION_COOKIE})=([!-:<-~]{{1,256}})\s*(?:;|$)")

_log = logging.getLogger(__name__)


class RateLimit:
    """The rate limit of requests, in the order in which they come; safe from any thread.

    Args:
        clock: by which the time passes.
        interval: mean time between two requests [s]; 0 does not limit them.
    """

    def __init__(self, clock: Clock, interval: float = EXCHANGE_INTERVAL) -> None:
        self._clock = clock
        self._interval = interval
        self._lock = Lock()
        self._rested_at = -inf  # when the whole burst is available again

    def wait(self) -> None:
        """Wait until one more request may be sent."""
        delay = self._take()
        if delay > 0.0:
            self._clock.wait(delay)

    def count(self) -> None:
        """Count a request that follows another at once, as a login does; later ones wait for it."""
        self._take()

    def _take(self) -> float:
        with self._lock:
            now = self._clock.now()
            self._rested_at = max(self._rested_at, now) + self._interval
            return self._rested_at - now - REQUEST_BURST * self._interval


class RwsSession:
    """A login over ``transport``; requests of several threads queue up.

    Attributes:
        login_count: how often the controller has let us in; the second login is for a session that it does not know.
    """

    def __init__(self, transport: Transport, *, user: str, password: str, timeout: float, clock: Clock) -> None:
        self.address = transport.address
        self.login_count = 0
        self._transport = transport
        self._user = user
        self._password = password
        self._timeout = timeout
        self._clock = clock
        self._cookies: dict[str, str] = {}  # replaced as a whole: another thread may be reading it
        self._turns = Condition()
        self._running: list[object] = []  # exchanges under way, the oldest first
        self._slow: object = None  # the one that has delayed another one for too long
        self._is_abandoned = False
        self._rate_limit = self._own_limit = RateLimit(clock, transport.request_interval)

    @property
    def is_open(self) -> bool:
        """Whether the controller has given us a session, as far as we know."""
        return SESSION_COOKIE in self._cookies

    def exchange(self, request: RwsRequest) -> httpx.Response:
        """The controller's response to ``request``, whatever its status, within the timeout once it has its turn.

        Its turn comes within the timeout, too, unless several requests wait for a controller that does not answer.

        Raises:
            NoConnection: nothing answered in time.
            LoginRefused: the user or the password is wrong.
            ProtocolError: what answers is not a controller.
        """
        self._check_not_abandoned()
        self._rate_limit.wait()
        with self._turn():
            deadline = ExchangeDeadline(self._clock.now() + self._timeout)
            if request.is_transfer:
                deadline = ExchangeDeadline(self._clock.now() + _LONGEST_TRANSFER, self._timeout)
            repeats = _REPEATS if request.is_repeatable else 0
            while True:
                try:
                    response = self._authorized(request, deadline)
                    if response.status_code != BUSY_STATUS or not repeats:
                        return response
                except ConnectionLost:
                    if not repeats:
                        raise
                repeats -= 1
                self._rate_limit.count()

    def lift_rate_limit(self) -> None:
        """No request waits because many came before it, until the next login: another controller may answer then."""
        self._rate_limit = RateLimit(self._clock, 0.0)

    def open_socket(self, target: str, listener: Listener) -> OpenWebSocket:
        """A WebSocket that belongs to this session, on a connection of its own.

        Raises:
            NoConnection: nothing answered in time.
            ControllerRefused: what answers does not open a WebSocket.
        """
        self._check_not_abandoned()
        self._rate_limit.wait()
        return self._transport.open_socket(target, _cookie_header(self._cookies), listener, self._timeout)

    def close(self) -> None:
        """Close the connection and forget the session; the controller keeps it until its time is up."""
        self._cookies = {}
        self._transport.close()

    def abandon(self) -> None:
        """End what is under way, and refuse every later request at once: for a program that has to end now.

        Later requests raise NoConnection.
        """
        with self._turns:
            self._is_abandoned = True
            self._turns.notify_all()
        self._transport.close()

    def not_a_controller(self, reason: Message) -> ProtocolError:
        """The error for a peer that speaks HTTP but not Robot Web Services."""
        return ProtocolError(message("no_controller_answers", address=self.address, reason=reason))

    def _check_not_abandoned(self) -> None:
        if self._is_abandoned:
            raise NoConnection(message("client_abandoned", address=self.address))

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """One exchange's turn: alone, or beside one that is slow."""
        turn = object()
        with self._turns:
            if not self._turns.wait_for(self._may_begin, _PATIENCE):
                self._slow = self._running[0]
                self._turns.notify_all()
                if not self._turns.wait_for(self._may_begin, self._timeout):
                    raise NoConnection(message("other_requests_under_way", address=self.address, timeout=self._timeout))
            self._running.append(turn)
        try:
            yield
        finally:
            with self._turns:
                self._running.remove(turn)
                self._turns.notify_all()

    def _may_begin(self) -> bool:
        """A request without a session waits for the one that logs in: two at once would open two sessions."""
        if not self._running or self._is_abandoned:
            return True
        return self._slow is self._running[0] and len(self._running) < _CONNECTIONS and self.is_open

    def _authorized(self, request: RwsRequest, deadline: ExchangeDeadline) -> httpx.Response:
        """The response of a controller that knows us; logs in where it does not."""
        cookies = self._cookies
        try:
            outgoing = httpx.Request(
                request.method,
                f"http://{self.address}{request.target}",
                headers={} if request.content_type is None else {"Content-Type": request.content_type},
                content=request.body,
                extensions={"deadline": deadline},
            )
        except httpx.InvalidURL as error:
            raise ProtocolError(message("request_not_http", address=self.address, error=said_by(error))) from error
        outgoing.headers.encoding = "utf-8"  # of user names in a login
        response = self._once(outgoing, cookies, deadline)
        if response.status_code == _UNAUTHORIZED and self.is_open and self._cookies != cookies:
            # Another request has logged in meanwhile: one session is enough.
            response = self._once(outgoing, self._cookies, deadline)
        if response.status_code != _UNAUTHORIZED:
            return response
        self._cookies = {}  # the old session is gone
        self._rate_limit.count()
        response = self._once(self._with_credentials(outgoing, response), {}, deadline)
        if response.status_code == _UNAUTHORIZED:
            raise LoginRefused(message("login_refused", address=self.address, user=self._user))
        if self.login_count:
            self._rate_limit = self._own_limit
        self.login_count += 1
        return response

    def _with_credentials(self, outgoing: httpx.Request, challenge: httpx.Response) -> httpx.Request:
        """``outgoing`` with the answer to the challenge of a controller; httpx computes it."""
        login = httpx.DigestAuth(self._user, self._password).auth_flow(outgoing)
        next(login)
        # Without the cookies of whatever answers: httpx would send them with the credentials.
        headers = [(name, value) for name, value in challenge.headers.raw if name.lower() == b"www-authenticate"]
        try:
            proved = login.send(httpx.Response(challenge.status_code, headers=headers, request=outgoing))
        except (StopIteration, httpx.ProtocolError, NotImplementedError, LookupError, ValueError) as error:
            raise self.not_a_controller(message("asks_for_other_login")) from error
        realm = _REALM.search(challenge.headers["WWW-Authenticate"])
        if realm is None or realm[1] != REALM:
            raise self.not_a_controller(message("login_for_other_realm", realm=realm[1] if realm else ""))
        return proved

    def _once(self, outgoing: httpx.Request, cookies: dict[str, str], deadline: ExchangeDeadline) -> httpx.Response:
        self._check_not_abandoned()
        if self._clock.now() >= deadline.end:
            raise NoConnection(message("no_answer_in_time", address=self.address, timeout=self._timeout))
        outgoing.headers.pop("Cookie", None)
        if cookies:
            outgoing.headers["Cookie"] = _cookie_header(cookies)
        response = self._transport.handle_request(outgoing)
        found = (_COOKIE.match(line.strip()) for line in response.headers.get_list("Set-Cookie"))
        self._cookies = {**self._cookies, **{own[1]: own[2] for own in found if own}}
        return response


def _cookie_header(cookies: dict[str, str]) -> str:
    return "; ".join(f"{name}={value}" for name, value in cookies.items())
