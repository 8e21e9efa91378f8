"""HTTP of the virtual controller: requests, replies, the digest login (credentials, nonces), sessions kept by cookies.

The login is that of RFC 2617 with MD5 and qop=auth; sessions are forgotten after five idle minutes (reference/rws.md
§2.1-2.2).
"""

from __future__ import annotations

import re
import secrets
from base64 import b64decode, b64encode
from binascii import Error as Base64Error
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import md5
from hmac import compare_digest
from urllib.parse import unquote

from abb_protocols.errors import ProtocolError, YumiError
from abb_protocols.rws.documents import Form, Pairs, decode_form
from abb_protocols.rws.values import CONNECTION_COOKIE, REALM, SESSION_COOKIE

_Headers = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class HttpRequest:
    """A request as the virtual controller receives it.

    Attributes:
        method: e.g. GET.
        target: path and query, exactly as on the request line.
        headers: names and values, in order; names may repeat.
        body: the content, empty for none.
        peer: the TCP connection it came on.
        path: the segments, unescaped, without a sub-property behind ``;``: it shows in the page of its resource anyway.
        query: parameters in the URL.
    """

    method: str
    target: str
    headers: _Headers = ()
    body: bytes = b""
    peer: str = ""
    path: tuple[str, ...] = field(init=False, repr=False, compare=False)
    query: Pairs = field(init=False, repr=False, compare=False)
    _values: dict[str, list[str]] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        path, _, query = self.target.partition("?")
        segments = tuple(unquote(part).partition(";")[0] for part in path.split("/") if part)
        object.__setattr__(self, "path", segments)
        object.__setattr__(self, "query", decode_form(query))
        for name, value in self.headers:  # once: several are looked up for each request
            self._values.setdefault(name.lower(), []).append(value)

    def header(self, name: str) -> str | None:
        """The first value of ``name`` in any case, or None."""
        values = self._values.get(name.lower())
        return values[0] if values else None

    def header_values(self, name: str) -> Sequence[str]:
        """All values of ``name`` in any case."""
        return self._values.get(name.lower(), ())

    def form(self) -> Pairs:
        """The form in the body; that of a module's text takes longer than a cycle the first time."""
        return _long_form(self.body) if len(self.body) > _LONG_FORM else _form(self.body)


_LONG_FORM = 4096  # bytes


def _form(body: bytes) -> Pairs:
    return decode_form(body.decode("utf-8", "replace"))


_long_form = lru_cache(2)(_form)


@dataclass(frozen=True, slots=True)
class HttpReply:
    """A response as the virtual controller sends it."""

    status: int
    headers: _Headers = ()
    body: bytes = b""

    @classmethod
    def at(cls, location: str, status: int = 202) -> HttpReply:
        """What was made, or is under way, is to be found at another address."""
        return cls(status, (("Location", location), ("Content-Type", Form.XHTML.value)))

    def header(self, name: str) -> str | None:
        """The first value of ``name`` in any case, or None."""
        return next((value for key, value in self.headers if key.lower() == name.lower()), None)


# The login

NONCE_LIFE = 300.0  # [s]; Appweb calls a nonce stale after five minutes

_DIGEST_FIELDS = ("username", "realm", "nonce", "uri", "response")
_DIGEST_FIELDS_OF_QOP = ("nc", "cnonce")
_PATH_PARAMETERS = re.compile(r";[^/]*$")  # of the last segment of a path
_DIGEST_PARAMETER = re.compile(r'([A-Za-z][\w-]*)\s*=\s*(?:"((?:[^"\\]|\\.)*)"|([^\s,"]+))')


def digest_challenge(nonce: str, *, is_stale: bool = False) -> str:
    """What a server asks for in ``WWW-Authenticate``, in the order and quoting of an IRC5."""
    return (
        f'Digest realm="{REALM}", domain="/", qop="auth", nonce="{nonce}", '
        f'opaque="799d5", algorithm="MD5", stale="{"TRUE" if is_stale else "FALSE"}"'
    )


@dataclass(frozen=True, slots=True)
class Credentials:
    """What a client answers in ``Authorization``; ``nc`` stays text, the controller does not count it.

    Without ``qop``, as in RFC 2069, which Appweb accepts, ``nc`` and ``cnonce`` are empty.
    """

    user: str
    realm: str
    nonce: str
    uri: str
    response: str
    nc: str
    cnonce: str


def read_credentials(header: str) -> Credentials:
    """The digest credentials in an ``Authorization`` value.

    Raises:
        ProtocolError: it is not digest, or a field is missing.
    """
    scheme, _, rest = header.partition(" ")
    if scheme.lower() != "digest":
        raise ProtocolError(f"Robot Web Services logs in with HTTP digest, not with {scheme!r}.")
    found = {
        key.lower(): re.sub(r"\\(.)", r"\1", quoted) or bare for key, quoted, bare in _DIGEST_PARAMETER.findall(rest)
    }
    required = (*_DIGEST_FIELDS, *(_DIGEST_FIELDS_OF_QOP if "qop" in found else ()))
    missing = [name for name in required if name not in found]
    if missing:
        raise ProtocolError(f"The digest header lacks {', '.join(missing)}.")
    user, realm, nonce, uri, response = (found[name] for name in _DIGEST_FIELDS)
    nc, cnonce = (found[name] if "qop" in found else "" for name in _DIGEST_FIELDS_OF_QOP)
    return Credentials(user, realm, nonce, uri, response, nc, cnonce)


