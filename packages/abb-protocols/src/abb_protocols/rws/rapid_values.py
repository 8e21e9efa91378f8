"""RAPID values as Robot Web Services spell them: literals without blanks; encoded, decoded, split.

(reference/rws.md §6.5)

========== ==================== ==========================
RAPID      Python               text
========== ==================== ==========================
num, dnum  float                ``0.5``  ``-1E-05``  ``9E+09``
bool       bool                 ``TRUE``  ``FALSE``
string     str                  ``"say ""hi"" to it"``
record     tuple of values      ``[TRUE,1,[0,0,0]]``
array      tuple of values      ``[1,2,3]``
========== ==================== ==========================
"""

from __future__ import annotations

import re
from math import isfinite

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, ProtocolError

RapidValue = float | bool | str | tuple["RapidValue", ...]

_MAX_DEPTH = 64  # RAPID nests far less; a hostile text must not exhaust the stack
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_STRING = re.compile(r'"((?:[^"]|"")*)"')
_ESCAPE = re.compile(r'"(")|\\(\\)|\\([0-9A-Fa-f]{2})')


def encode(value: RapidValue) -> str:
    """The literal of ``value``.

    Raises:
        CommandRefused: a number is not finite; RAPID has no such value.
    """
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, (int, float)):
        return _encode_number(float(value))
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '""') + '"'
    return f"[{','.join(map(encode, value))}]"


def decode(text: str) -> RapidValue:
    """The value of a literal; blanks around its parts are allowed.

    Raises:
        ProtocolError: it is not a literal.
    """
    return _decode(text, 0)


def split(text: str) -> tuple[str, ...]:
    """The parts of a record or array: split at the commas of depth 0 that are not in a string.

    Raises:
        ProtocolError: the brackets or quotes do not close.
    """
    inner = text.strip()
    if not (inner.startswith("[") and inner.endswith("]")):
        raise ProtocolError(message("rapid_value_without_brackets", text=text))
    parts, depth, start, in_string = [], 0, 1, False
    for index, character in enumerate(inner[:-1]):
        if character == '"':
            in_string = not in_string
        elif not in_string:
            depth += (character == "[") - (character == "]")
            if character == "," and depth == 1:
                parts.append(inner[start:index].strip())
                start = index + 1
    if depth != 1 or in_string:
        raise ProtocolError(message("rapid_value_not_closed", text=text))
    last = inner[start:-1].strip()
    return (*parts, last) if parts or last else ()


def _encode_number(value: float) -> str:
    """The number as the controller prints it: 9000000000 is 9E+09."""
    if not isfinite(value):
        raise CommandRefused(message("rapid_number_not_finite", value=str(value)))
    mantissa, _, exponent = repr(value).upper().partition("E")
    digits = mantissa.removesuffix(".0")
    if exponent:
        return f"{digits}E{exponent}"
    significant = digits.lstrip("-").rstrip("0")
    places = len(digits.lstrip("-")) - 1
    if "." in digits or places < 7 or len(significant) != 1:
        return digits
    return f"{'-' if digits.startswith('-') else ''}{significant}E+{places:02d}"


def _decode(text: str, depth: int) -> RapidValue:
    if depth > _MAX_DEPTH:
        raise ProtocolError(message("rapid_value_nested_too_deeply"))
    word = text.strip()
    if word.startswith("["):
        return tuple(_decode(part, depth + 1) for part in split(word))
    if match := _STRING.fullmatch(word):
        # A doubled quote or backslash, or the character of a two-digit code.
        return _ESCAPE.sub(lambda escape: escape[1] or escape[2] or chr(int(escape[3], 16)), match[1])
    if word.upper() in ("TRUE", "FALSE"):
        return word.upper() == "TRUE"
    if NUMBER.fullmatch(word):
        return float(word)
    raise ProtocolError(message("rapid_value_unreadable", text=text))
