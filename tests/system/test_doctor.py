"""The doctor against the virtual controller: a healthy one, and every fault that a new set-up may have."""

from __future__ import annotations

import json
import shutil
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from abb_protocols.catalogue import Message, clause, message, remedy_of
from abb_protocols.catalogue.actions import Action
from abb_protocols.errors import ControllerRefused
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import OperatingMode
from abb_runtime.clock import ManualClock
from abb_runtime.rws.client import RwsClient
from abb_runtime.udp import UdpServer, free_port
from memory_http import MemoryHttp
from refusals import assert_says
from virtual_irc5.controller.installed_system import ROBOTS, factory_system
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.world import World, WorldSettings
from yumi.cli.main import main
from yumi.driver.commissioning.contents import essence
from yumi.driver.commissioning.controller_checks import examine_controller
from yumi.driver.commissioning.delivery import delivered_modules
from yumi.driver.commissioning.findings import Finding, Verdict
from yumi.driver.commissioning.machine_checks import Run, examine_machine
from yumi.driver.launch_checks import EgmAddress

HERE = {Side.LEFT: EgmAddress("127.0.0.1", 6511), Side.RIGHT: EgmAddress("127.0.0.1", 6512)}
NOON = datetime(2026, 7, 9, 12, 0, 0).timestamp()


def world(**settings: object) -> World:
    return World(replace(WorldSettings(start_time=NOON), **settings))  # type: ignore[arg-type]


def findings(
    controller: Irc5, addresses: Mapping[Side, EgmAddress] = HERE, now: float = NOON, password: str = "robotics"
) -> list[Finding]:
    """What the doctor finds on a controller, in no time."""
    clock = ManualClock()
    client = RwsClient(MemoryHttp(controller, clock), password=password, clock=clock)
    return list(examine_controller(client, addresses, lambda: datetime.fromtimestamp(now)))


def problems(*args: object, **options: object) -> list[tuple[str, Message]]:
    found = findings(*args, **options)  # type: ignore[arg-type]
    return [(each.requirement, each.said) for each in found if each.verdict is Verdict.PROBLEM]


def notes(*args: object, **options: object) -> dict[str, Message]:
    found = findings(*args, **options)  # type: ignore[arg-type]
    return {each.requirement: each.said for each in found if each.verdict is Verdict.NOTE}


def without_option(controller: Irc5, start: str) -> None:
    options = tuple(each for each in controller.identity.options if not each.startswith(start))
    controller.identity = replace(controller.identity, options=options)


def load(controller: Irc5, module: str, old: str, new: str) -> None:
    """Somebody loads the program with one module changed into both tasks."""
    modules = {name: text.replace(old, new) if name == module else text for name, text in delivered_modules().items()}
    assert modules != delivered_modules()
    controller.replace_program({f"HOME:/other/{name}.mod": text for name, text in modules.items()})


def test_healthy_robot_has_no_problem_and_is_said_to_start_with_motors_off() -> None:
    controller = world().controller
    assert problems(controller) == []
    assert notes(controller) == {
        "motors": message("motors_not_on_yet", state="motoroff"),
        "RAPID program": message("program_not_running_yet"),
    }


def test_running_robot_has_not_even_a_note() -> None:
    running = world()
    running.controller.set_motors(True)
    running.controller.start_rapid()
    for _ in range(100):  # the programs write their PERS data, which are part of the modules' texts
        running.cycle({})
    assert [each for each in findings(running.controller) if each.verdict is not Verdict.OK] == []


def test_wrong_password_is_the_only_problem_and_nothing_more_is_asked() -> None:
    expected = message("login_refused", address="memory", user="Default User")
    assert problems(world().controller, password="wrong") == [("login", expected)]


def test_robotware_without_egm_for_seven_axes_is_a_problem() -> None:
    controller = world().controller
    controller.identity = replace(controller.identity, robotware="6.08.01.00")
    assert problems(controller) == [("RobotWare", message("robotware_without_egm", version="6.8.1.0"))]


