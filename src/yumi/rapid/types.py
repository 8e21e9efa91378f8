"""The data types of RAPID: what values a datum may hold, its default, and how a value is checked when it is stored.

Values are immutable Python values: num and dnum are `float`, bool is `bool`, string is `str`, a record is a named
tuple with its components as attributes (`target.robax.rax_1`), an array is a tuple. Types that hold no value
(clock, egmident) are the objects their instructions work on.
"""

from __future__ import annotations

import math
import struct
from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from yumi.rapid.errors import RapidRuntimeError

SINGLE = struct.Struct("f")
LONGEST_STRING = 80  # characters
LARGEST_ARRAY = 50_000  # elements; a controller has memory for more, but not without end
MOST_OBJECTS = 1000  # values of an array of clocks and the like, each of which is made anew whenever it is declared


def single(value: float) -> float:
    """The value as a num holds it: single precision."""
    try:
        rounded: float = SINGLE.unpack(SINGLE.pack(value))[0]
    except OverflowError:
        rounded = float("inf")
    if rounded - rounded != 0.0:
        raise RapidRuntimeError("ERR_NUM_LIMIT", f"{value:g} does not fit into a num, which ends at 3.4E+38.")
    return rounded


def _double(value: float) -> float:
    if value - value != 0.0:
        raise RapidRuntimeError("ERR_NUM_LIMIT", f"{value:g} is not a dnum.")
    return float(value)


def _string(value: str) -> str:
    if len(value) > LONGEST_STRING:
        raise RapidRuntimeError(
            "ERR_STRTOOLNG", f"A string may have {LONGEST_STRING} characters, this one would have {len(value)}."
        )
    return value


@dataclass(frozen=True, slots=True)
class AtomicType:
    """num, dnum, bool or string: `convert` makes any suitable Python value a value of the type."""

    name: str
    initial: float | str | bool
    convert: Callable[[Any], Any]

    def default(self) -> Any:
        return self.initial


@dataclass(frozen=True, slots=True)
class RecordType:
    """A record; two records are the same type only when they are the same declaration."""

    name: str
    components: tuple[tuple[str, Type], ...]
    value_class: Any = field(compare=False, default=None)

    @staticmethod
    def named(name: str, components: tuple[tuple[str, Type], ...]) -> RecordType:
        value_class = namedtuple(name, [n for n, _ in components], rename=True)  # type: ignore[misc]
        return RecordType(name, components, value_class)

    def default(self) -> Any:
        return self.value_class._make(t.default() for _, t in self.components)

    def convert(self, value: Any) -> Any:
        if type(value) is self.value_class:
            return value
        return self.value_class._make(t.convert(v) for (_, t), v in zip(self.components, value, strict=True))

    def index(self, component: str) -> int | None:
        """The place of a component, found without regard to case."""
        wanted = component.lower()
        return next((i for i, (name, _) in enumerate(self.components) if name.lower() == wanted), None)


@dataclass(frozen=True, slots=True)
class ArrayType:
    """An array of up to three dimensions; a size of 0 is open, as in the parameter `x{*}`."""

    element: Type
    sizes: tuple[int, ...]

    @property
    def name(self) -> str:
        return self.element.name

    def default(self) -> Any:
        row = self._row()
        if holds_objects(row):
            return tuple(row.default() for _ in range(self.sizes[0]))
        return (row.default(),) * self.sizes[0]  # values do not change, so that all elements may be the same one

    def convert(self, value: Any) -> Any:
        if type(value) is tuple:  # of a datum, which holds converted values only
            return value
        row = self._row()
        return tuple(row.convert(item) for item in value)

    def _row(self) -> Type:
        return ArrayType(self.element, self.sizes[1:]) if len(self.sizes) > 1 else self.element


@dataclass(frozen=True, slots=True)
class AliasType:
    """Another name for a type: errnum is a num."""

    name: str
    base: Type

    def default(self) -> Any:
        return self.base.default()

    def convert(self, value: Any) -> Any:
        return self.base.convert(value)


