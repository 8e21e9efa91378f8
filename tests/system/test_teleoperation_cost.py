"""What teleoperation from a page, with a recording, costs the control loop: missed cycles, against none of the three."""

from __future__ import annotations

import asyncio
import json
import time
from math import sin
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from abb_runtime.process.command import Command
from soak import long, short, tell
from system.test_teleoperation_measured import RATE, ROOM, recorded_driver
from yumi.api.attach import RunningDriver
from yumi.recording.reader import recorded_messages

AWAY = (1.244, -1.222, -1.518, 0.733, -0.371, 0.192, 0.297)  # [rad]
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


async def teleoperate_for(url: str, seconds: float) -> tuple[float, int]:
    """Move the right arm from a page as a stick does; how many states a second came, and for how many frames it moved."""
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(f"{url}ws", headers={"Origin": url.rstrip("/")}) as socket,
    ):
        states, engaged, seen = 0, 0, asyncio.get_running_loop().create_future()

        async def send(**message: Any) -> None:
            await socket.send_str(json.dumps(message))

        async def read() -> None:
            nonlocal states, engaged, seen
            async for received in socket:
                message = json.loads(received.data)
                if message["type"] == "state":
                    states += 1
                    await send(type="seen")
                    newest.append(message["time"])
                elif message["type"] == "view" and message["control"] == "here" and not seen.done():
                    seen.set_result(None)
                elif message["type"] == "teleoperated":
                    engaged += message["arms"].get("right", {}).get("clutch") == "engaged"

        newest: list[float] = []
        reading = asyncio.create_task(read())
        while not newest:
            await asyncio.sleep(0.01)
        await send(type="take_control")
        await asyncio.wait_for(seen, 10.0)
        states, begin, due = 0, time.monotonic(), time.monotonic()
        while (now := time.monotonic()) - begin < seconds:
            twist = [0.0, 0.0, SPEED * sin(4.0 * now), 0.0, 0.0, 0.0]
            hand = {"clutch": now - begin > 0.2, "twist": twist}
            await send(type="teleoperate", frame={"time": now, "seen": newest[-1], "right": hand})
            due = max(due + 1.0 / RATE, now)
            await asyncio.sleep(max(0.0, due - time.monotonic()))
        rate = states / (time.monotonic() - begin)
        await socket.close()
        await reading
        return rate, engaged


def cycles_without(folder: Path, seconds: float) -> tuple[int, int]:
    with recorded_driver(folder, None) as driver:
        before = missed(driver)
        move_for(driver, seconds)
        after = missed(driver)
    return after[0] - before[0], after[1] - before[1]


def cycles_with(folder: Path, seconds: float) -> tuple[int, int]:
    record = folder / "record.mcap"
    with recorded_driver(folder, record) as driver, Command("yumi view", ("view", "--port", "0"), folder / "v.log") as view:
        url = view.wait_until_ready(60.0)
        before = missed(driver)
        rate, engaged = asyncio.run(teleoperate_for(url, seconds))
        after = missed(driver)
    assert rate > 25.0  # the page is open, and is shown the states
    assert engaged > 0.5 * seconds * RATE  # the arm is teleoperated
    assert sum(topic == "r/cycle" for topic, _, _ in recorded_messages(record)) > 200.0 * seconds
    return after[0] - before[0], after[1] - before[1]


@pytest.mark.alone
@pytest.mark.parametrize("seconds", [short(8.0, pytest.mark.real_time, pytest.mark.timeout(150)), long(60.0, 600.0)])
def test_control_loop_misses_no_more_cycles_while_a_page_teleoperates_and_all_is_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seconds: float
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    counts = {cycles_without: [0, 0], cycles_with: [0, 0]}
    for measured in (cycles_without, cycles_with, cycles_with, cycles_without):  # whatever else the machine does
        for index, count in enumerate(measured(tmp_path, seconds)):
            counts[measured][index] += count
    (without, cycles), (beside, cycles_beside) = counts.values()
    tell(
        f"Cycles missed while an arm moves: {without} of {cycles} by a program; "
        f"{beside} of {cycles_beside} by a page that teleoperates, with a recording."
    )
    assert beside / cycles_beside <= without / cycles + 1e-3
