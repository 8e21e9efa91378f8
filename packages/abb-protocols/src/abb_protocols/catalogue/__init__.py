"""The catalogue: messages for people as codes with values, and their words: headlines, sentences, clauses, remedies.

Between the parts of the program, its processes and its front ends travel :class:`Message` values: a code, and the
values that belong to it. Only what shows a message to a person words it, from the texts of each package.
What a person can do is an :class:`Action`, which each front end words as its user does it: a service of ROS, a method,
a command of the shell, a button. No code takes a sentence apart, compares it, or replaces words in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from math import degrees
from string import Formatter, ascii_lowercase
from types import MappingProxyType
from typing import Any

from abb_protocols.catalogue.actions import ACTIONS, Action, FrontEnd
from abb_protocols.catalogue.text import Text

Value = Any
"""A number, a text, a :class:`Message`, or a tuple of these."""

_WORDED = {"arm", "changes", "reason", "what", "text"}  # values that are words of a sentence, wherever they stand
_LONGEST_QUOTE = 80  # of what others have sent [characters]


@dataclass(frozen=True, slots=True)
class Message:
    """What is to be said: a code of the catalogue, and the values of its text.

    Its string is its sentence in the words of this program's front end.

    Attributes:
        code: of the text.
        values: by the names in the text; SI units, angles in rad.
    """

    code: str
    values: Mapping[str, Value] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", MappingProxyType(dict(self.values)))

    def __hash__(self) -> int:
        return hash(self.code)

    def __str__(self) -> str:
        return sentence(self)

    def __reduce__(self) -> tuple[Any, ...]:
        return Message, (self.code, dict(self.values))

    @property
    def actions(self) -> tuple[Action, ...]:
        """What a person can do about it, in the order in which it is done; those of messages in it included."""
        return tuple(dict.fromkeys(_actions(self)))


def message(code: str, /, **values: Value) -> Message:
    """The message of a code; that the text exists and has these values is checked by the tests of the catalogue."""
    return Message(code, values)


_modules = ["abb_protocols.texts"]


def add_texts(module: str) -> None:
    """Find texts in another module, too: in its ``SUBJECTS``, which are loaded when the first sentence is worded."""
    if module not in _modules:
        _modules.append(module)
        subjects.cache_clear()
        all_texts.cache_clear()


@cache
def subjects() -> Mapping[str, Mapping[str, Text]]:
    """All texts by subject, as the documentation lists them."""
    return {subject: of_subject for name in _modules for subject, of_subject in import_module(name).SUBJECTS.items()}


@cache
def all_texts() -> dict[str, Text]:
    """All texts by code; ``text`` is what others have said: the operating system, a library, the controller."""
    found = {"text": Text("{text}")}
    for of_subject in subjects().values():
        assert not found.keys() & of_subject.keys(), found.keys() & of_subject.keys()
        found.update(of_subject)
    return found


_front_end = FrontEnd.SCRIPT


def speak_as(front_end: FrontEnd) -> None:
    """Word the messages of this program for another front end than a script."""
    global _front_end  # noqa: PLW0603 - one program speaks to one kind of reader
    _front_end = front_end


def sentence(said: Message, front_end: FrontEnd | None = None) -> str:
    """A message as one or more whole sentences."""
    if said.code == "text":  # what others have said, as they said it
        return str(said.values["text"])
    text = _begun(said, _full(said, front_end))
    return text if text.endswith((".", "!", "?", ":")) else f"{text}."


def headline(said: Message, front_end: FrontEnd | None = None) -> str:
    """What was done or is so, as a line of its own, without a full stop and without what to do."""
    return _begun(said, clause(said, front_end))


def clause(said: Message, front_end: FrontEnd | None = None) -> str:
    """What happened or is so, as part of a sentence: what to do is left out."""
    return _Words(said, front_end or _front_end).vformat(_template(said).what, (), said.values)


def remedy_of(said: Message, front_end: FrontEnd | None = None) -> str:
    """What to do about it, as part of a sentence; empty where nothing is to be done."""
    return _Words(said, front_end or _front_end).vformat(_template(said).remedy, (), said.values)


def _full(said: Message, front_end: FrontEnd | None = None) -> str:
    what, remedy = clause(said, front_end), remedy_of(said, front_end)
    return f"{what}; {remedy}" if remedy else what


def in_words(said: Iterable[Message], front_end: FrontEnd | None = None) -> str:
    """Several messages, each in sentences of its own."""
    return " ".join(sentence(each, front_end) for each in said)


def said_by(error: BaseException) -> Message:
    """What an error says: the message of an error of this package, the text of any other."""
    said = getattr(error, "said", None)
    return said if isinstance(said, Message) else message("text", text=str(error) or type(error).__name__)


def to_wire(value: Value) -> Any:
    """A value of a message, or a message, as values that JSON can carry."""
    if isinstance(value, Message):
        return {"code": value.code, "values": {name: to_wire(each) for name, each in value.values.items()}}
    if isinstance(value, tuple | list):
        return [to_wire(each) for each in value]
    return value


def from_wire(value: Any) -> Value:
    """The opposite of :func:`to_wire`; lists come back as tuples."""
    if isinstance(value, Mapping) and isinstance(value.get("code"), str):
        values = value.get("values", {})
        return Message(value["code"], {name: from_wire(each) for name, each in values.items()})
    if isinstance(value, list):
        return tuple(from_wire(each) for each in value)
    return value


def is_known(said: Message) -> bool:
    """Whether this program has the texts of a message and of those in it, with all values: some may be newer."""
    if said.code not in all_texts() or not _fields(said.code) <= said.values.keys() | _ACTION_FIELDS.keys():
        return False
    if not _fields_of_actions(said) <= said.values.keys():
        return False
    return all(map(is_known, _messages_in(said)))


def quoted(value: object) -> str:
    """What a request or a file of others holds, for a sentence: as Python writes it, cut to 80 characters."""
    return cut(repr(value[: _LONGEST_QUOTE + 1] if isinstance(value, str) else value))


def cut(text: str) -> str:
    """A text that may hold what others have sent, cut to 80 characters."""
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}…"


def enumerated(texts: Iterable[str], last: str) -> str:
    """Texts as in ``a, b or c``."""
    *others, end = texts
    return f"{', '.join(others)} {last} {end}" if others else end


# In texts `{recover}` is what to do ("call recover"), `{Recover}` the same at the begin of a sentence, and
# `{recover:name}` what it is called.
_ACTION_FIELDS: Mapping[str, Action] = {
    name: action for action in Action for name in (action.value, action.value.capitalize())
}


def _template(said: Message) -> Text:
    return all_texts()[said.code]


def _begun(said: Message, text: str) -> str:
    """The words of a message as a sentence begins."""
    return text[:1].upper() + text[1:] if _begins_with_a_word(said) else text


def _begins_with_a_word(said: Message) -> bool:
    """Whether a sentence begins with a word that is written with a capital: not with a file, a name or a number."""
    what = _template(said).what
    if what[:1] in ascii_lowercase:
        return "_" not in what.partition(" ")[0]
    name = next((name for name, _ in _parts(said.code)), "") if what.startswith("{") else ""
    value = said.values.get(name)
    return _begins_with_a_word(value) if isinstance(value, Message) else name in _WORDED


def _parts(code: str) -> Iterator[tuple[str, str]]:
    """Names and formats of the fields of a text."""
    text = all_texts()[code]
    for template in (text.what, text.remedy):
        for _, name, spec, _ in Formatter().parse(template):
            if name is not None:
                yield name, spec or ""


def _fields(code: str) -> set[str]:
    return {name for name, _ in _parts(code)}


def _fields_of_actions(said: Message) -> set[str]:
    """The values that the words of its actions have, in any front end."""
    words = (each.do for action in _own_actions(said) for each in ACTIONS[action.value].values())
    return {name for text in words for _, name, _, _ in Formatter().parse(text) if name is not None}


def _messages_in(said: Message) -> Iterator[Message]:
    for value in said.values.values():
        yield from (each for each in (value if isinstance(value, tuple) else (value,)) if isinstance(each, Message))


def _own_actions(said: Message) -> Iterator[Action]:
    return (_ACTION_FIELDS[name] for name, _ in _parts(said.code) if name not in said.values and name in _ACTION_FIELDS)


def _actions(said: Message) -> Iterator[Action]:
    for each in _messages_in(said):
        yield from _actions(each)
    yield from _own_actions(said)


class _Words(Formatter):
    """Fills the fields of a text.

    Formats beside Python's own: ``.1°`` degrees of rad, ``.0mm``, ``.0ms``, ``quoted``, ``cut``, ``list`` (a, b, c, or
    none), ``or`` (a, b or c), ``and``, and for messages ``sentence``, ``remedy`` and ``full`` (what happened, and what
    to do, within a sentence), and for lists of them ``steps`` (what to do about each, before what comes next); without
    one a message is its clause.
    """

    def __init__(self, said: Message, front_end: FrontEnd) -> None:
        self._said = said
        self._front_end = front_end

    def get_value(self, key: int | str, args: Any, kwargs: Any) -> Any:
        if key in kwargs:
            return kwargs[key]
        return _Do(_ACTION_FIELDS[str(key)], str(key)[0].isupper())

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, _Do):
            return self._action(value, format_spec)
        if isinstance(value, Message):
            word = {"sentence": sentence, "remedy": remedy_of, "full": _full}.get(format_spec, clause)
            return word(value, self._front_end)
        if isinstance(value, tuple | list):
            return self._list(value, format_spec)
        if format_spec in _QUOTES:
            return _QUOTES[format_spec](value)
        for unit, factor in _UNITS.items():
            if format_spec.endswith(unit):
                return f"{value * factor:{format_spec.removesuffix(unit)}f}{unit if unit == '°' else f' {unit}'}"
        return str(super().format_field(value, format_spec))

    def _action(self, do: _Do, format_spec: str) -> str:
        words = ACTIONS[do.action.value][self._front_end.value]
        text = self.vformat(words.name if format_spec == "name" else words.do, (), self._said.values)
        return text[:1].upper() + text[1:] if do.begins else text

    def _list(self, values: Sequence[Any], format_spec: str) -> str:
        is_list = format_spec in {"list", "or", "and"}
        texts = [self.format_field(each, "" if is_list else format_spec) for each in values]
        if format_spec == "remedy":
            texts = [each for each in texts if each]
        if is_list and not texts:
            return "none"
        if format_spec in {"or", "and"}:
            return enumerated(texts, format_spec)
        if format_spec == "sentence":
            return " ".join(texts)
        if format_spec == "steps":
            return "".join(f"{step}; " for each in values if (step := remedy_of(each, self._front_end)))
        return ("; then " if any(isinstance(each, Message) for each in values) else ", ").join(texts)


@dataclass(frozen=True, slots=True)
class _Do:
    action: Action
    begins: bool


_UNITS = {"°": degrees(1.0), "mm": 1e3, "ms": 1e3}
_QUOTES: Mapping[str, Callable[[Any], str]] = {"quoted": quoted, "cut": lambda value: cut(str(value))}
