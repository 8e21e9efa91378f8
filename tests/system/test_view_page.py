"""The page of ``yumi view`` in a browser: a virtual robot is watched and operated through the page alone."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

import yumi
from abb_protocols.catalogue import Message, clause, message
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import StopNotConfirmed
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import Joints, Pose, Side, home, joints
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION
from abb_runtime.faults import inject_fault
from abb_runtime.process.command_process import CommandProcess
from browser import browser
from flight import LOST, flown, write_flight_record
from yumi.core.collision import CollisionModel, Obstacle
from yumi.recording.message_types import recorded_event

pytestmark = [pytest.mark.real_time, pytest.mark.alone, pytest.mark.timeout(180)]
SOON = 20_000  # [ms]
JOGGED_ON = 0.6
"""A jog that goes on ends at the joint's limit, two radians away; on a busy machine a stop may be late [rad]."""
TOO_SLOW = "too slow now|asked for .* ago|arm follows no commands"
"""What the page tells of a jog that it ended since the machine was busy for a moment."""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as chromium:
        yield chromium


BOX = Obstacle("post", Pose((0.40, -0.12, 0.06), IDENTITY_QUATERNION), (0.08, 0.08, 0.20))
BESIDE = ((81, -119, -33, 35, -142, 103, -176), (119, -121, -67, 37, -179, 119, -139))  # of it, on either side [°]


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The page of a virtual robot with a box, whose limiter keeps the arms apart from all."""
    folder = tmp_path_factory.mktemp("view")
    config = folder / "yumi.yaml"
    box = f"{{position: {list(BOX.centre.position)}, size: {list(BOX.size)}}}"
    config.write_text(f"collision:\n  enabled: true\n  boxes:\n    {BOX.name}: {box}\n")
    arguments = ("view", "--virtual", "--port", "0", "--logs", str(folder), "--config", str(config))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(folder))
        with CommandProcess("yumi view", "yumi", arguments, folder / "view.log") as command:
            yield command.wait_until_ready(60.0)


@pytest.fixture
def held(served: str, chromium: Any) -> str:
    """No page is open, and EGM holds both arms at home, whatever the test before has left."""
    for context in chromium.contexts:
        context.close()
    with yumi.attach() as driver:
        try:
            driver.recover()
        except StopNotConfirmed as stop:
            driver.recover(confirm=stop.stop)
        driver.speed_scale = 1.0
        driver.start_egm()
        driver.give_back()  # what a person at the page has moved before
        driver.move_to(right="home", left="home", speed_scale=1.0)
    return served


@pytest.fixture
def url(held: str) -> str:
    """The same, but EGM is off."""
    with yumi.attach() as driver:
        driver.stop_egm()
    return held


def words(said: Message) -> str:
    """A pattern of what a message says happened, at the begin of a sentence or in it."""
    return f"(?i:{re.escape(clause(said, FrontEnd.PAGE))})"


class Page:
    """What a person does on the page, and reads there."""

    def __init__(self, chromium: Any, url: str) -> None:
        self.errors: list[str] = []
        self.tab = chromium.new_page(viewport={"width": 1280, "height": 900})
        self.tab.on("pageerror", lambda error: self.errors.append(str(error)))
        self.tab.on("console", lambda line: self.errors.append(line.text) if line.type == "error" else None)
        self.tab.goto(url)

    def text(self, selector: str) -> str:
        return str(self.tab.inner_text(selector))

    def wait(self, selector: str, pattern: str) -> str:
        """Until the text of an element has the pattern; the text."""
        for _ in range(SOON // 50):
            text = self.text(selector)
            if re.search(pattern, text):
                return text
            self.tab.wait_for_timeout(50)
        raise AssertionError(f"{selector} says {text!r}, not {pattern!r}")

    def jog(self, begin: Callable[[], None], end: Callable[[], None], condition: Callable[[], bool]) -> None:
        """Jog until the condition holds; where the page tells that it was too slow for it, press again, as it asks."""
        begin()
        for _ in range(SOON // 50):
            if condition():
                return
            if re.search(TOO_SLOW, self.text("#toast")):
                end()
                self.wait("#verdict", "EGM holds both arms|Ready")
                self.tab.evaluate("document.querySelector('#toast').textContent = ''")
                begin()
            self.tab.wait_for_timeout(50)
        raise AssertionError(f"the page shows otherwise; it has said: {self.text('#toast')}")

    def press(self, selector: str) -> None:
        self.tab.click(selector)

    def turn_to(self, tab: str) -> None:
        """Choose what the arm is operated with."""
        self.press(f"#tab-{tab}")

    def mend(self, label: str) -> None:
        """Press the button beside what the page says of the robot."""
        self.wait("#remedy-button", label)
        self.press("#remedy-button")

    def hold(self, jog: str, condition: Callable[[], bool]) -> None:
        """Keep a jog button pressed with the mouse until the condition holds, and wait until the arm stands."""
        self.jog(partial(self.begin, jog), self.tab.mouse.up, condition)
        self.tab.mouse.up()
        self.wait("#verdict", "Ready")

    def begin(self, jog: str) -> None:
        self.turn_to("joints" if jog.startswith("joint") else "tool")
        button = self.tab.locator(f'[data-jog="{jog}"]')
        button.scroll_into_view_if_needed()
        button.hover()
        self.tab.mouse.down()

    def angle(self, row: int) -> float:
        """Of a joint in chain order, as the page shows it on any tab [°]."""
        return float(self.tab.locator("#joints tr").nth(row).locator("td").nth(0).text_content().rstrip("°"))

    def tip(self) -> tuple[float, ...]:
        """Where the fingertips are, as the page shows it [mm]."""
        return tuple(float(value) for value in re.findall(r"-?\d+\.\d", self.text("#tool-pose"))[:3])

    def limit(self) -> tuple[str, str]:
        """The pair that limits the right arm, and the label of the line between two parts, both at one time."""
        self.tab.wait_for_timeout(50)
        texts = self.tab.evaluate("['#verdict', '#nearest'].map((each) => document.querySelector(each).innerText)")
        pair = re.fullmatch(r"The right arm is kept apart: (right .+ – .+)", texts[0].strip())
        return (pair[1] if pair else "", texts[1])

    def robot(self) -> str:
        """Address of the robot's controller, as the page shows it."""
        return self.text("#chips .chip:first-child b").partition(",")[0]

    def take_control(self) -> None:
        self.wait("#take", "Take control")
        self.press("#take")
        self.wait("#take", "Give control back")


