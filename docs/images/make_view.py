"""Take pictures of the page of `yumi view` for the documentation: a virtual robot is operated through the page.

Needs Debian's chromium and playwright. Frames are taken while the page is operated, at their own pace; the animation
shows what the page showed.

    python docs/images/make_view.py    # docs/images/view.webp (moves), view-dark.webp, view-390.webp, teleoperate*.webp
    python docs/images/make_view.py --folder /tmp/x    # elsewhere
    python docs/images/make_view.py --folder /tmp/x --review    # also a picture of each state of the page, to look at
"""

from __future__ import annotations

import argparse
import io
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Error as PlaywrightError
from playwright.sync_api import sync_playwright

from abb_runtime.process.command_process import CommandProcess
from abb_view.page_build import run_script
from yumi.api.attach import attach
from yumi.web.page_build import ROBOT_PAGE

CONFIG = """
collision:
  enabled: true
  boxes:
    post: {position: [0.30, 0.30, 0.0], size: [0.08, 0.08, 0.20]}
"""
ARGUMENTS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
SIZE = (1120, 700)
EYE = (900, 640)  # of a headset's picture
SHOWN = (840, 525)  # of the animation [pixels]
FRAME = 180  # [ms]
NAMES = {"teleoperate": "teleoperate", "headset": "teleoperate-headset"}  # of files that are not called view-


