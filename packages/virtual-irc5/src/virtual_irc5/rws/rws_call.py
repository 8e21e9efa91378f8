"""A call of Robot Web Services: what a request asks of the controller, and what may come of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import isfinite, nan
from typing import Any

from abb_protocols.errors import YumiError
from abb_protocols.rws.documents import Page, Pairs, Status, first_value
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.values import RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller_log import RefusalReason, Refused
from virtual_irc5.rws.http import HttpReply

_MOST_DIGITS = 12


class CallFailure(YumiError):
    """The answer is an error.

    Attributes:
        status: of HTTP.
        code: ABB's.
    """

    def __init__(self, status: int, code: RwsCode, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status
        self.code = code

    def document(self, service: str) -> Status:
        """The error document, its message in the controller's shape (reference/rws.md §3.4)."""
        sentence = str(self).rstrip(".")
        if service == "fileservice":
            return Status(int(self.code), f"{sentence} {int(self.code)} -1")
        message = f"rws_resource_{service}.cpp[1] {sentence} code:{int(self.code)} icode:-1"
        return Status(int(self.code), message)


def bad_call(sentence: str) -> CallFailure:
    """The failure for a parameter that makes no sense."""
    return CallFailure(400, RwsCode.INVALIDARG, sentence)


_REFUSALS: Mapping[RefusalReason, tuple[int, RwsCode]] = {
    RefusalReason.WRONG_MODE: (403, RwsCode.MODE_REJECT),
    RefusalReason.MOTORS_OFF: (400, RwsCode.EXEC_STATE),
    RefusalReason.NOT_STOPPED: (400, RwsCode.EXEC_STATE),
    RefusalReason.ALREADY_RUNNING: (400, RwsCode.EXEC_STATE),
    RefusalReason.NO_PROGRAM_POINTER: (400, RwsCode.EXEC_STATE),
    RefusalReason.READ_ONLY: (403, RwsCode.REJECT),
    RefusalReason.UNKNOWN: (404, RwsCode.UNRESOLVED_URL),
    RefusalReason.OUT_OF_RANGE: (400, RwsCode.INVALIDARG),
    RefusalReason.EMERGENCY_STOP: (403, RwsCode.INVALID_STATE),
    RefusalReason.BAD_VALUE: (400, RwsCode.INVALIDARG),
    RefusalReason.NO_FILE: (400, RwsCode.FILE_NOT_FOUND),
    RefusalReason.NO_MODULE: (400, RwsCode.NO_SUCH_SYMBOL),
    RefusalReason.NAME_TAKEN: (400, RwsCode.MODULE_NAME_TAKEN),
    RefusalReason.BAD_PROGRAM: (400, RwsCode.SYNTAX),
    RefusalReason.NO_SPACE: (507, RwsCode.MAX_LIMIT_REACHED),
}


def call_refusal(refused: Refused) -> CallFailure:
    """The answer to a request that the controller refuses."""
    status, code = _REFUSALS[refused.reason]
    return CallFailure(status, code, str(refused))


@dataclass(frozen=True, slots=True)
class RwsCall:
    """A request whose path is understood.

    Attributes:
        method: of HTTP.
        path: the segments, unescaped, without a sub-property behind ``;``.
        query: parameters in the URL.
        form: parameters in the body.
        names: values of the placeholders in the operation's path.
        content: the body as it came.
        session: whose request it is.
        host: host and port as the client calls them.
        privilege: what the client may change in manual mode (RMMP): ``none``, ``modify`` or ``exec``.
    """

    method: str
    path: tuple[str, ...]
    query: Pairs = ()
    form: Pairs = ()
    names: Mapping[str, str] = field(default_factory=dict)
    content: bytes = b""
    session: str = ""
    host: str = ""
    privilege: str = "none"

    def option(self, name: str) -> str | None:
        """A parameter in the URL, or None."""
        return first_value(self.query, name) if self.query else None

    def number_option(self, name: str, default: int) -> int:
        """A parameter in the URL that is a whole number from 0.

        Raises:
            CallFailure: it is not a number.
        """
        text = self.option(name)
        if text is None:
            return default
        if not text.isdecimal() or len(text) > _MOST_DIGITS:
            raise bad_call(f"{name} is a whole number of up to {_MOST_DIGITS} digits, not {text[:50]!r}")
        return int(text)

    def parameter(self, name: str, default: str) -> str:
        """A parameter in the body; ``default`` where it is missing or empty."""
        return first_value(self.form, name) or default

    def required(self, name: str) -> str:
        """A parameter in the body.

        Raises:
            CallFailure: it is missing.
        """
        value = first_value(self.form, name)
        if value is None:
            raise bad_call(f"the body lacks {name}")
        return value

    def number(self, name: str) -> float:
        """A parameter in the body that is a finite number.

        Raises:
            CallFailure: it is missing or none.
        """
        text = self.required(name)
        try:
            value = float(text)
        except ValueError:
            value = nan
        if not isfinite(value):
            raise bad_call(f"{name} is a finite number, not {text!r}")
        return value

    def check(self, operation: Operation[Any]) -> None:
        """Refuse a parameter that is none of those an operation takes.

        Raises:
            CallFailure: 400.
        """
        for pairs, values in ((self.form, operation.values), (self.query, operation.query)):
            for name, text in pairs:
                if values.get(name) and text not in values[name]:
                    raise bad_call(f"{name} is {' or '.join(values[name])}, not {text[:50]!r}")


Shown = Page | HttpReply | None
"""A page, a reply that is not a page, or None for "done, nothing to show"."""

Handler = Callable[[Irc5, RwsCall], object]
"""Answers a call with a value of its operation, with values by their titles, or with what is shown.

It raises CallFailure or Refused.
"""

Preparation = Callable[[Irc5, RwsCall], Callable[[], object] | None]
"""Work that may be done while the robot goes on, and that the handler then finds done; None where nothing takes long.

It reads the controller, raises CallFailure, and changes nothing; the work touches nothing that the robot changes.
"""
