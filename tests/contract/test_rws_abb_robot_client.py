"""The public client abb-robot-client, unchanged, against the virtual controller: every method of its RWS class."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from rws_bench import PASSWORD, USER

from abb_protocols.rws.values import OperatingMode
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.world import World

rws = pytest.importorskip("abb_robot_client.rws", reason="needs abb-robot-client")

TASK = "T_ROB_L"
_MODULE = """MODULE Data
    PERS num one := 1;
    PERS num many{3} := [1, 2, 3];
    PERS jointtarget home := [[0,0,0,0,0,0],[0,9E9,9E9,9E9,9E9,9E9]];
    PERS jointtarget homes{2} := [[[0,0,0,0,0,0],[0,9E9,9E9,9E9,9E9,9E9]],[[0,0,0,0,0,0],[0,9E9,9E9,9E9,9E9,9E9]]];
ENDMODULE
"""


@pytest.fixture(scope="module")
def site() -> Iterator[Any]:
    """A client, and the controller it talks to."""
    world = World()
    world.controller.files["HOME:/data.mod"] = _MODULE
    world.controller.tasks[TASK].load(_MODULE, "data.mod")
    service = RwsService(world.controller, user=USER, password=PASSWORD)
    lock, over = threading.Lock(), threading.Event()

    def handle(request: Any) -> Any:
        with lock:
            return service.handle(request, time.monotonic())

    def live() -> None:
        while not over.wait(0.02):
            with lock:
                world.cycle({})
                service.advance(time.monotonic())

    with HttpServer(handle, 0) as server:
        thread = threading.Thread(target=live)
        thread.start()
        client = rws.RWS(f"http://{server.address}", USER, PASSWORD)
        yield SimpleNamespace(client=client, controller=world.controller, lock=lock)
        over.set()
        thread.join()


def test_execution_and_panel(site: Any) -> None:
    client = site.client
    assert client.get_operation_mode() == "AUTO"
    client.set_controller_state("motoron")
    assert client.get_controller_state() == "motoron"
    client.resetpp()
    client.start(cycle="once", tasks=["T_ROB_R", TASK])
    assert client.get_execution_state().ctrlexecstate == "running"
    client.stop()
    assert client.get_execution_state().ctrlexecstate == "stopped"
    client.deactivate_task("T_ROB_R")
    assert not client.get_tasks()["T_ROB_R"].active
    client.activate_task("T_ROB_R")
    assert client.get_tasks()["T_ROB_R"].active
    client.set_speedratio(50)
    assert client.get_speedratio() == 50
    client.set_speedratio(100)
    client.set_controller_state("motoroff")


def test_signals(site: Any) -> None:
    client = site.client
    with site.lock:
        signal = site.controller.signals.get("EGM_STOP")
    place = {"network": signal.network, "unit": signal.device}
    client.set_digital_io("EGM_STOP", 1, **place)
    assert client.get_digital_io("EGM_STOP", **place) == 1
    client.set_digital_io("EGM_STOP", 0, **place)
    client.set_analog_io("EGM_STOP", 1, **place)
    assert client.get_analog_io("EGM_STOP", **place) == 1
    client.set_analog_io("EGM_STOP", 0, **place)


def test_data(site: Any) -> None:
    client = site.client
    assert {"one", "many", "home"} <= {each["name"] for each in client.get_rapid_variables(TASK)}
    client.set_rapid_variable("Data/one", "7", TASK)
    assert client.get_rapid_variable("Data/one", TASK) == "7"
    client.set_rapid_variable_num("Data/one", 8.0, TASK)
    assert client.get_rapid_variable_num("Data/one", TASK) == 8.0
    client.set_rapid_variable_num_array("Data/many", [4, 5, 6], TASK)
    assert list(client.get_rapid_variable_num_array("Data/many", TASK)) == [4, 5, 6]
    home = client.get_rapid_variable_jointtarget("Data/home", TASK)
    client.set_rapid_variable_jointtarget("Data/home", home, TASK)
    homes = client.get_rapid_variable_jointtarget_array("Data/homes", TASK)
    assert len(homes) == 2
    client.set_rapid_variable_jointtarget_array("Data/homes", homes, TASK)


def test_positions(site: Any) -> None:
    assert len(site.client.get_jointtarget("ROB_L").robax) == 6
    assert len(site.client.get_robtarget("ROB_L").trans) == 3


def test_files_and_events(site: Any) -> None:
    client = site.client
    assert client.get_ramdisk_path()
    client.upload_file("$HOME/x.txt", b"text")
    assert client.read_file("$HOME/x.txt") == b"text"
    assert "x.txt" in client.list_files("$HOME")
    client.delete_file("$HOME/x.txt")
    assert "x.txt" not in client.list_files("$HOME")
    with site.lock:
        site.controller.set_motors(True)  # an event
    assert client.read_event_log()[0].title


def test_queues(site: Any) -> None:
    client = site.client
    assert client.try_create_ipc_queue("RMQ_w", 4440, 444)
    assert not client.try_create_ipc_queue("RMQ_w", 4440, 444)
    client.send_ipc_message("RMQ_w", "hello", "RMQ_w")
    assert [message.data for message in client.read_ipc_message("RMQ_w")] == ["hello"]
    assert "_embedded" in client.get_ipc_queue("RMQ_w")


def test_right_to_write_in_manual_mode(site: Any) -> None:
    with site.lock:
        site.controller.select_mode(OperatingMode.MANUAL_REDUCED)
    with pytest.raises(rws.ABBException, match="there is no resource /http:"):  # it puts the address in front twice
        site.client.request_rmmp(timeout=10)
    assert site.client._do_get("users/rmmp/poll?json=1")["_embedded"]["_state"][0]["status"] == "GRANTED"
    with site.lock:
        site.controller.select_mode(OperatingMode.AUTO)


def test_subscription(site: Any) -> None:
    seen: list[Any] = []
    with site.lock:
        place = site.controller.signals.get("EGM_STOP")
    site.client.try_create_ipc_queue("RMQ_w")
    request = rws.SubscriptionResourceRequest
    kinds, priority = rws.SubscriptionResourceType, rws.SubscriptionResourcePriority
    resources = [
        request(kinds.ExecutionState, priority.Medium),
        request(kinds.OperationalMode, priority.Medium),
        request(kinds.ControllerState, priority.Medium),
        request(kinds.Elog, priority.Medium),
        request(kinds.IpcQueue, priority.Medium, "RMQ_w"),
        request(kinds.Signal, priority.High, {"signal": "EGM_STOP", "network": place.network, "unit": place.device}),
        request(kinds.PersVar, priority.High, {"name": "Data/one", "task": TASK}),
    ]
    subscription = site.client.subscribe(resources, seen.append)
    site.client.set_controller_state("motoron")
    site.client.set_rapid_variable("Data/one", "11", TASK)
    site.client.set_digital_io("EGM_STOP", 1, network=place.network, unit=place.device)
    site.client.send_ipc_message("RMQ_w", "hello", "RMQ_w")
    expected = {"ControllerState", "VariableValue", "Signal", "IpcMessage", "EventLogEntryEvent"}
    end = time.monotonic() + 10
    while not expected <= {type(each).__name__ for each in seen} and time.monotonic() < end:
        time.sleep(0.05)
    subscription.close()
    subscription.thread.name = "abb-robot-client-output"  # which goes on reconnecting after its end
    assert expected <= {type(each).__name__ for each in seen}
