"""Finds decisions that are too long or lack one of their four parts, and a list of them that is out of date.

``make check`` runs it; ``python setup/check_decisions.py write`` writes the list.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "explanation" / "decisions"
LIST = FOLDER / "README.md"
PARTS = ("Status", "Context", "Decision", "Consequences")
WORDS = 300

_PART = re.compile(r"^\*\*(\w+)\.\*\*", re.MULTILINE)
_TITLE = re.compile(r"# (\d+)\. (.+)")
_STATUS = re.compile(r"^\*\*Status\.\*\* ((?:Accepted|Superseded by \[).*?)\.?\n\n", re.MULTILINE | re.DOTALL)
_HEAD = f"""# Decisions

One page each, in four parts (status, context, decision, consequences) of at most {WORDS} words together.
Rules and figures beyond that are in the reference and explanation pages, to which a decision links.

| | decision | status |
|---|---|---|
"""


def pages() -> list[Path]:
    """The decisions, in the order of their numbers."""
    return sorted(FOLDER.glob("[0-9]*.md"))


def check(page: Path) -> list[str]:
    """What is wrong with a decision, a line each."""
    text = page.read_text(encoding="utf-8")
    found = []
    title = _TITLE.match(text)
    if title is None or f"{int(title[1]):04}-" != page.name[:5]:
        found.append(f"the first line is not '# {int(page.name[:4])}. ' and a title")
    if (words := len(text.split())) > WORDS:
        found.append(f"{words} words; a decision has at most {WORDS}, the rest belongs into a reference page")
    if (parts := tuple(part for part in _PART.findall(text) if part in PARTS)) != PARTS:
        found.append(f"the parts are {', '.join(parts) or 'none'}; give {', '.join(PARTS)}, each as '**Context.** …'")
    elif _STATUS.search(text) is None:
        found.append("the status is neither 'Accepted' nor 'Superseded by [number](page)'")
    return [f"{page.relative_to(FOLDER.parents[2])}: {each}" for each in found]


def listed() -> str:
    """The list of all decisions, which are without fault."""
    rows = []
    for page in pages():
        text = page.read_text(encoding="utf-8")
        title, status = _TITLE.match(text), _STATUS.search(text)
        if title and status:
            words = " ".join(status[1].split())
            rows.append(f"| {title[1]} | [{title[2]}]({page.name}) | {words[0].lower()}{words[1:]} |\n")
    return _HEAD + "".join(rows)


def main() -> int:
    """Print every finding; 1 where there is one."""
    if sys.argv[1:] == ["write"]:
        LIST.write_text(listed(), encoding="utf-8")
    found = [line for page in pages() for line in check(page)]
    if not found and LIST.read_text(encoding="utf-8") != listed():
        found.append(f"{LIST.relative_to(FOLDER.parents[2])} is out of date: python setup/check_decisions.py write")
    sys.stdout.write("".join(f"{line}\n" for line in found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
