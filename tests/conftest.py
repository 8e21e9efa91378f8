"""Fixtures for all tests, each named after the thing it gives."""

from __future__ import annotations

import gc
import os
import runpy
import shutil
import signal
import tempfile
import threading
from collections.abc import Iterator
from math import radians
from pathlib import Path

import pytest
from hypothesis import settings

from abb_protocols.catalogue import speak_as
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.robot.joints import Joints, joints
from abb_runtime.clock import ManualClock

_RUNTIME = pytest.StashKey[str]()

COLLECTOR = (50_000, 20, 20)
"""After how many new objects the collector looks at the young, the older and all of them.

A virtual controller is some ten thousand objects that refer to each other, and the modules of all tests are far more.
With Python's own thresholds the collector looks at each of them several times while they are made.
"""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--random-words", action="store_true", help="Replace every sentence of the catalogue by random words."
    )


def pytest_configure(config: pytest.Config) -> None:
    """Give what the tests start a world of its own, beside other tests and beside a driver that runs on this machine.

    A shell starts what goes on in its background so that Ctrl-C is ignored, and every command would inherit that.
    """
    gc.set_threshold(*COLLECTOR)
    config.stash[_RUNTIME] = tempfile.mkdtemp(prefix="yumi-tests-")  # short: sockets in it have paths
    os.environ["XDG_RUNTIME_DIR"] = config.stash[_RUNTIME]  # where the one driver of a machine is found
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.getoption("random_words"):
        folder = str(Path(__file__).parent / "random_words")
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [folder, os.environ.get("PYTHONPATH")]))
        runpy.run_path(f"{folder}/sitecustomize.py")  # in the processes that the tests start Python does so itself


def pytest_unconfigure(config: pytest.Config) -> None:
    shutil.rmtree(config.stash[_RUNTIME])


IN_REAL_TIME = ("docs", "ros", "system")
"""The folders of all tests marked ros or real_time: ``make test-real-time`` reads no others."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Long tests run only where they are selected, see ``make soak``; random words have no wording to look at."""
    folders = tuple(Path(__file__).parent / folder for folder in IN_REAL_TIME)
    for item in items:
        if is_in_real_time(item) and not any(map(item.path.is_relative_to, folders)):
            raise pytest.UsageError(f"make test-real-time does not find {item.nodeid}; move it to {IN_REAL_TIME}.")
    if config.getoption("random_words"):
        for item in items:
            if item.get_closest_marker("words"):
                item.add_marker(pytest.mark.skip(reason="looks at the catalogue's own words, which are random now"))
    if "soak" not in config.option.markexpr:  # another -m takes the place of the usual one
        config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("soak")])
        items[:] = [item for item in items if not item.get_closest_marker("soak")]


def is_in_real_time(item: pytest.Item) -> bool:
    return any(item.get_closest_marker(name) for name in ("ros", "real_time"))


def pytest_collection_finish() -> None:
    """The modules of all tests stay: the garbage collector need not look at them again and again."""
    gc.collect()
    settle_collector()


def settle_collector() -> None:
    gc.freeze()
    gc.set_threshold(*COLLECTOR)


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
def _nothing_lasts() -> Iterator[None]:
    """What a test has chosen for the whole process ends with it, and no thread of it goes on."""
    before = set(threading.enumerate())
    yield
    speak_as(FrontEnd.SCRIPT)  # a command may have chosen other words
    if gc.get_threshold() != COLLECTOR:  # a controller that ran in this process has set it for itself
        settle_collector()
    # What reads the output of a whole module's process lives as long as the process.
    left = [thread for thread in threading.enumerate() if thread not in before and not thread.name.endswith("-output")]
    for thread in left:
        thread.join(timeout=2.0)
    assert [thread.name for thread in left if thread.is_alive()] == []
