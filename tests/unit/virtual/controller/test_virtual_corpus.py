"""Programs of several tasks: each directory of tests/rapid_corpus is a controller with a module for each task.

The first lines of T_ROB_L.mod say what has to come of it, as in tests/unit/rapid/test_rapid_corpus.py; a line on
the FlexPendant is preceded by the task that writes it.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from virtual_irc5.controller.installed_system import delivered_system, with_programs
from virtual_irc5.world import World, WorldSettings

FOLDER = Path(__file__).parents[3] / "rapid_corpus"
PROGRAMS = sorted(path for path in FOLDER.iterdir() if path.is_dir())


@pytest.mark.parametrize("folder", PROGRAMS, ids=lambda path: path.name)
def test_tasks_do_what_they_say(folder: Path) -> None:
    text = (folder / "T_ROB_L.mod").read_text()
    programs = {path.stem: [path] for path in folder.glob("*.mod")}
    programs = {"T_ROB_R": [], **programs}
    world = World(WorldSettings(system=with_programs(delivered_system(), programs, sorted(folder.glob("*.cfg")))))
    controller = world.controller
    controller.set_motors(True)
    controller.start_rapid()
    seen: list[str] = []
    counts = dict.fromkeys(controller.tasks, 0)
    for _ in range(round(float(_directives(text, "run")[0]) / world.cycle_time)):
        world.cycle({})
        for task, lines in controller.screens.items():
            seen += [f"{task} {line}" for line in lines[counts[task] :]]
            counts[task] = len(lines)
    sentences = [event.description for event in controller.events.entries()]
    assert sorted(seen) == sorted(_directives(text, "line")), sentences  # tasks run beside each other
    for task in controller.tasks:
        assert [line for line in seen if line.startswith(task)] == [
            line for line in _directives(text, "line") if line.startswith(task)
        ]
    for line in _directives(text, "value"):
        name, _, value = line.partition(" ")
        task = controller.tasks["T_ROB_L"]
        assert task.read(task.modules[-1].name, name) == value


def _directives(text: str, kind: str) -> list[str]:
    prefix = f"! @{kind} "
    return [line[len(prefix) :] for line in text.splitlines() if line.startswith(prefix)]
