"""RAPID's data types (num, bool, string, signals), data in memory, operators, limits, and errors of the language.

Values are immutable Python values: num and dnum are `float`, bool is `bool`, string is `str`, a record is a named
tuple with its components as attributes (`target.robax.rax_1`), an array is a tuple. A type has a default and checks
what is stored. Types that hold no value (clock, egmident) are the objects their instructions work on. Data in memory
are variables, parts of them, and the parameter that was not passed. The operators have the types they take and give.

::

    RapidError
    ├── RapidSyntaxError     the text is not RAPID: mend the module
    ├── RapidReferenceError  a name, type or argument does not fit: mend the module, or load what it refers to
    │   ├── Unresolved           nothing declares a name: the program runs up to where it is used
    │   │   └── NotProvided          RobotWare has it, the library has not
    │   ├── ModuleNameTaken      there is a module of that name: unload it first, or replace it
    │   └── ProgramTooLarge      there is no memory for it: make it smaller, or unload others
    ├── RapidRuntimeError    an execution error with an error number, which an ERROR handler may catch
    ├── UnknownSymbol        no such module or symbol
    └── RapidValueError      a literal does not fit the symbol it was written to
"""

from __future__ import annotations

import math
import operator
import struct
from collections import namedtuple
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Protocol

from abb_protocols.errors import RapidError
from virtual_irc5.rapid.ast import Storage


class RapidSyntaxError(RapidError):
    """The text is not RAPID; the message says where, what was found and what would be allowed.

    Attributes:
        sentence: what was found and what would be allowed, without the place.
        line, column: counted from 1.
    """

    def __init__(self, sentence: str, *, filename: str, line: int, column: int) -> None:
        super().__init__(f"{filename}:{line}:{column}: {sentence}")
        self.sentence = sentence
        self.filename = filename
        self.line = line
        self.column = column


class RapidReferenceError(RapidError):
    """A name is unknown or used as what it is not; the message begins with module and line.

    Attributes:
        sentence: what does not fit, without the place.
        line, column: counted from 1, 0 where the error has no position in a file.
    """

    def __init__(self, message: str, *, sentence: str = "", filename: str = "", line: int = 0, column: int = 0) -> None:
        super().__init__(message)
        self.sentence = sentence or message
        self.filename = filename
        self.line = line
        self.column = column


class Unresolved(RapidReferenceError):
    """Nothing declares a name: an error only where the program uses it, with the error number `error` then.

    Technical reference manual, RAPID kernel: references are resolved late, so that modules may be loaded in any order.
    """

    error = "ERR_REFUNKDAT"


class UnresolvedFunction(Unresolved):
    error = "ERR_REFUNKFUN"


class UnresolvedProcedure(Unresolved):
    error = "ERR_REFUNKPRC"


class RapidUnresolvedTrap(Unresolved):
    error = "ERR_REFUNKTRP"


class NotProvided(Unresolved):
    """What RobotWare has and this library has not; the error is none of RAPID's, so that no handler takes it."""

    error = "NOT_PROVIDED"


class ModuleNameTaken(RapidReferenceError):
    """The task has a module of that name already."""


class ProgramTooLarge(RapidReferenceError):
    """The task has no memory for it."""


class UnknownSymbol(RapidError):
    """The task has no such module, or the module no such symbol."""


class RapidValueError(RapidError):
    """A literal is not a value of the type it should have; nothing was changed."""


class RapidRuntimeError(RapidError):
    """An execution error; instructions raise it to start RAPID's error handling.

    Attributes:
        name: the error's name, such as "ERR_UDPUC_COMM", or "" for a number raised by the program itself. A name that
            is not registered is fatal: no handler can take it.
        number: the value of ERRNO, or None until the task has looked the name up.
    """

    def __init__(self, name: str, sentence: str) -> None:
        super().__init__(sentence)
        self.name = name
        self.number: float | None = None


