"""The I/O system: who may write a signal, and that no edge is lost."""

import pytest

from abb_protocols.rws.values import SignalType
from virtual_irc5.controller.signals import ControllerSignal, Signals
from virtual_irc5.controller_log import RefusalReason, Refused
from virtual_irc5.system_parameters import SystemConfiguration

Edge = tuple[str, float, float]


@pytest.fixture
def edges() -> list[Edge]:
    return []


@pytest.fixture
def signals(edges: list[Edge]) -> Signals:
    return Signals(
        [
            ControllerSignal("EGM_STOP", SignalType.DIGITAL_INPUT, "", "All", 0, ""),
            ControllerSignal("STATIONARY", SignalType.DIGITAL_OUTPUT, "", "ReadOnly", 1, ""),
            ControllerSignal("GROUP", SignalType.GROUP_OUTPUT, "", "All", 5, "Hand_R", "EtherNetIP"),
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
    assert refused.value.reason is RefusalReason.READ_ONLY
    assert edges == []


def test_signals_let_the_controller_write_what_clients_may_not(signals: Signals) -> None:
    signals.drive("STATIONARY", 0)
    assert signals.get("STATIONARY").value == 0


def test_signals_refuse_a_digital_value_other_than_0_and_1(signals: Signals) -> None:
    with pytest.raises(Refused, match=r"EGM_STOP is digital: 0 or 1, not 2\.") as refused:
        signals.set("EGM_STOP", 2)
    assert refused.value.reason is RefusalReason.OUT_OF_RANGE


def test_signals_refuse_an_unknown_name(signals: Signals) -> None:
    with pytest.raises(Refused, match=r"there is no signal NOTHING\.") as refused:
        signals.get("NOTHING")
    assert refused.value.reason is RefusalReason.UNKNOWN


CROSSED = """EIO:CFG_1.0:6:1::
#
EIO_SIGNAL:

      -Name "door" -SignalType "DI" -Access "All"
      -Name "part" -SignalType "DI" -Access "All"
      -Name "bypass" -SignalType "DI" -Access "All"
      -Name "go" -SignalType "DO" -Access "All"
      -Name "stop" -SignalType "DO" -Access "All"
      -Name "echo" -SignalType "DO" -Access "All"
#
EIO_CROSS:

      -Name "c1" -Res "go" -Act1 "door" -Oper1 "AND" -Act2 "part" -Oper2 "OR" -Act3 "bypass"
      -Name "c2" -Res "stop" -Act1 "go" -Act1_invert
      -Name "c3" -Res "echo" -Act1 "stop"
"""


def test_cross_connected_signal_follows_its_actors() -> None:
    changes: list[tuple[str, float]] = []
    signals = Signals((), lambda name, old, new: changes.append((name, new)))
    signals.configure(SystemConfiguration([CROSSED]))
    assert [signals.get(name).value for name in ("go", "stop", "echo")] == [0, 1, 1]
    changes.clear()
    signals.set("door", 1)
    assert signals.get("go").value == 0
    signals.set("part", 1)
    assert changes == [("door", 1), ("part", 1), ("go", 1), ("stop", 0), ("echo", 0)]
    signals.set("part", 0)
    signals.set("bypass", 1)
    assert [signals.get(name).value for name in ("go", "stop", "echo")] == [1, 0, 0]


def test_cross_connection_in_a_circle_ends() -> None:
    circle = CROSSED + '      -Name "c4" -Res "bypass" -Act1 "go" -Act1_invert\n'
    signals = Signals((), lambda name, old, new: None)
    signals.configure(SystemConfiguration([circle]))
    signals.set("door", 1)
    assert signals.get("door").value == 1


def test_cross_connection_of_an_unknown_signal_is_rejected_and_logged() -> None:
    configuration = SystemConfiguration([CROSSED.replace('"door" -Oper1', '"nosuch" -Oper1')])
    signals = Signals((), lambda *_: None)
    signals.configure(configuration)
    signals.set("part", 1)
    assert signals.get("go").value == 0
    assert signals.rejected == ["The cross connection of go names nosuch, which is no signal."]