def test_stop_is_explained_and_confirmed_on_the_page(chromium: Any, url: str) -> None:
    page = Page(chromium, url)
    page.wait("#verdict", "EGM is off")
    page.take_control()

    # Why does it not move? An emergency stop, which a person must confirm.
    page.press("#press-stop")
    page.wait("#verdict", "Stopped: .*Emergency stop")
    pressed = words(message("emergency_stop_pressed"))
    page.wait("#remedy", pressed)
    assert re.search(pressed, str(page.tab.get_attribute("#recover:disabled", "title")))
    page.mend("Release the emergency stop")
    page.wait("#remedy", "^" + words(message("stop_open", stop="")))
    page.mend("Recover")
    assert "Is no person near it" in page.wait("#confirm", "Confirm the stop")
    inject_fault(page.robot(), "emergency-stop", {})
    page.wait("#confirm", rf"Not yet: first end what stops the robot\s+{pressed}")
    assert not page.tab.is_visible("#confirm-yes")
    page.press("#confirm-no")
    page.mend("Release the emergency stop")
    page.mend("Recover")
    assert "Is no person near it" in page.wait("#confirm", "Confirm the stop")
    page.press("#confirm-yes")
    page.wait("#toast", "10013 Emergency stop")
    page.wait("#verdict", "Ready")
    page.mend("Start EGM")
    page.wait("#verdict", "EGM holds both arms")
    assert page.errors == []


