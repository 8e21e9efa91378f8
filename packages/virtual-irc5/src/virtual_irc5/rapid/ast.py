"""The syntax tree of RAPID: statements, expressions, declarations (modules, routines, records), storage, parameters.

Names keep the spelling of the source; RAPID compares them without case (`virtual_irc5.rapid.program`). Nodes are equal
wherever they stand.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import Enum

LARGEST_COLUMN = 0xFFFF


class Storage(Enum):
    """How long a datum is kept: constant, variable (new at each PP to main), persistent; the value is RWS' word."""

    CONST = "con"
    VAR = "var"
    PERS = "per"


class ParameterMode(Enum):
    """How an argument reaches a parameter."""

    VALUE = "value"
    VAR = "VAR"
    PERS = "PERS"
    INOUT = "INOUT"


class RoutineKind(Enum):
    PROC = "PROC"
    FUNC = "FUNC"
    TRAP = "TRAP"


@dataclass(slots=True)
class Node:
    """A node begins at its `position`: line and column, from 1, in one number.

    A long program has some 100,000 nodes, and each object more would make the garbage collector slower.
    """

    position: int = field(default=0x10001, kw_only=True, compare=False, repr=False)

    @property
    def line(self) -> int:
        return self.position >> 16

    @property
    def column(self) -> int:
        return self.position & LARGEST_COLUMN


# Expressions ------------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class Literal(Node):
    """A number, string or truth value as written."""

    value: float | str | bool


@dataclass(slots=True)
class Name(Node):
    """An entire datum: variable, persistent, constant, parameter or signal."""

    name: str


@dataclass(slots=True)
class Element(Node):
    """An array element, `base{index, ...}`."""

    base: Reference
    indices: tuple[Expression, ...]


@dataclass(slots=True)
class Field(Node):
    """A record component, `base.name`."""

    base: Reference
    name: str


@dataclass(slots=True)
class Unary(Node):
    operator: str
    operand: Expression


@dataclass(slots=True)
class Binary(Node):
    operator: str
    left: Expression
    right: Expression


@dataclass(slots=True)
class Aggregate(Node):
    """`[a, b, c]`: a record or an array, depending on the type that is needed."""

    items: tuple[Expression, ...]


@dataclass(slots=True)
class FunctionCall(Node):
    name: str
    arguments: tuple[Argument, ...]


Reference = Name | Element | Field
Expression = Literal | Name | Element | Field | Unary | Binary | Aggregate | FunctionCall


@dataclass(slots=True)
class Argument(Node):
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
    condition: str | None = None


def children(node: Expression) -> tuple[Expression, ...]:
    """The expressions directly inside of an expression."""
    if isinstance(node, FunctionCall):
        return tuple(argument.value for argument in node.arguments if argument.value is not None)
    if isinstance(node, Element):
        return (node.base, *node.indices)
    if isinstance(node, Binary):
        return (node.left, node.right)
    if isinstance(node, Aggregate):
        return node.items
    inner = getattr(node, "operand", None) or getattr(node, "base", None)
    return () if inner is None else (inner,)


# Statements -------------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class Assignment(Node):
    target: Reference
    value: Expression


@dataclass(slots=True)
class ProcedureCall(Node):
    name: str
    arguments: tuple[Argument, ...]


@dataclass(slots=True)
class LateCall(Node):
    """`%expression% arguments;`: the procedure's name is found while the program runs."""

    name: Expression
    arguments: tuple[Argument, ...]


@dataclass(slots=True)
class If(Node):
    branches: tuple[tuple[Expression, Block], ...]
    otherwise: Block


@dataclass(slots=True)
class For(Node):
    variable: str
    first: Expression
    last: Expression
    step: Expression | None
    body: Block


@dataclass(slots=True)
class While(Node):
    condition: Expression
    body: Block


@dataclass(slots=True)
class Test(Node):
    """`TEST value CASE ...`: `otherwise` is the DEFAULT branch."""

    value: Expression
    cases: tuple[tuple[tuple[Expression, ...], Block], ...]
    otherwise: Block


@dataclass(slots=True)
class Goto(Node):
    label: str


@dataclass(slots=True)
class Label(Node):
    name: str


@dataclass(slots=True)
class Return(Node):
    value: Expression | None


@dataclass(slots=True)
class Raise(Node):
    number: Expression | None


@dataclass(slots=True)
class Exit(Node):
    """`EXIT;` ends the execution of the program."""


@dataclass(slots=True)
class Retry(Node):
    """`RETRY;` begins the statement that failed again."""


@dataclass(slots=True)
class TryNext(Node):
    """`TRYNEXT;` goes on behind the statement that failed."""


@dataclass(slots=True)
class Connect(Node):
    target: Reference
    trap: str


_Simple = Assignment | ProcedureCall | LateCall | Goto | Return | Raise | Exit | Retry | TryNext | Connect
Statement = _Simple | If | For | While | Test | Label
Block = tuple[Statement, ...]


def statements(routine: Routine) -> Iterator[Statement | Data]:
    """The statements and declarations of a routine that are executed, those within others too."""
    handler = routine.handler.body if routine.handler is not None else ()
    rest: list[object] = [*routine.locals, *routine.body, *handler, *(routine.undo or ())]
    while rest:
        node = rest.pop()
        if isinstance(node, tuple):
            rest += node
        elif isinstance(node, (Data, Statement)):
            if not isinstance(node, Label):
                yield node
            if isinstance(node, (If, For, While, Test)):
                rest += [getattr(node, name) for name in node.__slots__]


# Declarations -----------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class Data(Node):
    """A CONST, VAR or PERS declaration; `dimensions` is empty for a single value."""

    name: str
    type_name: str
    storage: Storage
    dimensions: tuple[Expression, ...]
    initial: Expression | None
    is_local: bool
    is_task: bool


@dataclass(slots=True)
class Record(Node):
    """A record type; `components` are pairs of type name and component name."""

    name: str
    components: tuple[tuple[str, str], ...]
    is_local: bool


@dataclass(slots=True)
class Alias(Node):
    name: str
    type_name: str
    is_local: bool


@dataclass(slots=True)
class Parameter(Node):
    """A parameter; those that share a `group` (0, 1, ...) exclude each other, required ones have None.

    Attributes:
        rank: the number of dimensions of an array parameter `x{*,*}`, 0 for a single value.
    """

    name: str
    type_name: str
    mode: ParameterMode
    rank: int
    group: int | None = None


@dataclass(slots=True)
class Handler(Node):
    """The ERROR clause: with `numbers` it is a long-jump handler for those errors, with none it takes every error."""

    numbers: tuple[Expression, ...]
    body: Block


@dataclass(slots=True)
class Routine(Node):
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


@dataclass(slots=True)
class Module(Node):
    """A module as written.

    Attributes:
        attributes: in capitals (SYSMODULE, NOVIEW, NOSTEPIN, VIEWONLY, READONLY).
    """

    name: str
    attributes: frozenset[str]
    records: tuple[Record, ...]
    aliases: tuple[Alias, ...]
    data: tuple[Data, ...]
    routines: tuple[Routine, ...]
    filename: str = ""
    text: str = field(default="", repr=False, compare=False)

    @property
    def is_system(self) -> bool:
        return "SYSMODULE" in self.attributes

    def read_from(self, filename: str, text: str) -> Module:
        """This module as read from a file."""
        return replace(self, filename=filename, text=text)
