"""The client's calls against a controller on the true wire."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import degrees

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, ControllerRefused
from abb_protocols.rws.operations.event_log import RwsEvent
from abb_protocols.rws.operations.io import RwsSignal
from abb_protocols.rws.operations.modules import ModuleInfo
from abb_protocols.rws.operations.rapid import TaskInfo
from abb_protocols.rws.rapid_values import encode
from abb_protocols.rws.values import (
    ControllerState,
    EventType,
    ExecutionState,
    OperatingMode,
    SignalType,
    TaskExecution,
)
from abb_runtime.rws.client import RwsClient
from contract.rws_bench import PlainController, serving
from refusals import refused


@pytest.fixture
def controller() -> PlainController:
    return PlainController()


@pytest.fixture
def client(controller: PlainController) -> Iterator[RwsClient]:
    with serving(controller) as address, RwsClient(address) as client:
        yield client


def test_connect_tells_which_controller_answers(client: RwsClient) -> None:
    system = client.connect()
    assert (system.name, system.robotware) == ("YuMi", (6, 13, 0, 0))
    assert "689-1 Externally Guided Motion (EGM)" in system.options


def test_operating_mode_is_read(client: RwsClient, controller: PlainController) -> None:
    assert client.operating_mode() is OperatingMode.AUTO
    controller.mode = OperatingMode.MANUAL_FULL
    assert client.operating_mode() is OperatingMode.MANUAL_FULL


def test_motors_are_switched_on_and_off(client: RwsClient) -> None:
    client.set_motors(True)
    assert client.controller_state() is ControllerState.MOTORS_ON
    client.set_motors(False)
    assert client.controller_state() is ControllerState.MOTORS_OFF


def test_rapid_is_started_and_stopped(client: RwsClient, controller: PlainController) -> None:
    client.set_motors(True)
    client.move_pp_to_main()
    client.start_rapid()
    assert client.execution() is ExecutionState.RUNNING
    client.stop_rapid()
    assert client.execution() is ExecutionState.STOPPED
    assert controller.pp_at_main == 1


def test_tasks_are_listed(client: RwsClient) -> None:
    right, left = client.tasks()
    assert (right.name, left.name) == ("T_ROB_R", "T_ROB_L")
    assert right == TaskInfo(
        name="T_ROB_R", links="link", execution=TaskExecution.READY, is_active=True, is_motion_task=True
    )


def test_clock_is_read_as_the_pendant_shows_it(client: RwsClient, controller: PlainController) -> None:
    assert client.clock().timestamp() == pytest.approx(controller.time, abs=1.0)


def test_modules_are_listed(client: RwsClient) -> None:
    assert client.modules("T_ROB_L") == (
        ModuleInfo("TRobMain", "ProgMod"),
        ModuleInfo("TRobSystem", "SysMod"),
    )


@pytest.mark.parametrize("text", ["", "run me", 'say "hi"', "50% + 1 & more; a=b", "ä→\\", "1E+06"])
def test_string_arrives_at_the_controller_and_comes_back(client: RwsClient, text: str) -> None:
    client.set_symbol("T_ROB_R", "TRobSystem", "routine_name_input", encode(text))
    assert client.symbol("T_ROB_R", "TRobSystem", "routine_name_input") == encode(text)


def test_symbol_has_a_type(client: RwsClient) -> None:
    assert client.symbol_type("T_ROB_R", "TRobMain", "current_state") == "num"


def test_signal_is_written_and_read(client: RwsClient) -> None:
    client.set_signal("hand_MaxSpeed_R", 120)
    assert client.signal("hand_MaxSpeed_R") == RwsSignal("hand_MaxSpeed_R", SignalType.GROUP_OUTPUT, 120.0)


def test_pulse_gives_one_rising_edge_each_time(client: RwsClient, controller: PlainController) -> None:
    client.pulse_signal("EGM_START_JOINT")
    client.pulse_signal("EGM_START_JOINT")
    edges = [(old, new) for _, old, new in controller.edges]
    assert edges == [(0.0, 1.0), (1.0, 0.0), (0.0, 1.0)]


def test_all_signals_are_read(client: RwsClient) -> None:
    values = client.signals()
    assert (len(values), values["hand_MaxSpeed_R"], values["OUTPUT_STATIONARY_ROB_R"]) == (4, 200.0, 1.0)


def test_all_signals_are_read_page_by_page(client: RwsClient, monkeypatch: pytest.MonkeyPatch) -> None:
    first = (("start", "0"), ("limit", "3"))  # which older controllers take for granted
    exchange = client._session.exchange
    monkeypatch.setattr(client._session, "exchange", lambda asked: exchange(replace(asked, query=asked.query or first)))
    assert list(client.signals()) == list(PlainController().signals.names)


def test_pulse_is_refused_when_something_holds_the_signal(
    client: RwsClient, controller: PlainController, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(controller.signals, "set", lambda name, value: None)
    with refused(CommandRefused, "signal_does_not_keep", signal="EGM_START_JOINT", address=client.address, value=1):
        client.pulse_signal("EGM_START_JOINT")


def test_joint_target_is_in_chain_order_and_radians(client: RwsClient) -> None:
    target_deg = [degrees(angle) for angle in client.joint_target("ROB_R")]
    assert target_deg == pytest.approx([0.0, -130.0, -135.0, 30.0, 0.0, 40.0, 0.123456])


def test_speed_ratio_is_set_and_read(client: RwsClient) -> None:
    client.set_speed_ratio(30)
    assert client.speed_ratio() == 30


@pytest.mark.parametrize("percent", [-1, 101])
def test_speed_ratio_beyond_its_range_is_refused(client: RwsClient, percent: int) -> None:
    with refused(CommandRefused, "speed_ratio_out_of_range", percent=percent, lowest=0, highest=100):
        client.set_speed_ratio(percent)
    assert client.speed_ratio() == 100


def test_events_come_newest_first(client: RwsClient, controller: PlainController) -> None:
    controller.events.append(10011, "Motors ON state", "The system is on.")
    controller.events.append(10010, "Motors OFF state")
    newest, older = client.events()
    assert newest.title == "Motors OFF state"
    assert older == RwsEvent(
        1, EventType.INFORMATION, 10011, "2026-07-09 T 00:00:00", "Motors ON state", "The system is on."
    )


@pytest.mark.parametrize("count", [0, 1, 50, 51, 110, 200])
def test_events_are_gathered_over_pages(client: RwsClient, controller: PlainController, count: int) -> None:
    for number in range(120):
        controller.events.append(10011, f"event {number}")
    titles = [event.title for event in client.events(count=count)]
    assert titles == [f"event {number}" for number in range(119, -1, -1)][:count]


REFUSED: list[tuple[Callable[[RwsClient], object], str, str]] = [
    (RwsClient.start_rapid, "starting RAPID", "rws_exec_state"),
    (lambda client: client.signal("nothing"), "reading signal nothing", "rws_unresolved_url"),
    (
        lambda client: client.set_signal("OUTPUT_STATIONARY_ROB_R", 0),
        "writing signal OUTPUT_STATIONARY_ROB_R",
        "rws_reject",
    ),
    (lambda client: client.symbol("T_ROB_R", "TRobMain", "nothing"), "reading TRobMain/nothing of T_ROB_R", "text"),
    (
        lambda client: client.set_symbol("T_ROB_R", "TRobMain", "x", "1"),
        "writing TRobMain/x of T_ROB_R",
        "rws_no_such_symbol",
    ),
    (
        lambda client: client.set_symbol("T_ROB_R", "TRobMain", "current_state", '"x"'),
        "writing TRobMain/current_state of T_ROB_R",
        "rws_syntax",
    ),
    (lambda client: client.joint_target("ROB_1"), "reading the joints of ROB_1", "rws_no_such_mechunit"),
]


@pytest.mark.parametrize(("call", "what", "reason"), REFUSED)
def test_refusal_says_what_was_asked_and_why_not(
    client: RwsClient, call: Callable[[RwsClient], object], what: str, reason: str
) -> None:
    with refused(ControllerRefused, "rws_refused", address=client.address, what=what) as caught:
        call(client)
    assert caught.value.said.values["reason"].code == reason
    assert caught.value.code is not None


def test_refusal_without_a_text_of_ours_has_the_controllers_words(client: RwsClient) -> None:
    with refused(ControllerRefused, "rws_refused") as caught:
        client.symbol("T_ROB_R", "TRobMain", "nothing")
    assert "Symbol not found" in caught.value.said.values["reason"].values["text"]


def test_motors_in_manual_mode_are_refused_with_abbs_code(client: RwsClient, controller: PlainController) -> None:
    controller.mode = OperatingMode.MANUAL_REDUCED
    with refused(ControllerRefused, "rws_refused", reason=message("rws_mode_reject"), status=403) as caught:
        client.set_motors(True)
    assert (caught.value.status, caught.value.code) == (403, -1073445860)
