"""What RAPID prints it can read: literals of random types and values."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from virtual_irc5.rapid.literals import format_value, parse_value
from virtual_irc5.rapid.types import BOOL, NUM, STRING, ArrayType, RecordType, Type, single_precision

LATIN = st.characters(min_codepoint=1, max_codepoint=255)
TEXTS = st.text(LATIN, max_size=80)
NUMBERS = st.floats(-3e38, 3e38, allow_subnormal=False).map(single_precision)
WHOLE = st.integers(-(2**23), 2**23).map(float)


def record_of(components: list[Type]) -> RecordType:
    return RecordType.named("R", tuple((f"c{i}", type_) for i, type_ in enumerate(components)))


TYPES = st.recursive(
    st.sampled_from([NUM, BOOL, STRING]),
    lambda inner: st.lists(inner, min_size=1, max_size=4).map(record_of),
    max_leaves=8,
)


def values_of(type_: Type) -> st.SearchStrategy[Any]:
    if isinstance(type_, RecordType):
        return st.tuples(*(values_of(t) for _, t in type_.components)).map(type_.convert)
    return {NUM: st.one_of(NUMBERS, WHOLE), BOOL: st.booleans(), STRING: TEXTS}[type_]


@st.composite
def typed_values(draw: st.DrawFn) -> tuple[Type, Any]:
    type_ = draw(TYPES)
    return type_, draw(values_of(type_))


@given(typed_values())
def test_text_of_a_value_reads_back_to_the_same_text(typed: tuple[Type, Any]) -> None:
    type_, value = typed
    text = format_value(type_, value)
    assert format_value(type_, parse_value(type_, text)) == text


@given(TEXTS)
def test_string_reads_back_unchanged(text: str) -> None:
    assert parse_value(STRING, format_value(STRING, text)) == text


@given(WHOLE)
def test_whole_number_reads_back_unchanged(number: float) -> None:
    assert parse_value(NUM, format_value(NUM, number)) == number


@given(NUMBERS)
def test_number_reads_back_to_six_digits(number: float) -> None:
    read = parse_value(NUM, format_value(NUM, number))
    assert abs(read - number) <= 1e-5 * abs(number)


@given(st.lists(st.lists(WHOLE, min_size=3, max_size=3), min_size=2, max_size=2))
def test_array_reads_back_unchanged(rows: list[list[float]]) -> None:
    array = ArrayType(NUM, (2, 3))
    value = array.convert(rows)
    assert parse_value(array, format_value(array, value)) == value
