"""``virtual-irc5 check`` and ``yumi rapid check``: what in RAPID modules does not fit, found without a controller.

A check finds what the language does not allow, and what the virtual controller does not provide.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from abb_protocols.catalogue import message
from abb_protocols.errors import RapidError, SettingsError
from abb_runtime.options import FILE_TYPE, JsonOutput, SharedCommand, cfg_option, json_option, model_option

if TYPE_CHECKING:
    from virtual_irc5.rapid.types import RapidReferenceError


_MOST_SYNTAX_ERRORS = 20  # of one file
_ROUTINE_BEGINS = re.compile(r"^\s*(?:LOCAL\s+)?(?:PROC|FUNC|TRAP)\b", re.IGNORECASE)
_ROUTINE_HEAD = re.compile(r"^\s*(?:LOCAL\s+)?(?:TRAP\s+\w+|(?:PROC|FUNC)\b.*\))\s*(?:!.*)?$", re.IGNORECASE)
_ROUTINE_ENDS = re.compile(r"^\s*END(?:PROC|FUNC|TRAP)\b", re.IGNORECASE)


@click.command(cls=SharedCommand)
@click.argument("files", nargs=-1, required=True, type=FILE_TYPE, metavar="FILE…")
@cfg_option
@model_option
@json_option
def check(files: tuple[Path, ...], cfg: tuple[Path, ...], model: str, json_output: JsonOutput) -> None:
    """Find errors in RAPID modules.

    The modules are checked as one program: syntax errors, type errors and unknown names, for the robot of --model.
    One line each: file, line, column, and what is expected. "unknown" is what nothing declares (an error where it is
    executed, once all modules are there), "missing" what RobotWare has and this package has not. Exit code 1 with any.

    \b
    Examples:
      {command} pick.mod
      {command} --model irb120 pick.mod
      {command} --json pick.mod    a list, for editors
    """
    faults = check_program(files, cfg, model)
    json_output.write(json.dumps([asdict(fault) for fault in faults], indent=2))
    if not json_output.is_printed:
        for fault in faults:
            click.echo(f"{fault.file}:{fault.line}:{fault.column}: {fault.kind}: {fault.sentence}")
        if not faults:
            click.echo(f"{len(files)} {'file' if len(files) == 1 else 'files'}: nothing found")
    if faults:
        sys.exit(1)


@dataclass(frozen=True, slots=True)
class ProgramFault:
    """Something in a program that does not fit.

    Attributes:
        file: where it is.
        line, column: counted from 1.
        kind: "syntax", "reference" (a type, an argument, a name used twice), "unknown" or "missing".
        sentence: what was found and what is expected.
    """

    file: str
    line: int
    column: int
    kind: str
    sentence: str


def check_program(files: Sequence[Path], cfg: Sequence[Path] = (), robot: str = "yumi") -> list[ProgramFault]:
    """All that does not fit in modules that make one program, in the order of files and lines.

    Args:
        files: its modules.
        cfg: system parameters that it needs.
        robot: name of the robot it is written for, one of those of the virtual controller.

    Raises:
        SettingsError: a file cannot be read, or the system parameters are not what they should be.
    """
    from virtual_irc5.controller.file_store import decoded_file_text  # noqa: PLC0415
    from virtual_irc5.controller.installed_system import (  # noqa: PLC0415
        ROBOTS,
        delivered_system,
        is_user_module,
        with_programs,
    )
    from virtual_irc5.rapid.types import RapidReferenceError  # noqa: PLC0415 - a quick --help
    from virtual_irc5.world import World, WorldSettings  # noqa: PLC0415

    model = ROBOTS[robot]
    name = model.units[0].task
    world = World(WorldSettings(system=with_programs(delivered_system(model), {name: ()}, cfg)))
    task = world.controller.tasks[name]
    faults, modules = [], []
    for path in files:
        try:
            text = decoded_file_text(path.read_bytes())
        except OSError as error:
            raise SettingsError(
                message("file_unreadable", file=str(path), reason=error.strerror or str(error))
            ) from error
        parsable, found = _parsable(text, str(path))
        faults += found
        if parsable is not None:
            modules.append((path, parsable))
    if any(is_user_module(text) for _, text in modules):
        task.unload("user")
    for path, text in modules:
        try:
            task.load(text, str(path))
        except RapidReferenceError as error:
            faults.append(_fault(error))
        except RapidError as error:
            faults.append(ProgramFault(str(path), 1, 1, "reference", str(error)))
    faults += [_fault(error) for error in task.faults()]
    order = {str(path): index for index, path in enumerate(files)}
    return sorted(dict.fromkeys(faults), key=lambda each: (order.get(each.file, 0), each.line, each.column))


def _parsable(text: str, filename: str) -> tuple[str | None, list[ProgramFault]]:
    """The text without the routines that have syntax errors, None when it is none of RAPID's, and those errors."""
    from virtual_irc5.rapid.parser import parse_module  # noqa: PLC0415 - a quick --help
    from virtual_irc5.rapid.types import RapidSyntaxError  # noqa: PLC0415

    faults: list[ProgramFault] = []
    while len(faults) < _MOST_SYNTAX_ERRORS:
        try:
            parse_module(text, filename)
        except RapidSyntaxError as error:
            faults.append(ProgramFault(filename, error.line, error.column, "syntax", error.sentence))
            lines = text.split("\n")
            first = min(error.line, len(lines)) - 1
            while first >= 0 and not _ROUTINE_BEGINS.match(lines[first]):
                if _ROUTINE_ENDS.match(lines[first]) and first < error.line - 1:
                    return None, faults  # between routines: there is nothing to leave out
                first -= 1
            last = next((i for i in range(max(first, 0), len(lines)) if _ROUTINE_ENDS.match(lines[i])), None)
            if first < 0 or last is None:
                return None, faults
            # Its head stays, so that calls of it are no errors, too.
            keeps_head = first < error.line - 1 and _ROUTINE_HEAD.match(lines[first])
            lines[first + 1 : last] = [""] * (last - first - 1)
            if not keeps_head:
                lines[first] = lines[last] = ""
            text = "\n".join(lines)
        else:
            return text, faults
    return None, faults


def _fault(error: RapidReferenceError) -> ProgramFault:
    from virtual_irc5.rapid.types import NotProvided, Unresolved  # noqa: PLC0415 - a quick --help

    kind = "missing" if isinstance(error, NotProvided) else "unknown" if isinstance(error, Unresolved) else "reference"
    return ProgramFault(error.filename, max(error.line, 1), max(error.column, 1), kind, error.sentence)
