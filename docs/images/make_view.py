"""Take pictures of the page of `yumi view` for the documentation: a virtual robot is operated through the page.

Needs Debian's chromium and playwright. Frames are taken while the page is operated, at their own pace; the animation
shows what the page showed.

    python docs/images/make_view.py                    # docs/images/view.webp (moves), view-dark.webp, view-390.webp
    python docs/images/make_view.py --folder /tmp/x    # elsewhere
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
from playwright.sync_api import sync_playwright

from yumi.process.supervision import Command

ARGUMENTS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
SIZE = (1120, 700)
SHOWN = (840, 525)  # of the animation [pixels]
FRAME = 180  # [ms]


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
        button = self.page.locator(f'[data-jog="{jog}"]')
        button.scroll_into_view_if_needed()
        button.hover()
        self.page.mouse.down()
        self.take(count)
        self.page.mouse.up()
        self.take(1)

    def wait(self, selector: str, words: str) -> None:
        self.page.wait_for_function(
            "([selector, words]) => document.querySelector(selector).innerText.includes(words)",
            arg=[selector, words],
            polling=50,
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
    page.fill("#jog-speed", "10")  # a picture takes long where there is no graphics card
    film.hold("joint 0 1", 5)
    film.hold("linear z 1", 6)
    film.hold("elbow 1", 5)
    page.select_option("#pose", "ready")
    page.click("#preview")
    film.take(3)
    page.click("#move")
    film.take(8)
    film.wait("#toast", "stands at the goal")
    page.click("#preview")
    page.click("#open")
    film.wait("#gripper-text", "50.0 mm")
    page.click("#put-part")
    film.wait("#toast", "done")
    page.click("#close")
    film.wait("#toast", "holds something")
    film.take(4)
    page.click("#press-stop")
    film.wait("#verdict", "Stopped")
    film.take(8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path(__file__).parent)
    folder: Path = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as logs, sync_playwright() as playwright:
        os.environ["XDG_RUNTIME_DIR"] = logs
        arguments = ("view", "--virtual", "--port", "0", "--logs", logs)
        with Command("yumi view", arguments, Path(logs) / "view.log") as command:
            url = command.wait_until_ready(60.0)
            browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=ARGUMENTS)

            def opened(size: tuple[int, int], scheme: Any = "light") -> Any:
                page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme)
                page.goto(url)
                page.wait_for_function("() => document.querySelector('#chips').innerText.includes('AUTO')", polling=50)
                page.wait_for_timeout(2500)
                return page

            def picture(page: Any, name: str, before: Callable[[], None] = lambda: None) -> None:
                before()
                Image.open(io.BytesIO(page.screenshot())).save(folder / name, quality=82)
                page.close()

            picture(opened(SIZE, "dark"), "view-dark.webp")
            picture(opened((390, 844)), "view-390.webp")
            page = opened(SIZE)
            film = Film(page)
            demonstration(film)
            page.close()
            first, *others = film.frames
            first.save(
                folder / "view.webp", save_all=True, append_images=others, duration=FRAME, loop=0, quality=60, method=2
            )
            browser.close()


if __name__ == "__main__":
    main()
