"""Long work beside the virtual robot."""

from __future__ import annotations

from collections.abc import Iterator
from threading import Event

import pytest

from yumi.virtual_controller import Background


@pytest.fixture
def background() -> Iterator[Background]:
    background = Background()
    background.start()
    yield background
    background.stop()


def test_work_gives_what_it_returns_or_raises(background: Background) -> None:
    assert background.submit(lambda: 1 + 1).result(5.0) == 2
    with pytest.raises(ZeroDivisionError):
        background.submit(lambda: 1 / 0).result(5.0)


def test_work_that_nobody_waits_for_is_not_begun_and_others_are(background: Background) -> None:
    """A client that goes while its module waits to be parsed takes nothing with it."""
    release, done = Event(), []
    first = background.submit(lambda: release.wait(5.0))
    given_up = background.submit(lambda: done.append("given up"))
    last = background.submit(lambda: done.append("last"))
    assert given_up.cancel()
    release.set()
    last.result(5.0)
    assert (first.result(5.0), done) == (True, ["last"])
