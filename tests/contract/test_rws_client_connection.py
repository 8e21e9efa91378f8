"""What the client does, and says, when login or connection are not as they should be."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import ControllerRefused, LoginRefused, NoConnection, ProtocolError, SettingsError, YumiError
from abb_runtime.clock import ManualClock
from abb_runtime.rws.client import RwsClient
from abb_runtime.rws.transport import AnswerTimeout
from contract.rws_bench import PASSWORD, PlainController, serving
from refusals import assert_says, refused
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.rws_service import RwsService
from yumi.driver.settings import RobotSettings

HTML = (("Content-Type", "text/html"),)
BASIC = ("WWW-Authenticate", 'Basic realm="validusers@robapi.abb"')
ROUTER = ("WWW-Authenticate", 'Digest realm="router", nonce="1", qop="auth"')


@pytest.fixture
def controller() -> PlainController:
    return PlainController()


@pytest.fixture
def address(controller: PlainController) -> Iterator[str]:
    with serving(controller) as address:
        yield address


@contextmanager
def greeting(words: bytes, at: tuple[str, int] = ("127.0.0.1", 0)) -> Iterator[str]:
    """A server that says ``words`` to whoever connects, hears what they say, and hangs up."""
    with socket.create_server(at) as server:
        thread = threading.Thread(target=_greet, args=(server, words))
        thread.start()
        try:
            yield f"127.0.0.1:{server.getsockname()[1]}"
        finally:
            server.shutdown(socket.SHUT_RDWR)
            thread.join()


def _greet(server: socket.socket, words: bytes) -> None:
    while True:
        try:
            peer, _ = server.accept()
        except OSError:
            return
        with peer:
            peer.recv(4096)
            peer.sendall(words)


@contextmanager
def dripping(head: bytes, drop: bytes) -> Iterator[str]:
    """A server whose answer begins with ``head`` and goes on with ``drop`` as long as somebody listens."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=_drip, args=(server, head, drop))
        thread.start()
        yield f"127.0.0.1:{server.getsockname()[1]}"
        thread.join()


def _drip(server: socket.socket, head: bytes, drop: bytes) -> None:
    peer, _ = server.accept()
    with peer, suppress(OSError):
        peer.recv(4096)
        peer.sendall(head)
        while True:
            peer.sendall(drop)


def refusal(address: str, kind: type[YumiError], **settings: str | float) -> Message:
    with pytest.raises(kind) as caught:
        RwsClient(address, **settings).connect()  # type: ignore[arg-type]
    assert type(caught.value) is kind
    return caught.value.said


def test_wrong_password_is_said(address: str) -> None:
    said = refusal(address, LoginRefused, password="wrong")
    assert said == message("login_refused", address=address, user="Default User")


@pytest.mark.parametrize("user", ["Nobody", "Jürgen", 'a "quoted" one'])
def test_wrong_user_is_said(address: str, user: str) -> None:
    said = refusal(address, LoginRefused, user=user, password=PASSWORD)
    assert said == message("login_refused", address=address, user=user)


def test_user_that_http_cannot_carry_is_refused(address: str) -> None:
    assert_says(refusal(address, ProtocolError, user="two\nlines"), "request_not_http", address=address)


def test_user_with_an_umlaut_is_let_in(controller: PlainController) -> None:
    adapter = RwsService(controller, user="Jürgen", password="größer")
    with (
        HttpServer(lambda request: adapter.handle(request, 0.0), port=0) as server,
        RwsClient(server.address, user="Jürgen", password="größer") as client,
    ):
        assert client.speed_ratio() == 100


def test_answer_that_never_ends_is_given_up() -> None:
    head = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n"
    with dripping(head, b"1\r\nx\r\n") as address:
        said = refusal(address, AnswerTimeout, timeout=0.2)
    assert said == message("answer_not_ended", address=address)


def test_closed_port_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
    assert refusal(address, NoConnection) == message("connection_refused", address=address)


def test_unknown_name_is_said() -> None:
    assert refusal("yumi.invalid", NoConnection) == message("address_unknown", address="yumi.invalid")


