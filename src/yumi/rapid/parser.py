"""The parser: RAPID text to syntax tree, with errors that say where, what was found and what is allowed instead.

Lark calls the methods of `TreeBuilder` while it parses, so that there is no parse tree beside the syntax tree.
Literals, which the controller prints and reads for values (reference/rws.md §6.5), are here, too.
"""

from __future__ import annotations

import functools
import math
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from lark import Lark, Token, Transformer, UnexpectedToken, v_args
from lark.common import LexerConf
from lark.exceptions import UnexpectedInput
from lark.lexer import Lexer
from lark.parsers.lalr_analysis import Shift

from yumi.rapid import ast as s
from yumi.rapid.ast import Aggregate, Expression, Literal, Module, Parameter, Reference, Unary
from yumi.rapid.types import (
    BOOL,
    DNUM,
    LONGEST_STRING,
    NUM,
    STRING,
    ArrayType,
    AtomicType,
    RapidRuntimeError,
    RapidSyntaxError,
    RapidValueError,
    RecordType,
    Type,
    described,
    resolved,
)

NodeType = TypeVar("NodeType", bound=s.Node)
Clause = tuple[str, Any]
ESCAPE = re.compile(r'""|\\\\|\\[0-9A-Fa-f]{2}')
BASES = {"0x": 16, "0b": 2, "0o": 8}
LONGEST_NAME = 32  # characters
LONGEST_MODULE = 2_000_000  # characters; a longer one takes more memory than the rest of the controller
LONGEST_EXPRESSION = 16_000  # characters of a value that stands alone, as clients write them
SHALLOW_STACK, LONG_ROW = 60, 21  # of the parser's states; of operands and operators
DEEPEST_NESTING = 200  # of statements and expressions: those who walk the tree do it by recursion
MOST_RESULTS, LONGEST_RESULTS = 64, 3_000_000  # remembered texts, their characters; a tree takes much more memory
ATTRIBUTES = frozenset(("SYSMODULE", "NOVIEW", "NOSTEPIN", "VIEWONLY", "READONLY"))


class NotAllowed(Exception):
    """The grammar takes it, but RAPID does not."""

    def __init__(self, sentence: str, where: Token | s.Node) -> None:
        super().__init__(sentence)
        self.line, self.column = where.line or 1, where.column or 1


def _of(kind: type[NodeType], items: Sequence[object]) -> tuple[NodeType, ...]:
    return tuple(item for item in items if isinstance(item, kind))


def _tuple(self: TreeBuilder, *items: Any) -> tuple[Any, ...]:
    return items


def _position(token: Token) -> int:
    return (token.line or 1) << 16 | min(token.column or 1, s.LARGEST_COLUMN)


def _node(kind: type[NodeType], token: Token, *fields: Any) -> NodeType:
    """A node that begins at a token; the names among its fields become plain strings."""
    return kind(*(str(each) if type(each) is Token else each for each in fields), position=_position(token))


def _statement(kind: type[NodeType]) -> Any:
    """The method for a statement that begins with a keyword and whose other parts are the fields of its node."""

    def build(self: TreeBuilder, keyword: Token, *parts: Any) -> NodeType:
        return _node(kind, keyword, *parts)

    return build


class _Prefixed:
    """An operand with NOT or a sign before it."""

    __slots__ = ("operand", "operator")

    def __init__(self, operator: Token, operand: Any) -> None:
        self.operator = operator
        self.operand = operand


