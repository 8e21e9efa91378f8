"""One clone for all pages, and a list of what was run at the end."""

from __future__ import annotations

from collections import Counter

import pytest
from terminals import RESULTS, Pages


@pytest.fixture(scope="session")
def documentation(tmp_path_factory: pytest.TempPathFactory) -> Pages:
    return Pages(tmp_path_factory.mktemp("documentation"))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if not RESULTS:
        return
    ran = sum(len(each.ran) for each in RESULTS.values())
    reasons = Counter(reason for each in RESULTS.values() for _, reason in each.left_out)
    terminalreporter.section("commands of the documentation")
    terminalreporter.write_line(f"{ran} commands of {len(RESULTS)} pages were run, {sum(reasons.values())} were not:")
    for reason, count in reasons.most_common():
        terminalreporter.write_line(f"  {count:3} {reason}")
