"""The loading of modules: the program that a task goes on with, made beside the one that it executes."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.compiler import compile_routine, link_module
from virtual_irc5.rapid.frame import Code
from virtual_irc5.rapid.literals import format_value
from virtual_irc5.rapid.loaded_modules import LoadedModule
from virtual_irc5.rapid.program import Program
from virtual_irc5.rapid.types import UNSET_DATA, ProgramTooLarge, RapidReferenceError

_LONGEST_PROGRAM = 4_000_000  # characters in all modules together
MOST_DATA = 20_000  # declared in all modules together
# From the name of a datum on: what stands between ":=" and ";".
_FIRST_VALUE = re.compile(r'[^:"!]*:=\s*((?:"(?:[^"]|"")*"|[^";])*?)\s*;')


@dataclass(frozen=True, slots=True)
class Prepared:
    """Modules ready to be loaded.

    Attributes:
        replaces_program: whether they take the place of all program modules.
        base: the program they were prepared for.
        program: the program with them.
        is_linked: whether its data have their values.
    """

    modules: tuple[LoadedModule, ...]
    replaces_program: bool
    base: Program
    program: Program
    is_linked: bool

    def is_for(self, base: Program, modules: Sequence[s.Module], *, replaces_program: bool, has_pp: bool) -> bool:
        """Whether modules were prepared for a program; where it has a program pointer, their data need values."""
        texts = [(each.syntax.filename, each.syntax.text) for each in self.modules]
        is_same = self.base is base and self.replaces_program == replaces_program
        return is_same and texts == [(each.filename, each.text) for each in modules] and (self.is_linked or not has_pp)


def prepared(
    base: Program, modules: Sequence[s.Module], *, replaces_program: bool, has_pp: bool, task: str
) -> Prepared:
    """A program with other modules, linked and compiled as far as it fits where there is a program pointer.

    Raises:
        RapidReferenceError: a name is declared twice.
        ProgramTooLarge: there is no memory for it.
    """
    removed = removed_by(modules, base, replaces_program=replaces_program)
    kept = [*modules, *(each.syntax for each in base.modules.values() if each not in removed)]
    length, count = sum(len(each.text) for each in kept), sum(len(each.data) for each in kept)
    if length > _LONGEST_PROGRAM or count > MOST_DATA:
        raise ProgramTooLarge(
            f"{modules[0].filename}: with '{modules[0].name}' the task {task} would have {length} characters "
            f"of text and {count} data, there is memory for {_LONGEST_PROGRAM} and {MOST_DATA}."
        )
    program, loaded = base, tuple(LoadedModule.of(each) for each in modules)
    for old in removed if replaces_program else ():
        program = program.unloaded(old.name)
    for new in loaded:
        program = program.loaded(new)
    if has_pp:
        for each in program.modules.values():  # what the others lacked may have come
            link_module(program, each)
        for routine in program.routines:
            if routine not in program.codes:
                with suppress(RapidReferenceError):  # an error of its call
                    program.codes[routine] = compile_routine(program, routine)
    return Prepared(loaded, replaces_program, base, program, has_pp)


def removed_by(modules: Sequence[s.Module], program: Program, *, replaces_program: bool) -> list[LoadedModule]:
    """The modules whose place others take: those of their names, and all program modules where they are a program."""
    names = {each.name.lower() for each in modules}
    return [
        each
        for key, each in program.modules.items()
        if key in names or (replaces_program and not each.syntax.is_system)
    ]


def saved_text(module: LoadedModule) -> str:
    """A module's text, its persistents with their values of now as first values."""
    text = module.syntax.text
    lines = list(itertools.accumulate((len(line) for line in text.splitlines(keepends=True)), initial=0))
    for variable, datum in sorted(module.data.items(), key=lambda item: -item[1].position):
        if datum.storage is not s.Storage.PERS or datum.initial is None or variable.value is UNSET_DATA:
            continue
        found = _FIRST_VALUE.match(text, lines[datum.line - 1] + datum.column - 1)
        if found is not None:
            value = format_value(variable.type, variable.value)
            text = f"{text[: found.start(1)]}{value}{text[found.end(1) :]}"
    return text


def free_code(codes: Sequence[Code]) -> None:
    """Free code that is not needed any more, in pieces: all at once would keep other threads waiting for cycles."""
    for code in codes:
        while code.steps:
            del code.steps[-500:]
