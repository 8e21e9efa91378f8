from __future__ import annotations

import gc

from yumi.links.realtime import paused_collector


def test_collector_pauses_while_something_is_measured_and_goes_on_after_it() -> None:
    with paused_collector():
        assert not gc.isenabled()
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
