"""Fixtures for all tests, each named after the thing it gives."""

from __future__ import annotations

import gc
import signal
import threading
from collections.abc import Iterator
from math import radians

import pytest
import pytest_timeout
from hypothesis import settings

from yumi.clock import ManualClock
from yumi.robot.joints import Joints, joints


def pytest_configure() -> None:
    """A shell starts what goes on in its background so that Ctrl-C is ignored, and every command would inherit that."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """A ``real_time`` test asserts times, which other work on the machine can disturb: it is repeated, at most twice.

    One that is marked with ``flaky(reruns=0)`` measures so that nothing disturbs it.

    Long tests run only where they are selected, see ``make soak``.
    """
    if "soak" not in config.option.markexpr:  # another -m takes the place of the usual one
        config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("soak")])
        items[:] = [item for item in items if not item.get_closest_marker("soak")]
    for item in items:
        if item.get_closest_marker("real_time") and not item.get_closest_marker("flaky"):
            item.add_marker(pytest.mark.flaky(reruns=2))


def pytest_collection_finish() -> None:
    """The modules of all tests stay: the garbage collector need not look at them again and again.

    A virtual controller is some ten thousand objects that refer to each other. With Python's own threshold the
    collector looks at each of them several times while one is made, which takes as long as making it.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """pytest-timeout stops its timer at the first failure; without a new one, a rerun could hang for ever."""
    if getattr(item, "execution_count", 1) > 1:
        item.ihook.pytest_timeout_set_timer(item=item, settings=pytest_timeout._get_item_settings(item))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Why a test was repeated: it failed once, and a flaky test is a defect whose cause is to be found."""
    for report in terminalreporter.stats.get("rerun", []):
        terminalreporter.section(f"repeated: {report.nodeid}")
        terminalreporter.line(report.longreprtext)


# How long an example takes is the machine's affair. `make soak` has the long form of every property.
settings.register_profile("short", deadline=None, max_examples=30)
settings.register_profile("long", deadline=None, max_examples=1000)
settings.load_profile("short")


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def middle() -> Joints:
    """A position well inside every joint's range [rad]."""
    return joints([radians(value) for value in (10.0, -60.0, 20.0, 15.0, 30.0, 40.0, 50.0)])


@pytest.fixture(autouse=True)
def _no_thread_is_left() -> Iterator[None]:
    before = set(threading.enumerate())
    yield
    # What reads the output of a whole module's process lives as long as the process.
    left = [thread for thread in threading.enumerate() if thread not in before and not thread.name.endswith("-output")]
    for thread in left:
        thread.join(timeout=2.0)
    assert [thread.name for thread in left if thread.is_alive()] == []
