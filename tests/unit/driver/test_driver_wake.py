from __future__ import annotations

import pytest

from yumi.clock import ManualClock
from yumi.driver import control_process as wake
from yumi.driver.control_process import GLANCE, AheadWait, BlockingWait, HotWait, WakeMode, describe, way_to_wait
from yumi.robot.joints import CYCLE

LOOK = 2e-6


class ScriptedPoller:
    """A poller on a clock moved by hand: datagrams arrive at given times."""

    def __init__(self, clock: ManualClock, arrivals: list[float]) -> None:
        self.looks = 0
        self.dozed = 0.0
        self._clock = clock
        self._arrivals = arrivals
        self.handler = lambda now: None

    def wait(self, timeout: float) -> bool:
        self.looks += 1
        self._clock.advance(min(timeout, self._next() - self._clock.now()) if timeout else LOOK)
        if self._clock.now() < self._next():
            return False
        self.handler(self._arrivals.pop(0))
        return True

    def doze(self, duration: float) -> bool:
        slept = max(0.0, min(duration, self._next() - self._clock.now()))
        self.dozed += slept
        self._clock.advance(slept)
        return self._clock.now() >= self._next()

    def _next(self) -> float:
        return self._arrivals[0] if self._arrivals else 1e9


@pytest.fixture
def ahead(clock: ManualClock) -> AheadWait:
    return AheadWait(clock)


def run(ahead: AheadWait, clock: ManualClock, arrivals: list[float], until: float) -> ScriptedPoller:
    poller = ScriptedPoller(clock, arrivals)
    poller.handler = lambda now: ahead.note_arrival(clock.now())  # type: ignore[assignment]
    while clock.now() < until:
        ahead.wait(poller, is_streaming=True)  # type: ignore[arg-type]
    return poller


def test_waiting_ahead_sleeps_most_of_the_period(ahead: AheadWait, clock: ManualClock) -> None:
    arrivals = [count * CYCLE for count in range(1, 501)]
    poller = run(ahead, clock, arrivals, 500 * CYCLE)
    assert poller.dozed > 0.9 * 499 * CYCLE


def test_waiting_ahead_only_glances_when_nobody_streams(ahead: AheadWait, clock: ManualClock) -> None:
    poller = ScriptedPoller(clock, [])
    ahead.wait(poller, is_streaming=False)  # type: ignore[arg-type]
    assert (poller.looks, clock.now()) == (1, GLANCE)


def test_waiting_ahead_stops_looking_when_a_datagram_stays_away(ahead: AheadWait, clock: ManualClock) -> None:
    poller = run(ahead, clock, [CYCLE, 2 * CYCLE], 20 * CYCLE)
    assert poller.looks * LOOK < 2 * CYCLE


def test_waiting_ahead_rehearses_before_each_datagram_that_is_due(ahead: AheadWait, clock: ManualClock) -> None:
    rehearsed: list[float] = []
    ahead.prepare(lambda: rehearsed.append(clock.now()))
    run(ahead, clock, [count * CYCLE for count in range(1, 101)], 100 * CYCLE)
    assert len(rehearsed) > 90
    assert all(CYCLE * 0.85 < moment % CYCLE < CYCLE for moment in rehearsed)


def test_rehearsal_is_left_out_when_something_came_already(ahead: AheadWait, clock: ManualClock) -> None:
    rehearsed: list[float] = []
    ahead.prepare(lambda: rehearsed.append(clock.now()))
    run(ahead, clock, [CYCLE, 1.5 * CYCLE], 1.5 * CYCLE)
    assert not rehearsed


def test_rehearsals_go_on_after_one_that_was_interrupted_for_long(ahead: AheadWait, clock: ManualClock) -> None:
    rehearsed: list[float] = []

    def rehearse() -> None:
        rehearsed.append(clock.now())
        clock.advance(0.2 if len(rehearsed) == 10 else 1e-4)

    ahead.prepare(rehearse)
    run(ahead, clock, [count * CYCLE for count in range(1, 201)], 200 * CYCLE)
    assert len(rehearsed) > 100


@pytest.mark.parametrize(
    ("mode", "is_permitted", "kind"),
    [
        (WakeMode.AUTO, True, HotWait),
        (WakeMode.AUTO, False, AheadWait),
        (WakeMode.HOT, True, HotWait),
        (WakeMode.HOT, False, BlockingWait),
        (WakeMode.AHEAD, True, AheadWait),
        (WakeMode.BLOCKING, True, BlockingWait),
    ],
)
def test_mode_takes_what_is_permitted(
    monkeypatch: pytest.MonkeyPatch, clock: ManualClock, mode: WakeMode, is_permitted: bool, kind: type
) -> None:
    monkeypatch.setattr(wake.AwakeProcessors, "are_permitted", staticmethod(lambda: is_permitted))
    wait = way_to_wait(mode, clock)
    assert type(wait) is kind
    assert describe(wait)
