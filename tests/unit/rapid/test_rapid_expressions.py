"""Expressions: precedence, types, records, arrays, and the errors of computing."""

import pytest
from rapid_bench import Bench, error_of, evaluated, started

from virtual_irc5.rapid.types import RapidReferenceError


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1 + 2 * 3", "7"),
        ("(1 + 2) * 3", "9"),
        ("-2 * -3 - 4", "2"),
        ("7 DIV 2", "3"),
        ("-7 DIV 2", "-3"),
        ("-7 MOD 3", "-1"),
        ("7 / 2", "3.5"),
        ("10 - 3 - 2", "5"),
    ],
)
def test_number_expression(expression: str, value: str) -> None:
    assert evaluated(expression) == value


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1 < 2 AND 2 <= 2", "TRUE"),
        ("NOT TRUE AND FALSE", "TRUE"),
        ("(NOT TRUE) AND FALSE", "FALSE"),
        ("TRUE AND NOT FALSE", "TRUE"),
        ("TRUE XOR TRUE", "FALSE"),
        ("TRUE OR FALSE AND FALSE", "TRUE"),
        ('"a" + "b" = "ab"', "TRUE"),
        ('"a" <> "A"', "TRUE"),
        ("[1,2,3] = p", "TRUE"),
        ("p = [1,2,4]", "FALSE"),
    ],
)
def test_truth_expression(expression: str, value: str) -> None:
    assert evaluated(expression, "bool", "CONST pos p := [1,2,3];") == value


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("[1,2,3] + p", "[2,4,6]"),
        ("p - [1,1,1]", "[0,1,2]"),
        ("p * 2", "[2,4,6]"),
        ("2 * p", "[2,4,6]"),
        ("-p", "[-1,-2,-3]"),
        ("p * [0,0,1]", "[2,-1,0]"),
    ],
)
def test_position_expression(expression: str, value: str) -> None:
    assert evaluated(expression, "pos", "CONST pos p := [1,2,3];") == value


def test_orientations_multiply_as_rotations() -> None:
    half_turns = "CONST orient about_x := [0,1,0,0]; CONST orient about_y := [0,0,1,0];"
    assert evaluated("about_x * about_y", "orient", half_turns) == "[0,0,0,1]"


def test_right_side_of_and_is_left_alone_when_the_left_decides() -> None:
    functions = 'FUNC bool evaluated_too() TPWrite "evaluated"; RETURN TRUE; ENDFUNC'
    assert started('IF FALSE AND evaluated_too() TPWrite "never";', functions).lines == []


def test_left_operand_is_read_before_a_later_function_changes_it() -> None:
    functions = "VAR num n := 1; FUNC num bump() n := 10; RETURN 5; ENDFUNC"
    assert evaluated("n + bump()", declarations=functions) == "6"


def test_num_has_single_precision() -> None:
    assert evaluated("16777216 + 1") == "1.67772E+07"
    assert evaluated("16777216 + 1", "dnum") == "16777217"


def test_component_of_nested_record_is_read_and_written() -> None:
    bench = started(
        "t.tframe.trans.x := t.tload.mass + 1;",
        "VAR tooldata t := [TRUE,[[0,0,0],[1,0,0,0]],[2,[0,0,1],[1,0,0,0],0,0,0]];",
    )
    assert bench.read("t") == "[TRUE,[[3,0,0],[1,0,0,0]],[2,[0,0,1],[1,0,0,0],0,0,0]]"


def test_component_names_are_found_in_any_case() -> None:
    assert evaluated("p.X + P.y", declarations="CONST pos p := [1,2,3];") == "3"


def test_record_is_copied_when_it_is_assigned() -> None:
    bench = started("a := [1,2,3]; b := a; b.x := 9;", "VAR pos a; VAR pos b;")
    assert (bench.read("a"), bench.read("b")) == ("[1,2,3]", "[9,2,3]")


def test_array_of_three_dimensions_is_indexed_from_one() -> None:
    bench = started("a{2,1,2} := a{1,1,1} + 5;", "VAR num a{2,1,2} := [[[1,2]],[[3,4]]];")
    assert bench.read("a") == "[[[1,2]],[[3,6]]]"


def test_component_of_array_element_is_written() -> None:
    bench = started("a{2}.y := 7;", "VAR pos a{2};")
    assert bench.read("a") == "[[0,0,0],[0,7,0]]"


def test_signal_name_stands_for_its_level() -> None:
    bench = Bench('result := di1 + 1; IF di1 = 1 TPWrite "high";', "VAR num result;")
    bench.host.signals["di1"] = 1.0
    assert (bench.start().read("result"), bench.lines) == ("2", ["high"])


@pytest.mark.parametrize(
    ("statement", "name"),
    [
        ("n := 1 / 0;", "ERR_DIVZERO"),
        ("n := 5 MOD 0;", "ERR_DIVZERO"),
        ("n := 5.5 DIV 2;", "ERR_INT_NOTVAL"),
        ("n := a{4};", "ERR_OUTOFBND"),
        ("a{0} := 1;", "ERR_OUTOFBND"),
        ("n := a{1.5};", "ERR_OUTOFBND"),
        ("n := 3E38 * 10;", "ERR_NUM_LIMIT"),
        ('WHILE TRUE DO text := text + "0123456789"; ENDWHILE', "ERR_STRTOOLNG"),
    ],
)
def test_computation_that_fails_stops_the_task(statement: str, name: str) -> None:
    assert error_of(statement, "VAR num n; VAR num a{3}; VAR string text;") == name


@pytest.mark.parametrize(
    ("statement", "sentence"),
    [
        ('n := "1";', "a string is found where a num is needed"),
        ("n := 1 + TRUE;", "'+' cannot be applied to num and bool"),
        ("n := NOT 1;", "'NOT' cannot be applied to a num"),
        ("n := d;", "a dnum is found where a num is needed"),
        ("n := p.w;", "a pos has no component 'w'"),
        ("n := n{1};", "a num has no 1-dimensional elements"),
        ("p := [1,2];", "an aggregate of 2 is found where a pos is needed"),
        ("n := main;", "'main' is a routine or type and has no value"),
        ("c := 2;", "'c' cannot be changed here"),
        ("IF di1 n := 1;", "a signal is found where a bool is needed"),
    ],
)
def test_expression_that_does_not_fit_is_refused(statement: str, sentence: str) -> None:
    bench = Bench(statement, "VAR num n; VAR dnum d; VAR pos p; CONST num c := 1;")
    with pytest.raises(RapidReferenceError, match=r"M, line 4: ") as caught:
        bench.task.move_pp_to_main()
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("condition", "value"),
    [("n = 0.3", "TRUE"), ("0.3 = n", "TRUE"), ("-n = -0.3", "TRUE"), ("n > 0.3", "FALSE"), ("d = 0.3", "TRUE")],
)
def test_literal_beside_a_num_is_as_exact_as_one(condition: str, value: str) -> None:
    assert evaluated(condition, "bool", "VAR num n := 0.3; VAR dnum d := 0.3;") == value
