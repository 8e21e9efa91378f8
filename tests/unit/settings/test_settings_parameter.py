from __future__ import annotations

from math import inf, nan

import pytest

from abb_protocols.errors import CommandRefused
from abb_runtime.parameters import Parameter, ParameterType, Value, flag_setting, number, numbers, text, texts
from refusals import refused

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
    ("parameter", "value", "shown"),
    [
        (GAIN, 2.1, "2.1"),
        (GAIN, nan, "nan"),
        (COUNT, 10, "10"),
        (GAINS, (1.0, 3.0), "(1.0, 3.0)"),
        (GAINS, (nan,), "(nan,)"),
        (FREE, inf, "inf"),
    ],
)
def test_parameter_refuses_what_is_out_of_its_range(parameter: Parameter, value: object, shown: str) -> None:
    code = "value_out_of_range_with_unit" if parameter.unit else "value_out_of_range"
    bounds = {"lowest": parameter.lowest, "highest": parameter.highest, "unit": parameter.unit}
    with refused(CommandRefused, code, parameter=parameter.name, value=shown, **bounds):
        parameter.accept(value)


@pytest.mark.parametrize(
    ("parameter", "value", "shown", "kind"),
    [
        (GAIN, "1", "'1'", "a number"),
        (GAIN, True, "True", "a number"),
        (GAIN, None, "None", "a number"),
        (COUNT, 1.0, "1.0", "a whole number"),
        (COUNT, True, "True", "a whole number"),
        (FLAG, 1, "1", "true or false"),
        (MODE, 1, "1", "a text"),
        (NAMES, "ab", "'ab'", "a list of texts"),
        (NAMES, ["a", 1], "['a', 1]", "a list of texts"),
        (GAINS, 1.0, "1.0", "a list of numbers"),
        (GAINS, [1.0, "x"], "[1.0, 'x']", "a list of numbers"),
    ],
)
def test_parameter_refuses_another_type(parameter: Parameter, value: object, shown: str, kind: str) -> None:
    with refused(CommandRefused, "value_of_wrong_type", parameter=parameter.name, value=shown, type=kind):
        parameter.accept(value)


@pytest.mark.parametrize(
    ("parameter", "value", "shown"), [(MODE, "medium", "'medium'"), (NAMES, ("a", "c"), "('a', 'c')")]
)
def test_parameter_refuses_what_is_not_among_its_choices(parameter: Parameter, value: object, shown: str) -> None:
    choices = parameter.choices
    with refused(CommandRefused, "value_not_a_choice", parameter=parameter.name, value=shown, choices=choices):
        parameter.accept(value)


def test_values_are_read_by_type() -> None:
    values = {"a": 1, "b": True, "c": "x", "d": (1.0, 2.0), "e": ("y",)}
    assert (number(values, "a"), flag_setting(values, "b"), text(values, "c")) == (1, True, "x")
    assert (numbers(values, "d"), texts(values, "e")) == ((1.0, 2.0), ("y",))
