"""RAPID's numbers."""

import pytest
from rapid_bench import error_of, evaluated, started


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("Abs(-2.5)", "2.5"),
        ("Round(2.5)", "3"),
        ("Round(-2.5)", "-3"),
        ("Round(0.3852138\\Dec:=3)", "0.385"),
        ("Trunc(-1.9)", "-1"),
        ("Trunc(1.29\\Dec:=1)", "1.2"),
        ("Sqrt(16)", "4"),
        ("Pow(2,10)", "1024"),
        ("Exp(0)", "1"),
        ("Sin(30)", "0.5"),
        ("Cos(60)", "0.5"),
        ("Tan(45)", "1"),
        ("ASin(1)", "90"),
        ("ACos(0)", "90"),
        ("ATan(1)", "45"),
        ("ATan2(-1,-1)", "-135"),
        ("Max(1,2) + Min(3,4)", "5"),
        ("DnumToNum(NumToDnum(2.5))", "2.5"),
        ("Distance([0,0,0],[3,4,0])", "5"),
        ("pi", "3.14159"),
    ],
)
def test_function_of_numbers(expression: str, value: str) -> None:
    assert evaluated(expression) == value


def test_function_of_dnums_keeps_all_digits() -> None:
    assert evaluated("AbsDnum(-16777217)", "dnum") == "16777217"


@pytest.mark.parametrize(
    ("expression", "name"),
    [
        ("Sqrt(-1)", "ERR_NEGARG"),
        ("ASin(2)", "ERR_ARGVALERR"),
        ("Pow(-1,0.5)", "ERR_ARGVALERR"),
        ("Pow(1E30,100)", "ERR_OVERFLOW"),
        ("DnumToNum(1.5\\Integer)", "ERR_INT_NOTVAL"),
        ("Dim(1,1)", "ERR_NOTARR"),
    ],
)
def test_function_outside_of_its_range_is_an_error(expression: str, name: str) -> None:
    assert error_of(f"n := {expression};", "VAR num n;") == name


def test_counters_work_on_variables_and_persistents() -> None:
    bench = started("Incr a; Decr p; Add d, 2.5; Clear c;", "VAR num a; PERS num p := 5; VAR dnum d; VAR num c := 9;")
    assert [bench.read(name) for name in "apdc"] == ["1", "4", "2.5", "0"]


def test_dim_gives_the_size_of_each_dimension() -> None:
    array = "VAR num a{2,3};"
    assert (evaluated("Dim(a,1)", declarations=array), evaluated("Dim(a,2)", declarations=array)) == ("2", "3")
    assert error_of("n := Dim(a,3);", array + "VAR num n;") == "ERR_ILLDIM"
