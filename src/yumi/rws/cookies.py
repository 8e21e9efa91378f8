"""Cookies as the controller sets them; their names begin with ``-``, which many libraries refuse."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

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
