"""RAPID's sockets on this machine's, with clients of Python; the task's time is virtual."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator

import pytest
from rapid_bench import Bench, started

from free_ports import free_tcp_port
from virtual_irc5.program_sockets import ProgramNetwork

SERVER = """
VAR socketdev server; VAR socketdev client; VAR string text; VAR string address; VAR num port; VAR num count;
VAR rawbytes raw; VAR byte values{1024}; VAR bool answer;
"""
ACCEPT = 'SocketCreate server; SocketBind server,"192.168.125.1",%d; SocketListen server; SocketAccept server,client'


class Served:
    """A program that has executed up to its first wait, and the clients that connect to its port."""

    def __init__(self, body: str) -> None:
        self.port = free_tcp_port()
        self.bench = Bench(body.replace("%d", str(self.port)), SERVER).start()
        self.clients: list[socket.socket] = []

    def connect(self) -> socket.socket:
        client = socket.create_connection(("127.0.0.1", self.port), timeout=5.0)
        self.clients.append(client)
        return client

    def advance(self, seconds: float = 0.004) -> None:
        self.bench.run(seconds)

    def ask(self, client: socket.socket, request: bytes) -> bytes:
        """The answer that is there after one cycle."""
        client.sendall(request)
        self.advance()
        return client.recv(1024)


@pytest.fixture
def serve() -> Iterator[type[Served]]:
    made: list[Served] = []

    class Kept(Served):
        def __init__(self, body: str) -> None:
            super().__init__(body)
            made.append(self)

    yield Kept
    for each in made:
        for client in each.clients:
            client.close()


def test_text_is_answered_in_the_cycle_it_comes_in(serve: type[Served]) -> None:
    loop = r'; WHILE TRUE DO SocketReceive client\Str:=text; SocketSend client\Str:=text+"!"; ENDWHILE'
    served = serve(ACCEPT + r"\ClientAddress:=address" + loop)
    client = served.connect()
    assert [served.ask(client, text) for text in (b"one", b"two")] == [b"one!", b"two!"]
    assert served.bench.read("address") == '"127.0.0.1"'


def test_numbers_are_packed_and_unpacked(serve: type[Served]) -> None:
    served = serve(
        ACCEPT + r";SocketReceive client\RawData:=raw\ReadNoOfBytes:=6; UnpackRawBytes raw\Network,1,port\IntX:=UINT; "
        r"UnpackRawBytes raw\Network,3,count\Float4; ClearRawBytes raw; "
        r"PackRawBytes count*port,raw\Network,1\Float4; SocketSend client\RawData:=raw; WaitTime 1;"
    )
    answer = served.ask(served.connect(), struct.pack(">Hf", 3, 2.5))
    assert struct.unpack(">f", answer) == (7.5,)


def test_bytes_wait_until_there_are_as_many_as_asked_for(serve: type[Served]) -> None:
    served = serve(
        ACCEPT
        + r";SocketReceive client\Data:=values\ReadNoOfBytes:=4\NoRecBytes:=count; SocketSend client\Data:=values"
        r"\NoOfBytes:=3; WaitTime 1;"
    )
    client = served.connect()
    client.sendall(b"\x01\x02")
    served.advance()
    assert served.bench.read("count") == "0"
    assert served.ask(client, b"\x03\xff") == b"\x01\x02\x03"
    assert (served.bench.read("values")[:10], served.bench.read("count")) == ("[1,2,3,255", "4")


def test_long_message_comes_in_pieces_of_eighty_characters(serve: type[Served]) -> None:
    served = serve(ACCEPT + r";SocketReceive client\Str:=text; count:=SocketPeek(client); WaitTime 1;")
    client = served.connect()
    client.sendall(b"x" * 100)
    served.advance()
    assert (served.bench.read("text"), served.bench.read("count")) == ('"' + "x" * 80 + '"', "20")


@pytest.mark.parametrize("way", ["goes", "breaks"])
def test_client_that_goes_is_an_error_after_which_the_next_is_accepted(serve: type[Served], way: str) -> None:
    served = serve(
        r"""WHILE TRUE DO SocketReceive client\Str:=text; SocketSend client\Str:=text; ENDWHILE
        ERROR
        IF ERRNO=ERR_SOCK_CLOSED THEN
            IF SocketGetStatus(server)=SOCKET_CLOSED THEN
                SocketCreate server; SocketBind server,"127.0.0.1",%d; SocketListen server;
            ENDIF
            SocketClose client;
            SocketAccept server,client\Time:=WAIT_MAX;
            RETRY;
        ENDIF"""
    )
    first = served.connect()
    assert served.ask(first, b"a") == b"a"
    if way == "breaks":
        first.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    first.close()
    served.advance()
    assert served.ask(served.connect(), b"b") == b"b"


@pytest.mark.parametrize(
    ("body", "error"),
    [
        (r"SocketReceive client\Str:=text", "ERR_SOCK_CLOSED"),
        (r'SocketCreate client; SocketSend client\Str:="x"', "ERR_SOCK_NOT_CONN"),
        (r"SocketCreate client; SocketListen client", "ERR_SOCK_NOT_BOUND"),
        (r'SocketCreate client; SocketBind client,"robot",1234', "ERR_SOCK_ADDR_INVALID"),
        (r'SocketCreate client; SocketBind client,"127.0.0.1",70000', "ERR_SOCK_ADDR_INVALID"),
        (r"SocketCreate client; SocketCreate client", "ERR_SOCK_IS_CONN"),
        (r'SocketCreate client; SocketConnect client,"127.0.0.1",%d\Time:=1', "ERR_SOCK_CLOSED"),
        (ACCEPT + r"\Time:=0.1", "ERR_SOCK_TIMEOUT"),
        (
            'SocketCreate server; SocketBind server,"127.0.0.1",%d; SocketListen server; '
            'SocketCreate client; SocketBind client,"127.0.0.1",%d; SocketListen client',
            "ERR_SOCK_ADDR_INUSE",
        ),
        (r'SocketCreate client; SocketSendTo client,"127.0.0.1",%d\Str:="x"', "ERR_SOCK_UNSPEC"),
    ],
)
def test_misuse_is_an_error(serve: type[Served], body: str, error: str) -> None:
    served = serve(f"{body};")
    served.advance(0.2)
    assert served.bench.stop.error == error


def test_waiting_ends_at_its_time(serve: type[Served]) -> None:
    served = serve(ACCEPT + r";SocketReceive client\Str:=text\Time:=0.5;")
    served.connect()
    served.advance(0.4)
    assert not served.bench.host.events
    served.advance(0.2)
    assert served.bench.stop.error == "ERR_SOCK_TIMEOUT"


def test_program_connects_to_a_server_wherever_its_cell_has_it(serve: type[Served]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        served = serve(
            rf'SocketCreate client; SocketConnect client,"192.168.125.99",{port}; SocketSend client\Str:="here"; '
            r"answer:=SocketGetStatus(client)=SOCKET_CONNECTED; SocketReceive client\Str:=text; WaitTime 1;"
        )
        served.advance()
        connection, _ = listener.accept()
        with connection:
            assert connection.recv(100) == b"here"
            connection.sendall(b"welcome")
            served.advance()
    assert (served.bench.read("text"), served.bench.read("answer")) == ('"welcome"', "TRUE")


def test_datagrams_are_received_and_answered(serve: type[Served]) -> None:
    served = serve(
        r"""SocketCreate server\UDP; SocketBind server,"192.168.125.1",%d;
        SocketReceiveFrom server\Str:=text\NoRecBytes:=count,address,port;
        SocketSendTo server,address,port\Str:=text+text; WaitTime 1;"""
    )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.settimeout(5.0)
        client.sendto(b"ab", ("127.0.0.1", served.port))
        served.advance()
        assert client.recv(100) == b"abab"
    assert served.bench.read("count") == "2"


def test_moving_pp_to_main_closes_the_sockets(serve: type[Served]) -> None:
    served = serve(ACCEPT + r";SocketReceive client\Str:=text;")
    client = served.connect()
    served.advance()
    served.bench.task.stop()
    served.bench.task.move_pp_to_main()
    assert client.recv(10) == b""
    served.bench.task.start()
    served.advance()
    assert served.connect()


def test_more_sockets_than_a_controller_has_are_an_error() -> None:
    body = "FOR i FROM 1 TO 40 DO SocketCreate many{i}; count:=i; ENDFOR"
    bench = started(body, "VAR num count; VAR socketdev many{40};")
    assert (bench.stop.error, bench.read("count")) == ("ERR_SOCK_UNSPEC", "32")


def test_receiver_that_does_not_read_delays_its_sender_only(serve: type[Served]) -> None:
    served = serve(ACCEPT + r";WHILE TRUE DO SocketSend client\Data:=values; count:=count+1; ENDWHILE")
    client = served.connect()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    sent = -1
    while int(served.bench.read("count")) != sent:
        sent = int(served.bench.read("count"))
        served.advance(0.4)
    assert sent > 0
    assert not served.bench.host.events


@pytest.mark.parametrize(
    ("address", "is_local"),
    [("127.0.0.1", True), ("127.8.0.1", True), ("localhost", True), ("0.0.0.0", False), ("127.evil.org", False)],
)
def test_programs_stay_on_a_controller_that_listens_on_this_machine_only(address: str, is_local: bool) -> None:
    assert ProgramNetwork(address).is_local is is_local
    assert ProgramNetwork(address).remote("192.0.2.1", 80) == (address if is_local else "192.0.2.1", 80)
