"""What the page of ``yumi view`` costs the control loop, and how soon it shows and does what a person asks for.

The figures are told, see ``make soak``; the browser renders in software here, which is why its times stand apart.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median, quantiles
from threading import Event, Thread
from typing import Any

import aiohttp
import pytest

import yumi
from browser import browser
from soak import tell
from yumi.api.attach import RunningDriver
from yumi.process.supervision import Command

pytestmark = [pytest.mark.real_time, pytest.mark.soak, pytest.mark.timeout(600)]
PHASE = 20.0  # [s] with the page closed, and with it open
HOLDS = 40
AWAY = {"right": {"j1": 0.3, "j5": 0.9}, "left": {"j1": -0.3, "j5": 0.9}}


@pytest.fixture
def url(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    arguments = ("view", "--virtual", "--port", "0", "--logs", str(tmp_path))
    with Command("yumi view", arguments, tmp_path / "view.log") as command:
        yield command.wait_until_ready(60.0)


def missed(driver: RunningDriver) -> tuple[int, int]:
    """Cycles of both arms that got no reply in time or never arrived, and all cycles."""
    counts = [arm.cycles for arm in driver.state.arms.values() if arm.cycles is not None]
    return sum(it.missed + it.lost for it in counts), sum(it.answered for it in counts)


def move_for(driver: RunningDriver, seconds: float) -> tuple[int, int]:
    """Move both arms there and back; cycles that were missed, and all cycles."""
    before, end = missed(driver), time.monotonic() + seconds
    while time.monotonic() < end:
        driver.move_to(right=AWAY["right"], left=AWAY["left"])
        driver.move_to(right="home", left="home")
    after = missed(driver)
    return after[0] - before[0], after[1] - before[1]


def test_page_that_is_open_makes_the_control_loop_miss_no_more_cycles(url: str) -> None:
    with yumi.attach() as driver:
        driver.start_egm()
        closed, cycles = move_for(driver, PHASE)
        tell(f"Page closed: {closed} of {cycles} cycles missed while both arms moved.")
        for name, is_drawn in (("receives states", False), ("draws in software", True)):
            is_over, rates = Event(), []
            watching = Thread(target=_draw if is_drawn else _receive, args=(url, is_over, rates))
            watching.start()
            opened, cycles = move_for(driver, PHASE)
            is_over.set()
            watching.join()
            tell(f"A page that {name}, {rates[0]:.1f} states a second: {opened} of {cycles} cycles missed.")
            if not is_drawn:
                assert rates[0] > 28.0
                assert opened <= closed + cycles * 1e-3  # a second core is what this machine may not have
        driver.stop_egm()


def _receive(url: str, is_over: Event, rates: list[float]) -> None:
    async def main() -> None:
        async with aiohttp.ClientSession() as session, _page(session, url) as socket:
            count, begin = 0, time.monotonic()
            while not is_over.is_set():
                count += (await _next(socket))["type"] == "state"
            rates.append(count / (time.monotonic() - begin))

    asyncio.run(main())


def _draw(url: str, is_over: Event, rates: list[float]) -> None:
    with browser() as chromium:
        page = chromium.new_page(viewport={"width": 1280, "height": 900})
        count = [0]

        def take(frame: Any) -> None:
            count[0] += str(frame).startswith('{"type":"state"')

        page.on("websocket", lambda socket: socket.on("framereceived", take))
        page.goto(url)
        page.wait_for_timeout(3000)
        count[0], begin = 0, time.monotonic()
        while not is_over.is_set():
            page.wait_for_timeout(200)
        rates.append(count[0] / (time.monotonic() - begin))


def _page(session: aiohttp.ClientSession, url: str) -> Any:
    return session.ws_connect(f"{url}ws", headers={"Origin": url.rstrip("/")})


async def _next(socket: aiohttp.ClientWebSocketResponse) -> Any:
    message = json.loads(await asyncio.wait_for(socket.receive_str(), 10.0))
    if message["type"] == "state":
        await socket.send_str('{"type": "seen"}')
    return message


def test_what_a_person_presses_is_seen_within_a_tenth_of_a_second(url: str) -> None:
    with yumi.attach() as driver:
        driver.start_egm()
    delays, stops = asyncio.run(_delays(url))
    p95 = quantiles(delays, n=20)[-1]
    tell(
        f"From a key to the first state with motion: median {1e3 * median(delays):.0f} ms, p95 {1e3 * p95:.0f} ms; "
        f"from the last message of a lost link to standstill: p95 {1e3 * quantiles(stops, n=20)[-1]:.0f} ms."
    )
    assert p95 < 0.100
    assert max(stops) < 0.4  # to the state in which it stands; it has stopped by then


async def _delays(url: str) -> tuple[list[float], list[float]]:
    """From a key's message until a state shows motion, and from the last message until one shows standstill [s]."""
    delays, stops = [], []
    async with aiohttp.ClientSession() as session, _page(session, url) as socket:
        while (message := await _next(socket))["type"] != "state":
            pass
        seen = message["time"]
        await socket.send_str('{"type": "take_control"}')
        for hold in range(HOLDS):
            speeds = [0.3 if hold % 2 else -0.3, *[0.0] * 6]
            begin, moved_at, last = time.monotonic(), 0.0, 0.0
            is_held = True
            while True:
                if is_held:
                    jog = {"arm": "right", "hold": hold, "seen": seen, "speeds": speeds}
                    await socket.send_str(json.dumps({"type": "jog_joints", **jog}))
                    last = time.monotonic()
                while (message := await _next(socket))["type"] != "state":
                    assert message["type"] != "jog_refused", message["error"]["message"]
                now, seen, arm = time.monotonic(), message["time"], message["state"]["arms"]["right"]
                is_moving = abs(arm["velocity"][0]) > 0.01
                moved_at = moved_at or (now if is_moving else 0.0)
                is_held = not moved_at or now - moved_at < 0.3
                if not is_held and not is_moving:
                    stops.append(now - last)
                    break
            if hold:  # the first one takes the arm over
                delays.append(moved_at - begin)
    return delays, stops
