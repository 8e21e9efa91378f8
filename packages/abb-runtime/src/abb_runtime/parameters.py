"""Values that can be set: numbers and texts with ranges, choices and units, and the YAML files, as of ROS 2, for them.

A parameter file names nodes, in full or by wildcard, each with its parameters; every value knows its line::

    /r/controller_manager:            a node; also nested, r: {controller_manager: …}
      ros__parameters:
        gains: {joint_1: {p: 1.0}}    the parameter gains.joint_1.p
    /**/forward_controller:           that node in any namespace; * stands for one name, ** for any number
    /**:                              every node that has the parameters
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from math import inf
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import msgspec
import yaml

from abb_protocols.catalogue import message, quoted
from abb_protocols.errors import CommandRefused, SettingsError


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
            CommandRefused: wrong type, out of range, not a finite number or not among the choices.
        """
        try:
            accepted: Value = msgspec.convert(value, _PYTHON_TYPES[self.type])
        except (msgspec.ValidationError, OverflowError) as error:
            raise CommandRefused(
                message("value_of_wrong_type", parameter=self.name, value=quoted(value), type=self.type.value)
            ) from error
        for element in accepted if isinstance(accepted, tuple) else (accepted,):
            if isinstance(element, str):
                if self.choices and element not in self.choices:
                    raise CommandRefused(
                        message(
                            "value_not_a_choice", parameter=self.name, value=quoted(value), choices=tuple(self.choices)
                        )
                    )
            elif not isinstance(element, bool) and not (abs(element) < inf and self.lowest <= element <= self.highest):
                shown = f"{value:g}" if isinstance(value, float) else quoted(value)
                raise CommandRefused(
                    message(
                        "value_out_of_range_with_unit" if self.unit else "value_out_of_range",
                        parameter=self.name,
                        value=shown,
                        lowest=self.lowest,
                        highest=self.highest,
                        unit=self.unit,
                    )
                )
        return accepted


def number(values: Values, name: str) -> float:
    """A number or whole number from complete, accepted ``values``."""
    value = values[name]
    assert isinstance(value, int | float)
    return value


def flag_setting(values: Values, name: str) -> bool:
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
class ParameterFileEntry:
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
class ParameterFileSection:
    """What a file sets on the nodes of one name or wildcard.

    Attributes:
        nodes: full name, or wildcard, of the nodes.
        place: file and line.
        entries: by the parameters' full names.
    """

    nodes: str
    place: str
    entries: dict[str, ParameterFileEntry]

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
    sections: tuple[ParameterFileSection, ...]

    def parameters(self, node: str) -> dict[str, ParameterFileEntry]:
        """What it sets on the node of that full name; later sections override earlier ones."""
        merged: dict[str, ParameterFileEntry] = {}
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
                raise SettingsError(message("section_of_no_node", place=section.place, name=section.nodes, known=known))


_MAX_FILE = 256 * 1024
"""Longest file of settings [bytes]."""

_MAX_DEPTH = 20
"""So many levels of mappings, lists and values a file may have."""

_MAX_NODES = 20_000
"""So many keys and values a file may have; what an alias stands for counts each time."""

_MAX_NUMBER = 1000
"""Longest number [characters]."""

_Read = TypeVar("_Read")
_NULL, _MERGE = "tag:yaml.org,2002:null", "tag:yaml.org,2002:merge"
_COLLECTIONS = ("tag:yaml.org,2002:map", "tag:yaml.org,2002:seq")


def read_parameter_file(path: Path) -> ParameterFile:
    """The parameters in ``path``.

    Raises:
        SettingsError: the file is missing, is not YAML or exceeds a limit, or something in it is not a parameter.
    """
    return _read(path, lambda document: ParameterFile(path.name, tuple(_sections(document, document.root(), ""))))


def read_mapping(path: Path) -> dict[str, Any]:
    """The mapping in ``path``: what it holds are mappings, lists and values in turn.

    Raises:
        SettingsError: the file is missing, is not YAML, holds no mapping or exceeds a limit, or a key stands twice.
    """
    return _read(path, lambda document: document.mapping(document.root()))


