"""Prints how regularly the virtual robot sends its datagrams while other programs take all the processors they get.

A virtual controller in a process of its own runs EGM on both arms, is asked for its state as a driver asks, and gets an
answer to every datagram. Arrival times are the kernel's, so that this program may be late itself::

    python benchmarks/virtual_robot_under_load.py --seconds 60 --loops 2
"""

from __future__ import annotations

import argparse
import os
import socket
import struct
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from threading import Event as Flag
from threading import Thread

from abb_protocols.robot.joints import Joints, Side
from abb_runtime.clock import SystemClock
from abb_runtime.rws.client import RwsClient
from virtual_irc5.testing.controller_process import ControllerProcess
from yumi.driver.bringup import Bringup
from yumi.driver.state_machine import EgmMotionSettings
from yumi.egm.joint_codec import JointCodec

SO_TIMESTAMPNS = 35  # Linux; Python has no name for it
BUSY_LOOP = "while True: pass"
SILENCE = 0.020
"""After so long the driver says that EGM feedback is lost [s]."""


class Sensor:
    """Holds one arm where it stands, and notes when each datagram reached this machine's kernel [s]."""

    def __init__(self, port: int) -> None:
        self.arrivals: list[float] = []
        self._codec = JointCodec()
        self._goal: Joints | None = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._socket.settimeout(0.5)
        self._socket.bind(("127.0.0.1", port))

    def run(self, is_over: Flag) -> None:
        while not is_over.is_set():
            try:
                datagram, ancillary, _, robot = self._socket.recvmsg(2048, 64)
            except TimeoutError:
                continue
            seconds, nanoseconds = struct.unpack("qq", ancillary[0][2])
            self.arrivals.append(seconds + 1e-9 * nanoseconds)
            report = self._codec.decode(datagram)
            self._goal = self._goal or report.measured
            self._socket.sendto(self._codec.encode_joints(report.seqno, self._goal, None), robot)
        self._socket.close()


def measure(seconds: float, loops: int) -> dict[Side, list[float]]:
    """The times between two datagrams of each arm [s]."""
    is_over = Flag()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        controller = stack.enter_context(ControllerProcess(folder / "log", {"calibrated": True}))
        sensors = {side: Sensor(port) for side, port in controller.egm_ports.items()}
        threads = [Thread(target=sensor.run, args=(is_over,)) for sensor in sensors.values()]
        for thread in threads:
            thread.start()
            stack.callback(thread.join)
        stack.callback(is_over.set)
        client = stack.enter_context(RwsClient(controller.address))
        bringup = Bringup(client, EgmMotionSettings(), SystemClock(), lambda step: None)
        bringup.make_ready()
        bringup.start_egm()
        for _ in range(loops):  # in sessions of their own, as programs of other terminals are
            loop = subprocess.Popen([sys.executable, "-S", "-c", BUSY_LOOP], start_new_session=True)
            stack.callback(loop.wait)
            stack.callback(loop.kill)
        begin = {side: len(sensor.arrivals) for side, sensor in sensors.items()}
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            client.controller_state()  # its session limits the rate
        arrivals = {side: sensor.arrivals[begin[side] :] for side, sensor in sensors.items()}
    return {side: [after - before for before, after in pairwise(each)] for side, each in arrivals.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="how long EGM runs")
    parser.add_argument("--loops", type=int, default=2, help="busy loops beside it")
    chosen = parser.parse_args()
    print(f"{chosen.seconds:g} s beside {chosen.loops} busy loops on {os.cpu_count()} processors:")
    for side, gaps in measure(chosen.seconds, chosen.loops).items():
        gaps.sort()
        median, p999, longest = (1e3 * gaps[int(share * (len(gaps) - 1))] for share in (0.5, 0.999, 1.0))
        lost = sum(gap > SILENCE for gap in gaps)
        print(
            f"{side.word:5}  {len(gaps)} datagrams, gaps: median {median:.1f} ms, p99.9 {p999:.1f} ms, "
            f"longest {longest:.1f} ms, {lost} longer than {1e3 * SILENCE:.0f} ms"
        )


if __name__ == "__main__":
    main()
