"""HTTP digest authentication (RFC 2617, MD5, qop=auth) as Robot Web Services uses it, for both ends.

Source: reference/rws.md §2.1.

Cookies as the controller sets them; their names begin with ``-``, which many libraries refuse.

The client's login: answers a digest challenge once, then lives on the cookies of its session.

Like ABB's own client it never sends credentials unasked (reference/rws.md §2.2).
"""

from __future__ import annotations

import re
import secrets
from base64 import b64decode, b64encode
from binascii import Error as Base64Error
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from hashlib import md5
from hmac import compare_digest
from urllib.parse import unquote

from yumi.errors import ProtocolError

REALM = "validusers@robapi.abb"
OPAQUE = "799d5"
NONCE_LIFE = 300.0  # [s]; Appweb calls a nonce stale after five minutes

_PARAMETER = re.compile(r'([A-Za-z][\w-]*)\s*=\s*(?:"((?:[^"\\]|\\.)*)"|([^\s,"]+))')


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
    """What a client answers in ``Authorization``; ``nc`` stays text, the controller does not count it."""

    user: str
    realm: str
    nonce: str
    uri: str
    response: str
    opaque: str
    nc: str
    cnonce: str

    def header(self) -> str:
        """The header's value."""
        return (
            f'Digest username="{_escaped(self.user)}", realm="{self.realm}", nonce="{self.nonce}", '
            f'uri="{self.uri}", response="{self.response}", opaque="{self.opaque}", algorithm="MD5", '
            f'qop="auth", nc={self.nc}, cnonce="{self.cnonce}"'
        )


def read_challenge(header: str) -> Challenge:
    """The digest challenge in a ``WWW-Authenticate`` value.

    Raises:
        ProtocolError: the server asks for another kind of login.
    """
    fields = _parameters(header, "realm", "nonce")
    if "auth" not in fields.get("qop", "auth").replace(" ", "").split(","):
        raise ProtocolError(f"The server asks for digest protection {fields['qop']!r}; only 'auth' is known.")
    is_stale = fields.get("stale", "").upper() == "TRUE"
    return Challenge(fields["nonce"], fields["realm"], fields.get("opaque", ""), is_stale)


def answer(
    challenge: Challenge, *, user: str, password: str, method: str, uri: str, cnonce: str, count: int = 1
) -> Credentials:
    """The client's answer for one request; ``uri`` is path and query, exactly as on the request line."""
    nc = f"{count:08x}"
    unsigned = Credentials(user, challenge.realm, challenge.nonce, uri, "", challenge.opaque, nc, cnonce)
    return replace(unsigned, response=_response(unsigned, password, method))


def read_credentials(header: str) -> Credentials:
    """The digest credentials in an ``Authorization`` value.

    Raises:
        ProtocolError: it is not digest, or a field is missing.
    """
    fields = _parameters(header, "username", "realm", "nonce", "uri", "response", "nc", "cnonce")
    return Credentials(
        user=fields["username"],
        realm=fields["realm"],
        nonce=fields["nonce"],
        uri=fields["uri"],
        response=fields["response"],
        opaque=fields.get("opaque", ""),
        nc=fields["nc"],
        cnonce=fields["cnonce"],
    )


def is_genuine(credentials: Credentials, *, user: str, password: str, method: str, target: str) -> bool:
    """Whether the credentials prove knowledge of the password for this request.

    Clients differ in how they escape the uri, so it is compared unescaped; the response is over the one they
    sent.
    """
    if credentials.realm != REALM or unquote(credentials.uri) != unquote(target):
        return False
    expected = _response(replace(credentials, user=user), password, method)
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


def _parameters(header: str, *required: str) -> Mapping[str, str]:
    scheme, _, rest = header.partition(" ")
    if scheme.lower() != "digest":
        raise ProtocolError(f"Robot Web Services logs in with HTTP digest, not with {scheme!r}.")
    fields = {key.lower(): _unescaped(quoted) or bare for key, quoted, bare in _PARAMETER.findall(rest)}
    missing = [name for name in required if name not in fields]
    if missing:
        raise ProtocolError(f"The digest header lacks {', '.join(missing)}.")
    return fields


