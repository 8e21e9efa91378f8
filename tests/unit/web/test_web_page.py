"""The page in a browser, with a driver that notes what it is asked: what a person drags and presses on the picture."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import degrees, radians
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.robot.gripper_values import GripperState, ServoState
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Side, home, joints
from abb_protocols.rws.values import ControllerState
from browser import browser
from fake_driver import FakeDriver
from yumi.control.controllers.joint_goal import JointGoal
from yumi.web import live, page_operator, view_server
from yumi.web.view_server import ViewServer, ViewSettings


@pytest.fixture(scope="module")
def program() -> Iterator[Any]:
    """Chromium, which all tests share."""
    with browser() as chromium:
        yield chromium


@pytest.fixture
def chromium(program: Any) -> Iterator[Any]:
    """The browser, in which no page is open; each page has its own storage."""
    yield program
    for context in program.contexts:
        context.close()


@pytest.fixture(autouse=True)
def slow_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    """A browser that draws in software may be slow: the page jogs and keeps control nevertheless."""
    monkeypatch.setattr(page_operator, "OLDEST_SEEN_STATE", 60.0)
    monkeypatch.setattr(view_server, "_ANSWER", 60.0)


@contextmanager
def served() -> Iterator[str]:
    """The page's address, served on a thread of its own."""
    loop = asyncio.new_event_loop()
    thread = Thread(target=loop.run_forever)
    thread.start()

    async def made() -> ViewServer:
        view = ViewServer(ViewSettings(port=0, may_operate=True, token="secret"))
        await view.start()
        return view

    view = asyncio.run_coroutine_threadsafe(made(), loop).result(10.0)
    try:
        yield view.url
    finally:
        asyncio.run_coroutine_threadsafe(view.stop(), loop).result(10.0)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


@contextmanager
def running() -> Iterator[FakeDriver]:
    driver = FakeDriver()
    driver.robot.control.on_command = driver.robot.rest
    driver.server.start()
    try:
        yield driver
    finally:
        driver.server.stop()


def operated(chromium: Any, url: str, errors: list[str], script: str = "") -> Any:
    """A page that has control, in which a script ran first; what it logs as an error is appended."""
    page = chromium.new_page(viewport={"width": 1000, "height": 450})
    page.add_init_script(script)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(url)
    page.wait_for_function("() => document.querySelector('#verdict').innerText.includes('Ready')", polling=50)
    page.click("#take")
    page.wait_for_function("() => document.querySelector('#take').innerText.includes('back')", polling=50)
    return page


