"""The page of stops and refusals shows what is said: all of them are provoked again."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from abb_runtime.faults import Fault
from system.provoked_stops import page, sections

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "stops-and-refusals.md"


@pytest.mark.timeout(120)
@pytest.mark.skipif(importlib.util.find_spec("roboplan") is None, reason="needs yumi-ros2[planning]")
def test_page_shows_what_is_said_of_every_fault_and_refusal(pytestconfig: pytest.Config) -> None:
    found = sections()
    rows = [row for section in found.values() for row in section]
    assert len(rows) >= 80
    for fault in Fault:
        assert any(f"`{fault.value.name}`" in row.what for row in rows), fault
    if not pytestconfig.getoption("random_words"):
        assert PAGE.read_text(encoding="utf-8") == page(found), "run: make pages"
