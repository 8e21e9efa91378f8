"""One session with a controller over one connection: login, retries and deadline, one policy for all.

* A session is opened by digest once and then kept by its cookies; when the controller has forgotten it, the
  request is answered 401, was not carried out, and is sent again with a new login.
* A request that only reads is repeated, at most twice, when the connection breaks or the controller is busy
  (503).
* Any other request is never repeated after it may have been carried out.
* Requests keep the pace a controller asks for; waiting for its turn is no part of a request's timeout.
* One request at a time; but one that a peer lets wait keeps no other one waiting for long: that goes on a second
  connection, which belongs to the same session (reference/rws.md §2.2: cookies hold on every connection).

Source: reference/rws.md §1.1-1.2, §2.2.

The pace of requests: a controller wants fewer than twenty a second (reference/rws.md §1.1).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from threading import Condition, Lock
from typing import Protocol

from yumi.clock import Clock
from yumi.errors import LoginRefused, NoConnection, ProtocolError
from yumi.rws import auth as digest
from yumi.rws.auth import Headers, Login
from yumi.rws.http import ConnectionLost, HttpReply, HttpRequest, Listener
from yumi.rws.requests import Request

INTERVAL = 0.051
"""Mean time between two requests [s]."""

BURST = 15
"""So many requests may come at once after a rest, so that a short task such as bring-up need not wait."""


class RequestPace:
    """Gives every request its turn, in the order in which the requests come; safe from any thread.

    Args:
        clock: where waiting time comes from.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = Lock()
        self._rested_at = -inf  # when the whole burst is available again

    def wait(self) -> None:
        """Wait for the turn of one request."""
        delay = self._take()
        if delay > 0.0:
            self._clock.wait(delay)

    def count(self) -> None:
        """Count a request that follows another at once, as a login does; later ones wait for it."""
        self._take()

    def _take(self) -> float:
        with self._lock:
            now = self._clock.now()
            self._rested_at = max(self._rested_at, now) + INTERVAL
            return self._rested_at - now - BURST * INTERVAL


_REPEATS = 2
_UNAUTHORIZED = 401
_BUSY = 503
_CONNECTIONS = 2
_PATIENCE = 0.5  # [s] a request waits so long for the one before it; a controller answers within some 10 ms


class Link(Protocol):
    """Carries two exchanges at a time; :class:`yumi.rws.http.HttpLink` is one."""

    @property
    def address(self) -> str: ...

    def exchange(self, request: HttpRequest, timeout: float) -> HttpReply: ...

    def open_socket(self, request: HttpRequest, listener: Listener, timeout: float) -> Socket: ...

    def close(self) -> None:
        """Close the connections, and end the exchanges under way."""


class Socket(Protocol):
    """An open WebSocket; :class:`yumi.rws.subscription.WebSocket` is one."""

    def close(self) -> None: ...


