"""The check that no code takes a sentence for people apart."""

from __future__ import annotations

import pytest
from check_prose import prose_in


@pytest.mark.parametrize(
    "code",
    [
        "try:\n    f()\nexcept ValueError as error:\n    g(str(error).removeprefix('a'))",
        "try:\n    f()\nexcept ValueError as error:\n    is_gone = 'gone' in str(error)",
        "try:\n    f()\nexcept ValueError as error:\n    text = str(error)\n    text.replace('a', 'b')",
        "def f(state):\n    return state.reason == 'not ready'",
        "def f(state):\n    return state.cause.strip().split('; ')",
        "def f(said):\n    return re.sub('a', 'b', sentence(said))",
    ],
)
def test_code_that_takes_a_sentence_apart_is_found(code: str) -> None:
    assert len(list(prose_in(code))) == 1


@pytest.mark.parametrize(
    "code",
    [
        "def f(state):\n    return bool(state.reason)",
        "def f(state):\n    return state.reason == ''",
        "def f(error):\n    return error.said.code == 'no_driver_runs'",
        "def f(line):\n    return line.split('; ')",
        "try:\n    f()\nexcept ValueError as error:\n    raise KeyError(str(error)) from error",
    ],
)
def test_other_code_is_not(code: str) -> None:
    assert list(prose_in(code)) == []