class Propagated(Exception):
    """An error handler passes its error on to the caller (RAISE in an ERROR clause).

    Attributes:
        is_long_jump: whether only handlers that list the number may take it.
    """

    def __init__(self, error: RapidRuntimeError, *, is_long_jump: bool) -> None:
        super().__init__(str(error))
        self.error = error
        self.is_long_jump = is_long_jump


@contextmanager
def raised_as(name: str, *kinds: type[Exception], before: str = "") -> Iterator[None]:
    """Let an error of another kind be an execution error, with `before` in front of its sentence."""
    try:
        yield
    except kinds as error:
        raise RapidRuntimeError(name, f"{before}{error}") from error


def execution_error(error: RapidValueError | ArithmeticError) -> RapidRuntimeError:
    """RAPID's error for data that have no text, such as a socket, where it is needed, or for a number out of range."""
    if isinstance(error, ArithmeticError):
        return RapidRuntimeError("ERR_NUM_LIMIT", f"A number in the expression is too large: {error}.")
    return RapidRuntimeError("ERR_ARGVALERR", str(error))


# ABB does not publish the values, and programs compare names only; the library counts them up from here.
FIRST_ERROR_NUMBER = 1001
FIRST_BOOKED_NUMBER = 5001  # what BookErrNo gives out
ALL_ERRORS = "LONG_JMP_ALL_ERR"  # in the list of an ERROR clause: it takes every error, from long jumps as well
LARGEST_OWN_NUMBER = 90  # 1 to 90 are the program's own

_SINGLE = struct.Struct("f")
LONGEST_NAME = 32  # characters, as a program can write it
LONGEST_STRING = 80  # characters
LARGEST_ARRAY = 50_000  # elements; a controller has memory for more, but not without end
MOST_OBJECTS = 1000  # values of an array of clocks and the like, each of which is made anew whenever it is declared


def single_precision(value: float) -> float:
    """The value as a num holds it: single precision."""
    try:
        rounded: float = _SINGLE.unpack(_SINGLE.pack(value))[0]
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
    @lru_cache(maxsize=256)  # each task of each controller declares the same ones
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
        """The index of a component, found without regard to case."""
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
        row = self.row
        if holds_objects(row):
            return tuple(row.default() for _ in range(self.sizes[0]))
        return (row.default(),) * self.sizes[0]  # values do not change, so that all elements may be the same one

    def convert(self, value: Any) -> Any:
        if type(value) is tuple:  # of a datum, which holds converted values only
            self._check_sizes(value)
            return value
        row = self.row
        return tuple(row.convert(item) for item in value)

    def _check_sizes(self, value: Any) -> None:
        """The sizes of an open array are known at run time only; raises ERR_INVDIM for others than these."""
        found, first = [], value
        for _ in self.sizes:
            found.append(len(first))
            first = first[0]
        if any(size not in (0, length) for size, length in zip(self.sizes, found, strict=True)):
            given = type_text(ArrayType(self.element, tuple(found)))
            raise RapidRuntimeError("ERR_INVDIM", f"{given} is found where {type_text(self)} is needed.")

    @property
    def row(self) -> Type:
        """What is found at one index: an element, or an array with a dimension less."""
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
    new: Callable[[], Any] = field(compare=False)

    def default(self) -> Any:
        return self.new()

    def convert(self, value: Any) -> Any:
        return value


@dataclass(frozen=True, slots=True)
class RapidSignalType:
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
    """A parameter type that takes several types: ABB's `anytype#`, and those of ours below."""

    name: str

    def default(self) -> Any:
        raise TypeError(f"{self.name} has no value of its own")

    def convert(self, value: Any) -> Any:
        return value


Type = AtomicType | RecordType | ArrayType | AliasType | ObjectType | RapidSignalType | OpenType

