"""Literals: values as the controller prints them, and text back to values."""

import pytest

from virtual_irc5.rapid import InstructionSet
from virtual_irc5.rapid.literals import format_number, format_value, parse_value
from virtual_irc5.rapid.types import BOOL, DNUM, NUM, STRING, ArrayType, RapidValueError, Type


def type_named(name: str) -> Type:
    return InstructionSet().type(name)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (10.0, "10"),
        (-0.0, "0"),
        (0.5, "0.5"),
        (42.1, "42.1"),
        (-118.4, "-118.4"),
        (9e9, "9E+09"),
        (-1.25e-5, "-1.25E-05"),
        (1 / 3, "0.333333"),
        (1234567.0, "1234567"),
        (123456.7, "123457"),
    ],
)
def test_num_is_printed_as_the_controller_does(value: float, text: str) -> None:
    assert format_number(value) == text


def test_dnum_is_printed_with_fifteen_digits() -> None:
    assert (format_number(1 / 3, "dnum"), format_number(9e9, "dnum")) == ("0.333333333333333", "9000000000")


@pytest.mark.parametrize(
    ("value", "text"),
    [("", '""'), ('say "hi"', '"say ""hi"""'), ("a\\b", r'"a\\b"'), ("\x07", r'"\07"'), ("größe", '"größe"')],
)
def test_string_is_quoted(value: str, text: str) -> None:
    assert format_value(STRING, value) == text
    assert parse_value(STRING, text) == value


def test_record_is_printed_without_blanks() -> None:
    pose = type_named("pose")
    assert format_value(pose, pose.default()) == "[[0,0,0],[0,0,0,0]]"


def test_array_is_printed_row_by_row() -> None:
    array = ArrayType(BOOL, (2, 2))
    assert format_value(array, ((True, False), (False, True))) == "[[TRUE,FALSE],[FALSE,TRUE]]"


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e-05", 1e-5), ("9e+09", 9e9), ("9000000000", 9e9), ("-3", -3.0), (" + 2 ", 2.0), ("9E9", 9e9), (".5", 0.5)],
)
def test_number_is_read_in_every_shape_clients_send(text: str, value: float) -> None:
    assert parse_value(DNUM, text) == value


def test_blanks_and_case_do_not_matter() -> None:
    assert parse_value(ArrayType(BOOL, (2,)), " [ true , False ] ") == (True, False)


def test_components_of_a_parsed_record_have_names() -> None:
    target = parse_value(type_named("jointtarget"), "[[1,2,3,4,5,6],[7,9E9,9E9,9E9,9E9,9E9]]")
    assert (target.robax.rax_6, target.extax.eax_a) == (6.0, 7.0)


@pytest.mark.parametrize(
    ("type_", "text", "sentence"),
    [
        (NUM, '"1"', "'\"1\"' is not a value of type num. A num is expected."),
        (NUM, "nan", "'nan' is not a value of type num. A num is expected."),
        (NUM, "1E39", "does not fit into a num, which ends at 3.4E+38."),
        (NUM, "1 2", "found '2' where an operator or the end of the text is allowed."),
        (NUM, "", "found the end of the text where an expression is allowed."),
        (BOOL, "1", "'1' is not a value of type bool. A bool is expected."),
        (STRING, "abc", "'abc' is not a value of type string. A string is expected."),
        (ArrayType(NUM, (3,)), "[1,2]", "is not a value of type num{3}. An aggregate of 3 in brackets is expected."),
    ],
)
def test_text_that_is_no_such_value_is_refused(type_: Type, text: str, sentence: str) -> None:
    with pytest.raises(RapidValueError) as caught:
        parse_value(type_, text)
    assert sentence in str(caught.value)


def test_type_without_values_cannot_be_printed() -> None:
    with pytest.raises(RapidValueError, match="The type clock has no values"):
        format_value(type_named("clock"), None)
