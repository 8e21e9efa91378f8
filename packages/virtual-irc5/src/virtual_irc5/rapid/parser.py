"""The parser: RAPID text to syntax tree, with errors that say where, what was found and what is allowed instead."""

from __future__ import annotations

import functools
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lark import Lark, Token, UnexpectedToken
from lark.common import LexerConf
from lark.exceptions import UnexpectedInput
from lark.lexer import Lexer
from lark.parsers.lalr_analysis import Shift

from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.ast import Expression, Module, Parameter, Reference
from virtual_irc5.rapid.tree_builder import BUILDER, NotAllowed
from virtual_irc5.rapid.types import RapidSyntaxError

LONGEST_MODULE = 2_000_000  # characters; a longer one takes more memory than the rest of the controller
_LONGEST_EXPRESSION = 16_000  # characters of a value that stands alone, as clients write them
_SHALLOW_STACK = 60  # of the parser's states
_DEEPEST_NESTING = 200  # of statements and expressions: those who walk the tree do it by recursion
_MOST_RESULTS, _LONGEST_RESULTS = 64, 3_000_000  # remembered texts, their characters; a tree takes much more memory


# What is allowed at a position, from the general to the particular: a group that is allowed as a whole is named as one.
_GROUPS = {
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
_WORDS = {
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
        transformer=BUILDER,
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


def parse_expression(text: str) -> Expression:
    if len(text) > _LONGEST_EXPRESSION:
        sentence = f"a value has up to {_LONGEST_EXPRESSION} characters, this one has {len(text)}."
        raise RapidSyntaxError(sentence, filename="<value>", line=1, column=1)
    expression: Expression = _remembered(text, "expression", "<value>")
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
        while keys and (len(keys) >= _MOST_RESULTS or total > _LONGEST_RESULTS):
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
            if depth > _SHALLOW_STACK or BUILDER.has_long_rows:  # else it cannot be nested that deeply
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
            if depth > _DEEPEST_NESTING:
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
    groups = {word: members for word, members in _GROUPS.items() if names >= members}
    rest = names.difference(*groups.values())
    words = [*groups, *sorted(_WORDS.get(name, name) for name in rest)]
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
