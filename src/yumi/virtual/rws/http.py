"""HTTP and the documents it carries, as the virtual controller has them.

The first half is HTTP: requests and replies, the digest login (RFC 2617, MD5, qop=auth), and sessions kept by cookies,
which are forgotten after five idle minutes (reference/rws.md §2.1-2.2).

The second half makes and writes documents: pages and errors as XHTML or JSON, those of RobotWare 7 as HAL, and events
as XHTML (reference/rws.md §3, §14). Clients cut them with regular expressions and receive events into buffers of 1024
bytes, so spelling and length count: events are one line of ASCII.
"""

from __future__ import annotations

import json
import re
import secrets
from base64 import b64decode, b64encode
from binascii import Error as Base64Error
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from hashlib import md5
from hmac import compare_digest
from urllib.parse import unquote
from xml.sax.saxutils import escape

from yumi.errors import ProtocolError, YumiError
from yumi.rws.documents import XMLNS, Form, Link, Page, State, Status
from yumi.rws.types import CONNECTION_COOKIE, REALM, SESSION_COOKIE

# HTTP: requests and replies, login, sessions --------------------------------------------------------------------------

Headers = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class HttpRequest:
    """A request as the virtual controller receives it.

    Attributes:
        method: e.g. GET.
        target: path and query, exactly as on the request line.
        headers: names and values, in order; names may repeat.
        body: the content, empty for none.
        peer: the TCP connection it came on.
    """

    method: str
    target: str
    headers: Headers = ()
    body: bytes = b""
    peer: str = ""
    _values: dict[str, list[str]] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name, value in self.headers:  # once: several are looked up for each request
            self._values.setdefault(name.lower(), []).append(value)

    def header(self, name: str) -> str | None:
        """The first value of ``name`` in any case, or None."""
        values = self._values.get(name.lower())
        return values[0] if values else None

    def header_values(self, name: str) -> Sequence[str]:
        """All values of ``name`` in any case."""
        return self._values.get(name.lower(), ())


@dataclass(frozen=True, slots=True)
class HttpReply:
    """A response as the virtual controller sends it."""

    status: int
    headers: Headers = ()
    body: bytes = b""

    def header(self, name: str) -> str | None:
        """The first value of ``name`` in any case, or None."""
        return next((value for key, value in self.headers if key.lower() == name.lower()), None)


# The login

OPAQUE = "799d5"
NONCE_LIFE = 300.0  # [s]; Appweb calls a nonce stale after five minutes

_DIGEST_FIELDS = ("username", "realm", "nonce", "uri", "response")
_DIGEST_FIELDS_OF_QOP = ("nc", "cnonce")
_PATH_PARAMETERS = re.compile(r";[^/]*$")  # of the last segment of a path
_DIGEST_PARAMETER = re.compile(r'([A-Za-z][\w-]*)\s*=\s*(?:"((?:[^"\\]|\\.)*)"|([^\s,"]+))')


