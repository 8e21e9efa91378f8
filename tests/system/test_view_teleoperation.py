"""Teleoperation from the page of ``yumi view``: a headset, keys and a gamepad move a virtual robot."""

from __future__ import annotations

import time
from base64 import b64encode
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import cos, pi, radians, sin
from pathlib import Path
from typing import Any

import pytest

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.joints import Pose, Side
from abb_protocols.robot.kinematics import pose_distance, tool0_to_body
from abb_runtime.process.command_process import CommandProcess
from abb_view.page_build import run_script
from browser import browser
from soak import long, short, tell
from system.test_teleoperation_measured import (
    ROOM,
    check_delays,
    recorded_driver,
    right_cycles,
    standstill,
)
from yumi.api.attach import RunningDriver
from yumi.control.hand_over import Commander
from yumi.driver.teleoperated_arm import DEVICE_LINK_LOST
from yumi.web.page_build import ROBOT_PAGE

pytestmark = [pytest.mark.real_time, pytest.mark.alone, pytest.mark.timeout(240)]
SOON = 20.0  # [s]
HAND = (0.25, 1.2, -0.4)  # of the right hand, in the headset's frame [m]
EXACT = (1e-4, radians(0.1))  # 0.1 mm, 0.1 degrees
SMALL = {"width": 360, "height": 260}
"""A picture that software draws sixty times a second."""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as chromium:
        yield chromium


@pytest.fixture(scope="module")
def emulated_headset() -> str:
    return run_script(ROBOT_PAGE, "person")


@dataclass(frozen=True)
class Served:
    """A driver, what it records, and the address of its page."""

    driver: RunningDriver
    record: Path
    url: str


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("teleoperation")
    record = folder / "record.mcap"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(folder))
        with recorded_driver(folder, record) as driver, served_page(folder) as url:
            yield Served(driver, record, url)


@pytest.fixture
def driver(served: Served) -> RunningDriver:
    """No person commands its arms, and the right one has room, whatever the test before has left."""
    end = time.monotonic() + SOON
    while any(Commander(commander(served.driver, side)).is_person for side in Side):  # until the link counts as lost
        assert time.monotonic() < end, "the page that was closed still commands an arm"
        time.sleep(0.02)
    served.driver.give_back()
    while True:  # what the page has left brakes
        try:
            served.driver.move_to(right=ROOM)
        except CommandRefused as refusal:
            if refusal.said.code != "arm_moves_commanded_by" or time.monotonic() > end:
                raise
            time.sleep(0.02)
        else:
            return served.driver


@contextmanager
def served_page(folder: Path) -> Iterator[str]:
    """The address of the page of the driver that runs."""
    with CommandProcess("yumi view", "yumi", ("view", "--port", "0"), folder / "view.log") as view:
        yield view.wait_until_ready(60.0)


@contextmanager
def page_of(chromium: Any, url: str, script: str = "") -> Iterator[Any]:
    """The page with control, on the tab Teleoperate; ``script`` runs in it first."""
    page = chromium.new_page(viewport=SMALL)
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    if script:
        page.add_init_script(script)
    page.goto(url)
    wait(page, lambda: "EGM holds both arms" in page.text_content("#verdict"))
    press(page, "#take")
    wait(page, lambda: page.text_content("#take") == "Give control back")
    press(page, "#tab-teleop")
    try:
        yield page
    finally:
        page.context.close()
    assert errors == []


def wait(page: Any, condition: Callable[[], object]) -> None:
    end = time.monotonic() + SOON
    while not condition():
        assert time.monotonic() < end, page.text_content("#teleop-panel") + page.text_content("#toast")
        page.wait_for_timeout(20)


def press(page: Any, selector: str) -> None:
    """Without scrolling: the page is small."""
    page.evaluate("(selector) => document.querySelector(selector).click()", selector)


def clutch(page: Any, side: Side = Side.RIGHT) -> str:
    """What the page shows of an arm's clutch."""
    return str(page.locator("#teleop-arms-list li").nth(0 if side is Side.RIGHT else 1).get_attribute("data-clutch"))


def sent(driver: RunningDriver, side: Side = Side.RIGHT) -> Pose:
    """Where the fingertips are sent."""
    position = driver.state.arms[side.word].sent
    assert position is not None
    return tool0_to_body(side, position, FINGERTIPS)