def test_robot_is_operated_through_the_page(chromium: Any, url: str) -> None:
    page = Page(chromium, url)
    page.wait("#verdict", "EGM is off")
    page.take_control()
    page.mend("Start EGM")
    page.wait("#verdict", "EGM holds both arms")

    # Jog a joint with the mouse, and with the keyboard.
    assert page.angle(0) == pytest.approx(0.0, abs=0.1)
    page.hold("joint 0 1", lambda: page.angle(0) > 5.0)
    moved = page.angle(0)
    assert 5.0 < moved < 40.0
    assert "EGM runs on both arms" in str(page.tab.get_attribute("#start:disabled", "title"))

    def press_key() -> None:
        page.tab.locator('[data-jog="joint 0 -1"]').focus()  # a button that was disabled has lost it
        page.tab.keyboard.down(" ")

    page.jog(press_key, partial(page.tab.keyboard.up, " "), lambda: "moves" in page.text("#verdict"))
    page.tab.keyboard.up(" ")
    page.wait("#verdict", "Ready")
    assert page.angle(0) < moved

    # Jog the tool along a line, forwards; upwards from here the arm would meet the robot's body.
    before = page.tip()
    page.hold("linear x 1", lambda: page.tip()[0] - before[0] > 20.0)
    x, y, z = (after - start for after, start in zip(page.tip(), before, strict=True))
    assert x > 20.0
    assert (y, z) == pytest.approx((0.0, 0.0), abs=3.0)

    # Grip a part and see its width.
    page.turn_to("virtual")
    page.press("#open")
    page.wait("#gripper-text", "50.0 mm")
    page.tab.fill("#part-width", "22")
    page.press("#put-part")
    page.wait("#toast", "Done: ")
    page.press("#close")
    page.wait("#toast", "holds something 22.0 mm wide")
    page.wait("#gripper-text", "22.0 mm, holding with 10 N")

    # Scale the speed, preview a pose, go there.
    page.tab.fill("#speed", "50")
    page.wait("#chips", "speed\\s*50 %")
    page.turn_to("poses")
    page.tab.select_option("#pose", "home")
    page.press("#preview")
    page.press("#move")
    page.wait("#toast", "The right arm stands at the goal")
    assert page.angle(0) == pytest.approx(0.0, abs=0.2)
    assert page.errors == []


def test_cause_and_remedy_of_a_fault_are_read_on_the_page(chromium: Any, url: str) -> None:
    page = Page(chromium, url)
    page.take_control()
    page.press("#start")
    page.wait("#toast", "EGM runs on both arms")
    page.turn_to("virtual")
    groups = page.tab.evaluate("[...document.querySelectorAll('#fault optgroup')].map((each) => each.label)")
    assert groups == ["EGM", "Stops and modes", "Web services (RWS)", "Gripper"]
    page.tab.select_option("#fault", "comm-timeout")
    page.press("#inject")
    page.wait("#verdict", "EGM holds the left arm")
    page.wait("#remedy", "The right arm follows no commands. Press “Start EGM”")
    ended = message("robot_stopped_following_in_motion", arm="right", controllers=("joint_position_controller",))
    page.wait("#events", words(ended))
    page.mend("Start EGM")
    page.wait("#toast", "EGM runs on both arms")  # a stop before would be one of its start
    page.wait("#verdict", "EGM holds both arms")

    page.tab.select_option("#fault", "program-stop")
    page.press("#inject")
    page.wait("#verdict", "Stopped: ")
    assert "press “Recover…”" in page.wait("#remedy", words(message("program_stopped")))
    page.wait("#remedy-button", "Recover")

    # A field without a number sends nothing, and what the page says covers no button.
    page.tab.fill("#part-width", "")
    page.press("#put-part")
    page.wait("#toast", "Nothing was sent: the width must be a number from 1 to 50 mm")
    toast, panels = (page.tab.locator(each).bounding_box() for each in ("#toast", ".panels"))
    assert toast["x"] + toast["width"] < panels["x"]  # it covers no button
    assert page.errors == []


def test_arm_is_pushed_aside_and_follows_the_handle(chromium: Any, held: str) -> None:
    page = Page(chromium, held)
    page.wait("#verdict", "EGM holds both arms")
    page.take_control()

    # Push the arm: what is measured deviates, and comes back.
    page.turn_to("virtual")
    before = page.angle(3)
    with Watch() as watch:
        watch.wait(lambda: True)
        page.press("#push")
        watch.wait(lambda: watch.travel() > 0.02)
        _, start = watch.seen[0]
        watch.wait(lambda: all(it == pytest.approx(start, abs=0.002) for _, it in watch.seen[-30:]))  # for 0.5 s
    page.wait("#verdict", "EGM holds both arms")
    assert page.angle(3) == pytest.approx(before, abs=0.2)

    # By the handle in the picture: the tool follows it while it is dragged.
    before = page.tip()
    page.turn_to("tool")
    page.tab.select_option("#handle", "jog translate")
    page.tab.wait_for_function("() => document.querySelector('#scene').dataset.handle?.includes(',')", polling=50)

    def drag() -> None:
        canvas = page.tab.locator("#scene").bounding_box()
        x, y = map(float, page.tab.locator("#scene").get_attribute("data-handle").split(","))
        page.tab.mouse.move(canvas["x"] + x, canvas["y"] + y)
        page.tab.mouse.down()
        page.tab.mouse.move(canvas["x"] + x, canvas["y"] + y - 40, steps=5)

    page.jog(drag, page.tab.mouse.up, lambda: page.tip()[2] > before[2] + 15.0)
    page.tab.mouse.up()
    page.wait("#verdict", "Ready")
    assert page.errors == []


