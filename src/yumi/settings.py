"""Values that can be set: their types, ranges, choices and units, and ROS 2 parameter files that set them.

A parameter file names nodes, in full or by wildcard, each with its parameters; every value knows its line::

    /r/controller_manager:            a node; also nested, r: {controller_manager: …}
      ros__parameters:
        gains: {joint_1: {p: 1.0}}    the parameter gains.joint_1.p
    /**/forward_controller:           that node in any namespace; * stands for one name, ** for any number
    /**:                              every node that has the parameters
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from math import inf
from pathlib import Path
from typing import Any, TypeAlias

import msgspec
import yaml

from yumi.errors import CommandRefused, SettingsError


def bounded(default: float | None, lowest: float, highest: float, unit: str = "") -> Any:
    """A dataclass field with a range that includes both ends."""
    return field(default=default, metadata={"lowest": lowest, "highest": highest, "unit": unit})


Value: TypeAlias = bool | int | float | str | tuple[str, ...] | tuple[float, ...]
"""What a parameter may hold."""

Values: TypeAlias = Mapping[str, Value]
"""Values of parameters by their full names, ``gains.yumi_joint_1_r.p``."""


class ParameterType(Enum):
    """Type of a parameter; the values are the words for messages."""

    BOOL = "true or false"
    INTEGER = "a whole number"
    DOUBLE = "a number"
    STRING = "a text"
    DOUBLE_ARRAY = "a list of numbers"
    STRING_ARRAY = "a list of texts"


_PYTHON_TYPES: Mapping[ParameterType, Any] = {
    ParameterType.BOOL: bool,
    ParameterType.INTEGER: int,
    ParameterType.DOUBLE: float,
    ParameterType.STRING: str,
    ParameterType.DOUBLE_ARRAY: tuple[float, ...],
    ParameterType.STRING_ARRAY: tuple[str, ...],
}


@dataclass(frozen=True, slots=True)
class Parameter:
    """A value that can be set.

    Attributes:
        name: as in ros2_control's parameter files; dots group.
        default: value until another one is set; its type is the parameter's, an empty tuple is a list of texts.
        lowest: smallest number allowed, of each element in a list.
        highest: largest number allowed, of each element in a list.
        unit: unit of the value, empty for a bare number.
        description: one sentence.
        choices: the texts allowed, of each element in a list; any when empty.
        read_only: whether it can be set only while the controller is unconfigured.
        fixed: why the default holds whatever is set, for a name that parameter files of others have; empty for any
            other. With an empty tuple as default it stands for the whole group of names that begin with it.
    """

    name: str
    default: Value
    lowest: float = -inf
    highest: float = inf
    unit: str = ""
    description: str = ""
    choices: tuple[str, ...] = ()
    read_only: bool = False
    fixed: str = ""

    @property
    def type(self) -> ParameterType:
        """The type of the default."""
        if isinstance(self.default, tuple):
            numeric = bool(self.default) and not isinstance(self.default[0], str)
            return ParameterType.DOUBLE_ARRAY if numeric else ParameterType.STRING_ARRAY
        return next(kind for kind, python in _PYTHON_TYPES.items() if python is type(self.default))

    @property
    def is_group(self) -> bool:
        """Whether it stands for all names that begin with it."""
        return bool(self.fixed) and self.default == ()

    def accept(self, value: object) -> Value:
        """``value`` in the parameter's own type: a whole number becomes a number, a list a tuple.

        Raises:
            CommandRefused: wrong type, out of range, not a finite number or not among the choices; the sentence
                begins with "is", so that the caller can put the name before it.
        """
        try:
            accepted: Value = msgspec.convert(value, _PYTHON_TYPES[self.type])
        except (msgspec.ValidationError, OverflowError) as error:
            raise CommandRefused(f"is {value!r}; it must be {self.type.value}.") from error
        for element in accepted if isinstance(accepted, tuple) else (accepted,):
            if isinstance(element, str):
                if self.choices and element not in self.choices:
                    raise CommandRefused(f"is {value!r}; choose from: {', '.join(self.choices)}.")
            elif not isinstance(element, bool) and not (abs(element) < inf and self.lowest <= element <= self.highest):
                shown = f"{value:g}" if isinstance(value, float) else value
                raise CommandRefused(
                    f"is {shown}; allowed is {self.lowest:g} to {self.highest:g} {self.unit}".rstrip() + "."
                )
        return accepted


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


_PARAMETERS = "ros__parameters"


@dataclass(frozen=True, slots=True)
class Entry:
    """A parameter's value in a file.

    Attributes:
        value: what is set.
        place: file and line, for a sentence.
        is_general: whether it stands under a wildcard instead of the node's name: for every node with the parameter.
    """

    value: Value
    place: str
    is_general: bool


@dataclass(frozen=True, slots=True)
class Section:
    """What a file sets on the nodes of one name or wildcard.

    Attributes:
        nodes: full name, or wildcard, of the nodes.
        place: file and line.
        entries: by the parameters' full names.
    """

    nodes: str
    place: str
    entries: dict[str, Entry]

    def concerns(self, node: str) -> bool:
        """Whether it is for the node of that full name."""
        words = {"**": r"(?:/[^/]+)*", "*": r"/[^/]+"}
        pattern = "".join(words.get(token, "/" + re.escape(token)) for token in self.nodes.split("/")[1:])
        return re.fullmatch(pattern, node) is not None


@dataclass(frozen=True, slots=True)
class ParameterFile:
    """A file as read.

    Attributes:
        name: the file's name.
        sections: in the order of the file.
    """

    name: str
    sections: tuple[Section, ...]

    def parameters(self, node: str) -> dict[str, Entry]:
        """What it sets on the node of that full name; later sections override earlier ones."""
        merged: dict[str, Entry] = {}
        for section in self.sections:
            if section.concerns(node):
                merged.update(section.entries)
        return merged

    def check_nodes(self, nodes: Iterable[str]) -> None:
        """Check that every section is for one of ``nodes``.

        Raises:
            SettingsError: one is for another node.
        """
        known = tuple(nodes)
        for section in self.sections:
            if not any(section.concerns(node) for node in known):
                raise SettingsError(
                    f"{section.place}: {section.nodes} is not the name of anything here; there are: {', '.join(known)}."
                )


def read_parameter_file(path: Path) -> ParameterFile:
    """The parameters in ``path``.

    Raises:
        SettingsError: the file is missing or is not YAML, or something in it is not a parameter.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise SettingsError(f"Cannot read {path}: {error.strerror}.") from error
    try:
        return ParameterFile(path.name, tuple(_Reader(path.name, text).sections()))
    except yaml.YAMLError as error:
        raise SettingsError(f"{path} is not YAML: {' '.join(str(error).split())}.") from error


