"""Many clients of Robot Web Services in one process, light enough to leave the processor to the controller.

``python rws_load.py ADDRESS CLIENTS RATE SECONDS`` prints a line of JSON. Each client has a session, a subscription to
a signal at high priority with its WebSocket, and sends RATE requests a second; one more client changes the signal.
"""

from __future__ import annotations

import json
import os
import re
import selectors
import socket
import sys
import time
from dataclasses import dataclass, field

from digest_client import authorization

USER, PASSWORD = "Default User", "robotics"
SIGNAL = "custom_DO_0"
CHANGE_PERIOD = 0.25  # [s]; high priority has 50 ms between two events
FEWEST_BETWEEN = 0.1  # [s]; also after this process stood still, lest the controller rightly reports only the last
TARGETS = (
    "/rw/panel/ctrlstate",
    "/rw/rapid/execution",
    f"/rw/iosystem/signals/{SIGNAL}",
    "/rw/rapid/symbol/data/RAPID/T_ROB_R/TRobMain/current_state",
    "/rw/motionsystem/mechunits/ROB_L/jointtarget",
    "/rw/rapid/tasks?json=1",
)
PING, PONG = b"\x89\x00", b"\x8a\x80\0\0\0\0"
"""Frames without a message (RFC 6455); the controller ends a subscription whose client leaves a ping unanswered."""
_FORM = "application/x-www-form-urlencoded"


def request(method: str, target: str, cookies: str, body: str = "", more: str = "") -> bytes:
    kind = f"Content-Type: {_FORM}\r\nContent-Length: {len(body)}\r\n" if method == "POST" else ""
    cookie = f"Cookie: {cookies}\r\n" if cookies else ""
    return f"{method} {target} HTTP/1.1\r\nHost: yumi\r\n{cookie}{kind}{more}\r\n{body}".encode()


def response(link: socket.socket) -> tuple[int, bytes]:
    """Status and all bytes of a response that is waited for."""
    data = b""
    while not is_complete(data):
        part = link.recv(65536)
        if not part:
            raise ConnectionError("the controller closed the connection")
        data += part
    return int(data.split(b" ", 2)[1]), data


def is_complete(data: bytes) -> bool:
    head, separator, body = data.partition(b"\r\n\r\n")
    if not separator:
        return False
    length = re.search(rb"(?i)content-length: *(\d+)", head)
    return len(body) >= (int(length[1]) if length else 0)


@dataclass(slots=True)
class Client:
    """One client; times in [s]."""

    http: socket.socket
    cookies: str = ""
    events: socket.socket | None = None
    due: float = 0.0
    sent_at: float = 0.0
    is_waiting: bool = False
    received: bytes = b""
    count: int = 0
    errors: list[str] = field(default_factory=list)
    delays: list[float] = field(default_factory=list)

    def log_in(self) -> None:
        self.http.sendall(request("GET", "/rw", ""))
        _, challenge = response(self.http)
        found = re.search(rb"(?i)www-authenticate: *([^\r]*)", challenge)
        assert found is not None
        proof = authorization(found[1].decode(), user=USER, password=PASSWORD, method="GET", uri="/rw")
        self.http.sendall(request("GET", "/rw", "", more=f"Authorization: {proof}\r\n"))
        status, reply = response(self.http)
        assert status == 200, reply
        self.cookies = "; ".join(each.decode() for each in re.findall(rb"(?i)set-cookie: *([^;\r]*)", reply))

    def subscribe(self, address: tuple[str, int]) -> None:
        body = f"resources=1&1=/rw/iosystem/signals/{SIGNAL};state&1-p=2"
        self.http.sendall(request("POST", "/subscription", self.cookies, body))
        status, reply = response(self.http)
        assert status == 201, reply
        group = re.search(rb"/poll/\d+", reply)
        assert group is not None
        self.events = socket.create_connection(address)
        self.events.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        upgrade = (
            "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: robapi2_subscription\r\n"
        )
        self.events.sendall(request("GET", group[0].decode(), self.cookies, more=upgrade))
        status, reply = response(self.events)
        assert status == 101, reply

    def send(self, now: float, message: bytes) -> None:
        self.http.sendall(message)
        self.count += 1
        self.is_waiting, self.sent_at, self.received = True, now, b""

    def receive(self) -> None:
        data = self.http.recv(65536)
        self.received += data
        if not data:
            self.errors.append("closed")
        if is_complete(self.received):
            self.is_waiting = False
            self.delays.append(time.monotonic() - self.sent_at)
            if not self.received.startswith((b"HTTP/1.1 200", b"HTTP/1.1 204")):
                self.errors.append(self.received[:80].decode())


