"""The tree builder: makes RAPID's syntax tree; Lark calls it while it parses, so that there is no parse tree beside."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from lark import Token, Transformer, v_args

from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.types import LONGEST_NAME, LONGEST_STRING

_NodeType = TypeVar("_NodeType", bound=s.Node)
_Clause = tuple[str, Any]
_ESCAPE = re.compile(r'""|\\\\|\\[0-9A-Fa-f]{2}')
_BASES = {"0x": 16, "0b": 2, "0o": 8}
_LONG_ROW = 21  # operands and operators
_ATTRIBUTES = frozenset(("SYSMODULE", "NOVIEW", "NOSTEPIN", "VIEWONLY", "READONLY"))


class NotAllowed(Exception):
    """The grammar takes it, but RAPID does not."""

    def __init__(self, sentence: str, where: Token | s.Node) -> None:
        super().__init__(sentence)
        self.line, self.column = where.line or 1, where.column or 1


def _of(kind: type[_NodeType], items: Sequence[object]) -> tuple[_NodeType, ...]:
    return tuple(item for item in items if isinstance(item, kind))


def _tuple(self: TreeBuilder, *items: Any) -> tuple[Any, ...]:
    return items


def _position(token: Token) -> int:
    return (token.line or 1) << 16 | min(token.column or 1, s.LARGEST_COLUMN)


def _node(kind: type[_NodeType], token: Token, *fields: Any) -> _NodeType:
    """A node that begins at a token; the names among its fields become plain strings."""
    return kind(*(str(each) if type(each) is Token else each for each in fields), position=_position(token))


def _statement(kind: type[_NodeType]) -> Any:
    """The method for a statement that begins with a keyword and whose other parts are the fields of its node."""

    def build(self: TreeBuilder, keyword: Token, *parts: Any) -> _NodeType:
        return _node(kind, keyword, *parts)

    return build


@dataclass(eq=False, slots=True)
class _Prefixed:
    """An operand with NOT or a sign before it."""

    operator: Token
    operand: Any


@dataclass(eq=False, slots=True)
class _Precedence:
    """Makes a tree of operands and operators in a row.

    RAPID overview, expressions: `* / DIV MOD` before `+ -` before `< > <> <= >= =` before AND before XOR, OR and NOT.
    NOT reaches as far as the ANDs that follow it: NOT a AND b is NOT (a AND b).
    """

    row: list[Any]
    index: int = 0

    def expression(self) -> s.Expression:
        return self._joined(("OR", "XOR"), self._logical)

    def _joined(self, kinds: Sequence[str], operand: Callable[[], s.Expression]) -> s.Expression:
        """Operands with operators of one precedence between them, from left to right."""
        left = operand()
        while (operator := self._next(kinds)) is not None:
            left = s.Binary(operator.upper(), left, operand(), position=left.position)
        return left

    def _next(self, kinds: Sequence[str]) -> Token | None:
        """The operator that comes next, when it is one of these."""
        operator: Token | None = self.row[self.index] if self.index < len(self.row) else None
        if operator is None or operator.type not in kinds:
            return None
        self.index += 1
        return operator

    def _nots(self) -> list[Token]:
        """The NOTs before the operand that comes next, which is left without them."""
        found = []
        while isinstance(self.row[self.index], _Prefixed) and self.row[self.index].operator.type == "NOT":
            found.append(self.row[self.index].operator)
            self.row[self.index] = self.row[self.index].operand
        return found

    def _logical(self) -> s.Expression:
        nots = self._nots()
        left = self._relation()
        while (operator := self._next(("AND",))) is not None:
            inner = self._nots()
            left = s.Binary(operator.upper(), left, _applied(inner, self._relation()), position=left.position)
        return _applied(nots, left)

    def _relation(self) -> s.Expression:
        left = self._sum()
        if (operator := self._next(("RELATION",))) is None:
            return left
        whole = s.Binary(operator.upper(), left, self._sum(), position=left.position)
        if (second := self._next(("RELATION",))) is not None:
            raise NotAllowed(f"found '{second}' after a comparison: put one of the two in parentheses.", second)
        return whole

    def _sum(self) -> s.Expression:
        return self._joined(("PLUS", "MINUS"), self._term)

    def _term(self) -> s.Expression:
        return self._joined(("TIMES", "DIVIDE", "DIV", "MOD"), self._factor)

    def _factor(self) -> s.Expression:
        operand: Any = self.row[self.index]
        signs = []
        self.index += 1
        while isinstance(operand, _Prefixed):
            if operand.operator.type == "NOT":
                raise NotAllowed("found 'NOT' where a number or datum is needed.", operand.operator)
            signs.append(operand.operator)
            operand = operand.operand
        whole: s.Expression = _applied(signs, operand)
        return whole


def _applied(operators: Sequence[Token], operand: s.Expression) -> s.Expression:
    for operator in reversed(operators):
        operand = _node(s.Unary, operator, operator.upper(), operand)
    return operand


@v_args(inline=True)
class TreeBuilder(Transformer[Token, Any]):
    """One method for each rule of grammar.lark; `None` stands for what was left out.

    Attributes:
        has_long_rows: whether it has ever met an expression of many operators, which makes a deep tree.
    """

    has_long_rows = False

    def name(self, token: Token) -> Token:
        if len(token) > LONGEST_NAME:
            raise NotAllowed(f"a name has up to {LONGEST_NAME} characters, '{token}' has {len(token)}.", token)
        return token

    # Modules ------------------------------------------------------------------------------------------------------

    def module(self, name: Token, attributes: frozenset[str] | None, *items: object) -> s.Module:
        kinds = (_of(s.Record, items), _of(s.Alias, items), _of(s.Data, items), _of(s.Routine, items))
        return _node(s.Module, name, name, attributes or frozenset(), *kinds)

    def attributes(self, *names: Token) -> frozenset[str]:
        for name in names:
            if name.upper() not in _ATTRIBUTES:
                sentence = f"a module has no attribute '{name}'; there are {', '.join(sorted(_ATTRIBUTES))}."
                raise NotAllowed(sentence, name)
        return frozenset(name.upper() for name in names)

    def record(self, local: Token | None, name: Token, *components: tuple[str, str]) -> s.Record:
        return _node(s.Record, name, name, components, local is not None)

    def component(self, type_name: Token, name: Token) -> tuple[str, str]:
        return str(type_name), str(name)

    def alias(self, local: Token | None, type_name: Token, name: Token) -> s.Alias:
        return _node(s.Alias, name, name, type_name, local is not None)

    def data(
        self,
        local: Token | None,
        storage: Token,
        type_name: Token,
        name: Token,
        dimensions: tuple[s.Expression, ...] | None,
        initial: s.Expression | None,
    ) -> s.Data:
        kind = s.Storage[storage.split()[-1].upper()]
        is_task = storage.type.startswith("TASK")
        return _node(s.Data, name, name, type_name, kind, dimensions or (), initial, local is not None, is_task)

    def local_data(self, *parts: Any) -> s.Data:
        return self.data(None, *parts)

    def storage(self, word: Token) -> Token:
        return word

    dimensions = _tuple

    # Routines -----------------------------------------------------------------------------------------------------

    def procedure(self, local: Token | None, name: Token, parameters: Any, *body: Any) -> s.Routine:
        return self._routine(s.RoutineKind.PROC, local, None, name, parameters, *body)

    def function(self, local: Token | None, type_name: Token, name: Token, parameters: Any, *body: Any) -> s.Routine:
        return self._routine(s.RoutineKind.FUNC, local, type_name, name, parameters, *body)

    def trap(self, local: Token | None, name: Token, *body: Any) -> s.Routine:
        return self._routine(s.RoutineKind.TRAP, local, None, name, None, *body)

    def _routine(
        self,
        kind: s.RoutineKind,
        local: Token | None,
        return_type: Token | None,
        name: Token,
        parameters: tuple[s.Parameter, ...] | None,
        declared: tuple[s.Data, ...],
        block: s.Block,
        *clauses: _Clause,
    ) -> s.Routine:
        found = dict(clauses)
        ends = (found.get("backward"), found.get("handler"), found.get("undo"))
        head = (name, kind, return_type, parameters or ())
        return _node(s.Routine, name, *head, declared, block, *ends, local is not None)

    locals = _tuple

    def backward(self, block: s.Block) -> _Clause:
        return "backward", block

    def undo(self, block: s.Block) -> _Clause:
        return "undo", block

    def handler(self, keyword: Token, numbers: tuple[s.Expression, ...] | None, block: s.Block) -> _Clause:
        return "handler", _node(s.Handler, keyword, numbers or (), block)

    error_numbers = _tuple

    def parameters(self, *groups: s.Parameter | tuple[s.Parameter, ...]) -> tuple[s.Parameter, ...]:
        parameters: list[s.Parameter] = []
        for index, group in enumerate(groups):
            alternatives = group if isinstance(group, tuple) else ()
            for parameter in alternatives:
                parameter.group = index
            parameters += alternatives or (group,)  # type: ignore[arg-type]
        return tuple(parameters)

    optional_group = _tuple

    def parameter(self, mode: s.ParameterMode | None, type_name: Token, name: Token, rank: int | None) -> s.Parameter:
        return _node(s.Parameter, name, name, type_name, mode or s.ParameterMode.VALUE, rank or 0)

    def mode(self, word: Token) -> s.ParameterMode:
        return s.ParameterMode[word.upper()]

    def open_dimensions(self, *stars: Token) -> int:
        return len(stars)

    # Statements ---------------------------------------------------------------------------------------------------

    block = _tuple

    def assignment(self, target: s.Reference, value: s.Expression) -> s.Assignment:
        return s.Assignment(target, value, position=target.position)

    def call(self, name: Token, arguments: tuple[s.Argument, ...] | None) -> s.ProcedureCall:
        return _node(s.ProcedureCall, name, name, arguments or ())

    def placeholder(self, token: Token) -> s.ProcedureCall:
        return _node(s.ProcedureCall, token, token, ())

    def late_call(self, name: s.Expression, arguments: tuple[s.Argument, ...] | None) -> s.LateCall:
        return s.LateCall(name, arguments or (), position=name.position)

    def label(self, name: Token) -> s.Label:
        return _node(s.Label, name, name)

    goto = _statement(s.Goto)
    return_statement = _statement(s.Return)
    raise_statement = _statement(s.Raise)
    exit_statement = _statement(s.Exit)
    retry = _statement(s.Retry)
    trynext = _statement(s.TryNext)
    connect = _statement(s.Connect)
    for_statement = _statement(s.For)
    while_statement = _statement(s.While)

    def if_statement(self, keyword: Token, condition: s.Expression, then: s.Block, *rest: Any) -> s.If:
        *branches, otherwise = rest
        return _node(s.If, keyword, ((condition, then), *branches), otherwise or ())

    elseif = _tuple

    def compact_if(self, keyword: Token, condition: s.Expression, then: s.Statement) -> s.If:
        return _node(s.If, keyword, ((condition, (then,)),), ())

    def test_statement(self, keyword: Token, value: s.Expression, *rest: Any) -> s.Test:
        *cases, otherwise = rest
        return _node(s.Test, keyword, value, tuple(cases), otherwise or ())

    def case(self, *parts: Any) -> tuple[tuple[s.Expression, ...], s.Block]:
        return parts[:-1], parts[-1]

    # Arguments ----------------------------------------------------------------------------------------------------

    arguments = _tuple

    def required(self, name: Token | None, value: s.Expression) -> s.Argument:
        return s.Argument(None if name is None else str(name), value, False, position=value.position)

    def optional(self, name: Token, value: s.Expression | None) -> s.Argument:
        return _node(s.Argument, name, name, value, True)

    def conditional(self, name: Token, condition: Token) -> s.Argument:
        return _node(s.Argument, name, name, _node(s.Name, condition, condition), True, condition)

    # Expressions --------------------------------------------------------------------------------------------------

    # What comes to an expression or a group is an operand, a `_Prefixed` or a list of operands and operators.

    def chain(self, first: Any, operator: Token, operand: Any) -> list[Any]:
        row = first if type(first) is list else [first]
        row.append(operator)
        row.append(operand)
        if len(row) > _LONG_ROW:
            self.has_long_rows = True
        return row

    def prefixed(self, operator: Token, operand: Any) -> _Prefixed:
        return _Prefixed(operator, operand)

    def expression(self, row: Any) -> Any:
        if isinstance(row, s.Node):
            return row
        if type(row) is list and len(row) == 3 and isinstance(row[0], s.Node) and isinstance(row[2], s.Node):
            left, operator, right = row  # as most are
            return s.Binary(operator.upper(), left, right, position=left.position)
        return _Precedence(row if type(row) is list else [row]).expression()

    def group(self, expression: s.Expression) -> s.Expression:
        return expression

    def number(self, token: Token) -> s.Literal:
        base = _BASES.get(token[:2].lower())
        try:
            value = float(token) if base is None else float(int(token[2:], base))
        except OverflowError:  # no number of RAPID's is that large: an error where it is stored
            value = math.inf
        return s.Literal(value, position=_position(token))

    def string(self, token: Token) -> s.Literal:
        r"""The text of a string: `""` is a quote, `\\` a backslash, `\5C` the character with that code."""
        value = token[1:-1]
        if "\\" in value or '"' in value:
            value = _ESCAPE.sub(lambda m: m[0][0] if m[0][0] == m[0][1] else chr(int(m[0][1:], 16)), value)
        if len(value) > LONGEST_STRING:
            raise NotAllowed(f"a string has up to {LONGEST_STRING} characters, this one has {len(value)}.", token)
        return s.Literal(value, position=_position(token))

    def true(self, token: Token) -> s.Literal:
        return s.Literal(True, position=_position(token))

    def false(self, token: Token) -> s.Literal:
        return s.Literal(False, position=_position(token))

    def function_call(self, name: Token, arguments: tuple[s.Argument, ...] | None) -> s.FunctionCall:
        return _node(s.FunctionCall, name, name, arguments or ())

    def aggregate(self, bracket: Token, *items: s.Expression) -> s.Aggregate:
        return _node(s.Aggregate, bracket, items)

    def data_name(self, name: Token) -> s.Name:
        return s.Name(sys.intern(str(name)), position=_position(name))

    def element(self, base: s.Reference, *indices: s.Expression) -> s.Element:
        return s.Element(base, indices, position=base.position)

    def field(self, base: s.Reference, name: Token) -> s.Field:
        return s.Field(base, str(name), position=base.position)


BUILDER = TreeBuilder()
