"""A virtual controller whose EGM sockets write down every datagram that passes; a program of its own, and its reader.

``python tests/system/tapped_controller.py <folder> <left EGM port> <right EGM port>`` prints its RWS port and serves
until its standard input ends.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from struct import Struct
from threading import Event as Flag
from threading import Thread

from abb_protocols.robot.joints import Side
from abb_runtime.clock import SystemClock
from abb_runtime.udp import UdpClient, free_port

from wire_faults import Tapped  # isort: skip - the folder of this file is on the path, as for tests

_ENTRY = Struct("<d?H")  # time [s], whether it was received, length [bytes]
_LOOK = 0xFFFF  # instead of a length: the robot looked for datagrams


class TappedLink(UdpClient):
    """The robot's end of an arm's wire."""

    def __init__(self, host: str, port: int, file: Path) -> None:
        super().__init__(host, port)
        self._clock = SystemClock()
        self._file = file.open("wb", buffering=0)

    def send(self, datagram: bytes) -> None:
        super().send(datagram)
        self._file.write(_ENTRY.pack(self._clock.now(), False, len(datagram)) + datagram)

    def receive(self) -> list[bytes]:
        datagrams, now = super().receive(), self._clock.now()
        entries = [_ENTRY.pack(now, True, len(each)) + each for each in datagrams]
        self._file.write(b"".join((_ENTRY.pack(now, True, _LOOK), *entries)))
        return datagrams

    def close(self) -> None:
        super().close()
        self._file.close()


class TappedController:
    """The program as a child of this process.

    Attributes:
        rws_port: where its Robot Web Services are, once it was started.
        egm_ports: where its arms send their datagrams.
        passed: what has passed, as far as it was read.
    """

    def __init__(self, folder: Path) -> None:
        self.rws_port = 0
        self.egm_ports = {side: free_port() for side in Side}
        self.passed = {side: Tapped() for side in Side}
        self._folder = folder
        self._places = dict.fromkeys(Side, 0)

    def start(self) -> None:
        ports = (self.egm_ports[Side.LEFT], self.egm_ports[Side.RIGHT])
        self._process = subprocess.Popen(
            [sys.executable, __file__, str(self._folder), *map(str, ports)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        assert self._process.stdout is not None
        self.rws_port = int(self._process.stdout.readline())

    def stop(self) -> None:
        self._process.communicate(timeout=20.0)

    def read(self) -> None:
        """Take in what has passed since the last look."""
        for side, passed in self.passed.items():
            with _file(self._folder, self.egm_ports[side]).open("rb") as file:
                file.seek(self._places[side])
                self._places[side] += _take(file.read(), passed)


def _take(entries: bytes, passed: Tapped) -> int:
    """Add whole entries; how many bytes they were."""
    at = 0
    while at + _ENTRY.size <= len(entries):
        time, is_received, length = _ENTRY.unpack_from(entries, at)
        size = 0 if length == _LOOK else length
        datagram = entries[at + _ENTRY.size : at + _ENTRY.size + size]
        if len(datagram) < size:
            break
        if length == _LOOK:
            passed.note_received(time, ())
        elif is_received:
            passed.note_heard(time, datagram)
        else:
            passed.note_sent(datagram)
        at += _ENTRY.size + size
    return at


def _file(folder: Path, port: int) -> Path:
    return folder / f"egm_{port}.bin"


def main(folder: Path, left_port: int, right_port: int) -> None:
    """Serve until standard input ends."""
    from virtual_irc5.server import VirtualController
    from virtual_irc5.world import WorldSettings

    def link(host: str, port: int) -> UdpClient:
        file = _file(folder, port)
        return UdpClient(host, port) if file.exists() else TappedLink(host, port, file)

    settings = WorldSettings(
        robot_name="Tapped",
        egm_ports={Side.LEFT: left_port, Side.RIGHT: right_port},
        grippers_are_calibrated=True,
        start_time=time.time(),
    )
    is_over = Flag()
    controller = VirtualController(
        settings, rws_port=0, user="Default User", password="robotics", host="127.0.0.1", link=link
    )
    Thread(target=lambda: (sys.stdin.read(), is_over.set()), daemon=True).start()
    controller.run(is_over, lambda port: print(port, flush=True))  # noqa: T201 - its parent reads it


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