def commander(driver: RunningDriver, side: Side = Side.RIGHT) -> str:
    """Who commands an arm, as the driver's state names them."""
    return driver.state.arms[side.word].command.who


def at_rest(page: Any, driver: RunningDriver, side: Side = Side.RIGHT) -> Pose:
    """Where the fingertips are sent, once they have been there for a while."""
    seen = [sent(driver, side)]
    end = time.monotonic() + SOON
    while len(seen) < 10 or max(pose_distance(seen[-1], each)[0] for each in seen[-10:]) > 1e-6:
        assert time.monotonic() < end, "the tool does not stand"
        page.wait_for_timeout(30)
        seen.append(sent(driver, side))
    return seen[-1]


class Headset:
    """A person with an emulated headset, who has entered VR.

    They look up, so that nothing is drawn but the background: software draws the robot too slowly for a headset.
    """

    def __init__(self, page: Any) -> None:
        self.page = page
        page.select_option("#device", "headset")
        wait(page, lambda: self.evaluate("!person.device.activeSession"))
        frames = self.evaluate("person.frames.length")
        press(page, "#enter-vr")
        wait(page, lambda: self.evaluate("person.frames.length") > frames + 1)
        self.look(0.5 * pi)

    def look(self, pitch: float, heading: float = 0.0) -> None:
        """Look upwards by ``pitch`` [rad], ``heading`` to the left of the robot [rad]."""
        a, b, c, d = cos(0.5 * heading), sin(0.5 * heading), cos(0.5 * pitch), sin(0.5 * pitch)
        self.evaluate(f"person.device.quaternion.set({a * d}, {b * c}, {-b * d}, {a * c})")

    def evaluate(self, expression: str) -> Any:
        return self.page.evaluate(expression)

    def put(self, position: tuple[float, float, float], side: Side = Side.RIGHT) -> None:
        self.evaluate(f"person.put('{side.word}', {list(position)})")

    def engage(self, side: Side = Side.RIGHT) -> None:
        """Squeeze the grip until the arm follows; again where the machine had no time for a frame, as the page asks."""
        for _ in range(20):
            self.evaluate(f"person.squeeze('{side.word}', 1)")
            wait(self.page, lambda: clutch(self.page, side) in {"engaged", "limited", "inert"})
            if clutch(self.page, side) != "inert":
                return
            self.release(side)
        raise AssertionError(self.page.text_content("#teleop-panel"))

    def release(self, side: Side = Side.RIGHT) -> None:
        self.evaluate(f"person.squeeze('{side.word}', 0)")
        wait(self.page, lambda: clutch(self.page, side) == "released")

    def to_browser_clock(self) -> float:
        """What is added to a time of the page [s] for one of this program, from the fastest of some answers."""
        offsets = []
        for _ in range(30):
            before = time.monotonic()
            there = float(self.evaluate("performance.now() / 1000"))
            after = time.monotonic()
            offsets.append((after - before, 0.5 * (before + after) - there))
        return min(offsets)[1]


@pytest.fixture
def person(chromium: Any, emulated_headset: str, served: Served, driver: RunningDriver) -> Iterator[Headset]:
    """On a page that has control."""
    with page_of(chromium, served.url, emulated_headset) as page:
        yield Headset(page)


