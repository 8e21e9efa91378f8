"""What the demonstration tells a person before a robot moves, and how it asks after a stop."""

from __future__ import annotations

import io
import os
import pty
from collections.abc import Callable, Iterator
from math import pi, radians
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console
from ros_bench import Robot

from abb_protocols.errors import RobotNotReady, StopNotConfirmed
from abb_protocols.robot.description import SERVO_GRIPPERS
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ArmCommand, ArmState, Side, home, joints
from reported_limiter import ReportedLimiter
from trajectories import change_rate
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_motion import EgmMotionParameters
from yumi.cli import demo
from yumi.cli.demo import DemoScreen, motions_ahead, read_positions
from yumi.control.collisions import COLLISION_MARGIN, CollisionLimiter
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.driver.settings import CollisionSettings, RobotSettings, override, read_settings
from yumi.ros.move_and_grab import GRAB_GOALS, MEETING_OF_ARMS, MOVE_TOLERANCE, MoveAndGrab

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
    assert "No joint is faster than 60 °/s (speed_scale 1)" in motions_ahead(GRAB_GOALS, top_speed=radians(60.0))


def test_positions_are_read_from_the_controller(robot: Robot) -> None:
    positions = read_positions(RobotSettings(address="127.0.0.1", rws_port=robot.rws_port))
    assert set(positions) == set(Side)
    assert all(len(position) == len(GRAB_GOALS[Side.LEFT]) for position in positions.values())


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


def test_bar_is_full_when_the_arm_has_arrived() -> None:
    def wait_for_motion(has_arrived: Callable[[], bool], _: str) -> None:
        while not has_arrived():
            continue

    errors, shares = iter([1.0, 0.5, 0.9 * MOVE_TOLERANCE]), list[float]()
    arm = SimpleNamespace(
        error=lambda: next(errors), goals=SimpleNamespace(publish=lambda _: None, topic=""), is_commanded=True
    )
    application: Any = MoveAndGrab.__new__(MoveAndGrab)
    application._arms, application.reports = {Side.LEFT: arm}, {Side.LEFT: SimpleNamespace()}
    application._progress = SimpleNamespace(
        step=lambda sentence: None, error=lambda side, error_deg, share: shares.append(share)
    )
    application._activate = application._wait = lambda *_: None
    application._wait_for_motion = wait_for_motion
    application._move(Side.LEFT)
    assert shares == [0.5, 1.0]


class Done:
    """A future that has its result."""

    def __init__(self, value: object) -> None:
        self.result = lambda: value

    def done(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("message", "offered"),
    [
        ("The stop 10013-1-aaaaaa is open. It did not become idle.", ""),
        ("Call recover with the id 50204-3-bbbbbb.", "50204-3-bbbbbb"),
    ],
)
def test_stop_is_offered_for_confirmation_only_with_its_own_text(message: str, offered: str) -> None:
    """The state in the result is newer than the message: a stop that it alone knows was not shown to a person."""
    state = SimpleNamespace(stop="50204-3-bbbbbb")
    result = SimpleNamespace(success=False, message=message, stop=offered, state=state)
    handle = SimpleNamespace(get_result_async=lambda: Done(SimpleNamespace(result=result)))
    application = MoveAndGrab.__new__(MoveAndGrab)
    application._recover_client = SimpleNamespace(
        server_is_ready=lambda: True, send_goal_async=lambda *_, **__: Done(handle)
    )
    with pytest.raises(RobotNotReady, match=offered or "10013-1-aaaaaa") as refused:
        application._request_recovery("")
    assert refused.value.stop == offered
    assert isinstance(refused.value, StopNotConfirmed) is bool(offered)


