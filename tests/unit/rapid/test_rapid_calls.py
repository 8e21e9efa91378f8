"""Calls: how arguments reach parameters."""

import pytest
from rapid_bench import Bench, error_of, evaluated, started

from virtual_irc5.rapid.types import RapidReferenceError


def refusal(body: str, declarations: str) -> str:
    with pytest.raises(RapidReferenceError) as caught:
        Bench(body, declarations).task.move_pp_to_main()
    return str(caught.value)


def test_function_gives_its_value() -> None:
    assert evaluated("2 * square(3)", declarations="FUNC num square(num x) RETURN x * x; ENDFUNC") == "18"


def test_function_may_call_itself() -> None:
    factorial = "FUNC num factorial(num n) IF n < 2 RETURN 1; RETURN n * factorial(n - 1); ENDFUNC"
    assert evaluated("factorial(5)", declarations=factorial) == "120"


def test_function_may_wait() -> None:
    bench = started("n := slow() + slow();", "VAR num n; FUNC num slow() WaitTime 0.1; RETURN 4; ENDFUNC")
    assert bench.read("n") == "0"
    bench.run(0.3)
    assert bench.read("n") == "8"


def test_function_without_return_is_an_error() -> None:
    assert error_of("n := f();", "VAR num n; FUNC num f() ENDFUNC") == "ERR_FNCNORET"


def test_value_parameter_is_a_copy() -> None:
    bench = started("p n;", "VAR num n := 1; PROC p(num x) x := 2; ENDPROC")
    assert bench.read("n") == "1"


def test_var_parameter_is_the_variable_itself() -> None:
    bench = started("p n; p a{2}; p q.y;", "VAR num n; VAR num a{2}; VAR pos q; PROC p(VAR num x) x := 2; ENDPROC")
    assert (bench.read("n"), bench.read("a"), bench.read("q")) == ("2", "[0,2]", "[0,2,0]")


def test_pers_parameter_takes_persistents_only() -> None:
    procedure = "PERS num a := 1; VAR num b; PROC p(PERS num x) x := 2; ENDPROC"
    assert started("p a;", procedure).read("a") == "2"
    assert "'b' cannot be changed here" in refusal("p b;", procedure)


def test_inout_parameter_takes_variables_and_persistents() -> None:
    bench = started("p a; p b;", "PERS num a := 1; VAR num b; PROC p(INOUT num x) Incr x; ENDPROC")
    assert (bench.read("a"), bench.read("b")) == ("2", "1")


PREDEFINED = """
  PERS tooldata own:=[TRUE,[[0,0,1],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PROC show(PERS tooldata tool, PERS wobjdata wobj, INOUT loaddata load)
    TPWrite ArgName(tool) + ValToStr(tool.robhold) + ValToStr(wobj.ufprog) + ValToStr(load.mass);
    IF IsPers(tool) deeper tool;
  ENDPROC
  PROC deeper(PERS tooldata tool)
    TPWrite ValToStr(tool.tload.mass);
  ENDPROC
  PROC change(PERS tooldata tool)
    tool := own;
  ENDPROC
  PROC shift(INOUT tooldata tool)
    tool.tframe.trans.x := 5;
  ENDPROC
"""


def test_predefined_tool_work_object_and_load_are_passed_to_pers_and_inout_parameters() -> None:
    bench = started("show tool0, wobj0, load0;", PREDEFINED)
    assert bench.lines == ["tool0TRUETRUE0.001", "0.001"]


@pytest.mark.parametrize("call", ["change tool0;", "shift tool0;", 'SetDataVal "tool0", own;'])
def test_predefined_tool_is_not_changed_through_a_parameter(call: str) -> None:
    assert error_of(call, PREDEFINED) == "ERR_SYM_ACCESS"
    handled = f"{call} TPWrite ValToStr(tool0 = own); ERROR TPWrite ValToStr(tool0 = own); TRYNEXT;"
    assert started(handled, PREDEFINED).lines == ["FALSE", "FALSE"]


