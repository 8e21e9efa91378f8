"""One operation of Robot Web Services: get, post, put or delete; and the notation of the tables in this package.

The tables are read by both ends: the client's calls, below each table, fill in a line and send it; the virtual
controller finds the line of a request and checks the request against it. Parameters are written
``name, name=value|value``: any text, or one of these.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Generic, TypeVar, cast

from abb_protocols.rws.operations.operation_answer import OperationAnswer
from abb_protocols.rws.request import RwsRequest
from abb_protocols.rws.values import Grant

_T = TypeVar("_T")
_A = TypeVar("_A")

Values = Mapping[str, tuple[str, ...]]
"""Parameters by name, each with the texts it may be; none where any text may come."""

TRUTH_VALUES = "true|false|TRUE|FALSE"
UPPER_TRUTH_VALUES = "TRUE|FALSE|true|false"
"""A truth value that clients write in capitals."""

_SUCCESS: Mapping[str, int] = {"GET": 200, "PUT": 200, "OPTIONS": 200, "HEAD": 204, "POST": 204, "DELETE": 204}
_PLACE = re.compile(r"\{(\w+)(?::[^{}]*)?\}")


@dataclass(frozen=True, slots=True)
class Operation(Generic[_T]):
    """One line of the table.

    Attributes:
        method: of HTTP.
        path: ``{name}`` stands for one segment, ``{name:.+}`` for one or more.
        action: the ``action`` in the URL; None for a call without one.
        values: the parameters in the body, and what each may be.
        needs_mastership: the domain whose mastership the client must hold, or "".
        respects_mastership: the domain that no other client may hold, or "".
        resource: the ``resource`` in the URL; an operation whose ``query`` has it answers all without their own line.
        query: the parameters in the URL beside these two, and what each may be.
        status: of HTTP where the call succeeds; 0 for the usual one of the method.
        lacks: hardware or option that this robot does not have; such a call is answered with 404.
        needs_grant: what the user must be granted; None for what everybody may do.
        answer: how its values are spelled; None where it shows nothing, or a page of its own.
    """

    method: str
    path: str
    action: str | None = None
    values: Values = field(default_factory=dict)
    needs_mastership: str = ""
    respects_mastership: str = ""
    resource: str | None = None
    query: Values = field(default_factory=dict)
    status: int = 0
    lacks: str = ""
    needs_grant: Grant | None = None
    answer: OperationAnswer[Any] | None = None

    def shows(self, answer: OperationAnswer[_A]) -> Operation[_A]:
        """The operation, answered like this."""
        return cast("Operation[_A]", replace(self, answer=answer))

    @property
    def answered(self) -> OperationAnswer[_T]:
        """How its values are spelled; only for one that shows any."""
        assert self.answer is not None
        return self.answer

    @property
    def success(self) -> int:
        """Status of HTTP where the call succeeds."""
        return 404 if self.lacks else self.status or _SUCCESS[self.method]

    @property
    def service(self) -> str:
        """The service it belongs to, such as ``rapid`` or ``fileservice``."""
        parts = [part for part in self.path.split("/") if part]
        return "root" if not parts else parts[1] if parts[0] == "rw" and len(parts) > 1 else parts[0]

    def path_of(self, *places: str) -> str:
        """The path with these texts in the places of its braces, in order."""
        texts = iter(places)
        return _PLACE.sub(lambda _: next(texts), self.path)

    def request(self, /, *places: str, **arguments: object) -> RwsRequest:
        """The request for the operation.

        Args:
            places: texts for the placeholders in its path, in order.
            arguments: of URL and body by name, with ``_`` for ``-``; one that is None is left out.

        Raises:
            KeyError: the operation has no such parameter.
        """
        names = {name.replace("-", "_"): name for name in (*self.query, *self.values)}
        given = [(names[name], _text(value)) for name, value in arguments.items() if value is not None]
        marks = (("action", self.action), ("resource", self.resource))
        query = [(name, text) for name, text in marks if text is not None]
        query += [pair for pair in given if pair[0] in self.query]
        form = tuple(pair for pair in given if pair[0] not in self.query)
        has_form = self.method in ("POST", "PUT")
        return RwsRequest(self.method, self.path_of(*places), tuple(query), form if has_form else None)


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value.value if isinstance(value, Enum) else value)


def _parameters(text: str) -> Values:
    """The parameters that a line of a table writes as ``name, name=value|value``."""
    parts = (part.strip().partition("=") for part in text.split(",") if part.strip())
    return {name: tuple(allowed.split("|")) if allowed else () for name, _, allowed in parts}


def get(
    path: str,
    query: str = "",
    *,
    resource: str | None = None,
    action: str | None = None,
    status: int = 0,
    grant: Grant | None = None,
) -> Operation[Any]:
    """An operation that reads."""
    url = _parameters(query)
    return Operation("GET", path, action, resource=resource, query=url, status=status, needs_grant=grant)


def post(
    path: str,
    action: str | None = None,
    values: str = "",
    *,
    query: str = "",
    method: str = "POST",
    status: int = 0,
    needs: str = "",
    respects: str = "",
    grant: Grant | None = None,
) -> Operation[Any]:
    """An operation that changes something; ``needs`` and ``respects`` are masterships."""
    body, url = _parameters(values), _parameters(query)
    return Operation(method, path, action, body, needs, respects, query=url, status=status, needs_grant=grant)


def put(path: str, values: str = "", *, status: int = 0, grant: Grant | None = None) -> Operation[Any]:
    """An operation that writes a whole resource."""
    return post(path, None, values, method="PUT", status=status, grant=grant)


def delete(path: str, *, status: int = 0, needs: str = "", grant: Grant | None = None) -> Operation[Any]:
    """An operation that removes a resource."""
    return post(path, method="DELETE", status=status, needs=needs, grant=grant)


def absent_operations(what: str, targets: str) -> tuple[Operation[Any], ...]:
    """Operations, each as ``METHOD /path?action=…``, that need what this robot does not have; ``|`` is between them."""
    found: list[Operation[Any]] = []
    for target in targets.split("|"):
        method, _, rest = target.strip().partition(" ")
        path, _, query = rest.partition("?")
        marks = _parameters(query)
        action, resource = (next(iter(marks.get(name, ())), None) for name in ("action", "resource"))
        free = {name: allowed for name, allowed in marks.items() if not allowed}
        found.append(Operation(method, path, action, resource=resource, query=free, lacks=what))
    return tuple(found)
