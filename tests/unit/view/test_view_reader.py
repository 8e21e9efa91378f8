"""A controller as its page reads and draws it: virtual ones in memory and in virtual time."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import aiohttp
import httpx
import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from abb_protocols.catalogue import Message
from abb_protocols.catalogue import message as say
from abb_protocols.errors import ControllerRefused
from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.irb120 import irb120
from abb_protocols.robot.joints import Joints, Side, home
from abb_protocols.robot.kinematics import matrix_from_quaternion
from abb_protocols.robot.yumi_arms import irb14050
from abb_runtime.clock import ManualClock
from abb_runtime.faults import DISPLAY_PATH, Fault
from abb_runtime.rws.client import RwsClient
from abb_view import controller_server, controller_view, page_server
from abb_view.controller_reader import LINES_AROUND, ControllerReader, LogLine, PointerReport, ReaderUnit
from abb_view.controller_server import ControllerServer
from abb_view.controller_view import ControllerView
from abb_view.page_server import FORWARDED, OpenPage, PageSettings
from abb_view.robot_model import capsule_model, controller_model
from memory_http import MemoryHttp
from virtual_irc5.controller.installed_system import ROBOTS, factory_system, with_programs
from virtual_irc5.world import World, WorldSettings
from yumi.web.view_only import why_view_only

PROGRAM = """MODULE Cell
    CONST jointtarget there:=[[20,10,5,10,20,30],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PROC main()
        TPWrite "begins";
        approach;
        ErrWrite \\W, "Box is late", "It came after 3 s.";
        WaitTime 100;
    ENDPROC
    PROC approach()
        MoveAbsJ there, v100, fine, tool0;
    ENDPROC
ENDMODULE
"""
LATER = PROGRAM.replace("    PROC main()", "    ! a line more\n    PROC main()")


class Transport(MemoryHttp):
    """Counts requests, and refuses those of some paths.

    Attributes:
        asked: requests by method and path.
        refused: paths that the controller does not have.
    """

    def __init__(self, world: World, clock: ManualClock) -> None:
        super().__init__(world.controller, clock)
        self.asked: Counter[tuple[str, str]] = Counter()
        self.refused: set[str] = set()

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        self.asked[request.method, request.url.path] += 1
        if request.url.path in self.refused:
            request = httpx.Request("GET", "http://memory/rw/nothing", headers=request.headers)
        return super().handle_request(request)


class Cell(ManualClock):
    """A virtual controller and what reads it, on one clock."""

    def __init__(
        self, robot: str, folder: Path, *, is_own: bool = True, options: tuple[str, ...] | None = None
    ) -> None:
        super().__init__()
        file = folder / "cell.mod"
        file.write_text(PROGRAM, encoding="ascii")
        task = "T_ROB1" if robot != "yumi" else "T_ROB_L"
        system = with_programs(factory_system(ROBOTS[robot]), {task: [file]})
        self.world = World(WorldSettings(system=system))
        if options is not None:
            self.world.controller.identity = replace(self.world.controller.identity, options=options)
        self.rws = Transport(self.world, self)
        if not is_own:  # as a real one, or RobotStudio's
            self.rws.refused.add(DISPLAY_PATH)
        self.client = RwsClient(self.rws, clock=self)
        self.client.connect()
        self.reader = ControllerReader(self.client, self)
        self.reader.why_view_only = why_view_only(self.reader, say("driver_has_ended"))
        self.lines: list[LogLine] = []
        self.reader.on_log = self.lines.extend

    def reopen(self) -> ControllerReader:
        """A reader of what answers now, with a session of its own."""
        client = RwsClient(self.rws, clock=self)
        client.connect()
        return ControllerReader(client, self)

    def start(self) -> None:
        self.world.controller.set_motors(on=True)
        self.world.controller.start_rapid("once")

    def go_on(self, seconds: float, each: Callable[[], None] = lambda: None) -> None:
        """Let the robot go on, and read it as it falls due."""
        for _ in range(round(seconds / self.world.cycle_time)):
            self.advance(self.world.cycle_time)
            self.world.cycle({})
            while self.reader.step() <= 0.0:
                continue
            each()


def test_six_axes_are_shown_where_they_are_while_the_pointer_stands_at_the_line_that_moves_them(tmp_path: Path) -> None:
    cell = Cell("irb120", tmp_path)
    cell.start()
    cell.go_on(0.5)
    message = cell.reader.message()
    assert message.arms["ROB_1"] == pytest.approx(cell.world.arms[Side.RIGHT].planned, abs=0.05)
    assert message.arms["ROB_1"] != irb120().home
    (task,) = message.tasks
    assert (task.name, task.execution) == ("T_ROB1", "started")
    lines = tuple(PROGRAM.splitlines())
    assert task.pointer == PointerReport("Cell", "approach", 10, 10 - LINES_AROUND, lines[10 - LINES_AROUND - 1 :])
    assert (message.program, message.motors, message.operating_mode) == ("running", "motoron", "AUTO")
    assert message.speed_ratio == 100
    assert message.missing == (str(say("no_driver_for_robot", robot="an IRB 120 (mechanical unit ROB_1), not a YuMi")),)
    assert LogLine("TPWrite", "begins", task="T_ROB1") in cell.lines


def test_event_log_is_shown_from_its_beginning_each_message_once(tmp_path: Path) -> None:
    cell = Cell("irb120", tmp_path)
    cell.start()
    cell.go_on(6.0)
    codes = [line.code for line in cell.lines if line.source == "event log"]
    assert codes == [event.code for event in reversed(cell.world.controller.events.entries())]
    late = next(line for line in cell.lines if line.text == "Box is late")
    assert (late.level, late.detail, len(late.clock)) == ("warning", "It came after 3 s.", 8)


def test_lines_of_tpwrite_are_shown_once_and_anew_by_a_controller_that_was_started_anew(tmp_path: Path) -> None:
    cell = Cell("irb120", tmp_path)
    host = cell.world.controller.execution.installed["T_ROB1"].host
    for text in ("one", "two"):
        host.write_text("T_ROB1", text)
        cell.go_on(1.0)
    assert [line.text for line in cell.lines if line.source == "TPWrite"] == ["one", "two"]
    host.lines.clear()
    host.line_count = 0
    host.write_text("T_ROB1", "three")
    cell.go_on(1.0)
    assert [line.text for line in cell.lines if line.source == "TPWrite"] == ["one", "two", "three"]


def test_arms_of_a_yumi_are_shown_in_the_order_of_the_chain_without_a_state_machine(tmp_path: Path) -> None:
    cell = Cell("yumi", tmp_path)
    cell.go_on(0.2)
    message = cell.reader.message()
    for side in Side:
        assert message.arms[side.word] == pytest.approx(home(side), abs=1e-4)
    assert message.missing == (str(say("driver_has_ended")),)
    assert cell.reader.kind.is_drawn
    assert set(controller_model(cell.reader)["arms"]) == {"right", "left"}


def test_single_arm_is_shown_in_the_order_of_the_chain(tmp_path: Path) -> None:
    cell = Cell("irb14050", tmp_path)
    cell.go_on(0.2)
    assert cell.reader.message().arms["ROB_1"] == pytest.approx(irb14050().home, abs=1e-4)


def test_robot_without_a_description_is_shown_as_numbers(tmp_path: Path) -> None:
    cell = Cell("irb120", tmp_path, options=("RobotWare Base", "IRB 1200-5/0.9"))
    cell.go_on(0.2)
    message = cell.reader.message()
    assert message.arms["ROB_1"] == pytest.approx(irb120().home, abs=1e-4)
    assert message.missing == (
        str(say("no_driver_for_robot", robot="an IRB 1200 (mechanical unit ROB_1), not a YuMi")),
        str(say("no_description_of_robot")),
    )
    model = controller_model(cell.reader)
    assert (model["joints"], model["limits"]["lower"]) == ([], [])
    assert model["arms"]["ROB_1"]["axes"] == (1, 2, 3, 4, 5, 6)


@pytest.mark.parametrize("robot", ["yumi", "irb120"])
def test_controller_that_is_not_ours_is_only_read_and_gets_few_requests(tmp_path: Path, robot: str) -> None:
    cell = Cell(robot, tmp_path, is_own=False)
    assert not cell.reader.is_virtual
    cell.start()
    cell.go_on(1.0)
    cell.rws.asked.clear()
    cell.go_on(10.0)
    assert {method for method, _ in cell.rws.asked} == {"GET"}
    assert 30 < cell.rws.asked.total() <= 5.5 * 10.0
    assert all(line.source == "event log" for line in cell.lines)


def test_what_the_controller_refuses_is_named_until_it_is_shown_again(tmp_path: Path) -> None:
    cell = Cell("irb120", tmp_path)
    joints = "/rw/motionsystem/mechunits/ROB_1/jointtarget"
    cell.rws.refused.add(joints)
    cell.go_on(0.3)
    message = cell.reader.message()
    assert message.arms == {"ROB_1": None}
    with pytest.raises(ControllerRefused) as refusal:
        cell.client.joint_target("ROB_1")
    said = say("controller_does_not_show", what="the joints of ROB_1", why=refusal.value.said)
    assert message.missing[1] == str(said)
    cell.rws.refused.clear()
    cell.go_on(0.3)
    assert len(cell.reader.message().missing) == 1
    assert cell.reader.message().arms["ROB_1"] is not None


def test_lines_of_a_module_that_was_replaced_are_read_anew(tmp_path: Path) -> None:
    cell = Cell("irb120", tmp_path)
    cell.client.move_pp_to_main()
    cell.go_on(2.0)
    (task,) = cell.reader.message().tasks
    assert task.pointer is not None
    assert (task.pointer.line, "    ! a line more" in task.pointer.text) == (4, False)
    cell.client.set_module_text("T_ROB1", "Cell", LATER)
    cell.client.move_pp_to_main()
    cell.go_on(3.0)
    (task,) = cell.reader.message().tasks
    assert task.pointer is not None
    assert (task.pointer.line, "    ! a line more" in task.pointer.text) == (5, True)


def test_nothing_is_known_of_a_controller_that_does_not_answer_until_it_does_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(controller_view, "_RECONNECT", 0.01)
    cell = Cell("irb120", tmp_path)
    changes: list[Message | None] = []
    view = ControllerView(
        cell.reader,
        cell.reopen,
        "yumi view",
        lambda state: None,
        lambda log: None,
        lambda: changes.append(view.why_not),
    )

    async def main() -> None:
        view.watch(True)
        running = asyncio.create_task(view.run())
        await until(lambda: cell.reader.message().arms["ROB_1"] is not None, cell)
        cell.rws.is_there = False
        await until(lambda: bool(changes), cell)
        assert cell.reader.message().arms == {"ROB_1": None}
        cell.rws.is_there = True
        await until(lambda: cell.reader.message().arms["ROB_1"] is not None, cell)
        running.cancel()
        await asyncio.wait([running])

    asyncio.run(main())
    assert [each and str(each) for each in changes] == ["Nothing answers in this memory.", None]
    assert view.reader is cell.reader  # the session goes on: it is the same controller


async def until(condition: Callable[[], bool], cell: Cell) -> None:
    """Wait for what a view reads; everything is due all the time."""
    for _ in range(1000):
        if condition():
            return
        cell.advance(1.0)
        await asyncio.sleep(0.005)
    raise AssertionError


@pytest.mark.parametrize("is_noticed", [True, False], ids=["connection lost", "session lost"])
def test_real_controller_that_takes_the_place_of_a_virtual_one_is_shown_as_a_real_one_and_gets_few_requests(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_noticed: bool
) -> None:
    monkeypatch.setattr(controller_view, "_RECONNECT", 0.01)
    cell, other = Cell("irb120", tmp_path), Cell("yumi", tmp_path)
    cell.reader.address = "127.0.0.1:8080"
    cell.world.controller.execution.installed["T_ROB1"].host.write_text("T_ROB1", "begins")
    server = ControllerServer(PageSettings(port=0), "virtual-irc5 view", cell.reader, cell.reopen, takes_faults=True)
    view = server._view
    page = Introduced()

    async def main() -> None:
        view.watch(True)
        running = asyncio.create_task(view.run())
        await until(lambda: cell.reader.message().arms["ROB_1"] is not None and bool(view.lines), cell)
        server.introduce(page)
        server.pages.add(page)
        if is_noticed:
            cell.rws.is_there = False
            await until(lambda: view.why_not is not None, cell)
        cell.rws.adapter, cell.rws.refused = other.rws.adapter, {DISPLAY_PATH}
        cell.rws.is_there = True
        await until(
            lambda: view.reader is not cell.reader and view.why_not is None and page.kinds[-1] != "IRB 120", cell
        )
        running.cancel()
        await asyncio.wait([running])

    asyncio.run(main())
    assert page.kinds[0] == "IRB 120"
    assert (page.sent[0]["is_virtual"], bool(page.sent[0]["faults"])) == (True, True)
    assert (page.kinds[-1], page.sent[-1]["is_virtual"], page.sent[-1]["faults"]) == ("IRB 14000", False, [])
    assert msgspec.json.decode(server._model)["arms"].keys() == {"right", "left"}
    assert all(line.source != "TPWrite" for line in view.lines)  # nothing of the controller before

    cell.reader = view.reader
    cell.go_on(1.0)
    cell.rws.asked.clear()
    cell.go_on(10.0)
    assert {method for method, _ in cell.rws.asked} == {"GET"}
    assert 30 < cell.rws.asked.total() <= 5.5 * 10.0


class Introduced(OpenPage):
    """A page without a browser.

    Attributes:
        sent: what it was sent of the controller.
    """

    def __init__(self) -> None:
        self.is_local = True
        self.sent: list[Mapping[str, Any]] = []

    def send(self, message: Mapping[str, Any]) -> None:
        self.sent.append(message)

    def send_bytes(self, message: bytes) -> None:
        """A line of the log."""

    def send_state(self, state: bytes) -> None:
        """A state."""

    @property
    def kinds(self) -> list[str]:
        """The robots."""
        return [each["controller"].robot for each in self.sent]


def test_page_gets_the_controller_with_its_log_and_can_only_look(tmp_path: Path) -> None:
    cell = Cell("irb120", tmp_path)

    async def main() -> None:
        server = ControllerServer(PageSettings(port=0), "yumi view", cell.reader, cell.reopen)
        await server.start()
        base = f"http://127.0.0.1:{server.port}"
        try:
            async with (
                aiohttp.ClientSession() as session,
                session.ws_connect(f"{base}/ws", headers={"Origin": base}) as socket,
            ):
                seen: dict[str, Any] = {}
                while "controller" not in seen or seen["controller"]["arms"]["ROB_1"] is None:
                    message = await socket.receive_json(timeout=10.0)
                    seen[message["type"]] = message
                    if message["type"] == "controller":
                        await socket.send_json({"type": "seen"})
                assert seen["view"]["controller"] == {
                    "address": "memory",
                    "robot": "IRB 120",
                    "units": ["ROB_1"],
                    "is_drawn": True,
                }
                await socket.send_json({"type": "take_control"})
                while message["type"] != "refused":
                    message = await socket.receive_json(timeout=10.0)
                assert message["sentence"] == str(say("no_driver_for_controller"))
        finally:
            await server.stop()

    asyncio.run(asyncio.wait_for(main(), 30.0))


@pytest.mark.parametrize("takes_faults", [True, False])
def test_page_injects_faults_only_into_a_virtual_controller_of_this_machine_that_it_may(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, takes_faults: bool
) -> None:
    injected: list[tuple[str, str, Mapping[str, str]]] = []

    def inject(address: str, name: str, form: Mapping[str, str]) -> Fault:
        injected.append((address, name, form))
        return Fault.MOTORS_OFF

    monkeypatch.setattr(controller_server, "inject_fault", inject)
    monkeypatch.setattr(controller_server, "takes_faults", lambda address: is_virtual)

    async def answer(cell: Cell) -> dict[str, Any]:
        server = ControllerServer(
            PageSettings(port=0), "virtual-irc5 view", cell.reader, cell.reopen, takes_faults=takes_faults
        )
        await server.start()
        base = f"http://127.0.0.1:{server.port}"
        try:
            async with (
                aiohttp.ClientSession() as session,
                session.ws_connect(f"{base}/ws", headers={"Origin": base}) as socket,
            ):
                await socket.send_json({"type": "inject", "id": 3, "name": "motors-off", "form": {}})
                while (message := await socket.receive_json(timeout=10.0)).get("id") != 3:
                    continue
                return dict(message)
        finally:
            await server.stop()

    here, far = "127.0.0.1:8080", "192.168.125.1:80"
    for address, is_own, is_virtual in (
        (here, True, True),
        (far, True, True),
        (here, False, True),
        (here, True, False),
    ):
        injected.clear()
        cell = Cell("irb120", tmp_path, is_own=is_own)
        cell.reader.address = address
        message = asyncio.run(asyncio.wait_for(answer(cell), 30.0))
        may = takes_faults and is_own and is_virtual and address == here
        assert injected == ([(address, "motors-off", {})] if may else [])
        if may:
            assert message == {"type": "done", "id": 3, "result": "Done: Motors Off is pressed"}
        else:
            assert message["error"]["sentence"] == str(say("faults_only_virtual"))


@pytest.mark.parametrize("header", [*FORWARDED, None])
def test_page_on_another_machine_is_offered_no_faults_and_injects_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, header: str | None
) -> None:
    injected: list[str] = []
    monkeypatch.setattr(controller_server, "takes_faults", lambda address: True)
    monkeypatch.setattr(controller_server, "inject_fault", lambda address, name, form: injected.append(name))
    if header is None:
        monkeypatch.setattr(page_server, "is_loopback", lambda host: host != "127.0.0.1")
    cell = Cell("irb120", tmp_path)
    cell.reader.address = "localhost:8080"

    async def main() -> None:
        settings = PageSettings(port=0, token="secret")
        server = ControllerServer(settings, "virtual-irc5 view", cell.reader, cell.reopen, takes_faults=True)
        await server.start()
        base = f"http://127.0.0.1:{server.port}"
        headers = {"Origin": base, **({} if header is None else {header: "192.168.1.30"})}
        try:
            async with (
                aiohttp.ClientSession() as session,
                session.ws_connect(f"{base}/ws?token=secret", headers=headers) as socket,
            ):
                while (message := await socket.receive_json(timeout=10.0))["type"] != "view":
                    continue
                assert (message["is_virtual"], message["faults"]) == (True, [])
                await socket.send_json({"type": "inject", "id": 3, "name": "motors-off", "form": {}})
                while (message := await socket.receive_json(timeout=10.0)).get("id") != 3:
                    continue
                assert message["error"]["sentence"] == str(say("faults_only_here"))
        finally:
            await server.stop()

    asyncio.run(asyncio.wait_for(main(), 30.0))
    assert injected == []


@pytest.mark.parametrize("arm", [irb120(), irb14050()], ids=["irb120", "irb14050"])
def test_robot_is_drawn_with_its_tool_where_the_description_has_it(arm: KinematicArm) -> None:
    model = capsule_model([ReaderUnit("ROB_1", "ROB_1", arm.axes, arm)])
    numbers = np.random.default_rng(3)
    for _ in range(20):
        position = numbers.uniform(arm.limits.lower, arm.limits.upper)
        frame = np.eye(4)
        values = dict(zip(model["arms"]["ROB_1"]["joints"], position, strict=True))
        for joint in model["joints"]:  # a chain, in its order
            frame = frame @ fixed(joint["xyz"], joint["rpy"])
            if joint["type"] == "revolute":
                frame = frame @ turn(joint["axis"], values[joint["name"]])
        tool0 = arm.tool0(as_joints(position))
        assert frame[:3, 3] == pytest.approx(tool0.position, abs=1e-9)
        assert frame[:3, :3] == pytest.approx(matrix_from_quaternion(tool0.orientation), abs=1e-9)


def test_capsules_lead_from_axis_to_axis() -> None:
    arm = irb120()
    model = capsule_model([ReaderUnit("ROB_1", "ROB_1", arm.axes, arm)])
    for joint in model["joints"]:
        end, shapes = np.array(joint["xyz"]), model["links"][joint["parent"]]
        if np.linalg.norm(end) > 0.0:
            assert any(shape["shape"] == "sphere" and shape["xyz"] == joint["xyz"] for shape in shapes)
            (cylinder,) = (shape for shape in shapes if shape["xyz"] == pytest.approx(end / 2.0))
            along = fixed([0.0, 0.0, 0.0], cylinder["rpy"])[:3, 2]
            assert along * cylinder["length"][0] == pytest.approx(end)


def as_joints(position: NDArray[np.float64]) -> Joints:
    return tuple(position.tolist())  # type: ignore[return-value]  # an arm may have six


def turn(axis: list[float], angle: float) -> NDArray[np.float64]:
    x, y, z = axis
    cross = np.array([(0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)])
    frame = np.eye(4)
    frame[:3, :3] += np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return frame


def fixed(xyz: list[float], rpy: list[float]) -> NDArray[np.float64]:
    """A frame as URDF has it."""
    roll, pitch, yaw = rpy
    frame = turn([0, 0, 1], yaw) @ turn([0, 1, 0], pitch) @ turn([1, 0, 0], roll)
    frame[:3, 3] = xyz
    return frame
