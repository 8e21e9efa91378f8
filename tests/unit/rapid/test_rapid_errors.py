"""Error handling: handlers, RETRY, TRYNEXT, RAISE, and long jumps over execution levels."""

import pytest
from rapid_bench import Bench, error_of, started

from virtual_irc5.rapid.states import EventKind, Execution
from virtual_irc5.rapid.types import RapidReferenceError

FAILING = "PROC fail() RAISE 7; ENDPROC"


def test_handler_sees_the_error_number() -> None:
    assert started('n := 1 / 0; ERROR IF ERRNO = ERR_DIVZERO TPWrite "caught";', "VAR num n;").lines == ["caught"]


def test_end_of_the_handler_leaves_the_routine() -> None:
    procedure = 'PROC p() RAISE 1; TPWrite "never"; ERROR TPWrite "handled"; ENDPROC'
    assert started('p; TPWrite "back";', procedure).lines == ["handled", "back"]


def test_trynext_goes_on_behind_the_statement_that_failed() -> None:
    body = 'IF TRUE THEN n := 1 / 0; TPWrite "inside"; ENDIF TPWrite "behind"; ERROR TRYNEXT;'
    assert started(body, "VAR num n;").lines == ["inside", "behind"]


def test_trynext_behind_a_failed_condition_skips_the_whole_if() -> None:
    body = 'IF 1 / 0 = 1 THEN TPWrite "inside"; ENDIF TPWrite "behind"; ERROR TRYNEXT;'
    assert started(body).lines == ["behind"]


def test_retry_evaluates_the_statement_anew() -> None:
    body = "result := 6 / n; ERROR n := 2; RETRY;"
    assert started(body, "VAR num n; VAR num result;").read("result") == "3"


def test_retry_calls_the_functions_of_the_statement_again() -> None:
    function = 'VAR num n; VAR num r; FUNC num one() TPWrite "one"; RETURN 1; ENDFUNC'
    assert started("r := one() / n; ERROR n := 1; RETRY;", function).lines == ["one", "one"]


def test_retry_that_never_helps_becomes_an_error_of_its_own() -> None:
    bench = started("n := 1 / 0; ERROR Incr tries; RETRY;", "VAR num n; VAR num tries;")
    assert (bench.stop.error, bench.read("tries")) == ("ERR_EXCRTYMAX", "5")
    assert "RETRY was tried 4 times in vain; the error was: 1 is divided by zero." in bench.stop.sentence


def test_return_in_the_handler_of_a_function_gives_a_value() -> None:
    function = "FUNC num safe(num x, num y) RETURN x / y; ERROR IF ERRNO = ERR_DIVZERO RETURN -1; RAISE; ENDFUNC"
    assert started("n := safe(1, 0);", f"VAR num n; {function}").read("n") == "-1"


def test_error_goes_to_the_caller_when_the_routine_has_no_handler() -> None:
    assert started('fail; ERROR TPWrite ""\\Num:=ERRNO;', FAILING).lines == ["7"]


def test_raise_in_a_handler_passes_the_error_on() -> None:
    middle = 'PROC middle() fail; ERROR TPWrite "middle"; RAISE; ENDPROC'
    assert started('middle; TPWrite "on"; ERROR TRYNEXT;', f"{FAILING} {middle}").lines == ["middle", "on"]


def test_trynext_in_the_caller_goes_on_behind_the_call() -> None:
    assert started('fail; TPWrite "behind"; ERROR TRYNEXT;', FAILING).lines == ["behind"]


def test_error_inside_a_handler_stops_the_task() -> None:
    body = "n := 1 / 0; ERROR n := 5 MOD 0; TRYNEXT;"
    assert error_of("p; ERROR TRYNEXT;", f"VAR num n; PROC p() {body} ENDPROC") == "ERR_DIVZERO"


def test_routine_called_by_a_handler_may_have_its_own_handler() -> None:
    procedure = 'PROC p() RAISE 2; ERROR TPWrite "inner"; TRYNEXT; ENDPROC'
    assert started('RAISE 1; ERROR p; TPWrite "outer"; TRYNEXT;', procedure).lines == ["inner", "outer"]


