"""Names and values in queries and form bodies, written strictly and read as tolerantly as a controller does.

Source: reference/rws.md §1. ABB's own C++ client sends values unescaped, Python clients percent-encode them;
both must arrive as the same text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from urllib.parse import quote, unquote

Pairs = tuple[tuple[str, str], ...]

CONTENT_TYPE = "application/x-www-form-urlencoded"

# A raw "+" is a blank in a form, except in the exponent of a number printed by a client that escapes nothing.
_BLANK_PLUS = re.compile(r"(?<![0-9.][eE])\+|\+(?![0-9])")


def encode(pairs: Iterable[tuple[str, str]]) -> str:
    """``name=value&…``, everything but letters, digits and ``-._~`` percent-encoded as UTF-8."""
    return "&".join(f"{quote(name, safe='')}={quote(value, safe='')}" for name, value in pairs)


def decode(text: str) -> Pairs:
    """The pairs of a query or form body, in order.

    The text is split only at ``&``: a ``;`` belongs to the values of subscriptions. A name without ``=`` has
    the value "".
    """
    return tuple(_pair(part) for part in text.split("&") if part)


def first(pairs: Pairs, name: str) -> str | None:
    """The first value of ``name``, or None."""
    return next((value for key, value in pairs if key == name), None)


def _pair(part: str) -> tuple[str, str]:
    name, _, value = part.partition("=")
    return _text(name), _text(value)


def _text(raw: str) -> str:
    return unquote(_BLANK_PLUS.sub(" ", raw))
