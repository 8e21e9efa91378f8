"""One clone for all pages, and a list of what was run at the end."""

from __future__ import annotations

from collections import Counter

import pytest
from doc_pages import BadPage, inventory
from terminals import RESULTS, Pages


@pytest.fixture(scope="session")
def documentation(tmp_path_factory: pytest.TempPathFactory) -> Pages:
    return Pages(tmp_path_factory.mktemp("documentation"))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """What the pages' commands have come to; without a page that was run, what would be."""
    terminalreporter.section("commands of the documentation")
    if RESULTS:
        run = sum(len(each.ran) for each in RESULTS.values())
        reasons = Counter(reason for each in RESULTS.values() for _, reason in each.left_out)
        where = f"of {len(RESULTS)} pages were run"
    else:
        try:
            run, reasons = inventory()
        except BadPage as error:  # a test reports it, too
            terminalreporter.write_line(str(error))
            return
        where = "of all pages and of --help are run by tests (none in this run)"
    terminalreporter.write_line(f"{run} commands {where}, {sum(reasons.values())} are not:")
    for reason, count in reasons.most_common():
        terminalreporter.write_line(f"  {count:3} {reason}")
