"""The operations of Robot Web Services as one table: method, path, action, handler, and what is checked before it.

Each service (``panel``, ``rapid``, …) is a module with its handlers and its part of the table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import isfinite, nan
from typing import NamedTuple, cast

from aiohttp import web
from yarl import URL

from yumi.errors import YumiError
from yumi.rws.documents import Link, Page, Pairs, State, Status, first_value
from yumi.rws.types import Code, Grant
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.controller.events import Refusal, Refused
from yumi.virtual.rws.http import HttpReply

_MOST_DIGITS = 12
_MOST_PATHS = 1024  # whose operations are remembered: finding one takes longer than most answers
LONGEST_KEPT = 256  # characters of a target or path that is remembered; none that clients use is longer


class Failure(YumiError):
    """The answer is an error.

    Attributes:
        status: of HTTP.
        code: ABB's.
    """

    def __init__(self, status: int, code: Code, sentence: str) -> None:
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


def invalid(sentence: str) -> Failure:
    """The failure for a parameter that makes no sense."""
    return Failure(400, Code.INVALIDARG, sentence)


_REFUSALS: Mapping[Refusal, tuple[int, Code]] = {
    Refusal.WRONG_MODE: (403, Code.MODE_REJECT),
    Refusal.MOTORS_OFF: (400, Code.EXEC_STATE),
    Refusal.NOT_STOPPED: (400, Code.EXEC_STATE),
    Refusal.ALREADY_RUNNING: (400, Code.EXEC_STATE),
    Refusal.NO_PROGRAM_POINTER: (400, Code.EXEC_STATE),
    Refusal.READ_ONLY: (403, Code.REJECT),
    Refusal.UNKNOWN: (404, Code.UNRESOLVED_URL),
    Refusal.OUT_OF_RANGE: (400, Code.INVALIDARG),
    Refusal.EMERGENCY_STOP: (403, Code.INVALID_STATE),
    Refusal.BAD_VALUE: (400, Code.INVALIDARG),
    Refusal.NO_FILE: (400, Code.FILE_NOT_FOUND),
    Refusal.NO_MODULE: (400, Code.NO_SUCH_SYMBOL),
    Refusal.NAME_TAKEN: (400, Code.MODULE_NAME_TAKEN),
    Refusal.BAD_PROGRAM: (400, Code.SYNTAX),
    Refusal.NO_SPACE: (507, Code.MAX_LIMIT_REACHED),
}


def refusal(refused: Refused) -> Failure:
    """The answer to a request that the controller refuses."""
    status, code = _REFUSALS[refused.reason]
    return Failure(status, code, str(refused))


@dataclass(frozen=True, slots=True)
class Call:
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
            Failure: it is not a number.
        """
        text = self.option(name)
        if text is None:
            return default
        if not text.isdecimal() or len(text) > _MOST_DIGITS:
            raise invalid(f"{name} is a whole number of up to {_MOST_DIGITS} digits, not {text[:50]!r}")
        return int(text)

    def parameter(self, name: str, default: str) -> str:
        """A parameter in the body; ``default`` where it is missing or empty."""
        return first_value(self.form, name) or default

    def required(self, name: str) -> str:
        """A parameter in the body.

        Raises:
            Failure: it is missing.
        """
        value = first_value(self.form, name)
        if value is None:
            raise invalid(f"the body lacks {name}")
        return value

    def number(self, name: str) -> float:
        """A parameter in the body that is a finite number.

        Raises:
            Failure: it is missing or none.
        """
        text = self.required(name)
        try:
            value = float(text)
        except ValueError:
            value = nan
        if not isfinite(value):
            raise invalid(f"{name} is a finite number, not {text!r}")
        return value


Answer = Page | HttpReply | None
"""A page, a reply that is not a page, or None for "done, nothing to show"."""

Handler = Callable[[Irc5, Call], Answer]
"""Answers a call; raises Failure or Refused."""


Preparation = Callable[[Irc5, Call], Callable[[], object] | None]
"""Work that may be done while the robot goes on, and that the handler then finds done; None where nothing takes long.

It reads the controller, raises Failure, and changes nothing; the work touches nothing that the robot changes.
"""


Values = Mapping[str, tuple[str, ...]]
"""Parameters by name, each with the texts it may be; none where any text may come."""

_SUCCESS: Mapping[str, int] = {"GET": 200, "PUT": 200, "OPTIONS": 200, "HEAD": 204, "POST": 204, "DELETE": 204}


