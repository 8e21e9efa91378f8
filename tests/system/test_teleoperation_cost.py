"""What teleoperation from a page, with a recording, costs the control loop: missed cycles, against those without."""

from __future__ import annotations

import asyncio
import json
import time
from math import sin
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from abb_runtime.process.command_process import CommandProcess
from soak import long, short, tell
from system.test_teleoperation_measured import RATE, ROOM, recorded_driver
from yumi.api.attach import RunningDriver
from yumi.recording.reader import recorded_messages

AWAY = (*ROOM[:6], ROOM[6] + 0.4)  # [rad]: the tool turns, where it has room
SPEED = 0.05  # [m/s] of the tool


def missed(driver: RunningDriver) -> tuple[int, int]:
    """Cycles of both arms that got no reply in time or never arrived, and those that got one."""
    counts = [arm.cycles for arm in driver.state.arms.values() if arm.cycles is not None]
    return sum(it.missed + it.lost for it in counts), sum(it.answered for it in counts)


def move_for(driver: RunningDriver, seconds: float) -> None:
    """Move the right arm there and back, as a program does."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        driver.move_to(right=AWAY)
        driver.move_to(right=ROOM)


class Page:
    """What the page's script does, without a browser: it takes each state as it comes, and sends frames.

    Attributes:
        states: that have come.
        engaged: frames by which the right arm was moved.
    """

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.states = self.engaged = 0
        self._socket, self._seen, self._has_control = socket, 0.0, asyncio.Event()

    async def read(self) -> None:
        """Take what the server sends, until the socket is closed."""
        async for received in self._socket:
            message = json.loads(received.data)
            if message["type"] == "state":
                if not self.states:
                    await self._send(type="take_control")
                self.states, self._seen = self.states + 1, message["time"]
                await self._send(type="seen")
            elif message["type"] == "view" and message["control"] == "here":
                self._has_control.set()
            elif message["type"] == "teleoperated":
                self.engaged += message["arms"]["right"]["clutch"] == "engaged"

    async def _send(self, **message: Any) -> None:
        await self._socket.send_str(json.dumps(message))

    async def teleoperate_for(self, seconds: float) -> None:
        """Move the right arm up and down, as a stick does."""
        await asyncio.wait_for(self._has_control.wait(), 10.0)
        begin = due = time.monotonic()
        while (now := time.monotonic()) - begin < seconds:
            twist = [0.0, 0.0, SPEED * sin(4.0 * now), 0.0, 0.0, 0.0]
            hand = {"clutch": now - begin > 0.2, "twist": twist}
            await self._send(type="teleoperate", frame={"time": now, "seen": self._seen, "right": hand})
            due = max(due + 1.0 / RATE, now)
            await asyncio.sleep(max(0.0, due - time.monotonic()))


async def teleoperate_for(url: str, seconds: float) -> Page:
    """Open a page, and move an arm from there."""
    origin = {"Origin": url.rstrip("/")}
    async with aiohttp.ClientSession() as session, session.ws_connect(f"{url}ws", headers=origin) as socket:
        page = Page(socket)
        reading = asyncio.create_task(page.read())
        await page.teleoperate_for(seconds)
        await socket.close()
        await reading
    return page


def cycles_without(folder: Path, seconds: float) -> tuple[int, int]:
    with recorded_driver(folder, None) as driver:
        before = missed(driver)
        move_for(driver, seconds)
        after = missed(driver)
    return after[0] - before[0], after[1] - before[1]


def cycles_with(folder: Path, seconds: float) -> tuple[int, int]:
    record = folder / "record.mcap"
    with (
        recorded_driver(folder, record) as driver,
        CommandProcess("yumi view", "yumi", ("view", "--port", "0"), folder / "view.log") as view,
    ):
        url = view.wait_until_ready(60.0)
        before = missed(driver)
        page = asyncio.run(teleoperate_for(url, seconds))
        after = missed(driver)
    assert page.states > 25.0 * seconds  # thirty a second
    assert page.engaged > 0.7 * seconds * RATE
    assert sum(topic == "r/cycle" for topic, _, _ in recorded_messages(record)) > 200.0 * seconds
    return after[0] - before[0], after[1] - before[1]


@pytest.mark.alone
@pytest.mark.parametrize("seconds", [short(5.0, pytest.mark.real_time, pytest.mark.timeout(240)), long(60.0, 600.0)])
def test_control_loop_misses_no_more_cycles_while_a_page_teleoperates_and_all_is_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seconds: float
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    without, cycles = cycles_without(tmp_path, seconds)
    beside, cycles_beside = cycles_with(tmp_path, seconds)
    tell(
        f"Cycles missed while an arm moves: {without} of {cycles} by a program; "
        f"{beside} of {cycles_beside} by a page that teleoperates, with a recording."
    )
    assert beside / cycles_beside <= without / cycles + 1e-3