def test_arm_is_jogged_into_the_limit_whose_pair_is_shown_and_planned_out(chromium: Any, held: str) -> None:
    page = Page(chromium, held)
    page.wait("#verdict", "EGM holds both arms")
    page.take_control()

    # By the arrow keys on the picture, to the left, until the limiter leads the arm along its own body.
    page.turn_to("tool")
    page.tab.focus("#scene")
    keys = page.tab.keyboard
    held: list[tuple[str, str]] = []

    def is_held() -> bool:
        pair, label = page.limit()
        if pair:
            held.append((pair, label))
        return len(held) == 5

    page.jog(partial(keys.down, "ArrowLeft"), partial(keys.up, "ArrowLeft"), is_held)
    assert all(label.startswith(pair) for pair, label in held), held  # the line with the distance is of the same pair
    keys.up("ArrowLeft")

    # Out of there by a plan, which begins nearer to the body than plans pass it.
    page.wait("#verdict", "Ready")
    page.turn_to("poses")
    page.tab.select_option("#pose", "home")
    page.press("#plan")
    page.wait("#plan-text", "A motion of")
    page.press("#execute")
    page.tab.wait_for_selector("#plan-box", state="hidden", timeout=SOON)
    page.wait("#toast", "The right arm stands at the goal")
    assert page.angle(0) == pytest.approx(0.0, abs=0.3)
    assert page.errors == []


def test_arm_stops_when_its_page_is_closed_and_when_another_one_takes_control(chromium: Any, held: str) -> None:
    """How soon, ``test_view_measured`` says."""
    page = Page(chromium, held)
    page.wait("#verdict", "EGM holds both arms")
    page.take_control()
    with Watch() as watch:
        watch.wait(lambda: True)
        page.jog(partial(page.begin, "joint 0 1"), page.tab.mouse.up, lambda: watch.travel() > 0.02)
        page.tab.close()
        watch.wait_for_rest()
    assert watch.travel() < JOGGED_ON

    # A second page that takes control ends the jog of the first, too.
    first, second = Page(chromium, held), Page(chromium, held)
    first.take_control()
    second.wait("#control-note", "Another page has control")
    first.tab.bring_to_front()
    with Watch() as watch:
        watch.wait(lambda: True)
        first.jog(partial(first.begin, "joint 0 -1"), first.tab.mouse.up, lambda: watch.travel() > 0.02)
        second.tab.evaluate("document.querySelector('#take').click()")
        second.wait("#take", "Give control back")
        watch.wait_for_rest()
    assert watch.travel() < JOGGED_ON
    first.wait("#toast", words(message("control_taken_by_other")))


def test_page_tells_why_it_ends_a_jog_whose_key_is_still_held(chromium: Any, held: str) -> None:
    page = Page(chromium, held)
    page.wait("#verdict", "EGM holds both arms")
    page.take_control()
    with Watch() as watch:
        watch.wait(lambda: True)
        page.jog(partial(page.begin, "joint 0 1"), page.tab.mouse.up, lambda: watch.travel() > 0.02)
        inject_fault(page.robot(), "egm-silence", {"arm": "right", "duration": "0.5"})
        page.wait("#toast", "The right arm follows no commands: press “Start EGM”|Jog refused: .* press again")
        watch.wait_for_rest()
    page.tab.mouse.up()
    assert page.errors == []


