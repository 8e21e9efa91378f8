"""A proxy before a web server on loopback that answers as no controller does, as long as a test wants it to."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

Attack = Callable[["HostileServer", socket.socket], None]
"""Answers one request on a connection; returning lets it go on, an OSError ends it."""

DROP = 0.05
"""Time between two drops of an answer that drips [s]; shorter than any timeout."""


class HostileServer:
    """Passes on what comes, unless an attack is set; connections stay open when that changes.

    Args:
        upstream: address of the true server.

    Attributes:
        address: of the proxy.
        attack: how requests are answered from now on; None passes them on.
        targets: only requests whose first line has this in it are attacked.
        injected: header lines that are put into every answer that is passed on.
        attacked: how many requests were attacked.
    """

    def __init__(self, upstream: str) -> None:
        host, _, port = upstream.rpartition(":")
        self._upstream = (host, int(port))
        self.attack: Attack | None = None
        self.targets = ""
        self.injected = b""
        self.attacked = 0
        self._is_over = threading.Event()
        self._server = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._server.getsockname()[1]}"
        self._ends: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept)]
        self._threads[0].start()

    def close(self) -> None:
        self._is_over.set()
        self._server.shutdown(socket.SHUT_RDWR)
        self._threads[0].join()
        self._server.close()
        for end in self._ends:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for end in self._ends:
            end.close()

    def drip(self, end: socket.socket, head: bytes, drop: bytes) -> None:
        """``head``, then a drop now and then until the peer has had enough."""
        end.sendall(head)
        while not self._is_over.wait(DROP):
            end.sendall(drop)

    def _accept(self) -> None:
        while True:
            try:
                end, _ = self._server.accept()
            except OSError:
                return
            true = socket.create_connection(self._upstream)
            self._ends += [end, true]
            for work in (self._forth, self._back):
                thread = threading.Thread(target=work, args=(end, true))
                self._threads.append(thread)
                thread.start()

    def _forth(self, end: socket.socket, true: socket.socket) -> None:
        with suppress(OSError):
            while data := end.recv(65536):
                attack = self.attack
                if attack is None or self.targets.encode() not in data.partition(b"\r\n")[0]:
                    true.sendall(data)
                else:
                    self.attacked += 1
                    attack(self, end)
        for each in (end, true):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)

    def _back(self, end: socket.socket, true: socket.socket) -> None:
        with suppress(OSError):
            while data := true.recv(65536):
                if self.injected and data.startswith(b"HTTP/"):
                    status, _, rest = data.partition(b"\r\n")
                    data = status + b"\r\n" + self.injected + rest
                end.sendall(data)


@contextmanager
def hostile_before(upstream: str) -> Iterator[HostileServer]:
    """A proxy before the server at ``upstream``."""
    server = HostileServer(upstream)
    try:
        yield server
    finally:
        server.close()


def answer(body: bytes, kind: str = "application/xhtml+xml", status: str = "200 OK") -> Attack:
    """The same whole answer to everything."""
    head = f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\n\r\n".encode()
    return lambda server, end: end.sendall(head + body)


def dripping(head: bytes, drop: bytes = b"x") -> Attack:
    """An answer that begins with ``head`` and then drips."""
    return lambda server, end: server.drip(end, head, drop)


def flood(head: bytes, wave: bytes) -> Attack:
    """An answer that never ends, as fast as it can be taken."""

    def pour(server: HostileServer, end: socket.socket) -> None:
        end.sendall(head)
        while True:
            end.sendall(wave)

    return pour


def cut(head: bytes = b"", *, is_reset: bool = False) -> Attack:
    """``head``, then the end of the connection."""

    def break_off(server: HostileServer, end: socket.socket) -> None:
        end.sendall(head)
        if is_reset:
            end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        raise ConnectionResetError("the attack ends the connection")

    return break_off


def _nested_lists(depth: int) -> bytes:
    lists = b"<ul><li>" * depth + b"</li></ul>" * depth
    return b'<html xmlns="http://www.w3.org/1999/xhtml"><body><div class="state">' + lists + b"</div></body></html>"


def _nested_states(depth: int) -> bytes:
    return b'{"_embedded":{"_state":[' + b'{"_type":"a","state":[' * depth + b"]}" * depth + b"]}}"


OK = b"HTTP/1.1 200 OK\r\nContent-Type: application/xhtml+xml\r\n"

ATTACKS: dict[str, Attack] = {
    "status line drips": dripping(b"HTTP/1.1 200 O", b"K"),
    "headers drip": dripping(OK + b"X-Drop: "),
    "header lines drip": dripping(OK, b"X-Drop: x\r\n"),
    "102 Processing drips": dripping(b"", b"HTTP/1.1 102 Processing\r\n\r\n"),
    "102 Processing floods": flood(b"", b"HTTP/1.1 102 Processing\r\n\r\n" * 100),
    "headers flood": flood(OK, b"X-Wave: x\r\n" * 100),
    "one header floods": flood(OK + b"X-Wave: ", b"x" * 10_000),
    "body drips": dripping(OK + b"Content-Length: 1000000\r\n\r\n"),
    "chunks drip": dripping(OK + b"Transfer-Encoding: chunked\r\n\r\n", b"1\r\nx\r\n"),
    "body floods": flood(OK + b"Content-Length: 100000000000\r\n\r\n", b"x" * 100_000),
    "nothing": lambda server, end: None,
    "1000 nested lists": answer(_nested_lists(1000)),
    "100000 nested lists": answer(_nested_lists(100_000)),
    "300 nested states": answer(_nested_states(300), "application/json"),
    "100000 nested states": answer(_nested_states(100_000), "application/json"),
    "503 storm": answer(b"", status="503 Service Unavailable"),
    "400 storm": answer(b"", status="400 Bad Request"),
    "no type": lambda server, end: end.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n"),
    "reset": cut(is_reset=True),
    "reset in the body": cut(OK + b"Content-Length: 100\r\n\r\nx", is_reset=True),
    "end in the headers": cut(OK),
    "end in the body": cut(OK + b"Content-Length: 100\r\n\r\nx"),
    "random bytes": cut(bytes(range(256)) * 16),
}
"""Each answers one request, and the next one, as no controller does."""
