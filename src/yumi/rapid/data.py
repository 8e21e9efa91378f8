"""Data in memory: variables, parts of variables, and the parameter that was not passed."""

from __future__ import annotations

from typing import Any, Protocol

from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.syntax import Storage
from yumi.rapid.types import Type

Path = tuple[int, ...]
UNSET: Any = object()  # the value of a declared datum before the program is linked


class Place(Protocol):
    """Something a value can be read from and written to: what VAR, PERS and INOUT parameters receive."""

    value: Any

    @property
    def name(self) -> str: ...

    @property
    def type(self) -> Type: ...


class Variable:
    """A named datum; `value` is always a converted value of `type`.

    Attributes:
        initial: what a VAR begins with at each PP to main, UNSET for objects, which are made anew.
    """

    __slots__ = ("initial", "is_local", "is_task", "name", "storage", "type", "value")

    def __init__(
        self,
        name: str,
        type_: Type,
        value: Any = UNSET,
        storage: Storage = Storage.VAR,
        *,
        is_local: bool = True,
        is_task: bool = False,
    ) -> None:
        self.name = name
        self.type = type_
        self.value = value
        self.storage = storage
        self.is_local = is_local
        self.is_task = is_task
        self.initial: Any = UNSET

    @property
    def is_constant(self) -> bool:
        return self.storage is Storage.CONST


class Part:
    """A component or element of another place; writing it replaces the whole value there."""

    __slots__ = ("path", "type", "whole")

    def __init__(self, whole: Place, path: Path, type_: Type) -> None:
        self.whole = whole
        self.path = path
        self.type = type_

    @property
    def name(self) -> str:
        return self.whole.name

    @property
    def value(self) -> Any:
        value = self.whole.value
        for index in self.path:
            value = value[index]
        return value

    @value.setter
    def value(self, new: Any) -> None:
        self.whole.value = replaced(self.whole.value, self.path, new)


def replaced(value: Any, path: Path, new: Any) -> Any:
    """The record or array `value` with the part at `path` being `new`."""
    if not path:
        return new
    items = list(value)
    items[path[0]] = replaced(items[path[0]], path[1:], new)
    return tuple(items) if type(value) is tuple else value._make(items)


class Absent:
    """What stands in the place of an optional parameter that was not passed."""

    __slots__ = ()
    name = "an optional parameter"

    @property
    def type(self) -> Type:
        raise RapidRuntimeError("ERR_NOTPRES", "An optional parameter is used that the caller did not pass.")

    @property
    def value(self) -> Any:
        raise RapidRuntimeError("ERR_NOTPRES", "An optional parameter is used that the caller did not pass.")

    @value.setter
    def value(self, new: Any) -> None:
        raise RapidRuntimeError("ERR_NOTPRES", "An optional parameter is used that the caller did not pass.")


ABSENT = Absent()
