"""How a resource of the virtual controller is found: a table of method, path, action and handler.

Handlers live in one module per service (``rws_panel``, ``rws_rapid``, …), each with its part of the table.

The controller's refusals in the words of Robot Web Services: HTTP status, ABB's code, message (rws.md §3.4).

What the RWS adapter asks of a controller; :class:`yumi.virtual.controller.controller.Irc5` is one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from yumi.errors import YumiError
from yumi.rapid.host import Execution
from yumi.rapid.task import ModuleInfo
from yumi.rws import documents as forms
from yumi.rws.documents import Link, Page, Pairs, State, Status
from yumi.rws.http import HttpReply
from yumi.rws.types import Code, CollisionState, ControllerState, OperatingMode
from yumi.virtual.controller.configuration import Instance
from yumi.virtual.controller.errors import Refusal, Refused
from yumi.virtual.controller.events import EventLog
from yumi.virtual.controller.files import FileStore
from yumi.virtual.controller.signals import Signals
from yumi.virtual.controller.units import Identity, MechanicalUnit


class RapidTask(Protocol):
    """A RAPID task; modules and symbols are found in any letter case."""

    @property
    def name(self) -> str: ...

    @property
    def modules(self) -> Sequence[ModuleInfo]: ...

    @property
    def execution(self) -> Execution: ...

    def type_of(self, module: str, name: str) -> str:
        """Name of a symbol's type; raises UnknownSymbol."""

    def kind_of(self, module: str, name: str) -> str:
        """How a symbol is stored, ``con``, ``var`` or ``per``; raises UnknownSymbol."""

    def dimensions_of(self, module: str, name: str) -> tuple[int, ...]:
        """Sizes of an array, empty for a single value; raises UnknownSymbol."""

    def read(self, module: str, name: str) -> str:
        """A symbol's value as a RAPID literal; raises UnknownSymbol."""

    def write(self, module: str, name: str, literal: str) -> None:
        """Give a symbol a value; raises UnknownSymbol or RapidValueError."""


class Controller(Protocol):
    """A controller as seen over the network; what it will not do it refuses with a reason and a sentence."""

    @property
    def identity(self) -> Identity: ...

    @property
    def mode(self) -> OperatingMode: ...

    @property
    def controller_state(self) -> ControllerState: ...

    @property
    def collision_state(self) -> CollisionState: ...

    @property
    def is_dark(self) -> bool:
        """Whether it is restarting: nothing answers."""

    @property
    def is_running(self) -> bool:
        """Whether RAPID runs."""

    @property
    def cycle(self) -> str: ...

    @property
    def tasks(self) -> Mapping[str, RapidTask]: ...

    @property
    def signals(self) -> Signals: ...

    @property
    def speed_ratio(self) -> int:
        """Override of all speeds [%]."""

    @property
    def time(self) -> float:
        """What its clock shows [s]; seconds since 1970 where people shall read it."""

    @property
    def events(self) -> EventLog: ...

    @property
    def files(self) -> FileStore: ...

    @property
    def units(self) -> Sequence[MechanicalUnit]: ...

    def set_motors(self, on: bool) -> None: ...

    def start_rapid(self) -> None: ...

    def stop_rapid(self) -> None: ...

    def move_pp_to_main(self) -> None: ...

    def load_module(self, task: str, path: str, *, replace: bool) -> None:
        """Load a file of the file store as a module of a task."""

    def unload_module(self, task: str, name: str) -> None: ...

    def acknowledge_collision(self) -> None: ...

    def restart(self) -> None:
        """Warm restart, soon."""

    def set_speed_ratio(self, percent: int) -> None: ...

    def joint_target(self, unit: str) -> tuple[Sequence[float], Sequence[float]]:
        """Axes 1-6 [deg] and the six external axes [deg], 9E9 where there is none."""

    def cfg(self, domain: str, type: str) -> Sequence[Instance]:
        """The instances of a configuration type; none when there is no such type."""

    def settle(self) -> None:
        """Run the interrupts that are due, so that the effects of a write show in the next answer."""


_MOST_DIGITS = 12