NUM = AtomicType("num", 0.0, single_precision)
DNUM = AtomicType("dnum", 0.0, _double)
BOOL = AtomicType("bool", False, bool)
STRING = AtomicType("string", "", _string)
SWITCH = AtomicType("switch", True, bool)
ANY_TYPE = OpenType("anytype")
ANY_NUM = OpenType("anynum")
ANY_VALUE = OpenType("anyvalue")
"""ABB's `anytype` where a literal keeps all its digits; elsewhere it is a num, as the data it is written to."""
DI_OR_BOOL = OpenType("signaldi_or_bool")
"""What a search watches: a digital input, or a persistent bool."""
ANY_SIGNAL = RapidSignalType("signal")


def resolved_type(type_: Type) -> Type:
    """The type itself behind any aliases."""
    while isinstance(type_, AliasType):
        type_ = type_.base
    return type_


def value_count(type_: Type) -> int:
    """How many atomic values a datum of the type holds."""
    type_ = resolved_type(type_)
    if isinstance(type_, ArrayType):
        return math.prod(type_.sizes) * value_count(type_.element)
    if isinstance(type_, RecordType):
        return sum(value_count(component) for _, component in type_.components)
    return 1


def holds_objects(type_: Type) -> bool:
    """Whether data of the type are or hold objects that instructions change."""
    type_ = resolved_type(type_)
    if isinstance(type_, ArrayType):
        return holds_objects(type_.element)
    if isinstance(type_, RecordType):
        return any(holds_objects(component) for _, component in type_.components)
    return isinstance(type_, ObjectType)


def is_numeric(type_: Type) -> bool:
    return resolved_type(type_) in (NUM, DNUM)


def is_assignable(wanted: Type, given: Type) -> bool:
    """Whether a value of `given` may stand where `wanted` is declared, without any conversion."""
    wanted, given = resolved_type(wanted), resolved_type(given)
    if wanted is DI_OR_BOOL:
        return given is BOOL or is_assignable(RapidSignalType("signaldi"), given)
    if isinstance(wanted, OpenType):
        return wanted is not ANY_NUM or is_numeric(given)
    if isinstance(wanted, RapidSignalType) and isinstance(given, RapidSignalType):
        return ANY_SIGNAL in (wanted, given) or wanted == given
    if isinstance(wanted, ArrayType) and isinstance(given, ArrayType):
        same_rank = len(wanted.sizes) == len(given.sizes)
        # Those of an open array are compared when it is executed.
        sizes_fit = same_rank and all(0 in (w, g) or w == g for w, g in zip(wanted.sizes, given.sizes, strict=True))
        return sizes_fit and is_assignable(wanted.element, given.element)
    return wanted is given or wanted == given


def type_text(type_: Type) -> str:
    """The type as a person would write it: `num`, `num{2,3}`, `errnum`."""
    if not isinstance(type_, ArrayType):
        return type_.name
    return f"{type_.name}{{{','.join(str(n) if n else '*' for n in type_.sizes)}}}"


def type_with_article(type_: Type) -> str:
    """The type with its article, for sentences."""
    text = type_text(type_)
    return f"{'an' if text[0].lower() in 'aeiou' else 'a'} {text}"


_Path = tuple[int, ...]
UNSET_DATA: Any = object()  # the value of a declared datum before the program is linked


class Reference(Protocol):
    """A datum or part of one, read from and written to: what VAR, PERS and INOUT parameters receive."""

    value: Any

    @property
    def name(self) -> str: ...

    @property
    def type(self) -> Type: ...


