from __future__ import annotations

import pytest

from yumi.control.commands import MemoryMailbox
from yumi.control.requests import Event, ImplausibleFeedback
from yumi.control.shared_state import Problem, Snapshot, peek_snapshot, put_snapshot
from yumi.driver.control_process import FastLines
from yumi.robot.joints import ZERO, Joints, Side

LEFT: Joints = (0.5, -1.0, 0.5, 0.0, 0.0, 0.0, 0.0)


def never_built(*_: object) -> None:
    """No process is started here."""


@pytest.mark.parametrize(("position", "is_other_arm"), [(LEFT, True), ((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), False)])
def test_doubted_position_that_is_the_other_arms_is_reported_as_such(
    monkeypatch: pytest.MonkeyPatch, position: Joints, is_other_arm: bool
) -> None:
    events: list[Event] = []
    lines = FastLines(never_built, events.append)  # type: ignore[arg-type]
    snapshots = {Side.LEFT: Snapshot(position=LEFT), Side.RIGHT: Snapshot(position=ZERO)}
    monkeypatch.setattr(lines, "snapshot", snapshots.__getitem__)
    lines._explain(
        events.append, ImplausibleFeedback(Side.RIGHT, "yumi_joint_1_r", 0.5, position, ("a",), is_lost=True)
    )
    (event,) = events
    assert isinstance(event, ImplausibleFeedback)
    assert event.is_other_arm is is_other_arm
    assert ("left and right EGM ports are exchanged?" in str(event)) is is_other_arm
    assert "yumi_joint_1_r is 28.6° from where the arm can be, the arm holds; a deactivated: " in str(event)


def test_snapshot_passes_the_problem_on() -> None:
    box = MemoryMailbox()
    told = Snapshot(implausible=3, problem=Problem.REFERENCES_IGNORED, interruptions=2, drift_ppm=1.5)
    put_snapshot(box, told)
    assert peek_snapshot(box) == told
