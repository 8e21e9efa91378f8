"""The RAPID modules of this package, and what makes two texts of a module the same."""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

from yumi.errors import ControllerRefused, ProtocolError
from yumi.robot.joints import Side
from yumi.rws.client import RwsClient

GRIPPER_MODULE = "TRobSG"
"""The module that needs the product SmartGripper."""

OWN_MODULE = "TRobSystem"
"""The module that is the user's to edit: it is loaded where there is none, and never replaced."""

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


def foreign_mains(client: RwsClient, side: Side) -> Iterator[tuple[str, str]]:
    """Name and text of each module in an arm's task that is not one of this package and has a ``main``."""
    ours = {name.lower() for name in delivered_modules()}
    for module in client.modules(side.task):
        if module.name.lower() in ours:
            continue
        try:
            text = client.module_text(side.task, module.name)
        except (ControllerRefused, ProtocolError):  # hidden and encoded modules of ABB, which have no main
            continue
        if has_main(text):
            yield module.name, text
