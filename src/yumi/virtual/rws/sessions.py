"""The server's sessions: known by cookie, forgotten after five idle minutes (reference/rws.md §2.2)."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from yumi.errors import YumiError
from yumi.rws import auth as cookies

MAX_SESSIONS = 70
IDLE_LIFE = 300.0  # [s]
_MAX_CONNECTIONS = 16  # remembered per session; a client that reconnects for each request must not fill memory
_FIRST_CONNECTION = 1507337


class TooManySessions(YumiError):
    """All sessions of the controller are taken."""


@dataclass(slots=True)
class Session:
    """One login.

    Attributes:
        id: value of the session cookie.
        last_used: time of the latest request [s].
        connections: the connection cookie of each TCP connection the session arrived on.
    """

    id: str
    last_used: float
    connections: dict[str, str] = field(default_factory=dict)


class SessionTable:
    """The sessions of one server; ``make_id`` gives 32 random hexadecimal digits."""

    def __init__(self, make_id: Callable[[], str] = secrets.token_hex) -> None:
        self._make_id = make_id
        self._sessions: dict[str, Session] = {}
        self._opened = 0
        self._connections = 0

    def __len__(self) -> int:
        return len(self._sessions)

    def find(self, request_cookies: Mapping[str, str], now: float) -> Session | None:
        """The session a request belongs to, by its session cookie."""
        self._forget_idle(now)
        return self._sessions.get(request_cookies.get(cookies.SESSION, ""))

    def find_by_connection(self, request_cookies: Mapping[str, str]) -> Session | None:
        """The session of a connection cookie; a small number proves nothing: check the digest first."""
        number = request_cookies.get(cookies.CONNECTION)
        return next((each for each in self._sessions.values() if number in each.connections.values()), None)

    def alive(self, now: float) -> tuple[str, ...]:
        """The ids of the sessions that have not expired."""
        self._forget_idle(now)
        return tuple(self._sessions)

    def keep_alive(self, id: str, now: float) -> None:
        """Note that a session is in use without a request."""
        if id in self._sessions:
            self._sessions[id].last_used = now

    def clear(self) -> None:
        """End all sessions."""
        self._sessions.clear()

    def open(self, now: float) -> Session:
        """A new session.

        Raises:
            TooManySessions: 70 are open.
        """
        self._forget_idle(now)
        if len(self._sessions) >= MAX_SESSIONS:
            raise TooManySessions(f"Too many sessions {len(self._sessions)}/{MAX_SESSIONS}.")
        self._opened += 1
        session = Session(f"{self._opened}::http.session::{self._make_id()[:32]}", now)
        self._sessions[session.id] = session
        return session

    def close(self, session: Session) -> None:
        """End a session."""
        self._sessions.pop(session.id, None)

    def touch(self, session: Session, peer: str, now: float) -> tuple[str, ...]:
        """Note a request on TCP connection ``peer``; the ``Set-Cookie`` values its answer must carry.

        The session cookie comes first and the connection cookie last; some clients count on the order.
        """
        session.last_used = now
        if peer in session.connections:
            return ()
        is_new = not session.connections
        if len(session.connections) >= _MAX_CONNECTIONS:
            session.connections.pop(next(iter(session.connections)))
        number = str(_FIRST_CONNECTION + self._connections)
        self._connections += 1
        session.connections[peer] = number
        connection = cookies.set_cookie(cookies.CONNECTION, number)
        return (cookies.set_cookie(cookies.SESSION, session.id), connection) if is_new else (connection,)

    def _forget_idle(self, now: float) -> None:
        idle = [each for each in self._sessions.values() if now - each.last_used > IDLE_LIFE]
        for session in idle:
            self.close(session)