class Watch:
    """Where the right arm is, sixty times a second, seen by another program."""

    def __init__(self) -> None:
        self.seen: list[tuple[float, Joints]] = []
        self._is_over = Event()
        self._thread = Thread(target=self._run)

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        with yumi.attach() as driver:
            for state in driver.watch(60.0):
                arm = state.arms["right"]
                if arm.time is not None and arm.position is not None:
                    self.seen.append((arm.time, arm.position))
                if self._is_over.is_set():
                    return

    def wait(self, condition: Callable[[], bool]) -> None:
        """Until the arm was seen, and the condition holds."""
        for _ in range(1000):
            if self.seen and condition():
                return
            Event().wait(0.01)
        raise AssertionError("the arm was not seen for so long")

    def wait_for_rest(self) -> None:
        """Until the arm has stood for half a second."""
        self.wait(lambda: len(self.seen) > 30 and _difference(self.seen[-30][1], self.seen[-1][1]) < 0.001)

    def travel(self) -> float:
        """By how much the joint that moved most did so [rad]."""
        return _difference(self.seen[0][1], self.seen[-1][1])


def _difference(one: Joints, other: Joints) -> float:
    return max(abs(before - after) for before, after in zip(one, other, strict=True))


def test_motion_is_planned_round_a_box_shown_and_executed(chromium: Any, held: str) -> None:
    """The last one: it leaves the arm beside the box, from where home is no straight way."""
    pytest.importorskip("roboplan", reason="needs yumi-ros2[planning]")
    begin, end = (yumi.degrees(goal) for goal in BESIDE)
    with yumi.attach() as driver:
        driver.move_to(right=begin, speed_scale=1.0)
        driver.stop_egm()
    page = Page(chromium, held)
    page.wait(
        "#tool-pose", "as the controller reports while EGM is off"
    )  # where the arms are is known without EGM, too
    page.take_control()
    page.press("#start")
    page.wait("#verdict", "EGM holds both arms")
    page.turn_to("poses")
    page.tab.select_option("#pose", "joint positions")
    shapes = CollisionModel(dict.fromkeys(Side, GripperModules.SERVO), obstacles=(BOX,))

    def least(way: list[Joints]) -> float:
        """The least distance of the right arm from the box [m]."""
        distances = []
        for position in way:
            pairs = shapes.nearest({Side.RIGHT: position, Side.LEFT: home(Side.LEFT)}, 10_000)
            distances.append(next(it.distance for it in pairs if it.other == BOX.name and it.part.startswith("right")))
        return min(distances)

    straight = [joints([a + share * (b - a) for a, b in zip(begin, end, strict=True)]) for share in (0.2, 0.5, 0.8)]
    assert least(straight) < -0.01
    for index, angle in enumerate(BESIDE[1]):
        page.tab.locator("#joint-goal input").nth(index).fill(str(angle))
    page.press("#plan")
    assert "Nothing moves before Execute" in page.wait("#plan-text", "A motion of")
    before = page.angle(0)
    page.tab.focus("#plan-time")  # the slider moves the ghost
    page.tab.keyboard.press("End")
    assert page.angle(0) == before
    with Watch() as watch:
        page.press("#execute")
        page.tab.wait_for_selector("#plan-box", state="hidden", timeout=SOON)  # else the toast may be an old one
        page.wait("#toast", "The right arm stands at the goal")
    assert page.angle(0) == pytest.approx(BESIDE[1][0], abs=0.3)
    assert not page.tab.is_visible("#plan-box")
    assert least([position for _, position in watch.seen][::5]) > 0.0
    assert page.errors == []


def test_recording_is_opened_and_scrubbed_to_its_event(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    file, frames = tmp_path / "stopped.mcap", flown(1000).frames()
    write_flight_record(file, 1.8e9, recorded_event(LOST, frames[-1].time), {Side.RIGHT: tuple(frames)})
    with CommandProcess("yumi view", "yumi", ("view", str(file), "--port", "0"), tmp_path / "view.log") as command:
        page = Page(chromium, command.wait_until_ready(60.0))
        page.wait("#joints", "°")
        page.wait("#clock", "0.00 s")
        start = page.angle(1)
        page.press("#events button")
        assert float(page.text("#clock").split()[0]) > 0.0
        page.wait("#events li.current", words(LOST.said))
        assert page.angle(1) != start
        page.wait("#kind", "^Recording stopped.mcap at ")
        page.wait("#verdict", "Stopped: .*" + words(LOST.said))
        page.tab.focus("#time")
        page.tab.keyboard.press("Home")
        page.wait("#clock", "^0.00 s")
        page.wait("#verdict", "^The right arm moved$")
        assert page.tab.title() == "Recording stopped.mcap"
        assert page.angle(1) == start
        assert page.errors == []
