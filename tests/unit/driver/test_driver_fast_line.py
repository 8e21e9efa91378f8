from __future__ import annotations

import os
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from yumi.clock import ManualClock
from yumi.control.requests import CycleFailed, Stop
from yumi.driver.control_process import BlockingWait, FastLine, PipeClosed, WiredArm
from yumi.robot.joints import Side


class Source:
    """Something that is readable once it was told so."""

    def __init__(self) -> None:
        self._reader, self._writer = os.pipe()

    def fileno(self) -> int:
        return self._reader

    def make_readable(self) -> None:
        os.write(self._writer, b"x")

    def close(self) -> None:
        os.close(self._reader)
        os.close(self._writer)


class Parent(Source):
    """Its end of the pipe: tells to stop, then goes; remembers what it was told."""

    def __init__(self) -> None:
        super().__init__()
        self.told: list[object] = []
        self._mail = [Stop()]

    def read(self) -> bool:
        if not self._mail:
            raise PipeClosed
        return True

    def receive(self) -> Any:
        return self._mail.pop()

    def send(self, value: object) -> None:
        self.told.append(value)


class Line:
    """An arm that takes 100 ms for a cycle, and fails at the first."""

    state = None

    def __init__(self, clock: ManualClock, parent: Parent) -> None:
        self.manager = SimpleNamespace(deactivate_commanding=self._deactivate)
        self.is_still = True
        self.deactivated = 0
        self.watched: list[float] = []
        self._clock, self._parent = clock, parent

    def _deactivate(self) -> None:
        self.deactivated += 1

    def run(self, now: float) -> None:
        self._clock.advance(0.1)
        self._parent.make_readable()
        raise ValueError("a command of six joints")

    def is_datagram_due(self, now: float) -> bool:
        return False

    def watch_silence(self, now: float) -> None:
        self.watched.append(now)

    def take_events(self) -> tuple[object, ...]:
        return ()


@pytest.fixture
def parent() -> Iterator[Parent]:
    parent = Parent()
    yield parent
    parent.close()


@pytest.fixture
def line(clock: ManualClock, parent: Parent) -> Iterator[Line]:
    """After a run that begins with a datagram and ends when the parent tells so."""
    line, socket = Line(clock, parent), Source()
    arm: Any = WiredArm(line, socket)  # type: ignore[arg-type]
    socket.make_readable()
    loop = FastLine(parent, Side.LEFT, arm, SimpleNamespace(release=int), clock, BlockingWait(clock))  # type: ignore[arg-type]
    loop.run()
    yield line
    socket.close()


def test_fast_line_does_not_take_its_own_standstill_for_the_robots_silence(line: Line) -> None:
    assert line.watched[0] == 0.0


def test_fast_line_deactivates_what_commands_when_a_cycle_fails(line: Line, parent: Parent) -> None:
    assert line.deactivated >= 1
    failures = [told for told in parent.told if isinstance(told, CycleFailed)]
    assert "ValueError: a command of six joints" in str(failures[0])