def test_missing_option_is_a_problem_and_options_that_are_not_needed_are_none() -> None:
    controller = world().controller
    for start in ("689-1", "623-1", "616-1"):
        without_option(controller, start)
    option, loss = "689-1 Externally Guided Motion (EGM)", "EGM can move no arm"
    assert problems(controller) == [("option", message("option_not_installed", option=option, loss=loss))]


@pytest.mark.parametrize(
    ("robot", "named"),
    [
        ("irb120", "an IRB 120 (mechanical unit ROB_1), not a YuMi"),
        ("irb14050", "an IRB 14050 (mechanical units ROB_1, ROB_1_7), not a YuMi with two arms"),
    ],
)
def test_another_robot_is_named_first_and_lacks_nothing_else(robot: str, named: str) -> None:
    controller = world(system=factory_system(ROBOTS[robot])).controller
    first, *others = findings(controller)
    assert (first.requirement, first.verdict) == ("robot", Verdict.PROBLEM)
    assert first.said == message("not_a_yumi", address="memory", robot=named)
    assert (first.found, first.remedy) == (clause(first.said), remedy_of(first.said))
    assert {each.verdict for each in others} == {Verdict.OK}


def test_missing_gripper_product_is_a_note() -> None:
    controller = world().controller
    without_option(controller, "SmartGripper")
    assert notes(controller)["gripper product"] == message("gripper_product_missing", product="SmartGripper")


def test_manual_mode_is_a_problem() -> None:
    controller = world().controller
    controller.mode = OperatingMode.MANUAL_REDUCED
    (found,) = problems(controller)
    assert found == ("operating mode", message("mode_keeps_programs_out", mode="MANR"))
    assert found[1].actions == (Action.TURN_TO_AUTO,)


def test_pressed_emergency_stop_is_a_problem() -> None:
    controller = world().controller
    controller.press_emergency_stop()
    ((requirement, said),) = problems(controller)
    assert requirement == "motors"
    assert_says(said, "motors_kept_off", state="emergencystop")


def test_datagrams_that_go_to_another_machine_are_a_problem() -> None:
    controller = world(egm_host="127.0.0.9").controller
    found = problems(controller)
    assert [requirement for requirement, _ in found] == [f"UDPUC device {side.unit}" for side in HERE]
    for side, (_, said) in zip(HERE, found, strict=True):
        port = HERE[side].port
        assert_says(said, "datagrams_go_elsewhere", there=f"127.0.0.9:{port}", here=f"127.0.0.1:{port}")


def test_datagrams_that_go_to_another_port_are_a_problem_of_that_arm() -> None:
    controller = world(egm_ports={Side.RIGHT: 7000}).controller
    ((requirement, said),) = problems(controller)
    assert requirement == "UDPUC device ROB_R"
    assert_says(said, "datagrams_go_elsewhere", there="127.0.0.1:7000", here="127.0.0.1:6512")


def test_missing_module_is_a_problem_of_its_task() -> None:
    controller = world().controller
    controller.execution.unload_module("T_ROB_R", "TRobRAPID")
    assert problems(controller) == [("modules in T_ROB_R", message("modules_missing", modules=("TRobRAPID",)))]


def test_missing_watchdog_is_a_note_that_says_what_is_lost() -> None:
    controller = world().controller
    controller.execution.unload_module("T_ROB_R", "TRobWatchdog")
    assert notes(controller)["modules in T_ROB_R"] == message("watchdog_missing", module="TRobWatchdog")


def test_changed_module_is_a_problem_unless_the_add_in_brings_its_own() -> None:
    controller = world().controller
    load(controller, "TRobEGM", "ENDMODULE", "CONST num more:=1;\nENDMODULE")
    for side in Side:
        found = notes(controller)[f"modules in {side.task}"]
        assert found == message("modules_of_add_in", modules=("TRobEGM",))
    without_option(controller, "StateMachine Core")
    assert problems(controller) == [
        (f"modules in {side.task}", message("modules_differ", modules=("TRobEGM",))) for side in Side
    ]


