"""The page in a browser, with a driver that notes what it is asked: what a person drags and presses on the picture."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from browser import browser
from fake_driver import FakeDriver
from yumi.robot.joints import ZERO, Joints, Side
from yumi.web import live
from yumi.web.server import ViewServer, ViewSettings


@contextmanager
def served() -> Iterator[str]:
    """The page's address, served on a thread of its own."""
    loop = asyncio.new_event_loop()
    thread = Thread(target=loop.run_forever)
    thread.start()

    async def made() -> ViewServer:
        server = ViewServer(ViewSettings(port=0, may_operate=True, token="secret"))
        await server.start()
        return server

    server = asyncio.run_coroutine_threadsafe(made(), loop).result(10.0)
    try:
        yield server.url
    finally:
        asyncio.run_coroutine_threadsafe(server.stop(), loop).result(10.0)
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


@pytest.mark.timeout(120)
def test_tool_follows_the_handle_and_the_keys_on_the_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(live, "OLDEST_SEEN", 60.0)  # a browser that draws in software may be slow
    errors: list[str] = []
    with browser() as chromium, running() as driver, served() as url:
        page: Any = chromium.new_page(viewport={"width": 1280, "height": 900})
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(url)
        page.click("#take")
        page.wait_for_function("() => document.querySelector('#take').innerText.includes('back')", polling=50)

        def twist(condition: Callable[[Joints], bool]) -> None:
            for _ in range(400):
                newest = driver.robot.tool_goals[Side.RIGHT].read()
                if newest is not None and condition(newest[1].twist):
                    return
                page.wait_for_timeout(20)
            raise AssertionError(f"the tool was asked for {newest}")

        page.select_option("#handle", "jog translate")
        page.wait_for_function(
            "() => (document.querySelector('#scene').dataset.handle ?? '').includes(',')", polling=50
        )
        canvas = page.locator("#scene").bounding_box()
        x, y = map(float, page.locator("#scene").get_attribute("data-handle").split(","))
        page.mouse.move(canvas["x"] + x, canvas["y"] + y)
        page.mouse.down()
        page.mouse.move(canvas["x"] + x, canvas["y"] + y - 40, steps=5)
        twist(lambda it: it[2] > 0.02 and it[3:] == ZERO[3:])
        page.mouse.up()
        twist(lambda it: it == ZERO)

        page.select_option("#handle", "none")
        page.focus("#scene")
        page.keyboard.down("ArrowLeft")
        twist(lambda it: it[1] > 0.02 and it[:1] == ZERO[:1] and it[2:] == ZERO[2:])
        page.keyboard.up("ArrowLeft")
        twist(lambda it: it == ZERO)
        page.select_option("#jog-frame", "box table")
        page.focus("#scene")
        page.keyboard.down("Shift")
        page.keyboard.down("PageUp")
        twist(lambda it: it[5] > 0.1)
        page.locator("#scene").blur()
        twist(lambda it: it == ZERO)
    assert errors == []
