"""The hand-over with a person: what is asked, and when."""

from __future__ import annotations

import sys
from pathlib import Path
from unittest.mock import MagicMock

import pytest


@pytest.mark.parametrize("is_person", [True, False])
def test_rod_is_asked_for_when_the_gripper_is_open_and_let_go_before_the_arms_move(
    monkeypatch: pytest.MonkeyPatch, *, is_person: bool
) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples"))
    import hand_over

    robot, terminal = MagicMock(), MagicMock()
    terminal.isatty.return_value = is_person
    connect = MagicMock()
    connect.return_value.__enter__.return_value = robot
    monkeypatch.setattr(hand_over.yumi, "connect", connect)
    monkeypatch.setattr(sys, "stdin", terminal)
    flush, question = MagicMock(), MagicMock()
    monkeypatch.setattr(hand_over.termios, "tcflush", flush)
    monkeypatch.setattr("builtins.input", question)
    robot.attach_mock(flush, "flush")  # whose calls are listed with those of the robot
    robot.attach_mock(question, "input")
    hand_over.main("memory")
    begin = [name for name, _, _ in robot.mock_calls if "is_holding" not in name]
    asked = ["flush", "input"] if is_person else []
    opened = ["move_to", "right.gripper.open", "left.gripper.open"]
    expected = [*opened, *asked, "right.gripper.grasp", *asked, "right.move_to_pose"]
    assert begin[: len(expected)] == expected
    if is_person:
        hold, let_go = (call.args[0] for call in question.call_args_list)
        assert "80 mm" in hold
        assert "Let go" in let_go
    assert hand_over.FREE > 2 * hand_over.NEAR
