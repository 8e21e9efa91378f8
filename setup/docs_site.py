"""What ``make docs`` adds to the pages of docs/: MkDocs calls these functions (``hooks`` in mkdocs.yml).

Pages are written for the repository, where a link may lead to a source file. In the site such a link becomes the file's
name. Two pages exist in the site alone: the index of messages, collected from the sources, and CONTRIBUTING.md.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
MESSAGES = "reference/messages.md"
CONTRIBUTING = "contributing.md"
GENERATED = (MESSAGES, CONTRIBUTING)
"""Pages that are made when the site is."""

_LINK = re.compile(r"\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?(?: \"([^\"]*)\")?\)")
_SHORTEST = 12  # letters; below that it is a word and no message


@dataclass(frozen=True, order=True)
class Message:
    """A message that a user can meet.

    Attributes:
        error: class of the error, e.g. ``RobotNotReady``.
        text: its words; ``…`` stands for what differs.
        file: where it is raised, from the clone's root.
    """

    error: str
    text: str
    file: str


def messages(source: Path = ROOT / "src" / "yumi") -> list[Message]:
    """Every message of an error that the sources raise, in the order of the errors' names."""
    kinds = set(error_classes(source / "errors.py"))
    found = set()
    for file in sorted(source.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in kinds):
                continue
            for text in (_text(each) for each in node.args[:1]):
                # Without enough words of its own it is a text from elsewhere, or has nothing to search for.
                if sum(letter.isalpha() for letter in text) >= _SHORTEST:
                    found.add(Message(node.func.id, text, str(file.relative_to(source.parents[1]))))
    return sorted(found)


def error_classes(file: Path = ROOT / "src" / "yumi" / "errors.py") -> dict[str, str]:
    """The errors of the package and the first line of what each means."""
    classes = [node for node in ast.parse(file.read_text(encoding="utf-8")).body if isinstance(node, ast.ClassDef)]
    return {each.name: (ast.get_docstring(each) or "").partition("\n")[0] for each in classes}


def messages_page() -> str:
    """The index of messages as a page."""
    found = messages()
    page = [
        "# Messages and what to do",
        "",
        f"The {len(found)} messages with which this package refuses or fails, collected from its sources when this "
        "site was built. `…` stands for a value. Search for a few words of yours (press `s`): each says what was "
        "wrong, what is allowed and, where there is something to do, what. Conditions for moving have a [page of their "
        "own](readiness.md), events of the controller are explained in [recovery](recovery.md).",
        "",
    ]
    for error, meaning in error_classes().items():
        own = [each for each in found if each.error == error]
        if own:
            page += [f"## {error}", "", meaning, "", "| message | raised in |", "|---|---|"]
            page += [f"| {_escaped(each.text)} | `{each.file}` |" for each in own]
            page.append("")
    return "\n".join(page)


def rewritten(text: str, page: Path) -> str:
    """The page's text, where links that lead out of docs/ are names; of code, the file is shown on hovering over it."""

    def link(found: re.Match[str]) -> str:
        words, target = found[1], found[2]
        if "://" in target or target.startswith("mailto:"):
            return found[0]
        file = (page.parent / target).resolve()
        if file.is_relative_to(ROOT / "docs"):
            return found[0]
        name = str(file.relative_to(ROOT))
        if words.strip("`") in name:
            return words
        if words.startswith("`") and words.endswith("`"):
            return f'{words}{{ title="{name}{f": {found[4]}" if found[4] else ""}" }}'
        return f"{words} (`{name}` in the repository)"

    return _LINK.sub(link, text)


def on_config(config: Any) -> Any:
    """Put every decision into the navigation, by its title."""
    for _, sections in (next(iter(each.items())) for each in config.nav):
        for section in sections if isinstance(sections, list) else ():
            if "Decisions" in section:
                section["Decisions"] += [{title: page} for title, page in decisions().items()]
    return config


def decisions() -> dict[str, str]:
    """The decision pages: titles and paths in docs/."""
    files = sorted((ROOT / "docs" / "explanation" / "decisions").glob("0*.md"))
    return {
        file.read_text(encoding="utf-8").partition("\n")[0].lstrip("# "): f"explanation/decisions/{file.name}"
        for file in files
    }


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that exist in the site alone."""
    from mkdocs.structure.files import File  # noqa: PLC0415 - the tests of this file do not need MkDocs

    contributing = (
        (ROOT / "CONTRIBUTING.md")
        .read_text(encoding="utf-8")
        .replace("](docs/", "](")
        .replace("[CHANGELOG](CHANGELOG.md)", "`CHANGELOG.md`")
    )
    for name, content in ((MESSAGES, messages_page()), (CONTRIBUTING, contributing)):
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Rewrite a page before it is rendered."""
    return rewritten(markdown, ROOT / "docs" / page.file.src_uri)


def on_page_content(html: str, page: Any, config: Any, files: Any) -> str:
    """Without the colons before an example in a docstring, which Markdown does not know."""
    return html.replace("<p>::</p>", "")


def _text(node: ast.expr) -> str:
    """The words of a string, with ``…`` for each value in it."""
    return re.sub("(… ?)+", "… ", "".join(_parts(node))).replace("… .", "….").replace("… ,", "…,").strip()


def _parts(node: ast.expr) -> Iterator[str]:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        for value in node.values:
            yield from _parts(value)
    elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        yield from _parts(node.left)
        yield from _parts(node.right)
    else:
        yield "…"


def _escaped(text: str) -> str:
    for letter in "\\|<>*_[]{}":
        text = text.replace(letter, f"\\{letter}")
    return text.replace("\n", " ")


if __name__ == "__main__":
    sys.stdout.write(messages_page())
