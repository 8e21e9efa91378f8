"""RAPID's I/O."""

import pytest
from rapid_bench import error_of, started


@pytest.mark.parametrize(
    ("statement", "level"),
    [
        ("Set do1;", 1),
        ("Reset do1;", 0),
        ("SetDO do1, 1;", 1),
        ("InvertDO do1;", 1),
        ("SetGO do1, 12;", 12),
        ("SetAO do1, 0.5;", 0.5),
    ],
)
def test_output_is_set(statement: str, level: float) -> None:
    assert started(statement).host.signals["do1"] == level


def test_delayed_output_lets_the_program_go_on() -> None:
    bench = started('SetDO \\SDelay:=0.1, do1, 1; TPWrite "on"; WaitTime 1;')
    assert (bench.lines, bench.host.signals["do1"]) == (["on"], 0.0)
    bench.run(0.15)
    assert bench.host.signals["do1"] == 1.0


def test_pulse_ends_by_itself_even_when_the_program_is_over() -> None:
    bench = started("PulseDO \\PLength:=0.05, do1;")
    assert bench.host.signals["do1"] == 1.0
    bench.run(0.1)
    assert bench.host.signals["do1"] == 0.0


def test_pulse_without_length_lasts_a_fifth_of_a_second() -> None:
    bench = started("PulseDO \\High, do1;")
    bench.run(0.18)
    assert bench.host.signals["do1"] == 1.0
    bench.run(0.04)
    assert bench.host.signals["do1"] == 0.0


@pytest.mark.parametrize(
    ("function", "level"),
    [
        ("DInput(di1)", "0"),
        ("DOutput(do1)", "1"),
        ("GInput(go1)", "3"),
        ("GOutput(go1)", "3"),
        ("AInput(go1)", "3"),
        ("AOutput(go1)", "3"),
    ],
)
def test_signal_is_read(function: str, level: str) -> None:
    assert started(f"Set do1; SetGO go1, 3; n := {function};", "VAR num n;").read("n") == level


def test_input_is_tested() -> None:
    assert started('IF NOT TestDI(di1) TPWrite "low";').lines == ["low"]


def test_output_that_does_not_exist_is_an_error() -> None:
    assert error_of("p;", "PROC p() VAR signaldo nothing; Set nothing; ENDPROC") == "ERR_SIG_NOT_VALID"