def test_program_of_another_version_is_a_problem() -> None:
    controller = world().controller
    load(controller, "TRobMain", "VERSION:=1.1", "VERSION:=1.0")
    said = dict(problems(controller))["version in T_ROB_R"]
    assert_says(said, "state_machine_of_other_version", task="T_ROB_R", version="1.0", expected=1.1)


def test_controller_that_gives_neither_texts_nor_time_is_told_with_notes(monkeypatch: pytest.MonkeyPatch) -> None:
    refusal = message("no_task", task="none")

    def refuse(*_: str) -> None:
        raise ControllerRefused(refusal, status=404)

    monkeypatch.setattr(RwsClient, "module_text", refuse)
    monkeypatch.setattr(RwsClient, "clock", refuse)
    controller = world().controller
    assert problems(controller) == []
    found = notes(controller)
    assert found["clock"] == message("clock_unreadable", reason=refusal)
    assert found["modules in T_ROB_L"] == message("modules_not_comparable", reason=refusal)


def test_clock_that_is_off_is_a_note_with_both_times() -> None:
    controller = world().controller
    times = message("clock_differs", there="2026-07-09 12:00:00", here="2026-07-09 13:00:00")
    assert notes(controller, now=NOON + 3600.0)["clock"] == times


def test_module_with_other_spaces_cases_comments_and_pers_values_is_the_same() -> None:
    text = 'MODULE A\n  PERS num a{2}:=[1,\n    2]; ! first\n  CONST string s:="a!b";\nENDMODULE\n'
    same = 'module A\n! other words\nPERS   num a{2} := [7, 8];\nCONST string s := "a!b";\nendmodule'
    assert essence(text) == essence(same)
    assert essence(text) != essence(text.replace("a!b", "a!c"))
    assert essence(text) != essence(text.replace("s:=", "t:="))


def test_port_that_is_taken_here_is_a_problem() -> None:
    with UdpServer("127.0.0.1", 0) as taken:
        addresses = {Side.LEFT: EgmAddress("127.0.0.1", taken.port), Side.RIGHT: EgmAddress("127.0.0.1", free_port())}
        found = [each for each in examine_machine("127.0.0.1", addresses) if each.verdict is Verdict.PROBLEM]
    (port,) = (address.port for address in addresses.values() if str(address.port) in found[0].requirement)
    (taken_port,) = found
    assert taken_port.said == message("udp_port_taken", port=port)
    assert port == addresses[Side.LEFT].port


@pytest.mark.parametrize(
    ("code", "output", "verdict", "said"),
    [
        (1, "", Verdict.NOTE, "firewall_unreadable"),
        (0, "", Verdict.OK, "firewall_open"),
        (
            0,
            "chain input { type filter hook input priority 0; policy drop; }",
            Verdict.NOTE,
            "firewall_closes_something",
        ),
        (
            0,
            "chain input { type filter hook input priority 0; policy drop; udp dport { 6511, 6512 } accept }",
            Verdict.OK,
            "firewall_open",
        ),
    ],
)
def test_firewall_is_told_as_far_as_it_is_readable(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, code: int, output: str, verdict: Verdict, said: str
) -> None:
    monkeypatch.setattr(shutil, "which", lambda name, path: f"/usr/sbin/{name}" if name == "nft" else None)
    found = firewall(lambda command: subprocess.CompletedProcess(command, code, output, ""), tmp_path / "none")
    assert found.verdict is verdict
    assert_says(found.said, said, firewall="nft", ports="6511:6512")


def test_firewall_that_is_on_but_closed_to_readers_names_the_command_that_opens_the_ports(tmp_path: Path) -> None:
    ufw = tmp_path / "ufw.conf"
    ufw.write_text("# /etc/ufw/ufw.conf\nENABLED=yes\n")
    found = firewall(lambda command: subprocess.CompletedProcess(command, 1, "", ""), ufw)
    assert found.said == message("ufw_is_on", robot="192.0.2.1", ports="6511:6512")
    assert found.remedy == remedy_of(found.said)


@pytest.mark.words
def test_command_that_opens_the_ports_can_be_copied() -> None:
    said = message("ufw_is_on", robot="192.0.2.1", ports="6511:6512")
    assert remedy_of(said) == "run `sudo ufw allow from 192.0.2.1 to any port 6511:6512 proto udp`"


