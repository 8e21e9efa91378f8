from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from yumi.control.controller import MemoryBuffer
from yumi.control.events import ImplausibleFeedback
from yumi.control.loop import name_the_arm
from yumi.control.shared_state import Problem, Snapshot, read_snapshot
from yumi.robot.joints import ZERO, Joints, Side

LEFT: Joints = (0.5, -1.0, 0.5, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(("position", "is_other_arm"), [(LEFT, True), ((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), False)])
def test_doubted_position_that_is_the_other_arms_is_reported_as_such(position: Joints, is_other_arm: bool) -> None:
    arms: Any = {Side.LEFT: SimpleNamespace(position=LEFT), Side.RIGHT: SimpleNamespace(position=ZERO)}
    event = name_the_arm(ImplausibleFeedback(Side.RIGHT, "yumi_joint_1_r", 0.5, position, ("a",), is_lost=True), arms)
    assert isinstance(event, ImplausibleFeedback)
    assert event.is_other_arm is is_other_arm
    assert ("left and right EGM ports are exchanged?" in str(event)) is is_other_arm
    assert "yumi_joint_1_r is 28.6° from where the arm can be, the arm holds; a deactivated: " in str(event)


def test_snapshot_passes_the_problem_on() -> None:
    box = MemoryBuffer()
    told = Snapshot(implausible=3, problem=Problem.REFERENCES_IGNORED, interruptions=2, drift_ppm=1.5)
    box.write(told)
    assert read_snapshot(box) == told
