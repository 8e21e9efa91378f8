from __future__ import annotations

import gc
import os
import re
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import get_native_id

import pytest

from abb_runtime.process.realtime import paused_collector, prefer_thread, short_switch_interval, shorten_turns


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

    def prefer() -> int:
        prefer_thread()
        return policy()

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert in_thread(prefer) == os.SCHED_OTHER


def turn() -> int:
    """How long the calling thread may go on [ns]; 0 where Linux does not tell."""
    told = Path(f"/proc/self/task/{get_native_id()}/sched")
    found = (
        re.search(r"^se\.slice\s*:\s*(\d+)", told.read_text(encoding="ascii"), re.MULTILINE) if told.exists() else None
    )
    return int(found[1]) if found else 0


def is_linux_since(*version: int) -> bool:
    return sys.platform == "linux" and tuple(map(int, re.findall(r"\d+", os.uname().release)[:2])) >= version


@pytest.mark.skipif(not (is_linux_since(6, 12) and turn()), reason="this Linux has no turns of a length, or tells none")
def test_thread_and_those_it_starts_have_short_turns_with_the_niceness_of_before() -> None:
    def shorten() -> int:
        shorten_turns()
        assert turn() < before
        return in_thread(turn)

    before, nice = turn(), os.getpriority(os.PRIO_PROCESS, 0)
    assert in_thread(shorten) < before
    assert (turn(), os.getpriority(os.PRIO_PROCESS, 0)) == (before, nice)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has other ways to schedule a thread")
def test_thread_that_is_scheduled_otherwise_stays_so() -> None:
    def shorten() -> int:
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
        shorten_turns()
        return policy()

    assert in_thread(shorten) == os.SCHED_BATCH