@pytest.mark.timeout(120)
def test_token_of_the_address_lets_every_tab_of_a_browser_in_and_stands_in_no_cookie(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    ready = "() => document.querySelector('#verdict').innerText.includes('Ready')"
    with running(), served() as url:
        base = url.partition("#")[0]
        small = {"width": 400, "height": 200}  # since three pages are drawn in software
        context, other = chromium.new_context(viewport=small), chromium.new_context(viewport=small)
        first, second, foreign = context.new_page(), context.new_page(), other.new_page()
        first.goto(url)
        first.wait_for_function(ready, polling=50)
        assert (first.url, context.cookies()) == (base, [])
        second.goto(base)
        second.wait_for_function(ready, polling=50)
        foreign.goto(f"{base}#token=wrong")
        foreign.wait_for_function("() => document.body.innerText.includes('address with the token')", polling=50)
        foreign.goto(url)  # in the same tab, where only what follows the # is another
        foreign.wait_for_function(ready, polling=50)


@pytest.mark.timeout(120)
def test_every_control_is_reached_by_tab_with_a_visible_focus(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    errors: list[str] = []
    with running(), served() as url:
        page = operated(chromium, url, errors)
        counts = []
        for tab in ("joints", "tool", "poses"):
            page.click(f"#tab-{tab}")
            shown = page.evaluate(
                """() => [...document.querySelectorAll("button, select, input, [tabindex]")]
                    .filter((each) => each.offsetParent && !each.disabled)
                    .map((each, index) => (each.dataset.stop = index))"""
            )
            counts.append(len(shown))
            page.evaluate("document.activeElement.blur(); document.body.focus()")
            reached, hidden = set(), set()
            for _ in range(2 * len(shown)):
                page.keyboard.press("Tab")
                stop, outline = page.evaluate(
                    """() => [document.activeElement.dataset.stop ?? "",
                        getComputedStyle(document.activeElement).outlineStyle]"""
                )
                reached.add(stop)
                if stop and outline == "none":
                    hidden.add(stop)
            assert {str(each) for each in shown} - reached == set()
            assert hidden == set()
        assert min(counts) > 25
        # Between the arms by the arrow keys, as between tabs elsewhere.
        page.focus("#tab-right")
        page.keyboard.press("ArrowRight")
        assert page.get_attribute("#tab-left", "aria-selected") == "true"
        assert page.evaluate("document.activeElement.id") == "tab-left"
        page.focus("#tab-poses")
        page.keyboard.press("ArrowLeft")
        assert page.evaluate("document.activeElement.id") == "tab-tool"
        assert page.is_visible("#pad")
    assert errors == []


@pytest.mark.timeout(120)
@pytest.mark.parametrize("is_here", [True, False])
def test_page_on_another_machine_has_no_faults_of_a_virtual_robot_and_says_so(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_here: bool
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(view_server, "is_of_this_machine", lambda request: is_here)
    monkeypatch.setattr(live, "_is_virtual", lambda address: True)
    errors: list[str] = []
    with running(), served() as url:
        page = operated(chromium, url, errors)
        for selector in ("#press-stop", "#tab-virtual"):
            assert page.is_visible(selector) is is_here
        elsewhere = "" if is_here else sentence(message("faults_only_here"), FrontEnd.VIRTUAL_PAGE)
        assert page.text_content("#no-faults") == elsewhere
        assert page.is_visible("#no-faults") is not is_here
        page.set_viewport_size({"width": 320, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") == 320
    assert errors == []


@pytest.mark.timeout(120)
def test_part_that_is_held_is_drawn_and_buttons_that_cannot_work_say_why(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    errors: list[str] = []
    with running() as driver, served() as url:
        page = operated(chromium, url, errors)

        def becomes(condition: str) -> None:
            page.wait_for_function(f"() => {condition}", polling=50)

        becomes("document.querySelector('#scene').dataset.held === 'right left'")
        driver.fingers = GripperState(ServoState.ACTION_COMPLETED, 0, True, 0.02, 0.0, 10.0)
        becomes("document.querySelector('#scene').dataset.held === ''")
        assert "Fingertips" in page.inner_text("#tool-pose")
        assert "(tool0: " in page.inner_text("#tool-pose")

        # The robot ran EGM, and no controller commands the left arm any more.
        egm = dict.fromkeys(Side, "running")
        driver.manager.robot = replace(driver.manager.robot, egm=egm)
        becomes("document.querySelector('#banner').dataset.level === 'good'")
        assert page.get_attribute("#start:disabled", "title") == "EGM runs on both arms."
        driver.robot.control.release(Side.LEFT)
        becomes("document.querySelector('#banner').dataset.level === 'warn'")
        assert "no controller commands the left arm" in page.inner_text("#verdict")
        assert page.is_enabled("#start")

        # An arm that does not follow ends a jog, and lets none begin.
        snapshots = driver.robot.control.snapshots
        snapshots[Side.RIGHT] = snapshots[Side.RIGHT]._replace(is_running=False, is_streaming=False)
        becomes("document.querySelector('[data-jog=\"joint 0 1\"]').disabled")
        assert "The right arm follows no commands" in page.get_attribute('[data-jog="joint 0 1"]', "title")
        page.click("#tab-left")
        becomes("!document.querySelector('[data-jog=\"joint 0 1\"]').disabled")

        # A stop is confirmed; nothing is while the button is still pressed.
        driver.manager.robot = replace(
            driver.manager.robot,
            controller_state=ControllerState.EMERGENCY_STOP,
            reasons=(message("emergency_stop_pressed"), message("stop_open", stop="10013-1-abc")),
            stop="10013-1-abc",
        )
        pressed = sentence(message("emergency_stop_pressed"), FrontEnd.PAGE)
        becomes(f"document.querySelector('#recover').title.startsWith({json.dumps(pressed)})")
        assert page.is_disabled("#recover")
        assert page.is_hidden("#remedy-button")  # of a real robot: a person releases it
    assert errors == []


FRAMES = """
window.frames_sent = [];
window.backlog = 0;
const { send } = WebSocket.prototype;
WebSocket.prototype.send = function (data) {
  const { type, frame } = JSON.parse(data);
  if (type === "teleoperate") frames_sent.push(frame);
  send.call(this, data);
};
Object.defineProperty(WebSocket.prototype, "bufferedAmount", { get: () => backlog });
"""
"""Notes the frames of the page's device; ``backlog`` is what seems to wait in its connection."""


class Frames:
    """The frames that a page sends of its keyboard."""

    def __init__(self, page: Any) -> None:
        self._page = page
        page.click("#tab-teleop")
        page.focus("#keys")
        self.next("!right.clutch")  # a clutch counts that is pressed from now on

    def next(self, is_meant: str) -> dict[str, Any]:
        """The next frame of which an expression in JavaScript is true; five others may come before."""
        self._page.evaluate("frames_sent.length = 0")
        self._page.wait_for_function(
            f"() => frames_sent.length > 5 || frames_sent.some(({{ right }}) => {is_meant})", polling=20
        )
        found = self._page.evaluate(f"frames_sent.find(({{ right }}) => {is_meant}) ?? null")
        assert found, self._page.evaluate("frames_sent")
        right: dict[str, Any] = found["right"]
        return right


@pytest.mark.timeout(120)
def test_command_key_of_a_mac_lets_every_key_go(chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    errors: list[str] = []
    with running(), served() as url:
        page = operated(chromium, url, errors, FRAMES)
        frames, keys = Frames(page), page.keyboard
        for key in (" ", "r"):
            keys.down(key)
        assert frames.next("right.clutch && right.twist[2] > 0")["twist"][2] == pytest.approx(0.15)
        keys.down("Meta")
        frames.next("!right.clutch")
        page.evaluate("frames_sent.length = 0")
        keys.up("Meta")  # R and Space were let go meanwhile, of which a Mac reports nothing
        page.wait_for_function("() => frames_sent.length > 5", polling=20)
        assert not page.evaluate("frames_sent.some(({ right }) => right.clutch)")
        keys.up(" ")
        keys.down(" ")
        assert frames.next("right.clutch")["twist"] == [0.0] * 6
    assert errors == []


@pytest.mark.timeout(120)
def test_frames_wait_for_no_connection_that_is_behind_and_the_clutch_must_be_pressed_again(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    errors: list[str] = []
    with running(), served() as url:
        page = operated(chromium, url, errors, FRAMES)
        frames, keys = Frames(page), page.keyboard
        keys.down(" ")
        frames.next("right.clutch")
        page.evaluate("() => { backlog = 5000; frames_sent.length = 0; }")
        page.wait_for_timeout(300)  # eighteen frames' time
        assert page.evaluate("frames_sent.length") == 0
        page.evaluate("backlog = 0")  # a release may have been among them
        page.wait_for_function("() => frames_sent.length > 5", polling=20)
        assert not page.evaluate("frames_sent.some(({ right }) => right.clutch)")
        keys.up(" ")
        frames.next("!right.clutch")
        keys.down(" ")
        frames.next("right.clutch")
    assert errors == []


IN_VIEW = """ids => ids.filter(id => {
    const box = document.querySelector(id).getBoundingClientRect();
    return box.height > 0 && box.top >= 0 && box.bottom <= innerHeight;
})"""
"""Those of some elements that are seen whole, without scrolling."""


@pytest.mark.timeout(120)
def test_what_is_used_together_is_seen_together_and_the_picture_stays_on_a_telephone(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    errors: list[str] = []
    with running(), served() as url:
        page = operated(chromium, url, errors)
        page.set_viewport_size({"width": 1440, "height": 757})
        always = ["#scene", "#stop", "#start", "#recover", "#tool-pose", "#open", "#close"]
        for tab, own in {
            "joints": ['[data-jog="joint 0 1"]', '[data-jog="joint 6 -1"]'],
            "tool": ['[data-jog="linear x 1"]', '[data-jog="elbow 1"]'],
            "poses": ["#pose", "#plan", "#move", "#activate"],
        }.items():
            page.click(f"#tab-{tab}")
            assert page.evaluate(IN_VIEW, [*always, *own]) == [*always, *own], tab

        page.set_viewport_size({"width": 390, "height": 844})
        for tab, jog in (("joints", "joint 6 1"), ("tool", "elbow 1")):
            page.evaluate("scrollTo(0, 0)")
            page.click(f"#tab-{tab}")
            page.locator(f'[data-jog="{jog}"]').scroll_into_view_if_needed()
            needed = ["#scene", "#stop", f'[data-jog="{jog}"]']
            assert page.evaluate(IN_VIEW, needed) == needed, tab
        assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert errors == []


@pytest.mark.timeout(120)
def test_goal_is_that_of_the_arm_that_is_chosen_and_an_empty_field_moves_nothing(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    errors: list[str] = []
    with running() as driver, served() as url:
        at_left = joints([radians(angle) for angle in (5.0, -110.0, -30.0, 25.0, 10.0, 40.0, -15.0)])
        snapshots = driver.robot.control.snapshots
        snapshots[Side.LEFT] = snapshots[Side.LEFT]._replace(position=at_left)
        page = operated(chromium, url, errors)
        page.wait_for_function("() => document.querySelector('#tool-pose').innerText.includes('mm')", polling=50)
        page.click("#tab-poses")
        page.select_option("#pose", "joint positions")
        page.click("#preview")

        def angles() -> Any:
            return page.evaluate("() => [...document.querySelectorAll('#joint-goal input')].map(each => each.value)")

        def says(button: str, words: str) -> None:
            page.evaluate("() => (document.querySelector('#toast').textContent = '')")
            page.click(button)
            page.wait_for_function(
                "words => document.querySelector('#toast').innerText.includes(words)", arg=words, polling=50
            )

        assert angles() == [f"{degrees(angle):.1f}" for angle in home(Side.RIGHT)]
        page.click("#tab-left")
        assert angles() == [f"{degrees(angle):.1f}" for angle in at_left]
        assert page.get_attribute("#preview", "aria-pressed") == "false"
        axis = page.locator("#joint-goal input").nth(2)
        axis.fill("")
        page.click("#preview")  # shows nothing, and breaks nothing
        for text, button in (("", "#move"), ("", "#plan"), ("999", "#move")):
            axis.fill(text)
            says(button, "axis 7 takes a number from -168.5° to 168.5°")
        page.fill("#open-width", "")
        says("#open", "a number from 1 to 50 mm")
        page.fill("#grip-force", "0")
        says("#close", "a number from 1 to 20 N")

        # What is complete is sent, and nothing was before.
        page.fill("#open-width", "20.5")
        says("#open", "The gripper is open")
        axis.fill("-25.5")
        page.click("#move")
        while not driver.robot.control.commands:  # at worst until the time of this test is over
            page.wait_for_timeout(20)
        (opened,) = driver.grippers[Side.LEFT].goals
        assert opened.position == pytest.approx(0.01025)
        assert not driver.grippers[Side.RIGHT].goals
        goals = [command for command in driver.robot.control.commands if isinstance(command.message, JointGoal)]
        assert [command.side for command in goals] == [Side.LEFT]
        expected = [*at_left[:2], radians(-25.5), *at_left[3:]]
        assert goals[0].message.position == pytest.approx(expected, abs=1e-6)
    assert errors == []


@pytest.mark.timeout(120)
def test_tool_follows_the_handle_and_the_keys_on_the_picture(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    errors: list[str] = []
    with running() as driver, served() as url:
        page = operated(chromium, url, errors)

        def twist(condition: Callable[[Joints], bool]) -> None:
            for _ in range(400):
                newest = driver.robot.tool_goals[Side.RIGHT].read()
                if newest is not None and condition(newest[1].twist):
                    return
                page.wait_for_timeout(20)
            raise AssertionError(f"the tool was asked for {newest}")

        page.click("#tab-tool")
        page.select_option("#handle", "jog translate")
        page.wait_for_function(
            "() => (document.querySelector('#scene').dataset.handle ?? '').includes(',')", polling=50
        )
        canvas = page.locator("#scene").bounding_box()
        x, y = map(float, page.locator("#scene").get_attribute("data-handle").split(","))
        page.mouse.move(canvas["x"] + x, canvas["y"] + y)
        page.mouse.down()
        page.mouse.move(canvas["x"] + x, canvas["y"] + y - 40, steps=5)
        twist(lambda it: it[2] > 0.02 and it[3:] == ZERO_JOINTS[3:])
        page.mouse.up()
        twist(lambda it: it == ZERO_JOINTS)

        page.select_option("#handle", "none")
        page.focus("#scene")
        page.keyboard.down("ArrowLeft")
        twist(lambda it: it[1] > 0.02 and it[:1] == ZERO_JOINTS[:1] and it[2:] == ZERO_JOINTS[2:])
        page.keyboard.up("ArrowLeft")
        twist(lambda it: it == ZERO_JOINTS)
        # A key that is let go while Command is held is not reported, and one of the number pad by another name.
        page.keyboard.down("ArrowLeft")
        twist(lambda it: it[1] > 0.02)
        page.keyboard.down("Meta")
        twist(lambda it: it == ZERO_JOINTS)
        page.keyboard.up("Meta")
        page.keyboard.up("ArrowLeft")
        for kind, key in (("keydown", "Home"), ("keyup", "7")):
            page.dispatch_event("#scene", kind, {"key": key, "code": "Numpad7"})
            twist(lambda it, kind=kind: (it[6] < 0.0) is (kind == "keydown"))
        page.focus('[data-jog="linear z 1"]')
        page.keyboard.down(" ")
        twist(lambda it: it[2] > 0.02)
        page.keyboard.down("Meta")
        twist(lambda it: it == ZERO_JOINTS)
        page.keyboard.up("Meta")
        page.keyboard.up(" ")
        page.select_option("#jog-frame", "box table")
        page.focus("#scene")
        page.keyboard.down("Shift")
        page.keyboard.down("PageUp")
        twist(lambda it: it[5] > 0.1)
        page.locator("#scene").blur()
        twist(lambda it: it == ZERO_JOINTS)
    assert errors == []