def test_handler_with_numbers_takes_those_only() -> None:
    assert started('RAISE 3; ERROR (2, 3) TPWrite "listed"; TRYNEXT;').lines == ["listed"]
    stop = started('RAISE 4; ERROR (2, 3) TPWrite "listed"; TRYNEXT;').stop
    assert (stop.kind, stop.number) == (EventKind.ERROR, 4)


def test_booked_errors_have_numbers_of_their_own_and_keep_their_name() -> None:
    bench = started("BookErrNo ERR_A; BookErrNo ERR_B; RAISE ERR_B;", "VAR errnum ERR_A := -1; VAR errnum ERR_B := -1;")
    assert bench.read("ERR_A") != bench.read("ERR_B")
    assert bench.stop.error == "ERR_B"


def test_raise_of_a_number_that_is_not_booked_is_illegal() -> None:
    assert error_of("RAISE 91;") == "ERR_ILLRAISE"


@pytest.mark.parametrize("statement", ["RETRY;", "TRYNEXT;", "RAISE;"])
def test_handler_statement_outside_of_a_handler_is_refused(statement: str) -> None:
    with pytest.raises(RapidReferenceError, match="may only stand in an error handler"):
        Bench(statement).task.move_pp_to_main()


def test_long_jump_skips_handlers_that_do_not_list_the_number() -> None:
    low = "PROC low() RAISE 5; ERROR (5) RAISE 5; ENDPROC"
    middle = 'PROC middle() low; ERROR TPWrite "never"; ENDPROC'
    assert started('middle; TPWrite "on"; ERROR (5) TPWrite "top"; TRYNEXT;', f"{low} {middle}").lines == ["top", "on"]


def test_error_without_handler_stops_the_task_and_is_reported() -> None:
    bench = started("\nn := 1;\nn := n / 0;", "VAR num n;")
    stop = bench.stop
    assert (stop.kind, stop.error, stop.module, stop.routine, stop.line) == (
        EventKind.ERROR,
        "ERR_DIVZERO",
        "M",
        "main",
        6,
    )
    assert stop.sentence == "T_ROB_R stopped in M/main, line 6, with ERR_DIVZERO: 1 is divided by zero."
    assert bench.task.execution is Execution.STOPPED


def test_start_after_an_error_tries_the_statement_again() -> None:
    bench = started("result := 6 / n;", "VAR num n; VAR num result;")
    bench.task.write("M", "n", "2")
    bench.task.start()
    bench.task.advance(0.004)
    assert (bench.read("result"), bench.stop.kind) == ("3", EventKind.FINISHED)


# UNDO: what a procedure does when it is abandoned

INNER = 'PROC inner() RAISE 5; UNDO TPWrite "inner"; ENDPROC'
UNDOING = f'{INNER} PROC outer() inner; TPWrite "never"; UNDO TPWrite "outer"; ENDPROC'


def test_procedures_that_an_error_abandons_execute_undo_from_the_top_down() -> None:
    assert started('outer; ERROR TPWrite "handler"; TRYNEXT;', UNDOING).lines == ["inner", "outer", "handler"]


def test_procedures_that_a_long_jump_abandons_execute_undo() -> None:
    low = 'PROC low() RAISE 5; ERROR (5) RAISE 5; UNDO TPWrite "low"; ENDPROC'
    assert started('low; ERROR (5) TPWrite "top"; TRYNEXT;', low).lines == ["low", "top"]


def test_procedure_that_ends_by_itself_executes_no_undo() -> None:
    procedure = 'PROC p() TPWrite "p"; UNDO TPWrite "never"; ENDPROC PROC q() RETURN; UNDO TPWrite "never"; ENDPROC'
    assert started("p; q;", procedure).lines == ["p"]


def test_error_that_is_handled_in_the_procedure_itself_executes_no_undo() -> None:
    procedure = 'PROC p() RAISE 5; ERROR TPWrite "handled"; UNDO TPWrite "never"; ENDPROC'
    assert started("p;", procedure).lines == ["handled"]


