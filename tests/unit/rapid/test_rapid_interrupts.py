"""Interrupts: traps between statements and in waits, queued, asleep, single, timed."""

import pytest
from rapid_bench import Bench, error_of, started

TRAP = 'VAR intnum i; VAR num n; TRAP onEdge Incr n; TPWrite "trap"; ENDTRAP\n'
WATCH = "CONNECT i WITH onEdge; ISignalDI di1, HIGH, i; "
IDLE = "WHILE TRUE DO WaitTime 0.1; ENDWHILE"


def watching(order: str = WATCH, trap: str = TRAP, rest: str = IDLE) -> Bench:
    return started(order + rest, trap)


def test_rising_edge_runs_the_trap_at_once() -> None:
    bench = watching()
    bench.set("di1", 1)
    assert bench.read("n") == "1"


def test_level_and_falling_edge_run_no_trap() -> None:
    bench = watching()
    bench.set("di1", 1)
    bench.set("di1", 1)
    bench.set("di1", 0)
    assert bench.read("n") == "1"


@pytest.mark.parametrize(("edge", "count"), [("HIGH", "1"), ("LOW", "1"), ("1", "1"), ("0", "1"), ("edge", "2")])
def test_interrupt_is_ordered_for_an_edge(edge: str, count: str) -> None:
    bench = watching(f"CONNECT i WITH onEdge; ISignalDI di1, {edge}, i; ")
    bench.set("di1", 1)
    bench.set("di1", 0)
    assert bench.read("n") == count


def test_single_interrupt_comes_once() -> None:
    bench = watching("CONNECT i WITH onEdge; ISignalDI \\Single, di1, HIGH, i; ")
    for level in (1, 0, 1):
        bench.set("di1", level)
    assert bench.read("n") == "1"


def test_output_signal_can_order_an_interrupt() -> None:
    bench = watching("CONNECT i WITH onEdge; ISignalDO do1, HIGH, i; ")
    bench.set("do1", 1)
    assert bench.read("n") == "1"


def test_disabled_interrupts_are_queued_until_they_are_enabled() -> None:
    bench = watching(rest='IDisable; WaitTime 0.1; TPWrite "free"; IEnable; ' + IDLE)
    for level in (1, 0, 1):
        bench.set("di1", level)
    assert bench.read("n") == "0"
    bench.run(0.2)
    assert bench.lines == ["free", "trap", "trap"]


def test_sleeping_interrupt_is_dropped() -> None:
    bench = watching(rest="ISleep i; WaitTime 0.1; IWatch i; " + IDLE)
    bench.set("di1", 1)
    bench.run(0.2)
    assert bench.read("n") == "0"
    bench.set("di1", 0)
    bench.set("di1", 1)
    assert bench.read("n") == "1"


def test_deleted_interrupt_comes_no_more_and_can_be_connected_again() -> None:
    bench = watching(rest="IDelete i; CONNECT i WITH onEdge; " + IDLE)
    bench.set("di1", 1)
    assert bench.read("n") == "0"


def test_delete_of_an_interrupt_never_connected_is_harmless() -> None:
    assert started('IDelete i; TPWrite "on";', "VAR intnum i;").lines == ["on"]


def test_interrupt_cannot_be_connected_twice() -> None:
    assert error_of("CONNECT i WITH onEdge; CONNECT i WITH onEdge;", TRAP) == "ERR_ALRDYCNT"


def test_order_without_a_trap_is_an_error() -> None:
    assert error_of("ISignalDI di1, HIGH, i;", TRAP) == "ERR_UNKINO"


def test_edge_is_lost_while_the_task_is_stopped() -> None:
    bench = watching()
    bench.task.stop()
    bench.set("di1", 1)
    bench.task.start()
    bench.run(0.2)
    assert bench.read("n") == "0"


def test_trap_is_not_interrupted_by_another() -> None:
    trap = 'VAR intnum i; TRAP onEdge TPWrite "in"; WaitTime 0.1; TPWrite "out"; ENDTRAP\n'
    bench = watching(trap=trap)
    bench.set("di1", 1)
    bench.set("di1", 0)
    bench.set("di1", 1)
    bench.run(0.5)
    assert bench.lines == ["in", "out", "in", "out"]


def test_wait_goes_on_behind_the_trap_and_keeps_its_time() -> None:
    bench = watching(rest='WaitTime 0.1; TPWrite "over";')
    bench.run(0.05)
    bench.set("di1", 1)
    bench.run(0.04)
    assert bench.lines == ["trap"]
    bench.run(0.02)
    assert bench.lines == ["trap", "over"]


def test_trap_knows_its_interrupt_number() -> None:
    trap = "VAR intnum i; VAR intnum j; VAR bool same; TRAP onEdge same := INTNO = j; ENDTRAP\n"
    order = "CONNECT i WITH onEdge; CONNECT j WITH onEdge; ISignalDI di1, HIGH, i; ISignalDI di2, HIGH, j; "
    bench = watching(order, trap)
    bench.set("di1", 1)
    assert bench.read("same") == "FALSE"
    bench.set("di2", 1)
    assert bench.read("same") == "TRUE"


def test_timer_comes_again_and_again_at_its_time() -> None:
    bench = watching("CONNECT i WITH onEdge; ITimer 0.1, i; ", rest="WaitTime 10;")
    bench.task.advance(0.35)
    assert bench.read("n") == "3"


def test_timer_does_not_catch_up_on_the_time_the_task_was_stopped() -> None:
    bench = watching("CONNECT i WITH onEdge; ITimer 0.1, i; ", rest="WaitTime 100;")
    bench.task.stop()
    bench.task.advance(10.0)
    bench.task.start()
    bench.task.advance(0.01)
    assert bench.read("n") == "1"


def test_single_timer_comes_once() -> None:
    bench = watching("CONNECT i WITH onEdge; ITimer \\Single, 0.05, i; ", rest="WaitTime 10;")
    bench.run(0.3)
    assert bench.read("n") == "1"


def test_timer_that_is_too_fast_is_an_error() -> None:
    assert error_of("CONNECT i WITH onEdge; ITimer 0.05, i;", TRAP) == "ERR_ARGVALERR"


def test_error_in_a_trap_without_handler_stops_the_task() -> None:
    bench = watching(trap="VAR intnum i; VAR num n; TRAP onEdge n := 1 / 0; ENDTRAP\n", rest=IDLE + " ERROR TRYNEXT;")
    bench.set("di1", 1)
    assert (bench.stop.error, bench.stop.routine) == ("ERR_DIVZERO", "onEdge")
