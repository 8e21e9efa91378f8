"""Configuration, files and RAPID modules of a controller as values, and the difference of two: a calculation."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isclose
from typing import NamedTuple

_CODE = re.compile(r'(?:"[^"]*"|[^"!])*')
"""A line up to its comment."""

_PERSISTENT = re.compile(r"\b(pers\s+\w+\s+\w+(?:\{[^}]*\})?)\s*:=[^;]*;", re.IGNORECASE)
_SAME = 1e-4  # relative difference of two numbers that are the same: the controller rounds
_SET = {"true", "yes", "1"}  # a flag in a file, and what controllers make of it


class CfgKey(NamedTuple):
    """One instance of the configuration; the name, or what distinguishes it in a type without names."""

    domain: str
    type: str
    name: str


class ModuleKey(NamedTuple):
    """A RAPID module in a task."""

    task: str
    name: str


@dataclass(frozen=True, slots=True)
class Contents:
    """A part of what is on a controller; None for what is not there.

    Attributes:
        files: texts by path; a directory ends in a slash and has the text "".
        cfg: attributes of instances.
        modules: texts of loaded modules.
    """

    files: Mapping[str, str | None] = field(default_factory=dict)
    cfg: Mapping[CfgKey, Mapping[str, str] | None] = field(default_factory=dict)
    modules: Mapping[ModuleKey, str | None] = field(default_factory=dict)

    def absent(self) -> Contents:
        """The same things, none of them there."""
        return Contents(dict.fromkeys(self.files), dict.fromkeys(self.cfg), dict.fromkeys(self.modules))

    def completed_from(self, other: Contents) -> Contents:
        """This, and what only the other has."""
        return Contents({**other.files, **self.files}, {**other.cfg, **self.cfg}, {**other.modules, **self.modules})

    def as_json(self) -> dict[str, object]:
        """For a record."""
        return {
            "files": dict(self.files),
            "cfg": [[*key, attributes and dict(attributes)] for key, attributes in self.cfg.items()],
            "modules": [[*key, text] for key, text in self.modules.items()],
        }

    @classmethod
    def of_json(cls, value: Mapping[str, object]) -> Contents:
        """Out of a record."""
        texts, cfg, modules = value["files"], value["cfg"], value["modules"]
        assert isinstance(texts, dict)
        assert isinstance(cfg, list)
        assert isinstance(modules, list)
        return cls(
            texts,
            {CfgKey(domain, type, name): attributes for domain, type, name, attributes in cfg},
            {ModuleKey(task, name): text for task, name, text in modules},
        )


@dataclass(frozen=True, slots=True)
class ContentsChange:
    """One line of a plan.

    Attributes:
        sign: ``+`` what comes, ``-`` what goes, ``~`` what becomes different.
        place: what it is, and where.
        what: how it changes, where it is there before and after.
    """

    sign: str
    place: str
    what: str = ""

    def __str__(self) -> str:
        return f"{self.sign} {self.place}{f': {self.what}' if self.what else ''}"


def differences(present: Contents, wanted: Contents) -> tuple[ContentsChange, ...]:
    """What has to change, in the order of cfg, files and modules; attributes that are not wanted do not count."""
    changes = []
    for key, attributes in wanted.cfg.items():
        now, place = present.cfg.get(key), f"{key.domain} {key.type} {key.name}"
        if attributes is None and now is not None:
            changes.append(ContentsChange("-", place))
        elif attributes is not None and now is None:
            shown = (f"{name} {value}" for name, value in attributes.items() if value not in ("", key.name))
            changes.append(ContentsChange("+", place, ", ".join(shown)))
        elif attributes is not None and now is not None and (new := changed(now, attributes)):
            shown = (f"{name} {now.get(name, '')!r} becomes {value!r}" for name, value in new.items())
            changes.append(ContentsChange("~", place, ", ".join(shown)))
    for path, text in wanted.files.items():
        if (was := present.files.get(path)) != text:
            changes.append(_change(f"{'directory' if path.endswith('/') else 'file'} {path}", was, text))
    for module, text in wanted.modules.items():
        if not is_same_module(was := present.modules.get(module), text):
            changes.append(_change(f"module {module.name} in {module.task}", was, text))
    return tuple(changes)


def _change(place: str, before: str | None, after: str | None) -> ContentsChange:
    if before is None or after is None:
        return ContentsChange("+" if before is None else "-", place)
    was, becomes = before.splitlines(), after.splitlines()
    return ContentsChange("~", place, f"{len({*becomes} - {*was})} new lines, {len({*was} - {*becomes})} gone")


def changed(now: Mapping[str, str], wanted: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in wanted.items() if not _is_same_value(now.get(name, ""), value)}


def _is_same_value(one: str, other: str) -> bool:
    try:
        return isclose(float(one), float(other), rel_tol=_SAME)
    except ValueError:
        words = {one.strip().lower(), other.strip().lower()}
        return len(words) == 1 or words <= _SET


def is_same_module(one: str | None, other: str | None) -> bool:
    if one is None or other is None:
        return one is other
    return essence(one) == essence(other)


def essence(text: str) -> str:
    """A RAPID text to compare: without comments, spaces, letter case and the present values of PERS data."""
    code = "\n".join(match[0] for line in text.splitlines() if (match := _CODE.match(line)))
    return "".join(_PERSISTENT.sub(r"\1;", code).split()).lower()
