from __future__ import annotations

from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.errors import CommandRefused, ProtocolError
from abb_protocols.rws.rapid_values import RapidValue, decode, encode, split
from refusals import refused

atoms = st.one_of(st.booleans(), st.floats(allow_nan=False, allow_infinity=False), st.text())
values = st.recursive(atoms, lambda inner: st.lists(inner, max_size=5).map(tuple), max_leaves=20)


@given(values)
def test_literal_brings_back_its_value(value: RapidValue) -> None:
    assert decode(encode(value)) == value


@pytest.mark.parametrize(
    ("value", "literal"),
    [
        (0.0, "0"),
        (10.0, "10"),
        (-0.5, "-0.5"),
        (1e-05, "1E-05"),
        (9e9, "9E+09"),
        (123456789.0, "123456789"),
        (True, "TRUE"),
        ('say "hi"', '"say ""hi"""'),
        ("a\\b", '"a\\\\b"'),
        (((600.0, 0.0, 225.3), (1.0, 0.0, 0.0, 0.0)), "[[600,0,225.3],[1,0,0,0]]"),
        ((), "[]"),
    ],
)
def test_value_is_written_as_the_controller_prints_it(value: RapidValue, literal: str) -> None:
    assert encode(value) == literal


@pytest.mark.parametrize(
    ("literal", "value"),
    [
        ("9000000000", 9e9),
        ("8.999999e+009", 8.999999e9),
        ("true", True),
        (" [ 1 , [ 2 , 3 ] ] ", (1.0, (2.0, 3.0))),
        ('["a,b","]"]', ("a,b", "]")),
        (r'"\41"', "A"),
    ],
)
def test_literal_is_read_in_all_its_spellings(literal: str, value: RapidValue) -> None:
    assert decode(literal) == value


@pytest.mark.parametrize(
    ("literal", "code", "text"),
    [
        ("", "rapid_value_unreadable", ""),
        ("[1,2", "rapid_value_without_brackets", "[1,2"),
        ("[1,]", "rapid_value_unreadable", ""),
        ("[1]]", "rapid_value_not_closed", "[1]]"),
        ('"open', "rapid_value_unreadable", '"open'),
        ("abc", "rapid_value_unreadable", "abc"),
        ("nan", "rapid_value_unreadable", "nan"),
        ("1 2", "rapid_value_unreadable", "1 2"),
        ("[1][2]", "rapid_value_unreadable", "1][2"),
    ],
)
def test_text_that_is_no_literal_is_refused(literal: str, code: str, text: str) -> None:
    with refused(ProtocolError, code, text=text):
        decode(literal)


def test_literal_nested_without_end_is_refused() -> None:
    with refused(ProtocolError, "rapid_value_nested_too_deeply"):
        decode("[" * 10000 + "]" * 10000)


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_number_that_is_not_finite_is_refused(value: float) -> None:
    with refused(CommandRefused, "rapid_number_not_finite", value=str(value)):
        encode((1.0, value))


def test_split_keeps_inner_lists_and_strings_whole() -> None:
    assert split('[TRUE,[1,2],"x,y"]') == ("TRUE", "[1,2]", '"x,y"')