@pytest.mark.parametrize("assignment", ["tool0 := own;", "wobj0.ufprog := FALSE;", "load0.mass := 1;"])
def test_assignment_to_a_predefined_tool_work_object_or_load_is_refused(assignment: str) -> None:
    assert f"'{assignment[:5]}' cannot be changed here" in refusal(assignment, PREDEFINED)


def test_predefined_tool_is_not_a_variable_and_not_a_constant() -> None:
    assert "'tool0' cannot be changed here" in refusal("p tool0;", "PROC p(VAR tooldata tool) ENDPROC")
    assert "'tool0' is not a constant" in refusal("", "PERS tooldata copy := tool0;")


def test_interrupt_may_watch_a_predefined_persistent() -> None:
    body = "CONNECT watch WITH seen; IPers tool0, watch; change tool0; ERROR TRYNEXT;"
    bench = started(body, f'{PREDEFINED} VAR intnum watch; TRAP seen TPWrite "changed"; ENDTRAP')
    bench.run(0.1)
    assert bench.lines == []
    assert bench.stop.error == ""


def test_array_parameter_takes_any_size() -> None:
    total = "FUNC num total(num x{*}) VAR num s; FOR i FROM 1 TO Dim(x,1) DO s := s + x{i}; ENDFOR RETURN s; ENDFUNC"
    assert evaluated("total(a) + total([10,20])", declarations=f"CONST num a{{3}} := [1,2,3]; {total}") == "36"


ARRAYS = """
  VAR num three{3} := [1,2,3]; VAR num two{2} := [8,9]; VAR num zeros{3}; VAR num square{2,2} := [[1,2],[3,4]];
  VAR num wide{2,3}; VAR num copy{3}; VAR num copies{2,2};
  PROC keep(num a{*}) copy := a; ENDPROC
  PROC keep_all(num a{*,*}) copies := a; ENDPROC
  PROC fill(VAR num a{*}) a := three; ENDPROC
  PROC swap(VAR num a{*}, INOUT num b{*}) VAR num c{3}; c := a; a := b; b := c; ENDPROC
  FUNC bool same(num a{*}) RETURN three = a AND a = three; ENDFUNC
"""


@pytest.mark.parametrize(
    ("body", "values"),
    [
        ("keep three;", {"copy": "[1,2,3]"}),
        ("keep_all square;", {"copies": "[[1,2],[3,4]]"}),
        ("fill zeros;", {"zeros": "[1,2,3]"}),
        ("swap three, zeros;", {"three": "[0,0,0]", "zeros": "[1,2,3]"}),
        ("IF same(three) AND NOT same(two) AND NOT same(zeros) keep three;", {"copy": "[1,2,3]"}),
    ],
)
def test_array_parameter_is_assigned_and_compared_with_arrays_of_its_size(body: str, values: dict[str, str]) -> None:
    bench = started(body, ARRAYS)
    assert {name: bench.read(name) for name in values} == values


@pytest.mark.parametrize("body", ["keep two;", "keep_all wide;", "fill two;", "swap three, two;"])
def test_array_parameter_of_another_size_is_an_error_of_the_assignment(body: str) -> None:
    assert error_of(body, ARRAYS) == "ERR_INVDIM"
    bench = started(f"{body} ERROR IF ERRNO = ERR_INVDIM TRYNEXT;", ARRAYS)
    assert [bench.read(name) for name in ("copy", "copies", "two")] == ["[0,0,0]", "[[0,0],[0,0]]", "[8,9]"]


@pytest.mark.parametrize("value", ["two", "n", "square"])
def test_datum_of_other_dimensions_is_not_read_or_written_by_its_name(value: str) -> None:
    data = f"{ARRAYS} VAR num n; PERS num stored{{3}} := [4,5,6];"
    assert error_of(f'GetDataVal "stored", {value};', data) == "ERR_INVDIM"
    assert error_of(f'SetDataVal "stored", {value};', data) == "ERR_INVDIM"


def test_present_is_whether_an_optional_argument_was_passed() -> None:
    procedure = 'PROC p(\\num x) IF Present(x) THEN TPWrite ""\\Num:=x; ELSE TPWrite "none"; ENDIF ENDPROC'
    assert started("p; p\\x:=3;", procedure).lines == ["none", "3"]


