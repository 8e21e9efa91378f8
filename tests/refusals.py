"""Refusals by what they are: the class, the code and the values, never the sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import pytest

from abb_protocols.catalogue import Message
from abb_protocols.errors import YumiError

E = TypeVar("E", bound=YumiError)


@contextmanager
def refused(kind: type[E], code: str, /, **values: Any) -> Iterator[pytest.ExceptionInfo[E]]:
    """What is inside must raise ``kind`` with this code, and with these values among its own; numbers to 1e-9."""
    with pytest.raises(kind) as caught:
        yield caught
    assert_says(caught.value.said, code, **values)


def assert_says(said: Message, code: str, /, **values: Any) -> None:
    """``said`` has this code, and these values among its own; numbers to 1e-9."""
    assert said.code == code, said
    for name, value in values.items():
        expected = pytest.approx(value, abs=1e-9, nan_ok=True) if isinstance(value, float) else value
        assert said.values[name] == expected, (name, said.values)


def numbers_in(said: Message) -> set[int]:
    """The numbers of the controller's events in a message."""
    return {each.values["number"] for each in _all_in(said) if "number" in each.values}


def codes_in(said: Message) -> set[str]:
    """The codes of a message and of all messages in it."""
    return {each.code for each in _all_in(said)}


def _all_in(said: Message) -> Iterator[Message]:
    yield said
    for value in said.values.values():
        for each in value if isinstance(value, tuple) else (value,):
            if isinstance(each, Message):
                yield from _all_in(each)
