"""The linker: declarations that depend on each other, and those that do not fit."""

import pytest
from rapid_bench import Bench, started

from virtual_irc5.rapid.types import RapidReferenceError


def refusal(declarations: str) -> str:
    with pytest.raises(RapidReferenceError) as caught:
        Bench("", declarations).task.move_pp_to_main()
    return str(caught.value)


def test_constants_may_be_used_before_they_are_declared() -> None:
    bench = started("", "VAR num a{N} := [B,B]; CONST num B := 2 * C; CONST num C := N + 1; CONST num N := 2;")
    assert bench.read("a") == "[6,6]"


def test_constants_and_records_come_from_other_modules() -> None:
    bench = Bench("", "VAR Point p := [X,1];")
    bench.task.load("MODULE Other RECORD Point num x; num y; ENDRECORD CONST num X := 5; ENDMODULE", "other.mod")
    assert bench.start().read("p") == "[5,1]"


def test_record_may_contain_a_record_declared_later() -> None:
    bench = started("o.inner.x := 4;", "RECORD Outer Inner inner; ENDRECORD RECORD Inner num x; ENDRECORD VAR Outer o;")
    assert bench.read("o") == "[[4]]"


def test_alias_is_the_same_type_under_another_name() -> None:
    bench = started("l := n; n := l + 1;", "ALIAS num level; VAR level l; VAR num n := 2;")
    assert (bench.read("n"), bench.task.type_of("M", "l")) == ("3", "level")


def test_component_called_like_a_python_keyword_works() -> None:
    assert started("x.class := 2;", "RECORD R num class; num def; ENDRECORD VAR R x;").read("x") == "[2,0]"


def test_datum_may_have_the_name_of_its_type() -> None:
    assert started("pose.trans.x := 1;", "VAR pose pose;").read("pose") == "[[1,0,0],[0,0,0,0]]"


@pytest.mark.parametrize(
    ("declarations", "sentence"),
    [
        ("CONST num x;", "the constant 'x' needs a value"),
        ("CONST num a := b; CONST num b := a;", "depends on itself"),
        ("RECORD R R again; ENDRECORD VAR R x;", "the type 'R' contains itself"),
        ("VAR num a{0};", "the array 'a' needs one to three sizes of at least 1"),
        ("VAR num a{1,1,1,1};", "the array 'a' needs one to three sizes of at least 1"),
        ("VAR num a{2} := [1];", "an aggregate of 1 is found where a num{2} is needed"),
        ("VAR num a; VAR num b := a;", "'a' is not a constant, which a declaration needs"),
        ("VAR num a := Sin(1);", "a declaration cannot call a function"),
        ("CONST num a := 1 / 0;", "the value of 'a' cannot be computed: 1 is divided by zero."),
    ],
)
def test_declaration_that_does_not_fit_is_refused(declarations: str, sentence: str) -> None:
    assert sentence in refusal(declarations)


def test_name_declared_twice_in_a_module_is_refused_at_once() -> None:
    with pytest.raises(RapidReferenceError, match="M, line 2: 'Same' is declared twice"):
        Bench("", "VAR num same; PROC Same() ENDPROC")


@pytest.mark.parametrize(
    ("declaration", "name"), [("CONST num x := 1;", "x"), ("PROC Main() ENDPROC", "Main"), ("ALIAS num X;", "X")]
)
def test_global_name_of_another_module_is_refused_when_the_module_is_loaded(declaration: str, name: str) -> None:
    bench = Bench("", "VAR num x;")
    with pytest.raises(RapidReferenceError, match=f"Other, line 2: '{name}' is global in the module 'M', too"):
        bench.task.load(f"MODULE Other\n{declaration} ENDMODULE", "other.mod")
    assert [module.name for module in bench.task.modules] == ["M"]


def test_local_name_may_be_that_of_another_module() -> None:
    bench = Bench("", "VAR num x := 1;")
    bench.task.load("MODULE Other LOCAL VAR num x := 2; PROC p() ENDPROC ENDMODULE", "other.mod")
    assert (bench.start().read("x"), bench.task.read("Other", "x")) == ("1", "2")


def test_persistent_of_a_routine_is_refused() -> None:
    with pytest.raises(RapidReferenceError, match="'x' is persistent, which data of routines cannot be"):
        Bench("PERS num x := 1;")


def test_error_has_file_line_and_column() -> None:
    bench = Bench('x := "";', "VAR num x;")
    with pytest.raises(RapidReferenceError) as caught:
        bench.task.move_pp_to_main()
    assert (caught.value.filename, caught.value.line, caught.value.column) == ("M.mod", 4, 6)


