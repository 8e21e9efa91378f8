from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_guide_shows_nothing_but_what_the_examples_do() -> None:
    guide = (ROOT / "docs" / "how-to" / "script-without-ros.md").read_text()
    examples = "".join(path.read_text() for path in (ROOT / "examples").glob("script_*.py"))
    snippets = re.findall(r"^```python\n(.*?)^```", guide, re.DOTALL | re.MULTILINE)
    assert len(snippets) == 2
    assert [snippet for snippet in snippets if snippet not in examples] == []