class _Precedence:
    """Makes a tree of operands and operators in a row.

    RAPID overview, expressions: `* / DIV MOD` before `+ -` before `< > <> <= >= =` before AND before XOR, OR and NOT.
    NOT reaches as far as the ANDs that follow it: NOT a AND b is NOT (a AND b).
    """

    __slots__ = ("index", "row")

    def __init__(self, row: list[Any]) -> None:
        self.row = row
        self.index = 0

    def expression(self) -> s.Expression:
        left = self._logical()
        while (operator := self._next(("OR", "XOR"))) is not None:
            left = s.Binary(operator.upper(), left, self._logical(), position=left.position)
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
        left = self._term()
        while (operator := self._next(("PLUS", "MINUS"))) is not None:
            left = s.Binary(operator.upper(), left, self._term(), position=left.position)
        return left

    def _term(self) -> s.Expression:
        left = self._factor()
        while (operator := self._next(("TIMES", "DIVIDE", "DIV", "MOD"))) is not None:
            left = s.Binary(operator.upper(), left, self._factor(), position=left.position)
        return left

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
            if name.upper() not in ATTRIBUTES:
                sentence = f"a module has no attribute '{name}'; there are {', '.join(sorted(ATTRIBUTES))}."
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

    def procedure(
        self, local: Token | None, name: Token, parameters: tuple[s.Parameter, ...] | None, *body: Any
    ) -> s.Routine:
        return self._routine(s.RoutineKind.PROC, local, None, name, parameters, body)

    def function(self, local: Token | None, type_name: Token, name: Token, parameters: Any, *body: Any) -> s.Routine:
        return self._routine(s.RoutineKind.FUNC, local, type_name, name, parameters, body)

    def trap(self, local: Token | None, name: Token, *body: Any) -> s.Routine:
        return self._routine(s.RoutineKind.TRAP, local, None, name, None, body)

    def _routine(
        self,
        kind: s.RoutineKind,
        local: Token | None,
        return_type: Token | None,
        name: Token,
        parameters: tuple[s.Parameter, ...] | None,
        body: Sequence[Any],
    ) -> s.Routine:
        declared, block, *clauses = body
        found = dict(clauses)
        return _node(
            s.Routine,
            name,
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
        )

    locals = _tuple

    def backward(self, block: s.Block) -> Clause:
        return "backward", block

    def undo(self, block: s.Block) -> Clause:
        return "undo", block

    def handler(self, keyword: Token, numbers: tuple[s.Expression, ...] | None, block: s.Block) -> Clause:
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

    def parameter(self, mode: s.Mode | None, type_name: Token, name: Token, rank: int | None) -> s.Parameter:
        return _node(s.Parameter, name, name, type_name, mode or s.Mode.VALUE, rank or 0)

    def mode(self, word: Token) -> s.Mode:
        return s.Mode[word.upper()]

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
        if len(row) > LONG_ROW:
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
        base = BASES.get(token[:2].lower())
        try:
            value = float(token) if base is None else float(int(token[2:], base))
        except OverflowError:  # no number of RAPID's is that large: an error where it is stored
            value = math.inf
        return s.Literal(value, position=_position(token))

    def string(self, token: Token) -> s.Literal:
        r"""The text of a string: `""` is a quote, `\\` a backslash, `\5C` the character with that code."""
        value = token[1:-1]
        if "\\" in value or '"' in value:
            value = ESCAPE.sub(lambda m: m[0][0] if m[0][0] == m[0][1] else chr(int(m[0][1:], 16)), value)
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


_BUILDER = TreeBuilder()

# What is allowed at a position, from the general to the particular: a group that is allowed as a whole is named as one.
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


@functools.cache
def _grammar() -> str:
    return Path(__file__).with_name("grammar.lark").read_text(encoding="utf-8")


_BEGUN_STRING = re.compile(r'"(?:[^"\\\n]|""|\\\\|\\[0-9A-Fa-f]{2})*')  # a string of grammar.lark up to where it fails


