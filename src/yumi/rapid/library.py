r"""The library: instructions, functions, types and data that extend the language.

A host registers the instructions of its robot here; RAPID itself only knows how to call them. A signature is the
parameter list of a RAPID routine, exactly as it would stand between its parentheses::

    library = InstructionSet()  # on top of RAPID's own instructions

    @library.instruction("EGMStop", r"VAR egmident EGMid, egmstopmode Mode, \num RampOutTime")
    def egm_stop(call: Call) -> Iterator[None]:
        ...
        yield  # not done: go on at the next advance

- `VAR`, `PERS`, `INOUT` before a type: the argument must be such a datum, and `call["EGMid"] = value` writes to it.
- `\num RampOutTime`: optional, `call.present("RampOutTime")`, `call.get("RampOutTime", default)`.
- `\switch Joint | \switch Pose`: at most one of them; a switch that is present has the value True.
- A function of its values alone is a formula: `library.formula("Sin", "num Angle", "num", lambda angle: ...)`.
- Types: every RAPID type, and `anytype`, `anynum` (num or dnum), `signal` (any kind), `x{*}` for arrays.

An instruction returns None, or is a generator: each `yield` gives the task back until the next advance (`yield t`:
and no later than task time t [s]). A function returns its value, or is a generator that returns it.
`RapidRuntimeError` starts RAPID's error handling. When the routine is abandoned (long jump, PP to main) the generator
is closed.
"""

from __future__ import annotations

import inspect
import math
from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

from yumi.rapid.ast import Mode, Storage
from yumi.rapid.parser import parse_parameters
from yumi.rapid.types import (
    ABSENT,
    ALL_ERRORS,
    ANY_NUM,
    ANY_SIGNAL,
    ANY_TYPE,
    ANY_VALUE,
    BOOL,
    DI_OR_BOOL,
    DNUM,
    ERROR_NAMES,
    FIRST_ERROR_NUMBER,
    NUM,
    STRING,
    SWITCH,
    AliasType,
    ArrayType,
    LiveVariable,
    ObjectType,
    ProtectedVariable,
    RapidReferenceError,
    RapidRuntimeError,
    RecordType,
    Reference,
    SignalType,
    Type,
    Variable,
)

if TYPE_CHECKING:
    from yumi.rapid.task import Task

_parsed = cache(parse_parameters)  # each task has a library, and all have the same signatures
Implementation = TypeVar("Implementation", bound=Callable[..., Any])
Wait = Iterator["float | None"]


class Call:
    """One call of an instruction or function: its arguments by name, without regard to case.

    Attributes:
        task: the task that executes it.
        name: the name it was called by.
    """

    __slots__ = ("_arguments", "name", "task")

    def __init__(self, task: Task, name: str, arguments: dict[str, Reference]) -> None:
        self.task = task
        self.name = name
        self._arguments = arguments

    def present(self, name: str) -> bool:
        return self._arguments.get(name.lower(), ABSENT) is not ABSENT

    def __getitem__(self, name: str) -> Any:
        return self._arguments[name.lower()].value

    def __setitem__(self, name: str, value: Any) -> None:
        """Write to the datum passed for a VAR, PERS or INOUT parameter."""
        reference = self._arguments[name.lower()]
        reference.value = reference.type.convert(value)

    def get(self, name: str, default: Any = None) -> Any:
        """The value of an argument, the default where it is not passed or the instruction has no such parameter."""
        reference = self._arguments.get(name.lower(), ABSENT)
        return default if reference is ABSENT else reference.value

    def reference(self, name: str) -> Reference:
        """The datum itself, with its name, type and value."""
        return self._arguments[name.lower()]


def whole_argument(call: Call, name: str, lowest: int, highest: int, default: int | None = None) -> int:
    """An argument that is a whole number within limits; raises ERR_ARGVALERR."""
    value: float = call.get(name, default) if default is not None else call[name]
    if value != int(value) or not lowest <= value <= highest:
        sentence = f"{call.name}: {name} is a whole number from {lowest} to {highest}, not {value:g}."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    return int(value)


VISUALIZE = (
    r"\switch Visualize, \string Header, \string Message | \string MsgArray{*}, \switch Wrap, \icondata Icon, "
    r"\string Image, \num VisualizeTime, \VAR signaldo UIActiveSignal, \num ErrorNumber"
)
"""What the instructions that wait take, to show the operator what they wait for."""