def is_genuine(credentials: Credentials, *, user: str, password: str, method: str, target: str) -> bool:
    """Whether the credentials prove knowledge of the password for this request.

    Clients differ in how they escape the uri, so it is compared unescaped; the response is over the one they
    sent. Python's ``requests`` leaves out what stands behind a ``;`` of the path, others the whole query.
    """
    path, mark, query = target.partition("?")
    meant = {unquote(target), unquote(f"{_PATH_PARAMETERS.sub('', path)}{mark}{query}"), unquote(path)}
    if credentials.realm != REALM or unquote(credentials.uri) not in meant:
        return False
    secret = _md5(f"{user}:{credentials.realm}:{password}")
    has_qop = credentials.nc or credentials.cnonce
    count = f"{credentials.nonce}:{credentials.nc}:{credentials.cnonce}:auth" if has_qop else credentials.nonce
    expected = _md5(f"{secret}:{count}:" + _md5(f"{method}:{credentials.uri}"))
    same_user = compare_digest(_bytes(credentials.user), _bytes(user))
    return compare_digest(_bytes(credentials.response.lower()), _bytes(expected)) and same_user


def make_nonce(secret: str, now: float, count: int) -> str:
    """A nonce in Appweb's layout: secret (16 hex digits), realm, time [ms], counter."""
    return b64encode(f"{secret}:{REALM}:{int(now * 1000):x}:{count:x}".encode()).decode()


def nonce_age(nonce: str, secret: str, now: float) -> float | None:
    """Age of one of our own nonces [s]; None when we did not make it."""
    try:
        parts = b64decode(nonce, validate=True).decode("ascii").split(":")
        made_by, realm, time_ms, _ = parts
        age = now - int(time_ms, 16) / 1000.0
    except (Base64Error, ValueError, OverflowError):
        return None
    return age if compare_digest(made_by, secret) and realm == REALM else None


def _md5(text: str) -> str:
    return md5(_bytes(text), usedforsecurity=False).hexdigest()


def _bytes(text: str) -> bytes:
    """As they came: a header may hold bytes that are not text, which Python keeps as surrogates."""
    return text.encode(errors="surrogateescape")


# Cookies and sessions


def _set_cookie(name: str, value: str) -> str:
    """A ``Set-Cookie`` value; always the same path, or clients see two cookies of one name."""
    return f"{name}={value}; path=/; httponly"


def read_cookies(headers: Iterable[str]) -> dict[str, str]:
    """The cookies of a request, from all its ``Cookie`` values."""
    pairs = (part.partition("=") for header in headers for part in header.split(";"))
    return {name.strip(): value.strip().strip('"') for name, _, value in pairs if name.strip()}


MAX_SESSIONS = 70
IDLE_SESSION_LIFE = 300.0  # [s]
_MAX_CONNECTIONS = 16  # remembered per session; a client that reconnects for each request must not fill memory
_FIRST_CONNECTION = 1507337


class TooManySessions(YumiError):
    """All sessions of the controller are taken."""


@dataclass(slots=True)
class HttpSession:
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
        self._sessions: dict[str, HttpSession] = {}
        self._opened = 0
        self._connections = 0

    def __len__(self) -> int:
        return len(self._sessions)

    def find(self, request_cookies: Mapping[str, str], now: float) -> HttpSession | None:
        """The session a request belongs to, by its session cookie."""
        session = self._sessions.get(request_cookies.get(SESSION_COOKIE, ""))
        if session is not None and _is_idle(session, now):
            self.close(session)
            return None
        return session

    def find_by_connection(self, request_cookies: Mapping[str, str]) -> HttpSession | None:
        """The session of a connection cookie; a small number proves nothing: check the digest first."""
        number = request_cookies.get(CONNECTION_COOKIE)
        return next((each for each in self._sessions.values() if number in each.connections.values()), None)

    def alive(self, now: float) -> Collection[str]:
        """The ids of the sessions that have not expired."""
        self._forget_idle(now)
        return self._sessions.keys()

    def keep_alive(self, id: str, now: float) -> None:
        """Note that a session is in use without a request."""
        if id in self._sessions:
            self._sessions[id].last_used = now

    def clear(self) -> None:
        """End all sessions."""
        self._sessions.clear()

    def open(self, now: float) -> HttpSession:
        """A new session.

        Raises:
            TooManySessions: 70 are open.
        """
        self._forget_idle(now)
        if len(self._sessions) >= MAX_SESSIONS:
            raise TooManySessions(f"Too many sessions {len(self._sessions)}/{MAX_SESSIONS}.")
        self._opened += 1
        session = HttpSession(f"{self._opened}::http.session::{self._make_id()[:32]}", now)
        self._sessions[session.id] = session
        return session

    def close(self, session: HttpSession) -> None:
        """End a session."""
        self._sessions.pop(session.id, None)

    def touch(self, session: HttpSession, peer: str, now: float) -> tuple[str, ...]:
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
        connection = _set_cookie(CONNECTION_COOKIE, number)
        return (_set_cookie(SESSION_COOKIE, session.id), connection) if is_new else (connection,)

    def _forget_idle(self, now: float) -> None:
        for session in [each for each in self._sessions.values() if _is_idle(each, now)]:
            self.close(session)


def _is_idle(session: HttpSession, now: float) -> bool:
    return now - session.last_used > IDLE_SESSION_LIFE