def test_undo_sees_the_data_of_its_procedure_and_may_wait() -> None:
    procedure = "PROC p(num given) VAR num own; own := 2 * given; RAISE 5; UNDO WaitTime 0.1; n := own; ENDPROC"
    bench = started("p 4; ERROR m := n; TRYNEXT;", f"VAR num n; VAR num m; {procedure}")
    assert bench.read("m") == "0"
    bench.run(0.2)
    assert bench.read("m") == "8"


def test_routine_that_undo_calls_is_abandoned_without_its_own_undo() -> None:
    called = 'PROC called() RAISE 6; ERROR RAISE; UNDO TPWrite "never"; ENDPROC'
    bench = started("p; ERROR TRYNEXT;", f"{called} PROC p() RAISE 5; UNDO called; ENDPROC")
    assert (bench.stop.number, bench.lines) == (6, [])


def test_error_that_a_routine_called_by_undo_handles_does_not_disturb_what_is_abandoned() -> None:
    called = 'PROC called() RAISE 6; ERROR TPWrite "called"; TRYNEXT; ENDPROC'
    outer = 'PROC outer() p; UNDO TPWrite "outer"; ENDPROC'
    body = 'outer; ERROR TPWrite ""\\Num:=ERRNO; TRYNEXT;'
    assert started(body, f"{called} {outer} PROC p() RAISE 5; UNDO called; ENDPROC").lines == ["called", "outer", "5"]


def test_trap_comes_after_undo() -> None:
    program = "CONNECT i WITH trapped; ISignalDI di1,HIGH,i; p; WaitTime 10; ERROR TRYNEXT;"
    trap = 'TRAP trapped TPWrite "trapped"; ENDTRAP'
    undo = 'PROC p() RAISE 5; UNDO WaitTime 0.1; TPWrite "undone"; ENDPROC'
    bench = started(program, f"VAR intnum i; {trap} {undo}")
    bench.set("di1", 1.0)
    bench.run(0.2)
    assert bench.lines == ["undone", "trapped"]


def test_error_in_undo_at_pp_to_main_is_reported_once_and_pp_is_moved() -> None:
    bench = started("p;", "VAR num n; PROC p() WaitTime 10; UNDO n := 1 / 0; ENDPROC")
    bench.task.stop()
    bench.task.move_pp_to_main()
    assert [event.error for event in bench.host.events] == ["ERR_DIVZERO"]
    assert (bench.task.execution, bench.task.is_running) == (Execution.READY, False)


def test_pp_to_main_executes_undo_of_the_procedures_it_leaves() -> None:
    bench = started("p;", 'PROC p() WaitTime 10; UNDO TPWrite "undone"; ENDPROC')
    bench.task.stop()
    bench.task.move_pp_to_main()
    assert bench.lines == ["undone"]


def test_undo_that_does_not_end_does_not_keep_pp_from_main() -> None:
    bench = started("p;", "VAR num n; PROC p() WaitTime 10; UNDO WHILE TRUE DO n := n + 1; ENDWHILE ENDPROC")
    bench.task.stop()
    bench.task.move_pp_to_main()
    assert bench.task.execution is Execution.READY


@pytest.mark.parametrize("clause", ["UNDO", "BACKWARD"])
def test_clauses_that_are_executed_rarely_have_to_fit(clause: str) -> None:
    with pytest.raises(RapidReferenceError, match="a bool is found where a num is needed"):
        Bench(f"{clause} WaitTime TRUE;").task.move_pp_to_main()


@pytest.mark.parametrize("clause", ["UNDO", "BACKWARD"])
def test_functions_have_no_undo_and_no_backward(clause: str) -> None:
    with pytest.raises(RapidReferenceError, match=f"'f' has {clause}, which procedures alone may have"):
        Bench("", f"FUNC num f() RETURN 1; {clause} ENDFUNC").task.move_pp_to_main()


def test_handler_of_all_errors_takes_long_jumps_of_any_number() -> None:
    low = "PROC low() RAISE 5; ERROR (5) RAISE 5; ENDPROC"
    assert started('low; ERROR (LONG_JMP_ALL_ERR) TPWrite "all"; TRYNEXT;', low).lines == ["all"]
