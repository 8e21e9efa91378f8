"""Misconfigurations of set-ups: the doctor names the cause of each, and finds nothing on healthy robots."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from datetime import datetime
from typing import NamedTuple

import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import ControllerRefused, NoConnection, ProtocolError, RobotNotReady
from abb_protocols.robot.joints import Side
from abb_protocols.rws.operations.rapid import TaskInfo
from abb_protocols.rws.values import CollisionState, ControllerState, Grant, OperatingMode
from abb_runtime.clock import ManualClock
from abb_runtime.faults import Fault, FaultDirection
from abb_runtime.rws.client import RwsClient
from abb_runtime.udp import NetworkCard, UdpServer
from memory_http import MemoryHttp
from refusals import assert_says, refused
from virtual_irc5.controller.installed_system import delivered_system
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.world import World, WorldSettings
from yumi.cli.doctor import _examine_stream
from yumi.driver.commissioning.controller_checks import examine_controller
from yumi.driver.commissioning.delivery import delivered_modules
from yumi.driver.commissioning.findings import Finding, Verdict
from yumi.driver.commissioning.machine_checks import examine_machine
from yumi.driver.commissioning.stream_checks import ArmStream, examine_stream, listen, obstacle_to_stream, streaming
from yumi.driver.launch_checks import EgmAddress
from yumi.egm.egm_session import Arrivals, SessionCounters
from yumi.testing.virtual_yumi import VirtualYumi

HERE = {Side.LEFT: EgmAddress("127.0.0.1", 6511), Side.RIGHT: EgmAddress("127.0.0.1", 6512)}
NOON = datetime(2026, 7, 9, 12, 0, 0).timestamp()
FOREIGN = "MODULE Production\n  PROC main()\n    WaitTime 1;\n  ENDPROC\nENDMODULE\n"


class Robot:
    """A virtual controller with what a client of it and the doctor need."""

    def __init__(self, **settings: object) -> None:
        world = World(replace(WorldSettings(start_time=NOON), **settings))  # type: ignore[arg-type]
        self.controller: Irc5 = world.controller
        self.clock = ManualClock()
        self.transport = MemoryHttp(self.controller, self.clock)
        self.password = "robotics"
        self.now = NOON

    def client(self) -> RwsClient:
        return RwsClient(self.transport, password=self.password, clock=self.clock)

    def findings(self) -> list[Finding]:
        return list(examine_controller(self.client(), HERE, lambda: datetime.fromtimestamp(self.now)))


class Case(NamedTuple):
    """One misconfiguration, and what is found of it: a code with values, or words of what bring-up or a client says."""

    name: str
    seed: Callable[[Robot], object]
    requirement: str
    said: Message | str
    verdict: Verdict = Verdict.PROBLEM


def no_device(device: str) -> Message:
    return message("udpuc_device_missing", device=device)


def cfg(domain: str, type_name: str, name: str, **attributes: str) -> Callable[[Robot], object]:
    def change(robot: Robot) -> None:
        robot.controller.configuration.change(domain, type_name, name, attributes)

    return change


def removed(domain: str, type_name: str, name: str) -> Callable[[Robot], object]:
    return lambda robot: robot.controller.configuration.remove(domain, type_name, name)


def without_option(start: str) -> Callable[[Robot], object]:
    def change(robot: Robot) -> None:
        identity = robot.controller.identity
        options = tuple(each for each in identity.options if not each.startswith((start, "StateMachine")))
        robot.controller.identity = replace(identity, options=options)

    return change


def robotware(version: str) -> Callable[[Robot], object]:
    def change(robot: Robot) -> None:
        robot.controller.identity = replace(robot.controller.identity, robotware=version)

    return change


def shows(name: str, value: object) -> Callable[[Robot], object]:
    return lambda robot: setattr(robot.controller, name, value)


def edited(robot: Robot) -> None:
    without_option("none")(robot)
    text = delivered_modules()["TRobEGM"].replace("PRESYNC_TIMEOUT:=10", "PRESYNC_TIMEOUT:=1")
    robot.controller.files["HOME:/edited.mod"] = text
    robot.controller.load_module("T_ROB_R", "HOME:/edited.mod", replace=True)


def foreign_main(robot: Robot) -> None:
    robot.controller.execution.tasks["T_ROB_L"].lose_pp()
    robot.controller.execution.unload_module("T_ROB_L", "TRobMain")
    robot.controller.files["HOME:/production.mod"] = FOREIGN
    robot.controller.load_module("T_ROB_L", "HOME:/production.mod", replace=False)


def not_restarted(robot: Robot) -> None:
    """As after a load of EIO.cfg without the restart."""
    robot.controller.effective.remove("EIO", "EIO_SIGNAL", "EGM_STOP")
    robot.controller.signals.configure(robot.controller.effective)


def held_by_another(robot: Robot) -> None:
    robot.client().call("POST", "/rw/mastership/rapid", (("action", "request"),))


def sessions_full(robot: Robot) -> None:
    for _ in range(70):
        robot.client().connect()


def nothing_there(robot: Robot) -> None:
    robot.transport.is_there = False


def wrong_password(robot: Robot) -> None:
    robot.password = "wrong"


def ungranted(robot: Robot) -> None:
    users = robot.transport.adapter._users
    users.granted = frozenset(users.granted) - {Grant.RAPID_CURRVALUE}


def many_sessions(robot: Robot) -> None:
    for _ in range(60):
        client = robot.client()
        client.connect()
        client.register()


def clock_off(robot: Robot) -> None:
    robot.now += 3600.0


CASES = [
    Case("other computer", cfg("SIO", "COM_TRP", "ROB_R", RemoteAdress="127.0.0.9"), "UDPUC device ROB_R", "127.0.0.9"),
    Case("other port", cfg("SIO", "COM_TRP", "ROB_L", RemotePortNumber="7000"), "UDPUC device ROB_L", "127.0.0.1:7000"),
    Case(
        "both arms on one port",
        cfg("SIO", "COM_TRP", "ROB_L", RemotePortNumber="6512"),
        "UDPUC devices",
        message("devices_share_port", port="6512"),
    ),
    Case("no device", removed("SIO", "COM_TRP", "ROB_L"), "UDPUC device ROB_L", no_device("ROB_L")),
    Case("device of TCP", cfg("SIO", "COM_TRP", "ROB_R", Type="TCP/IP"), "UDPUC device ROB_R", no_device("ROB_R")),
    Case(
        "signal missing",
        removed("EIO", "EIO_SIGNAL", "EGM_START_JOINT"),
        "signals",
        message("signals_missing", signals=("EGM_START_JOINT",)),
    ),
    Case(
        "signal of another type",
        cfg("EIO", "EIO_SIGNAL", "EGM_STOP", SignalType="DO"),
        "signal EGM_STOP",
        message("signal_differs", attribute="SignalType", value="DO", needed="DI"),
    ),
    Case(
        "signal not writable",
        cfg("EIO", "EIO_SIGNAL", "EGM_STOP", Access="Default"),
        "signal EGM_STOP",
        message("signal_differs", attribute="Access"),
    ),
    Case(
        "name of another signal",
        cfg("EIO", "EIO_SIGNAL", "EGM_STOP", Device="D652_10"),
        "signal EGM_STOP",
        message("signal_on_device", device="D652_10"),
    ),
    Case("loaded, not restarted", not_restarted, "restart", message("signals_not_in_use", signals=("EGM_STOP",))),
    Case(
        "no motion data",
        removed("MOC", "EXT_MOTION_DATA", "ROB_R_RAW"),
        "motion data",
        message("motion_data_missing", names=("ROB_R_RAW",)),
    ),
    Case("option missing", without_option("689-1"), "option", message("option_not_installed")),
    Case(
        "RobotWare too old", robotware("6.08.01.00"), "RobotWare", message("robotware_without_egm", version="6.8.1.0")
    ),
    Case("RobotWare 7", robotware("7.10.00.00"), "RobotWare", message("robotware_too_new", version="7.10.0.0")),
    Case("foreign main", foreign_main, "program in T_ROB_L", message("module_has_main", module="Production")),
    Case("module edited", edited, "modules in T_ROB_R", message("modules_differ", modules=("TRobEGM",))),
    Case(
        "module missing",
        lambda robot: robot.controller.execution.unload_module("T_ROB_R", "TRobEGM"),
        "modules in T_ROB_R",
        message("modules_missing", modules=("TRobEGM",)),
    ),
    Case(
        "manual mode",
        shows("mode", OperatingMode.MANUAL_REDUCED),
        "operating mode",
        message("mode_keeps_programs_out", mode="MANR"),
    ),
    Case(
        "full speed, RMMP needed",
        shows("mode", OperatingMode.MANUAL_FULL),
        "operating mode",
        message("mode_keeps_programs_out", mode="MANF"),
    ),
    Case(
        "emergency stop",
        lambda robot: robot.controller.press_emergency_stop(),
        "motors",
        message("motors_kept_off", state="emergencystop"),
    ),
    Case(
        "safety chain",
        shows("controller_state", ControllerState.GUARD_STOP),
        "motors",
        message("motors_kept_off", state="guardstop"),
    ),
    Case(
        "system failure",
        shows("controller_state", ControllerState.SYSTEM_FAILURE),
        "motors",
        message("motors_kept_off", state="sysfail"),
    ),
    Case("collision", shows("collision_state", CollisionState.TRIGGERED), "collision", message("arm_has_collided")),
    Case("speed ratio 0", shows("speed_ratio", 0), "speed ratio", message("speed_ratio_zero")),
    Case("mastership held", held_by_another, "mastership", message("mastership_held", domain="rapid")),
    Case("sessions full", sessions_full, "reachable", message("sessions_taken", most=70)),
    Case("nothing there", nothing_there, "reachable", "Nothing answers"),
    Case("wrong password", wrong_password, "login", message("login_refused", user="Default User")),
    Case("clock off", clock_off, "clock", message("clock_differs", here="2026-07-09 13:00:00"), Verdict.NOTE),
    Case(
        "user without grants",
        ungranted,
        "grants",
        message("grants_missing", grants=("UAS_RAPID_CURRVALUE (write RAPID data)",)),
    ),
    Case("sessions nearly full", many_sessions, "sessions", message("many_sessions", limit=70), Verdict.NOTE),
    Case(
        "no gripper product",
        without_option("SmartGripper"),
        "gripper product",
        message("gripper_product_missing", product="SmartGripper"),
        Verdict.NOTE,
    ),
]


def says(finding: Finding, said: Message | str) -> bool:
    if isinstance(said, str):
        return said in finding.found
    return finding.said.code == said.code and said.values.items() <= finding.said.values.items()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_doctor_names_the_cause(case: Case) -> None:
    robot = Robot()
    case.seed(robot)
    found = [each for each in robot.findings() if each.requirement == case.requirement]
    assert [each.verdict for each in found if says(each, case.said)] == [case.verdict], found
    assert all(each.why for each in found)


def test_task_that_is_switched_off_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    tasks = RwsClient.tasks

    def one_off(client: RwsClient) -> tuple[TaskInfo, ...]:
        return tuple(replace(task, is_active=task.name != "T_ROB_L") for task in tasks(client))

    monkeypatch.setattr(RwsClient, "tasks", one_off)
    found = [each for each in Robot().findings() if each.requirement == "task"]
    assert [each.said for each in found] == [message("task_switched_off", task="T_ROB_L")]


def test_gripper_without_signals_is_named() -> None:
    robot = Robot()
    signals = robot.controller.configuration.instances("EIO", "EIO_SIGNAL")
    for each in signals:
        if each.name.startswith("hand_") and each.name.endswith("_R"):
            robot.controller.effective.remove("EIO", "EIO_SIGNAL", each.name)
    robot.controller.signals.configure(robot.controller.effective)
    found = {each.requirement: each for each in robot.findings()}
    assert found["gripper right"].verdict is Verdict.NOTE
    assert found["gripper left"].verdict is Verdict.OK


def test_peer_that_is_not_a_controller_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def connect(_: RwsClient) -> None:
        raise ProtocolError(message("signals_missing", signals=()))

    monkeypatch.setattr(RwsClient, "connect", connect)
    (found,) = Robot().findings()
    assert (found.requirement, found.verdict) == ("reachable", Verdict.PROBLEM)
    assert found.said == message("signals_missing", signals=())
    assert found.remedy


def healthy() -> Iterator[tuple[str, Robot]]:
    """Ten robots that have nothing wrong."""
    yield "stock", Robot()
    yield "calibrated", Robot(grippers_are_calibrated=True)
    yield "another name", Robot(robot_name="cell 7")
    for version in ("6.09.00.00", "6.15.03.00"):
        robot = Robot()
        robotware(version)(robot)
        yield version, robot
    robot = Robot()
    without_option("StateMachine")(robot)
    yield "without the Add-In", robot
    robot = Robot()
    robot.controller.set_motors(True)
    yield "motors on", robot
    robot = Robot()
    robot.controller.set_motors(True)
    robot.controller.start_rapid()
    yield "program runs", robot
    robot = Robot()
    robot.controller.files["HOME:/tools.mod"] = "MODULE tools\n  PERS num main_speed:=1;\nENDMODULE\n"
    robot.controller.load_module("T_ROB_L", "HOME:/tools.mod", replace=False)
    yield "module of its owner", robot
    robot = Robot()
    robot.controller.configuration.put("EIO", "EIO_SIGNAL", {"Name": "door", "SignalType": "DI", "Device": "D652_10"})
    robot.controller.speed_ratio = 50
    yield "signal of its owner", robot


def test_doctor_finds_no_problem_on_healthy_robots() -> None:
    robots = list(healthy())
    assert len(robots) == 10
    for name, robot in robots:
        found = [each for each in robot.findings() if each.verdict is not Verdict.OK]
        assert {each.requirement for each in found} <= {"motors", "RAPID program"}, name
        assert [each for each in found if each.verdict is Verdict.PROBLEM] == [], name


# This machine

CABLE = NetworkCard("enp3s0", "192.168.125.50", "255.255.255.0", 1500, is_up=True, is_wireless=False, is_tunnel=False)
AWAITED = {Side.LEFT: EgmAddress("192.168.125.50", 6511), Side.RIGHT: EgmAddress("192.168.125.50", 6512)}


def of_machine(
    *cards: NetworkCard, environment: Mapping[str, str] | None = None, addresses: Mapping[Side, EgmAddress] = AWAITED
) -> dict[str, Finding]:
    found = examine_machine("192.168.125.1", addresses, cards=lambda: cards, environment=environment or {})
    return {each.requirement: each for each in found}


@pytest.mark.parametrize(
    ("cards", "requirement", "said"),
    [
        ([replace(CABLE, mtu=500)], "network card", message("card_with_small_mtu", card="enp3s0", mtu=500)),
        ([replace(CABLE, is_wireless=True)], "network card", message("card_is_wireless", card="enp3s0")),
        ([replace(CABLE, is_tunnel=True)], "network card", message("card_is_tunnel", card="enp3s0")),
        ([replace(CABLE, is_up=False)], "network card", message("card_not_connected", card="enp3s0")),
        (
            [CABLE, replace(CABLE, name="wlp1s0", address="192.168.125.77")],
            "network card",
            message("cards_share_network", others=("wlp1s0 (192.168.125.77)",)),
        ),
        ([replace(CABLE, address="192.168.125.51")], "route", message("no_card_with_address", host="192.168.125.50")),
        ([replace(CABLE, mask="255.255.255.240")], "route", message("card_in_other_network", robot="192.168.125.1")),
    ],
)
def test_way_to_the_robot_that_is_wrong_is_named(cards: list[NetworkCard], requirement: str, said: Message) -> None:
    found = of_machine(*cards)[requirement]
    assert found.verdict is not Verdict.OK
    assert says(found, said)


def test_cable_in_the_robots_network_is_fine() -> None:
    found = of_machine(CABLE)
    assert found["route"].verdict is found["network card"].verdict is Verdict.OK


@pytest.mark.parametrize(("domain", "verdict"), [("0", "ok"), ("101", "ok"), ("150", "note"), ("x", "problem")])
def test_ros_domain_is_looked_at(domain: str, verdict: str) -> None:
    assert of_machine(CABLE, environment={"ROS_DOMAIN_ID": domain})["ROS domain"].verdict.value == verdict


@pytest.mark.parametrize(
    ("variables", "verdict", "said"),
    [
        ({}, "ok", message("ros_discovery_of_driver")),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, "ok", message("as_found", value="LOCALHOST")),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, "note", message("ros_discovery_off")),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LAN"}, "problem", message("ros_discovery_invalid", value="LAN")),
        (
            {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_LOCALHOST_ONLY": "1"},
            "note",
            message("ros_discovery_overruled", value="SUBNET"),
        ),
    ],
)
def test_ros_discovery_range_is_looked_at(variables: Mapping[str, str], verdict: str, said: Message) -> None:
    found = of_machine(CABLE, environment=variables)["ROS discovery"]
    assert (found.verdict.value, says(found, said)) == (verdict, True)


def test_one_port_for_both_arms_and_a_taken_port_are_named() -> None:
    with UdpServer("127.0.0.1", 0) as taken:
        port = taken.port
        both = dict.fromkeys(Side, EgmAddress("127.0.0.1", port))
        found = list(examine_machine("127.0.0.1", both))
    wrong = [each.requirement for each in found if each.verdict is Verdict.PROBLEM]
    assert wrong[0] == "UDP ports here"
    assert f"UDP port {port} here" in wrong


# EGM's position streams, in virtual time


def streams_of(yumi: VirtualYumi, seed: Callable[[VirtualYumi], object] = lambda _: None) -> list[Finding]:
    with yumi.client() as client:
        with streaming(client, yumi):
            seed(yumi)
            streams = listen(yumi.egm, yumi, 1.0)
        stands = {side: client.joint_target(side.unit) for side in Side}
        return list(examine_stream(streams, stands, HERE))


@pytest.fixture
def yumi() -> VirtualYumi:
    return VirtualYumi()


def test_streams_of_both_arms_arrive_and_all_is_as_before(yumi: VirtualYumi) -> None:
    before = tuple(yumi.world.arms[Side.LEFT].position)
    found = streams_of(yumi)
    assert [each.verdict for each in found] == [Verdict.OK, Verdict.OK]
    assert_says(found[0].said, "stream_quality", lost=0)
    assert found[0].said.values["period"] == pytest.approx(0.00403, abs=5e-6)
    assert tuple(yumi.world.arms[Side.LEFT].position) == before
    assert yumi.world.controller.controller_state is ControllerState.MOTORS_OFF
    assert not yumi.world.controller.is_running


def test_stream_that_is_dropped_on_the_way_is_named(yumi: VirtualYumi) -> None:
    network = yumi.world.network
    found = streams_of(yumi, lambda _: network.inject(Fault.EGM_LOSS, Side.RIGHT, 100.0, FaultDirection.FROM_ROBOT))
    (right,) = [each for each in found if each.verdict is Verdict.PROBLEM]
    assert right.requirement == "EGM right"
    assert_says(right.said, "stream_dropped", host="127.0.0.1", port=6512)


def test_stream_with_losses_is_named(yumi: VirtualYumi) -> None:
    network = yumi.world.network
    found = streams_of(yumi, lambda _: network.inject(Fault.EGM_LOSS, Side.LEFT, 10.0, FaultDirection.FROM_ROBOT))
    (left,) = [each for each in found if each.verdict is Verdict.PROBLEM]
    assert_says(left.said, "stream_lossy")


def test_exchanged_ports_are_named(yumi: VirtualYumi) -> None:
    yumi.egm = {Side.LEFT: yumi.egm[Side.RIGHT], Side.RIGHT: yumi.egm[Side.LEFT]}
    found = streams_of(yumi)
    assert [each.verdict for each in found] == [Verdict.PROBLEM, Verdict.PROBLEM]
    assert_says(found[0].said, "stream_of_other_arm")


def test_something_else_at_the_port_is_named() -> None:
    nothing = ArmStream(SessionCounters(malformed=12), Arrivals(0.0, 0.0, 0.0, 0.0), None)
    stands = dict.fromkeys(Side, (0.0,) * 7)
    (found,) = examine_stream({Side.LEFT: nothing}, stands, HERE)  # type: ignore[arg-type]
    assert_says(found.said, "stream_not_egm")


def test_link_that_is_lost_while_streaming_is_an_error(yumi: VirtualYumi) -> None:
    with yumi.client() as client, pytest.raises(NoConnection), streaming(client, yumi):
        raise NoConnection("gone")
    assert not yumi.world.controller.is_running


def test_stream_starts_no_program_of_another(yumi: VirtualYumi) -> None:
    controller = yumi.world.controller
    controller.files["HOME:/cell.mod"] = "MODULE Cell\n  PROC main()\n  ENDPROC\nENDMODULE\n"
    controller.execution.unload_module("T_ROB_L", "TRobMain")
    with refused(RobotNotReady, "no_state_machine_to_start", task="T_ROB_L"), streaming(yumi.client(), yumi):
        pass
    controller.load_module("T_ROB_L", "HOME:/cell.mod", replace=False)
    with refused(RobotNotReady, "no_state_machine_to_start", task="T_ROB_L"), streaming(yumi.client(), yumi):
        pass
    assert controller.controller_state is ControllerState.MOTORS_OFF


def with_another_task() -> VirtualYumi:
    """A robot whose owner has a task of his own, which starts with the others."""
    text = "MODULE Log\n  PERS num seen:=0;\n  PROC main()\n    seen:=1;\n  ENDPROC\nENDMODULE\n"
    ours = delivered_system()
    system = replace(
        ours,
        parameters=(*ours.parameters, 'SYS:CFG_1.0::\nCAB_TASKS:\n      -Name "T_LOG" -Type "NORMAL"\n'),
        files={**ours.files, "HOME:/log.mod": text.encode()},
        modules={"T_LOG": ("HOME:/log.mod",)},
    )
    return VirtualYumi(WorldSettings(system=system))


def test_stream_starts_no_other_task_and_leaves_it_selected() -> None:
    yumi = with_another_task()
    with yumi.client() as client:
        with streaming(client, yumi):
            yumi.wait(0.5)
            assert [task.name for task in client.tasks() if task.is_active] == ["T_ROB_R", "T_ROB_L"]
        assert client.value("T_LOG", "Log", "seen") == 0.0
        assert all(task.is_active for task in client.tasks())
        # It would have run:
        client.set_motors(True)
        client.move_pp_to_main()
        client.start_rapid()
        yumi.wait(0.5)
        assert client.value("T_LOG", "Log", "seen") == 1.0


def refuse_switching_on(client: RwsClient, monkeypatch: pytest.MonkeyPatch) -> None:
    select = client.select_task

    def refusing(task: str, is_selected: bool) -> None:
        if is_selected:
            raise ControllerRefused("The task panel is locked.", status=403)
        select(task, is_selected)

    monkeypatch.setattr(client, "select_task", refusing)


@pytest.mark.parametrize("error", [None, NoConnection("The link was lost; check the cable.")])
def test_task_that_stays_switched_off_is_an_error_that_names_it(
    monkeypatch: pytest.MonkeyPatch, error: NoConnection | None
) -> None:
    yumi = with_another_task()
    progress: list[str] = []

    def fail() -> None:
        if error is not None:
            raise error

    with yumi.client() as client:
        refuse_switching_on(client, monkeypatch)
        with pytest.raises(RobotNotReady) as raised, streaming(client, yumi, progress.append):
            fail()
    said, tasks = raised.value.said, ("T_LOG",)
    if error is None:
        assert said == message("tasks_left_off", tasks=tasks)
    else:
        assert said == message("tasks_left_off_after", tasks=tasks, reason=error.said)
        assert str(error) in str(raised.value)
    assert "T_LOG" in progress[-1]
    assert not yumi.world.controller.is_running


def test_task_that_stays_switched_off_is_a_problem_of_the_doctor(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    yumi = with_another_task()
    monkeypatch.setattr("yumi.cli.doctor.SystemClock", lambda: yumi)
    monkeypatch.setattr("yumi.driver.commissioning.stream_checks.listen", lambda *_: listen(yumi.egm, yumi, 0.1))
    with yumi.client() as client:
        refuse_switching_on(client, monkeypatch)
        (found,) = _examine_stream(client, dict.fromkeys(Side, EgmAddress("127.0.0.1", 0)))
    assert (found.requirement, found.verdict) == ("EGM stream", Verdict.PROBLEM)
    assert found.said == message("tasks_left_off", tasks=("T_LOG",))
    said = [line.strip() for line in capsys.readouterr().err.splitlines()]
    assert said.index("task T_LOG is switched off meanwhile") < said.index(
        "program pointers to main, start the program"
    )


def test_stream_is_not_tried_where_the_program_is_a_problem() -> None:
    task = Finding("program in T_ROB_L", Verdict.PROBLEM, message("module_has_main", module="Cell"))
    skipped = obstacle_to_stream([task])
    assert skipped is not None
    assert_says(skipped.said, "stream_not_tried", requirement="program in T_ROB_L", reason=task.said)
    assert obstacle_to_stream([Finding("motors", Verdict.PROBLEM, message("motors_off"))]) is None
