"""What `make check` refuses in decisions."""

from __future__ import annotations

from pathlib import Path

import check_decisions
import pytest

GOOD = "# 7. A title\n\n**Status.** Accepted.\n\n**Context.** C.\n\n**Decision.** D.\n\n**Consequences.** E.\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "docs" / "explanation" / "decisions"
    folder.mkdir(parents=True)
    monkeypatch.setattr(check_decisions, "FOLDER", folder)
    return folder


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (GOOD, None),
        (GOOD.replace("Accepted.", "Superseded by [8](0008-b.md)."), None),
        (GOOD.replace("D.", "D. *Not chosen*: F.\n\n**More.** G."), None),
        (GOOD.replace("# 7.", "# 8."), "the first line is not '# 7. ' and a title"),
        (GOOD + "word " * 300, "312 words"),
        (GOOD.replace("**Context.** C.\n\n", ""), "the parts are Status, Decision, Consequences"),
        (GOOD.replace("Accepted.", "Good."), "the status is neither"),
    ],
)
def test_decision_has_four_parts_a_status_and_300_words(folder: Path, text: str, fault: str | None) -> None:
    page = folder / "0007-a.md"
    page.write_text(text, encoding="utf-8")
    found = check_decisions.check(page)
    assert len(found) == (fault is not None)
    assert fault is None or fault in found[0]


def test_list_has_number_title_and_status(folder: Path) -> None:
    (folder / "0007-a.md").write_text(GOOD.replace("Accepted.", "Accepted; see\n[8](0008-b.md)."), encoding="utf-8")
    assert check_decisions.listed().splitlines()[-1] == "| 7 | [A title](0007-a.md) | accepted; see [8](0008-b.md) |"
