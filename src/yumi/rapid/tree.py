"""The tree builder: turns each grammar rule into its node of the syntax tree while the parser runs."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any, TypeVar

from lark import Token, Transformer, v_args
from lark.tree import Meta

from yumi.rapid import syntax as s
from yumi.rapid.types import LONGEST_STRING

Node = TypeVar("Node")
ESCAPE = re.compile(r'""|\\\\|\\[0-9A-Fa-f]{2}')
BASES = {"0x": 16, "0b": 2, "0o": 8}


LONGEST_NAME = 32  # characters
ATTRIBUTES = frozenset(("SYSMODULE", "NOVIEW", "NOSTEPIN", "VIEWONLY", "READONLY"))


class NotAllowed(Exception):
    """The grammar takes it, but RAPID does not."""

    def __init__(self, sentence: str, meta: Meta) -> None:
        super().__init__(sentence)
        self.line: int = meta.line
        self.column: int = meta.column


def string_value(token: str) -> str:
    r"""The text of a string literal: `""` is a quote, `\\` a backslash, `\5C` the character with that code."""
    return ESCAPE.sub(_unescaped, token[1:-1])


def _unescaped(match: re.Match[str]) -> str:
    text = match.group()
    return text[0] if text[1] == text[0] else chr(int(text[1:], 16))


def number_value(token: str) -> float:
    base = BASES.get(token[:2].lower())
    try:
        return float(token) if base is None else float(int(token[2:], base))
    except OverflowError:  # no number of RAPID's is that large; whoever stores it is told
        return math.inf


def _of(kind: type[Node], items: Sequence[object]) -> tuple[Node, ...]:
    return tuple(item for item in items if isinstance(item, kind))


@v_args(meta=True, inline=True)
class TreeBuilder(Transformer[Token, Any]):
    """One method for each rule of grammar.lark; `None` stands for what was left out."""

    def name(self, meta: Meta, token: Token) -> str:
        if len(token) > LONGEST_NAME:
            raise NotAllowed(f"a name has up to {LONGEST_NAME} characters, '{token}' has {len(token)}.", meta)
        return str(token)

    # Modules ------------------------------------------------------------------------------------------------------

    def module(self, meta: Meta, name: str, attributes: frozenset[str] | None, *items: object) -> s.Module:
        return s.Module(
            name,
            attributes or frozenset(),
            _of(s.Record, items),
            _of(s.Alias, items),
            _of(s.Data, items),
            _of(s.Routine, items),
            filename="",
        )

    def attributes(self, meta: Meta, *names: Token) -> frozenset[str]:
        unknown = next((name for name in names if name.upper() not in ATTRIBUTES), None)
        if unknown is not None:
            raise NotAllowed(f"a module has no attribute '{unknown}'; there are {', '.join(sorted(ATTRIBUTES))}.", meta)
        return frozenset(name.upper() for name in names)

    def record(self, meta: Meta, local: Token | None, name: str, *components: s.Component) -> s.Record:
        return s.Record(name, components, local is not None, meta.line)

    def component(self, meta: Meta, type_name: str, name: str) -> s.Component:
        return s.Component(type_name, name)

    def alias(self, meta: Meta, local: Token | None, type_name: str, name: str) -> s.Alias:
        return s.Alias(name, type_name, local is not None, meta.line)

    def data(
        self,
        meta: Meta,
        local: Token | None,
        storage: tuple[s.Storage, bool],
        type_name: str,
        name: str,
        dimensions: tuple[s.Expression, ...] | None,
        initial: s.Expression | None,
    ) -> s.Data:
        kind, is_task = storage
        return s.Data(name, type_name, kind, dimensions or (), initial, local is not None, is_task, meta.line)

    def local_data(self, meta: Meta, *parts: Any) -> s.Data:
        return self.data(meta, None, *parts)

    def storage(self, meta: Meta, word: Token) -> tuple[s.Storage, bool]:
        return s.Storage[word.split()[-1].upper()], word.type.startswith("TASK")

    def dimensions(self, meta: Meta, *sizes: s.Expression) -> tuple[s.Expression, ...]:
        return sizes

    # Routines -----------------------------------------------------------------------------------------------------

    def procedure(
        self, meta: Meta, local: Token | None, name: str, parameters: tuple[s.Parameter, ...] | None, *body: Any
    ) -> s.Routine:
        return self._routine(meta, s.RoutineKind.PROC, local, None, name, parameters, body)

    def function(
        self, meta: Meta, local: Token | None, type_name: str, name: str, parameters: Any, *body: Any
    ) -> s.Routine:
        return self._routine(meta, s.RoutineKind.FUNC, local, type_name, name, parameters, body)

    def trap(self, meta: Meta, local: Token | None, name: str, *body: Any) -> s.Routine:
        return self._routine(meta, s.RoutineKind.TRAP, local, None, name, None, body)

    def _routine(
        self,
        meta: Meta,
        kind: s.RoutineKind,
        local: Token | None,
        return_type: str | None,
        name: str,
        parameters: tuple[s.Parameter, ...] | None,
        body: Sequence[Any],
    ) -> s.Routine:
        declared, block, *clauses = body
        found = dict(clauses)
        return s.Routine(
            name,
            kind,
            return_type,
            parameters or (),
            declared,
            block,
            found.get("backward"),
            found.get("handler"),
            found.get("undo"),
            local is not None,
            meta.line,
        )

    def locals(self, meta: Meta, *data: s.Data) -> tuple[s.Data, ...]:
        return data

    def backward(self, meta: Meta, block: s.Block) -> tuple[str, s.Block]:
        return "backward", block

    def undo(self, meta: Meta, block: s.Block) -> tuple[str, s.Block]:
        return "undo", block

    def handler(self, meta: Meta, numbers: tuple[s.Expression, ...] | None, block: s.Block) -> tuple[str, s.Handler]:
        return "handler", s.Handler(numbers or (), block, meta.line)

    def error_numbers(self, meta: Meta, *numbers: s.Expression) -> tuple[s.Expression, ...]:
        return numbers

    def parameters(self, meta: Meta, *groups: tuple[s.Parameter, ...]) -> tuple[s.Parameter, ...]:
        return tuple(
            s.Parameter(p.name, p.type_name, p.mode, p.rank, None if p.group is None else index)
            for index, group in enumerate(groups)
            for p in group
        )

    def required_group(self, meta: Meta, parameter: s.Parameter) -> tuple[s.Parameter, ...]:
        return (parameter,)

    def optional_group(self, meta: Meta, *alternatives: s.Parameter) -> tuple[s.Parameter, ...]:
        return tuple(s.Parameter(p.name, p.type_name, p.mode, p.rank, 0) for p in alternatives)

    def parameter(self, meta: Meta, mode: s.Mode | None, type_name: str, name: str, rank: int | None) -> s.Parameter:
        return s.Parameter(name, type_name, mode or s.Mode.VALUE, rank or 0, None)

    def mode(self, meta: Meta, word: Token) -> s.Mode:
        return s.Mode[word.upper()]

    def open_dimensions(self, meta: Meta, *stars: Token) -> int:
        return len(stars)

    # Statements ---------------------------------------------------------------------------------------------------

    def block(self, meta: Meta, *statements: s.Statement) -> s.Block:
        return statements

    def assignment(self, meta: Meta, target: s.Reference, value: s.Expression) -> s.Assignment:
        return s.Assignment(target, value, meta.line)

    def call(self, meta: Meta, name: str, arguments: tuple[s.Argument, ...] | None) -> s.ProcedureCall:
        return s.ProcedureCall(name, arguments or (), meta.line)

    def late_call(self, meta: Meta, name: s.Expression, arguments: tuple[s.Argument, ...] | None) -> s.LateCall:
        return s.LateCall(name, arguments or (), meta.line)

    def goto(self, meta: Meta, label: str) -> s.Goto:
        return s.Goto(label, meta.line)

    def label(self, meta: Meta, name: str) -> s.Label:
        return s.Label(name, meta.line)

    def return_statement(self, meta: Meta, value: s.Expression | None) -> s.Return:
        return s.Return(value, meta.line)

    def raise_statement(self, meta: Meta, number: s.Expression | None) -> s.Raise:
        return s.Raise(number, meta.line)

    def exit_statement(self, meta: Meta) -> s.Exit:
        return s.Exit(meta.line)

    def retry(self, meta: Meta) -> s.Retry:
        return s.Retry(meta.line)

    def trynext(self, meta: Meta) -> s.TryNext:
        return s.TryNext(meta.line)

    def connect(self, meta: Meta, target: s.Reference, trap: str) -> s.Connect:
        return s.Connect(target, trap, meta.line)

    def if_statement(self, meta: Meta, condition: s.Expression, then: s.Block, *rest: Any) -> s.If:
        *branches, otherwise = rest
        return s.If(((condition, then), *branches), otherwise or (), meta.line)

    def elseif(self, meta: Meta, condition: s.Expression, then: s.Block) -> tuple[s.Expression, s.Block]:
        return condition, then

    def compact_if(self, meta: Meta, condition: s.Expression, then: s.Statement) -> s.If:
        return s.If(((condition, (then,)),), (), meta.line)

    def for_statement(
        self,
        meta: Meta,
        variable: str,
        first: s.Expression,
        last: s.Expression,
        step: s.Expression | None,
        body: s.Block,
    ) -> s.For:
        return s.For(variable, first, last, step, body, meta.line)

    def while_statement(self, meta: Meta, condition: s.Expression, body: s.Block) -> s.While:
        return s.While(condition, body, meta.line)

    def test_statement(self, meta: Meta, value: s.Expression, *rest: Any) -> s.Test:
        *cases, otherwise = rest
        return s.Test(value, tuple(cases), otherwise or (), meta.line)

    def case(self, meta: Meta, *parts: Any) -> tuple[tuple[s.Expression, ...], s.Block]:
        *values, block = parts
        return tuple(values), block

    # Arguments ----------------------------------------------------------------------------------------------------

    def arguments(self, meta: Meta, *arguments: s.Argument) -> tuple[s.Argument, ...]:
        return arguments

    def required(self, meta: Meta, name: str | None, value: s.Expression) -> s.Argument:
        return s.Argument(name, value, False, meta.line)

    def optional(self, meta: Meta, name: str, value: s.Expression | None) -> s.Argument:
        return s.Argument(name, value, True, meta.line)

    def conditional(self, meta: Meta, name: str, condition: str) -> s.Argument:
        return s.Argument(name, s.Name(condition, meta.line), True, meta.line, condition)

    # Expressions --------------------------------------------------------------------------------------------------

    def binary(self, meta: Meta, left: s.Expression, operator: Token, right: s.Expression) -> s.Binary:
        return s.Binary(operator.upper(), left, right, meta.line)

    def unary(self, meta: Meta, operator: Token, operand: s.Expression) -> s.Unary:
        return s.Unary(operator.upper(), operand, meta.line)

    def number(self, meta: Meta, token: Token) -> s.Literal:
        return s.Literal(number_value(token), meta.line)

    def string(self, meta: Meta, token: Token) -> s.Literal:
        value = string_value(token)
        if len(value) > LONGEST_STRING:
            raise NotAllowed(f"a string has up to {LONGEST_STRING} characters, this one has {len(value)}.", meta)
        return s.Literal(value, meta.line)

    def true(self, meta: Meta, token: Token) -> s.Literal:
        return s.Literal(True, meta.line)

    def false(self, meta: Meta, token: Token) -> s.Literal:
        return s.Literal(False, meta.line)

    def function_call(self, meta: Meta, name: str, arguments: tuple[s.Argument, ...] | None) -> s.FunctionCall:
        return s.FunctionCall(name, arguments or (), meta.line)

    def aggregate(self, meta: Meta, *items: s.Expression) -> s.Aggregate:
        return s.Aggregate(items, meta.line)

    def data_name(self, meta: Meta, name: str) -> s.Name:
        return s.Name(name, meta.line)

    def element(self, meta: Meta, base: s.Reference, *indices: s.Expression) -> s.Element:
        return s.Element(base, indices, meta.line)

    def field(self, meta: Meta, base: s.Reference, name: str) -> s.Field:
        return s.Field(base, name, meta.line)
