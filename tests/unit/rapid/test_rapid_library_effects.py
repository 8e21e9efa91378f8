"""What RAPID's instructions and functions do: the programs of `effects.txt`, each with the lines it must write.

Programs there need the task alone; instructions of the robot (motion, EGM, grippers) have tests of their own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import pytest
from rapid_bench import Bench


@dataclass
class Effect:
    """A program and what it must write."""

    names: list[str]
    declarations: list[str] = field(default_factory=list)
    body: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)


EFFECTS = Path(__file__).with_name("effects.txt")


def effects(file: Path = EFFECTS) -> list[Effect]:
    """The programs of a file."""
    found: list[Effect] = []
    for line in file.read_text(encoding="ascii").splitlines():
        mark, _, rest = line.partition(" ")
        if mark == "==":
            found.append(Effect(rest.split()))
        elif line and mark != "#":
            effect = found[-1]
            place = {"--": effect.declarations, "=>": effect.lines}.get(mark)
            (effect.body if place is None else place).append(line if place is None else rest)
    return found


@pytest.mark.parametrize("effect", effects(), ids=lambda effect: effect.names[0])
def test_effect(effect: Effect, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "UTC")
    bench = Bench("\n".join(effect.body), "\n".join(effect.declarations))
    bench.host.devices.facts = {"SerialNo": "14000-1", "SWVersion": "6.13"}
    bench.host.devices.time = lambda: 1_614_834_367.0
    bench.start().run(1.2)
    assert effect.lines, "a program without an effect proves nothing"
    assert bench.lines == effect.lines, bench.stop.sentence if bench.host.events else ""
    text = "\n".join([*effect.declarations, *effect.body]).lower()
    assert not [name for name in effect.names if name.lower() not in text]