def test_conditional_argument_is_passed_on_when_it_is_present() -> None:
    inner = 'PROC inner(\\switch on \\num x) IF Present(on) TPWrite "on"; IF Present(x) TPWrite ""\\Num:=x; ENDPROC'
    outer = "PROC outer(\\switch loud \\num y) inner\\on?loud\\x?y; ENDPROC"
    assert started("outer; outer\\loud; outer\\y:=7;", inner + "\n" + outer).lines == ["on", "7"]


def test_optional_parameter_that_is_absent_cannot_be_used() -> None:
    assert error_of("p;", "VAR num n; PROC p(\\num x) n := x; ENDPROC") == "ERR_NOTPRES"


def test_arguments_are_evaluated_from_left_to_right() -> None:
    routines = 'FUNC num say(num x) TPWrite ""\\Num:=x; RETURN x; ENDFUNC PROC p(num a, num b, num c) ENDPROC'
    assert started("p say(1), say(2), say(3);", routines).lines == ["1", "2", "3"]


def test_required_argument_may_be_named() -> None:
    assert started('p text:="named";', "PROC p(string text) TPWrite text; ENDPROC").lines == ["named"]


def test_signal_is_passed_as_a_parameter() -> None:
    bench = started("p do1;", "PROC p(VAR signaldo sig) SetDO sig, 1; ENDPROC")
    assert bench.host.signals["do1"] == 1.0


def test_local_routine_is_hidden_from_other_modules() -> None:
    bench = Bench("hidden;")
    bench.task.load("MODULE Other LOCAL PROC hidden() ENDPROC ENDMODULE", "other.mod")
    assert bench.start().stop.error == "ERR_REFUNKPRC"


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        ("p;", "'p' lacks the argument 'a'"),
        ("p 1, 2;", "'p' has too many arguments"),
        ("p TRUE;", "a bool is found where a num is needed"),
        ("p 1\\c;", "'p' has no optional argument '\\c'"),
        ("p 1\\on\\off;", "'p' is given two arguments that exclude each other"),
        ("p 1\\on\\on;", "'on' is given twice to 'p'"),
        ("p 1\\on:=TRUE;", "the switch '\\on' takes no value"),
        ("p 1\\b;", "'\\b' needs a value: '\\b:=...'"),
        ("p 1\\b?x;", "'x' is not an optional parameter of this routine"),
        ("q 1;", "'x' needs a datum, not an expression"),
        ("q s;", "'x' needs a num, not a string"),
        ("q c;", "'c' cannot be changed here"),
        ("f;", "'f' cannot be called as a procedure"),
        ("t;", "'t' cannot be called as a procedure"),
        ("s;", "'s' is not a procedure or instruction"),
        ("n := p(1);", "'p' is a procedure and gives no value"),
        ("n := s();", "'s' is not a function"),
        ("RETURN 1;", "RETURN takes no value in 'main'"),
    ],
)
def test_call_that_does_not_fit_is_refused(call: str, sentence: str) -> None:
    declarations = (
        "PROC p(num a \\switch on | switch off \\num b) ENDPROC PROC q(VAR num x) ENDPROC TRAP t ENDTRAP "
        "FUNC num f() RETURN 1; ENDFUNC VAR string s; VAR num n; CONST num c := 1;"
    )
    assert sentence in refusal(call, declarations)


def test_late_call_names_a_local_procedure_by_its_module() -> None:
    bench = Bench('%"Other:p"% 3; %"M:p"% 4;', 'PROC p(num n) TPWrite "M"\\Num:=n; ENDPROC')
    bench.task.load('MODULE Other LOCAL PROC p(num n) TPWrite "Other"\\Num:=n; ENDPROC ENDMODULE', "other.mod")
    assert bench.start().lines == ["Other3", "M4"]


@pytest.mark.parametrize("name", ["Nowhere:p", "M:nothing", "nothing"])
def test_late_call_of_what_does_not_exist_is_an_error(name: str) -> None:
    assert error_of(f'%"{name}"%;') == "ERR_REFUNKPRC"
