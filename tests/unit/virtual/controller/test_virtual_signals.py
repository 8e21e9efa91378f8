"""The I/O system: who may write a signal, and that no edge is lost."""

import pytest

from yumi.rws.types import SignalType
from yumi.virtual.controller.events import Refusal, Refused
from yumi.virtual.controller.signals import Signal, Signals

Edge = tuple[str, float, float]


@pytest.fixture
def edges() -> list[Edge]:
    return []


@pytest.fixture
def signals(edges: list[Edge]) -> Signals:
    return Signals(
        [
            Signal("EGM_STOP", SignalType.DIGITAL_INPUT, "", "All", 0, ""),
            Signal("STATIONARY", SignalType.DIGITAL_OUTPUT, "", "ReadOnly", 1, ""),
            Signal("GROUP", SignalType.GROUP_OUTPUT, "", "All", 5, "Hand_R", "EtherNetIP"),
        ],
        lambda *edge: edges.append(edge),
    )


def test_signals_announce_a_change_before_the_write_returns(signals: Signals, edges: list[Edge]) -> None:
    signals.set("EGM_STOP", 1)
    assert edges == [("EGM_STOP", 0, 1)]
    assert signals.get("EGM_STOP").value == 1


def test_signals_announce_nothing_when_the_value_stays(signals: Signals, edges: list[Edge]) -> None:
    signals.set("EGM_STOP", 0)
    assert edges == []


def test_signals_announce_every_edge_of_a_pulse(signals: Signals, edges: list[Edge]) -> None:
    for value in (0, 1, 0):
        signals.set("EGM_STOP", value)
    assert edges == [("EGM_STOP", 0, 1), ("EGM_STOP", 1, 0)]


def test_signals_refuse_clients_without_access(signals: Signals, edges: list[Edge]) -> None:
    with pytest.raises(Refused, match="access level ReadOnly; clients write those with All") as refused:
        signals.set("STATIONARY", 0)
    assert refused.value.reason is Refusal.READ_ONLY
    assert edges == []


def test_signals_let_the_controller_write_what_clients_may_not(signals: Signals) -> None:
    signals.drive("STATIONARY", 0)
    assert signals.get("STATIONARY").value == 0


def test_signals_refuse_a_digital_value_other_than_0_and_1(signals: Signals) -> None:
    with pytest.raises(Refused, match=r"EGM_STOP is digital: 0 or 1, not 2\.") as refused:
        signals.set("EGM_STOP", 2)
    assert refused.value.reason is Refusal.OUT_OF_RANGE


def test_signals_refuse_an_unknown_name(signals: Signals) -> None:
    with pytest.raises(Refused, match=r"there is no signal NOTHING\.") as refused:
        signals.get("NOTHING")
    assert refused.value.reason is Refusal.UNKNOWN