class _Reader:
    """Walks the nodes of a YAML document, which know their lines."""

    def __init__(self, file: str, text: str) -> None:
        self._file = file
        self._loader = yaml.SafeLoader(text)

    def sections(self) -> Iterator[Section]:
        document = self._loader.get_single_node()
        if not isinstance(document, yaml.MappingNode):
            raise SettingsError(f"{self._file} must hold a mapping of settings.")
        yield from self._sections(document, "")

    def _sections(self, node: yaml.MappingNode, namespace: str) -> Iterator[Section]:
        for key, place, value in self._items(node, may_repeat=True):  # as in ROS, sections of one name add up
            nodes = f"{namespace}/{key.strip('/')}"
            is_parameters = key == _PARAMETERS and bool(namespace)
            if not isinstance(value, yaml.MappingNode):
                is_empty = isinstance(value, yaml.ScalarNode) and value.tag == "tag:yaml.org,2002:null"
                if not is_empty:
                    where = namespace if is_parameters else nodes
                    raise SettingsError(f"{place}: {where} needs a mapping {_PARAMETERS!r}.")
                if is_parameters:
                    yield Section(namespace, place, {})
            elif is_parameters:
                is_general = namespace.endswith("*")
                entries = {name: Entry(item, at, is_general) for name, at, item in self._parameters(value, "")}
                yield Section(namespace, place, entries)
            else:
                yield from self._sections(value, nodes)

    def _parameters(self, node: yaml.MappingNode, group: str) -> Iterator[tuple[str, str, Value]]:
        for key, place, value in self._items(node):
            if isinstance(value, yaml.MappingNode):
                yield from self._parameters(value, f"{group}{key}.")
            else:
                yield f"{group}{key}", place, self._value(value, f"{place}: {group}{key}")

    def _items(self, node: yaml.MappingNode, *, may_repeat: bool = False) -> Iterator[tuple[str, str, yaml.Node]]:
        self._loader.flatten_mapping(node)
        lines: dict[str, int] = {}
        for key, value in node.value:
            line = key.start_mark.line + 1
            name = str(self._loader.construct_object(key))
            if name in lines and not (may_repeat and name != _PARAMETERS):
                raise SettingsError(f"{self._file} line {line}: {name} stands in line {lines[name]} already.")
            lines[name] = line
            yield name, f"{self._file} line {line}", value

    def _value(self, node: yaml.Node, place: str) -> Value:
        value = self._loader.construct_object(node, deep=True)
        if isinstance(value, bool | int | float | str):
            return value
        if isinstance(value, list):
            if all(isinstance(element, str) for element in value):
                return tuple(value)
            if all(isinstance(element, int | float) and not isinstance(element, bool) for element in value):
                return tuple(float(element) for element in value)
        raise SettingsError(f"{place} is {value!r}; it must be a truth value, a number, a text or a list of one kind.")
