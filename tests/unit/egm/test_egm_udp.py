from __future__ import annotations

import pytest

from abb_protocols.errors import NoConnection
from abb_runtime.udp import Poller, UdpClient, UdpServer, address_of_host, address_towards, free_port
from refusals import refused


def receive(link: UdpServer | UdpClient) -> list[bytes]:
    """What arrives within a second."""
    got: list[bytes] = []
    poller = Poller()
    poller.watch(link, lambda: got.extend(link.receive()))
    poller.wait(1.0)
    poller.close()
    return got


def test_server_answers_whoever_spoke() -> None:
    with UdpServer("127.0.0.1", 0) as server:
        client = UdpClient("127.0.0.1", server.port)
        client.send(b"state")
        assert receive(server) == [b"state"]
        server.send(b"command")
        assert receive(client) == [b"command"]
        client.close()


def test_server_hands_out_what_has_queued_up_oldest_first() -> None:
    with UdpServer("127.0.0.1", 0) as server:
        client = UdpClient("127.0.0.1", server.port)
        for each in (b"1", b"2", b"3"):
            client.send(each)
        assert receive(server) == [b"1", b"2", b"3"]
        client.close()


def test_server_leaves_datagrams_of_strangers_aside() -> None:
    with UdpServer("127.0.0.1", 0, remote="192.0.2.1") as server:
        client = UdpClient("127.0.0.1", server.port)
        client.send(b"state")
        assert receive(server) == []
        assert server.foreign == 1
        client.close()


def test_server_answers_nobody_before_anybody_spoke() -> None:
    with UdpServer("127.0.0.1", 0) as server:
        server.send(b"command")


def test_client_survives_that_nobody_listens() -> None:
    with UdpServer("127.0.0.1", 0) as server:
        port = server.port
    client = UdpClient("127.0.0.1", port)
    for _ in range(3):
        client.send(b"state")
        assert client.receive() == []
    client.close()


def test_server_says_that_its_port_is_taken() -> None:
    with (
        UdpServer("127.0.0.1", 0) as server,
        refused(NoConnection, "udp_port_taken", port=server.port),
    ):
        UdpServer("127.0.0.1", server.port)


def test_server_says_that_an_address_is_not_its_own() -> None:
    with refused(NoConnection, "udp_port_not_opened", host="192.0.2.1", port=6511):
        UdpServer("192.0.2.1", 6511)


def test_own_address_towards_this_machine_is_loopback() -> None:
    assert address_towards("127.0.0.1") == "127.0.0.1"


def test_unknown_name_is_refused_with_a_sentence() -> None:
    with refused(NoConnection, "host_unknown", host="no such host"):
        address_of_host("no such host")


def test_server_hands_out_what_one_sender_sent_then_what_another_did() -> None:
    with UdpServer("127.0.0.1", 0) as server:
        one, other = UdpClient("127.0.0.1", server.port), UdpClient("127.0.0.1", server.port)
        for sender, datagram in ((one, b"1"), (one, b"2"), (other, b"a"), (one, b"3"), (other, b"b")):
            sender.send(datagram)
        assert [server.receive() for _ in range(5)] == [[b"1", b"2"], [b"a"], [b"3"], [b"b"], []]
        server.send(b"reply")
        assert (receive(other), one.receive(), server.foreign) == ([b"reply"], [], 0)
        one.close()
        other.close()


def test_server_reads_no_more_than_a_bound_at_once_however_much_waits() -> None:
    with UdpServer("127.0.0.1", 0, remote="192.0.2.1") as server:
        reads = 0

        def flood(size: int, flags: int = 0) -> tuple[bytes, tuple[str, int]]:
            nonlocal reads
            reads += 1
            return b"junk", ("127.0.0.2", 6510)

        server._receive = flood  # type: ignore[assignment]
        assert server.receive() == []
        assert reads == server.foreign == 256


def test_system_drops_a_flood_of_others_so_that_the_pinned_sender_is_heard_at_once() -> None:
    with UdpServer("127.0.0.1", 0) as server:
        robot, other = UdpClient("127.0.0.1", server.port), UdpClient("127.0.0.1", server.port)
        robot.send(b"1")
        assert receive(server) == [b"1"]
        server.pin()
        for _ in range(2000):  # more than the socket's buffer holds
            other.send(b"junk")
        robot.send(b"2")
        assert (server.receive(), server.foreign) == ([b"2"], 0)
        robot.close()
        other.close()


def test_server_hears_and_answers_only_the_sender_that_is_pinned() -> None:
    with UdpServer("127.0.0.1", 0) as server:
        robot, other = UdpClient("127.0.0.1", server.port), UdpClient("127.0.0.1", server.port)
        robot.send(b"1")
        assert receive(server) == [b"1"]
        server.pin()
        for sender, datagram in ((other, b"a"), (robot, b"2"), (other, b"b")):
            sender.send(datagram)
        assert receive(server) == [b"2"]
        server.send(b"reply")
        assert (receive(robot), other.receive()) == ([b"reply"], [])
        robot.close()
        other.close()


def test_server_counts_and_leaves_aside_what_others_had_sent_when_one_was_pinned() -> None:
    with UdpServer("127.0.0.1", 0) as server:
        robot, other = UdpClient("127.0.0.1", server.port), UdpClient("127.0.0.1", server.port)
        for sender, datagram in ((robot, b"1"), (other, b"a"), (robot, b"2"), (other, b"b")):
            sender.send(datagram)
        assert receive(server) == [b"1"]
        server.pin()
        assert (server.receive(), server.foreign) == ([b"2"], 2)
        robot.close()
        other.close()


@pytest.mark.parametrize("host", ["127.0.0.1", ""])
@pytest.mark.parametrize("is_asked_for", [False, True])
def test_server_hears_every_sender_again_on_its_port_after_one_was_released(host: str, is_asked_for: bool) -> None:
    """Linux gives up a port that it has chosen itself when a connection is dissolved."""
    with UdpServer(host, free_port() if is_asked_for else 0) as server:
        address, port, descriptor = server.host, server.port, server.fileno()
        robot, other = UdpClient("127.0.0.1", port), UdpClient("127.0.0.1", port)
        for _ in range(3):
            robot.send(b"1")
            assert receive(server) == [b"1"]
            server.pin()
            server.release()
            other.send(b"a")
            assert receive(server) == [b"a"]
            server.send(b"reply")
            assert receive(other) == [b"reply"]
        assert (server.host, server.port, server.fileno()) == (address, port, descriptor)
        with refused(NoConnection, "udp_port_taken", port=port):
            UdpServer(host, port)
        robot.close()
        other.close()


def test_server_goes_on_when_the_sender_that_is_pinned_has_closed_its_port() -> None:
    with UdpServer("127.0.0.1", 0) as server:
        robot = UdpClient("127.0.0.1", server.port)
        robot.send(b"1")
        assert receive(server) == [b"1"]
        server.pin()
        robot.close()
        for _ in range(3):
            server.send(b"reply")
            assert server.receive() == []
        server.release()
        again = UdpClient("127.0.0.1", server.port)
        again.send(b"2")
        assert receive(server) == [b"2"]
        again.close()


def test_server_that_nobody_has_spoken_to_pins_nobody() -> None:
    with UdpServer("127.0.0.1", 0) as server:
        server.pin()
        server.release()
        assert not server.is_pinned
