"""The instructions a host builds on: what RAPID provides here, and the names of what RobotWare 6 base has besides."""

from __future__ import annotations

from importlib.resources import files

from yumi.rapid.builtins.constants import CONSTANTS
from yumi.rapid.builtins.data import DATA, MATHS
from yumi.rapid.builtins.dialogs import DIALOGS
from yumi.rapid.builtins.execution import EXECUTION
from yumi.rapid.builtins.files import FILES
from yumi.rapid.builtins.information import INFORMATION
from yumi.rapid.builtins.matrices import MATRICES
from yumi.rapid.builtins.options import OPTIONS
from yumi.rapid.builtins.queues import QUEUES
from yumi.rapid.builtins.rawbytes import RAWBYTES
from yumi.rapid.builtins.signals import SIGNALS
from yumi.rapid.builtins.sockets import SOCKETS
from yumi.rapid.builtins.strings import STRINGS
from yumi.rapid.builtins.symbols import SYMBOLS
from yumi.rapid.builtins.system import SYSTEM
from yumi.rapid.library import Library

STANDARD = Library(DATA)
for _part in (
    CONSTANTS,
    MATHS,
    STRINGS,
    SIGNALS,
    SYSTEM,
    RAWBYTES,
    SOCKETS,
    FILES,
    DIALOGS,
    INFORMATION,
    SYMBOLS,
    QUEUES,
    EXECUTION,
    MATRICES,
    OPTIONS,
):
    STANDARD.include(_part)

NAMES: dict[str, tuple[str, ...]] = {}
"""The names that RobotWare 6 base has, provided or not, by the sections of `names.txt`."""
for _section in files("yumi.rapid.builtins").joinpath("names.txt").read_text(encoding="ascii").split("\n[")[1:]:
    _title, _, _names = _section.partition("]")
    NAMES[_title] = tuple(_names.split())
    STANDARD.missing(*NAMES[_title])  # except those that are provided


class InstructionSet(Library):
    """The names every module of a task sees: RAPID's own, and what the host registers on top of them."""

    def __init__(self, base: Library = STANDARD) -> None:
        super().__init__(base)
