"""RAPID's predefined constants: programs get the values of `constants.txt`, and each error is caught by its name."""

from __future__ import annotations

from pathlib import Path

import pytest
from rapid_bench import started

from virtual_irc5.rapid import InstructionSet
from virtual_irc5.rapid.rapid_library import ERROR_NAMES
from virtual_irc5.rapid.types import LONGEST_NAME
from virtual_irc5.world import World

SECTIONS = {
    section.partition("]")[0]: section.partition("]")[2].split()
    for section in Path(__file__).with_name("constants.txt").read_text(encoding="ascii").split("\n[")[1:]
}
ERRORS = SECTIONS.pop("errnum")


@pytest.fixture(scope="module")
def library() -> InstructionSet:
    """With the robot's own."""
    library = World().controller.tasks["T_ROB_R"].library
    assert isinstance(library, InstructionSet)
    return library


@pytest.mark.parametrize("type_name", SECTIONS)
def test_program_gets_the_value(type_name: str, library: InstructionSet) -> None:
    """A program assigns each constant to a variable of its type and compares it with what it should be."""
    constants = dict(entry.replace("\\20", " ").split("=", 1) for entry in SECTIONS[type_name])
    body = "\n".join(f"value:={name}; {name}_:=value;" for name in constants)
    variables = "\n".join(f"VAR {type_name} {name}_;" for name in constants)
    bench = started(body, f"VAR {type_name} value;\n{variables}", library)
    assert not bench.stop.error, bench.stop.sentence
    assert {name: bench.read(f"{name}_") for name in constants} == constants


def test_errors_are_raised_and_caught_by_their_names() -> None:
    """Each is raised in a routine whose handler takes that error alone."""
    routines = "\n".join(
        f'PROC p{i}() RAISE {name}; ERROR ({name}) TPWrite "{name}"; TRYNEXT; ENDPROC' for i, name in enumerate(ERRORS)
    )
    bench = started("\n".join(f"p{i};" for i in range(len(ERRORS))), routines)
    bench.run(0.5)
    assert bench.lines == ERRORS


def test_every_error_has_a_name_that_a_program_can_write() -> None:
    assert max(map(len, ERROR_NAMES)) <= LONGEST_NAME
