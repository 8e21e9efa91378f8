"""RAPID's own instructions, and the set a host builds its instructions on."""

from __future__ import annotations

from yumi.rapid.builtin_data import DATA
from yumi.rapid.builtin_maths import MATHS
from yumi.rapid.builtin_signals import SIGNALS
from yumi.rapid.builtin_strings import STRINGS
from yumi.rapid.builtin_system import SYSTEM
from yumi.rapid.library import Library

STANDARD = Library(DATA)
for _part in (MATHS, STRINGS, SIGNALS, SYSTEM):
    STANDARD.include(_part)


class InstructionSet(Library):
    """The names every module of a task sees: RAPID's own, and what the host registers on top of them."""

    def __init__(self, base: Library = STANDARD) -> None:
        super().__init__(base)
