r"""Programs in the styles of public RAPID: each loads, runs, and does what its first lines say.

The lines are comments. What there is: ``! @signal NAME=VALUE …``, ``! @at SECONDS NAME=VALUE`` (a change from outside),
``! @module PATH TEXT`` (to load), ``! @run SECONDS``. What has to come of it: ``! @line TEXT`` on the FlexPendant (in
this order and no others), ``! @value NAME LITERAL``, ``! @ends NAME=VALUE`` of a signal, ``! @file PATH TEXT`` (\n for
a new line), ``! @stop NAME`` of the error that stops it.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from rapid_bench import RecordingHost

from virtual_irc5.rapid import InstructionSet
from virtual_irc5.rapid.task import Task

FOLDER = Path(__file__).parents[2] / "rapid_corpus"
PROGRAMS = sorted(FOLDER.glob("*.mod"))


def directives(text: str, kind: str) -> list[str]:
    """What follows `! @kind`, line by line."""
    prefix = f"! @{kind} "
    return [line[len(prefix) :] for line in text.splitlines() if line.startswith(prefix)]


class Cell(RecordingHost):
    """A controller whose signals order interrupts."""

    def write_signal(self, name: str, value: float) -> None:
        old = self.signals[name.lower()]
        super().write_signal(name, value)
        self.task.signal_changed(name, old, value)

    task: Task


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_program_does_what_it_says(path: Path) -> None:
    text, host = path.read_bytes().decode("latin-1"), Cell()
    for each in " ".join(directives(text, "signal")).split():
        name, _, value = each.partition("=")
        host.signals[name.lower()] = float(value)
    for line in directives(text, "module"):
        name, _, content = line.partition(" ")
        host.files[name] = content.replace("\\n", "\n")
    changes = [(float(at), *each.split("=")) for line in directives(text, "at") for at, each in [line.split()]]
    task = host.task = Task("T_ROB1", host, InstructionSet())
    task.repeats = True
    task.load(text, f"HOME:/{path.name}")
    task.move_pp_to_main()
    task.start()
    for step in range(round(float(directives(text, "run")[0]) / 0.004)):
        while changes and changes[0][0] <= step * 0.004:
            _, name, value = changes.pop(0)
            host.write_signal(name, float(value))
        task.advance(0.004)
    sentences = [event.sentence for event in host.events]
    assert host.lines == directives(text, "line"), sentences
    assert [event.error for event in host.events if event.error] == directives(text, "stop"), sentences
    for line in directives(text, "value"):
        name, _, value = line.partition(" ")
        assert task.read(task.modules[0].name, name) == value
    for line in directives(text, "ends"):
        name, _, value = line.partition("=")
        assert (name, host.signals[name.lower()]) == (name, float(value))
    for line in directives(text, "file"):
        name, _, content = line.partition(" ")
        assert host.devices.disk.read(name).decode("latin-1") == content.replace("\\n", "\n")
    assert changes == []
    assert any(directives(text, kind) for kind in ("line", "value", "ends", "file")), "it must have an effect"


def test_there_are_programs() -> None:
    assert len(PROGRAMS) >= 40
