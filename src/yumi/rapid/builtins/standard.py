"""RAPID's own instructions, and the set a host builds its instructions on."""

from __future__ import annotations

from yumi.rapid.builtins.data import DATA
from yumi.rapid.builtins.maths import MATHS
from yumi.rapid.builtins.robotware import FUNCTIONS, INSTRUCTIONS
from yumi.rapid.builtins.signals import SIGNALS
from yumi.rapid.builtins.strings import STRINGS
from yumi.rapid.builtins.system import SYSTEM
from yumi.rapid.library import Library

STANDARD = Library(DATA)
for _part in (MATHS, STRINGS, SIGNALS, SYSTEM):
    STANDARD.include(_part)
STANDARD.missing(*INSTRUCTIONS, *FUNCTIONS)  # except those that are provided


class InstructionSet(Library):
    """The names every module of a task sees: RAPID's own, and what the host registers on top of them."""

    def __init__(self, base: Library = STANDARD) -> None:
        super().__init__(base)
