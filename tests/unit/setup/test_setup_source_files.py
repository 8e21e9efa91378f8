"""The page of all source files, and what is refused of them."""

from __future__ import annotations

from pathlib import Path

import pytest
import source_files


@pytest.mark.parametrize(
    ("name", "text", "noun"),
    [
        ("a.py", '"""The cycle: one datagram in,\none reply out. Nothing else runs here.\n\nMore.\n"""\n', None),
        ("a.hpp", "// The cycle: one datagram in,\n// one reply out. Nothing else runs here.\n\n#pragma once\n", None),
        ("a.ts", "/**\n * The cycle: one datagram in,\n * one reply out. Nothing else runs here.\n */\n", None),
        ("b.py", '"""See :mod:`abb_runtime.rws`, or ``yumi up``."""\n', "See `abb_runtime.rws`, or `yumi up`"),
        ("c.py", "x = 1\n", ""),
        ("c.hpp", "#pragma once\n// not the first\n", ""),
    ],
)
def test_noun_is_the_first_sentence_of_docstring_or_comment(
    tmp_path: Path, name: str, text: str, noun: str | None
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    expected = "The cycle: one datagram in, one reply out" if noun is None else noun
    assert source_files.noun_of(tmp_path / name) == expected


@pytest.fixture
def long_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "long.py"
    path.write_text('"""A noun."""\n' + "\n" * source_files.LONG, encoding="utf-8")
    monkeypatch.setattr(source_files, "files", lambda: {"long.py": path})
    monkeypatch.setattr(source_files, "REASONS", {})
    return path


def test_long_file_without_a_reason_is_refused(long_file: Path) -> None:
    assert [fault.partition(";")[0] for fault in source_files.faults()] == ["long.py: 701 lines, more than 700"]


def test_reason_without_a_long_file_is_refused(long_file: Path) -> None:
    source_files.REASONS["long.py"] = "a client"
    assert source_files.faults() == []
    long_file.write_text('"""A noun."""\n', encoding="utf-8")
    assert source_files.faults() == ["setup/source_files.py: long.py has 1 lines and needs no reason"]


def test_file_without_a_first_sentence_is_refused(long_file: Path) -> None:
    long_file.write_text("x = 1\n", encoding="utf-8")
    assert source_files.faults() == ["long.py: the first line names no noun"]


def test_number_of_lines_stays_while_it_is_nearly_right(long_file: Path) -> None:
    long_file.write_text('"""A noun."""\n' * 100, encoding="utf-8")
    before = source_files.page("")
    assert "| `long.py` | A noun | 100 |" in before
    long_file.write_text('"""A noun."""\n' * 150, encoding="utf-8")
    assert source_files.page(before) == before
    long_file.write_text('"""A noun."""\n' * 151, encoding="utf-8")
    assert "| `long.py` | A noun | 151 |" in source_files.page(before)
