"""The tables that say which of RobotWare's names RAPID has here."""

from __future__ import annotations

import pytest
import rapid_coverage


@pytest.fixture(scope="module")
def generated() -> str:
    return rapid_coverage.tables()


def test_nearly_all_that_is_provided_is_executed_by_a_test(generated: str) -> None:
    total = next(line for line in generated.splitlines() if line.startswith("| All |"))
    untested = int(total.split("|")[5])
    assert untested <= 40, "add what is new to tests/unit/rapid/effects.txt"


def test_nearly_all_of_what_a_yumi_has_is_done(generated: str) -> None:
    total = next(line for line in generated.splitlines() if line.startswith("| All |"))
    assert float(total.split("|")[8].strip(" %")) >= 95.0