class Film:
    """The page, and its pictures."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.frames: list[Image.Image] = []

    def take(self, count: int = 1) -> None:
        for _ in range(count):
            picture = Image.open(io.BytesIO(self.page.screenshot())).convert("RGB")
            self.frames.append(picture.resize(SHOWN, Image.Resampling.LANCZOS))
            self.page.wait_for_timeout(40)

    def hold(self, jog: str, count: int) -> None:
        """Press a button again and again, with a picture after each time: one takes too long to jog meanwhile."""
        self.page.click("#tab-joints" if jog.startswith("joint") else "#tab-tool")
        button = self.page.locator(f'[data-jog="{jog}"]')
        button.scroll_into_view_if_needed()
        button.hover()
        for _ in range(count):
            self.page.mouse.down()
            self.page.wait_for_timeout(350)
            self.page.mouse.up()
            self.take(1)

    def wait(self, selector: str, words: str) -> None:
        self.page.wait_for_function(
            "([selector, words]) => document.querySelector(selector).innerText.includes(words)",
            arg=[selector, words],
            polling=50,
            timeout=120_000,
        )


def demonstration(film: Film) -> None:
    """Take control, start EGM, jog, go to a pose, grip, and an emergency stop with its remedy."""
    page = film.page
    film.wait("#verdict", "EGM is off")
    film.take(4)
    page.click("#take")
    film.wait("#take", "Give control back")
    page.click("#start")
    film.wait("#verdict", "EGM holds both arms")
    film.take(3)
    film.hold("joint 0 1", 4)
    film.hold("linear z 1", 4)
    page.click("#tab-poses")
    page.select_option("#pose", "ready")
    page.click("#preview")
    film.take(3)
    page.click("#move")
    film.take(6)
    film.wait("#verdict", "Ready")
    page.click("#preview")
    page.click("#tab-virtual")
    page.click("#open")
    film.wait("#gripper-text", "50.0 mm")
    page.click("#put-part")
    film.wait("#toast", "Done")
    page.click("#close")
    film.wait("#toast", "holds something")
    film.take(4)
    page.click("#press-stop")
    film.wait("#verdict", "Stopped")
    film.take(8)


def teleoperate(film: Film, save: Callable[[Any, str], None]) -> None:
    """The tab Teleoperate while keys lead both arms."""
    page = film.page
    page.click("#tab-teleop")
    page.click("#keys")
    page.keyboard.down(" ")
    film.wait("#teleop-arms-list", "follows")
    page.keyboard.down("r")
    page.wait_for_timeout(500)
    page.keyboard.up("r")
    page.wait_for_timeout(300)
    save(page, "teleoperate")
    page.keyboard.up(" ")


def wear_headset(page: Any, save: Callable[[Any, str], None]) -> None:
    """What one eye of an emulated headset sees while the right arm follows the hand.

    Software draws the robot so slowly that the link is lost meanwhile, and the clutch. So the person looks up while the
    hand leads the arm, where nothing is to be drawn, and down for one picture: it shows how it was when it was begun.
    """
    film = Film(page)
    film.wait("#take", "Take control")
    page.click("#take")
    page.click("#tab-teleop")
    page.select_option("#device", "headset")
    page.click("#enter-vr")
    page.wait_for_function("() => person.frames.length > 1", polling=50)
    page.evaluate("person.put('left', [-0.25, 1.25, -0.6])")
    for _ in range(20):
        page.evaluate("person.put('right', [0.25, 1.25, -0.6]); person.device.quaternion.set(0.7, 0, 0, 0.714)")
        page.evaluate("person.squeeze('right', 1)")
        if is_followed(page) and page.evaluate(LEAD):
            save(page, "headset")
            return
        page.evaluate("person.squeeze('right', 0)")
        page.wait_for_timeout(300)
    raise RuntimeError("the machine is too busy for a clutch that is held")


def is_followed(page: Any) -> bool:
    """Whether an arm follows the device, which takes a moment after the clutch was pressed."""
    try:
        page.wait_for_function(
            "() => document.querySelector('#teleop-arms-list').innerText.includes('follows')", polling=20, timeout=2000
        )
    except PlaywrightError:
        return False
    return True


LEAD = """() => new Promise((done) => {
  const begin = performance.now();
  const lead = () => {
    const passed = (performance.now() - begin) / 1000;
    person.put("right", [0.25 + 0.1 * passed, 1.25 + 0.12 * passed, -0.6 - 0.06 * passed]);
    if (passed < 1) return requestAnimationFrame(lead);
    setTimeout(() => {
      if (!document.querySelector("#teleop-arms-list").innerText.includes("follows")) return done(false);
      person.device.quaternion.set(-0.17, 0, 0, 0.985);
      window.requestAnimationFrame = () => 0;
      setTimeout(() => done(true), 1500);
    });
  };
  lead();
})"""
"""Lead the right hand away for a second; if the arm follows then, look down for one picture, and draw no other."""


def teleoperation(opened: Callable[..., Any], save: Callable[[Any, str], None]) -> None:
    """The pictures of teleoperation, from where the arms have room; EGM is off before and after."""
    with attach() as driver:
        driver.start_egm()
        driver.move_to(right="ready", left="ready")
        page = opened(SIZE)
        page.click("#take")
        teleoperate(Film(page), save)
        page.close()
        page = opened(EYE, script=run_script(ROBOT_PAGE, "person"))
        wear_headset(page, save)
        page.close()
        driver.give_back()  # the arms are reserved for the person who has teleoperated them
        driver.move_to(right="home", left="home")
        driver.stop_egm()


def move_to_limit(film: Film) -> None:
    """Send the right arm straight against the body: the limiter keeps it apart while the motion goes on.

    A key that is held would do so, too, but a page that draws in software lets it go while a picture is taken.
    """
    page = film.page
    page.click("#tab-poses")
    page.select_option("#pose", "joint positions")
    page.locator("#joint-goal input").nth(0).fill("-60")
    page.click("#move")
    film.wait("#verdict", "kept apart")


def review(page: Any, save: Callable[[Any, str], None], opened: Callable[..., Any]) -> None:
    """A picture of each state that a page can be in, of a robot that stands after an emergency stop."""
    film = Film(page)
    save(page, "fault")
    for name, other in (("fault-dark", opened(SIZE, "dark")), ("fault-390", opened((390, 844)))):
        save(other, name)
        other.close()
    page.click("#remedy-button")
    film.wait("#remedy", "motors are off")
    save(page, "released")
    page.click("#recover")
    save(page, "confirm")
    page.click("#confirm-yes")
    film.wait("#verdict", "Ready")
    page.click("#start")
    film.wait("#verdict", "EGM holds both arms")
    for tab in ("joints", "tool", "virtual", "poses"):
        page.click(f"#tab-{tab}")
        save(page, f"tab-{tab}")
    for name, select in (("preview", "home"), ("handle", "the handle")):
        page.select_option("#pose", select)
        if select == "home":
            page.click("#preview")
        save(page, name)
    page.select_option("#pose", "home")
    move_to_limit(film)
    save(page, "limit")
    page.click("#stop")
    film.wait("#verdict", "EGM is off")
    page.click("#start")
    film.wait("#verdict", "EGM holds both arms")
    page.select_option("#pose", "ready")
    page.click("#plan")  # from where the limiter has stopped it
    film.wait("#plan-text", "A motion of")
    save(page, "plan")
    page.close()  # which gives control back
    for name, other in (("control-390", opened((390, 844))), ("control-390-dark", opened((390, 844), "dark"))):
        other.click("#take")
        Film(other).wait("#take", "Give control back")
        save(other, name)
        other.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path(__file__).parent)
    parser.add_argument("--review", action="store_true", help="also a picture of each state of the page")
    arguments = parser.parse_args()
    folder: Path = arguments.folder
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as logs, sync_playwright() as playwright:
        os.environ["XDG_RUNTIME_DIR"] = logs
        config = Path(logs) / "yumi.yaml"
        config.write_text(f"{CONFIG}recorder:\n  folder: {logs}\n")
        options = ("view", "--virtual", "--port", "0", "--logs", logs, "--config", str(config))
        with CommandProcess("yumi view", "yumi", options, Path(logs) / "view.log") as command:
            url = command.wait_until_ready(60.0)
            browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=ARGUMENTS)

            def opened(size: tuple[int, int], scheme: Any = "light", script: str = "") -> Any:
                page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme)
                if script:
                    page.add_init_script(script)
                page.goto(url)
                page.wait_for_function("() => document.querySelector('#chips').innerText.includes('AUTO')", polling=50)
                page.wait_for_timeout(2500)
                return page

            def picture(page: Any, name: str) -> None:
                file = NAMES.get(name, f"view-{name}")
                Image.open(io.BytesIO(page.screenshot())).save(folder / f"{file}.webp", quality=82)

            for name, page in (("dark", opened(SIZE, "dark")), ("390", opened((390, 844)))):
                picture(page, name)
                page.close()
            teleoperation(opened, picture)
            page = opened(SIZE)
            film = Film(page)
            demonstration(film)
            if arguments.review:
                review(page, picture, opened)
                recordings = sorted(Path(logs).rglob("*.mcap"))  # the driver has recorded the stop
                with CommandProcess(
                    "yumi view", ("view", str(recordings[0]), "--port", "0"), Path(logs) / "record.log"
                ) as other:
                    shown = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
                    shown.goto(other.wait_until_ready(60.0))
                    Film(shown).wait("#joints", "°")
                    shown.click("#events button")
                    shown.wait_for_timeout(2500)
                    picture(shown, "recording")
                    shown.close()
            first, *others = film.frames
            first.save(
                folder / "view.webp", save_all=True, append_images=others, duration=FRAME, loop=0, quality=60, method=2
            )
            browser.close()


if __name__ == "__main__":
    main()
