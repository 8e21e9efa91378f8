"""The page and the picture of the limiter's states."""

from __future__ import annotations

import limiter_states


def test_page_and_picture_are_those_of_the_table() -> None:
    told = "run: .venv/bin/python setup/limiter_states.py"
    assert limiter_states.PAGE.read_text(encoding="utf-8") == limiter_states.page(), told
    assert limiter_states.PICTURE.read_text(encoding="utf-8") == limiter_states.picture(), told
