from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from abb_runtime.process.realtime import paused_collector, prefer_thread, short_switch_interval


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


def in_thread(work: Callable[[], int]) -> int:
    """What ``work`` returns in a thread of its own."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work).result()


def policy() -> int:
    """How the system schedules the calling thread."""
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK


def may_run_in_real_time() -> bool:
    def ask() -> int:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        except PermissionError:
            return 0
        return 1

    return bool(in_thread(ask))


@pytest.mark.skipif(not may_run_in_real_time(), reason="this machine does not permit real-time priority")
def test_thread_runs_in_real_time_and_neither_others_nor_those_it_starts() -> None:
    def prefer() -> int:
        prefer_thread()
        assert policy() == os.SCHED_FIFO
        assert os.sched_getparam(0).sched_priority < 50  # that of the control loop
        return in_thread(policy)

    assert in_thread(prefer) == os.SCHED_OTHER
    assert policy() == os.SCHED_OTHER


def test_thread_goes_on_where_real_time_is_not_permitted(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    prefer_thread()
    assert policy() == os.SCHED_OTHER
