"""What ``make docs`` adds to the pages of docs/: MkDocs calls these functions (``hooks`` in mkdocs.yml).

Pages are written for the repository, where a link may lead to a source file. In the site such a link becomes the file's
name. One page more is in the site, CONTRIBUTING.md. The first page begins as README.md does. Long tables are made from
the code when the site is.
"""

from __future__ import annotations

import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
CONTRIBUTING = "contributing.md"
GENERATED = (CONTRIBUTING,)
"""Pages that are made when the site is."""

_TABLES = re.compile(r"<!-- Written by setup/(\w+)\.py when the site is built\. -->\n?")
_README = "<!-- Written by setup/docs_site.py: the beginning of README.md. -->"
_LINK = re.compile(r"\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?(?: \"([^\"]*)\")?\)")


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
        is_code = words.startswith("`") and words.endswith("`")
        if is_code and words.strip("`") in name:
            return words
        if is_code:
            return f'{words}{{ title="{name}{f": {found[4]}" if found[4] else ""}" }}'
        return f"{words} `{name}`"

    return indented(_rows(_LINK.sub(link, text)))


def _rows(text: str) -> str:
    """The text with bare bars in the code of tables: GitHub wants a backslash before them, MkDocs shows it."""
    lines = text.split("\n")
    for index, line in enumerate(lines):
        if line.lstrip().startswith("|"):
            lines[index] = re.sub(r"`[^`]+`", lambda code: code[0].replace("\\|", "|"), line)
    return "\n".join(lines)


def indented(text: str) -> str:
    """The text with what belongs to a list item four columns in, as MkDocs wants it; GitHub counts from its words."""
    lines, columns, fence = [], list[int](), ""  # columns where the words of the items around a line begin
    for line in text.split("\n"):
        words = line.lstrip(" ")
        column = len(line) - len(words)
        if words and not fence:
            while columns and column < columns[-1]:
                columns.pop()
        shift = 4 * len(columns) - (columns[-1] if columns else 0)
        lines.append(" " * (column + shift) + words if words and (not fence or column >= -shift) else line)
        mark = re.match(r"`{3,}|~{3,}", words)
        if fence:
            fence = "" if words.rstrip() == fence else fence
        elif mark:
            fence = mark[0]
        elif item := re.match(r"(?:[-*+]|\d+\.) +", words):
            columns.append(column + len(item[0]))
    return "\n".join(lines)


_QUESTION = re.compile(r'(\w+)\{"([^"]+)"\} -- yes --> (\w+)(?:\(\[([^\]]+)\]\))?')
_REMEDY = re.compile(r'(\w+) -- no --> \w+\["([^"]+)"\]')
_ROW, _WIDTH, _GAP = 58, 330, 70  # of a box in the chart [px]


def chart(source: str) -> str:
    """A chain of questions in Mermaid's language as SVG, each with what to do where the answer is no.

    GitHub draws Mermaid; the site would have to load a program from another host.

    Raises:
        ValueError: it is another chart.
    """
    boxes, y = [], 2
    remedies: dict[str, str] = {}
    questions: list[tuple[str, str, str | None]] = []
    for line in filter(None, (each.strip() for each in source.splitlines()[1:])):
        if question := _QUESTION.fullmatch(line):
            questions.append((question[1], question[2], question[4]))
        elif remedy := _REMEDY.fullmatch(line):
            remedies[remedy[1]] = remedy[2]
        else:
            raise ValueError(f"a chart on the site is a chain of questions, which this is none of: {line}")

    def box(x: int, text: str, radius: int) -> str:
        words = (
            f'<foreignObject x="{x}" y="{y}" width="{_WIDTH}" height="{_ROW - 18}"><div class="chart">{text}</div>'
            "</foreignObject>"
        )
        return f'<rect x="{x}" y="{y}" width="{_WIDTH}" height="{_ROW - 18}" rx="{radius}"/>{words}'

    for name, text, end in questions:
        boxes += [box(2, text, 18), box(2 + _WIDTH + _GAP, remedies[name], 2)]
        middle, below = y + (_ROW - 18) // 2, y + _ROW - 18
        boxes.append(f'<path d="M{2 + _WIDTH} {middle}h{_GAP - 4}" marker-end="url(#to)"/>')
        boxes.append(f'<text x="{_WIDTH + _GAP // 2 - 6}" y="{middle - 5}">no</text>')
        boxes.append(f'<path d="M{2 + _WIDTH // 2} {below}v14" marker-end="url(#to)"/>')
        boxes.append(f'<text x="{10 + _WIDTH // 2}" y="{below + 14}">yes</text>')
        y += _ROW
        if end:
            boxes.append(box(2, f"<b>{end}</b>", 18))
            y += _ROW
    head = '<marker id="to" viewBox="0 0 6 6" refX="5" refY="3" markerWidth="6" markerHeight="6" orient="auto">'
    return (
        f'<svg class="chart" viewBox="0 0 {2 * _WIDTH + _GAP + 4} {y}" xmlns="http://www.w3.org/2000/svg">'
        f'<defs>{head}<path class="tip" d="M0 0L6 3L0 6z"/></marker></defs>{"".join(boxes)}</svg>'
    )


def with_tables(text: str) -> str:
    """The page's text with the tables that its comments name; each is too long for a page that a person edits."""

    def written(found: re.Match[str]) -> str:
        sys.path.insert(0, str(Path(__file__).parent))
        try:
            return str(import_module(found[1]).tables())
        finally:
            del sys.path[0]

    return _TABLES.sub(written, text)


def contributing_page() -> str:
    """CONTRIBUTING.md as a page."""
    return _as_in_docs((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))


def with_readme(text: str) -> str:
    """The first page's text with the beginning of README.md, until its first heading, in place of a comment."""
    beginning = (ROOT / "README.md").read_text(encoding="utf-8").partition("\n")[2].partition("\n## ")[0]
    return text.replace(_README, _as_in_docs(beginning.strip()))


def _as_in_docs(text: str) -> str:
    """A page of the clone's root as if it stood in docs/: rewritten() makes names of links that lead out of there."""
    return re.sub(r"\]\((docs/)?(?=[\w.])(?!\w+:)", lambda link: "](" if link[1] else "](../", text)


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

    files.append(File.generated(config, CONTRIBUTING, content=contributing_page()))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Rewrite a page before it is rendered."""
    markdown = rewritten(with_readme(with_tables(markdown)), ROOT / "docs" / page.file.src_uri)
    return re.sub(r"```mermaid\n(.*?)```", lambda found: chart(found[1]), markdown, flags=re.DOTALL)


def on_page_content(html: str, page: Any, config: Any, files: Any) -> str:
    """Without the colons before an example in a docstring, and the roles of names, which Markdown does not know."""
    return re.sub(r":(?:attr|class|data|exc|func|meth|mod):(?=<code)", "", html.replace("<p>::</p>", ""))
