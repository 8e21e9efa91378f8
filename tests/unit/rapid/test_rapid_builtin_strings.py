"""RAPID's strings."""

import pytest
from rapid_bench import error_of, evaluated, started

from virtual_irc5.rapid.parser import parse_expression
from virtual_irc5.rapid.types import RapidSyntaxError


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("NumToStr(0.38521,3)", '"0.385"'),
        ("NumToStr(7,0)", '"7"'),
        ("NumToStr(1234.5,2\\Exp)", '"1.23E+03"'),
        ("DnumToStr(0.5,1)", '"0.5"'),
        ("ValToStr(p)", '"[1,2,3]"'),
        ("ValToStr(TRUE)", '"TRUE"'),
        ('ValToStr("a")', '"a"'),
        ('StrFormat("{2} of {1}, {3}"\\Arg1:="five"\\Arg2:="one{1}")', '"one{1} of five, {3}"'),
        ('StrPart("Robotics",1,5)', '"Robot"'),
        ('StrMap("Robotics","aeiou","AEIOU")', '"RObOtIcs"'),
        ("GetTaskName()", '"T_ROB_R"'),
    ],
)
def test_function_to_a_string(expression: str, value: str) -> None:
    assert evaluated(expression, "string", "CONST pos p := [1,2,3];") == value


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ('StrLen("Robotics")', "8"),
        ('StrFind("Robotics",1,"aeiou")', "2"),
        ('StrFind("Robotics",1,"aeiou"\\NotInSet)', "1"),
        ('StrFind("IRB 6400",1,STR_DIGIT)', "5"),
        ('StrFind("abc",1,"x")', "4"),
        ('StrMatch("Robotics",1,"bo")', "3"),
        ('StrMatch("Robotics",4,"bo")', "9"),
    ],
)
def test_search_in_a_string(expression: str, value: str) -> None:
    assert evaluated(expression) == value


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ('StrMemb("Robot",2,"aeiou")', "TRUE"),
        ('StrOrder("FIRST","SECOND",STR_UPPER)', "TRUE"),
        ('StrOrder("SECOND","FIRST",STR_UPPER)', "FALSE"),
        ('StrOrder("FIRST","FIRST",STR_UPPER)', "TRUE"),
        ('StrOrder("FIRST","FIR",STR_UPPER)', "FALSE"),
        ('StrOrder("b","a","ba")', "TRUE"),
        ('StrOrder("1","Z",STR_UPPER)', "FALSE"),
        ("RobOS()", "FALSE"),
    ],
)
def test_question_about_a_string(expression: str, value: str) -> None:
    assert evaluated(expression, "bool") == value


@pytest.mark.parametrize(
    "expression",
    ['StrPart("abc",2,3)', 'StrPart("abc",0,1)', 'StrPart("abc",1.5,1)', 'StrMap("a","ab","c")'],
)
def test_place_outside_of_the_string_is_an_error(expression: str) -> None:
    assert error_of(f"s := {expression};", "VAR string s;") == "ERR_ARGVALERR"


def test_string_becomes_a_value_of_the_variables_type() -> None:
    bench = started(
        'ok := StrToVal("[1, 2,3E1]", p); fine1 := StrToVal("x", p);', "VAR bool ok; VAR bool fine1; VAR pos p;"
    )
    assert (bench.read("ok"), bench.read("p"), bench.read("fine1")) == ("TRUE", "[1,2,30]", "FALSE")


@pytest.mark.parametrize(("text", "value"), [("-5", "-5"), ("+5", "5"), ("0x10", "16"), ("-0b101", "-5")])
def test_number_with_a_sign_or_of_another_base_is_a_literal(text: str, value: str) -> None:
    bench = started(f'ok := StrToVal("{text}", n);', "VAR bool ok; VAR num n;")
    assert (bench.read("ok"), bench.read("n")) == ("TRUE", value)


@pytest.mark.parametrize(("text", "type_"), [("1,5", "num"), ("5;", "num"), ("[1,2,3]x", "pos")])
def test_text_behind_a_value_makes_it_no_value(text: str, type_: str) -> None:
    bench = started(f'ok := StrToVal("{text}", v);', f"VAR bool ok := TRUE; VAR {type_} v;")
    assert bench.read("ok") == "FALSE"
    with pytest.raises(RapidSyntaxError, match="where the end of the text is allowed"):
        parse_expression(text)


@pytest.mark.parametrize(("text", "type_"), [("--5", "num"), ("+-5", "dnum"), ("[1,- -2,3]", "pos"), ("2+3", "num")])
def test_expression_is_no_value(text: str, type_: str) -> None:
    bench = started(f'ok := StrToVal("{text}", v);', f"VAR bool ok := TRUE; VAR {type_} v;")
    assert bench.read("ok") == "FALSE"


@pytest.mark.parametrize("call", ['StrDigCmp("\u00b2",EQ,"2")', 'StrDigCmp("2",EQ,"\u0662")'])
def test_digits_of_other_scripts_make_no_number(call: str) -> None:
    assert error_of(f"flag := {call};", "VAR bool flag;") == "ERR_INT_NOTVAL"
