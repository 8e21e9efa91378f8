"""The page of a controller in a browser, of ``virtual-irc5 view``, and of ``yumi view`` where no driver can run."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import LoginRefused, NoConnection, RobotNotReady
from abb_runtime.process.command_process import CommandProcess
from browser import browser
from system.test_doctor import served, world
from virtual_irc5.controller.installed_system import ROBOTS, factory_system
from yumi.driver.settings import RobotSettings
from yumi.web.view_only import open_controller, reopen_controller

SOON = 60_000  # [ms]
PROGRAM = """MODULE Cell
    CONST jointtarget low:=[[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST jointtarget high:=[[60,-20,-20,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PROC main()
        TPWrite "round";
        MoveAbsJ high, v50, fine, tool0;
        MoveAbsJ low, v50, fine, tool0;
    ENDPROC
ENDMODULE
"""


def settings(port: int, password: str = "robotics") -> RobotSettings:
    return RobotSettings(address="127.0.0.1", rws_port=port, password=password)


def test_controller_is_left_to_a_driver_where_one_can_run() -> None:
    with served(world().controller) as what:
        assert open_controller(settings(what.port)) is None
        assert {request.method for request in what.requests} == {"GET"}


def test_yumi_without_the_state_machine_is_read_and_says_why() -> None:
    with served(world(system=factory_system()).controller) as what:
        reader = open_controller(settings(what.port))
        assert reader is not None
        again = reopen_controller(settings(what.port))
        for each in (reader, again):
            missing = message("state_machine_missing", task="T_ROB_R", module="TRobMain")
            assert each.message().missing == (str(missing),)
            each.close()


def test_controller_that_a_driver_can_run_for_by_now_is_named() -> None:
    with served(world().controller) as what, pytest.raises(RobotNotReady) as refusal:
        reopen_controller(settings(what.port))
    assert refusal.value.said == message("driver_can_run_now", address=f"127.0.0.1:{what.port}")


def test_controller_that_does_not_let_us_in_or_is_not_there_is_an_error() -> None:
    with served(world(system=factory_system(ROBOTS["irb120"])).controller) as what:
        with pytest.raises(LoginRefused):
            open_controller(settings(what.port, password="wrong"))
        port = what.port
    with pytest.raises(NoConnection):
        open_controller(settings(port))


@pytest.fixture
def address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Of an IRB 120 whose program runs."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    file = tmp_path / "cell.mod"
    file.write_text(PROGRAM, encoding="ascii")
    arguments = ("controller", "--model", "irb120", "--rws-port", "0", "--program", f"T_ROB1={file}", "--start")
    with CommandProcess("controller", "yumi", arguments, tmp_path / "controller.log") as controller:
        yield controller.wait_until_ready(60.0).rpartition("/")[2]


@pytest.mark.real_time
@pytest.mark.alone
@pytest.mark.timeout(180)
def test_page_of_six_axes_shows_the_moving_arm_with_the_arrow_at_the_line(address: str, tmp_path: Path) -> None:
    errors: list[str] = []
    arguments = ("view", "--robot", address, "--port", "0")
    with browser() as chromium, CommandProcess("view", "yumi", arguments, tmp_path / "view.log") as view:
        lines: list[str] = []
        url = view.wait_until_ready(60.0, on_line=lines.append)
        robot = "an IRB 120 (mechanical unit ROB_1), not a YuMi"
        assert sentence(message("no_driver_for_robot", robot=robot), FrontEnd.SHELL) in lines[1]
        page = chromium.new_page(viewport={"width": 1000, "height": 700})
        page.set_default_timeout(SOON)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda line: errors.append(line.text) if line.type == "error" else None)
        page.goto(url)
        page.wait_for_function("() => document.querySelector('#verdict').innerText === 'View only: RAPID runs'")
        assert "not a YuMi" in page.inner_text("#remedy")

        # The arrow is at one of the moves, and comes to the other one.
        for number, move in ((6, "MoveAbsJ high, v50, fine, tool0;"), (7, "MoveAbsJ low, v50, fine, tool0;")):
            shown = page.wait_for_function(
                """line => {
                  const at = document.querySelector('.code .at')?.innerText;
                  return at?.includes(line) && [at, document.querySelector('.task-head').innerText];
                }""",
                arg=move,
                polling=50,
            ).json_value()
            assert re.fullmatch(rf"➜\s*{number}\s+{move}", shown[0].strip())
            assert shown[1].split() == ["T_ROB1", "running", "Cell/main,", "line", str(number)]
        page.wait_for_function("() => document.querySelector('#rapid-log').innerText.includes('[T_ROB1] round')")

        # The joints move, in the numbers and in the picture.
        def place() -> Any:
            return page.inner_text("#joints tr:first-child .number"), page.inner_text("#tool-pose")

        before = place()
        page.wait_for_function("was => document.querySelector('#tool-pose').innerText !== was", arg=before[1])
        assert page.locator("#joints tr").count() == 6
        assert re.fullmatch(r"tool0 x\s-?\d+\.\d, y\s-?\d+\.\d, z\s-?\d+\.\d mm", place()[1])

        # Nothing of a YuMi or of a driver is on the page.
        for hidden in ("#take", "#stop", "#tab-ROB_1", ".gripper", "#health-panel", "#events-panel", "#robot-panel"):
            assert not page.is_visible(hidden), hidden
        page.set_viewport_size({"width": 390, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        assert errors == []


@pytest.mark.real_time
@pytest.mark.alone
@pytest.mark.timeout(180)
def test_page_of_virtual_irc5_stops_the_controller_and_turns_its_key(address: str, tmp_path: Path) -> None:
    errors: list[str] = []
    arguments = ("view", "--robot", address, "--port", "0")
    with browser() as chromium, CommandProcess("view", "virtual_irc5", arguments, tmp_path / "view.log") as view:
        page = chromium.new_page(viewport={"width": 1000, "height": 700})
        page.set_default_timeout(SOON)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda line: errors.append(line.text) if line.type == "error" else None)
        page.goto(view.wait_until_ready(60.0))
        page.wait_for_function("() => document.querySelector('#verdict').innerText === 'RAPID runs'")

        def shows(element: str, words: str) -> None:
            page.wait_for_function(
                "([element, words]) => document.querySelector(element).innerText.includes(words)", arg=[element, words]
            )

        page.click("#press-stop")
        shows("#verdict", "RAPID is stopped")
        shows("#chips", "emergency stop")
        shows("#rapid-log", "Emergency stop")
        page.click("#release-stop")
        shows("#toast", "the emergency stop is released")
        page.click("#key")
        shows("#chips", "MANR")
        page.select_option("#fault", "collision")  # of the one arm that there is, without a side
        page.click("#inject")
        shows("#toast", "motors are off")
        page.set_viewport_size({"width": 390, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        assert errors == []