class RapidLexer(Lexer):
    """Divides a text into the terminals of grammar.lark, twice as fast as Lark's own lexer: one match a token."""

    def __init__(self, settings: LexerConf) -> None:
        lines = [line for line in _grammar().splitlines() if line.startswith("%declare")]
        self._keywords = {word.lstrip("_"): word for line in lines for word in line.split()[1:]}
        ignored = set(settings.ignore)
        terminals = sorted(
            settings.terminals, key=lambda t: (-t.priority, -t.pattern.max_width, -len(t.pattern.value), t.name)
        )
        skipped = "|".join(each.pattern.to_regexp() for each in terminals if each.name in ignored)
        kept = "|".join(
            f"(?P<{each.name}>{each.pattern.to_regexp()})" for each in terminals if each.name not in ignored
        )
        self._skipped = re.compile(f"(?:{skipped})*")
        self._token = re.compile(f"(?:{kept})(?:{skipped})*")

    def lex(self, text: str) -> Iterator[Token]:  # type: ignore[override]  # Lark's interface of custom lexers
        place = 0
        for token in self.tokens(text):  # complete, as error messages need them
            place = text.index(token, place)
            yield Token(token.type, str(token), place, token.line, token.column, token.line, token.column, place)
            place += len(token)

    def tokens(self, text: str) -> Iterator[Token]:
        """The tokens with their type, line and column alone."""
        token_at, keywords, new, kind_of = self._token.match, self._keywords, str.__new__, Token
        begin = self._skipped.match(text)
        place = begin.end() if begin else 0
        line, line_start = 1 + text.count("\n", 0, place), text.rfind("\n", 0, place)
        length = len(text)
        while place < length:
            found = token_at(text, place)
            if found is None or found.lastgroup is None:
                sign = text[place]
                sentence = f"RAPID has no sign '{sign}'."
                if (string := _BEGUN_STRING.match(text, place)) is not None:
                    sentence = "the string does not end on its line."
                    if text[string.end() : string.end() + 1] == "\\":
                        place = string.end()
                        sentence = (
                            r"a backslash in a string is \\, or \ with the two hexadecimal digits of a character."
                        )
                raise NotAllowed(sentence, Token("", sign, place, line, place - line_start))
            kind = found.lastgroup
            value = found[kind]
            if kind == "IDENT":
                kind = keywords.get(value.upper(), kind)
            token = new(kind_of, value)
            token.type, token.line, token.column = kind, line, place - line_start
            yield token
            end = found.end()
            lines = text.count("\n", place, end)
            if lines:
                line += lines
                line_start = text.rfind("\n", place, end)
            place = end


class TableParser:
    """Lark's LALR(1) tables, executed without what they are not needed for: three times as fast for long modules."""

    def __init__(self, language: Lark) -> None:
        self.lexer = RapidLexer(language.parser.lexer_conf)
        parser = language.parser.parser.parser
        self._start_states, self._end_states = parser.parse_table.start_states, parser.parse_table.end_states
        # By state and terminal: the next state, or what to reduce: how many values, the rule's name and what it makes.
        self._shifts: dict[int, dict[str, int]] = {}
        self._reductions: dict[int, dict[str, tuple[int, str, Callable[[list[Any]], Any]]]] = {}
        for state, actions in parser.parse_table.states.items():
            shifts, reductions = self._shifts.setdefault(state, {}), self._reductions.setdefault(state, {})
            for token, (action, what) in actions.items():
                name = sys.intern(str(token))  # Lark's keys compare slowly
                if action is Shift:
                    shifts[name] = what
                else:
                    rule = sys.intern(str(what.origin.name))
                    reductions[name] = (len(what.expansion), rule, parser.callbacks[what])

    def parse(self, text: str, start: str) -> tuple[Any, int] | None:
        """The tree of a text and how deep the parser's stack was; None where the text does not fit the grammar."""
        states, deepest = [self._start_states[start]], 0
        values: list[Any] = []
        all_shifts, all_reductions, end = self._shifts, self._reductions, self._end_states[start]
        for token in self.lexer.tokens(text):
            kind, state = token.type, states[-1]
            while (following := all_shifts[state].get(kind)) is None:
                reduction = all_reductions[state].get(kind)
                if reduction is None:
                    return None
                count, name, make = reduction
                if count:
                    parts = values[-count:]
                    del states[-count:], values[-count:]
                else:
                    parts = []
                values.append(make(parts))
                state = all_shifts[states[-1]][name]
                states.append(state)
            states.append(following)
            values.append(token)
            deepest = max(deepest, len(states))
        while states[-1] != end:
            reduction = all_reductions[states[-1]].get("$END")
            if reduction is None:
                return None
            count, name, make = reduction
            parts = values[len(values) - count :]
            del states[len(states) - count :], values[len(values) - count :]
            values.append(make(parts))
            states.append(all_shifts[states[-1]][name])
        return values[-1], deepest