def test_machine_that_swallows_all_packets_is_said() -> None:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        address = f"127.0.0.1:{server.getsockname()[1]}"
        with socket.create_connection(server.getsockname()):  # the queue is full now
            said = refusal(address, NoConnection, timeout=0.2)
    assert_says(said, "nothing_at_address", address=address, timeout=pytest.approx(0.2, abs=0.05))


def test_second_address_of_a_name_is_tried_in_time_when_the_first_swallows_all_packets(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    look_up = socket.getaddrinfo

    def look_up_two(host: str, *args: int, **kinds: int) -> object:
        hosts = ("127.0.0.1", "127.0.0.2") if host == "yumi.test" else (host,)
        return [place for each in hosts for place in look_up(each, *args, **kinds)]

    monkeypatch.setattr(socket, "getaddrinfo", look_up_two)
    with socket.socket() as first:
        first.bind(("127.0.0.1", 0))
        first.listen(0)
        port = first.getsockname()[1]
        with socket.create_connection(first.getsockname()), greeting(b"220 smtp ready\r\n\r\n", ("127.0.0.2", port)):
            said = refusal(f"yumi.test:{port}", ProtocolError, timeout=1.0)
    assert said == message("no_http_spoken", address=f"yumi.test:{port}")


def test_machine_that_never_answers_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        said = refusal(address, AnswerTimeout, timeout=0.2)
    assert_says(said, "no_answer_to_request", address=address, timeout=pytest.approx(0.2, abs=0.05))


def test_server_that_does_not_speak_http_is_said() -> None:
    with greeting(b"220 smtp.example.org ready\r\n\r\n") as address:
        said = refusal(address, ProtocolError)
    assert said == message("no_http_spoken", address=address)


@pytest.mark.parametrize("words", [b"", b"SSH-2.0-OpenSSH_9.6\r\n"])
def test_server_that_hangs_up_is_said(words: bytes) -> None:
    with greeting(words) as address, refused(NoConnection, "no_http_answer", address=address):
        RwsClient(address).connect()


@pytest.mark.parametrize(
    ("reply", "reason"),
    [
        (HttpReply(200, HTML, b"<html><body>It works</body></html>"), message("answers_without_session", status=200)),
        (HttpReply(404, HTML, b"<html><body>Not here</body></html>"), message("answers_without_session", status=404)),
        (HttpReply(401, (BASIC,)), message("asks_for_other_login")),
        (HttpReply(401), message("asks_for_other_login")),
        (HttpReply(401, (ROUTER,)), message("login_for_other_realm", realm="router")),
    ],
)
def test_web_server_that_is_no_controller_is_said(reply: HttpReply, reason: Message) -> None:
    with HttpServer(lambda request: reply, port=0) as server:
        said = refusal(server.address, ProtocolError)
    assert said == message("no_controller_answers", address=server.address, reason=reason)


def test_controller_without_a_free_session_is_said(address: str) -> None:
    clients = [RwsClient(address) for _ in range(71)]
    for client in clients[:70]:
        client.connect()
    with refused(ControllerRefused, "sessions_taken", address=address, most=70) as caught:
        clients[70].connect()
    clients[0].close()
    clients[70].connect()
    for client in clients:
        client.close()
    assert caught.value.status == 503


@pytest.mark.parametrize("address", ["", "http://yumi", "yumi:eighty", "yumi:99999", "a b", "user@yumi"])
def test_address_that_is_none_is_refused(address: str) -> None:
    with refused(SettingsError, "no_address", address=address):
        RwsClient(address)


def test_building_a_client_does_nothing() -> None:
    RwsClient("yumi.invalid").close()


def test_client_logs_in_once_and_uses_one_session(address: str, controller: PlainController) -> None:
    with RwsClient(address, clock=ManualClock()) as client:
        for _ in range(100):
            client.operating_mode()
    logins = [request for request in controller.requests if request.header("Authorization")]
    assert len(logins) == 1
    assert len({request.peer for request in controller.requests}) == 1


def test_client_logs_in_again_when_its_session_is_forgotten(address: str, controller: PlainController) -> None:
    with RwsClient(address) as client:
        controller.clock.advance(301.0)
        client.set_speed_ratio(40)
    assert controller.speed_ratio == 40


def test_client_works_on_after_logging_out(address: str) -> None:
    with RwsClient(address) as client:
        client.log_out()
        assert client.speed_ratio() == 100


def test_client_finds_a_controller_that_was_restarted(controller: PlainController) -> None:
    with serving(controller) as address:
        client = RwsClient(address)
        client.connect()
    with pytest.raises(NoConnection):
        client.speed_ratio()
    port = int(address.rpartition(":")[2])
    with serving(controller, port) as address:
        assert client.speed_ratio() == 100
        client.close()


def test_client_closes_when_the_controller_is_gone(controller: PlainController) -> None:
    with serving(controller) as address:
        client = RwsClient(address)
        client.connect()
    client.close()


def test_client_serves_several_threads(address: str) -> None:
    ratios: list[int] = []
    with RwsClient(address, clock=ManualClock()) as client:

        def read() -> None:
            ratios.extend(client.speed_ratio() for _ in range(20))

        threads = [threading.Thread(target=read) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert ratios == [100] * 80


class DrippingServer:
    """Answers a request with a header to which a byte is added each second, for a minute, and then hangs up.

    A second is over when the peer has looked at the clock again, which it does before it reads on.
    """

    def __init__(self) -> None:
        self.clock = WatchedClock()
        self.is_over = threading.Event()
        self.sent = 0

    def answer(self, server: socket.socket) -> None:
        with suppress(OSError), server.accept()[0] as peer:
            peer.recv(4096)
            peer.sendall(b"HTTP/1.1 200 OK\r\nX-Drop: ")
            for _ in range(60):
                self.clock.was_read.clear()
                self.clock.advance(1.0)
                peer.sendall(b"x")
                self.sent += 1
                while not self.clock.was_read.wait(0.01):
                    if self.is_over.is_set():
                        return


class WatchedClock(ManualClock):
    def __init__(self) -> None:
        super().__init__()
        self.was_read = threading.Event()

    def now(self) -> float:
        time = super().now()
        self.was_read.set()
        return time


def test_headers_that_drip_for_a_minute_are_given_up_after_the_drivers_two_seconds() -> None:
    """In virtual time; what else a server may let drip is in test_rws_hostile_server.py."""
    timeout = RobotSettings().timeout
    assert timeout == 2.0
    dripping = DrippingServer()
    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=dripping.answer, args=(server,))
        thread.start()
        client = RwsClient(f"127.0.0.1:{server.getsockname()[1]}", timeout=timeout, clock=dripping.clock)
        try:
            with refused(AnswerTimeout, "no_answer_to_request", address=client.address, timeout=timeout):
                client.speed_ratio()
        finally:
            client.close()
            dripping.is_over.set()
            thread.join()
    assert timeout <= dripping.clock.now() <= timeout + 2.0
    assert dripping.sent <= 4


class SlowFile:
    """Sends a file a part a second, or takes one so; with a stop after ``parts`` of them."""

    def __init__(self, parts: int) -> None:
        self.clock = WatchedClock()
        self.parts = parts
        self.received = b""

    def answer(self, server: socket.socket) -> None:
        with suppress(OSError), server.accept()[0] as peer:
            while not self.received.endswith(b"\r\n\r\n"):
                self.received += peer.recv(65536)
            peer.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 30\r\n\r\n")
            for _ in range(self.parts):
                self.clock.was_read.clear()
                self.clock.advance(1.0)
                peer.sendall(b"x")
                self.clock.was_read.wait(5.0)
            self.clock.advance(10.0)
            peer.recv(1)  # until the client has given up


@pytest.mark.parametrize(("parts", "arrives"), [(30, True), (20, False)])
def test_file_may_take_longer_than_the_timeout_as_long_as_it_goes_on(parts: int, arrives: bool) -> None:
    slow = SlowFile(parts)
    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=slow.answer, args=(server,))
        thread.start()
        client = RwsClient(
            f"127.0.0.1:{server.getsockname()[1]}", timeout=0.5 if not arrives else 4.0, clock=slow.clock
        )
        try:
            if arrives:
                assert client.read_file("HOME:/a.bin") == b"x" * 30
            else:  # nothing comes for half a second after the last part
                with pytest.raises(AnswerTimeout):
                    client.read_file("HOME:/a.bin")
        finally:
            client.close()
            thread.join()
    assert slow.clock.now() >= parts
