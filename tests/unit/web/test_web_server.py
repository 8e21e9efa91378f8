"""The server of ``yumi view`` as a page sees it: over real sockets, with a driver that notes what it is asked."""

from __future__ import annotations

import asyncio
import json
import platform
import threading
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Literal

import aiohttp
import pytest
from msgspec.structs import replace

from abb_protocols.catalogue import Message, sentence
from abb_protocols.catalogue import message as say
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import SettingsError
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.differential_kinematics import posture_near, wrist_of, wrist_target
from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, Pose, Side, home, rotate
from abb_protocols.robot.kinematics import (
    IDENTITY_QUATERNION,
    compose_poses,
    inverse_pose,
    quaternion_of,
    quaternion_product,
    tool0_to_body,
)
from abb_runtime.faults import Fault
from abb_view.page_server import MAX_PAGES
from fake_driver import BOX, FakeDriver
from refusals import refused
from yumi.control.controllers.joint_goal import StopMotion
from yumi.control.loop_commands import Commands
from yumi.control.loop_events import RobotFollows
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.shared_state import Snapshot
from yumi.control.trajectory_commands import FollowTrajectory
from yumi.core.collision import Obstacle
from yumi.driver import endpoint_server
from yumi.driver.controller_names import CARTESIAN_CONTROLLER, GOAL_CONTROLLER, JOG_CONTROLLER
from yumi.driver.endpoint import find_driver
from yumi.driver.motion_commands import Jog, JogTool
from yumi.driver.surroundings import Surroundings
from yumi.planning.planner import Plan
from yumi.planning.planning_process import PlanningProcess
from yumi.web import distances, live, page_operator, view_server
from yumi.web.distances import Distances
from yumi.web.driver_link import DriverLink
from yumi.web.page_messages import MAX_JOG_JOINT_SPEED, MAX_JOG_LINEAR, ToolJog
from yumi.web.page_operator import OLDEST_SEEN_STATE, within_joint_speed
from yumi.web.view_server import ViewServer, ViewSettings

SOON = 10.0
RECORDING = {"name": "x.mcap", "date": "2026-11-24 14:03", "arms": {}}
SPEEDS = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, -0.2]


@pytest.fixture(autouse=True)
def _a_folder_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


@pytest.fixture
def driver() -> Iterator[FakeDriver]:
    driver = FakeDriver()
    driver.server.start()
    yield driver
    driver.server.stop()


