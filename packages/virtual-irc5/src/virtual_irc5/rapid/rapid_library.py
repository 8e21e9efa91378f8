r"""The library: instructions, functions with their parameters, types, data and error names that extend the language.

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
import re
from collections import ChainMap
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar

from virtual_irc5.rapid.ast import ParameterMode, Storage
from virtual_irc5.rapid.parser import parse_parameters
from virtual_irc5.rapid.types import (
    ALL_ERRORS,
    ANY_NUM,
    ANY_SIGNAL,
    ANY_TYPE,
    ANY_VALUE,
    BOOL,
    DI_OR_BOOL,
    DNUM,
    FIRST_ERROR_NUMBER,
    LONGEST_NAME,
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
    RapidSignalType,
    RecordType,
    Type,
    Variable,
)

_TEXT = Path(__file__).parent.joinpath("builtins", "names.txt").read_text(encoding="ascii")
ROBOTWARE_NAMES = {title: tuple(names.split()) for title, names in re.findall(r"^\[(\w+)\]([^\[]+)", _TEXT, re.M)}
"""The names that RobotWare 6 base has, provided or not, by the sections of `names.txt`."""

_LOWER_NAMES = frozenset(name.lower() for names in ROBOTWARE_NAMES.values() for name in names)


def is_robotware_name(name: str) -> bool:
    """Whether RobotWare has a name; a program that uses one which no library provides runs up to there."""
    return name.lower() in _LOWER_NAMES


# Of errors, the manuals have three more.
_CONSTANTS = sorted((*ROBOTWARE_NAMES["constants"], "ERR_CONCAT", "ERR_UI_BUTTONS", "ERR_UI_MAXTIME"))
ERROR_NAMES = [
    name
    for prefix in ("ERR_", "CORR_", "SYS_ERR_")
    for name in _CONSTANTS
    if name.startswith(prefix) and len(name) <= LONGEST_NAME  # no program could write it
]

_parsed = cache(parse_parameters)  # each task has a library, and all have the same signatures
_Implementation = TypeVar("_Implementation", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class FormalParameter:
    """A parameter with its type."""

    name: str
    type: Type
    mode: ParameterMode
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
    implementation: Callable[..., Any]
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
        self._next_error: int = base._next_error if base else FIRST_ERROR_NUMBER

    # Registering --------------------------------------------------------------------------------------------------

    def instruction(self, name: str, signature: str = "") -> Callable[[_Implementation], _Implementation]:
        """Decorate the function that executes the instruction `name`; it receives a `Call`."""
        return self._register(name, signature, None)

    def function(self, name: str, signature: str, returns: str) -> Callable[[_Implementation], _Implementation]:
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

        def refuse(call: Any) -> None:
            raise RapidRuntimeError(error, f"{name}: {sentence}")

        self._add(name, signature, None if returns is None else self.type(returns), refuse, Support.REFUSED)

    def _add(
        self, name: str, signature: str, returns: Type | None, implementation: Callable[..., Any], support: Support
    ) -> None:
        parameters = self.formal(signature)
        self._routines[name.lower()] = LibraryRoutine(name, parameters, returns, implementation, False, support)

    def _register(
        self, name: str, signature: str, returns: Type | None
    ) -> Callable[[_Implementation], _Implementation]:
        parameters = self.formal(signature)

        def registered(implementation: _Implementation) -> _Implementation:
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

    def constants(self, type_name: str, names: str) -> None:
        """Register predefined constants in their order: ``LT=1 LTEQ EQ`` counts on from the number given last."""
        number = 0
        for entry in names.split():
            name, _, given = entry.partition("=")
            number = int(given or number)
            self.data(name, type_name, number)
            number += 1

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

    def wrap(self, names: Iterable[str], wrapped: Callable[[Callable[..., Any]], Callable[..., Any]]) -> None:
        """Let routines that are registered do something around, or instead of, what they did."""
        for name in names:
            if (found := self.routine(name)) is not None:
                implementation = wrapped(found.implementation)
                may_wait = inspect.isgeneratorfunction(implementation)
                self._routines[name.lower()] = replace(found, implementation=implementation, may_wait=may_wait)

    def include(self, other: Library, owner: object = None) -> None:
        """Take over everything that `other` registered itself, without what it is based on.

        Where methods of a class were registered, `owner` is the object whose methods they are for this library.
        """
        for key, routine in other._routines.maps[0].items():
            is_method = owner is not None and routine.support is Support.DONE
            own = replace(routine, implementation=partial(routine.implementation, owner)) if is_method else routine
            self._routines[key] = own
        self._types.update(other._types.maps[0])
        self._data.update(other._data.maps[0])
        self._errors.update(other._errors.maps[0])

    # Looking up ---------------------------------------------------------------------------------------------------

    def routine(self, name: str) -> LibraryRoutine | None:
        return self._routines.get(name.lower())

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

    def value(self, name: str) -> Any:
        """The value of a predefined datum, which must be registered."""
        return self._data[name.lower()].value

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
        core.add_type(RapidSignalType(kind))
    core.alias("errnum", "num")
    for name in (*ERROR_NAMES, ALL_ERRORS):
        core.error(name)
    return core
