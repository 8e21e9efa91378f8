"""What the demonstration tells a person before a robot moves, and how it asks after a stop."""

from __future__ import annotations

import io
import os
import pty
from collections.abc import Callable, Iterator
from math import pi, radians
from types import SimpleNamespace

import pytest
from rich.console import Console
from ros_bench import Robot

from yumi.cli.demo import DemoScreen, motions_ahead, read_positions
from yumi.driver.settings import RobotSettings
from yumi.errors import RobotNotReady, StopNotConfirmed
from yumi.robot.joints import Side, home
from yumi.ros.move_and_grab import GOALS, MoveAndGrab

pytestmark = [pytest.mark.ros, pytest.mark.timeout(60)]


def test_prompt_says_from_where_to_where_and_how_fast_each_arm_moves() -> None:
    text = motions_ahead({side: home(side) for side in Side}, top_speed=pi, speed_scale=0.1)
    assert "The right arm moves by up to 143.6° (yumi_joint_4_r), straight in joint space:" in text
    assert "to   42.1, -118.4, -92.1, 46.5, -143.6, 42.5, 36.1° (axes 1, 2, 7, 3, 4, 5, 6)" in text
    assert "from 0.0, -130.0, -135.0, 30.0, 0.0, 40.0, 0.0°" in text
    assert "No joint is faster than 18 °/s (speed_scale 0.1)" in text
    assert "The motors are switched on" in text
    assert "grippers are calibrated" in text
    assert "the left tool is lifted by 50 mm on a straight line and put back" in text


def test_prompt_names_the_speed_that_joints_may_have_at_most() -> None:
    assert "No joint is faster than 60 °/s (speed_scale 1)" in motions_ahead(GOALS, top_speed=radians(60.0))


def test_positions_are_read_from_the_controller(robot: Robot) -> None:
    positions = read_positions(RobotSettings(address="127.0.0.1", rws_port=robot.rws_port))
    assert set(positions) == set(Side)
    assert all(len(position) == len(GOALS[Side.LEFT]) for position in positions.values())


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], None]]:
    """Standard input is a terminal; types a line there."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r", encoding="utf-8") as stream:
        monkeypatch.setattr("sys.stdin", stream)
        yield lambda line: os.write(ours, f"{line}\n".encode()) and None
    os.close(ours)


def screen_on(output: io.StringIO) -> DemoScreen:
    screen = DemoScreen()
    screen._console = screen._bars.live.console = Console(file=output, force_terminal=True, highlight=False)
    return screen


@pytest.mark.parametrize(("line", "is_confirmed"), [("yes", True), ("no", False), ("", False), ("y", False)])
def test_person_at_the_terminal_decides(terminal: Callable[[str], None], line: str, is_confirmed: bool) -> None:
    output = io.StringIO()
    assert screen_on(output).confirm("It stands [50204].", lambda: terminal(line)) is is_confirmed
    assert "It stands [50204]." in output.getvalue()


def test_yes_that_was_typed_before_the_question_confirms_nothing(terminal: Callable[[str], None]) -> None:
    terminal("yes")
    assert screen_on(io.StringIO()).confirm("It stands.", lambda: terminal("no")) is False


def test_no_question_is_asked_without_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("yes\n"))
    assert screen_on(io.StringIO()).confirm("It stands.", lambda: None) is False


def test_prompt_ends_when_the_demonstration_is_interrupted(terminal: Callable[[str], None]) -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        screen_on(io.StringIO()).confirm("It stands.", interrupt)


class Done:
    """A future that has its result."""

    def __init__(self, value: object) -> None:
        self.result = lambda: value

    def done(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("message", "stop", "offered"),
    [
        ("The stop 10013-1-aaaaaa is open. It did not become idle.", "50204-3-bbbbbb", ""),
        ("Call recover with the id 50204-3-bbbbbb.", "50204-3-bbbbbb", "50204-3-bbbbbb"),
    ],
)
def test_stop_is_offered_for_confirmation_only_with_its_own_text(message: str, stop: str, offered: str) -> None:
    """The state in the result is newer than the message: a stop that it alone knows was not shown to a person."""
    result = SimpleNamespace(success=False, message=message, state=SimpleNamespace(stop=stop))
    handle = SimpleNamespace(get_result_async=lambda: Done(SimpleNamespace(result=result)))
    application = MoveAndGrab.__new__(MoveAndGrab)
    application._recover_client = SimpleNamespace(
        server_is_ready=lambda: True, send_goal_async=lambda *_, **__: Done(handle)
    )
    with pytest.raises(RobotNotReady, match=stop if offered else "10013-1-aaaaaa") as refused:
        application._request_recovery("")
    assert refused.value.stop == offered
    assert isinstance(refused.value, StopNotConfirmed) is bool(offered)