class Page:
    """A page by hand."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket
        self.seen = 0.0

    async def send(self, **message: Any) -> None:
        if message["type"].startswith("jog"):
            message = {"seen": self.seen, **message}
        await self.socket.send_str(json.dumps(message))

    async def until(self, kind: str, is_meant: Callable[[dict[str, Any]], bool] = lambda message: True) -> Any:
        """The next message of a kind that is meant."""
        while True:
            message = await self.receive()
            if message["type"] == kind and is_meant(message):
                return message

    async def receive(self) -> Any:
        message = json.loads(await asyncio.wait_for(self.socket.receive_str(), SOON))
        if message["type"] == "state":
            self.seen = message["time"]
            await self.send(type="seen")
        return message

    async def take_control(self) -> None:
        await self.until("state")
        await self.send(type="take_control")
        await self.until("view", lambda view: view["control"] == "here")

    async def ask(self, method: str, **values: Any) -> Any:
        await self.send(type="ask", id=7, request={"method": method, **values})
        while True:
            message = await self.receive()
            if message["type"] in {"done", "failed"}:
                assert message["id"] == 7
                return message


class Site:
    """The server and a client of it."""

    def __init__(self, server: ViewServer, session: aiohttp.ClientSession) -> None:
        self.server, self.session = server, session
        self.base = f"http://127.0.0.1:{server.port}"

    def connect(self, token: str = "secret", paired: str = "", **headers: str) -> Any:
        own = {"Origin": self.base, **headers}
        return self.session.ws_connect(f"{self.base}/ws?token={token}&paired={paired}", headers=own)

    @asynccontextmanager
    async def page(self, paired: str = "", **headers: str) -> AsyncIterator[Page]:
        async with self.connect(paired=paired, **headers) as socket:
            yield Page(socket)

    async def why_closed(self, token: str) -> str | None:
        """What a page is told that is not let in."""
        async with self.connect(token) as socket:
            end = await socket.receive(timeout=SOON)
            assert end.type is aiohttp.WSMsgType.CLOSE
            return end.extra

    async def status(self, path: str, **headers: str) -> int:
        async with self.session.get(f"{self.base}{path}", headers=headers, allow_redirects=False) as reply:
            return reply.status


def run(story: Callable[[Site], Coroutine[Any, Any, None]], **settings: Any) -> None:
    async def main() -> None:
        if settings.get("may_operate"):
            settings["token"] = "secret"
        site = ViewServer(ViewSettings(port=0, **settings))
        await site.start()
        try:
            async with aiohttp.ClientSession() as session:
                await story(Site(site, session))
        finally:
            await site.stop()

    asyncio.run(asyncio.wait_for(main(), 4 * SOON))


def on_page(code: str, **values: Any) -> str:
    """What a page of a real robot shows of a message."""
    return sentence(say(code, **values), FrontEnd.PAGE)


async def eventually(condition: Callable[[], object]) -> None:
    for _ in range(1000):
        if condition():
            return
        await asyncio.sleep(0.01)
    raise AssertionError("the condition did not come true")


def test_page_gets_its_files_the_robot_and_thirty_states_a_second(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        for path in (
            "/",
            "/static/app.js",
            "/static/style.css",
            "/static/LICENSE-three",
            "/model.json",
            "/meshes/torso.stl",
        ):
            assert await site.status(path) == 200
        async with site.page() as page:
            first = await page.until("state")
            assert first["state"]["robot"] == "192.168.125.1:80"
            last = first
            for _ in range(30):
                last = await page.until("state")
            assert 0.7 < last["state"]["time"] - first["state"]["time"] < 2.0

    run(story)


def test_page_that_is_slow_to_show_a_state_gets_every_line_of_the_log(driver: FakeDriver) -> None:
    happened = [RobotFollows(Side.RIGHT), RobotFollows(Side.LEFT)]

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.until("state")
            while json.loads(await page.socket.receive_str())["type"] != "state":
                continue  # and this one is not shown yet
            for event in happened:
                driver.server.note_event(event)
            await eventually(lambda: len(site.server._live.events) >= len(happened))
            state = site.server._live._state
            await eventually(lambda: site.server._live._state != state)  # a newer one waits for the page
            await page.send(type="seen")
            heard = []
            while len(heard) < len(happened):
                heard += [event["sentence"] for event in (await page.receive()).get("events", ())]
            assert heard == [str(event) for event in happened]

    run(story)


def test_page_says_why_there_is_no_robot_and_finds_it_when_it_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "_SEARCH", 0.05)
    driver = FakeDriver()

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.until("view", lambda view: view["why_no_robot"] == on_page("no_driver_runs"))
            await asyncio.to_thread(driver.server.start)
            await page.until("view", lambda view: not view["why_no_robot"])
            await page.until("state")
            await asyncio.to_thread(driver.server.stop)
            await page.until("view", lambda view: view["why_no_robot"])

    run(story)


def test_page_that_has_control_asks_for_nothing_but_a_stop_once_it_may_not_operate(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            site.server._live.why_not = Message("text", {"text": "The driver is gone."})
            assert (await page.ask("set_speed_scale", speed_scale=0.5))["error"]["sentence"] == "The driver is gone."
            assert (await page.ask("stop_egm"))["type"] == "done"

    run(story, may_operate=True)


def test_robot_is_looked_for_anew_after_no_page_was_open(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        for _ in range(2):
            async with site.page() as page:
                await page.until("state")
                site.server._live.is_virtual = True
            await eventually(lambda: site.server._live.why_not)
            assert not site.server._live.is_virtual

    run(story)


def test_foreign_pages_and_names_are_refused(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        assert await site.status("/", Host="evil.example") == 403
        assert await site.status("/", Origin="http://evil.example") == 403
        assert await site.status("/model.json", Origin="null") == 403
        assert await site.status("/", Host=f"localhost:{site.server.port}") == 200
        for headers in ({}, {"Origin": "http://evil.example"}, {"Origin": "http://127.0.0.1:1"}):
            with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
                await site.session.ws_connect(f"{site.base}/ws", headers=headers)
            assert refusal.value.status == 403

    run(story)


NO_TOKEN = "Open the page by the address with the token that `yumi view` printed."


def test_other_machines_need_the_token(driver: FakeDriver) -> None:
    with refused(SettingsError, "page_needs_token", host="0.0.0.0"):
        ViewSettings(host="0.0.0.0")

    async def story(site: Site) -> None:
        for token in ("", "wrong", "%FF%FE", "secret2"):
            assert await site.why_closed(token) == NO_TOKEN
        async with site.page() as page:
            await page.until("state")
        assert site.server.url == f"http://{platform.node()}:{site.server.port}/#token=secret"

    run(story, host="0.0.0.0", token="secret")


def test_page_that_may_operate_a_real_robot_needs_the_token_on_this_machine_too(driver: FakeDriver) -> None:
    with refused(SettingsError, "operating_page_needs_token"):
        ViewSettings(may_operate=True)

    async def story(site: Site) -> None:
        assert await site.why_closed("") == NO_TOKEN
        assert site.server.url.endswith("/#token=secret")

    run(story, may_operate=True)


def test_token_is_in_no_cookie_as_another_server_of_the_machine_would_get_it(driver: FakeDriver) -> None:
    """Who has the cookies of this host, and reads the page with them, has nothing to operate the robot with."""

    async def story(site: Site) -> None:
        cookie = {"Cookie": "yumi_view_token=secret; token=secret"}
        for path in ("/", "/?token=secret", "/static/app.js", "/model.json"):
            async with site.session.get(f"{site.base}{path}", headers=cookie) as reply:
                assert (reply.status, reply.headers.getall("Set-Cookie", [])) == (200, [])
                assert "secret" not in await reply.text()
        headers = {"Origin": site.base, **cookie}
        async with site.session.ws_connect(f"{site.base}/ws", headers=headers) as socket:
            assert (await socket.receive(timeout=SOON)).extra == NO_TOKEN

    run(story, may_operate=True)


@pytest.mark.parametrize("line", [b"Cookie: yumi_view_token=\xff\xfe", b"Host: \xff\xfe", b"Origin: \xff\xfe"])
@pytest.mark.parametrize("path", [b"/", b"/ws?token=\xff\xfe", b"/recording.json?token=%FF"])
def test_bytes_that_are_not_utf_8_are_no_login_and_no_error(driver: FakeDriver, path: bytes, line: bytes) -> None:
    async def story(site: Site) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", site.server.port)
        host = b"" if line.startswith(b"Host") else b"Host: 127.0.0.1\r\n"
        writer.write(b"GET " + path + b" HTTP/1.1\r\n" + host + line + b"\r\nConnection: close\r\n\r\n")
        status = int((await reader.readline()).split()[1])
        writer.close()
        assert status in ((200,) if path == b"/" and line.startswith(b"Cookie") else (400, 403))

    run(story, may_operate=True, recording=RECORDING)


@pytest.mark.parametrize("scheme", ["ftp", "HTTP", "ws"])
def test_origin_of_another_scheme_is_refused(driver: FakeDriver, scheme: str) -> None:
    async def story(site: Site) -> None:
        assert await site.status("/", Origin=f"{scheme}://127.0.0.1:{site.server.port}") == 403

    run(story)


def test_page_on_all_addresses_is_served_under_names_of_this_machine_only(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        port, name = site.server.port, platform.node()
        for host in ("127.0.0.1", "192.168.1.20", "[fe80::1]", "localhost", name, f"{name}.local", name.upper()):
            assert await site.status("/", Host=f"{host}:{port}") == 200, host
        for host in ("evil.example", f"evil-{name}", f"{name}-evil", f"evil.{name}", "1.2.3.4.evil.example", "", "["):
            assert await site.status("/", Host=f"{host}:{port}") == 403, host

    run(story, host="0.0.0.0", token="secret")


def test_real_robot_is_only_looked_at(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.until("state")
            await page.send(type="take_control")
            assert (await page.until("refused"))["sentence"] == on_page("page_only_shows")
            assert (await page.ask("start_egm"))["error"]["code"] == "page_only_shows"
            await page.send(type="jog_joints", arm="right", hold=1, speeds=SPEEDS)
            assert (await page.until("jog_refused"))["error"]["code"] == "page_only_shows"
        assert driver.manager.asked == []
        assert driver.robot.speeds[Side.RIGHT].read() is None

    run(story)


def test_real_robot_is_stopped_by_a_page_that_only_looks(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.until("view", lambda view: view["may_stop"] and view["why_not_operated"])
            assert (await page.ask("stop_egm"))["type"] == "done"
        assert driver.manager.asked == ["stop"]

    run(story)


@pytest.mark.parametrize(
    ("is_here", "takes_faults", "refusal"),
    [(True, True, ""), (True, False, "faults_only_virtual"), (False, True, "faults_only_here")],
)
def test_faults_of_a_virtual_robot_are_for_pages_of_this_machine_alone(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch, is_here: bool, takes_faults: bool, refusal: str
) -> None:
    """A controller that is not virtual any more is asked before each."""
    injected: list[str] = []

    def inject(address: str, name: str, form: dict[str, str]) -> Fault:
        injected.append(name)
        return Fault.MOTORS_OFF

    monkeypatch.setattr(page_operator, "inject_fault", inject)
    monkeypatch.setattr(page_operator, "takes_faults", lambda address: takes_faults)
    monkeypatch.setattr(live, "_is_virtual", lambda address: True)

    async def story(site: Site) -> None:
        async with site.page(**({} if is_here else {"Via": "1.1 a-proxy"})) as page:
            view = await page.until("view", lambda view: view["is_virtual"])
            assert [each["name"] for each in view["faults"]] == [each.value.name for each in Fault] * is_here
            elsewhere = sentence(say("faults_only_here"), FrontEnd.VIRTUAL_PAGE)
            assert view["why_no_faults"] == ("" if is_here else elsewhere)
            await page.take_control()
            await page.send(type="inject", id=3, name="motors-off")
            answer = await page.until("failed" if refusal else "done", lambda it: it["id"] == 3)
            assert injected == ([] if refusal else ["motors-off"])
            assert not refusal or answer["error"]["code"] == refusal

    run(story)


def test_page_loses_a_virtual_robot_once_a_real_one_answers_at_its_address(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = {"is_virtual": True}
    monkeypatch.setattr(live, "_is_virtual", lambda address: kinds["is_virtual"])

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.until("view", lambda view: view["is_virtual"])
            await page.take_control()
            kinds["is_virtual"] = False
            driver.manager.session_count += 1
            assert (await page.until("refused"))["sentence"] == on_page("page_only_shows")
            view = await page.until("view", lambda view: view["control"] == "none")
            assert (view["is_virtual"], view["faults"]) == (False, [])
            assert (await page.ask("start_egm"))["error"]["code"] == "page_only_shows"
            assert driver.manager.asked == []
            kinds["is_virtual"] = True
            driver.manager.session_count += 1
            await page.until("view", lambda view: view["is_virtual"])

    run(story)


def test_page_that_comes_while_it_is_asked_whether_the_robot_is_virtual_hears_that_it_still_is(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    is_asked, is_answered = threading.Event(), threading.Event()

    def is_virtual(address: str) -> bool:
        if driver.manager.session_count > 1:
            is_asked.set()
            assert is_answered.wait(SOON)
        return True

    monkeypatch.setattr(live, "_is_virtual", is_virtual)

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.until("view", lambda view: view["is_virtual"])
            driver.manager.session_count += 1
            await eventually(is_asked.is_set)
            async with site.page() as other:
                assert not (await other.until("view"))["is_virtual"]
                is_answered.set()
                await other.until("view", lambda view: view["is_virtual"])
                await other.take_control()

    run(story)


def test_page_that_has_control_operates_and_another_one_does_not(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page, site.page() as other:
            await other.until("state")
            assert (await page.ask("set_speed_scale", speed_scale=0.5))["error"]["code"] == "control_not_taken"
            await page.take_control()
            assert (await page.ask("set_speed_scale", speed_scale=0.5))["type"] == "done"
            assert driver.manager.speed.value == 0.5
            assert (await page.ask("grip", arm="left", action="close", force=8.0))["result"]["outcome"] == "holding"
            opened = await page.ask("grip", arm="left", action="open", force=8.0)
            assert opened["error"]["code"] == "force_while_opening"
            await other.until("view", lambda view: view["control"] == "elsewhere")
            assert (await other.ask("start_egm"))["error"]["code"] == "control_not_taken"
            assert (await other.ask("stop_egm"))["type"] == "done"  # a stop is for every page
            await page.send(type="inject", id=3, name="emergency-stop")
            failed = await page.until("failed")
            assert failed["error"]["code"] == "faults_only_virtual"
            await page.send(type="give_back")
            await page.until("view", lambda view: view["control"] == "none")

    run(story, may_operate=True)


@pytest.mark.parametrize("way", ["closes", "is replaced", "gives back"])
def test_motion_of_a_page_ends_when_it_loses_control(driver: FakeDriver, way: str) -> None:
    async def story(site: Site) -> None:
        async with site.page() as other:
            async with site.page() as page:
                await page.take_control()
                await page.send(type="ask", id=1, request={"method": "move", "right": "home"})
                await eventually(lambda: driver.robot.control.commands)
                driver.robot.control.on_command = driver.robot.rest
                if way == "is replaced":
                    await other.take_control()
                    assert (await page.until("refused"))["sentence"] == on_page("control_taken_by_other")
                elif way == "gives back":
                    await page.send(type="give_back")
                if way != "closes":
                    await eventually(lambda: isinstance(driver.robot.control.commands[-1].message, StopMotion))
            await eventually(lambda: isinstance(driver.robot.control.commands[-1].message, StopMotion))

    run(story, may_operate=True)


async def held(page: Page, condition: Callable[[], object], **jog: Any) -> None:
    """A key is held until the condition is true: the first message only takes the arm over."""
    for _ in range(300):
        await page.send(arm="right", **jog)
        if condition():
            return
        await page.until("state")  # thirty times a second
    raise AssertionError("the condition did not come true")


def speeds_of(driver: FakeDriver, side: Side = Side.RIGHT) -> Any:
    newest = driver.robot.speeds[side].read()
    return None if newest is None else newest[1].velocity


def twist_of(driver: FakeDriver, side: Side = Side.RIGHT) -> Any:
    newest = driver.robot.tool_goals[side].read()
    return None if newest is None else newest[1].twist


@pytest.mark.parametrize("is_given_back", [True, False])
def test_jog_reaches_the_arm_and_ends_with_the_key_and_with_control(driver: FakeDriver, is_given_back: bool) -> None:
    driver.robot.control.on_command = driver.robot.rest  # it is taken over from standstill

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await held(page, lambda: speeds_of(driver) == tuple(SPEEDS), type="jog_joints", hold=1, speeds=SPEEDS)
            assert driver.robot.control.switches[-1].activate == (JOG_CONTROLLER,)
            await page.send(type="jog_joints", arm="right", hold=1, speeds=[0.0] * 7)
            await eventually(lambda: speeds_of(driver) == ZERO_JOINTS)
            up = [0.0, 0.0, 0.1]
            await held(page, lambda: twist_of(driver) == (*up, 0.0, 0.0, 0.0, 0.0), type="jog_tool", hold=2, linear=up)
            assert driver.robot.control.switches[-1].activate == (CARTESIAN_CONTROLLER,)
            if is_given_back:  # the arm stops, and follows again what it followed before
                await page.send(type="give_back")
                await eventually(lambda: driver.robot.control.switches[-1].activate == (GOAL_CONTROLLER,))
        # The page is closed: the arm stops, and holds.
        await eventually(lambda: twist_of(driver) == ZERO_JOINTS)
        await eventually(lambda: not driver.server.client_count)
        last = GOAL_CONTROLLER if is_given_back else CARTESIAN_CONTROLLER
        assert driver.robot.control.switches[-1].activate == (last,)

    run(story, may_operate=True)


NESTED_TOO_DEEPLY = on_page("request_not_understood", why=say("request_nested_too_deeply"))


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ({"type": "jog_joints", "arm": "right", "hold": 1, "speeds": [5.0, 0, 0, 0, 0, 0, 0]}, "<= 0.5"),
        ({"type": "jog_joints", "arm": "right", "hold": 1, "speeds": [0.1]}, "length 7"),
        ({"type": "jog_tool", "arm": "head", "hold": 1}, "Invalid enum value 'head'"),
        ({"type": "ask", "id": 1, "request": {"method": "shutdown"}}, "Invalid value 'shutdown'"),
        (
            {"type": "ask", "id": 1, "request": {"method": "jog", "arm": "right", "speeds": [5.0, 0, 0, 0, 0, 0, 0]}},
            "Invalid value 'jog'",
        ),
        ({"type": "open_door"}, "Invalid value 'open_door'"),
        ('{"type": ' + "[" * 16_000, NESTED_TOO_DEEPLY),
        ('{"x":' * 3000, NESTED_TOO_DEEPLY),
    ],
)
def test_message_that_means_nothing_is_refused_and_changes_nothing(
    driver: FakeDriver, message: dict[str, Any] | str, words: str
) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await (page.socket.send_str(message) if isinstance(message, str) else page.send(**message))
            assert words in (await page.until("refused"))["sentence"]
        assert speeds_of(driver) is None

    run(story, may_operate=True)


def test_plan_is_shown_and_then_followed_once(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    start = {side: home(side) for side in Side}
    goal = (start[Side.RIGHT][0] + 0.2, *start[Side.RIGHT][1:])
    points = tuple(
        TrajectoryPoint(time, position, ZERO_JOINTS, ZERO_JOINTS)
        for time, position in ((0.0, start[Side.RIGHT]), (1.0, goal))
    )

    async def plan(self: object, begin: Any, goals: Any, *, obstacles: tuple[Obstacle, ...], **options: Any) -> Plan:
        assert [box.name for box in obstacles] == ["table"]
        assert options["limits"] == YUMI_LIMITS
        assert (begin, goals) == (start, {Side.RIGHT: goal})
        return Plan(start, {Side.RIGHT: points}, 1.0, 0.5, 0.02)

    monkeypatch.setattr(PlanningProcess, "plan", plan)
    driver.robot.control.on_command = driver.robot.rest

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.until("state")
            await page.send(type="plan", id=1, right={"j1": goal[0]})
            assert (await page.until("failed"))["error"]["code"] == "control_not_taken"
            await page.take_control()
            await page.send(type="plan", id=2, right={"j1": goal[0]})
            result = (await page.until("done"))["result"]
            assert (result["duration"], result["clearance"]) == (1.0, 0.02)
            assert [time for time, _ in result["arms"]["right"]] == [0.0, 1.0]
            assert not driver.robot.control.commands
            for _ in range(2):
                await page.send(type="execute", id=3, plan=result["plan"])
            assert (await page.until("failed"))["error"]["code"] == "plan_is_old"
            await eventually(lambda: driver.robot.control.commands)
            await eventually(lambda: isinstance(driver.robot.control.commands[-1].message, FollowTrajectory))
            await page.send(type="plan", id=4, right=[0.4, 0.0, 0.3], is_pose=True)
            assert (await page.until("failed"))["error"]["code"] == "no_pose_of_fingertips"

    run(story, may_operate=True)


def test_plan_needs_to_know_where_both_arms_are(driver: FakeDriver) -> None:
    driver.robot.control.snapshots[Side.LEFT] = Snapshot()

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await page.send(type="plan", id=2, right="home")
            unknown = on_page("plan_without_position", arm="left")
            assert (await page.until("failed"))["error"]["sentence"] == unknown

    run(story, may_operate=True)


def test_page_is_shown_boxes_and_the_parts_that_are_nearest(driver: FakeDriver) -> None:
    folded = (-0.2, 0.5, -0.3, 0.4, 0.0, 0.3, 0.0)
    at_box = driver.robot.control.snapshots[Side.RIGHT]._replace(position=folded)
    driver.robot.control.snapshots[Side.RIGHT] = at_box
    expected = Distances(Surroundings(boxes=(BOX,))).nearest({Side.RIGHT: folded, Side.LEFT: home(Side.LEFT)})
    assert expected is not None

    async def story(site: Site) -> None:
        async with site.page() as page:
            view = await page.until("view", lambda view: not view["why_no_robot"])
            assert view["surroundings"]["boxes"][0]["name"] == "table"
            nearest = (await page.until("state"))["nearest"]
            assert (nearest["part"], nearest["other"]) == (expected.part, expected.other)
            assert nearest["distance"] == pytest.approx(expected.distance)

    run(story)


def test_page_is_shown_what_an_arm_is_kept_apart_from_instead_of_the_nearest_pair(driver: FakeDriver) -> None:
    pair = ("right gripper", "body")
    limited = dict(zip(("limited_part", "limited_other", "limited_distance"), (*pair, 0.011), strict=True))
    near_body = (0.28, -2.47, -2.45, 0.54, 0.45, 0.73, -0.17)
    snapshots = driver.robot.control.snapshots
    snapshots[Side.RIGHT] = snapshots[Side.RIGHT]._replace(position=near_body, **limited)

    async def story(site: Site) -> None:
        async with site.page() as page:
            message = await page.until("state")
            shown = message["state"]["arms"]["right"]["limited"]
            assert (shown["part"], shown["other"], shown["distance"]) == (*pair, 0.011)
            assert message["state"]["arms"]["left"]["limited"] is None
            assert (message["nearest"]["part"], message["nearest"]["other"]) == pair

    run(story)


def test_parts_that_limit_an_arm_in_turn_are_not_shown_in_turn(driver: FakeDriver) -> None:
    snapshots = driver.robot.control.snapshots

    def limit(part: str) -> None:
        limited = dict(zip(("limited_part", "limited_other", "limited_distance"), (part, "body", 0.011), strict=True))
        snapshots[Side.RIGHT] = snapshots[Side.RIGHT]._replace(**limited)

    async def story(site: Site) -> None:
        limit("right gripper")
        async with site.page() as page:
            begin = time.monotonic()
            seen, shown = set(), set()
            while len(seen) < 2 or time.monotonic() < begin + 2 * distances._SHOWN_FOR:
                message = await page.until("state")
                seen.add(message["state"]["arms"]["right"]["limited"]["part"])
                shown.add(message["limited"]["right"]["part"])
                limit(
                    "right wrist"
                    if message["state"]["arms"]["right"]["limited"]["part"] == "right gripper"
                    else "right gripper"
                )
            assert len(shown) == 1
            other = ({"right wrist", "right gripper"} - shown).pop()
            limit(other)  # from now on this one alone
            while message["limited"]["right"]["part"] != other:
                message = await page.until("state")

    run(story)


def test_jog_ends_when_the_page_sends_no_more(driver: FakeDriver) -> None:
    driver.robot.control.on_command = driver.robot.rest

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await held(page, lambda: speeds_of(driver) == tuple(SPEEDS), type="jog_joints", hold=1, speeds=SPEEDS)
            begin = time.monotonic()
            await eventually(lambda: speeds_of(driver) == ZERO_JOINTS)  # whatever timeout the controller has
            assert time.monotonic() - begin < 0.5

    run(story, may_operate=True)


@pytest.mark.parametrize("frame", ["base", "tool"])
def test_tool_is_jogged_no_faster_than_its_joints_may_be(frame: Literal["base", "tool"]) -> None:
    stretched, step, slowed = (0.3, -0.9, -1.4, -1.0, 0.2, 0.4, 0.1), 1e-3, []
    for direction in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (0.6, 0.0, 0.8)):
        x, y, z = (MAX_JOG_LINEAR * each for each in direction)
        asked = ToolJog(arm="right", hold=1, seen=0.0, frame=frame, linear=(x, y, z), angular=(0.0, 0.0, 0.2))
        jog = within_joint_speed(asked, stretched)
        share = jog.angular[2] / asked.angular[2]
        assert jog.linear == pytest.approx((share * x, share * y, share * z))  # the same direction
        assert jog == replace(asked, linear=jog.linear, angular=(0.0, 0.0, jog.angular[2]))
        # Where the arm is a moment later, by another calculation.
        here = tool0_to_body(Side.RIGHT, stretched, FINGERTIPS)
        turn = here.orientation if frame == "tool" else IDENTITY_QUATERNION
        linear, angular = rotate(turn, jog.linear), rotate(turn, jog.angular)
        place = [at + step * speed for at, speed in zip(here.position, linear, strict=True)]
        after = Pose((place[0], place[1], place[2]), quaternion_product(quaternion_of(angular, step), here.orientation))
        angle = wrist_of(Side.RIGHT, stretched).angle
        target = wrist_target(Side.RIGHT, compose_poses(after, inverse_pose(FINGERTIPS)), angle)
        there, error = posture_near(Side.RIGHT, target, stretched)
        assert error < 1e-9
        fastest = max(abs(b - a) for a, b in zip(stretched, there, strict=True)) / step
        assert (
            fastest == pytest.approx(MAX_JOG_JOINT_SPEED, rel=0.02) if share < 1.0 else fastest <= MAX_JOG_JOINT_SPEED
        )
        slowed.append(share < 1.0)
    assert any(slowed)


def test_jog_that_comes_late_is_refused_and_its_end_is_not(driver: FakeDriver) -> None:
    driver.robot.control.on_command = driver.robot.rest

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await held(page, lambda: speeds_of(driver) == tuple(SPEEDS), type="jog_joints", hold=1, speeds=SPEEDS)
            late = time.monotonic() - OLDEST_SEEN_STATE - 0.1  # as if what was sent had waited in a tunnel
            await page.send(type="jog_joints", arm="right", hold=2, seen=late, speeds=[0.5] * 7)
            late_jog = await page.until("jog_refused", lambda it: it["hold"] == 2)
            assert late_jog["error"]["code"] == "page_too_slow_to_jog"
            await page.send(type="jog_joints", arm="right", hold=1, seen=late, speeds=[0.0] * 7)
            await eventually(lambda: speeds_of(driver) == ZERO_JOINTS)

    run(story, may_operate=True)


def test_driver_is_told_when_a_jog_came(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    """So that no jog moves the arm that has waited on the way to the driver, or in it."""
    driver.robot.control.on_command = driver.robot.rest
    asked: list[Jog | JogTool] = []
    ask = DriverLink.ask

    async def noted(link: DriverLink, command: Any, *reports: Any) -> Any:
        asked.extend([command] if isinstance(command, Jog | JogTool) else [])
        return await ask(link, command, *reports)

    monkeypatch.setattr(DriverLink, "ask", noted)
    up = [0.0, 0.0, 0.02]

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            begin = time.monotonic()
            await held(page, lambda: speeds_of(driver) == tuple(SPEEDS), type="jog_joints", hold=1, speeds=SPEEDS)
            await held(page, lambda: twist_of(driver) == (*up, 0.0, 0.0, 0.0, 0.0), type="jog_tool", hold=2, linear=up)
            times = [each.time for each in asked]
            assert {type(each) for each in asked} == {Jog, JogTool}
            assert all(at is not None and begin <= at <= time.monotonic() for at in times)
            assert len(set(times)) == len(times)

    run(story, may_operate=True)


def test_end_of_a_jog_is_carried_out_however_long_it_waited(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver.robot.control.on_command = driver.robot.rest
    up = [0.0, 0.0, 0.02]

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await held(page, lambda: twist_of(driver) == (*up, 0.0, 0.0, 0.0, 0.0), type="jog_tool", hold=1, linear=up)
            monkeypatch.setattr(page_operator, "STALE_JOG", -1.0)  # what waits has always waited for too long
            await page.send(type="jog_tool", arm="right", hold=1)
            await eventually(lambda: twist_of(driver) == ZERO_JOINTS)

    run(story, may_operate=True)


def test_next_page_gives_back_what_a_page_that_was_closed_has_jogged(driver: FakeDriver) -> None:
    driver.robot.control.on_command = driver.robot.rest

    async def story(site: Site) -> None:
        async with site.page() as other:
            async with site.page() as page:
                await page.take_control()
                await held(page, lambda: speeds_of(driver) == tuple(SPEEDS), type="jog_joints", hold=1, speeds=SPEEDS)
            await eventually(lambda: speeds_of(driver) == ZERO_JOINTS)
            assert driver.robot.control.switches[-1].activate == (JOG_CONTROLLER,)
            await other.take_control()
            await other.send(type="give_back")
            await eventually(lambda: driver.robot.control.switches[-1].activate == (GOAL_CONTROLLER,))

    run(story, may_operate=True)


def test_arm_follows_its_own_tool_controller_again_after_its_joints_were_jogged(driver: FakeDriver) -> None:
    control = driver.robot.control
    control.on_command = driver.robot.rest
    control.call(Commands.switch_controllers, Side.RIGHT, (CARTESIAN_CONTROLLER,), (GOAL_CONTROLLER,))

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await held(page, lambda: speeds_of(driver) == tuple(SPEEDS), type="jog_joints", hold=1, speeds=SPEEDS)
            await page.send(type="give_back")
            await eventually(lambda: control.switches[-1].activate == (CARTESIAN_CONTROLLER,))

    run(story, may_operate=True)


def test_nothing_is_given_back_of_what_was_jogged_before_all_pages_were_closed(driver: FakeDriver) -> None:
    driver.robot.control.on_command = driver.robot.rest

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await held(page, lambda: speeds_of(driver) == tuple(SPEEDS), type="jog_joints", hold=1, speeds=SPEEDS)
        await eventually(lambda: not driver.server.client_count)
        async with site.page() as page:
            await page.take_control()
            await page.send(type="give_back")
            await eventually(lambda: site.server._giving_back is not None and site.server._giving_back.done())
        assert driver.robot.control.switches[-1].activate == (JOG_CONTROLLER,)

    run(story, may_operate=True)


def test_egm_is_stopped_while_control_is_given_back_which_ends_then(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "_STAND", 1000.0)
    control = driver.robot.control
    control.on_command = driver.robot.rest

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await held(page, lambda: speeds_of(driver) == tuple(SPEEDS), type="jog_joints", hold=1, speeds=SPEEDS)
            moving = control.snapshots[Side.RIGHT]._replace(velocity=tuple(SPEEDS))
            control.snapshots[Side.RIGHT] = moving
            await page.send(type="give_back")
            await page.until("view", lambda view: view["control"] == "none")
            assert (await page.ask("stop_egm"))["type"] == "done"
            await eventually(lambda: site.server._giving_back is not None and site.server._giving_back.cancelled())
        assert driver.manager.asked == ["stop"]
        assert control.switches[-1].activate == (JOG_CONTROLLER,)

    run(story, may_operate=True)


def test_page_loses_control_with_its_driver_and_stops_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "_SEARCH", 0.05)
    driver, following = FakeDriver(), FakeDriver()
    driver.server.start()

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await asyncio.to_thread(driver.server.stop)
            assert (await page.until("refused"))["sentence"] == on_page("driver_has_ended")
            await page.until("view", lambda view: view["control"] == "none")
            await asyncio.to_thread(following.server.start)
            try:
                await page.until("view", lambda view: not view["why_no_robot"])
                assert (await page.ask("stop_egm"))["type"] == "done"
                await page.take_control()
                assert (await page.ask("set_speed_scale", speed_scale=0.5))["type"] == "done"
            finally:
                await asyncio.to_thread(following.server.stop)
        assert (driver.manager.asked, following.manager.asked) == ([], ["stop"])
        assert following.manager.speed.value == 0.5

    run(story, may_operate=True)


def test_page_that_shows_nothing_gets_no_more_states_and_loses_control(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(view_server, "_ANSWER", 0.3)

    async def story(site: Site) -> None:
        async with site.page() as page, site.page() as other:
            await page.take_control()
            states = 0
            while True:
                message = json.loads(await asyncio.wait_for(page.socket.receive_str(), SOON))  # is not answered
                states += message["type"] == "state"
                if message["type"] == "refused":
                    break
            assert message["sentence"] == on_page("page_was_silent")
            assert states <= 1
            await other.until("view", lambda view: view["control"] == "none")

    run(story, may_operate=True)


def test_page_that_has_control_may_ask_for_nothing_for_long(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(endpoint_server, "FIRST_REQUEST", 1.0)

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            silent, writer = await asyncio.open_unix_connection(find_driver(""))
            told = json.loads(await silent.read())  # and so would it be for the page's connection
            assert told["error"]["said"]["code"] == "silent_client"
            writer.close()
            assert (await page.ask("set_speed_scale", speed_scale=0.5))["type"] == "done"

    run(story, may_operate=True)


def test_jog_of_an_arm_without_egm_is_refused_once_for_each_hold(driver: FakeDriver) -> None:
    for side in Side:
        driver.robot.control.snapshots[side] = driver.robot.control.snapshots[side].__class__()

    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            await page.send(type="jog_joints", arm="right", hold=1, speeds=SPEEDS)
            jog = await page.until("jog_refused")
            no_egm = on_page("goal_refused", reason=say("arm_without_egm", arm="right"))
            assert jog["error"]["sentence"] == no_egm
            await page.send(type="jog_joints", arm="right", hold=1, speeds=SPEEDS)
            await page.until("state")
            await page.send(type="jog_joints", arm="right", hold=2, speeds=SPEEDS)
            assert (await page.until("jog_refused"))["hold"] == 2

    run(story, may_operate=True)


def test_egm_is_stopped_however_much_a_page_has_asked_for(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    async def story(site: Site) -> None:
        async with site.page() as page:
            await page.take_control()
            monkeypatch.setattr(endpoint_server, "MAX_PENDING", 0)
            asked = await page.ask("set_speed_scale", speed_scale=0.5)
            assert asked["error"]["code"] == "too_many_requests"
            assert (await page.ask("stop_egm"))["type"] == "done"

    run(story, may_operate=True)


def test_too_many_pages_are_refused(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        sockets = [await site.connect() for _ in range(MAX_PAGES)]
        assert await site.why_closed("") == f"{MAX_PAGES} pages are open already; close one."
        for socket in sockets:
            await socket.close()

    run(story)


def test_programs_without_the_token_take_no_place_of_a_page(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        others = [await site.connect(token) for token in ("", "wrong") for _ in range(MAX_PAGES)]  # they do not close
        async with site.page() as page:
            await page.take_control()
        for other in others:
            await other.close()

    run(story, may_operate=True)


def test_recording_is_served_and_nothing_is_operated() -> None:
    async def story(site: Site) -> None:
        assert await site.status("/recording.json") == await site.status("/recording.json?token=wrong") == 403
        async with site.session.get(f"{site.base}/recording.json?token=secret") as reply:
            assert await reply.json() == RECORDING
        async with site.page() as page:
            view = await page.until("view")
            assert view["is_recording"]
            assert view["recording"] == {"name": "x.mcap", "date": "2026-11-24 14:03"}
            await page.send(type="take_control")
            assert (await page.until("refused"))["sentence"] == on_page("is_a_recording")

    run(story, recording=RECORDING, may_operate=True)


def test_port_that_is_taken_is_refused(driver: FakeDriver) -> None:
    async def story(site: Site) -> None:
        second = ViewServer(ViewSettings(port=site.server.port))
        with refused(SettingsError, "port_cannot_be_opened", port=site.server.port, host="127.0.0.1"):
            await second.start()

    run(story)
