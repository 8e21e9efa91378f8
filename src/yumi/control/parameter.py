"""What can be set on a controller: typed values with ranges, choices and units, as ros2_control's parameter files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from math import inf
from typing import TypeAlias, TypeGuard

from yumi.errors import CommandRefused

Value: TypeAlias = bool | int | float | str | tuple[str, ...] | tuple[float, ...]
"""What a parameter may hold."""

Values: TypeAlias = Mapping[str, Value]
"""Values of parameters by their full names, ``gains.yumi_joint_1_r.p``."""


class ParameterType(Enum):
    """Type of a parameter; the values are the words for a sentence."""

    BOOL = "true or false"
    INTEGER = "a whole number"
    DOUBLE = "a number"
    STRING = "a text"
    DOUBLE_ARRAY = "a list of numbers"
    STRING_ARRAY = "a list of texts"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A value of a controller that can be set.

    Attributes:
        name: as in ros2_control's parameter files; dots group.
        default: value until told otherwise; its type is the parameter's, an empty tuple is a list of texts.
        lowest: smallest number allowed, of each element in a list.
        highest: largest number allowed, of each element in a list.
        unit: unit of the value, empty for a bare number.
        description: one sentence.
        choices: the texts allowed, of each element in a list; any when empty.
        read_only: whether it can be set only while the controller is unconfigured.
    """

    name: str
    default: Value
    lowest: float = -inf
    highest: float = inf
    unit: str = ""
    description: str = ""
    choices: tuple[str, ...] = ()
    read_only: bool = False

    @property
    def type(self) -> ParameterType:
        """The type, as told by the default."""
        if isinstance(self.default, tuple):
            numeric = bool(self.default) and not isinstance(self.default[0], str)
            return ParameterType.DOUBLE_ARRAY if numeric else ParameterType.STRING_ARRAY
        return _TYPES[type(self.default)]

    def accept(self, value: object) -> Value:
        """``value`` in the parameter's own type: a whole number becomes a number, a list a tuple.

        Raises:
            CommandRefused: wrong type, out of range, not a finite number or not among the choices; the sentence
                begins with "is", for the caller to put the parameter's name before it.
        """
        accepted = _converted(self.type, value)
        if accepted is None:
            raise CommandRefused(f"is {value!r}; it must be {self.type.value}.")
        for element in accepted if isinstance(accepted, tuple) else (accepted,):
            self._check_element(element, value)
        return accepted

    def _check_element(self, element: bool | float | str, value: object) -> None:
        if isinstance(element, str):
            if self.choices and element not in self.choices:
                raise CommandRefused(f"is {value!r}; choose from: {', '.join(self.choices)}.")
        elif not isinstance(element, bool) and not (abs(element) < inf and self.lowest <= element <= self.highest):
            raise CommandRefused(
                f"is {value}; allowed is {self.lowest:g} to {self.highest:g} {self.unit}".rstrip() + "."
            )


_TYPES = {
    bool: ParameterType.BOOL,
    int: ParameterType.INTEGER,
    float: ParameterType.DOUBLE,
    str: ParameterType.STRING,
}


def _converted(kind: ParameterType, value: object) -> Value | None:
    """``value`` as ``kind``; None where it is of another type."""
    if kind is ParameterType.BOOL:
        return value if isinstance(value, bool) else None
    if kind is ParameterType.INTEGER:
        return value if isinstance(value, int) and not isinstance(value, bool) else None
    if kind is ParameterType.DOUBLE:
        return float(value) if _is_number(value) else None
    if kind is ParameterType.STRING:
        return value if isinstance(value, str) else None
    return _list_of(kind, value)


def _list_of(kind: ParameterType, value: object) -> Value | None:
    if isinstance(value, str) or not isinstance(value, Sequence):
        return None
    if kind is ParameterType.STRING_ARRAY:
        return tuple(value) if all(isinstance(element, str) for element in value) else None
    return tuple(float(element) for element in value) if all(map(_is_number, value)) else None


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def number(values: Values, name: str) -> float:
    """A number or whole number from complete, accepted ``values``."""
    value = values[name]
    assert isinstance(value, int | float)
    return value


def flag(values: Values, name: str) -> bool:
    """A truth value from complete, accepted ``values``."""
    value = values[name]
    assert isinstance(value, bool)
    return value


def text(values: Values, name: str) -> str:
    """A text from complete, accepted ``values``."""
    value = values[name]
    assert isinstance(value, str)
    return value


def numbers(values: Values, name: str) -> tuple[float, ...]:
    """A list of numbers from complete, accepted ``values``."""
    value = values[name]
    assert isinstance(value, tuple)
    return tuple(float(element) for element in value)


def texts(values: Values, name: str) -> tuple[str, ...]:
    """A list of texts from complete, accepted ``values``."""
    value = values[name]
    assert isinstance(value, tuple)
    return tuple(str(element) for element in value)
