"""`yumi teleop` with input devices that are none, against a driver whose robot notes what it is asked."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import fake_evdev
from abb_protocols.catalogue import all_texts, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.robot.gripper_values import GripDirection, grip
from abb_protocols.robot.joints import Joints, Side, home
from fake_driver import FakeDriver
from fake_evdev import Event, FakeInputDevice, axis, button
from yumi.api import input_device
from yumi.cli.main import main
from yumi.control.tool_goal import ToolGoal
from yumi.driver.teleoperation import Teleoperation

PRESSED = [button("BTN_TR", 1)]
RELEASED = [button("BTN_TR", 0)]
UNTIL_ENGAGED: Sequence[Event] = ()
"""Stands for frames without events while the driver takes the arm over: its first goal is that it is engaged."""


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[FakeDriver]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(Teleoperation, "lasts", lambda teleoperation: 60.0)  # by the clock of this machine
    driver = FakeDriver()
    driver.robot.control.on_command = driver.robot.rest
    driver.server.start()
    yield driver
    driver.server.stop()


class Script:
    """What a device does from frame to frame; then it is unplugged. The robot's time goes by meanwhile."""

    def __init__(self, driver: FakeDriver, device: FakeInputDevice, *frames: Sequence[Event]) -> None:
        self._driver, self._frames, self._device = driver, list(frames), device
        self._is_read = False
        device.read = self.read  # type: ignore[method-assign]

    def read(self) -> Sequence[Event]:
        self._is_read = not self._is_read
        if not self._is_read:
            raise BlockingIOError
        self._driver.robot.clock.advance(1.0 / 60.0)
        if not self._frames:
            raise OSError(19, "No such device")
        goals = self._driver.robot.tool_goals.values()
        if self._frames[0] is UNTIL_ENGAGED and all(each.read() is None for each in goals):
            return []
        return self._frames.pop(0)


def connect(monkeypatch: pytest.MonkeyPatch, *devices: FakeInputDevice) -> None:
    monkeypatch.setattr(input_device, "_evdev", lambda: fake_evdev.library(*devices))


def run(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["teleop", *arguments], catch_exceptions=False)


def said(code: str, **values: Any) -> str:
    return f"Error: {sentence(message(code, **values), FrontEnd.SHELL)}"


def goal(driver: FakeDriver, side: Side = Side.RIGHT) -> ToolGoal:
    written = driver.robot.tool_goals[side].read()
    assert written is not None
    newest: ToolGoal = written[1]
    return newest


