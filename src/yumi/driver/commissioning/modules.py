"""The RAPID modules of this package, and what makes two texts of a module the same."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path

GRIPPER_MODULE = "TRobSG"
"""The module that needs the product SmartGripper."""

_CODE = re.compile(r'(?:"[^"]*"|[^"!])*')
"""A line up to its comment."""

_PERSISTENT = re.compile(r"\b(pers\s+\w+\s+\w+(?:\{[^}]*\})?)\s*:=[^;]*;", re.IGNORECASE)
_MAIN = re.compile(r"(?im)^\s*proc\s+main\s*\(")


def delivered_modules() -> dict[str, str]:
    """The RAPID modules of this package by name."""
    folder = files("yumi.controller_files")
    paths = sorted(each.name for each in folder.iterdir() if each.name.endswith((".mod", ".sys")))
    return {Path(path).stem: (folder / path).read_text(encoding="latin-1") for path in paths}


def essence(text: str) -> str:
    """A RAPID text to compare: without comments, spaces, letter case and the present values of PERS data."""
    code = "\n".join(match[0] for line in text.splitlines() if (match := _CODE.match(line)))
    return "".join(_PERSISTENT.sub(r"\1;", code).split()).lower()


def has_main(text: str) -> bool:
    """Whether a module declares the procedure a program begins with."""
    return _MAIN.search(text) is not None
