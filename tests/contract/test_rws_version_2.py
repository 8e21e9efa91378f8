"""Robot Web Services 2.0 over TLS sockets, asked by HTTP and WebSocket libraries as they come."""

from __future__ import annotations

import socket
import ssl
import sys
import threading
from collections.abc import Iterator
from dataclasses import replace
from http.client import HTTPSConnection

import httpx
import pytest
from websockets.sync.client import connect

from abb_protocols.errors import CommandRefused, MissingPrerequisite, NoConnection
from abb_runtime.faults import inject_fault, takes_faults
from abb_runtime.process.certificate import self_signed_context
from rws_examples_2 import BASIC, PASSWORD, SYMBOL, USER

pytest.importorskip("cryptography", reason="needs yumi-ros2[robotware7]")
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.subscriptions import SubscriptionChannel, Upgrade
from virtual_irc5.rws.version_2 import FORM_2, HAL_2, XHTML_2, RwsService2
from virtual_irc5.world import World

PANEL = "/rw/panel/ctrl-state"


class Site:
    """A controller with RobotWare 7, whose time passes when ``pass_time`` says so."""

    def __init__(self) -> None:
        self.world = World()
        self.service = RwsService2(self.world.controller, user=USER, password=PASSWORD)
        self.server = HttpServer(self._handle, 0, tls=self_signed_context("127.0.0.1"))
        self.is_listening = threading.Event()
        self._lock = threading.Lock()
        self._now = 0.0

    def _handle(self, request: HttpRequest) -> HttpReply | Upgrade | None:
        with self._lock:
            reply = self.service.handle(request, self._now)
        if not isinstance(reply, Upgrade):
            return reply
        attach = reply.attach

        def attached(channel: SubscriptionChannel) -> None:
            attach(channel)
            self.is_listening.set()

        return replace(reply, attach=attached)

    def pass_time(self) -> None:
        with self._lock:
            self._now += 1.0
            self.service.advance(self._now)


@pytest.fixture(scope="module")
def site() -> Iterator[Site]:
    site = Site()
    with site.server:
        yield site


@pytest.fixture
def client(site: Site) -> Iterator[httpx.Client]:
    """As users write it: no certificate is checked, and the session is kept by cookies."""
    headers = {"Accept": HAL_2}
    url = f"https://{site.server.address}"
    with httpx.Client(base_url=url, auth=(USER, PASSWORD), headers=headers, verify=False, trust_env=False) as client:
        yield client


def post(client: httpx.Client, path: str, text: str = "") -> httpx.Response:
    return client.post(path, content=text, headers={"Content-Type": FORM_2, "Accept": XHTML_2})


def test_motors_are_switched_on_and_data_are_written(client: httpx.Client) -> None:
    assert post(client, PANEL, "ctrl-state=motoron").status_code == 204
    assert client.get(PANEL).json()["state"] == [
        {"_type": "pnl-ctrlstate", "_title": "ctrl-state", "ctrlstate": "motoron"}
    ]
    assert post(client, f"{SYMBOL}/data?mastership=implicit", "value=5").status_code == 204
    assert client.get(f"{SYMBOL}/data").json()["state"][0]["value"] == "5"
    assert set(client.cookies) == {"-http-session-", "ABBCX"}
    assert post(client, PANEL, "ctrl-state=motoroff").status_code == 204


def test_file_is_written_loaded_and_read(client: httpx.Client) -> None:
    module = "MODULE Over\n  PROC over()\n  ENDPROC\nENDMODULE\n"
    kind = {"Content-Type": "text/plain;v=2.0"}
    assert client.put("/fileservice/HOME/over.mod", content=module, headers=kind).status_code == 201
    loaded = post(client, "/rw/rapid/tasks/T_ROB_L/loadmod?mastership=implicit", "modulepath=HOME/over.mod")
    assert loaded.status_code == 200
    assert "Over" in [each["name"] for each in client.get("/rw/rapid/tasks/T_ROB_L/modules").json()["state"]]
    assert client.get("/fileservice/HOME/over.mod", headers={"Accept": "*/*"}).text == module


def test_requests_with_the_headers_of_the_library_are_answered(site: Site) -> None:
    file, form = "/fileservice/HOME/own.txt", {"Content-Type": FORM_2}
    url = f"https://{site.server.address}"
    with httpx.Client(base_url=url, auth=(USER, PASSWORD), verify=False, trust_env=False) as client:  # accepts */*
        shown = client.get("/rw/panel/opmode")
        replies = [
            client.post(PANEL, content="ctrl-state=motoroff", headers=form),
            client.put(file, content="text", headers={"Content-Type": "text/plain;v=2.0"}),
            client.head(file),
            client.options(PANEL),
            client.delete(file),
            client.post("/subscription", content=f"resources=1&1={PANEL};ctrlstate&1-p=1", headers=form),
        ]
    assert [each.status_code for each in replies] == [204, 201, 204, 200, 204, 201]
    assert (shown.status_code, shown.headers["Content-Type"], "AUTO" in shown.text) == (200, XHTML_2, True)


