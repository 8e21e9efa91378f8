"""The page of every file, its noun and its lines: docs/explanation/files.md, made from the first line of each file.

``make check`` runs it and fails where the page is out of date, where a file has no first line, and where a file above
700 lines has no reason for that; ``python setup/source_files.py write`` writes the page.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = "packages"
PAGE = ROOT / "docs" / "explanation" / "files.md"
LONG = 700
"""A file with more lines needs a reason."""

REASONS = {
    "virtual_irc5/controller/irc5.py": "not split yet: modes, execution and arms",
}
"""Why a file is above 700 lines."""

GENERATED = {"abb_protocols/egm/egm_pb2.py"}
_TESTS = ("abb_view/page/tests/", "yumi/web/page/tests/")
_SUFFIXES = (".py", ".hpp", ".cpp", ".ts")
_NEAR = 50
_SENTENCE = re.compile(r"(.*?)(?:\.(?=\s|$)|$)", re.DOTALL)
_ROW = re.compile(r"^\| `([^`]+)` \|.*\| (\d+) \|$", re.MULTILINE)
_COMMENT = re.compile(r"(?:\s*//[^\n]*\n)+|\s*/\*\*.*?\*/", re.DOTALL)
_HEAD = f"""# Every file, its noun, its lines

<!-- Written by `python setup/source_files.py write` from the first line of each file; do not edit. -->

A file is one noun, and its first line names that noun ([why](decisions/0068-one-noun-a-file.md)).
Numbers of lines are right to within {_NEAR}; a file above {LONG} lines has its reason in brackets.
How the packages work together: [architecture](architecture.md).
"""


def files() -> dict[str, Path]:
    """The source files by their names below ``src`` of their package, without empty ones and the evaluation."""
    listed = subprocess.run(
        ["git", "ls-files", "--", SOURCES], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    paths = {
        name.partition("/src/")[2]: ROOT / name
        for name in listed.splitlines()
        if "/src/" in name and "/yumi_evaluation/" not in name
    }
    return {
        name: path
        for name, path in sorted(paths.items(), key=lambda each: (str(Path(each[0]).parent), each[0]))
        if name.endswith(_SUFFIXES)
        and name not in GENERATED
        and not name.startswith(_TESTS)
        and path.exists()
        and path.stat().st_size
    }


def noun_of(path: Path) -> str:
    """The first sentence of a file: of its docstring, or of its first comment; empty where it has neither."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        first = ast.get_docstring(ast.parse(text)) or ""
    else:
        comment = _COMMENT.match(text)
        first = re.sub(r"^\s*(?://|/?\*+/?) ?|\*/\s*$", "", comment[0], flags=re.MULTILINE) if comment else ""
    sentence = _SENTENCE.match(" ".join(first.partition("\n\n")[0].split()))
    noun = re.sub(r":\w+:`[.~]*([^`]+)`", r"`\1`", sentence[1] if sentence else "")
    return noun.replace("``", "`").replace("|", "\\|")


def page(before: str) -> str:
    """The page; a number of lines that is nearly right stays as it was before, so that few changes change the page."""
    written = {name: int(lines) for name, lines in _ROW.findall(before)}
    text, folder = _HEAD, None
    for name, path in files().items():
        if (parent := str(Path(name).parent)) != folder:
            folder = parent
            text += f"\n## `{folder}/`\n\n| file | noun | lines |\n|---|---|---|\n"
        lines = lines_of(path)
        if abs(lines - written.get(name, -LONG)) > _NEAR or (lines > LONG) != (written[name] > LONG):
            written[name] = lines
        reason = f" ({REASONS[name]})" if name in REASONS else ""
        text += f"| `{name}` | {noun_of(path)}{reason} | {written[name]} |\n"
    return text


def lines_of(path: Path) -> int:
    """How many lines a file has."""
    return path.read_bytes().count(b"\n")


def faults() -> list[str]:
    """What is wrong with the files, a line each."""
    lines = {name: lines_of(path) for name, path in files().items()}
    found = [f"{name}: the first line names no noun" for name, path in files().items() if not noun_of(path)]
    found += [
        f"{name}: {count} lines, more than {LONG}; split it, or give a reason in setup/source_files.py"
        for name, count in lines.items()
        if count > LONG and name not in REASONS
    ]
    return found + [
        f"setup/source_files.py: {name} has {lines.get(name, 'no')} lines and needs no reason"
        for name in REASONS
        if lines.get(name, 0) <= LONG
    ]


def main() -> int:
    """Print every finding; 1 where there is one."""
    before = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    if sys.argv[1:] == ["write"]:
        PAGE.write_text(page(before), encoding="utf-8")
        return 0
    found = faults()
    if page(before) != before:
        found.append(f"{PAGE.relative_to(ROOT)} is out of date: python setup/source_files.py write")
    sys.stdout.write("".join(f"{line}\n" for line in found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
