"""A document of headings, paragraphs, tables and pictures, as Markdown and as one HTML page for light and dark."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape


@dataclass(frozen=True, slots=True)
class Heading:
    """Of a section; level 1 is the title."""

    text: str
    level: int = 2


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Plain text."""

    text: str


@dataclass(frozen=True, slots=True)
class Table:
    """Cells as text; the first column names the row, numbers are set flush right.

    Attributes:
        header: one text a column.
        rows: as long as the header.
        caption: what it shows.
        texts: columns of text, which are set flush left.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    texts: tuple[int, ...] = (0,)


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture in two files.

    Attributes:
        light, dark: where they are, from the document's folder.
        caption: what it shows, with units and the thesis's figure numbers.
    """

    light: str
    dark: str
    caption: str


Block = Heading | Paragraph | Table | Picture


def to_markdown(blocks: Iterable[Block]) -> str:
    """The document for GitHub, which knows pictures for both themes."""
    return "\n\n".join(_markdown(block) for block in blocks) + "\n"


def to_html(blocks: Sequence[Block], title: str) -> str:
    """The document as a page that needs nothing but its pictures; a list of its sections stands above the first."""
    sections = [block for block in blocks if isinstance(block, Heading) and block.level == 2]
    first = blocks.index(sections[0]) if sections else len(blocks)
    above, below = (list(map(_html, part)) for part in (blocks[:first], blocks[first:]))
    body = "\n".join([*above, *([_contents(sections)] if sections else []), *below])
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>{escape(title)}</title>\n'
        f"<style>{_STYLE}</style>\n</head>\n<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )


def _markdown(block: Block) -> str:
    if isinstance(block, Heading):
        return f"{'#' * block.level} {block.text}"
    if isinstance(block, Table):
        return _markdown_table(block)
    if isinstance(block, Picture):
        source = f'<source media="(prefers-color-scheme: dark)" srcset="{block.dark}">'
        return (
            f'<picture>{source}<img alt="{escape(block.caption)}" src="{block.light}"></picture>\n\n*{block.caption}*'
        )
    return block.text


def _markdown_table(table: Table) -> str:
    ruler = ["---" if index in table.texts else "---:" for index in range(len(table.header))]
    lines = [table.header, tuple(ruler), *table.rows]
    text = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
    return f"{text}\n\n*{table.caption}*" if table.caption else text


def _html(block: Block) -> str:
    if isinstance(block, Heading):
        return f'<h{block.level} id="{_anchor(block)}">{_text(block.text)}</h{block.level}>'
    if isinstance(block, Table):
        return _html_table(block)
    if isinstance(block, Picture):
        source = f'<source media="(prefers-color-scheme: dark)" srcset="{escape(block.dark)}">'
        image = f'<img alt="{escape(block.caption)}" src="{escape(block.light)}">'
        caption = f"<figcaption>{_text(block.caption)}</figcaption>"
        return f"<figure><picture>{source}{image}</picture>{caption}</figure>"
    return f"<p>{_text(block.text)}</p>"


def _text(text: str) -> str:
    """Escaped; what belongs to a number stays on its line."""
    return _BESIDE_NUMBER.sub("&nbsp;", escape(text))


def _anchor(heading: Heading) -> str:
    """What a link to the section ends with."""
    return re.sub("[^a-z0-9]+", "-", heading.text.lower()).strip("-")


def _contents(sections: Iterable[Heading]) -> str:
    links = "".join(f'<li><a href="#{_anchor(each)}">{_text(each.text)}</a></li>' for each in sections)
    return f'<nav aria-label="Contents"><ul>{links}</ul></nav>'


def _html_table(table: Table) -> str:
    head = "".join(_cell("th", index, cell, table) for index, cell in enumerate(table.header))
    lines = ["".join(_cell("td", index, cell, table) for index, cell in enumerate(row)) for row in table.rows]
    rows = "\n".join(f"<tr>{line}</tr>" for line in lines)
    # The caption stands outside of what scrolls sideways: on a narrow page it would be cut off with the columns.
    caption = f"<figcaption>{_text(table.caption)}</figcaption>" if table.caption else ""
    body = f"<table><thead><tr>{head}</tr></thead>\n<tbody>{rows}</tbody></table>"
    return f'<figure><div class="wide">{body}</div>{caption}</figure>'


def _cell(tag: str, index: int, text: str, table: Table) -> str:
    kind = ' class="text"' if index in table.texts else ""
    return f"<{tag}{kind}>{_text(text)}</{tag}>"


_BESIDE_NUMBER = re.compile(r"(?<=\d) (?=(?:ms|s|Hz|%|rad/s[²³]?|°/s)(?:\W|$))|(?<=\bP) (?== \d)|(?<=\bP =) (?=\d)")

_STYLE = """
:root { color-scheme: light dark; --paper: #ffffff; --ink: #1b1f24; --faint: #59636e; --line: #d1d9e0;
  --band: #f6f8fa; --link: #0969da; }
@media (prefers-color-scheme: dark) {
  :root { --paper: #0d1117; --ink: #e6edf3; --faint: #9198a1; --line: #3d444d; --band: #151b23;
    --link: #4493f8; }
}
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.55 system-ui, sans-serif; }
main { max-width: 62rem; margin: 0 auto; padding: 2rem 1.25rem 4rem; }
h1 { font-size: 1.9rem; line-height: 1.2; } h2 { margin-top: 2.6rem; border-bottom: 1px solid var(--line); }
p { max-width: 48rem; }
a { color: var(--link); } nav ul { padding-left: 1.2rem; columns: 22rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums; }
figcaption { color: var(--faint); font-size: .9rem; padding: .3rem 0; }
th, td { padding: .35rem .7rem; border-bottom: 1px solid var(--line); text-align: right; vertical-align: top; }
.text { text-align: left; } td:not(.text), td.text:not(:first-child, :last-child) { white-space: nowrap; }
tr { background: var(--paper); } tbody tr:nth-child(even) { background: var(--band); }
figure { margin: 1.5rem 0; } img { max-width: 100%; height: auto; }
th.text:first-child, td.text:last-child { min-width: 8.5rem; } h3 { margin-top: 1.8rem; }
@media (max-width: 40rem) { main { padding: 1rem .8rem 3rem; } table { font-size: .82rem; }
  th, td { padding: .3rem .4rem; } h1 { font-size: 1.5rem; } td.text:last-child { min-width: 13rem; }
  tr > .text:first-child { position: sticky; left: 0; background: inherit; }
  picture { display: block; overflow-x: auto; } img { max-width: none; width: 44rem; } }
"""