def _response(credentials: Credentials, password: str, method: str) -> str:
    secret = _md5(f"{credentials.user}:{credentials.realm}:{password}")
    count = f"{credentials.nonce}:{credentials.nc}:{credentials.cnonce}:auth"
    return _md5(f"{secret}:{count}:" + _md5(f"{method}:{credentials.uri}"))


def _md5(text: str) -> str:
    return md5(_bytes(text), usedforsecurity=False).hexdigest()


def _bytes(text: str) -> bytes:
    """As they came: a header may hold bytes that are no text, which Python keeps as lone surrogates."""
    return text.encode(errors="surrogateescape")


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')


def _unescaped(text: str) -> str:
    return re.sub(r"\\(.)", r"\1", text)


SESSION = "-http-session-"
CONNECTION = "ABBCX"

_VALUE = re.compile("[!-:<-~]{1,256}")  # visible ASCII without a semicolon, which would end it


def set_cookie(name: str, value: str) -> str:
    """A ``Set-Cookie`` value; always the same path, or clients see two cookies of one name."""
    return f"{name}={value}; path=/; httponly"


def read_set_cookie(line: str) -> tuple[str, str]:
    """Name and value of a ``Set-Cookie`` value."""
    name, _, value = line.partition(";")[0].partition("=")
    return name.strip(), value.strip()


def is_own(name: str, value: str) -> bool:
    """Whether a controller sets such a cookie; the longest that was seen has 55 characters."""
    return name in (SESSION, CONNECTION) and _VALUE.fullmatch(value) is not None


def cookie_header(cookies: Mapping[str, str]) -> str:
    """A ``Cookie`` value."""
    return "; ".join(f"{name}={value}" for name, value in cookies.items())


def read_cookies(headers: Iterable[str]) -> dict[str, str]:
    """The cookies of a request, from all its ``Cookie`` values."""
    pairs = (part.partition("=") for header in headers for part in header.split(";"))
    return {name.strip(): value.strip() for name, _, value in pairs if name.strip()}


Headers = tuple[tuple[str, str], ...]


class Login:
    """User, password and what the controller has handed out for them; one per client."""

    def __init__(self, user: str, password: str, make_cnonce: Callable[[], str] = lambda: secrets.token_hex(8)) -> None:
        self._user = user
        self._password = password
        self._make_cnonce = make_cnonce
        self._cookies: dict[str, str] = {}

    @property
    def has_session(self) -> bool:
        """Whether the controller has given us a session, as far as we know."""
        return SESSION in self._cookies

    def headers(self) -> Headers:
        """What every request carries: the cookies of the session, if there is one."""
        return (("Cookie", cookie_header(self._cookies)),) if self._cookies else ()

    def accept(self, headers: Iterable[tuple[str, str]]) -> None:
        """Keep a controller's own cookies of an answer; the connection cookie changes with each TCP connection.

        All others are dropped: they would make the next requests longer than the controller reads.
        """
        lines = (value for name, value in headers if name.lower() == "set-cookie")
        own = {name: value for name, value in map(read_set_cookie, lines) if is_own(name, value)}
        self._cookies = {**self._cookies, **own}  # replaced as a whole: another thread may be reading it

    def answer(self, challenge: Challenge, method: str, target: str) -> Headers:
        """The headers that prove who we are for one request; the old session is gone and forgotten."""
        self.forget()
        credentials = answer(
            challenge,
            user=self._user,
            password=self._password,
            method=method,
            uri=target,
            cnonce=self._make_cnonce(),
        )
        return (("Authorization", credentials.header()),)

    def forget(self) -> None:
        """Drop the session's cookies."""
        self._cookies = {}
