"""The commands for a running driver, against one whose robot notes what it is asked."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from math import pi, radians
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import clause, message, sentence
from abb_protocols.catalogue.actions import Action, FrontEnd
from abb_protocols.errors import SettingsError
from abb_protocols.robot.joints import YUMI_LIMITS, Side, chain_from_abb, home, joint_names, named_pose
from fake_driver import ROBOT, FakeDriver
from refusals import refused
from yumi.api.attach import attach
from yumi.cli import robot_commands as commands
from yumi.cli import shell
from yumi.cli.main import main
from yumi.control.controllers.joint_goal import JointGoal
from yumi.driver.controller_names import GOAL_CONTROLLER, STREAM_CONTROLLER
from yumi.driver.endpoint import find_driver
from yumi.driver.endpoint_server import MAX_CLIENTS
from yumi.driver.robot_state import RobotMode

COLLISION = message("event_50204", number=50204, title="Motion supervision")


@pytest.fixture(autouse=True)
def _a_folder_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


@pytest.fixture
def driver() -> Iterator[FakeDriver]:
    driver = FakeDriver()
    driver.server.start()
    yield driver
    driver.server.stop()


def run(*arguments: str) -> str:
    result = CliRunner().invoke(main, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def refusal(*arguments: str, code: int = 1) -> str:
    result = CliRunner().invoke(main, arguments, catch_exceptions=False)
    assert result.exit_code == code, result.output
    return result.stderr


@pytest.mark.parametrize("kind", ["idle", "attached"])
def test_stop_is_served_at_once_beside_sixteen_clients(driver: FakeDriver, kind: str) -> None:
    run("stop")  # imported
    with ExitStack() as stack:
        for _ in range(MAX_CLIENTS):
            if kind == "idle":
                stack.enter_context(socket.socket(socket.AF_UNIX)).connect(str(find_driver()))
            else:
                assert stack.enter_context(attach()).state.is_connected
        begin = time.monotonic()
        assert run("stop") == "EGM has ended\n"
        assert time.monotonic() - begin < 0.5
    assert driver.manager.asked == ["stop", "stop"]


def goals(driver: FakeDriver) -> list[JointGoal]:
    return [command.message for command in driver.robot.control.commands if isinstance(command.message, JointGoal)]


def test_help_of_move_says_what_keeps_the_arms_apart_and_what_is_not_known() -> None:
    text = " ".join(CliRunner().invoke(main, ["move", "--help"]).output.split())
    assert "The driver keeps the arms apart from each other" in text
    assert "What was not declared is not known" in text


def test_state_is_shown_for_a_person(driver: FakeDriver) -> None:
    shown = run("state")
    for words in (
        f"robot {ROBOT}",
        "operating mode AUTO, motoron, RAPID running, speed_scale 1",
        "can move",
        f"right arm: EGM off, holding, commanded by {GOAL_CONTROLLER}",
        "j7 -135.00",
        "left gripper: keep object, 20.0 mm, holding",
    ):
        assert words in shown


def test_state_is_printed_as_json(driver: FakeDriver) -> None:
    shown = json.loads(run("state", "--json"))
    assert shown["arms"]["right"]["position"] == list(home(Side.RIGHT))
    assert shown["arms"]["right"]["mode"] == "holding"
    assert shown["controllers"]["left"][0]["name"] == GOAL_CONTROLLER


def test_state_says_why_nothing_moves_and_what_to_do(driver: FakeDriver) -> None:
    driver.manager.robot = replace(
        driver.manager.robot, reasons=(message("stop_open", stop="50204-1"),), causes=(COLLISION,), stop="50204-1"
    )
    reason = sentence(message("stop_open", stop="50204-1"), FrontEnd.SHELL)
    cause = sentence(COLLISION, FrontEnd.SHELL)
    assert f"cannot move: {reason}\nstopped by: {cause}\n" in run("state")


def test_controllers_are_listed(driver: FakeDriver) -> None:
    assert "commands" in next(line for line in run("controllers").splitlines() if GOAL_CONTROLLER in line)
    assert json.loads(run("controllers", "--json"))["right"][0]["state"] == "active"


def test_commands_reach_the_driver(driver: FakeDriver) -> None:
    assert run("start") == "EGM runs\n"
    run("start", "right")
    run("mode", "ready")
    assert "operating mode AUTO" in run("mode")
    assert json.loads(run("stop", "--json")) == "EGM has ended"
    run("calibrate")
    assert run("speed-scale", "0.3") == "speed_scale is 0.3\n"
    assert driver.manager.asked == [None, (Side.RIGHT,), RobotMode.READY, "stop"]
    assert driver.calibrated == [tuple(Side)]


def test_gripper_says_what_it_holds(driver: FakeDriver) -> None:
    assert run("grip", "right", "close", "--force", "5") == "The right gripper is holding something 0.0 mm wide.\n"
    assert json.loads(run("grip", "left", "open", "--width", "0.03", "--json")) == {
        "arm": "left",
        "outcome": "open",
        "width": 0.03,
    }
    assert sentence(message("width_while_closing"), FrontEnd.SHELL) in refusal(
        "grip", "right", "close", "--width", "0.01", code=2
    )
    assert "not in the range" in refusal("grip", "right", "open", "--width", "0.2", code=2)


@pytest.mark.parametrize(
    ("words", "goal"),
    [
        (("ready",), named_pose(Side.RIGHT, "ready")),
        (("j1=0.2",), (0.2, *home(Side.RIGHT)[1:])),
        (("j1=20", "joint_2=-110", "--degrees"), (radians(20), radians(-110), *home(Side.RIGHT)[2:])),
        (("0.1", "-2", "-2", "0.5", "0", "0.7", "0"), (0.1, -2.0, -2.0, 0.5, 0.0, 0.7, 0.0)),
        (
            ("0", "-130", "30", "0", "40", "0", "-135", "--abb", "--degrees"),
            chain_from_abb([radians(each) for each in (0, -130, 30, 0, 40, 0)], radians(-135)),
        ),
    ],
)
def test_arm_is_moved_to_a_pose_joints_or_angles(
    driver: FakeDriver, words: tuple[str, ...], goal: tuple[float, ...]
) -> None:
    driver.arrive()
    assert run("move", "right", *words, "--speed-scale", "0.2") == "The right arm stands at the goal\n"
    (sent,) = goals(driver)
    assert sent.position == pytest.approx(goal)
    assert sent.speed_scale == 0.2


def test_both_arms_are_moved_to_a_pose(driver: FakeDriver) -> None:
    driver.arrive()
    run("move", "both", "home")
    assert [goal.position for goal in goals(driver)] == [home(Side.RIGHT), home(Side.LEFT)]
    assert sentence(message("both_arms_take_a_pose"), FrontEnd.SHELL) in refusal("move", "both", "j1=0", code=2)


def test_motion_that_is_interrupted_ends_with_a_sentence(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(commands.RunningDriver, "move_to", interrupted)
    assert in_shell("motion_interrupted") in refusal("move", "right", "home")


def in_shell(code: str, **values: Any) -> str:
    """What the shell says of a message."""
    return sentence(message(code, **values), FrontEnd.SHELL)


LOWER, UPPER = YUMI_LIMITS.lower[1], YUMI_LIMITS.upper[1]


@pytest.mark.parametrize(
    ("words", "said", "code"),
    [
        (("right", "nan", *["0"] * 6), in_shell("goal_position_not_finite", position=1, value="nan"), 1),
        (
            ("right", "j2=4"),
            in_shell("goal_joint_out_of_range", joint="yumi_joint_2_r", position=4.0, lower=LOWER, upper=UPPER),
            1,
        ),
        (
            ("right", "j8=1"),
            in_shell("goal_joint_unknown", joint="j8", arm="right", joints=joint_names(Side.RIGHT), count=7),
            1,
        ),
        (("right", "0", "1"), in_shell("angle_count", count=2, joints=7), 2),
        (("right", "hoem"), in_shell("no_angle", text="hoem", poses=("home", "calibration", "ready")), 2),
        (("right", "j1=1", "j1=2"), in_shell("some_joint_named_twice"), 2),
        (("right", "j1=1", "--abb"), in_shell("abb_order_of_names"), 2),
        (("right", "home", "--speed-scale", "2"), "not in the range", 2),
        (("right", "0.4", "-0.2", "--pose"), in_shell("no_pose_on_command_line"), 2),
        (("right", "home", "--pose"), in_shell("no_pose_on_command_line"), 2),
        (("right", "home", "--linear"), in_shell("line_options_need_pose"), 2),
        (("right", "0.4", "-0.2", "0.3", "--pose", "--speed", "9"), "not in the range", 2),
        (("right", "0.4", "-0.2", "0.3", "--pose", "--speed", "0.1"), in_shell("tool_speed_without_line"), 1),
    ],
)
def test_impossible_goal_is_refused_and_changes_nothing(
    driver: FakeDriver, words: tuple[str, ...], said: str, code: int
) -> None:
    assert said in refusal("move", *words, code=code)
    assert driver.robot.control.commands == []


def test_refusal_names_the_command_that_helps(driver: FakeDriver) -> None:
    control = driver.robot.control
    control.snapshots[Side.RIGHT] = control.snapshots[Side.RIGHT]._replace(is_running=False)
    said = refusal("move", "right", "home")
    assert "`yumi start`" in said
    assert "robot.recover()" not in said


def test_degrees_that_were_not_called_so_are_refused_with_the_option(driver: FakeDriver) -> None:
    said = refusal("move", "right", "20", "-110", "-135", "30", "0", "40", "0")
    lower, upper = YUMI_LIMITS.lower[0], YUMI_LIMITS.upper[0]
    in_degrees = message("goal_joint_in_degrees", joint="yumi_joint_1_r", position=20.0, lower=lower, upper=upper)
    assert said == f"Error: {sentence(in_degrees, FrontEnd.SHELL)}\n"
    assert in_degrees.actions == (Action.GIVE_RADIANS,)
    assert driver.robot.control.commands == []


def test_switch_deactivates_what_commands_the_arm(driver: FakeDriver) -> None:
    run("switch", "right", STREAM_CONTROLLER)
    (switch,) = driver.robot.control.switches
    assert (switch.activate, switch.deactivate) == ((STREAM_CONTROLLER,), (GOAL_CONTROLLER,))


def test_stop_is_not_confirmed_without_a_person(driver: FakeDriver) -> None:
    driver.manager.robot = replace(driver.manager.robot, stop="50204-1", causes=(COLLISION,))
    said = message("confirm_by_option", causes=(COLLISION,), stop="50204-1")
    assert sentence(said, FrontEnd.SHELL) in refusal("recover", code=2)
    assert driver.recovered == []
    assert run("recover", "--confirm", "50204-1") == "The robot is ready\n"


@pytest.mark.parametrize(("answer", "confirmed"), [("yes", ["50204-1"]), ("no", []), ("", [])])
def test_person_confirms_a_stop_at_the_terminal(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch, answer: str, confirmed: list[str]
) -> None:
    driver.manager.robot = replace(driver.manager.robot, stop="50204-1", causes=(COLLISION,))
    monkeypatch.setattr(commands, "_is_at_a_terminal", lambda: True)
    result = CliRunner().invoke(main, ["recover"], input=f"{answer}\n")
    assert sentence(COLLISION, FrontEnd.SHELL) in result.stderr
    assert "confirm the stop 50204-1" in result.stderr
    assert driver.recovered == confirmed
    assert result.exit_code == (0 if confirmed else 2)


@pytest.mark.parametrize("command", [["state"], ["start"], ["move", "right", "home"], ["shell"], ["controllers"]])
def test_without_a_driver_a_sentence_says_how_to_start_one(command: list[str]) -> None:
    assert clause(message("no_driver_runs")).capitalize() in refusal(*command)


def test_angles_are_radians_unless_they_are_called_degrees() -> None:
    assert commands.goal_of(["j1=180"], in_degrees=True, abb=False) == {"j1": pytest.approx(pi)}
    with refused(SettingsError, "no_angle", text="x"):
        commands.goal_of(["j1=x"], in_degrees=False, abb=False)


@pytest.mark.parametrize("name", ["bash", "zsh", "fish"])
def test_completion_is_printed_for_a_shell(name: str) -> None:
    assert "_YUMI_COMPLETE" in run("completion", name)


def completions(words: str, incomplete: str) -> list[str]:
    arguments = [*words.split(), incomplete]
    environment = {"_YUMI_COMPLETE": "bash_complete", "COMP_WORDS": " ".join(arguments)}
    environment["COMP_CWORD"] = str(len(arguments) - 1)
    result = CliRunner().invoke(main, prog_name="yumi", env=environment)
    return [line.partition(",")[2] for line in result.stdout.splitlines()]


def test_arms_retreat_slowly_unless_told_otherwise(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []

    def retreat(_: object, *, speed_scale: float, on_motion: object) -> str:
        asked.append(speed_scale)
        return "The right and the left arm stand at the goal"

    monkeypatch.setattr(commands.RunningDriver, "retreat", retreat)
    assert run("retreat") == "The right and the left arm stand at the goal\n"
    run("retreat", "--speed-scale", "0.05")
    assert asked == [0.1, 0.05]


def test_shell_completes_commands_poses_and_controllers(driver: FakeDriver) -> None:
    assert completions("yumi", "co") == ["compare", "completion", "controller", "controllers"]
    assert completions("yumi move right", "r") == ["ready"]
    assert completions("yumi switch right", "joint_g") == [GOAL_CONTROLLER]


def test_prompt_is_connected_to_the_driver(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[str, object] = {}
    monkeypatch.setattr(shell.code, "interact", lambda banner, local, exitmsg: seen.update(local, banner=banner))
    monkeypatch.setattr(shell, "_HISTORY", Path("/nowhere/history"))
    run("shell")
    assert repr(seen["driver"]) == f"<yumi.RunningDriver {ROBOT}>"
    assert "driver.move_to" in str(seen["banner"])
    assert "need --robot" in refusal("shell", "--user", "x", code=2)
