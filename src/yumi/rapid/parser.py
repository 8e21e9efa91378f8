"""The parser: RAPID text to syntax tree, with errors a person can act on.

The tree builder: turns each grammar rule into its node of the syntax tree while the parser runs.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from lark import Lark, Token, Transformer, Tree, UnexpectedToken, v_args
from lark.exceptions import UnexpectedInput, VisitError
from lark.tree import Meta

from yumi.rapid import ast as s
from yumi.rapid.ast import Expression, Module, Parameter, Reference
from yumi.rapid.errors import RapidSyntaxError
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


# What may stand in a place, from the general to the particular: the first group that fits whole names its members.
GROUPS = {
    "a statement": frozenset(
        (
            *("IDENT", "PERCENT", "IF", "FOR", "WHILE", "TEST", "GOTO"),
            *("RETURN", "RAISE", "EXIT", "RETRY", "TRYNEXT", "CONNECT"),
        )
    ),
    "an expression": frozenset(("IDENT", "NUMBER", "STRING", "TRUE", "FALSE", "LPAR", "LSQB", "PLUS", "MINUS", "NOT")),
    "an operator": frozenset(("PLUS", "MINUS", "TIMES", "DIVIDE", "DIV", "MOD", "RELATION", "AND", "OR", "XOR")),
    "a routine": frozenset(("PROC", "FUNC", "TRAP")),
    "a type": frozenset(("RECORD", "ALIAS")),
    "a declaration": frozenset(("CONST", "VAR", "PERS", "TASK_VAR", "TASK_PERS")),
}
WORDS = {
    "IDENT": "a name",
    "NUMBER": "a number",
    "STRING": "a string",
    "RELATION": "a comparison",
    "PLUS": "'+'",
    "MINUS": "'-'",
    "TIMES": "'*'",
    "DIVIDE": "'/'",
    "ASSIGN": "':='",
    "TASK_VAR": "TASK VAR",
    "TASK_PERS": "TASK PERS",
    "SEMICOLON": "';'",
    "COLON": "':'",
    "COMMA": "','",
    "DOT": "'.'",
    "LPAR": "'('",
    "RPAR": "')'",
    "LBRACE": "'{'",
    "RBRACE": "'}'",
    "LSQB": "'['",
    "RSQB": "']'",
    "BACKSLASH": "'\\'",
    "PERCENT": "'%'",
    "QMARK": "'?'",
    "VBAR": "'|'",
    "$END": "the end of the text",
}


TOO_DEEP = "the text is nested too deeply: divide long expressions and statements within statements."
LONGEST_MODULE = 500_000  # characters; a longer one takes more memory than the rest of the controller


def parse_module(text: str, filename: str) -> Module:
    """Parse one module.

    Raises:
        RapidSyntaxError: with file, line, column, what was found and what would be allowed.
    """
    if len(text) > LONGEST_MODULE:
        sentence = f"a module has up to {LONGEST_MODULE} characters, this one has {len(text)}: divide it."
        raise RapidSyntaxError(sentence, filename=filename, line=1, column=1)
    module: Module = _remembered(text, "module", filename)
    return module.read_from(filename, text)


def parse_parameters(text: str) -> tuple[Parameter, ...]:
    r"""Parse a parameter list as it stands between the parentheses of a routine: `num x, \switch a | \switch b`."""
    if not text.strip():
        return ()
    parameters: tuple[Parameter, ...] = _checked(_parse(text, "parameters"), "<parameters>")
    return parameters


LONGEST_EXPRESSION = 16_000  # characters of a value that stands alone, as clients write them


def parse_expression(text: str, filename: str = "<value>") -> Expression:
    if len(text) > LONGEST_EXPRESSION:
        sentence = f"a value has up to {LONGEST_EXPRESSION} characters, this one has {len(text)}."
        raise RapidSyntaxError(sentence, filename=filename, line=1, column=1)
    expression: Expression = _remembered(text, "expression", filename)
    return expression


def parse_reference(text: str) -> Reference:
    """Parse the path to a datum: `name`, `name{1}`, `name.component`."""
    reference: Reference = _checked(_parse(text, "reference"), "<symbol>")
    return reference


@dataclass(frozen=True, slots=True)
class Mistake:
    """Why a text is not RAPID; it keeps nothing of the parser alive, as an exception with its traceback would."""

    sentence: str
    line: int
    column: int


@functools.cache
def _language() -> Lark:
    return Lark.open(
        "grammar.lark",
        rel_to=__file__,
        parser="lalr",
        lexer="basic",
        start=["module", "parameters", "expression", "reference"],
        propagate_positions=True,
        maybe_placeholders=True,
    )


def _remembered(text: str, start: str, filename: str) -> Any:
    """What the text was parsed to before, a syntax error too: who asks again does not wait again."""
    key = (text, start)
    result = _results.get(key)
    if result is None:
        result = _parse(text, start)
        _make_room(len(text))
        _results[key] = result
    return _checked(result, filename)


def _checked(result: Any, filename: str) -> Any:
    if isinstance(result, Mistake):
        raise RapidSyntaxError(result.sentence, filename=filename, line=result.line, column=result.column)
    return result


_results: dict[tuple[str, str], Any] = {}
MOST_RESULTS, LONGEST_RESULTS = 64, 1_000_000  # texts, characters; a tree takes a hundred times as much memory


def _make_room(length: int) -> None:
    keys = list(_results)  # other threads parse, too
    total = length + sum(len(text) for text, _ in keys)
    while keys and (len(keys) >= MOST_RESULTS or total > LONGEST_RESULTS):
        oldest = keys.pop(0)
        total -= len(oldest[0])
        _results.pop(oldest, None)


def _parse(text: str, start: str) -> Any:
    """The tree of a text, or the mistake in it."""
    read: list[Any] = []
    try:
        read.append(_language().parse(text, start=start))
        return TreeBuilder().transform(read[0])
    except UnexpectedInput as error:
        if isinstance(error, UnexpectedToken) and error.interactive_parser is not None:
            read = error.interactive_parser.parser_state.value_stack
        return _mistake(error, text)
    except (VisitError, RecursionError) as error:
        if isinstance(getattr(error, "orig_exc", error), RecursionError):
            return Mistake(TOO_DEEP, 1, 1)
        if not isinstance(error, VisitError) or not isinstance(error.orig_exc, NotAllowed):
            raise
        return Mistake(str(error.orig_exc), error.orig_exc.line, error.orig_exc.column)
    finally:
        _take_apart(read)


def _take_apart(nodes: list[Any]) -> None:
    """Free what the parser has read piece by piece: to free all at once lets other threads wait for many cycles."""
    while nodes:
        node = nodes.pop()
        if isinstance(node, Tree):
            nodes.extend(node.children)
            node.children.clear()


def _mistake(error: UnexpectedInput, text: str) -> Mistake:
    line, column = error.line, error.column
    if isinstance(error, UnexpectedToken) and error.token.type == "$END":
        lines = text.splitlines() or [""]
        line, column = len(lines), len(lines[-1]) + 1
    return Mistake(_sentence(error, text), line, column)


def _sentence(error: UnexpectedInput, text: str) -> str:
    if not isinstance(error, UnexpectedToken):
        sign = text[error.pos_in_stream or 0]
        return "the string does not end on its line." if sign == '"' else f"RAPID has no sign '{sign}'."
    found = "the end of the text" if error.token.type == "$END" else f"'{error.token}'"
    words = _grouped({name.lstrip("_") for name in error.accepts or error.expected})
    allowed = words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"
    return f"found {found} where {allowed} is allowed."


def _grouped(names: set[str]) -> list[str]:
    """What may stand here in words a person uses, groups first."""
    words = []
    rest = set(names)
    for word, members in GROUPS.items():
        if names >= members:
            words.append(word)
            rest -= members
    return words + sorted(WORDS.get(name, name) for name in rest)
