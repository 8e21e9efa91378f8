"""The parser: RAPID text to syntax tree, with errors a person can act on."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

from lark import Lark, Tree, UnexpectedToken
from lark.exceptions import UnexpectedInput, VisitError

from yumi.rapid.errors import RapidSyntaxError
from yumi.rapid.syntax import Expression, Module, Parameter, Reference
from yumi.rapid.tree import NotAllowed, TreeBuilder

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
