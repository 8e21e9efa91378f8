"""Checks RAPID programs against the language and against what the virtual controller provides."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from yumi.errors import RapidError, SettingsError
from yumi.rapid.errors import NotProvided, RapidReferenceError, RapidSyntaxError, Unresolved
from yumi.rapid.parser import parse_module
from yumi.virtual.controller.files import decoded
from yumi.virtual.controller.system import ROBOTS, YUMI, delivered_system, factory_system, with_programs
from yumi.virtual.world import World, WorldSettings

_MOST_SYNTAX_ERRORS = 20  # of one file
_BEGIN = re.compile(r"^\s*(?:LOCAL\s+)?(?:PROC|FUNC|TRAP)\b", re.IGNORECASE)
_HEAD = re.compile(r"^\s*(?:LOCAL\s+)?(?:TRAP\s+\w+|(?:PROC|FUNC)\b.*\))\s*(?:!.*)?$", re.IGNORECASE)
_END = re.compile(r"^\s*END(?:PROC|FUNC|TRAP)\b", re.IGNORECASE)


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

    def as_dict(self) -> dict[str, str | int]:
        return asdict(self)


def check_program(files: Sequence[Path], cfg: Sequence[Path] = (), robot: str = YUMI.name) -> list[ProgramFault]:
    """All that does not fit in modules that make one program, in the order of files and lines.

    Args:
        files: its modules.
        cfg: system parameters that it needs.
        robot: name of the robot it is written for, one of `ROBOTS`.

    Raises:
        SettingsError: a file cannot be read, or the system parameters are not what they should be.
    """
    model = ROBOTS[robot]
    system = delivered_system() if model.is_yumi else factory_system(model)
    name = model.units[0].task
    world = World(WorldSettings(system=with_programs(system, {name: ()}, cfg)))
    task = world.controller.tasks[name]
    faults = []
    for path in files:
        try:
            text = decoded(path.read_bytes())
        except OSError as error:
            raise SettingsError(f"{path} cannot be read: {error.strerror or error}.") from error
        parsable, found = _parsable(text, str(path))
        faults += found
        if parsable is None:
            continue
        try:
            task.load(parsable, str(path))
        except RapidReferenceError as error:
            faults.append(_fault(error))
        except RapidError as error:
            faults.append(ProgramFault(str(path), 1, 1, "reference", str(error)))
    faults += [_fault(error) for error in task.faults()]
    order = {str(path): index for index, path in enumerate(files)}
    return sorted(dict.fromkeys(faults), key=lambda each: (order.get(each.file, 0), each.line, each.column))


def _parsable(text: str, filename: str) -> tuple[str | None, list[ProgramFault]]:
    """The text without the routines that have syntax errors, None when it is none of RAPID's, and those errors."""
    faults: list[ProgramFault] = []
    while len(faults) < _MOST_SYNTAX_ERRORS:
        try:
            parse_module(text, filename)
        except RapidSyntaxError as error:
            sentence = str(error).removeprefix(f"{filename}:{error.line}:{error.column}: ")
            faults.append(ProgramFault(filename, error.line, error.column, "syntax", sentence))
            lines = text.split("\n")
            first = min(error.line, len(lines)) - 1
            while first >= 0 and not _BEGIN.match(lines[first]):
                if _END.match(lines[first]) and first < error.line - 1:  # between routines: nothing to leave out
                    return None, faults
                first -= 1
            last = next((i for i in range(max(first, 0), len(lines)) if _END.match(lines[i])), None)
            if first < 0 or last is None:
                return None, faults
            # Its head stays, so that calls of it are no errors, too.
            keeps_head = first < error.line - 1 and _HEAD.match(lines[first])
            lines[first + 1 : last] = [""] * (last - first - 1)
            if not keeps_head:
                lines[first] = lines[last] = ""
            text = "\n".join(lines)
        else:
            return text, faults
    return None, faults


def _fault(error: RapidReferenceError) -> ProgramFault:
    kind = "missing" if isinstance(error, NotProvided) else "unknown" if isinstance(error, Unresolved) else "reference"
    return ProgramFault(error.filename, max(error.line, 1), max(error.column, 1), kind, error.sentence)