class Failure(YumiError):
    """The answer is no.

    Attributes:
        status: of HTTP.
        code: ABB's.
    """

    def __init__(self, status: int, code: Code, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status
        self.code = code


@dataclass(frozen=True, slots=True)
class Call:
    """A request whose path is understood.

    Attributes:
        method: of HTTP.
        path: the segments, unescaped, without a sub-property behind ``;``.
        query: parameters in the URL.
        form: parameters in the body.
        names: what the placeholders of the route's path stand for.
        content: the body as it came.
        session: whose request it is.
        host: host and port as the client calls them.
    """

    method: str
    path: tuple[str, ...]
    query: Pairs = ()
    form: Pairs = ()
    names: Mapping[str, str] = field(default_factory=dict)
    content: bytes = b""
    session: str = ""
    host: str = ""

    def option(self, name: str) -> str | None:
        """A parameter in the URL, or None."""
        return forms.first(self.query, name)

    def required(self, name: str) -> str:
        """A parameter in the body.

        Raises:
            Failure: it is missing.
        """
        value = forms.first(self.form, name)
        if value is None:
            raise invalid(f"the body lacks {name}")
        return value

    def number_option(self, name: str, default: int) -> int:
        """A parameter in the URL that is a whole number from 0.

        Raises:
            Failure: it is no number.
        """
        text = self.option(name)
        if text is None:
            return default
        if not text.isdecimal() or len(text) > _MOST_DIGITS:
            raise invalid(f"{name} is a whole number of up to {_MOST_DIGITS} digits, not {text[:50]!r}")
        return int(text)


Answer = Page | HttpReply | None
"""A page, a reply that is none, or None for "done, nothing to show"."""

Handler = Callable[[Controller, Call], Answer]
"""Answers a call."""


@dataclass(frozen=True, slots=True)
class Route:
    """One line of the table; ``{name}`` in the path stands for one segment, ``{name*}`` for all that follow."""

    method: str
    path: str
    handler: Handler
    action: str | None = None


def answer(routes: Sequence[Route], controller: Controller, call: Call) -> Answer:
    """What the first route that fits answers.

    Raises:
        Failure: 404 for an unknown path, 405 for a method it does not know, 400 for an action it does not know.
        Refused: the controller says no.
    """
    here = [(route, names) for route in routes if (names := _names(route.path, call.path)) is not None]
    if not here:
        raise Failure(404, Code.FAIL, f"there is no resource /{'/'.join(call.path)}")
    fitting = [(route, names) for route, names in here if route.method == call.method]
    if not fitting:
        raise Failure(405, Code.NOTIMPL, f"{call.method} is not possible on /{'/'.join(call.path)}")
    for route, names in fitting:
        if route.action is None or route.action == call.option("action"):
            return route.handler(controller, replace(call, names=names))
    raise invalid(f"/{'/'.join(call.path)} knows no action {call.option('action')!r}")


def invalid(sentence: str) -> Failure:
    """The failure for a parameter that makes no sense."""
    return Failure(400, Code.INVALIDARG, sentence)


def resource(title: str, base: str, href: str, *states: State, next_href: str | None = None) -> Page:
    """A page with the links every resource has; ``base`` is a path, the adapter puts the host before it."""
    links = (Link("self", href), Link("action", f"{href}?action=show"))
    more = () if next_href is None else (Link("next", next_href),)
    return Page(title, base, states, links + more)


def entry(type: str, title: str, href: str | None = None, /, **fields: str) -> State:
    """An entry of a list that leads to ``href``, by default its title; ``_`` in field names stands for ``-``."""
    named = {name.replace("_", "-"): text for name, text in fields.items()}
    return State(type, title, named, (Link("self", title if href is None else href),))


def _names(pattern: str, path: tuple[str, ...]) -> dict[str, str] | None:
    """What the placeholders of ``pattern`` stand for in ``path``; None when it does not fit."""
    parts = [part for part in pattern.split("/") if part]
    names: dict[str, str] = {}
    for index, part in enumerate(parts):
        if part.endswith("*}"):
            names[part[1:-2]] = "/".join(path[index:])
            return names if len(path) > index else None
        if index >= len(path) or not (part.startswith("{") or part == path[index]):
            return None
        if part.startswith("{"):
            names[part[1:-1]] = path[index]
    return names if len(parts) == len(path) else None


_ANSWERS: Mapping[Refusal, tuple[int, Code]] = {
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


def failure(refused: Refused) -> Failure:
    """The answer to a request the controller refuses."""
    status, code = _ANSWERS[refused.reason]
    return Failure(status, code, str(refused))


def status_of(failure: Failure, service: str) -> Status:
    """The error document of an answer, its message in the controller's shape."""
    sentence = str(failure).rstrip(".")
    message = f"rws_resource_{service}.cpp[1] {sentence} code:{int(failure.code)} icode:-1"
    return Status(int(failure.code), message)