def test_request_without_accept_is_answered(site: Site) -> None:
    host, _, port = site.server.address.partition(":")
    insecure = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    insecure.check_hostname, insecure.verify_mode = False, ssl.CERT_NONE
    connection = HTTPSConnection(host, int(port), timeout=10.0, context=insecure)  # which sends none
    headers = {"Authorization": BASIC, "Content-Type": FORM_2}
    connection.request("POST", PANEL, "ctrl-state=motoroff", headers)
    assert connection.getresponse().status == 204
    connection.close()


def test_event_comes_over_a_secure_web_socket(site: Site, client: httpx.Client) -> None:
    reply = post(client, "/subscription", f"resources=1&1={PANEL};ctrlstate&1-p=1")
    assert reply.status_code == 201
    insecure = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    insecure.check_hostname, insecure.verify_mode = False, ssl.CERT_NONE
    cookies = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
    site.is_listening.clear()
    with connect(
        reply.headers["Location"],
        ssl=insecure,
        subprotocols=["rws_subscription"],  # type: ignore[list-item]
        additional_headers={"Cookie": cookies},
        proxy=None,
    ) as socket:
        assert socket.subprotocol == "rws_subscription"
        assert site.is_listening.wait(10.0)
        post(client, PANEL, "ctrl-state=motoron")
        site.pass_time()
        text = socket.recv(timeout=10.0)
    post(client, PANEL, "ctrl-state=motoroff")
    assert '<span class="ctrlstate">motoron</span>' in str(text)


def test_client_that_checks_certificates_does_not_trust_it(site: Site) -> None:
    with pytest.raises(httpx.ConnectError, match="self-signed certificate"):
        httpx.get(f"https://{site.server.address}/", trust_env=False)


def test_certificate_is_for_the_address(site: Site) -> None:
    host, _, port = site.server.address.partition(":")
    trusted = ssl.create_default_context(cadata=ssl.get_server_certificate((host, int(port))))
    reply = httpx.get(f"https://{site.server.address}/rw", verify=trusted, trust_env=False)
    assert reply.status_code == 401


def test_plain_http_is_not_answered(site: Site) -> None:
    with pytest.raises(httpx.TransportError):
        httpx.get(f"http://{site.server.address}/rw", trust_env=False)


def test_fault_is_sent_to_a_server_with_tls_too(site: Site) -> None:
    with pytest.raises(CommandRefused, match="is not a virtual controller of this package"):
        inject_fault(site.server.address, "program-stop", {})
    with pytest.raises(NoConnection):
        inject_fault("127.0.0.1:9", "program-stop", {})


def test_server_without_faults_is_not_taken_for_a_virtual_controller(site: Site) -> None:
    assert not takes_faults(site.server.address)
    assert not takes_faults("127.0.0.1:9")


@pytest.mark.parametrize(
    ("address", "is_verified"),
    [("127.0.0.1:80", False), ("localhost:80", False), ("[::1]:80", False), ("192.0.2.1:80", True)],
)
def test_certificate_of_another_machine_is_verified(
    address: str, is_verified: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []

    def answer(method: str, url: str, **options: object) -> httpx.Response:
        asked.append(options["verify"])
        return httpx.Response(204)

    monkeypatch.setattr(httpx, "request", answer)
    inject_fault(address, "program-stop", {})
    assert asked == [is_verified]


def test_connections_break_as_those_of_a_machine_that_goes_down(site: Site) -> None:
    host, _, port = site.server.address.partition(":")
    trusted = ssl.create_default_context(cadata=ssl.get_server_certificate((host, int(port))))
    with (
        socket.create_connection((host, int(port)), 10.0) as plain,
        trusted.wrap_socket(plain, server_hostname=host, suppress_ragged_eofs=False) as secure,
    ):
        secure.sendall(b"GET /rw HTTP/1.1\r\nHost: memory\r\n\r\n")
        reply = b""
        while b"</html>" not in reply:
            reply += secure.recv(5000)
        assert reply.startswith(b"HTTP/1.1 401")
        site.server.hang_up()
        with pytest.raises((ConnectionResetError, ssl.SSLEOFError)):  # and no end of TLS in order
            secure.recv(1000)


def test_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cryptography", None)
    with pytest.raises(MissingPrerequisite, match="robotware7"):
        self_signed_context("127.0.0.1")
