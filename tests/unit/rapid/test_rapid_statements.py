"""Statements: the structure of programs."""

import pytest
from rapid_bench import Bench, error_of, started

from virtual_irc5.rapid.states import EventKind
from virtual_irc5.rapid.types import RapidReferenceError


def test_if_takes_the_first_true_branch() -> None:
    body = 'FOR i FROM 1 TO 3 DO IF i=1 THEN TPWrite "a"; ELSEIF i=2 THEN TPWrite "b"; ELSE TPWrite "c"; ENDIF ENDFOR'
    assert started(body).lines == ["a", "b", "c"]


def test_for_counts_down_by_itself() -> None:
    assert started('FOR i FROM 2 TO 0 DO TPWrite ""\\Num:=i; ENDFOR').lines == ["2", "1", "0"]


def test_for_with_step_stays_inside_its_bounds() -> None:
    assert started('FOR i FROM 1 TO 6 STEP 2 DO TPWrite ""\\Num:=i; ENDFOR').lines == ["1", "3", "5"]


def test_for_with_a_step_away_from_its_end_does_nothing() -> None:
    assert started('FOR i FROM 1 TO 3 STEP -1 DO TPWrite "never"; ENDFOR').lines == []


def test_loop_variable_hides_a_datum_and_is_constant() -> None:
    with pytest.raises(RapidReferenceError, match="'i' cannot be changed here"):
        Bench("FOR i FROM 1 TO 2 DO i := 5; ENDFOR", "VAR num i;").task.move_pp_to_main()


def test_while_runs_until_its_condition_fails() -> None:
    assert started("WHILE n < 3 DO Incr n; ENDWHILE", "VAR num n;").read("n") == "3"


def test_test_takes_the_case_that_lists_the_value() -> None:
    cases = 'CASE 1,3: TPWrite "odd"; CASE 2: TPWrite "two"; DEFAULT: TPWrite "else";'
    assert started(f"FOR i FROM 1 TO 4 DO TEST i {cases} ENDTEST ENDFOR").lines == ["odd", "two", "odd", "else"]


def test_test_compares_strings() -> None:
    assert started('TEST "b" CASE "a": TPWrite "a"; CASE "b": TPWrite "b"; ENDTEST').lines == ["b"]


def test_goto_leaves_nested_loops() -> None:
    body = 'WHILE TRUE DO FOR i FROM 1 TO 9 DO IF i = 3 GOTO out; ENDFOR ENDWHILE out: TPWrite "out";'
    assert started(body).lines == ["out"]


def test_goto_repeats_from_a_label_above() -> None:
    assert started("again: Incr n; IF n < 5 GOTO again;", "VAR num n;").read("n") == "5"


def test_goto_into_a_block_is_refused() -> None:
    with pytest.raises(RapidReferenceError, match="there is no label 'inside' that this GOTO could reach"):
        Bench("GOTO inside; IF TRUE THEN inside: ENDIF").task.move_pp_to_main()


def test_return_leaves_the_routine_from_inside_a_loop() -> None:
    procedure = "PROC p() WHILE TRUE DO RETURN; ENDWHILE ENDPROC"
    assert started('p; TPWrite "back";', procedure).lines == ["back"]


def test_exit_ends_the_program_and_takes_the_program_pointer_away() -> None:
    bench = started('p; TPWrite "never";', "PROC p() EXIT; ENDPROC")
    assert (bench.lines, bench.stop.kind) == ([], EventKind.EXIT)


def test_stop_instruction_stops_and_start_goes_on_behind_it() -> None:
    bench = started('TPWrite "a"; Stop; TPWrite "b";')
    assert (bench.lines, bench.stop.kind) == (["a"], EventKind.STOP)
    bench.task.start()
    bench.task.advance(0.004)
    assert bench.lines == ["a", "b"]


def test_routine_data_are_new_in_each_call() -> None:
    procedure = 'PROC p() VAR num n := 1; Incr n; TPWrite ""\\Num:=n; ENDPROC'
    assert started("p; p;", procedure).lines == ["2", "2"]


def test_routine_data_hide_module_data() -> None:
    bench = started("p;", 'VAR num n := 5; PROC p() VAR string n := "mine"; TPWrite n; ENDPROC')
    assert (bench.lines, bench.read("n")) == (["mine"], "5")


def test_name_declared_twice_in_a_routine_is_refused() -> None:
    with pytest.raises(RapidReferenceError, match="'N' is declared twice in 'p'"):
        Bench("", "PROC p(num n) VAR num N; ENDPROC").task.move_pp_to_main()


def test_late_call_finds_the_procedure_by_its_name() -> None:
    procedures = 'PROC part1(string t) TPWrite "1"+t; ENDPROC PROC part2(string t) TPWrite "2"+t; ENDPROC'
    assert started('FOR i FROM 1 TO 2 DO %"part"+NumToStr(i,0)% "!"; ENDFOR', procedures).lines == ["1!", "2!"]


def test_late_call_of_an_unknown_procedure_is_an_error() -> None:
    assert error_of('%"nowhere"%;') == "ERR_REFUNKPRC"


def test_late_call_with_wrong_arguments_is_an_error() -> None:
    assert error_of('%"p"% 1;', "PROC p() ENDPROC") == "ERR_CALLPROC"


def test_call_by_var_appends_the_number() -> None:
    assert started('CallByVar "p", 3;', 'PROC p3() TPWrite "p3"; ENDPROC').lines == ["p3"]


def test_endless_recursion_is_an_error() -> None:
    assert error_of("main;") == "ERR_EXECPHR"


def test_endless_loop_without_a_wait_does_not_hang_the_controller() -> None:
    bench = started("WHILE TRUE DO Incr n; ENDWHILE", "VAR num n;")
    first = float(bench.read("n"))
    bench.task.advance(0.001)
    assert 100 < first < 2000
    assert first < float(bench.read("n")) < 4000


@pytest.mark.parametrize(
    "statement", ["<SMT>", "<VAR> := 1;", "x := <EXP>;", "TPWrite <ARG>;", "IF <EXP> THEN\n<SMT>\nENDIF"]
)
def test_program_with_placeholders_runs_up_to_the_first_one(statement: str) -> None:
    bench = started(f'TPWrite "before";\n{statement}\nTPWrite "never";', "VAR num x; <DDN> <RDN>")
    assert (bench.lines, bench.stop.error, bench.stop.line) == (["before"], "NOT_PROVIDED", 5)
    assert "is a placeholder: complete the statement" in bench.stop.sentence
