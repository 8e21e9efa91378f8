"""An echo beside what a test measures: how long the machine takes now for a datagram to another process and back."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from threading import Event, Thread
from types import TracebackType

PERIOD = 0.005
"""Between two datagrams [s]."""

_PATIENCE = 2.0  # [s]
_SERVED = """
import socket

with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as served:
    served.bind(("127.0.0.1", 0))
    print(served.getsockname()[1], flush=True)
    while True:
        datagram, peer = served.recvfrom(64)
        served.sendto(datagram, peer)
"""


class Echo:
    """A process that sends each datagram back, asked again and again within the ``with`` block."""

    def __init__(self) -> None:
        self._took: list[tuple[float, float]] = []  # when each was due, on the monotonic clock, and how long it took
        self._is_over = Event()
        self._thread = Thread(target=self._run, name="echo")

    def __enter__(self) -> Echo:
        self._process = subprocess.Popen([sys.executable, "-c", _SERVED], stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        self._port = int(self._process.stdout.readline())
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_over.set()
        self._thread.join()
        self._process.terminate()
        self._process.communicate()

    def longest(self, begin: float, end: float) -> float:
        """How long the slowest datagram took that was under way between two times of the monotonic clock [s]."""
        return max(took for due, took in tuple(self._took) if due < end and due + took > begin - 2.0 * PERIOD)

    def _run(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
            asked.settimeout(_PATIENCE)
            asked.connect(("127.0.0.1", self._port))
            due = time.monotonic() + PERIOD
            while not self._is_over.wait(max(0.0, due - time.monotonic())):
                asked.send(b"echo")
                asked.recv(64)
                now = time.monotonic()
                self._took.append((due, now - due))
                due = now + PERIOD
