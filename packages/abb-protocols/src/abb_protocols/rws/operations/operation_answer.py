"""The answer of an operation: texts, whole numbers, flags, choices in the fields of a state; one, a pair or a record.

The virtual controller writes a value into the fields of a state, and the client reads it out of them. A class of values
is a dataclass; each of its fields is ``Annotated`` with the name of the state's field where that is another one, and
with a :class:`Spelling` where the type does not say how a value is written.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from enum import Enum
from typing import Annotated, Any, Generic, TypeVar, get_args, get_origin, get_type_hints

from abb_protocols.rws.documents import Page, RwsLink, RwsState

_T = TypeVar("_T")
_E = TypeVar("_E", bound=Enum)


@dataclass(frozen=True, slots=True)
class Spelling(Generic[_T]):
    """How a value is read from the field of a name, or from several, and written to it."""

    read: Callable[[RwsState, str], _T]
    write: Callable[[str, _T], Mapping[str, str]]


TEXT = Spelling(RwsState.text, lambda name, value: {name: value})
TEXT_OR_NONE = Spelling(RwsState.text, lambda name, value: {name: value} if value else {})
"""A text whose field is left out where it is empty."""

TITLE: Spelling[str] = Spelling(lambda state, name: state.title, lambda name, value: {})
"""What the state is called, which is in no field."""

WHOLE = Spelling(RwsState.whole, lambda name, value: {name: str(value)})


def flag(true: str = "TRUE", false: str = "FALSE") -> Spelling[bool]:
    """A truth that is written in these words."""
    return Spelling(RwsState.flag, lambda name, value: {name: true if value else false})


def choice(true: str, false: str) -> Spelling[bool]:
    """A truth that is one of two words, of which only the first is true."""
    return Spelling(lambda state, name: state.text(name) == true, lambda name, value: {name: true if value else false})


def one_of(kind: type[_E]) -> Spelling[_E]:
    """A member of an enum by its value."""
    return Spelling(lambda state, name: state.member(kind, name), lambda name, value: {name: value.value})


@dataclass(frozen=True, slots=True)
class OperationAnswer(Generic[_T]):
    """The states of an answer, each with one value.

    Attributes:
        types: of the states: written is the first, read are all.
        read, write: the value in the fields of a state.
    """

    types: tuple[str, ...]
    read: Callable[[RwsState], _T]
    write: Callable[[_T], Mapping[str, str]]

    def of(self, page: Page) -> _T:
        """The value of a page with one."""
        return self.read(page.one(*self.types))

    def state(self, title: str, value: _T, *links: RwsLink) -> RwsState:
        """The state with a value."""
        return RwsState(self.types[0], title, self.write(value), links)


def single(type: str, name: str, spelling: Spelling[_T]) -> OperationAnswer[_T]:
    """An answer with one field; ``type`` is ``type|type`` where some controllers show another one."""
    return OperationAnswer(
        tuple(type.split("|")),
        lambda state: spelling.read(state, name),
        lambda value: spelling.write(name, value),
    )


def pair(type: str, first: str, second: str) -> OperationAnswer[tuple[int, int]]:
    """An answer with two whole numbers in these fields."""
    spelling = Spelling(
        lambda state, name: (state.whole(first), state.whole(second)),
        lambda name, values: {first: str(values[0]), second: str(values[1])},
    )
    return single(type, "", spelling)


def record(type: str, kind: type[_T], **spelled: tuple[str, Spelling[Any]]) -> OperationAnswer[_T]:
    """An answer with the fields of a dataclass, some spelled as given; ``type`` as for :func:`single`.

    What has a default may be missing where it is read.
    """
    parts = [
        (name, *spelled.get(name, (usual_name, usual)), is_optional)
        for name, (usual_name, usual, is_optional) in _spellings(kind).items()
    ]

    def read(state: RwsState) -> _T:
        found = {}
        for name, own, spelling, is_optional in parts:
            if not is_optional or own in state.fields:
                found[name] = spelling.read(state, own)
        return kind(**found)

    def write(value: _T) -> Mapping[str, str]:
        written: dict[str, str] = {}
        for name, own, spelling, _ in parts:
            written |= spelling.write(own, getattr(value, name))
        return written

    return OperationAnswer(tuple(type.split("|")), read, write)


def _spellings(kind: type[Any]) -> Mapping[str, tuple[str, Spelling[Any], bool]]:
    """The fields of a dataclass: the name of the state's field, its spelling, and whether it has a default."""
    hints = get_type_hints(kind, include_extras=True)
    found = {}
    for each in fields(kind):
        hint = hints[each.name]
        hint, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        spelled = next((mark for mark in marks if isinstance(mark, str)), each.name.replace("_", "-"))
        spelling = next((mark for mark in marks if isinstance(mark, Spelling)), None) or _usual(hint)
        has_default = each.default is not MISSING or each.default_factory is not MISSING
        found[each.name] = (spelled, spelling, has_default)
    return found


def _usual(kind: type[Any]) -> Spelling[Any]:
    if kind is bool:
        return flag()
    if kind is int:
        return WHOLE
    return one_of(kind) if isinstance(kind, type) and issubclass(kind, Enum) else TEXT
