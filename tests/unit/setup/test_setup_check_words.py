"""What `make check` refuses in pages: two sentences in a line, and lines that are too long."""

from __future__ import annotations

from pathlib import Path

import pytest
from check_words import check_lines


def findings(folder: Path, text: str) -> list[str]:
    page = folder / "page.md"
    page.write_text(text, encoding="utf-8")
    return [line.removeprefix(f"{page}:") for line in check_lines(page)]


@pytest.mark.parametrize(
    "line",
    [
        "The arm moves. The arm stands.",
        "- The arm moves (slowly). `yumi stop` ends that.",
        "1. **Move.** The arm moves. It stands.",
        "Does it move? [It](page.md) does.",
        "“The arm moves.” Then the arm stands.",
    ],
)
def test_line_with_two_sentences_is_refused(tmp_path: Path, line: str) -> None:
    assert findings(tmp_path, f"# Title\n\n{line}\n") == ["3: two sentences; each begins a line of its own"]


@pytest.mark.parametrize(
    "line",
    [
        "The arm moves, e.g. J1; version 3.12 of `a. B` stands … Then 5. it ends",
        "**Why.** The arm stands.",
        "- **Why.** The arm stands.",
        "2. The arm stands.",
        "| The arm moves. | The arm stands. |",
        "<!-- not run: takes long. Not here. -->",
        "```text\nThe arm moves. The arm stands.\n```",
    ],
)
def test_line_that_is_one_sentence_or_no_text_passes(tmp_path: Path, line: str) -> None:
    assert findings(tmp_path, f"{line}\n") == []


def test_line_above_120_columns_is_refused_but_for_addresses_tables_and_code(tmp_path: Path) -> None:
    words = "word " * 24
    assert findings(tmp_path, f"{words}\n") == []
    assert findings(tmp_path, f"{words}s\n") == ["1: 121 columns; a line of a page has at most 120"]
    link = f"[word]({'x' * 40}.md)"
    assert findings(tmp_path, f"{words[:100]}{link}\n| {words}{words} |\n```text\n{words}{words}\n```\n") == []


def test_text_after_a_fence_is_checked_again(tmp_path: Path) -> None:
    text = "````text\n```\nOne. Two.\n```\n````\nOne. Two.\n"
    assert findings(tmp_path, text) == ["6: two sentences; each begins a line of its own"]
