"""Teleoperation through the server of ``yumi view``: frames of a page's device, and pages on other machines."""

from __future__ import annotations

import asyncio
import ssl
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from abb_protocols.robot.joints import Side
from abb_runtime.process.certificate import installation_certificate
from abb_view.page_server import FORWARDED
from fake_driver import FakeDriver
from unit.web.test_web_server import SOON, SPEEDS, Page, Site, eventually, on_page, run
from yumi.control.loop_commands import ControllerCommand
from yumi.control.trajectory_commands import CancelTrajectory
from yumi.driver.controller_names import CARTESIAN_CONTROLLER
from yumi.driver.teleoperated_arm import DEVICE_LINK_LOST
from yumi.driver.teleoperation import OPERATOR_HOLDS, Teleoperation
from yumi.web import view_server
from yumi.web.pairing import WRONG_PAIRING_CODES
from yumi.web.view_server import ViewServer, ViewSettings

RELEASED = {"clutch": False}
RATE = 60.0


@pytest.fixture(autouse=True)
def _a_folder_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeDriver]:
    """One that takes no link for lost by its own clock."""
    monkeypatch.setattr(Teleoperation, "lasts", lambda teleoperation: 60.0)
    driver = FakeDriver()
    driver.robot.control.on_command = driver.robot.rest
    driver.server.start()
    yield driver
    driver.server.stop()


def frame_at(time: float, hand: dict[str, Any], age: float = 0.0) -> dict[str, Any]:
    """A frame of the right hand that a page makes after a state that is so old [s] when the frame comes."""
    return {"time": time, "seen": time - age, "right": hand}


class Device:
    """The device of a page, whose frames come a sixtieth of a second after each other."""

    def __init__(self, driver: FakeDriver, page: Page) -> None:
        self._driver, self._page = driver, page

    async def send(self, hand: dict[str, Any], age: float = 0.0) -> Any:
        """A frame of the right hand, that was made after a state that is so old [s]; what became of it."""
        clock = self._driver.robot.clock
        clock.advance(1.0 / RATE)
        await self._page.send(type="teleoperate", frame=frame_at(clock.now(), hand, age))
        return await self._page.until("teleoperated", lambda message: message["time"] == clock.now())

    async def engage(self, hand: dict[str, Any]) -> None:
        assert (await self.send(RELEASED))["arms"]["right"]["clutch"] == "released"
        for _ in range(500):
            if (await self.send(hand))["arms"]["right"]["clutch"] == "engaged":
                return
        raise AssertionError("the clutch does not engage")


def at(x: float, **values: Any) -> dict[str, Any]:
    """A hand that holds the clutch."""
    return {"clutch": True, "pose": [x, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], **values}


def goal(driver: FakeDriver) -> Any:
    newest = driver.robot.tool_goals[Side.RIGHT].read()
    return None if newest is None else newest[1].pose


def brakes(driver: FakeDriver) -> list[ControllerCommand]:
    return [each for each in driver.robot.control.commands if isinstance(each.message, CancelTrajectory)]