def test_stick_of_a_gamepad_moves_an_arm_and_its_button_the_gripper(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    pad = fake_evdev.gamepad()
    connect(monkeypatch, pad)
    moved = [axis("Y", -32768)], [button("BTN_SOUTH", 1)], []
    Script(driver, pad, [], PRESSED, UNTIL_ENGAGED, *moved)
    result = run("--tool-speed", "0.05")
    assert goal(driver).twist[:3] == pytest.approx((0.05, 0.0, 0.0))
    assert goal(driver).speed == 0.05
    assert driver.robot.tool_goals[Side.LEFT].read() is None
    assert [gripper.goals for gripper in driver.grippers.values()] == [[grip(GripDirection.INWARDS, 10.0)], []]
    assert result.stdout.splitlines() == ["right engaging", "right engaged"]
    assert result.stderr.splitlines()[0] == "Gamepad Xbox Pad"
    gone = message("input_device_gone", name="Xbox Pad", why=message("text", text="[Errno 19] No such device"))
    assert result.stderr.splitlines()[-1] == said("input_device_gone", **gone.values)
    assert pad.is_closed


def test_changes_are_written_as_json(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    mouse = fake_evdev.space_mouse()
    connect(monkeypatch, mouse)
    held = [button("BTN_0", 1)]
    Script(driver, mouse, [], held, UNTIL_ENGAGED, [button("BTN_0", 0)], [])
    lines = [json.loads(line) for line in run("spacemouse", "--arm", "left", "--json").stdout.splitlines()]
    assert [each["left"]["clutch"] for each in lines] == ["released", "engaging", "engaged", "released"]
    assert {each["right"]["clutch"] for each in lines} == {"released"}


def test_clutch_that_is_held_when_it_begins_moves_nothing(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    pad = fake_evdev.gamepad()
    pad.held.add("BTN_TR")
    connect(monkeypatch, pad)
    Script(driver, pad, *[[]] * 10, [axis("Y", -32768)], [])
    output = run("gamepad").stdout
    assert output.startswith("right inert; ")
    assert driver.robot.tool_goals[Side.RIGHT].read() is None


LEADER = """
from the_robot import clock, goals
from yumi.api.teleoperation_devices import LeaderReading
from abb_protocols.robot.joints import Side, home

class Pressed:
    '''Its clutch is pressed from the third reading on; once the arm follows, it leads by a tenth of a radian.'''

    def __init__(self):
        self.count = 0

    def read(self):
        if self.count < 3 or goals[Side.RIGHT].read() is not None:
            self.count += 1
        clock.advance(1.0 / 60.0)
        if self.count > 50:
            raise RuntimeError("the cable is broken")
        far = 0.1 if self.count > 10 else 0.0
        return LeaderReading([value + 0.3 + far for value in home(Side.RIGHT)], self.count > 2)

def unplugged():
    raise OSError("no such port")
"""


@pytest.fixture
def program(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setitem(sys.modules, "the_robot", driver.robot)
    file = tmp_path / "my_leader.py"
    file.write_text(LEADER)
    return file


def test_leader_arm_is_followed_joint_by_joint(driver: FakeDriver, program: Path) -> None:
    result = run("leader", "--leader", f"{program}:Pressed", "--arm", "right")
    why = message("text", text="the cable is broken")
    assert result.stderr.splitlines() == [said("leader_failed", kind="RuntimeError", why=why)]
    assert result.stdout.splitlines() == ["right engaging", "right engaged"]
    written = driver.robot.goals[Side.RIGHT].read()
    assert written is not None
    position: Joints = written[1].position
    assert position == pytest.approx([value + 0.1 for value in home(Side.RIGHT)], abs=0.02)


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ([], "leader_options_missing"),
        (["--leader", "FILE:Pressed"], "leader_options_missing"),
        (["--leader", "FILE:Pressed", "--arm", "both"], "leader_options_missing"),
        (["--leader", "FILE:unplugged", "--arm", "left"], "leader_not_made"),
        (["--leader", "FILE:missing", "--arm", "left"], "leader_not_made"),
        (["--leader", "nowhere.py:Arm", "--arm", "left"], "leader_not_made"),
        (["--leader", "FILE:Pressed", "--arm", "left", "--signs", "1,1"], "leader_signs_malformed"),
    ],
)
@pytest.mark.usefixtures("driver")
def test_leader_that_cannot_be_made_is_refused(program: Path, options: list[str], code: str) -> None:
    result = run("leader", *(each.replace("FILE", str(program)) for each in options))
    assert result.exit_code == 2
    assert max(re.split(r"\{[^}]*\}", all_texts()[code].what), key=len).strip() in result.stderr.lower()


# ---- what is missing


def test_devices_are_listed_without_a_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    connect(monkeypatch, fake_evdev.mouse(), fake_evdev.gamepad(), fake_evdev.space_mouse())
    assert run("--list").stdout.splitlines() == [
        "/dev/input/event5  gamepad    Xbox Pad",
        "/dev/input/event7  spacemouse 3Dconnexion SpaceMouse Compact",
    ]
    assert [each["kind"] for each in json.loads(run("--list", "--json").stdout)] == ["gamepad", "spacemouse"]
    connect(monkeypatch)
    assert run("--list").stdout.strip() == sentence(
        message("no_input_device", kind="gamepad or spacemouse"), FrontEnd.SHELL
    )


def test_driver_that_does_not_run_is_the_first_thing_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    connect(monkeypatch)
    assert run().stderr.strip() == said("no_driver_runs")


@pytest.mark.usefixtures("driver")
def test_machine_without_a_device_is_told_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    connect(monkeypatch)
    monkeypatch.setattr(input_device, "glob", lambda pattern: [])
    result = run("spacemouse")
    assert (result.exit_code, result.stderr.strip()) == (1, said("no_input_device", kind="spacemouse"))


@pytest.mark.usefixtures("driver")
def test_extra_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "evdev", None)
    result = run("gamepad")
    assert (result.exit_code, result.stderr.strip()) == (
        1,
        said("extra_missing", what=message("devices_need_evdev"), package="yumi-ros2", extra="teleop"),
    )
