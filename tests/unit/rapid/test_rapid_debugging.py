"""What a debugger does to a task: breakpoints, and the data of routines under way."""

from __future__ import annotations

import pytest
from rapid_bench import Bench

from virtual_irc5.rapid.states import EventKind
from virtual_irc5.rapid.types import RapidReferenceError, RapidValueError, UnknownSymbol

LOOP = "n := 0;\nWHILE TRUE DO\nn := n + 1;\nWaitTime 0.1;\nENDWHILE"
CALLS = """VAR num n;
PROC down(num depth \\num spare)
VAR num own;
IF depth > 1 down depth - 1;
own := depth;
WaitTime 1;
ENDPROC"""


@pytest.fixture
def loop() -> Bench:
    """Lines 4 to 8 of the module are the loop."""
    bench = Bench(LOOP, "VAR num n;")
    bench.task.move_pp_to_main()
    return bench


def test_breakpoint_that_is_set_while_the_program_runs_is_hit(loop: Bench) -> None:
    loop.task.start(stop_at_breakpoints=True)
    loop.run(0.25)
    loop.task.set_breakpoint("m", 6)
    loop.run(0.15)
    assert (loop.stop.kind, loop.stop.line, loop.task.is_running) == (EventKind.BREAKPOINT, 6, False)
    assert loop.read("n") == "3"


def test_breakpoint_that_is_cleared_while_the_program_runs_is_not_hit(loop: Bench) -> None:
    loop.task.set_breakpoint("M", 6)
    loop.task.start(stop_at_breakpoints=True)
    loop.run(0.1)
    loop.task.start(stop_at_breakpoints=True)
    loop.run(0.05)
    loop.task.clear_breakpoints("M", [6])
    loop.run(0.5)
    assert loop.task.is_running
    assert loop.task.breakpoints == ()


def test_breakpoint_that_is_set_between_start_and_first_statement_does_not_hold_the_start(loop: Bench) -> None:
    loop.task.start(stop_at_breakpoints=True)
    loop.task.set_breakpoint("M", 4)  # where the program pointer stands
    loop.run(0.1)
    assert loop.task.is_running


def test_start_without_breakpoints_passes_over_all(loop: Bench) -> None:
    loop.task.set_breakpoint("M", 6)
    loop.task.start()
    loop.run(0.1)
    loop.task.set_breakpoint("M", 7)
    loop.run(0.3)
    assert loop.task.is_running


def test_statements_are_watched_only_while_there_are_breakpoints(loop: Bench) -> None:
    """A program without them executes as fast as one that was started to pass over all."""
    machine = loop.task.machine
    loop.task.start(stop_at_breakpoints=True)
    loop.run(0.05)
    watched = [machine.pause is not None]
    loop.task.set_breakpoint("M", 4)
    watched.append(machine.pause is not None)
    loop.task.clear_breakpoints("M", [4])
    watched.append(machine.pause is not None)
    assert watched == [False, True, False]


@pytest.mark.parametrize("line", [0, 2, 3, 8, 99])
def test_breakpoint_stands_on_a_line_where_a_statement_begins(loop: Bench, line: int) -> None:
    with pytest.raises(RapidReferenceError, match=f"No statement of the module 'M' begins on line {line}"):
        loop.task.set_breakpoint("M", line)
    for known in (4, 5, 6, 7):
        loop.task.set_breakpoint("M", known)
    with pytest.raises(UnknownSymbol, match="has no module 'Other'"):
        loop.task.set_breakpoint("Other", 4)


def test_data_of_each_call_of_a_routine_are_read_and_written() -> None:
    bench = Bench("down 3;", CALLS).start()
    task = bench.task
    assert [task.read(f"%{number}", "depth") for number in (1, 2, 3)] == ["1", "2", "3"]
    assert task.read("m/DOWN", "Depth") == "1", "the innermost call"
    assert task.symbols("%1") == ("depth", "own"), "an optional parameter that was not passed has no value"
    assert task.symbols("%4") == ()
    task.write("%2", "own", "7")
    assert [task.read(f"%{number}", "own") for number in (1, 2, 3)] == ["1", "7", "0"]
    assert (task.kind_of("%1", "depth"), task.kind_of("%1", "own"), task.type_of("%1", "own")) == ("par", "var", "num")
    for block in ("%0", "%5", "%x", "M/up", "M/main/x"):
        with pytest.raises(UnknownSymbol):
            task.read(block, "depth")
    with pytest.raises(UnknownSymbol, match="The routine 'down' has no datum 'spare' here"):
        task.read("%1", "spare")


def test_loop_variable_is_visible_in_its_loop_alone_and_hides_an_outer_one() -> None:
    body = """FOR i FROM 1 TO 2 DO
FOR i FROM 10 TO 10 DO
WaitTime 1;
ENDFOR
WaitTime 1;
ENDFOR
WaitTime 1;"""
    bench = Bench(body).start()
    seen = []
    for _ in range(5):
        seen.append(bench.task.read("%1", "i") if bench.task.symbols("%1") else "")
        bench.run(1.0)
    assert seen == ["10", "1", "10", "2", ""]


def test_loop_variables_and_constants_of_routines_are_not_written() -> None:
    bench = Bench("CONST num c := 2;\nFOR i FROM 1 TO 2 DO\nWaitTime 1;\nENDFOR").start()
    for name, what in (("i", "a loop variable"), ("c", "a constant")):
        with pytest.raises(RapidValueError, match=f"'{name}' is {what} and cannot be written"):
            bench.task.write("M/main", name, "5")


def test_elements_of_arrays_in_routines_have_values_and_sizes() -> None:
    declarations = "PROC sum(num row{*})\nWaitTime 1;\nENDPROC"
    bench = Bench("VAR num grid{2,2};\ngrid{2,1} := 7;\nsum [4,5,6];", declarations).start()
    task = bench.task
    assert (task.read("%1", "row"), task.read("%1", "row{2}")) == ("[4,5,6]", "5")
    assert task.dimensions_of("%1", "row") == (3,)
    assert (task.read("M/main", "grid{2,1}"), task.dimensions_of("%2", "grid")) == ("7", (2, 2))
    task.write("M/main", "grid{1,2}", "9")
    assert task.read("M/main", "grid") == "[[0,9],[7,0]]"
    with pytest.raises(UnknownSymbol, match="has no datum 'grid"):
        task.read("M/main", "grid{3,1}")


def test_datum_has_no_value_before_its_declaration_is_executed() -> None:
    bench = Bench("VAR num first := 1;\nVAR num second := 2;\nWaitTime 1;")
    bench.task.move_pp_to_main()
    bench.task.set_breakpoint("M", 5)
    bench.task.start(stop_at_breakpoints=True)
    bench.run(0.01)
    assert (bench.stop.line, bench.task.symbols("M/main")) == (5, ("first",))
