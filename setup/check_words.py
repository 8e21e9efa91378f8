"""Refuses words that only this project used, in identifiers, user-visible text and docs; `make check` runs it.

Each has a word that ROS and ABB engineers search for: docs/reference/glossary.md.
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
}
"""Each word or words, singular as written, with what stands in its place."""

FOLDERS = ("src", "docs", "examples", "launch", "config", "README.md")
ALLOWED = {"docs/reference/glossary.md"}
"""Files that name the words to explain them."""

TERMS_OF_THE_FIELD = {("externally", "guided", "motion")}
"""Terms that contain one of the words and stay."""

_TERMS = {tuple(words.split()): instead for words, instead in WORDS.items()}
_LONGEST = max(map(len, _TERMS))
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def check(file: Path) -> list[str]:
    """Where ``file`` has one of the words, a line each."""
    text = file.read_text(encoding="utf-8")
    pieces = _python_pieces(text) if file.suffix == ".py" else enumerate(text.splitlines(), 1)
    found = []
    for line, piece in pieces:
        words = [word.lower() for word in _WORD.findall(piece)]
        for begin in range(len(words)):
            for count in range(1, _LONGEST + 1):
                if any(tuple(words[begin + count - len(term) : begin + count]) == term for term in TERMS_OF_THE_FIELD):
                    continue
                instead = _TERMS.get(tuple(words[begin : begin + count]))
                if instead and begin + count <= len(words):
                    term = " ".join(words[begin : begin + count])
                    found.append(f"{file}:{line}: {term!r} in {piece.strip()[:80]!r}; say {instead}")
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
    sys.stdout.write("".join(f"{line}\n" for line in found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
