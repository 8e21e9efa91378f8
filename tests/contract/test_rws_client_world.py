"""The client against the whole virtual controller: its RAPID program runs, its configuration answers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees

import pytest

from abb_protocols.robot.joints import Side, home
from abb_protocols.rws.values import ControllerState, ExecutionState, TaskExecution
from abb_runtime.rws.client import RwsClient
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.world import World

TASKS = ("T_ROB_R", "T_ROB_L")


@contextmanager
def connected(world: World) -> Iterator[RwsClient]:
    adapter = RwsService(world.controller, user="Default User", password="robotics")

    def handle(request: HttpRequest) -> HttpReply:
        return adapter.handle(request, world.controller.time)

    with HttpServer(handle, port=0) as server, RwsClient(server.address) as client:
        yield client


@pytest.fixture
def world() -> World:
    return World()


@pytest.fixture
def client(world: World) -> Iterator[RwsClient]:
    with connected(world) as client:
        yield client


@pytest.fixture
def idle_client(world: World, client: RwsClient) -> RwsClient:
    """A client of a controller whose state machines are idle."""
    client.set_motors(True)
    client.move_pp_to_main()
    client.start_rapid()
    for _ in range(10):
        world.cycle({})
    return client


def states(client: RwsClient) -> list[str]:
    return [client.symbol(task, "TRobMain", "current_state") for task in TASKS]


def test_controller_starts_with_motors_off_and_rapid_stopped(client: RwsClient) -> None:
    assert client.controller_state() is ControllerState.MOTORS_OFF
    assert client.execution() is ExecutionState.STOPPED
    assert [task.name for task in client.tasks()] == list(TASKS)


def test_bring_up_ends_in_idle(idle_client: RwsClient) -> None:
    assert [task.execution for task in idle_client.tasks()] == [TaskExecution.STARTED] * 2
    assert states(idle_client) == ["0", "0"]


def test_state_has_changed_when_the_pulse_is_answered(idle_client: RwsClient) -> None:
    idle_client.pulse_signal("EGM_START_JOINT")
    assert states(idle_client) == ["3", "3"]


def test_settings_of_egm_are_written_and_read_as_one_record(client: RwsClient) -> None:
    settings = client.symbol("T_ROB_L", "TRobEGM", "settings").replace(",20,4,1]", ",0,4,250]")
    client.set_symbol("T_ROB_L", "TRobEGM", "settings", settings)
    assert client.symbol("T_ROB_L", "TRobEGM", "settings") == settings
    assert client.symbol_type("T_ROB_L", "TRobEGM", "settings") == "EGMSettings"


@pytest.mark.parametrize("side", Side)
def test_arm_stands_where_the_robot_stands(client: RwsClient, side: Side) -> None:
    expected_deg = [degrees(angle) for angle in home(side)]
    assert [degrees(angle) for angle in client.joint_target(side.unit)] == pytest.approx(expected_deg)


def test_event_log_tells_what_the_client_did(idle_client: RwsClient) -> None:
    assert {10011, 10150} <= {event.code for event in idle_client.events()}