UNRESOLVED = {
    "missing;": "ERR_REFUNKPRC",
    "x := missing(1);": "ERR_REFUNKFUN",
    "x := missing;": "ERR_REFUNKDAT",
    "missing := 1;": "ERR_REFUNKDAT",
    "Set missing;": "ERR_REFUNKDAT",
    "CONNECT i WITH missing;": "ERR_REFUNKTRP",
    "Incr odd;": "ERR_REFUNKDAT",
    "x := DERIVED;": "ERR_REFUNKDAT",
    "WHILE missing > 1 DO ENDWHILE": "ERR_REFUNKDAT",
    "IF FALSE THEN x := 1; ELSEIF missing THEN x := 2; ENDIF": "ERR_REFUNKDAT",
    "TEST 5 CASE missing: x := 1; ENDTEST": "ERR_REFUNKDAT",
    "FOR n FROM 1 TO missing DO ENDFOR": "ERR_REFUNKDAT",
    "takes x;": "ERR_REFUNKDAT",
    "within;": "ERR_REFUNKDAT",
    '%"missing"%;': "ERR_REFUNKPRC",
    "Set do1 \\NoSuchArgument;": "NOT_PROVIDED",
}
DECLARED = """VAR num x; VAR intnum i; VAR nothing odd; CONST num DERIVED := 2 * MISSING;
PROC takes(nothing n) ENDPROC
PROC within() VAR nothing n; TPWrite "declared"; Incr n; ENDPROC
"""


@pytest.mark.parametrize("statement", UNRESOLVED)
def test_name_that_nothing_declares_is_an_error_where_it_is_used(statement: str) -> None:
    bench = started(f'TPWrite "before";\n{statement}\nTPWrite "after";', DECLARED)
    assert (bench.stop.error, bench.lines[0], "after" in bench.lines) == (UNRESOLVED[statement], "before", False)
    assert bench.stop.line in (4, 5, 8)


def test_statement_that_is_not_reached_may_name_what_nothing_declares() -> None:
    bench = started('IF x = 1 THEN missing; ELSEIF x = 0 THEN TPWrite "fine"; ELSEIF odd THEN ENDIF', DECLARED)
    assert (bench.lines, bench.stop.error) == (["fine"], "")


def test_handler_takes_the_error_of_an_unknown_name() -> None:
    handler = 'ERROR (ERR_OF_ANOTHER_OPTION, ERR_REFUNKPRC) TPWrite "handled"; TRYNEXT;'
    assert started(f"missing; {handler}").lines == ["handled"]


@pytest.mark.parametrize("statement", ["enlarge 1;", "total := total + 1;", "IF total < 9 total := total + 1;"])
def test_name_is_known_as_soon_as_its_module_is_loaded(statement: str) -> None:
    bench = started(f"WHILE TRUE DO WaitTime 1; {statement} ENDWHILE")
    bench.task.load("MODULE Late VAR num total; PROC enlarge(num n) total := total + n; ENDPROC ENDMODULE", "late.mod")
    bench.run(2.5)
    assert bench.task.read("Late", "total") == "2"


FAULTS = """MODULE Faulty
VAR nothing a;
CONST num b;
PROC p()
    VAR num x := "text";
    missing;
    IF y THEN
        Incr "1";
    ELSEIF 1 THEN
        a := 1;
    ENDIF
    WHILE TRUE DO
        GOTO nowhere;
    ENDWHILE
    Incr b2;
UNDO
    RETRY;
ENDPROC
VAR num b2;
FUNC num f()
    RETURN;
ENDFUNC
ENDMODULE
"""


def test_all_faults_of_a_program_are_listed_with_file_line_and_column() -> None:
    bench = Bench("x := 1;")
    bench.task.load(FAULTS, "HOME:/faulty.mod")
    faults = [(fault.filename, fault.line, fault.column) for fault in bench.task.faults()]
    lines = {(2, 13), (3, 11), (5, 18), (6, 5), (7, 8), (8, 9), (9, 12), (10, 9), (13, 9), (17, 5), (21, 5)}
    assert faults == [("M.mod", 4, 1), *(("HOME:/faulty.mod", *each) for each in sorted(lines))]


def test_program_that_fits_has_no_faults() -> None:
    bench = Bench("x := x + 1;", "VAR num x;")
    assert bench.task.faults() == []
    assert bench.start().read("x") == "1"
