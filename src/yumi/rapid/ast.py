"""The syntax tree of RAPID: what the parser hands to the compiler, as frozen values.

Names keep the spelling of the source; RAPID compares them without case (`yumi.rapid.compiler`). Every node that can be
blamed for something carries the line it starts on, counted from 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum


class Storage(Enum):
    """How long a datum lives: constant, variable (new at each PP to main), persistent; the value is RWS' word."""

    CONST = "con"
    VAR = "var"
    PERS = "per"


class Mode(Enum):
    """How an argument reaches a parameter."""

    VALUE = "value"
    VAR = "VAR"
    PERS = "PERS"
    INOUT = "INOUT"


class RoutineKind(Enum):
    PROC = "PROC"
    FUNC = "FUNC"
    TRAP = "TRAP"


# Expressions ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Literal:
    """A number, string or truth value as written."""

    value: float | str | bool
    line: int


@dataclass(frozen=True, slots=True)
class Name:
    """An entire datum: variable, persistent, constant, parameter or signal."""

    name: str
    line: int


@dataclass(frozen=True, slots=True)
class Element:
    """An array element, `base{index, ...}`."""

    base: Reference
    indices: tuple[Expression, ...]
    line: int


@dataclass(frozen=True, slots=True)
class Field:
    """A record component, `base.name`."""

    base: Reference
    name: str
    line: int


@dataclass(frozen=True, slots=True)
class Unary:
    operator: str
    operand: Expression
    line: int


@dataclass(frozen=True, slots=True)
class Binary:
    operator: str
    left: Expression
    right: Expression
    line: int


@dataclass(frozen=True, slots=True)
class Aggregate:
    """`[a, b, c]`: a record or an array, which of them the place decides."""

    items: tuple[Expression, ...]
    line: int


@dataclass(frozen=True, slots=True)
class FunctionCall:
    name: str
    arguments: tuple[Argument, ...]
    line: int


Reference = Name | Element | Field
Expression = Literal | Name | Element | Field | Unary | Binary | Aggregate | FunctionCall


@dataclass(frozen=True, slots=True)
class Argument:
    r"""One argument of a call.

    Attributes:
        name: the parameter's name where it is written (`\Tool:=t`, `a:=1`), else None.
        value: the expression; None for a switch.
        is_optional: whether it was written with a backslash.
        condition: the optional parameter `y` of `\x?y`: the argument is passed on when `y` is present.
    """

    name: str | None
    value: Expression | None
    is_optional: bool
    line: int
    condition: str | None = None


# Statements -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Assignment:
    target: Reference
    value: Expression
    line: int


@dataclass(frozen=True, slots=True)
class ProcedureCall:
    name: str
    arguments: tuple[Argument, ...]
    line: int


@dataclass(frozen=True, slots=True)
class LateCall:
    """`%expression% arguments;`: the procedure's name is found while the program runs."""

    name: Expression
    arguments: tuple[Argument, ...]
    line: int


@dataclass(frozen=True, slots=True)
class If:
    branches: tuple[tuple[Expression, Block], ...]
    otherwise: Block
    line: int


@dataclass(frozen=True, slots=True)
class For:
    variable: str
    first: Expression
    last: Expression
    step: Expression | None
    body: Block
    line: int


@dataclass(frozen=True, slots=True)
class While:
    condition: Expression
    body: Block
    line: int


@dataclass(frozen=True, slots=True)
class Test:
    """`TEST value CASE ...`: `otherwise` is the DEFAULT branch."""

    value: Expression
    cases: tuple[tuple[tuple[Expression, ...], Block], ...]
    otherwise: Block
    line: int


@dataclass(frozen=True, slots=True)
class Goto:
    label: str
    line: int


@dataclass(frozen=True, slots=True)
class Label:
    name: str
    line: int


@dataclass(frozen=True, slots=True)
class Return:
    value: Expression | None
    line: int


@dataclass(frozen=True, slots=True)
class Raise:
    number: Expression | None
    line: int


@dataclass(frozen=True, slots=True)
class Exit:
    line: int


@dataclass(frozen=True, slots=True)
class Retry:
    line: int


@dataclass(frozen=True, slots=True)
class TryNext:
    line: int


@dataclass(frozen=True, slots=True)
class Connect:
    target: Reference
    trap: str
    line: int


Simple = Assignment | ProcedureCall | LateCall | Goto | Return | Raise | Exit | Retry | TryNext | Connect
Statement = Simple | If | For | While | Test | Label
Block = tuple[Statement, ...]


# Declarations -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Data:
    """A CONST, VAR or PERS declaration; `dimensions` is empty for a single value."""

    name: str
    type_name: str
    storage: Storage
    dimensions: tuple[Expression, ...]
    initial: Expression | None
    is_local: bool
    is_task: bool
    line: int


@dataclass(frozen=True, slots=True)
class Component:
    type_name: str
    name: str


@dataclass(frozen=True, slots=True)
class Record:
    name: str
    components: tuple[Component, ...]
    is_local: bool
    line: int


@dataclass(frozen=True, slots=True)
class Alias:
    name: str
    type_name: str
    is_local: bool
    line: int


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter; those that share a `group` (0, 1, ...) exclude each other, required ones have None.

    Attributes:
        rank: the number of dimensions of an array parameter `x{*,*}`, 0 for a single value.
    """

    name: str
    type_name: str
    mode: Mode
    rank: int
    group: int | None

    @property
    def is_optional(self) -> bool:
        return self.group is not None


@dataclass(frozen=True, slots=True)
class Handler:
    """The ERROR clause: with `numbers` it is a long-jump handler for those errors, with none it takes every error."""

    numbers: tuple[Expression, ...]
    body: Block
    line: int


@dataclass(frozen=True, slots=True)
class Routine:
    name: str
    kind: RoutineKind
    return_type: str | None
    parameters: tuple[Parameter, ...]
    locals: tuple[Data, ...]
    body: Block
    backward: Block | None
    handler: Handler | None
    undo: Block | None
    is_local: bool
    line: int


@dataclass(frozen=True, slots=True)
class Module:
    """A module as written.

    Attributes:
        attributes: in capitals (SYSMODULE, NOVIEW, NOSTEPIN, VIEWONLY, READONLY).
        length: of its text, in characters.
    """

    name: str
    attributes: frozenset[str]
    records: tuple[Record, ...]
    aliases: tuple[Alias, ...]
    data: tuple[Data, ...]
    routines: tuple[Routine, ...]
    filename: str
    text: str = field(default="", repr=False, compare=False)

    @property
    def is_system(self) -> bool:
        return "SYSMODULE" in self.attributes

    def read_from(self, filename: str, text: str) -> Module:
        """This module as read from a file."""
        return replace(self, filename=filename, text=text)
