"""Refuses words that only this project used, and lines of pages that are hard to compare; `make check` runs it.

Each word, in identifiers, user-visible text and docs, has one that ROS and ABB engineers search for:
docs/reference/glossary.md. A line of a page holds one sentence at most, so that a change shows which one has changed,
and is at most 120 columns long, tables and the addresses of links apart.
"""

from __future__ import annotations

import io
import re
import subprocess
import sys
import tokenize
from pathlib import Path

WORDS = {
    "fast lines": "control loop, control process",
    "fast line": "control loop, control process",
    "arm line": "control loop",
    "mailbox": "buffer",
    "request desk": "command handler",
    "fault desk": "fault injection",
    "rehearsal": "(removed)",
    "rehearse": "try, inject",
    "glance": "poll period",
    "pursuit": "tracking filter",
    "stranger": "foreign client",
    "strangers": "foreign clients",
    "straggler": "late packet",
    "stragglers": "late packets",
    "cabinet": "controller panel",
    "lone": "single-arm",
    "nobody": "no one is needed: name the part that does it, or none",
    "somebody": "a user, another client",
    "whoever": "the client that, the caller",
    "shall": "must",
    "told": "reported, notified",
    "tells": "reports",
    "hands": "grippers",
    "hand io": "gripper I/O",
    "guided motion": "EGM",
    "is no joint of": "is not a joint of",
    "wanted ahead": "commanded offset",
    "admitted": "limited, sent",
    "calming": "stopping",
    "brisk": "(removed)",
    "admit": "limit",
    "admits": "limits",
    "bell": "event",
    "desk": "command handler",
    "walks": "samples, iterates over",
    "walked": "sampled, iterated over",
    "walking": "sampling, iterating over",
    "joining": "blending",
    "forecast": "target predictor",
    "swings": "oscillates",
    "swinging": "oscillating",
    "partner": "other arm",
    "partners": "other arms",
    "lives": "lifecycle, or name the state",
}
"""Each word or words, singular as written, with what stands in its place."""

PAGE_WORDS = {
    "piece": "segment",
    "pieces": "segments",
    "knows": "has, reads",
    "says": "reports, states, shows",
    "wants": "needs, takes",
}
"""The same for pages alone: in the code some are names still."""

FOLDERS = ("packages", "docs", "examples", "launch", "config", "*.md")
ALLOWED = {"docs/reference/glossary.md"}
"""Files that name the words to explain them."""

CHANGELOG = "CHANGELOG.md"
"""A release writes it."""

TERMS_OF_THE_FIELD = {("externally", "guided", "motion")}
"""Terms that contain one of the words and stay."""

COLUMNS = 120
_SENTENCES = re.compile(r"(?<![.…])(?<!\be\.g)(?<!\bi\.e)(?<!\bcf)[.!?][)\"”*_\]]* +(?=[(*\"“\[]*[A-Z`])")
_LEAD = re.compile(r"\s*(?:[-*+] |\d+[.)] )?(?:\*\*[^*]+\*\* )?")
"""What stands before the first sentence of a paragraph: the mark of a list, words in bold."""

_TARGET = re.compile(r"(?<=\])\([^)\s]+(?: \"[^\"]*\")?\)")
_CODE = re.compile(r"`[^`]+`")
_UNWRAPPED = re.compile(r"\s*(?:\||#|<|:::|!\[|\[!\[)")
"""How lines begin that are no text: tables, headings, comments, pictures."""

_TERMS = {tuple(words.split()): instead for words, instead in WORDS.items()}
_PAGE_TERMS = _TERMS | {(word,): instead for word, instead in PAGE_WORDS.items()}
_LONGEST = max(map(len, _PAGE_TERMS))
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def check(file: Path) -> list[str]:
    """Where ``file`` has one of the words, a line each."""
    text = file.read_text(encoding="utf-8")
    pieces = _python_pieces(text) if file.suffix == ".py" else enumerate(text.splitlines(), 1)
    terms = _PAGE_TERMS if file.suffix == ".md" and str(file) != CHANGELOG else _TERMS
    found = []
    for line, piece in pieces:
        words = [word.lower() for word in _WORD.findall(piece)]
        for begin in range(len(words)):
            for count in range(1, _LONGEST + 1):
                if any(tuple(words[begin + count - len(term) : begin + count]) == term for term in TERMS_OF_THE_FIELD):
                    continue
                instead = terms.get(tuple(words[begin : begin + count]))
                if instead and begin + count <= len(words):
                    term = " ".join(words[begin : begin + count])
                    found.append(f"{file}:{line}: {term!r} in {piece.strip()[:80]!r}; say {instead}")
    return found


def check_lines(file: Path) -> list[str]:
    """Where a page has a line that is too long or holds two sentences, a line each."""
    found, fence = [], ""
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
        mark = re.match(r" *(`{3,}|~{3,})", line)
        if fence or mark:
            fence = "" if fence and line.strip() == fence else fence or (mark[1] if mark else "")
            continue
        if _UNWRAPPED.match(line):
            continue
        if len(_TARGET.sub("", line)) > COLUMNS:
            found.append(f"{file}:{number}: {len(line)} columns; a line of a page has at most {COLUMNS}")
        text = _CODE.sub(lambda code: "`" + "x" * (len(code[0]) - 2) + "`", _TARGET.sub("", line))
        if _SENTENCES.search(text, _LEAD.match(text).end()):  # type: ignore[union-attr] # it matches nothing, too
            found.append(f"{file}:{number}: two sentences; each begins a line of its own")
    return found


def _python_pieces(text: str) -> list[tuple[int, str]]:
    """Names, comments and strings of a module, each with its line."""
    kinds = (tokenize.NAME, tokenize.COMMENT, tokenize.STRING)
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return [
        (token.start[0] + number, line)
        for token in tokens
        if token.type in kinds
        for number, line in enumerate(token.string.splitlines())
    ]


def main() -> int:
    """Print every finding; 1 where there is one."""
    listed = subprocess.run(["git", "ls-files", "--", *FOLDERS], check=True, capture_output=True, text=True).stdout
    files = [
        Path(name) for name in listed.splitlines() if name not in ALLOWED and name.endswith((".py", ".md", ".yaml"))
    ]
    found = [line for file in files for line in check(file)]
    found += [line for file in files if file.suffix == ".md" and str(file) != CHANGELOG for line in check_lines(file)]
    sys.stdout.write("".join(f"{line}\n" for line in found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