def firewall(run: Run, ufw: Path) -> Finding:
    return next(each for each in examine_machine("192.0.2.1", HERE, run, ufw) if each.requirement == "firewall")


@dataclass
class Served:
    """A virtual controller on loopback, with what it was asked."""

    port: int = 0
    requests: list[HttpRequest] = field(default_factory=list)


@contextmanager
def served(controller: Irc5) -> Iterator[Served]:
    adapter, what = RwsService(controller, user="Default User", password="robotics"), Served()

    def handle(request: HttpRequest) -> HttpReply:
        what.requests.append(request)
        reply = adapter.handle(request, time.monotonic())
        assert isinstance(reply, HttpReply)
        return reply

    with HttpServer(handle, port=0) as server:
        what.port = server.port
        yield what


@pytest.fixture
def here() -> Iterator[tuple[Served, list[str]]]:
    """A healthy controller whose datagrams come here, and the options to find it."""
    ports = {side: free_port() for side in Side}
    egm = [text for side, port in ports.items() for text in (f"--{side.word}-egm-port", str(port))]
    with served(world(egm_ports=ports, start_time=time.time()).controller) as what:
        yield what, ["--robot", f"127.0.0.1:{what.port}", *egm]


def run(*arguments: str, environment: Mapping[str, str] | None = None) -> Result:
    return CliRunner().invoke(main, ["doctor", *arguments], env=environment)


def test_doctor_only_reads(here: tuple[Served, list[str]]) -> None:
    what, options = here
    assert run(*options).exit_code == 0
    assert {request.method for request in what.requests} == {"GET"}
    assert any("module-text" in request.target for request in what.requests)
    assert not any("subscription" in request.target for request in what.requests)


def test_doctor_prints_one_line_a_requirement_and_that_nothing_is_missing(here: tuple[Served, list[str]]) -> None:
    result = run(*here[1])
    assert result.exit_code == 0
    assert "No problems found" in result.output
    lines = [line.split()[0] for line in result.output.splitlines()[1:-1]]
    assert set(lines) <= {"ok", "note"}


def test_doctor_writes_its_findings_as_json(here: tuple[Served, list[str]]) -> None:
    report = json.loads(run(*here[1], "--json", "-").stdout)
    assert report["robot"] == f"127.0.0.1:{here[0].port}"
    (mode,) = [each for each in report["findings"] if each["requirement"] == "operating mode"]
    assert mode == {
        "requirement": "operating mode",
        "verdict": "ok",
        "code": "as_found",
        "found": clause(message("as_found", value="AUTO")),
        "remedy": "",
        "why": "only in AUTO may a program on a computer change anything",
        "where": "mode switch, or the mode button of the FlexPendant",
    }
    assert all(each["why"] for each in report["findings"])


def test_doctor_writes_one_page_of_html(here: tuple[Served, list[str]], tmp_path: Path) -> None:
    assert run(*here[1], "--html", str(tmp_path / "robot.html")).exit_code == 0
    page = (tmp_path / "robot.html").read_text()
    assert page.startswith("<!DOCTYPE html>")
    assert "operating mode" in page


def test_doctor_ends_with_code_1_where_there_is_a_problem(here: tuple[Served, list[str]]) -> None:
    result = run(*here[1], "--json", "-", environment={"YUMI_PASSWORD": "not-it-4711"})
    assert result.exit_code == 1
    (login,) = [each for each in json.loads(result.stdout)["findings"] if each["requirement"] == "login"]
    assert (login["verdict"], login["code"]) == ("problem", "login_refused")
    assert "'Default User'" in login["found"]
    assert "not-it-4711" not in result.output


def test_doctor_says_that_nothing_answers() -> None:
    result = run("--robot", f"127.0.0.1:{_closed_port()}")
    assert result.exit_code == 1
    assert "problem  reachable" in result.output


def _closed_port() -> int:
    with HttpServer(lambda _: HttpReply(204), port=0) as server:
        return server.port
