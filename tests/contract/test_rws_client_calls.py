"""The client's calls against a controller on the true wire."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import degrees

import pytest

from contract.rws_bench import PlainController, serving
from yumi.errors import CommandRefused, ControllerRefused
from yumi.rws.client import RwsClient
from yumi.rws.documents import Event, ModuleInfo, Signal, TaskInfo
from yumi.rws.services import io
from yumi.rws.types import ControllerState, EventType, ExecutionState, OperatingMode, SignalType, TaskExecution, encode


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
    ready = TaskExecution.READY
    assert client.tasks() == tuple(TaskInfo(name, ready, True, True) for name in ("T_ROB_R", "T_ROB_L"))


def test_clock_is_read_as_the_pendant_shows_it(client: RwsClient, controller: PlainController) -> None:
    assert client.clock().timestamp() == pytest.approx(controller.time, abs=1.0)


def test_modules_are_listed(client: RwsClient) -> None:
    assert client.modules("T_ROB_L") == (ModuleInfo("TRobMain", "ProgMod"), ModuleInfo("TRobSystem", "SysMod"))


@pytest.mark.parametrize("text", ["", "run me", 'say "hi"', "50% + 1 & more; a=b", "ä→\\", "1E+06"])
def test_string_arrives_at_the_controller_and_comes_back(client: RwsClient, text: str) -> None:
    client.set_symbol("T_ROB_R", "TRobSystem", "routine_name_input", encode(text))
    assert client.symbol("T_ROB_R", "TRobSystem", "routine_name_input") == encode(text)


def test_symbol_has_a_type(client: RwsClient) -> None:
    assert client.symbol_type("T_ROB_R", "TRobMain", "current_state") == "num"


def test_signal_is_written_and_read(client: RwsClient) -> None:
    client.set_signal("hand_MaxSpeed_R", 120)
    assert client.signal("hand_MaxSpeed_R") == Signal("hand_MaxSpeed_R", SignalType.GROUP_OUTPUT, 120.0)


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
    read = io.get
    monkeypatch.setattr(io, "get", lambda path, *query: read(path, *(query or first)))
    assert list(client.signals()) == list(PlainController().signals.names)


def test_pulse_is_refused_when_something_holds_the_signal(
    client: RwsClient, controller: PlainController, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(controller.signals, "set", lambda name, value: None)
    with pytest.raises(CommandRefused, match=r"EGM_START_JOINT of .* does not keep the value 1; find what else"):
        client.pulse_signal("EGM_START_JOINT")


def test_joint_target_is_in_chain_order_and_radians(client: RwsClient) -> None:
    target_deg = [degrees(angle) for angle in client.joint_target("ROB_R")]
    assert target_deg == pytest.approx([0.0, -130.0, -135.0, 30.0, 0.0, 40.0, 0.123456])


def test_speed_ratio_is_set_and_read(client: RwsClient) -> None:
    client.set_speed_ratio(30)
    assert client.speed_ratio() == 30


@pytest.mark.parametrize("percent", [-1, 101])
def test_speed_ratio_beyond_its_range_is_refused(client: RwsClient, percent: int) -> None:
    with pytest.raises(CommandRefused, match=f"speed ratio of {percent} % is not possible; give 0 to 100"):
        client.set_speed_ratio(percent)
    assert client.speed_ratio() == 100


def test_events_come_newest_first(client: RwsClient, controller: PlainController) -> None:
    controller.events.append(10011, "Motors ON state", "The system is on.")
    controller.events.append(10010, "Motors OFF state")
    newest, older = client.events()
    assert newest.title == "Motors OFF state"
    assert older == Event(
        1, EventType.INFORMATION, 10011, "2026-07-09 T 00:00:00", "Motors ON state", "The system is on."
    )


@pytest.mark.parametrize("count", [0, 1, 50, 51, 110, 200])
def test_events_are_gathered_over_pages(client: RwsClient, controller: PlainController, count: int) -> None:
    for number in range(120):
        controller.events.append(10011, f"event {number}")
    titles = [event.title for event in client.events(count=count)]
    assert titles == [f"event {number}" for number in range(119, -1, -1)][:count]


REFUSED: list[tuple[Callable[[RwsClient], object], str]] = [
    (RwsClient.start_rapid, "starting RAPID was refused: the state of the RAPID execution forbids it"),
    (lambda client: client.signal("nothing"), "reading signal nothing was refused: the controller has nothing"),
    (lambda client: client.set_signal("OUTPUT_STATIONARY_ROB_R", 0), 'a signal needs Access "All"'),
    (lambda client: client.symbol("T_ROB_R", "TRobMain", "nothing"), "Symbol not found"),
    (lambda client: client.set_symbol("T_ROB_R", "TRobMain", "x", "1"), "no such RAPID symbol; load"),
    (lambda client: client.set_symbol("T_ROB_R", "TRobMain", "current_state", '"x"'), "not a RAPID value"),
    (lambda client: client.joint_target("ROB_1"), "no such mechanical unit"),
]


@pytest.mark.parametrize(("call", "sentence"), REFUSED)
def test_refusal_says_what_was_asked_and_why_not(
    client: RwsClient, call: Callable[[RwsClient], object], sentence: str
) -> None:
    with pytest.raises(ControllerRefused) as refused:
        call(client)
    assert sentence in str(refused.value)
    assert str(refused.value).startswith("127.0.0.1:")
    assert refused.value.code is not None


def test_motors_in_manual_mode_are_refused_with_abbs_code(client: RwsClient, controller: PlainController) -> None:
    controller.mode = OperatingMode.MANUAL_REDUCED
    with pytest.raises(ControllerRefused, match="switch the controller to AUTO") as refused:
        client.set_motors(True)
    assert (refused.value.status, refused.value.code) == (403, -1073445860)