class Variable:
    """A named datum; `value` is always a converted value of `type`.

    Attributes:
        initial: what a VAR begins with at each PP to main, UNSET for objects, which are made anew.
        fault: why it has neither type nor value: its declaration names what nothing declares.
        watchers: called when its value has changed, see `watch`.
    """

    __slots__ = ("fault", "initial", "is_local", "is_task", "name", "storage", "type", "value", "watchers")

    def __init__(
        self,
        name: str,
        type_: Type,
        value: Any = UNSET_DATA,
        storage: Storage = Storage.VAR,
        *,
        is_local: bool = True,
        is_task: bool = False,
    ) -> None:
        self.name = name
        self.type = type_
        self.value = value
        self.storage = storage
        self.is_local = is_local
        self.is_task = is_task
        self.initial: Any = UNSET_DATA
        self.fault = ""
        self.watchers: list[Callable[[], None]] = []

    @property
    def is_constant(self) -> bool:
        return self.storage is Storage.CONST

    def watch(self, watcher: Callable[[], None]) -> None:
        """Call `watcher` whenever the value has changed; a variable that nothing watches pays nothing for it."""
        self.watchers.append(watcher)
        self.__class__ = _WatchedVariable


_VALUE: Any = Variable.__dict__["value"]


class _WatchedVariable(Variable):
    """A variable with watchers; it has the same slots, so that a variable may become one."""

    __slots__ = ()

    @property
    def value(self) -> Any:
        return _VALUE.__get__(self)

    @value.setter
    def value(self, new: Any) -> None:
        old = _VALUE.__get__(self)
        _VALUE.__set__(self, new)
        if new != old:
            for watcher in tuple(self.watchers):
                watcher()


class LiveVariable(Variable):
    """A constant whose value is computed whenever it is read."""

    __slots__ = ("_read",)

    def __init__(self, name: str, type_: Type, read: Callable[[], Any]) -> None:
        super().__init__(name, type_, None, Storage.CONST, is_local=False)
        self._read = read

    @property
    def value(self) -> Any:
        return self.type.convert(self._read())

    @value.setter
    def value(self, new: Any) -> None:
        _VALUE.__set__(self, new)


class ProtectedVariable(Variable):
    """A persistent of RobotWare's own, such as tool0: a PERS parameter takes it, and nothing changes it.

    Its value is set once: watchers have nothing to wait for.
    """

    __slots__ = ()

    def __init__(self, name: str, type_: Type, value: Any) -> None:
        super().__init__(name, type_, UNSET_DATA, Storage.PERS, is_local=False)
        _VALUE.__set__(self, value)

    @property
    def value(self) -> Any:
        return _VALUE.__get__(self)

    @value.setter
    def value(self, new: Any) -> None:
        if new is not UNSET_DATA:  # as it is before its value is known
            # The manual says that no program changes it, and names no error for an assignment to a parameter; this one
            # is SetDataVal's of data that is read-only.
            raise RapidRuntimeError("ERR_SYM_ACCESS", f"'{self.name}' is RobotWare's own and cannot be changed.")

    def watch(self, watcher: Callable[[], None]) -> None:
        self.watchers.append(watcher)


class DatumPart:
    """A component or element of another datum; writing it replaces the whole value there."""

    __slots__ = ("path", "type", "whole")

    def __init__(self, whole: Reference, path: _Path, type_: Type) -> None:
        self.whole = whole
        self.path = path
        self.type = type_

    @property
    def name(self) -> str:
        return self.whole.name

    @property
    def value(self) -> Any:
        value = self.whole.value
        for index in self.path:
            value = value[index]
        return value

    @value.setter
    def value(self, new: Any) -> None:
        self.whole.value = _replaced(self.whole.value, self.path, new)


def _replaced(value: Any, path: _Path, new: Any) -> Any:
    """The record or array `value` with the part at `path` being `new`."""
    if not path:
        return new
    items = list(value)
    items[path[0]] = _replaced(items[path[0]], path[1:], new)
    return tuple(items) if type(value) is tuple else value._make(items)


class Absent:
    """Stands for an optional parameter that was not passed."""

    __slots__ = ()
    name = "an optional parameter"

    @property
    def type(self) -> Type:
        raise RapidRuntimeError("ERR_NOTPRES", "An optional parameter is used that the caller did not pass.")

    @property
    def value(self) -> Any:
        raise RapidRuntimeError("ERR_NOTPRES", "An optional parameter is used that the caller did not pass.")

    @value.setter
    def value(self, new: Any) -> None:
        raise RapidRuntimeError("ERR_NOTPRES", "An optional parameter is used that the caller did not pass.")


