from __future__ import annotations

import gc

import pytest

from yumi.links.realtime import paused_collector


def test_collector_pauses_and_goes_on_even_after_a_failure() -> None:
    with pytest.raises(RuntimeError), paused_collector():
        assert not gc.isenabled()
        raise RuntimeError
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