class RwsSession:
    """A login over ``link``; requests of several threads queue up."""

    def __init__(self, link: Link, *, user: str, password: str, timeout: float, clock: Clock) -> None:
        self.address = link.address
        self._link = link
        self._user = user
        self._timeout = timeout
        self._clock = clock
        self._login = Login(user, password)
        self._turns = Condition()
        self._running: list[object] = []  # exchanges under way, the oldest first
        self._slow: object = None  # the one that has kept another one waiting for too long
        self._is_abandoned = False
        self._pace = RequestPace(clock)

    @property
    def is_open(self) -> bool:
        """Whether the controller has given us a session, as far as we know."""
        return self._login.has_session

    def exchange(self, request: Request) -> HttpReply:
        """The controller's answer to ``request``, whatever its status, within the timeout once it has its turn.

        Its turn comes within the timeout, too, unless several requests wait for a controller that does not answer.

        Raises:
            NoConnection: nothing answered in time.
            LoginRefused: the user or the password is wrong.
            ProtocolError: what answers is not a controller.
        """
        self._check_not_abandoned()
        self._pace.wait()
        with self._turn():
            return self._repeated(request, self._clock.now() + self._timeout)

    def open_socket(self, target: str, listener: Listener) -> Socket:
        """A WebSocket that belongs to this session, on a connection of its own.

        Raises:
            NoConnection: nothing answered in time.
            ControllerRefused: what answers does not open a WebSocket.
        """
        self._check_not_abandoned()
        self._pace.wait()
        return self._link.open_socket(HttpRequest("GET", target, self._login.headers()), listener, self._timeout)

    def close(self) -> None:
        """Close the connection and forget the session; the controller keeps it until its time is up."""
        self._login.forget()
        self._link.close()

    def abandon(self) -> None:
        """End what is under way, and refuse every later request at once: for a program that has to end now.

        Later requests raise NoConnection.
        """
        with self._turns:
            self._is_abandoned = True
            self._turns.notify_all()
        self._link.close()

    def _check_not_abandoned(self) -> None:
        if self._is_abandoned:
            raise NoConnection(f"{self.address} is not asked any more: this program is ending.")

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """One exchange's turn: alone, or beside one that is slow."""
        turn = object()
        with self._turns:
            if not self._turns.wait_for(self._may_begin, _PATIENCE):
                self._slow = self._running[0]
                self._turns.notify_all()
                if not self._turns.wait_for(self._may_begin, self._timeout):
                    raise NoConnection(
                        f"{self.address} is busy with other requests for {self._timeout:.1f} s; ask again."
                    )
            self._running.append(turn)
        try:
            yield
        finally:
            with self._turns:
                self._running.remove(turn)
                self._turns.notify_all()

    def _may_begin(self) -> bool:
        """Whoever is not logged in waits for the one that logs in: two at once would open two sessions."""
        if not self._running or self._is_abandoned:
            return True
        return self._slow is self._running[0] and len(self._running) < _CONNECTIONS and self._login.has_session

    def _repeated(self, request: Request, deadline: float) -> HttpReply:
        for _ in range(_REPEATS if request.is_repeatable else 0):
            try:
                reply = self._authorized(request, deadline)
            except ConnectionLost:
                self._pace.count()
                continue
            if reply.status != _BUSY:
                return reply
            self._pace.count()
        return self._authorized(request, deadline)

    def _authorized(self, request: Request, deadline: float) -> HttpReply:
        cookies = self._login.headers()
        reply = self._once(request, cookies, deadline)
        if reply.status == _UNAUTHORIZED and self._login.has_session and self._login.headers() != cookies:
            # Another request has logged in meanwhile: one session is enough.
            reply = self._once(request, self._login.headers(), deadline)
        if reply.status != _UNAUTHORIZED:
            return reply
        proof = self._login.answer(self._challenge(reply), request.method, request.target)
        self._pace.count()
        reply = self._once(request, proof, deadline)
        if reply.status == _UNAUTHORIZED:
            raise LoginRefused(
                f"The controller at {self.address} does not accept user {self._user!r} with this password; give "
                "the right ones (a new controller knows user 'Default User' with password 'robotics')."
            )
        return reply

    def _once(self, request: Request, headers: Headers, deadline: float) -> HttpReply:
        self._check_not_abandoned()
        left = deadline - self._clock.now()
        if left <= 0.0:
            raise NoConnection(f"{self.address} did not answer within {self._timeout:.1f} s.")
        kind = () if request.content_type is None else (("Content-Type", request.content_type),)
        message = HttpRequest(request.method, request.target, headers + kind, request.body)
        reply = self._link.exchange(message, left)
        self._login.accept(reply.headers)
        return reply

    def _challenge(self, reply: HttpReply) -> digest.Challenge:
        try:
            challenge = digest.read_challenge(reply.header("WWW-Authenticate") or "")
        except ProtocolError as error:
            raise self.not_a_controller("it asks for another kind of login") from error
        if challenge.realm != digest.REALM:
            raise self.not_a_controller(f"its login is for {challenge.realm!r}")
        return challenge

    def not_a_controller(self, why: str) -> ProtocolError:
        """The error for a peer that speaks HTTP but not Robot Web Services."""
        return ProtocolError(
            f"A web server answers at {self.address}, but it is not an IRC5 controller with Robot Web Services "
            f"1.0: {why}; check the address and the port."
        )