class Load:
    """Sends and receives in one thread.

    Args:
        readers: send ``rate`` requests a second each, and have events.
        writer: changes the signal.
    """

    def __init__(self, readers: list[Client], writer: Client, rate: float) -> None:
        self.changes = 0
        self._readers = readers
        self._writer = writer
        self._rate = rate
        self._changed_at = 0.0

    def run(self, seconds: float) -> list[float]:
        """The latency of each event [s]."""
        latencies: list[float] = []
        begin = time.monotonic() + 0.1
        with selectors.DefaultSelector() as selector:
            selector.register(self._writer.http, selectors.EVENT_READ, (self._writer, False))
            for index, client in enumerate(self._readers):
                client.due = begin + index / len(self._readers) / self._rate
                assert client.events is not None
                selector.register(client.http, selectors.EVENT_READ, (client, False))
                selector.register(client.events, selectors.EVENT_READ, (client, True))
            self._writer.due = begin
            while (now := time.monotonic()) < begin + seconds:
                # The last change is a second before the end, so that its events have come by then.
                self._send(now, may_change=now < begin + seconds - 1.0)
                for key, _ in selector.select(0.001):
                    client, is_event = key.data
                    if is_event:
                        data = client.events.recv(65536)
                        if PING in data:
                            client.events.sendall(PONG)
                        elif not data:
                            client.errors.append("the controller ended a subscription")
                            selector.unregister(client.events)
                        latencies += [time.monotonic() - self._changed_at] * data.count(b"ios-signalstate-ev")
                    else:
                        client.receive()
        return latencies

    def _send(self, now: float, *, may_change: bool) -> None:
        for client in self._readers:
            if now >= client.due and not client.is_waiting:
                client.send(now, request("GET", TARGETS[client.count % len(TARGETS)], client.cookies))
                client.due += 1.0 / self._rate
        if may_change and now >= self._writer.due and not self._writer.is_waiting:
            self.changes += 1
            self._changed_at = time.monotonic()
            target, form = f"/rw/iosystem/signals/{SIGNAL}?action=set", f"lvalue={self.changes % 2}"
            self._writer.send(now, request("POST", target, self._writer.cookies, form))
            self._writer.due = max(self._writer.due + CHANGE_PERIOD, now + FEWEST_BETWEEN)


def load(address: tuple[str, int], number: int, rate: float, seconds: float) -> dict[str, object]:
    """What came of ``number`` clients in ``seconds``."""
    clients = [Client(socket.create_connection(address)) for _ in range(number + 1)]
    *readers, writer = clients
    for client in clients:
        client.http.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.log_in()
    for client in readers:
        client.subscribe(address)
    used, traffic = os.times(), Load(readers, writer, rate)
    latencies = sorted(traffic.run(seconds))
    after = os.times()
    delays = sorted(delay for client in readers for delay in client.delays)
    return {
        "requests_per_second": len(delays) / seconds,
        "errors": [error for client in clients for error in client.errors],
        "changes": traffic.changes,
        "events": len(latencies),
        "event_ms": [round(1e3 * latencies[int(share * (len(latencies) - 1))], 1) for share in (0.5, 0.99, 1.0)],
        "answer_ms": [round(1e3 * delays[int(share * (len(delays) - 1))], 1) for share in (0.5, 0.99, 1.0)],
        "own_processor_share": round((after.user + after.system - used.user - used.system) / seconds, 3),
    }


def main() -> None:
    host, _, port = sys.argv[1].partition(":")
    found = load((host, int(port)), int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4]))
    sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main()