@dataclass(frozen=True, slots=True)
class Deadline:
    r"""The end of a wait with \MaxTime and \TimeFlag.

    Attributes:
        time: task time [s], infinite without \MaxTime.
    """

    call: Call
    time: float

    @staticmethod
    def of(call: Call) -> Deadline:
        return Deadline(call, call.task.now + call.get("MaxTime", math.inf))

    def expire(self) -> bool:
        r"""Whether the time is up; sets \TimeFlag, or raises ERR_WAIT_MAXTIME without one."""
        if self.call.task.now < self.time:
            return False
        if not self.call.present("TimeFlag"):
            sentence = f"{self.call.name} has waited for {self.call['MaxTime']:g} s in vain."
            raise RapidRuntimeError("ERR_WAIT_MAXTIME", sentence)
        self.call["TimeFlag"] = True
        return True

    def met(self) -> None:
        r"""What was waited for has come: clears \TimeFlag."""
        if self.call.present("TimeFlag"):
            self.call["TimeFlag"] = False

    @contextmanager
    def visualized(self, what: str) -> Iterator[None]:
        r"""Meanwhile \Visualize shows the operator what is waited for, `what` without \Message."""
        if not self.call.present("Visualize"):
            yield
            return
        messages, task = self.call.task.host.devices.pendant.messages, self.call.task.name
        lines = self.call.get("MsgArray") or (self.call.get("Message", f"Waiting for {what}"),)
        messages[task] = (self.call.get("Header", self.call.name), *lines)
        try:
            yield
        finally:
            messages.pop(task, None)

    @property
    def due(self) -> float | None:
        """What to yield while waiting."""
        return None if math.isinf(self.time) else self.time


@dataclass(frozen=True, slots=True)
class FormalParameter:
    """A parameter with its type."""

    name: str
    type: Type
    mode: Mode
    group: int | None
    key: str = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "key", self.name.lower())


class Support(Enum):
    """How far an instruction or function does what RobotWare's does; the values are those of the coverage page."""

    DONE = "done"
    ACCEPTED = "accepted without effect"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class LibraryRoutine:
    """An instruction (`returns` is None) or function written in Python.

    Attributes:
        support: whether it does what RobotWare's does.
    """

    name: str
    parameters: tuple[FormalParameter, ...]
    returns: Type | None
    implementation: Callable[[Call], Any]
    may_wait: bool
    support: Support = Support.DONE


_Value = TypeVar("_Value")


class _Names(ChainMap[str, _Value]):
    """Names over those of a base; the compiler looks up each name of a program, which ChainMap does slowly."""

    def get(self, key: str, default: Any = None) -> Any:
        for names in self.maps:
            if key in names:
                return names[key]
        return default


