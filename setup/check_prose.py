"""Finds code that takes a sentence for people apart, compares it, or replaces words in it.

Between the parts of the program travel codes and values (decision 53 in docs/explanation/decisions); only
``abb_protocols.catalogue`` makes sentences of them. A text is a sentence here when it comes from ``str(error)`` of an
error, from a function of the catalogue, or from an attribute that holds one. Run by ``make check``.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).parents[1]
WORDING = {"sentence", "clause", "remedy_of", "in_words"}  # functions of the catalogue
HOLDING = {"sentence", "reason", "cause", "error_string"}  # attributes
TAKING_APART = {
    *("split", "rsplit", "splitlines", "partition", "rpartition", "replace", "translate"),
    *("startswith", "endswith", "removeprefix", "removesuffix", "find", "index", "count"),
}
MODULES = {"re"}


def main() -> int:
    """Print what was found; 1 where something was."""
    files = [*sorted((ROOT / "packages").rglob("*.py"))]
    found = [
        f"{file.relative_to(ROOT)}:{line}: {what}"
        for file in files
        if "catalogue" not in file.parts
        for line, what in prose_in(file.read_text(encoding="utf-8"))
    ]
    for each in found:
        print(f"{each}; decide by the code or the values of the message")
    return 1 if found else 0


def prose_in(source: str) -> Iterator[tuple[int, str]]:
    """Lines on which ``source`` does something with a sentence, and what."""
    tree = ast.parse(source)
    for scope in ast.walk(tree):
        if isinstance(scope, ast.FunctionDef | ast.AsyncFunctionDef | ast.Module):
            yield from _Scope(scope).found()


class _Scope:
    """A function, or what is outside of functions; functions in it are scopes of their own."""

    def __init__(self, scope: ast.AST) -> None:
        self._nodes = list(_own_nodes(scope))
        self._caught = {each.name for each in self._nodes if isinstance(each, ast.ExceptHandler) and each.name}
        self._texts: set[str] = set()
        for node in self._nodes:
            if isinstance(node, ast.Assign) and self._is_text(node.value):
                self._texts |= {each.id for each in node.targets if isinstance(each, ast.Name)}

    def found(self) -> Iterator[tuple[int, str]]:
        for node in self._nodes:
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                owner = node.func.value
                if node.func.attr in TAKING_APART and self._is_text(owner):
                    yield node.lineno, f"{node.func.attr}() of a sentence"
                if isinstance(owner, ast.Name) and owner.id in MODULES and any(map(self._is_text, node.args)):
                    yield node.lineno, "a regular expression on a sentence"
            elif isinstance(node, ast.Compare):
                yield from self._compared(node)

    def _compared(self, node: ast.Compare) -> Iterator[tuple[int, str]]:
        sides = (node.left, *node.comparators)
        for operator, (left, right) in zip(node.ops, pairwise(sides), strict=True):
            if isinstance(operator, ast.In | ast.NotIn) and self._is_text(right):
                yield node.lineno, "a look for words in a sentence"
            is_equality = isinstance(operator, ast.Eq | ast.NotEq)
            if is_equality and (self._is_text(left) or self._is_text(right)) and not _is_empty(left, right):
                yield node.lineno, "a comparison of a sentence"

    def _is_text(self, node: ast.expr) -> bool:
        if isinstance(node, ast.Name):
            return node.id in self._texts
        if isinstance(node, ast.Attribute):
            return node.attr in HOLDING and isinstance(node.ctx, ast.Load)
        if isinstance(node, ast.Call):
            if isinstance(node.func, ast.Name):
                of_caught = any(isinstance(each, ast.Name) and each.id in self._caught for each in node.args)
                return node.func.id in WORDING or (node.func.id == "str" and of_caught)
            return isinstance(node.func, ast.Attribute) and self._is_text(node.func.value)  # .strip(), .lower()
        return False


def _own_nodes(scope: ast.AST) -> Iterator[ast.AST]:
    for child in ast.iter_child_nodes(scope):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        yield child
        yield from _own_nodes(child)


def _is_empty(*sides: ast.expr) -> bool:
    return any(isinstance(each, ast.Constant) and each.value == "" for each in sides)


if __name__ == "__main__":
    sys.exit(main())