@dataclass(frozen=True, slots=True)
class Operation:
    """One line of the table.

    Attributes:
        method: of HTTP.
        path: ``{name}`` stands for one segment, ``{name:.+}`` for all that follow.
        handler: answers the call.
        action: the ``action`` in the URL; None for a call without one.
        values: the parameters in the body, and what each may be.
        needs_mastership: the domain whose mastership the client must hold, or "".
        respects_mastership: the domain that no other client may hold, or "".
        resource: the ``resource`` in the URL; an operation whose ``query`` has it answers all without their own line.
        query: the parameters in the URL beside these two, and what each may be.
        status: of HTTP where the call succeeds; 0 for the usual one of the method.
        needs_grant: what the user must be granted; None for what everybody may do.
        lacks: hardware or option that this robot does not have; such a call is answered with 404.
        prepare: the part of a call that takes longer than a cycle.
    """

    method: str
    path: str
    handler: Handler
    action: str | None = None
    values: Values = field(default_factory=dict)
    needs_mastership: str = ""
    respects_mastership: str = ""
    resource: str | None = None
    query: Values = field(default_factory=dict)
    status: int = 0
    lacks: str = ""
    needs_grant: Grant | None = None
    prepare: Preparation | None = None

    @property
    def success(self) -> int:
        """Status of HTTP where the call succeeds."""
        return 404 if self.lacks else self.status or _SUCCESS[self.method]

    @property
    def service(self) -> str:
        """The service it belongs to, such as ``rapid`` or ``fileservice``."""
        parts = [part for part in self.path.split("/") if part]
        return "root" if not parts else parts[1] if parts[0] == "rw" and len(parts) > 1 else parts[0]

    def check_values(self, call: Call) -> None:
        """Refuse a call with a parameter that is none of its values.

        Raises:
            Failure: 400.
        """
        for pairs, values in ((call.form, self.values), (call.query, self.query)):
            for name, text in pairs:
                if values.get(name) and text not in values[name]:
                    raise invalid(f"{name} is {' or '.join(values[name])}, not {text[:50]!r}")


def not_there(controller: Irc5, call: Call) -> None:
    """The answer of a controller without the hardware or option: it has no such resource."""
    raise Failure(404, Code.FAIL, f"there is no resource /{'/'.join(call.path)}")


class _Target(NamedTuple):
    """The two properties of a request that aiohttp's router reads."""

    method: str
    rel_url: URL


async def _no_handler(request: web.Request) -> web.StreamResponse:
    """Aiohttp's routes need a coroutine; ours answer without an event loop, in virtual time too."""
    raise NotImplementedError


class Router:
    """Finds the operation of a call with aiohttp's router."""

    def __init__(self, operations: Iterable[Operation]) -> None:
        self._dispatcher = web.UrlDispatcher()
        self._operations: dict[tuple[str, str], list[Operation]] = {}
        for operation in operations:
            resource = self._dispatcher.add_resource(operation.path)
            alternatives = self._operations.setdefault((operation.method, resource.canonical), [])
            if not alternatives:
                resource.add_route(operation.method, _no_handler)
            alternatives.append(operation)
        self._resolve_kept = lru_cache(_MOST_PATHS)(self._resolve_once)

    def find(self, call: Call) -> tuple[Operation, Call]:
        """The operation, and the call with the values of its placeholders.

        Raises:
            Failure: 404 for an unknown path, 405 for a method, 400 for an action it does not have.
        """
        path = "/" + "/".join(call.path)
        status, alternatives, names = self._resolve(call.method, path)
        if status == web.HTTPNotFound.status_code:
            raise Failure(404, Code.FAIL, f"there is no resource {path}")
        if status:
            raise Failure(405, Code.NOTIMPL, f"{call.method} is not possible on {path}")
        action, wanted = call.option("action"), call.option("resource") or None  # an empty one is none
        fitting = [each for each in alternatives if each.action == action]
        if call.method != "POST":  # an action of POST changes something; elsewhere an unknown one is ignored
            fitting = fitting or [each for each in alternatives if each.action is None]
        if not fitting:
            raise invalid(f"{path} {'needs an action' if action is None else f'does not have the action {action!r}'}")
        for operation in sorted(fitting, key=lambda each: each.resource != wanted):
            if operation.resource == wanted or (operation.resource is None and "resource" in operation.query):
                return operation, replace(call, names=names)
        raise invalid(f"{path} does not have the resource {wanted!r}")

    def actions(self, call: Call) -> Sequence[Operation]:
        """What can be done with the path of a call beside reading it."""
        path = "/" + "/".join(call.path)
        found: list[Operation] = []
        for method in ("POST", "PUT", "DELETE"):
            found += self._resolve(method, path)[1]
        return found

    def _resolve(self, method: str, path: str) -> tuple[int, Sequence[Operation], Mapping[str, str]]:
        return (self._resolve_kept if len(path) <= LONGEST_KEPT else self._resolve_once)(method, path)

    def _resolve_once(self, method: str, path: str) -> tuple[int, Sequence[Operation], Mapping[str, str]]:
        """Status of an error or 0, the operations of a method and path, and the values of the placeholders."""
        target = _Target(method, URL.build(path=path))
        try:
            # The router's coroutine waits for nothing, so that its first step is its last.
            self._dispatcher.resolve(cast("web.Request", target)).send(None)
        except StopIteration as result:
            match: web.UrlMappingMatchInfo = result.value
        if match.http_exception is not None:
            return match.http_exception.status, (), {}
        resource = match.route.resource
        assert resource is not None, "all routes are added to resources"
        return 0, self._operations[method, resource.canonical], dict(match)


def resource(title: str, base: str, href: str, *states: State, next_href: str | None = None) -> Page:
    """A page with the links every resource has; ``base`` is a path, the service puts the host before it."""
    links = (Link("self", href), Link("action", f"{href}{'&' if '?' in href else '?'}action=show"))
    more = () if next_href is None else (Link("next", next_href),)
    return Page(title, base, states, links + more)


def entry(type: str, title: str, href: str | None = None, /, **fields: str) -> State:
    """An entry of a list that leads to ``href``, by default its title; ``_`` in field names stands for ``-``."""
    named = {name.replace("_", "-"): text for name, text in fields.items()}
    return State(type, title, named, (Link("self", title if href is None else href),))
