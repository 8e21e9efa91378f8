"""A controller's login: HTTP digest (RFC 2617, MD5, qop=auth) and its cookies (reference/rws.md §2.1-2.2).

This is the server's side; the client's digest is httpx's.
"""

from __future__ import annotations

import re
from base64 import b64decode, b64encode
from binascii import Error as Base64Error
from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import md5
from hmac import compare_digest
from urllib.parse import unquote

from yumi.errors import ProtocolError

REALM = "validusers@robapi.abb"
OPAQUE = "799d5"
SESSION = "-http-session-"
CONNECTION = "ABBCX"
NONCE_LIFE = 300.0  # [s]; Appweb calls a nonce stale after five minutes

_REQUIRED = ("username", "realm", "nonce", "uri", "response", "nc", "cnonce")
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
    found = {key.lower(): re.sub(r"\\(.)", r"\1", quoted) or bare for key, quoted, bare in _PARAMETER.findall(rest)}
    missing = [name for name in _REQUIRED if name not in found]
    if missing:
        raise ProtocolError(f"The digest header lacks {', '.join(missing)}.")
    return Credentials(*(found[name] for name in _REQUIRED))


def is_genuine(credentials: Credentials, *, user: str, password: str, method: str, target: str) -> bool:
    """Whether the credentials prove knowledge of the password for this request.

    Clients differ in how they escape the uri, so it is compared unescaped; the response is over the one they
    sent.
    """
    if credentials.realm != REALM or unquote(credentials.uri) != unquote(target):
        return False
    secret = _md5(f"{user}:{credentials.realm}:{password}")
    count = f"{credentials.nonce}:{credentials.nc}:{credentials.cnonce}:auth"
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


def set_cookie(name: str, value: str) -> str:
    """A ``Set-Cookie`` value; always the same path, or clients see two cookies of one name."""
    return f"{name}={value}; path=/; httponly"


def read_cookies(headers: Iterable[str]) -> dict[str, str]:
    """The cookies of a request, from all its ``Cookie`` values."""
    pairs = (part.partition("=") for header in headers for part in header.split(";"))
    return {name.strip(): value.strip() for name, _, value in pairs if name.strip()}
