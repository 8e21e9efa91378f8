"""Datagrams that are late, forged, cut, lost, swapped or doubled while both arms move: what is sent never jumps."""

from __future__ import annotations

import pytest
from wire_faults import LASTING, SINGLE, Attack, Link, Swing, Tapped, check_limits, check_path, is_at_rest, swing

from abb_protocols.robot.joints import CYCLE, Side
from abb_runtime.faults import Fault
from system.virtual_time_bench import System

BEFORE, AFTER = 0.6, 0.6  # [s]
LONG = {
    "egm-stale-30",
    "egm-stale-60",
    "egm-stale-200",
    "egm-forge-old-5",
    "egm-forge-old-30",
    "egm-forge-ahead-5",
    "egm-forge-ahead-30",
}
"""As others of their kind: they run with ``make soak``."""

ATTACKS = [
    pytest.param(each, id=str(each), marks=pytest.mark.soak if str(each) in LONG else ())
    for each in (*SINGLE, *LASTING)
]


class Tap:
    """A link that remembers what passes."""

    def __init__(self, link: Link, system: System) -> None:
        self.passed = Tapped()
        self._link = link
        self._system = system

    def send(self, datagram: bytes) -> None:
        self.passed.note_sent(datagram)
        self._link.send(datagram)

    def receive(self) -> list[bytes]:
        datagrams = self._link.receive()
        self.passed.note_received(self._system.now(), datagrams)
        return datagrams


class SwingingSystem(System):
    """Both arms swing, led by goals that are streamed; they stand where the swing begins."""

    def __init__(self) -> None:
        super().__init__()
        self.taps = {side: Tap(link, self) for side, link in self._robot_ends.items()}
        self._robot_ends.update(self.taps)  # type: ignore[arg-type]
        self._begin: float | None = None
        for side, virtual_arm in self.world.arms.items():
            virtual_arm.strike(swing(side, 0.0))
        self.start_egm()
        self._begin = self.now()
        self.wait(BEFORE)

    def passed(self, side: Side) -> Tapped:
        return self.taps[side].passed

    def _cycle(self) -> None:
        if self._begin is not None:
            for side, arm in self.arms.items():
                arm.go(swing(side, self.now() - self._begin))
        super()._cycle()


@pytest.fixture
def system() -> SwingingSystem:
    return SwingingSystem()


def test_swing_that_nothing_disturbs_goes_on_within_the_limits(system: SwingingSystem) -> None:
    for side in Side:
        heard = system.passed(side).heard
        path = Swing(side, heard[-124:])
        system.wait(AFTER)
        recent = heard[-300:]
        check_limits(recent)
        assert check_path(recent, path, SINGLE[0]) == "goes on"
        assert not is_at_rest(recent)


@pytest.mark.parametrize("attack", ATTACKS)
def test_what_is_sent_keeps_its_limits_and_never_follows_what_is_false(system: SwingingSystem, attack: Attack) -> None:
    if attack.fault is Fault.EGM_STALE:
        system.wait(attack.amount * CYCLE)  # what is repeated has been sent by then
    begin = {side: system.passed(side).cycle for side in Side}
    paths = {side: Swing(side, system.passed(side).heard[-124:]) for side in Side}
    system.faults.inject(attack.fault, attack.side, attack.duration, attack.amount, attack.way)
    system.wait((attack.duration or 0.0) + AFTER)
    for side in Side:
        passed = system.passed(side)
        heard = passed.since(begin[side])
        check_limits(heard, stops=attack.stops)
        check_path(heard, paths[side], attack)
        first = begin[side] if attack.unanswered is not None else passed.cycle - 50
        sent, answered = {cycle for cycle, _ in passed.sent}, {each.cycle - 1 for each in heard}
        unanswered = [cycle for cycle in range(first, passed.cycle) if cycle not in sent & answered]
        assert len(unanswered) <= (attack.unanswered or 0), unanswered
