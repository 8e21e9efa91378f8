from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from yumi.rws import documents as forms

texts = st.text(alphabet=st.characters(exclude_categories=("Cs",)))


@given(st.lists(st.tuples(texts, texts).filter(any)))
def test_form_brings_back_what_was_written(pairs: list[tuple[str, str]]) -> None:
    assert forms.decode(forms.encode(pairs)) == tuple(pairs)


@pytest.mark.parametrize(
    ("raw", "value"),
    [
        ('value=[[1,2,3],"abc"]', '[[1,2,3],"abc"]'),
        ("value=%5B%5B1%2C2%5D%5D", "[[1,2]]"),
        ("value=1e+06", "1e+06"),
        ("value=[1.5E+09,2.E+10]", "[1.5E+09,2.E+10]"),
        ('value="move+to+7"', '"move to 7"'),
        ('value="50% full"', '"50% full"'),
        ("value=a=b", "a=b"),
        ("value=", ""),
        ("value", ""),
    ],
)
def test_value_is_read_whether_escaped_or_raw(raw: str, value: str) -> None:
    assert forms.decode(raw) == (("value", value),)


def test_form_is_split_only_at_ampersands() -> None:
    assert forms.decode("resources=0&0=/rw/rapid/execution;ctrlexecstate&0-p=1") == (
        ("resources", "0"),
        ("0", "/rw/rapid/execution;ctrlexecstate"),
        ("0-p", "1"),
    )


def test_first_value_counts_when_a_name_repeats() -> None:
    assert forms.first(forms.decode("json=1&json=2"), "json") == "1"


def test_missing_name_has_no_value() -> None:
    assert forms.first((), "json") is None