def test_hand_of_a_page_leads_the_tool_and_its_end_brakes_the_arm(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            device = Device(driver, page)
            await device.engage(at(0.0))
            begin = goal(driver)
            for _ in range(60):
                await device.send(at(0.1))
            assert goal(driver)[0] - begin[0] == pytest.approx(0.1, abs=1e-3)
            assert driver.robot.control.switches[-1].activate == (CARTESIAN_CONTROLLER,)
            assert brakes(driver) == []
        await eventually(lambda: len(brakes(driver)) == 1)  # the page was closed

    run(story, may_operate=True)


def test_arm_brakes_when_another_page_takes_control_and_frames_are_refused_then(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page, site.page() as other:
            await page.take_control()
            device = Device(driver, page)
            await device.engage(at(0.0))
            await other.take_control()
            await eventually(lambda: len(brakes(driver)) == 1)
            refused = await device.send(at(0.2))
            assert (refused["error"]["code"], refused["arms"]) == ("control_not_taken", {})
            begin = goal(driver)
            driver.robot.clock.advance(OPERATOR_HOLDS)
            assert (await Device(driver, other).send(at(0.0)))["arms"]["right"]["clutch"] == "inert"
            assert goal(driver) == begin

    run(story, may_operate=True)


def test_page_gets_in_its_words_why_a_held_clutch_moves_nothing(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            arm = (await Device(driver, page).send(at(0.0)))["arms"]["right"]  # held already
            assert (arm["clutch"], arm["why"]["sentence"]) == ("inert", on_page("teleoperation_begins"))
            both = await Device(driver, page).send(at(0.0, twist=[0.0] * 6))
            assert (both["error"]["code"], both["arms"]) == ("device_motion_count", {})

    run(story, may_operate=True)


def test_page_whose_frames_are_too_old_when_they_come_moves_nothing(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            device = Device(driver, page)
            for hand in (RELEASED, at(0.0)):  # each of them has been on the way for as long
                report = await device.send(hand, age=DEVICE_LINK_LOST + 0.1)
            arm = report["arms"]["right"]
            assert (arm["clutch"], arm["why"]["code"], report["dropped"]) == ("inert", "teleoperation_link_slow", 2)
            assert goal(driver) is None
            await device.engage(at(0.0))  # the link is better

    run(story, may_operate=True)


def test_frame_of_a_page_without_the_time_of_a_state_is_refused(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await page.send(type="teleoperate", frame={"time": 1.0, "right": at(0.0)})
            assert "`seen`" in (await page.until("refused"))["sentence"]

    run(story, may_operate=True)


@pytest.mark.parametrize(
    ("held", "reach_the_driver"),
    [
        ([True, True, True, True], [4]),
        ([True, False, False, True], [3, 4]),  # else the arm would go to where the hand went with the clutch let go
        ([False, True, False, True], [1, 3, 4]),
    ],
)
def test_newest_frame_and_each_press_of_the_clutch_wait_while_the_driver_takes_a_frame(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch, held: list[bool], reach_the_driver: list[int]
) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            device = Device(driver, page)
            await device.engage(at(0.0))
            taken: list[float] = []
            teleoperation = driver.server._robot.teleoperation  # what the driver does with a frame
            take, may_go_on = teleoperation.take, threading.Event()

            def slowly(frame: Any, *asked: Any) -> Any:
                taken.append(frame.time)
                assert may_go_on.wait(SOON)
                return take(frame, *asked)

            monkeypatch.setattr(teleoperation, "take", slowly)
            first = driver.robot.clock.now()
            frames = [first + (1 + count) / RATE for count in range(5)]
            await page.send(type="teleoperate", frame=frame_at(frames[0], at(0.0)))
            await eventually(lambda: len(taken) == 1)
            for time, is_held in zip(frames[1:], held, strict=True):
                await page.send(type="teleoperate", frame=frame_at(time, {**at(0.0), "clutch": is_held}))
            assert (await pair(page, ""))["type"] == "failed"  # the server has read them all
            may_go_on.set()
            await page.until("teleoperated", lambda message: message["time"] == frames[-1])
            assert taken == [frames[number] for number in (0, *reach_the_driver)]

    run(story, may_operate=True)


class Elsewhere:
    """A server that other machines reach, as they do: every page is one of another machine."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.codes: list[str] = []
        self._folder = folder
        monkeypatch.setattr(view_server, "is_loopback", lambda host: False)
        monkeypatch.setattr(view_server, "is_of_this_machine", lambda request: False)

    def run(self, story: Callable[[Site], Any], *, is_encrypted: bool = True) -> None:
        asyncio.run(asyncio.wait_for(self._serve(story, is_encrypted), 4 * SOON))

    async def _serve(self, story: Callable[[Site], Any], is_encrypted: bool) -> None:
        tls = installation_certificate(["127.0.0.1"], "yumi-ros2", self._folder).context if is_encrypted else None
        view = ViewServer(ViewSettings(port=0, may_operate=True, token="secret", tls=tls, show_code=self.codes.append))
        await view.start()
        trusted = ssl.create_default_context(cafile=self._folder / "certificate.pem") if is_encrypted else True
        try:
            async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(ssl=trusted)) as session:
                site = Site(view, session)
                site.base = view.url.partition("/#")[0]
                await story(site)
        finally:
            await view.stop()


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Elsewhere:
    return Elsewhere(tmp_path / "state", monkeypatch)


async def refusal(page: Page) -> str:
    """Why a page may not take control."""
    await page.until("state")
    await page.send(type="take_control")
    return str((await page.until("refused"))["sentence"])


async def pair(page: Page, code: str) -> Any:
    await page.send(type="pair", id=9, code=code)
    while True:
        message = await page.receive()
        if message["type"] in {"done", "failed"}:
            return message


def test_page_on_another_machine_operates_a_real_robot_once_it_is_paired(
    driver: FakeDriver, elsewhere: Elsewhere
) -> None:
    async def story(site: Site) -> None:
        assert site.base.startswith("https://")
        async with site.page() as page:
            assert await refusal(page) == on_page("operated_once_paired")
            assert (await page.ask("start_egm"))["error"]["code"] == "operated_once_paired"
            await page.send(type="jog_joints", arm="right", hold=1, speeds=SPEEDS)
            assert (await page.until("jog_refused"))["error"]["code"] == "operated_once_paired"
            assert (await Device(driver, page).send(at(0.0)))["error"]["code"] == "operated_once_paired"
            paired = await pair(page, elsewhere.codes[-1])
            assert paired["type"] == "done"
            assert (await page.ask("start_egm"))["error"]["code"] == "operated_once_paired"  # it connects anew first
        key = paired["result"]["key"]
        async with site.page(key) as page, site.page() as other:
            view = await page.until("view")
            assert (view["why_not_operated"], view["may_pair"]) == ("", False)
            await page.take_control()
            await Device(driver, page).engage(at(0.0))
            # The key is of this session: another page needs a code of its own.
            assert await refusal(other) == on_page("operated_once_paired")
        assert len(elsewhere.codes) == 2
        async with site.page("guess") as page:
            assert await refusal(page) == on_page("operated_once_paired")

    elsewhere.run(story)


def test_every_page_stops_a_real_robot_that_may_be_operated(driver: FakeDriver, elsewhere: Elsewhere) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.until("view", lambda view: view["may_pair"] and view["may_stop"])
            assert (await page.ask("stop_egm"))["type"] == "done"
        assert driver.manager.asked == ["stop"]

    elsewhere.run(story)


def test_page_on_another_machine_is_not_paired_over_a_connection_that_is_not_encrypted(
    driver: FakeDriver, elsewhere: Elsewhere
) -> None:
    async def story(site: Site) -> None:
        assert elsewhere.codes == []
        async with site.page() as page:
            assert await refusal(page) == on_page("operated_elsewhere_over_https")
            assert (await pair(page, "000000"))["error"]["code"] == "pairing_not_needed"
            assert (await page.ask("stop_egm"))["type"] == "done"

    elsewhere.run(story, is_encrypted=False)


def test_codes_cannot_be_tried_one_after_another(driver: FakeDriver, elsewhere: Elsewhere) -> None:
    async def story(site: Site) -> None:
        first = elsewhere.codes[-1]
        wrong = "000000" if first != "000000" else "111111"
        refusals = []
        for _ in range(WRONG_PAIRING_CODES + 1):  # however often the page connects anew
            async with site.page() as page:
                await page.until("state")
                refusals.append((await pair(page, wrong))["error"]["code"])
        assert refusals == ["pairing_code_wrong"] * (WRONG_PAIRING_CODES - 1) + ["pairing_paused"] * 2
        async with site.page() as page:
            await page.until("state")
            assert (await pair(page, elsewhere.codes[-1]))["error"]["code"] == "pairing_paused"
        assert len(elsewhere.codes) == 2

    elsewhere.run(story)


@pytest.mark.parametrize("header", FORWARDED)
def test_page_behind_a_proxy_of_this_machine_is_one_of_another_machine(driver: FakeDriver, header: str) -> None:
    async def story(site: Site) -> None:
        async with site.page(**{header: "192.168.1.30"}) as page:
            assert await refusal(page) == on_page("operated_elsewhere_over_https")
            assert (await page.ask("start_egm"))["error"]["code"] == "operated_elsewhere_over_https"
            assert (await page.ask("stop_egm"))["type"] == "done"
        assert driver.manager.asked == ["stop"]

    run(story, may_operate=True)


def test_page_on_this_machine_needs_no_code(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            assert (await pair(page, "000000"))["error"]["code"] == "pairing_not_needed"

    run(story, may_operate=True)