@functools.cache
def _language() -> Lark:
    return Lark(
        _grammar(),
        parser="lalr",
        lexer=RapidLexer,
        start=["module", "parameters", "expression", "reference"],
        maybe_placeholders=True,
        transformer=_BUILDER,
    )


@functools.cache
def _table_parser() -> TableParser:
    return TableParser(_language())


def parse_module(text: str, filename: str) -> Module:
    """Parse one module; raises RapidSyntaxError."""
    if len(text) > LONGEST_MODULE:
        sentence = f"a module has up to {LONGEST_MODULE} characters, this one has {len(text)}: divide it."
        raise RapidSyntaxError(sentence, filename=filename, line=1, column=1)
    module: Module = _remembered(text.removesuffix("\x1a"), "module", filename)  # which DOS wrote at the end
    return module.read_from(filename, text)


def parse_parameters(text: str) -> tuple[Parameter, ...]:
    r"""Parse a parameter list as it stands between the parentheses of a routine: `num x, \switch a | \switch b`."""
    if not text.strip():
        return ()
    parameters: tuple[Parameter, ...] = _checked(_parse(text, "parameters"), "<parameters>")
    return parameters


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


_results: dict[tuple[str, str], Any] = {}


def _remembered(text: str, start: str, filename: str) -> Any:
    """What the text was parsed to before, a mistake too: a long module takes seconds."""
    key = (text, start)
    result = _results.get(key)
    if result is None:
        result = _parse(text, start)
        keys = list(_results)  # other threads parse, too
        total = len(text) + sum(len(each) for each, _ in keys)
        while keys and (len(keys) >= MOST_RESULTS or total > LONGEST_RESULTS):
            oldest = keys.pop(0)
            total -= len(oldest[0])
            _results.pop(oldest, None)
        _results[key] = result
    return _checked(result, filename)


def _checked(result: Any, filename: str) -> Any:
    if isinstance(result, Mistake):
        raise RapidSyntaxError(result.sentence, filename=filename, line=result.line, column=result.column)
    return result


def _parse(text: str, start: str) -> Any:
    """The tree of a text, or the mistake in it."""
    try:
        found = _table_parser().parse(text, start)
        if found is None:  # Lark says why
            tree: Any = _language().parse(text, start=start)
            _check_nesting(tree)
        else:
            tree, depth = found
            if depth > SHALLOW_STACK or _BUILDER.has_long_rows:  # else it cannot be nested that deeply
                _check_nesting(tree)
    except UnexpectedInput as error:
        return _mistake(error, text)
    except NotAllowed as error:
        return Mistake(str(error), error.line, error.column)
    return tree


def _check_nesting(tree: object) -> None:
    rest = [(tree, 0)]
    while rest:
        node, depth = rest.pop()
        if isinstance(node, tuple):
            rest += [(each, depth) for each in node]
        elif isinstance(node, s.Node):
            if depth > DEEPEST_NESTING:
                sentence = "the text is nested too deeply: divide long expressions and statements within statements."
                raise NotAllowed(sentence, node)
            rest += [(getattr(node, name), depth + 1) for name in node.__slots__]


def _mistake(error: UnexpectedInput, text: str) -> Mistake:
    assert isinstance(error, UnexpectedToken), "the lexer raises its own errors"
    line, column, found = error.line, error.column, f"'{error.token}'"
    if error.token.type == "$END":
        lines = text.splitlines() or [""]
        line, column, found = len(lines), len(lines[-1]) + 1, "the end of the text"
    # What may stand here, in words: groups first, then what is left.
    names = {name.lstrip("_") for name in error.accepts or error.expected if "PLACEHOLDER" not in name}
    groups = {word: members for word, members in GROUPS.items() if names >= members}
    rest = names.difference(*groups.values())
    words = [*groups, *sorted(WORDS.get(name, name) for name in rest)]
    words = words or ["the end of the text"]
    allowed = words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"
    sentence = f"found {found} where {allowed} is allowed."
    if "SEMICOLON" in names:
        before = _last_line_before(text, line, column)
        if before < line:  # the statement went on at the next line
            sentence += f" Is a ';' missing after line {before}?"
    return Mistake(sentence, line, column)


