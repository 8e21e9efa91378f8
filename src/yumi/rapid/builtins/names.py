"""The names that RobotWare 6 base has, whether this library provides them or not; `names.txt` lists them."""

from __future__ import annotations

from importlib.resources import files

_SECTIONS: dict[str, tuple[str, ...]] = {}
_text = files("yumi.rapid.builtins").joinpath("names.txt").read_text(encoding="ascii")
for _section in _text.split("\n[")[1:]:
    _title, _, _names = _section.partition("]")
    _SECTIONS[_title] = tuple(_names.split())

INSTRUCTIONS = _SECTIONS["instructions"]
FUNCTIONS = _SECTIONS["functions"]
TYPES = _SECTIONS["types"]
CONSTANTS = _SECTIONS["constants"]