@dataclass(frozen=True, slots=True)
class Challenge:
    """What a server asks for in ``WWW-Authenticate``."""

    nonce: str
    realm: str = REALM
    opaque: str = OPAQUE
    is_stale: bool = False

    def header(self) -> str:
        """The header's value, in the order and quoting of an IRC5."""
        stale = "TRUE" if self.is_stale else "FALSE"
        return (
            f'Digest realm="{self.realm}", domain="/", qop="auth", nonce="{self.nonce}", '
            f'opaque="{self.opaque}", algorithm="MD5", stale="{stale}"'
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


def set_cookie(name: str, value: str) -> str:
    """A ``Set-Cookie`` value; always the same path, or clients see two cookies of one name."""
    return f"{name}={value}; path=/; httponly"


def read_cookies(headers: Iterable[str]) -> dict[str, str]:
    """The cookies of a request, from all its ``Cookie`` values."""
    pairs = (part.partition("=") for header in headers for part in header.split(";"))
    return {name.strip(): value.strip().strip('"') for name, _, value in pairs if name.strip()}


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
        session = self._sessions.get(request_cookies.get(SESSION_COOKIE, ""))
        if session is not None and _is_idle(session, now):
            self.close(session)
            return None
        return session

    def find_by_connection(self, request_cookies: Mapping[str, str]) -> Session | None:
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
        connection = set_cookie(CONNECTION_COOKIE, number)
        return (set_cookie(SESSION_COOKIE, session.id), connection) if is_new else (connection,)

    def _forget_idle(self, now: float) -> None:
        for session in [each for each in self._sessions.values() if _is_idle(each, now)]:
            self.close(session)


def _is_idle(session: Session, now: float) -> bool:
    return now - session.last_used > IDLE_LIFE


# Documents: pages, errors and events ----------------------------------------------------------------------------------

_XML = '<?xml version="1.0" encoding="UTF-8"?>'
_ILLEGAL_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_NOTHING_TO_ESCAPE = re.compile("[ !#-%'-;=?-~]*")  # most texts: nothing in them has to be escaped
_ENTITIES = {'"': "&quot;", "\t": "&#9;", "\n": "&#10;", "\r": "&#13;"}

MAX_EVENT = 1024
"""What the receive buffers of common clients hold [byte]."""


def resource(title: str, base: str, href: str, *states: State, next_href: str | None = None) -> Page:
    """A page with the links every resource has; ``base`` is a path, the service puts the host before it."""
    links = (Link("self", href), Link("action", f"{href}{'&' if '?' in href else '?'}action=show"))
    more = () if next_href is None else (Link("next", next_href),)
    return Page(title, base, states, links + more)


def entry(type: str, title: str, href: str | None = None, /, **fields: str) -> State:
    """An entry of a list that leads to ``href``, by default its title; ``_`` in field names stands for ``-``."""
    named = {name.replace("_", "-"): text for name, text in fields.items()}
    return State(type, title, named, (Link("self", title if href is None else href),))


def write_page(page: Page, form: Form) -> bytes:
    """The page as a document: XHTML on one line after the XML declaration, as clients match it line by line.

    The title has no place in JSON.
    """
    if form is Form.JSON:
        links = {"base": {"href": page.base}} | _json_links(page.links)
        return _json_bytes({"_links": links, "_embedded": {"_state": [_json_state(state) for state in page.states]}})
    states = "".join(map(_list_item, page.states))
    content = f'<div class="state">{_anchors(page.links)}<ul>{states}</ul></div>'
    return f"{_XML}\n{_html(page.title, page.base, content)}".encode("utf-8", "replace")


def write_status(status: Status, form: Form, *, base: str, title: str = "rw") -> bytes:
    """The status as an error document; its code is a number in JSON."""
    if form is Form.JSON:
        embedded = {"status": {"code": status.code, "msg": status.message}, "_state": []}
        return _json_bytes({"_links": {"base": {"href": base}}, "_embedded": embedded})
    content = f'<div class="status">{_span("code", f"{status.code:d}")}{_span("msg", status.message)}</div>'
    return f"{_XML}\n{_html(title, base, content)}".encode("utf-8", "replace")


def write_hal(page: Page) -> bytes:
    """The page as HAL of RobotWare 7: what has an address of its own is embedded, the rest is the page's state.

    Names are those of the XHTML, and all values are texts.
    """
    document: dict[str, object] = {"_links": {"base": {"href": page.base}} | _hal_links(page.links)}
    own = [_hal_state(state) for state in page.states if not state.links]
    embedded = [_hal_state(state) for state in page.states if state.links]
    if not embedded:
        document["status"] = {"code": _HAL_SUCCESS}
    if own or not embedded:
        document["state"] = own
    if embedded:
        document["_embedded"] = {"resources": embedded}
    return _json_bytes(document)


def write_hal_status(status: Status, base: str) -> bytes:
    """The status as an error document of RobotWare 7."""
    return _json_bytes({"_links": {"base": {"href": base}}, "status": {"code": status.code, "msg": status.message}})


def write_group(root: str, group: int, events: Sequence[Sequence[State]], *, is_secure: bool = False) -> bytes:
    """The answer to a subscription, with the values of this moment; ``root`` is ``host:port`` of the controller."""
    links = (
        f'<a href="subscription/{group}" rel="group"></a>'
        f'<a href="{"wss" if is_secure else "ws"}://{_escaped(root)}/poll/{group}" rel="self"></a>'
    )
    if not is_secure:
        links += f'<a href="subscription/{group}?action=show" rel="action"></a>'
    return _event_document(root, links, (state for event in events for state in event), is_secure)


def write_event(root: str, group: int, event: Sequence[State], *, is_secure: bool = False) -> str:
    """The message with one event; common clients look for one only in each.

    What is too long for their buffers is sent without its value, which a client can read where the link leads.
    """
    link = f'<a href="subscription/{group}" rel="group"></a>'
    text = _event_document(root, link, event, is_secure)
    if len(text) > MAX_EVENT:
        text = _event_document(root, link, [replace(event[0], fields={})], is_secure)
    return text.decode("ascii")


def _event_document(root: str, links: str, states: Iterable[State], is_secure: bool) -> bytes:
    content = f'<div class="state">{links}<ul>{"".join(map(_list_item, states))}</ul></div>'
    base = f"{'https' if is_secure else 'http'}://{root}/"
    return f"{_XML}{_html('Event', base, content)}".encode("ascii", "xmlcharrefreplace")


# XHTML


def _html(title: str, base: str, content: str) -> str:
    head = f'<head><title>{_escaped(title)}</title><base href="{_escaped(base)}"/></head>'
    return f'<html xmlns="{XMLNS}">{head}<body>{content}</body></html>'


def _list_item(state: State) -> str:
    spans = "".join([_span(name, text) for name, text in state.fields.items()])
    arguments = "".join(
        f'<span class="arg{number}" type="{_escaped(argument.type)}">{_escaped(argument.value)}</span>'
        for number, argument in enumerate(state.arguments, start=1)
    )
    children = f"<ul>{''.join(map(_list_item, state.children))}</ul>" if state.children else ""
    head = f'<li class="{_escaped_name(state.type)}" title="{_escaped(state.title)}">'
    return f"{head}{_anchors(state.links)}{spans}{arguments}{children}</li>"


def _anchors(links: tuple[Link, ...]) -> str:
    return "".join([f'<a href="{_escaped(link.href)}" rel="{_escaped_name(link.rel)}"/>' for link in links])


def _span(name: str, text: str) -> str:
    return f'<span class="{_escaped_name(name)}">{_escaped(text)}</span>'


def _escaped(text: str) -> str:
    return text if _NOTHING_TO_ESCAPE.fullmatch(text) else escape(_ILLEGAL_IN_XML.sub("\ufffd", text), _ENTITIES)


_escaped_name = lru_cache(1024)(_escaped)
"""For types, names of fields and relations: there are few, and each page has many of them."""

# JSON


# Where it differs from the XHTML (reference/rws.md §3.2).
_JSON_FIELD_NAMES: Mapping[str, Mapping[str, str]] = {
    "ms-robtargets": {f"eax_{letter}": f"eax{letter}" for letter in "abcdef"},
    "ms-mechunit": {
        "task-name": "task",
        "is-integrated-unit": "is-integrated-unitname",
        "has-integrated-unit": "has-integrated-unitname",
    },
    "ctrl-env": {"value": "_value"},
}
_JSON_TYPES = {"elog-message-li": "elog-message"}
_LIST_NAMES = {
    "sys-option-li": "options",
    "cfg-ia-t-li": "attrib",
    "sys-option": "options",
    "cfg-ia-t": "attrib",
    "sys-energy-mec-li": "mec",
    "sys-energy-axis-li": "axis",
    "dev-id-li": "devices",
}
_NUMBER_FIELDS = ("lvalue", "pvalue")
_ENCODER = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"))


def _json_bytes(value: object) -> bytes:
    return _ENCODER.encode(value).encode("utf-8", "replace")


def _json_state(state: State) -> dict[str, object]:
    names = _JSON_FIELD_NAMES.get(state.type, {})
    result: dict[str, object] = {"_type": _JSON_TYPES.get(state.type, state.type), "_title": state.title}
    if state.links:
        result["_links"] = _json_links(state.links)
    for name, text in state.fields.items():
        result[names.get(name, name)] = _number_or_text(text) if name in _NUMBER_FIELDS else text
    if state.arguments:
        result["argv"] = [{"type": argument.type, "value": argument.value} for argument in state.arguments]
    if state.children:
        result[_LIST_NAMES.get(state.children[0].type, "state")] = [_json_state(child) for child in state.children]
    return result


def _number_or_text(text: str) -> float | str:
    """The number a text is; the text where it is none."""
    try:
        return int(text) if text.lstrip("-").isdecimal() else float(text)
    except ValueError:
        return text


def _json_links(links: tuple[Link, ...]) -> dict[str, dict[str, str]]:
    return {link.rel: {"href": f"{link.href}{'&' if '?' in link.href else '?'}json=1"} for link in links}


# HAL


_HAL_SUCCESS = 294912
_HAL_TYPES = {"sys-option": "sys-options"}  # where it differs from the XHTML


def _hal_state(state: State) -> dict[str, object]:
    result: dict[str, object] = {"_links": _hal_links(state.links)} if state.links else {}
    result |= {"_type": _HAL_TYPES.get(state.type, state.type), "_title": state.title, **state.fields}
    if state.arguments:
        result["argv"] = [{"type": argument.type, "value": argument.value} for argument in state.arguments]
    if state.children:
        result[_LIST_NAMES.get(state.children[0].type, "state")] = [_hal_state(child) for child in state.children]
    return result


def _hal_links(links: tuple[Link, ...]) -> dict[str, dict[str, str]]:
    return {link.rel: {"href": link.href} for link in links}
