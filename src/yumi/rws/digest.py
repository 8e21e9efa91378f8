"""HTTP digest authentication (RFC 2617, MD5, qop=auth) as Robot Web Services uses it, for both ends.

Source: reference/rws.md §2.1.
"""

from __future__ import annotations

import re
from base64 import b64decode, b64encode
from binascii import Error as Base64Error
from collections.abc import Mapping
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