ABSENT_DATA = Absent()
_Operation = Callable[[Any, Any], Any]


def _divided(left: float, right: float) -> float:
    if right == 0.0:
        raise RapidRuntimeError("ERR_DIVZERO", f"{left:g} is divided by zero.")
    return left / right


def _whole(left: float, right: float) -> tuple[int, int]:
    if right == 0.0:
        raise RapidRuntimeError("ERR_DIVZERO", f"{left:g} is divided by zero.")
    if left != int(left) or right != int(right):
        raise RapidRuntimeError("ERR_INT_NOTVAL", f"DIV and MOD take integers, not {left:g} and {right:g}.")
    return int(left), int(right)


def _integer_quotient(left: float, right: float) -> float:
    dividend, divisor = _whole(left, right)
    quotient = abs(dividend) // abs(divisor)
    return float(quotient if (dividend < 0) == (divisor < 0) else -quotient)


def _scaled(position: Any, factor: float) -> Any:
    return type(position)._make(component * factor for component in position)


def _cross(left: Any, right: Any) -> Any:
    (ax, ay, az), (bx, by, bz) = left, right
    return type(left)(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def _rotation_product(left: Any, right: Any) -> Any:
    (a, b, c, d), (e, f, g, h) = left, right
    return type(left)(
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )


_NUMERIC: dict[str, tuple[_Operation, bool]] = {
    "+": (operator.add, False),
    "-": (operator.sub, False),
    "*": (operator.mul, False),
    "/": (_divided, False),
    "DIV": (_integer_quotient, False),
    "MOD": (lambda left, right: math.fmod(*_whole(left, right)), False),
    "<": (operator.lt, True),
    "<=": (operator.le, True),
    ">": (operator.gt, True),
    ">=": (operator.ge, True),
}
_RECORDS: dict[tuple[str, str, str], _Operation] = {
    ("+", "pos", "pos"): lambda left, right: left._make(map(operator.add, left, right)),
    ("-", "pos", "pos"): lambda left, right: left._make(map(operator.sub, left, right)),
    ("*", "pos", "num"): _scaled,
    ("*", "num", "pos"): lambda factor, position: _scaled(position, factor),
    ("*", "pos", "pos"): _cross,
    ("*", "orient", "orient"): _rotation_product,
}


def binary_operation(symbol: str, left: Type, right: Type) -> tuple[_Operation, Type] | None:
    """The operation and the type of its result; None when the types do not go with the operator.

    AND and OR are not here: their right side is evaluated only when the left one has not decided.
    """
    if symbol in {"=", "<>"}:
        operation = operator.eq if symbol == "=" else operator.ne
        return (operation, BOOL) if is_assignable(left, right) else None
    left, right = resolved_type(left), resolved_type(right)
    if is_numeric(left) and left == right and symbol in _NUMERIC:
        operation, is_comparison = _NUMERIC[symbol]
        return operation, BOOL if is_comparison else left
    if symbol == "+" and left == right == STRING:
        return operator.add, STRING
    if symbol == "XOR" and left == right == BOOL:
        return operator.ne, BOOL
    record = _RECORDS.get((symbol, left.name, right.name))
    return None if record is None else (record, right if left == NUM else left)


def unary_operation(symbol: str, operand: Type) -> Callable[[Any], Any] | None:
    """The operation, which gives the operand's type; None when the type does not go with the operator."""
    operand = resolved_type(operand)
    if symbol == "NOT":
        return operator.not_ if operand == BOOL else None
    if operand in (NUM, DNUM):
        return operator.neg if symbol == "-" else operator.pos
    return (lambda position: _scaled(position, -1.0)) if symbol == "-" and operand.name == "pos" else None
