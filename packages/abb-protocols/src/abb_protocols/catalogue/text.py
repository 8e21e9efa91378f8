"""One text of the catalogue."""

from __future__ import annotations

from typing import NamedTuple


class Text(NamedTuple):
    """What a message says, with its values in braces: lower case and without a full stop, as part of a sentence.

    Attributes:
        what: what happened or is so, why, and what is allowed.
        remedy: what to do; empty where nothing is to be done or ``what`` says all.
    """

    what: str
    remedy: str = ""