class Heard:
    """The progress of the demonstration."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def step(self, sentence: str) -> None:
        self.notes.append(sentence)

    note = step


def test_arms_are_sent_to_the_same_place_until_they_are_held_and_back() -> None:
    heard, sent = Heard(), []
    state = SimpleNamespace(limited_by=["left forearm - body, 3 mm"], speed_scale=1.0)
    application = MoveAndGrab.__new__(MoveAndGrab)
    application._progress, application._state = heard, state

    class Arm:
        is_commanded, stands = True, True

        def __init__(self, side: Side) -> None:
            self.at = GRAB_GOALS[side]
            self.goals = SimpleNamespace(publish=lambda message: sent.append((side, tuple(message.position))))

        def error(self) -> float:
            return 0.0

    application._arms = {side: Arm(side) for side in Side}
    waits = []

    def wait(is_true: Callable[[], bool], timeout: float, what: str) -> None:
        waits.append(what)
        if len(waits) == 1:
            assert not is_true()  # the body holds nothing apart that would meet
            state.limited_by = ["right wrist - left wrist, 10 mm"]
            application._arms[Side.LEFT].stands = False
            assert not is_true()
            application._arms[Side.LEFT].stands = True
        assert is_true()

    application._wait = wait
    application._approach()
    assert sent == [*((side, MEETING_OF_ARMS[side]) for side in Side), *((side, GRAB_GOALS[side]) for side in Side)]
    assert heard.notes[1:] == [
        "held: right wrist - left wrist, 10 mm; the driver lets them no nearer (collision.margin)"
    ]


@pytest.mark.parametrize(
    ("robot", "is_enabled", "approaches"), [(None, True, True), (None, False, False), ("10.0.0.1", True, False)]
)
def test_arms_approach_each_other_on_the_demonstrations_own_virtual_robot_alone(
    robot: str | None, is_enabled: bool, approaches: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class Process:
        log, exit_code = tmp_path / "log", None

        def __init__(self, *_: object) -> None:
            pass

        def __enter__(self) -> Process:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def wait_until_ready(self, *_: object) -> str:
            return "http://127.0.0.1:1"

    asked = []
    settings = override(read_settings(), {"collision": {"enabled": is_enabled}}, "test")
    monkeypatch.setattr(demo, "CommandProcess", Process)
    monkeypatch.setattr(demo, "read_settings", lambda: settings)
    monkeypatch.setattr(demo, "_run_application", lambda *_, approaches: asked.append(approaches))
    demo.run_demo(demo.DemoPlan(robot, (), tmp_path), Heard(), lambda: False)
    assert asked == [approaches]


@pytest.mark.timeout(240)
def test_limiter_holds_the_arms_of_the_approach_before_they_meet() -> None:
    """In virtual time, from where nothing is near yet; at first they go on along each other."""
    both = CollisionLimiter(CollisionSettings().model(SERVO_GRIPPERS), YUMI_LIMITS, EGM_GAIN, COLLISION_MARGIN)
    limiters = {side: ReportedLimiter(YUMI_LIMITS, collisions=both.arm(side)) for side in Side}
    arms, measured, time = {}, {}, 100.0
    for side in Side:
        begin = joints([a + 0.55 * (b - a) for a, b in zip(GRAB_GOALS[side], MEETING_OF_ARMS[side], strict=True)])
        arms[side] = arm = VirtualArm(side, begin, ArmModel(supervises_load=False))
        arm.switch_motors_on()
        arm.start_egm(EgmMotionParameters(bandwidth=0.0, max_speed=10.0))
        measured[side] = begin
    speeds = dict.fromkeys(Side, 1.0)
    for cycle in range(1000):
        time += CYCLE
        for side, arm in arms.items():
            velocity = change_rate(arm.position, measured[side], CYCLE)
            state = ArmState(time, CYCLE if cycle else 0.0, 1, arm.position, velocity, arm.planned, True)
            arm.set_reference(*limiters[side].limit(state, ArmCommand(MEETING_OF_ARMS[side]) if cycle else None))
            limiters[side].observe(state)
            measured[side], speeds[side] = arm.position, max(map(abs, velocity))
            arm.advance(CYCLE)
        held = [both.arm(side).limited for side in Side]
        if cycle > 50 and all(held) and max(speeds.values()) < 0.01:
            break
    else:
        raise AssertionError(f"The arms were not held; {held}, {speeds}")
    for side, limited in zip(Side, held, strict=True):
        assert limited is not None
        assert side.word in limited.part
        assert side.other.word in limited.other
        assert COLLISION_MARGIN - 1e-3 < limited.distance < 2.0 * COLLISION_MARGIN
