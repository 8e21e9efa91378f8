"""Waiting: for time, for conditions, for signals."""

from rapid_bench import Bench, error_of, started


def test_wait_time_takes_its_time_exactly() -> None:
    bench = started('WaitTime 0.1; TPWrite "over";')
    bench.task.advance(0.0995)
    assert bench.lines == []
    bench.task.advance(0.001)
    assert bench.lines == ["over"]


def test_loop_of_short_waits_keeps_its_period_in_long_advances() -> None:
    bench = started("WHILE TRUE DO Incr n; WaitTime 0.01; ENDWHILE", "VAR num n;")
    bench.task.advance(1.0)
    assert bench.read("n") in {"100", "101"}


def test_wait_in_position_lasts_until_the_robot_stands() -> None:
    bench = Bench('WaitTime \\InPos, 0; TPWrite "stands";')
    bench.task.in_position = lambda: False
    bench.start().run(0.1)
    assert bench.lines == []
    bench.task.in_position = lambda: True
    bench.run(0.01)
    assert bench.lines == ["stands"]


def test_wait_until_looks_at_its_condition_again() -> None:
    bench = started('WaitUntil n > 2; TPWrite "over";', "VAR num n;")
    bench.run(0.1)
    bench.task.write("M", "n", "3")
    assert bench.lines == []
    bench.run(0.01)
    assert bench.lines == ["over"]


def test_wait_until_calls_functions_in_its_condition() -> None:
    bench = started('WaitUntil ready(); TPWrite "over";', "VAR num n; FUNC bool ready() Incr n; RETURN n > 5; ENDFUNC")
    bench.run(0.05)
    assert (bench.lines, bench.read("n")) == (["over"], "6")


def test_wait_until_with_time_limit_raises_an_error() -> None:
    bench = started("WaitUntil FALSE \\MaxTime:=0.05;")
    assert bench.host.events == []
    bench.run(0.1)
    assert bench.stop.error == "ERR_WAIT_MAXTIME"
    assert "WaitUntil has waited for 0.05 s in vain." in bench.stop.sentence


def test_wait_until_with_time_flag_goes_on_and_sets_it() -> None:
    bench = started('WaitUntil di1 = 1 \\MaxTime:=0.05 \\TimeFlag:=late; TPWrite ""\\Bool:=late;', "VAR bool late;")
    bench.run(0.1)
    assert bench.lines == ["TRUE"]


def test_wait_until_clears_the_time_flag_when_the_condition_comes() -> None:
    bench = started('WaitUntil TRUE \\MaxTime:=1 \\TimeFlag:=late; TPWrite ""\\Bool:=late;', "VAR bool late := TRUE;")
    assert bench.lines == ["FALSE"]


def test_operator_sees_what_a_visualized_condition_waits_for() -> None:
    body = 'WaitUntil ready \\MaxTime:=1 \\TimeFlag:=late \\Visualize \\Header:="Door" \\Message:="Close it";'
    bench = started(f"{body} TPWrite ValToStr(late);", "PERS bool ready:=FALSE; VAR bool late;")
    bench.run(0.05)
    assert bench.host.devices.pendant.messages == {bench.task.name: ("Door", "Close it")}
    bench.task.write("M", "ready", "TRUE")
    bench.run(0.05)
    assert (bench.host.devices.pendant.messages, bench.lines) == ({}, ["FALSE"])


def test_trap_runs_while_a_condition_is_awaited() -> None:
    declarations = "VAR intnum i; VAR bool done; TRAP t done := TRUE; ENDTRAP\n"
    bench = started('CONNECT i WITH t; ISignalDI di1, HIGH, i; WaitUntil done; TPWrite "over";', declarations)
    bench.set("di1", 1)
    bench.run(0.01)
    assert bench.lines == ["over"]


def test_wait_for_a_signal_ends_with_its_level() -> None:
    bench = started('WaitDI di1, 1; TPWrite "high"; WaitDO do1, 1; TPWrite "out";')
    bench.host.signals["di1"] = 1.0
    bench.run(0.01)
    bench.host.signals["do1"] = 1.0
    bench.run(0.01)
    assert bench.lines == ["high", "out"]


def test_wait_for_a_signal_has_a_time_limit() -> None:
    bench = started("WaitDI di1, 1 \\MaxTime:=0.02;")
    bench.run(0.05)
    assert bench.stop.error == "ERR_WAIT_MAXTIME"


def test_wait_for_a_signal_that_is_none_is_refused() -> None:
    assert error_of("p;", "PROC p() VAR signaldi nothing; WaitDI nothing, 1; ENDPROC") == "ERR_SIG_NOT_VALID"
