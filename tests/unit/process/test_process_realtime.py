from __future__ import annotations

import gc
import sys

from yumi.process.realtime import paused_collector, short_switch_interval


def test_collector_pauses_while_something_is_measured_and_goes_on_after_it() -> None:
    with paused_collector():
        assert not gc.isenabled()
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_threads_take_turns_more_often_meanwhile() -> None:
    before = sys.getswitchinterval()
    with short_switch_interval():
        assert sys.getswitchinterval() < before
    assert sys.getswitchinterval() == before