def _last_line_before(text: str, line: int, column: int) -> int:
    """The line of the last token that begins before a place."""
    before = line
    for token in _table_parser().lexer.tokens(text):
        if (token.line, token.column) >= (line, column):
            break
        before = token.line or before
    return before


NUM_DIGITS = 6  # significant, of a num with decimals
DNUM_DIGITS = 15
LARGEST_EXACT = {"num": 8388608, "dnum": 4503599627370496}  # integers up to here are printed in full
SPECIAL = re.compile(r'["\\\x00-\x1f]')


def format_value(type_: Type, value: Any) -> str:
    """The value as a RAPID literal, without blanks: `[[600,0,225.3],[1,0,0,0]]`, `9E+09`, `TRUE`, `"text"`."""
    type_ = resolved(type_)
    if isinstance(type_, RecordType):
        parts = (format_value(t, v) for (_, t), v in zip(type_.components, value, strict=True))
        return f"[{','.join(parts)}]"
    if isinstance(type_, ArrayType):
        return f"[{','.join(format_value(type_.row, item) for item in value)}]"
    if type_ == BOOL:
        return "TRUE" if value else "FALSE"
    if type_ == STRING:
        escaped = SPECIAL.sub(lambda m: m[0] * 2 if m[0] in '"\\' else f"\\{ord(m[0]):02X}", value)
        return f'"{escaped}"'
    if type_ in (NUM, DNUM):
        return format_number(value, type_.name)
    raise RapidValueError(f"The type {type_.name} has no values that could be written down.")


def format_number(value: float, type_name: str = "num") -> str:
    if value == int(value) and abs(value) <= LARGEST_EXACT[type_name]:
        return str(int(value))
    return f"{value:.{NUM_DIGITS if type_name == 'num' else DNUM_DIGITS}G}"


def parse_value(type_: Type, text: str) -> Any:
    """The value a literal stands for.

    Raises:
        RapidValueError: the text is no literal, or one of another type.
    """
    try:
        return _value(type_, parse_expression(text))
    except RapidSyntaxError as error:
        raise RapidValueError(f"'{text}' is not a value of type {described(type_)}: {error}") from error
    except (_WrongType, RapidRuntimeError) as error:
        raise RapidValueError(f"'{text}' is not a value of type {described(type_)}. {error}".rstrip()) from error


class _WrongType(Exception):
    """Some part of a literal does not have the type that is needed there."""


def _value(type_: Type, node: Expression) -> Any:
    type_ = resolved(type_)
    if isinstance(type_, RecordType):
        items = _items(node, len(type_.components))
        return type_.value_class._make(_value(t, item) for (_, t), item in zip(type_.components, items, strict=True))
    if isinstance(type_, ArrayType):
        return tuple(_value(type_.row, item) for item in _items(node, type_.sizes[0]))
    if isinstance(type_, AtomicType):
        return type_.convert(_atom(type_, node))
    raise _WrongType(f"The type {type_.name} has no values that could be written down.")


def _items(node: Expression, count: int) -> tuple[Expression, ...]:
    if not isinstance(node, Aggregate) or len(node.items) != count:
        raise _WrongType(f"An aggregate of {count} in brackets is expected.")
    return node.items


def _atom(type_: AtomicType, node: Expression) -> Any:
    if isinstance(node, Unary) and node.operator in "+-" and type_ in (NUM, DNUM):
        if isinstance(node.operand, Unary):  # "--5" is an expression
            raise _WrongType("A number has one sign.")
        value = _atom(type_, node.operand)
        return -value if node.operator == "-" else value
    wanted = {"bool": bool, "string": str}.get(type_.name, float)
    if not isinstance(node, Literal) or type(node.value) is not wanted:
        raise _WrongType(f"A {type_.name} is expected.")
    return node.value
