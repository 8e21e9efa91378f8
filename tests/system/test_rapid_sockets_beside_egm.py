"""Twenty connections to socket servers in RAPID, each served in every cycle, beside two arms under EGM."""

from __future__ import annotations

import selectors
import socket
import statistics
import struct
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from held_arm import HeldArm
from rapid_servers import CONNECTIONS

from abb_protocols.robot.joints import CYCLE
from abb_runtime.udp import free_port
from free_ports import free_tcp_port
from soak import long, short, tell

pytestmark = pytest.mark.real_time
SCRIPT = Path(__file__).with_name("rapid_servers.py")


@pytest.mark.parametrize("seconds", [short(4.0), long(60.0, 180.0)])
def test_servers_answer_in_every_cycle_and_no_cycle_is_missed(seconds: float) -> None:
    ports = [free_port(), free_port(), free_tcp_port(), free_tcp_port()]
    command = [sys.executable, str(SCRIPT), *map(str, ports)]
    with ExitStack() as stack:
        arms = [HeldArm(port) for port in ports[:2]]
        for arm in arms:
            stack.enter_context(arm.socket)
        process = stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        stack.callback(process.terminate)
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        clients = [stack.enter_context(_connected(port)) for port in ports[2:] for _ in range(CONNECTIONS)]
        answered = _exchanged(arms, clients, seconds)
    gaps = [after - before for arm in arms for before, after in zip(arm.times, arm.times[1:], strict=False)]
    tell(
        f"{sum(answered) / seconds:.0f} exchanges/s over {len(clients)} connections; EGM cycle mean "
        f"{statistics.mean(gaps) * 1e3:.3f} ms, longest {max(gaps) * 1e3:.1f} ms"
    )
    for arm in arms:
        begun = len(arm.numbers) - 1 - arm.numbers[::-1].index(0)  # a stream may come before it, with its own numbers
        assert arm.numbers[begun:] == list(range(len(arm.numbers) - begun)), "a cycle is missing"
        assert len(arm.numbers) - begun > 0.95 * (seconds - 1.0) / CYCLE
    assert min(answered) > 0.5 * max(answered) > 0  # no connection is kept waiting for the others


def _connected(port: int, within: float = 20.0) -> socket.socket:
    """A connection to a server that may only be about to listen."""
    end = time.monotonic() + within
    while True:
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=5.0)
        except ConnectionRefusedError:
            if time.monotonic() > end:
                raise
            time.sleep(0.01)


def _exchanged(arms: list[HeldArm], clients: list[socket.socket], seconds: float) -> list[int]:
    """How many requests of each client were answered, which sends its next one when it has the answer."""
    requests = dict.fromkeys(clients, 0)
    with selectors.DefaultSelector() as selector:
        for arm in arms:
            selector.register(arm.socket, selectors.EVENT_READ, arm)
        for client in clients:
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.sendall(struct.pack(">I", 0))
            selector.register(client, selectors.EVENT_READ, None)
        end = time.perf_counter() + seconds
        while time.perf_counter() < end:
            for key, _ in selector.select(0.1):
                if key.data is not None:
                    key.data.answer()
                    continue
                client = key.fileobj
                assert isinstance(client, socket.socket)
                (answer,) = struct.unpack(">I", client.recv(4))
                assert answer == requests[client] + 1
                requests[client] = answer
                client.sendall(struct.pack(">I", answer))
    return list(requests.values())