@dataclass(frozen=True, slots=True)
class ObjectType:
    """A type without value: its data are objects made by `new`, which only instructions may use or change."""

    name: str
    new: Callable[[], Any]

    def default(self) -> Any:
        return self.new()

    def convert(self, value: Any) -> Any:
        return value


@dataclass(frozen=True, slots=True)
class SignalType:
    """signaldi, signaldo, signalgi, ...: a datum of it stands for a `Signal`; used as a value it is the level."""

    name: str

    def default(self) -> Any:
        return Signal("")

    def convert(self, value: Any) -> Any:
        return value


@dataclass(frozen=True, slots=True)
class Signal:
    """The name of an I/O signal."""

    name: str


@dataclass(frozen=True, slots=True)
class OpenType:
    """A parameter type that takes several types: ABB's `anytype#`, and here `anynum` for num and dnum."""

    name: str

    def default(self) -> Any:
        raise TypeError(f"{self.name} has no value of its own")

    def convert(self, value: Any) -> Any:
        return value


Type = AtomicType | RecordType | ArrayType | AliasType | ObjectType | SignalType | OpenType

NUM = AtomicType("num", 0.0, single)
DNUM = AtomicType("dnum", 0.0, _double)
BOOL = AtomicType("bool", False, bool)
STRING = AtomicType("string", "", _string)
SWITCH = AtomicType("switch", True, bool)
ANY_TYPE = OpenType("anytype")
ANY_NUM = OpenType("anynum")
ANY_SIGNAL = SignalType("signal")


def resolved(type_: Type) -> Type:
    """The type itself behind any aliases."""
    while isinstance(type_, AliasType):
        type_ = type_.base
    return type_


def value_count(type_: Type) -> int:
    """How many atomic values a datum of the type holds."""
    type_ = resolved(type_)
    if isinstance(type_, ArrayType):
        return math.prod(type_.sizes) * value_count(type_.element)
    if isinstance(type_, RecordType):
        return sum(value_count(component) for _, component in type_.components)
    return 1


def holds_objects(type_: Type) -> bool:
    """Whether data of the type are or hold objects that instructions change."""
    type_ = resolved(type_)
    if isinstance(type_, ArrayType):
        return holds_objects(type_.element)
    if isinstance(type_, RecordType):
        return any(holds_objects(component) for _, component in type_.components)
    return isinstance(type_, ObjectType)


def is_numeric(type_: Type) -> bool:
    return resolved(type_) in (NUM, DNUM)


def is_assignable(wanted: Type, given: Type) -> bool:
    """Whether a value of `given` may stand where `wanted` is declared, without any conversion."""
    wanted, given = resolved(wanted), resolved(given)
    if isinstance(wanted, OpenType):
        return wanted is ANY_TYPE or is_numeric(given)
    if isinstance(wanted, SignalType) and isinstance(given, SignalType):
        return ANY_SIGNAL in (wanted, given) or wanted == given
    if isinstance(wanted, ArrayType) and isinstance(given, ArrayType):
        return is_assignable(wanted.element, given.element) and _sizes_fit(wanted.sizes, given.sizes)
    return wanted is given or wanted == given


def _sizes_fit(wanted: tuple[int, ...], given: tuple[int, ...]) -> bool:
    return len(wanted) == len(given) and all(w in (0, g) for w, g in zip(wanted, given, strict=True))


def described(type_: Type) -> str:
    """The type as a person would write it: `num`, `num{2,3}`, `errnum`."""
    if not isinstance(type_, ArrayType):
        return type_.name
    return f"{type_.name}{{{','.join(str(n) if n else '*' for n in type_.sizes)}}}"


def one(type_: Type) -> str:
    """The type with its article, for sentences."""
    text = described(type_)
    return f"{'an' if text[0].lower() in 'aeiou' else 'a'} {text}"
