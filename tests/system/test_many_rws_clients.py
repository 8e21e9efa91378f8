"""Many clients with subscriptions and 20 requests a second each, beside both arms under EGM."""

from __future__ import annotations

import json
import os
import socket
import statistics
import subprocess
import sys
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from threading import Event, Thread
from typing import Any, NamedTuple

import pytest
from held_arm import HeldArm, answer_all
from rws_load import Client, Load

from abb_protocols.robot.joints import CYCLE, Side
from abb_runtime.clock import SystemClock, wait_until
from abb_runtime.rws.client import RwsClient
from soak import tell
from virtual_irc5.testing.controller_process import ControllerProcess
from yumi.driver.state_machine import MachineState, read_machine_state

pytestmark = [pytest.mark.real_time, pytest.mark.alone]
SCRIPT = Path(__file__).with_name("rws_load.py")
RATE = 20.0


def test_changes_keep_their_distance_after_this_process_stood_still() -> None:
    """Of two changes within 50 ms the controller may report the last alone, which is no loss."""
    own, other = socket.socketpair()
    with own, other:
        writer = Client(own)
        load, times = Load([], writer, RATE), []
        for now in [0.0, *(1.2 + 0.01 * step for step in range(100))]:
            before = load.changes
            load._send(now, may_change=True)
            writer.is_waiting = False  # it is answered at once
            times += [now] * (load.changes - before)
    assert min(after - before for before, after in pairwise(times)) >= 0.1
    assert len(times) >= 5


class Beside(NamedTuple):
    """What clients and both arms have seen beside each other.

    Attributes:
        found: what the clients tell.
        numbers: of the datagrams of each arm.
        gaps: between the datagrams of an arm [s].
    """

    found: dict[str, Any]
    numbers: list[list[int]]
    gaps: list[float]


def load(clients: int, seconds: float, tmp_path: Path) -> Beside:
    is_over = Event()
    with ExitStack() as stack:
        controller = ControllerProcess(tmp_path / "log", {"calibrated": True})
        arms = [HeldArm(controller.egm_ports[side]) for side in Side]
        for arm in arms:
            stack.enter_context(arm.socket)
        stack.enter_context(controller)
        thread = Thread(target=answer_all, args=(arms, is_over))
        thread.start()
        stack.callback(thread.join)
        stack.callback(is_over.set)
        client = stack.enter_context(RwsClient(controller.address))
        client.set_motors(True)
        client.move_pp_to_main()
        client.start_rapid()
        for state, signal in ((MachineState.IDLE, "EGM_START_JOINT"), (MachineState.RUN_EGM_ROUTINE, "")):
            wait_until(
                SystemClock(),
                lambda state=state: all(  # type: ignore[misc]
                    read_machine_state(client, side) is state for side in Side
                ),
                10.0,
                f"The state machine does not reach {state}.",
            )
            if signal:
                client.pulse_signal(signal)
        counts = [len(arm.numbers) for arm in arms]
        command = [sys.executable, str(SCRIPT), controller.address, str(clients), str(RATE), str(seconds)]
        helpers = {**os.environ, "PYTHONPATH": str(SCRIPT.parents[1])}
        done = subprocess.run(command, env=helpers, capture_output=True, text=True, check=True, timeout=seconds + 60.0)
        numbers = [arm.numbers[count:] for arm, count in zip(arms, counts, strict=True)]
        times = [arm.times[count:] for arm, count in zip(arms, counts, strict=True)]
    found = json.loads(done.stdout)
    gaps = [after - before for each in times for before, after in pairwise(each)]
    found["cycle_mean_ms"] = round(1e3 * statistics.mean(gaps), 3)
    tell(json.dumps(found))
    assert found["errors"] == []
    assert found["changes"] > 0
    assert found["events"] == found["changes"] * clients  # none is lost
    return Beside(found, numbers, gaps)


def test_clients_get_every_event_and_egm_goes_on_beside_them(tmp_path: Path) -> None:
    for numbers in load(16, 3.0, tmp_path).numbers:
        assert numbers == sorted(set(numbers))
        assert numbers[-1] - numbers[0] > 1.0 / CYCLE  # what a machine that stood still has missed is let go


@pytest.mark.soak
@pytest.mark.timeout(180)
@pytest.mark.parametrize("clients", [16, 64], ids=["some", "as many as a controller lets in"])
def test_clients_and_egm_do_not_disturb_each_other(clients: int, tmp_path: Path) -> None:
    beside = load(clients, 60.0, tmp_path)
    for numbers in beside.numbers:
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), "a cycle is missing"
    assert beside.found["requests_per_second"] > 0.95 * RATE * clients
    assert beside.found["event_ms"][1] < 50.0
    assert statistics.mean(beside.gaps) < 1.01 * CYCLE