class Library:
    """Names that every module of a task sees; what is registered here hides the same name of `base`."""

    def __init__(self, base: Library | None = None) -> None:
        # By lower-case name: what is registered here, then what the base has.
        self._routines: ChainMap[str, LibraryRoutine] = base._routines.new_child() if base else _Names()
        self._types: ChainMap[str, Type] = base._types.new_child() if base else _Names()
        self._data: ChainMap[str, Variable] = base._data.new_child() if base else _Names()
        self._errors: ChainMap[str, float] = base._errors.new_child() if base else ChainMap()
        self._missing: ChainMap[str, None] = base._missing.new_child() if base else ChainMap()
        self._next_error: int = base._next_error if base else FIRST_ERROR_NUMBER

    # Registering --------------------------------------------------------------------------------------------------

    def instruction(self, name: str, signature: str = "") -> Callable[[Implementation], Implementation]:
        """Decorate the function that executes the instruction `name`; it receives a `Call`."""
        return self._register(name, signature, None)

    def function(self, name: str, signature: str, returns: str) -> Callable[[Implementation], Implementation]:
        """Decorate the function that computes `name(...)`, of type `returns`, from a `Call`."""
        return self._register(name, signature, self.type(returns))

    def formula(self, name: str, signature: str, returns: str, compute: Callable[..., Any]) -> None:
        """Register a function that needs the values of its arguments only, in their order; None for an absent one."""
        keys = [parameter.key for parameter in self.formal(signature)]
        self.function(name, signature, returns)(lambda call: compute(*(call.get(key) for key in keys)))

    def accepted(self, name: str, signature: str = "") -> None:
        """Register an instruction that a program may execute and that changes nothing here."""
        self._add(name, signature, None, lambda call: None, Support.ACCEPTED)

    def refused(self, name: str, signature: str, error: str, sentence: str, returns: str | None = None) -> None:
        """Register an instruction or function that always fails, as a controller without what it needs does."""

        def refuse(call: Call) -> None:
            raise RapidRuntimeError(error, f"{name}: {sentence}")

        self._add(name, signature, None if returns is None else self.type(returns), refuse, Support.REFUSED)

    def _add(
        self, name: str, signature: str, returns: Type | None, implementation: Callable[[Call], Any], support: Support
    ) -> None:
        parameters = self.formal(signature)
        self._routines[name.lower()] = LibraryRoutine(name, parameters, returns, implementation, False, support)

    def _register(self, name: str, signature: str, returns: Type | None) -> Callable[[Implementation], Implementation]:
        parameters = self.formal(signature)

        def registered(implementation: Implementation) -> Implementation:
            may_wait = inspect.isgeneratorfunction(implementation)
            self._routines[name.lower()] = LibraryRoutine(name, parameters, returns, implementation, may_wait)
            return implementation

        return registered

    def formal(self, signature: str) -> tuple[FormalParameter, ...]:
        """The parameters of a signature."""
        return tuple(
            FormalParameter(
                p.name,
                ArrayType(self.type(p.type_name), (0,) * p.rank) if p.rank else self.type(p.type_name),
                p.mode,
                p.group,
            )
            for p in _parsed(signature)
        )

    def record(self, name: str, components: dict[str, str]) -> RecordType:
        """Register a record type from component names to type names, in order."""
        fields = tuple((component, self.type(type_name)) for component, type_name in components.items())
        record = RecordType.named(name, fields)
        self._types[name.lower()] = record
        return record

    def alias(self, name: str, base: str) -> None:
        """Register another name for a type, as errnum is for num."""
        self._types[name.lower()] = AliasType(name, self.type(base))

    def object_type(self, name: str, new: Callable[[], Any]) -> None:
        """Register a type without value (egmident, mecunit); each datum of it begins with an object from `new`."""
        self._types[name.lower()] = ObjectType(name, new)

    def add_type(self, type_: Type) -> None:
        self._types[type_.name.lower()] = type_

    def data(self, name: str, type_name: str, value: Any) -> None:
        """Register a predefined constant."""
        type_ = self.type(type_name)
        self._data[name.lower()] = Variable(name, type_, type_.convert(value), Storage.CONST, is_local=False)

    def persistent(self, name: str, type_name: str, value: Any) -> None:
        """Register a predefined persistent, which a program may pass on and not change."""
        type_ = self.type(type_name)
        self._data[name.lower()] = ProtectedVariable(name, type_, type_.convert(value))

    def live_data(self, name: str, type_name: str, read: Callable[[], Any]) -> None:
        """Register a predefined datum whose value is computed when it is read."""
        self._data[name.lower()] = LiveVariable(name, self.type(type_name), read)

    def error(self, name: str) -> float:
        """Register an error name such as ERR_UDPUC_COMM; returns its number."""
        number = float(self._next_error)
        self._next_error += 1
        self._errors[name.lower()] = number
        self.data(name, "errnum", number)
        return number

    def missing(self, *names: str) -> None:
        """Register names of RobotWare's instructions and functions; a program may use those that no library provides.

        It is loaded, and stops where it executes one.
        """
        self._missing.update(dict.fromkeys(name.lower() for name in names))

    def replace_implementations(self, names: Iterable[str], implementation: Callable[[Call], Any]) -> None:
        """Let routines that are registered do something else; they keep their parameters."""
        for name in names:
            self._routines[name.lower()] = replace(
                self._routines[name.lower()],
                implementation=implementation,
                may_wait=inspect.isgeneratorfunction(implementation),
            )

    def include(self, other: Library) -> None:
        """Take over everything that `other` registered itself, without what it is based on."""
        self._routines.update(other._routines.maps[0])
        self._types.update(other._types.maps[0])
        self._data.update(other._data.maps[0])
        self._errors.update(other._errors.maps[0])
        self._missing.update(other._missing.maps[0])

    # Looking up ---------------------------------------------------------------------------------------------------

    def routine(self, name: str) -> LibraryRoutine | None:
        return self._routines.get(name.lower())

    def is_missing(self, name: str) -> bool:
        return name.lower() in self._missing

    def find_type(self, name: str) -> Type | None:
        return self._types.get(name.lower())

    def type(self, name: str) -> Type:
        """The type called `name`; raises RapidReferenceError."""
        found = self.find_type(name)
        if found is None:
            raise RapidReferenceError(f"There is no type '{name}'; register it before it is used.")
        return found

    def datum(self, name: str) -> Variable | None:
        return self._data.get(name.lower())

    def error_number(self, name: str) -> float | None:
        return self._errors.get(name.lower())

    def error_name(self, number: float) -> str | None:
        return next((name.upper() for name, n in self._errors.items() if n == number), None)


def core_library() -> Library:
    """The atomic types, signals and error numbers: what RAPID's own instructions are written in."""
    core = Library()
    for type_ in (NUM, DNUM, BOOL, STRING, SWITCH, ANY_TYPE, ANY_NUM, ANY_VALUE, ANY_SIGNAL, DI_OR_BOOL):
        core.add_type(type_)
    for kind in ("signaldi", "signaldo", "signalgi", "signalgo", "signalai", "signalao"):
        core.add_type(SignalType(kind))
    core.alias("errnum", "num")
    for name in (*ERROR_NAMES, ALL_ERRORS):
        core.error(name)
    return core
