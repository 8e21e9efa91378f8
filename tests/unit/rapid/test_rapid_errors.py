"""Error handling: handlers, RETRY, TRYNEXT, RAISE, and long jumps over execution levels."""

import pytest
from rapid_bench import Bench, error_of, started

from yumi.rapid import EventKind, Execution, RapidReferenceError

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


def test_raise_of_a_number_nobody_booked_is_illegal() -> None:
    assert error_of("RAISE 91;") == "ERR_ILLRAISE"


@pytest.mark.parametrize("statement", ["RETRY;", "TRYNEXT;", "RAISE;"])
def test_handler_statement_outside_of_a_handler_is_refused(statement: str) -> None:
    with pytest.raises(RapidReferenceError, match="may only stand in an error handler"):
        Bench(statement).task.move_pp_to_main()


def test_long_jump_skips_handlers_that_do_not_list_the_number() -> None:
    low = "PROC low() RAISE 5; ERROR (5) RAISE 5; ENDPROC"
    middle = 'PROC middle() low; ERROR TPWrite "never"; ENDPROC'
    assert started('middle; TPWrite "on"; ERROR (5) TPWrite "top"; TRYNEXT;', f"{low} {middle}").lines == ["top", "on"]


def test_error_nobody_handles_stops_the_task_and_is_reported() -> None:
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