def moved(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> tuple[float, float, float]:
    """The hand, moved in the operator's frame: x away, y to the left, z up."""
    a, b, c = HAND
    return a - y, b + z, c - x


def is_away(begin: Pose, driver: RunningDriver) -> bool:
    """Whether the tool has left the place where it stood."""
    return pose_distance(begin, sent(driver))[0] > 1e-3


@pytest.mark.parametrize("steps", [short(8), long(40, 300.0)])
def test_motion_of_a_hand_in_a_headset_is_in_a_datagram_within_thirty_milliseconds(
    person: Headset, served: Served, driver: RunningDriver, steps: int
) -> None:
    """From the headset's time of the frame, which its page sends, to the datagram that moves the arm.

    The first one: neither the browser nor the driver has anything left to do for pages that were closed.
    """
    page, moved_at = person.page, []
    for attempt in range(2 * steps):
        person.engage()
        begin = at_rest(page, driver)
        page.wait_for_timeout(500 + 3.7 * attempt)  # the arm stands, and the robot's cycle is anywhere
        there = person.evaluate(f"person.move('right', {list(moved(z=0.0 if attempt % 2 else 0.01))})")
        if there is None:  # the machine had no time for a frame: the grip is pressed again
            continue
        at = there + person.to_browser_clock()
        wait(page, lambda begin=begin: is_away(begin, driver) or clutch(page) == "inert")
        if is_away(begin, driver):
            moved_at.append(at)
        if len(moved_at) == steps:
            break
    assert len(moved_at) == steps, f"The clutch was lost in {2 * steps - len(moved_at)} of {2 * steps} motions."
    cycles = right_cycles(served.record, moved_at[0], moved_at[-1])
    check_delays("a headset's frame", cycles, moved_at)


def test_hand_in_a_headset_leads_the_arm_and_each_press_goes_on_from_where_it_is(
    person: Headset, driver: RunningDriver
) -> None:
    page = person.page
    left, followed, commanders = at_rest(page, driver, Side.LEFT), 0, set()
    for attempt in range(20):
        step = (0.02, 0.015, 0.03) if attempt % 2 == 0 else (-0.02, -0.015, -0.03)
        begin = at_rest(page, driver)
        person.put(HAND)  # without the clutch nothing moves
        person.engage()
        assert within(begin, at_rest(page, driver), EXACT)
        x, y, z = (a + b for a, b in zip(begin.position, step, strict=True))
        goal = Pose((x, y, z), begin.orientation)
        person.put(moved(*step))
        wait(page, lambda goal=goal: within(goal, sent(driver), EXACT) or clutch(page) == "inert")
        commanders.add(commander(driver))
        is_followed = clutch(page) != "inert"  # else the machine had no time for a frame: the arm holds
        end = at_rest(page, driver)
        assert within(goal, end, EXACT) or not is_followed
        followed += is_followed
        person.release()
        # Let go, the hand goes anywhere; the arm holds.
        person.evaluate("person.put('right', [0.1, 0.9, -0.2], [0.92, 0.0, 0.38, 0.0])")
        assert within(end, at_rest(page, driver), EXACT)
        if followed == 4:
            break
    assert followed == 4
    assert "headset" in commanders <= {"headset", "none"}
    assert within(left, sent(driver, Side.LEFT), (1e-6, 1e-6))


def test_person_who_looks_down_in_a_headset_sees_the_whole_robot_before_them(
    chromium: Any, emulated_headset: str, served: Served
) -> None:
    with page_of(chromium, served.url, emulated_headset) as page:
        for place in ("0", "180"):  # behind the robot, opposite it
            page.select_option("#stands", place)
            person = Headset(page)
            assert drawn(page) is None
            person.look(radians(-25.0))
            person.put((0.25, -3.0, 0.0))  # the hands are not in the picture
            person.put((-0.25, -3.0, 0.0), Side.LEFT)
            wait(page, lambda: drawn(page) is not None)
            seen = drawn(page)
            assert seen is not None
            left, top, right, bottom = seen
            width, height = SMALL["width"], SMALL["height"]
            assert 0 < left < 0.4 * width < 0.6 * width < right < width - 1, seen
            assert 0 < top < 0.4 * height < 0.6 * height < bottom < height - 1, seen
            person.look(radians(-25.0), pi)
            wait(page, lambda: drawn(page) is None)
            person.look(0.0)  # iwer begins a session with how the head was held in its newest picture
            wait(page, lambda: drawn(page) is not None)


BOUNDS = """async (png) => {
  const picture = await createImageBitmap(new Blob([Uint8Array.from(atob(png), (each) => each.charCodeAt(0))]));
  const { width, height } = picture;
  const context = new OffscreenCanvas(width, height).getContext("2d");
  context.drawImage(picture, 0, 0);
  const { data } = context.getImageData(0, 0, width, height);
  let [left, top, right, bottom] = [width, height, -1, -1];
  for (let index = 0; index < width * height; index += 1) {
    if (data[4 * index + 1] >= 160) continue; // the background and the grid are lighter
    const [x, y] = [index % width, Math.floor(index / width)];
    [left, top, right, bottom] = [Math.min(left, x), Math.min(top, y), Math.max(right, x), Math.max(bottom, y)];
  }
  return right < 0 ? null : [left, top, right, bottom];
}"""
"""Where a picture is dark: left, top, right, bottom [pixels]; null where it is nowhere."""


def drawn(page: Any) -> list[int] | None:
    """Where the eye sees something apart from the background and the grid: left, top, right, bottom [pixels]."""
    bounds = page.evaluate(BOUNDS, b64encode(page.screenshot()).decode())
    return None if bounds is None else list(bounds)


def within(one: Pose, other: Pose, limits: tuple[float, float]) -> bool:
    distance, turn = pose_distance(one, other)
    return distance <= limits[0] and turn <= limits[1]


def test_nothing_moves_by_a_headset_that_does_not_see_the_hand_or_is_in_its_menu(
    person: Headset, driver: RunningDriver
) -> None:
    page = person.page
    for lose, find in (("see('right', false)", "see('right', true)"), ("hide(true)", "hide(false)")):
        person.engage()
        person.evaluate(f"person.{lose}")
        wait(page, lambda: clutch(page) in {"released", "inert"})
        held = at_rest(page, driver)
        person.put(moved(z=0.03))
        person.evaluate(f"person.{find}")
        # The grip is squeezed still: it has to be pressed again.
        wait(page, lambda: clutch(page) == "inert")
        frames = person.evaluate("person.frames.length")
        wait(page, lambda frames=frames: person.evaluate("person.frames.length") > frames + 5)
        assert within(held, at_rest(page, driver), (1e-6, 1e-6))
        person.put(HAND)
        person.release()
    person.engage()
    press(page, "#take")  # control is given back
    wait(page, lambda: page.text_content("#take") == "Take control")
    held = at_rest(page, driver)
    person.put(moved(z=0.03))
    page.wait_for_timeout(300)
    assert within(held, sent(driver), (1e-6, 1e-6))


LIFT_UNTIL_LOST = """() => new Promise((end) => {
  let height = 1.2, moves = 0, sent = person.frames.length, cutAt = 0, shown = "";
  const step = () => {
    if (cutAt || person.frames.length > sent) {
      height = Math.min(1.28, height + 0.0025);
      moves += 1;
    }
    sent = person.frames.length;
    person.put("right", [0.25, height, -0.4]);
    if (!cutAt && moves === 20) {
      person.cut(true);
      cutAt = performance.now();
      shown = document.querySelector("#teleop-arms-list li").dataset.clutch;
    }
    if (!cutAt || performance.now() < cutAt + 850) setTimeout(step, 5);
    else end([person.frames.at(-1).sentAt, shown]);
  };
  step();
})"""
"""Lifts the hand with each frame that the page sends, cuts the link after twenty, and lifts it on; when the last frame
was sent [s], and what the page showed of the clutch then."""


def test_arm_stands_soon_after_the_link_to_a_headset_is_lost_and_holds_when_it_is_back(
    person: Headset, served: Served, driver: RunningDriver
) -> None:
    page, lost_at = person.page, []
    for _ in range(10):
        person.engage()
        sent_at, shown = person.evaluate(LIFT_UNTIL_LOST)
        if shown not in {"engaged", "limited"}:  # the machine had no time for a frame: the grip is pressed again
            person.put(HAND)
            person.evaluate("person.cut(false)")
            continue
        lost_at.append(sent_at + person.to_browser_clock())
        held = at_rest(page, driver)
        person.evaluate("person.cut(false)")
        wait(page, lambda: clutch(page) == "inert")
        person.put(HAND)
        assert within(held, at_rest(page, driver), (1e-6, 1e-6))
        person.release()
        driver.give_back()
        driver.move_to(right=ROOM)
        if len(lost_at) == 2:
            break
    assert len(lost_at) == 2, "The clutch was lost before the link was cut, in eight of ten motions."
    cycles = right_cycles(served.record, lost_at[0], lost_at[-1])
    stops = [standstill(cycles, lost) for lost in lost_at]
    tell(f"From a headset's last frame to standstill: at most {1e3 * max(stops):.0f} ms.")
    assert max(stops) < DEVICE_LINK_LOST + 0.2


GAMEPAD = """
window.pad = { id: "A gamepad", connected: true, mapping: "standard", axes: [0, 0, 0, 0], rumbles: 0,
  buttons: Array.from({ length: 17 }, () => ({ pressed: false, touched: false, value: 0 })),
  vibrationActuator: { playEffect: () => { pad.rumbles += 1; return Promise.resolve("complete"); } } };
pad.hold = (index, isHeld) => { pad.buttons[index] = { pressed: isHeld, touched: isHeld, value: Number(isHeld) }; };
navigator.getGamepads = () => [pad, null, null, null];
"""


def until(page: Any, is_so: Callable[[], bool], press_again: Callable[[], None]) -> None:
    """Wait for something that a held clutch does; it is pressed again where the machine had no time for a frame."""

    def is_so_now() -> bool:
        if clutch(page) in {"inert", "released"}:
            press_again()
        return is_so()

    wait(page, is_so_now)


def moving(driver: RunningDriver, axis: int, by: float) -> Callable[[], bool]:
    """Whether the tool has moved along an axis [m] from where it is now."""
    begin = sent(driver).position[axis]
    return lambda: (sent(driver).position[axis] - begin) * by > by * by


CLICKS, KEYS = ("#take", "#tab-teleop", "#keys"), (" ", "w")
"""What a person presses from the address to a moving arm."""


def operated(page: Any, url: str, driver: RunningDriver) -> float | None:
    """How long it takes from the address to a moving arm [s]; None where the machine had no time for a frame."""
    is_moving, begin = moving(driver, 0, 0.001), time.monotonic()
    page.goto(url)
    for selector in CLICKS:
        wait(page, lambda selector=selector: page.is_visible(selector))
        press(page, selector)
        page.focus(selector)  # as a person's click does
    for key in KEYS:
        is_next = is_moving if key == KEYS[-1] else lambda: clutch(page) == "engaged"
        page.keyboard.down(key)
        wait(page, lambda is_next=is_next: is_next() or clutch(page) == "inert")
    return time.monotonic() - begin if is_moving() else None


def test_arm_moves_after_three_clicks_and_two_keys_from_the_address(
    chromium: Any, served: Served, driver: RunningDriver
) -> None:
    """As docs/how-to/teleoperate.md has it, with the time that browser, server and driver take of it."""
    for _ in range(3):
        page = chromium.new_page(viewport=SMALL)
        seconds = operated(page, served.url, driver)
        page.context.close()
        if seconds is not None:
            break
    assert seconds is not None, "the clutch was lost each time"
    tell(f"From the page's address to a moving arm: {seconds:.1f} s without a person's own time.")


def test_keys_move_the_arm_while_space_is_held_and_the_focus_is_there(
    chromium: Any, served: Served, driver: RunningDriver
) -> None:
    with page_of(chromium, served.url) as page:
        keys = page.keyboard

        def space() -> None:
            keys.up(" ")
            page.wait_for_timeout(100)
            keys.down(" ")
            page.wait_for_timeout(300)

        page.focus("#keys")
        held = at_rest(page, driver)
        keys.down("r")  # without Space
        page.wait_for_timeout(300)
        assert within(held, sent(driver), (1e-6, 1e-6))
        space()
        until(page, moving(driver, 2, 0.02), space)
        page.evaluate("document.activeElement.blur()")
        wait(page, lambda: clutch(page) == "released")
        held = at_rest(page, driver)
        page.focus("#keys")  # Space is held still, and repeats, but its press was lost with the focus
        keys.down(" ")
        keys.down("r")
        page.wait_for_timeout(300)
        assert within(held, sent(driver), (1e-6, 1e-6))


def test_gamepad_moves_the_arm_of_the_bumper_that_is_held_and_vibrates_at_a_limit(
    chromium: Any, served: Served, driver: RunningDriver
) -> None:
    with page_of(chromium, served.url, GAMEPAD) as page:

        def bumper() -> None:
            page.evaluate("pad.hold(5, false)")
            page.wait_for_timeout(100)
            page.evaluate("pad.hold(5, true)")
            page.wait_for_timeout(300)

        page.select_option("#device", "gamepad")
        assert page.text_content("#device-name") == "A gamepad"
        held, left = at_rest(page, driver), at_rest(page, driver, Side.LEFT)
        page.evaluate("pad.axes[1] = 1")  # without a bumper
        page.wait_for_timeout(300)
        assert within(held, sent(driver), (1e-6, 1e-6))
        bumper()
        until(page, moving(driver, 0, -0.01), bumper)
        until(page, lambda: commander(driver) == "device", bumper)
        page.evaluate("pad.axes[0] = -1")  # to the left, too, where the body is
        until(page, lambda: page.evaluate("pad.rumbles") > 0, bumper)
        page.evaluate("pad.connected = false")  # it is unplugged
        wait(page, lambda: clutch(page) == "released")
        at_rest(page, driver)
        assert within(left, sent(driver, Side.LEFT), (1e-6, 1e-6))