def _read(path: Path, take: Callable[[_Document], _Read]) -> _Read:
    try:
        with path.open("rb") as file:
            content = file.read(_MAX_FILE + 1)
    except OSError as error:
        raise SettingsError(message("settings_unreadable", file=str(path), reason=error.strerror)) from error
    if len(content) > _MAX_FILE:
        raise SettingsError(message("settings_too_large", file=str(path), limit=_MAX_FILE // 1024))
    try:
        return take(_Document(path.name, content.decode()))
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise SettingsError(
            message("settings_not_in_utf8", file=str(path), line=line, byte=content[error.start])
        ) from None
    except yaml.YAMLError as error:
        # Without PyYAML's context and problem, which quote the file: a password may stand there.
        mark = error.problem_mark if isinstance(error, yaml.MarkedYAMLError) else None
        if mark is None:
            raise SettingsError(message("settings_not_yaml", file=str(path))) from None
        raise SettingsError(
            message("settings_not_yaml_at", file=str(path), line=mark.line + 1, column=mark.column + 1)
        ) from None


class _Document(yaml.SafeLoader):
    """A YAML document as nodes, which know their lines.

    A node's extent, how many nodes it has and how deep they stand, counts what an alias stands for each time: a short
    file may stand for one of any size.
    """

    def __init__(self, file: str, text: str) -> None:
        super().__init__(text)
        self._file = file
        self._depth = self._count = 0
        self._extents: dict[yaml.Node, tuple[int, int]] = {}
        self._items: dict[yaml.Node, tuple[tuple[str, str, yaml.Node], ...]] = {}

    def place(self, node: yaml.Node) -> str:
        """File and line."""
        return f"{self._file} line {node.start_mark.line + 1}"

    def root(self) -> yaml.MappingNode:
        """The document's mapping."""
        node = self.get_single_node()
        if not isinstance(node, yaml.MappingNode):
            raise SettingsError(message("settings_without_mapping", file=self._file))
        return node

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        self._depth += 1
        self._count += 1
        self._check_extent(self._count, self._depth)
        is_alias = self.check_event(yaml.AliasEvent)
        node = super().compose_node(parent, index)
        self._depth -= 1
        if node is None:
            return None
        if is_alias and node not in self._extents:
            raise SettingsError(message("alias_in_itself", place=self.place(node)))
        if not is_alias:
            self._extents[node] = self._extent(node)
        count, depth = self._extents[node]
        self._check_extent(count, self._depth + depth)
        return node

    def _extent(self, node: yaml.Node) -> tuple[int, int]:
        if isinstance(node, yaml.ScalarNode):
            if len(node.value) > _MAX_NUMBER and node.tag.endswith((":int", ":float")):
                raise SettingsError(
                    message("number_too_long", place=self.place(node), length=len(node.value), limit=_MAX_NUMBER)
                )
            return 1, 1
        if node.tag not in _COLLECTIONS:
            raise SettingsError(message("tag_not_allowed", place=self.place(node), tag=node.tag))
        pairs = node.value if isinstance(node, yaml.MappingNode) else ((each,) for each in node.value)
        inner = [self._extents[each] for pair in pairs for each in pair]
        return 1 + sum(count for count, _ in inner), 1 + max((depth for _, depth in inner), default=0)

    def _check_extent(self, count: int, depth: int) -> None:
        if depth > _MAX_DEPTH:
            raise SettingsError(
                message("settings_nested_too_deeply", file=self._file, line=self.line + 1, limit=_MAX_DEPTH)
            )
        if count > _MAX_NODES:
            raise SettingsError(message("too_many_settings", file=self._file, line=self.line + 1, limit=_MAX_NODES))

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        except (ValueError, LookupError, TypeError, AttributeError) as error:  # PyYAML's, of a date 2024-99-99
            kind = node.tag.rpartition(":")[2]
            raise SettingsError(message("value_not_valid", place=self.place(node), kind=kind)) from error

    def items(self, node: yaml.MappingNode, *, repeated: bool = False) -> Sequence[tuple[str, str, yaml.Node]]:
        """Keys with place and value; a merged one, ``<<``, before the mapping's own, which overrides it.

        Args:
            node: the mapping.
            repeated: whether a key may stand twice, but for that of parameters.

        Raises:
            SettingsError: a key stands twice.
        """
        if node in self._items:
            return self._items[node]
        lines: dict[str, int] = {}
        for key, value in node.value:
            if key.tag == _MERGE:
                for merged in value.value if isinstance(value, yaml.SequenceNode) else (value,):
                    if isinstance(merged, yaml.MappingNode):
                        self.items(merged, repeated=repeated)
            name, line = key.value if key.tag == _MERGE else str(self.construct_object(key)), key.start_mark.line + 1
            if name in lines and not (repeated and name != _PARAMETERS):
                raise SettingsError(
                    message("setting_given_twice", file=self._file, line=line, setting=name, first=lines[name])
                )
            lines[name] = line
        self.flatten_mapping(node)
        self._items[node] = tuple(
            (str(self.construct_object(key)), self.place(key), value) for key, value in node.value
        )
        return self._items[node]

    def mapping(self, node: yaml.MappingNode) -> dict[str, Any]:
        """What a mapping holds."""
        return {name: self._content(value) for name, _, value in self.items(node)}

    def _content(self, node: yaml.Node) -> Any:
        if isinstance(node, yaml.MappingNode):
            return self.mapping(node)
        if isinstance(node, yaml.SequenceNode):
            return [self._content(each) for each in node.value]
        return self.construct_object(node)


def _sections(document: _Document, node: yaml.MappingNode, namespace: str) -> Iterator[ParameterFileSection]:
    for key, place, value in document.items(node, repeated=True):  # as in ROS, sections of one name add up
        nodes = f"{namespace}/{key.strip('/')}"
        is_parameters = key == _PARAMETERS and bool(namespace)
        if not isinstance(value, yaml.MappingNode):
            if value.tag != _NULL:
                where = namespace if is_parameters else nodes
                raise SettingsError(message("section_without_parameters", place=place, name=where))
            if is_parameters:
                yield ParameterFileSection(namespace, place, {})
        elif is_parameters:
            is_general = namespace.endswith("*")
            entries = {
                name: ParameterFileEntry(item, at, is_general) for name, at, item in _parameters(document, value, "")
            }
            yield ParameterFileSection(namespace, place, entries)
        else:
            yield from _sections(document, value, nodes)


def _parameters(document: _Document, node: yaml.MappingNode, group: str) -> Iterator[tuple[str, str, Value]]:
    for key, place, value in document.items(node):
        if isinstance(value, yaml.MappingNode):
            yield from _parameters(document, value, f"{group}{key}.")
        else:
            content = document.construct_object(value, deep=True)
            yield f"{group}{key}", place, _parameter_value(f"{group}{key}", content, place)


def _parameter_value(name: str, value: object, place: str) -> Value:
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list):
        if all(isinstance(element, str) for element in value):
            return tuple(value)
        if all(isinstance(element, int | float) and not isinstance(element, bool) for element in value):
            with suppress(OverflowError):  # a whole number that no float holds
                return tuple(float(element) for element in value)
    raise SettingsError(message("value_of_no_type", place=place, parameter=name, value=quoted(value)))
