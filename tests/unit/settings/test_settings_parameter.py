from __future__ import annotations

import re
from math import inf, nan

import pytest

from yumi import settings
from yumi.errors import CommandRefused
from yumi.settings import Parameter, ParameterType, Value

GAIN = Parameter("p", 1.0, 0.0, 2.0, "1/s", "A gain.")
COUNT = Parameter("count", 3, 1, 9)
FLAG = Parameter("flag", default=False)
MODE = Parameter("mode", "slow", choices=("slow", "fast"))
NAMES = Parameter("names", (), choices=("a", "b"))
GAINS = Parameter("gains", (1.0, 1.0), 0.0, 2.0)
FREE = Parameter("free", 0.0)


@pytest.mark.parametrize(
    ("parameter", "type_"),
    [
        (GAIN, ParameterType.DOUBLE),
        (COUNT, ParameterType.INTEGER),
        (FLAG, ParameterType.BOOL),
        (MODE, ParameterType.STRING),
        (NAMES, ParameterType.STRING_ARRAY),
        (GAINS, ParameterType.DOUBLE_ARRAY),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_parameter_has_the_type_of_its_default(parameter: Parameter, type_: ParameterType) -> None:
    assert parameter.type is type_
    assert parameter.accept(parameter.default) == parameter.default


@pytest.mark.parametrize(
    ("parameter", "value", "accepted"),
    [
        (GAIN, 2, 2.0),
        (COUNT, 9, 9),
        (FLAG, True, True),
        (MODE, "fast", "fast"),
        (NAMES, ["b", "a"], ("b", "a")),
        (NAMES, [], ()),
        (GAINS, [0, 2], (0.0, 2.0)),
        (FREE, -1e9, -1e9),
    ],
)
def test_parameter_takes_a_value_in_its_own_type(parameter: Parameter, value: object, accepted: Value) -> None:
    taken = parameter.accept(value)
    assert (taken, type(taken)) == (accepted, type(accepted))


@pytest.mark.parametrize(
    ("parameter", "value", "sentence"),
    [
        (GAIN, 2.1, "is 2.1; allowed is 0 to 2 1/s."),
        (GAIN, nan, "is nan; allowed is 0 to 2 1/s."),
        (GAIN, "1", "is '1'; it must be a number."),
        (GAIN, True, "is True; it must be a number."),
        (GAIN, None, "is None; it must be a number."),
        (COUNT, 1.0, "is 1.0; it must be a whole number."),
        (COUNT, True, "is True; it must be a whole number."),
        (COUNT, 10, "is 10; allowed is 1 to 9."),
        (FLAG, 1, "is 1; it must be true or false."),
        (MODE, "medium", "is 'medium'; choose from: slow, fast."),
        (MODE, 1, "is 1; it must be a text."),
        (NAMES, "ab", "is 'ab'; it must be a list of texts."),
        (NAMES, ["a", 1], "is ['a', 1]; it must be a list of texts."),
        (NAMES, ("a", "c"), "is ('a', 'c'); choose from: a, b."),
        (GAINS, 1.0, "is 1.0; it must be a list of numbers."),
        (GAINS, [1.0, "x"], "is [1.0, 'x']; it must be a list of numbers."),
        (GAINS, (1.0, 3.0), "is (1.0, 3.0); allowed is 0 to 2."),
        (GAINS, (nan,), "is (nan,); allowed is 0 to 2."),
        (FREE, inf, "is inf; allowed is -inf to inf."),
    ],
)
def test_parameter_refuses_what_is_not_allowed(parameter: Parameter, value: object, sentence: str) -> None:
    with pytest.raises(CommandRefused, match=f"^{re.escape(sentence)}$"):
        parameter.accept(value)


def test_values_are_read_by_type() -> None:
    values = {"a": 1, "b": True, "c": "x", "d": (1.0, 2.0), "e": ("y",)}
    assert (settings.number(values, "a"), settings.flag(values, "b"), settings.text(values, "c")) == (1, True, "x")
    assert (settings.numbers(values, "d"), settings.texts(values, "e")) == ((1.0, 2.0), ("y",))
