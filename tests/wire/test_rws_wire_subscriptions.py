"""Subscriptions as foreign clients make them, byte for byte: what is asked, answered and refused."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest

from contract.rws_bench import PASSWORD, USER, PlainController, serving
from digest_client import authorization

RESOURCE = "/rw/panel/speedratio"
ONE = f"resources=1&1={RESOURCE}&1-p=1"


@pytest.fixture
def controller() -> PlainController:
    return PlainController()


@pytest.fixture
def client(controller: PlainController) -> Iterator[httpx.Client]:
    with serving(controller) as address, logged_in(address) as client:
        yield client


@pytest.fixture(scope="module")
def refused() -> Iterator[httpx.Client]:
    """A client with a subscription, for requests that change nothing."""
    with serving(PlainController()) as address, logged_in(address) as client:
        subscribe(client)
        yield client


@contextmanager
def logged_in(address: str) -> Iterator[httpx.Client]:
    """A client with a session of its own, which its cookies prove."""
    with httpx.Client(base_url=f"http://{address}", trust_env=False) as client:
        lines = client.get("/rw", auth=httpx.DigestAuth(USER, PASSWORD)).headers.get_list("set-cookie")
        client.cookies.clear()
        client.headers["Cookie"] = "; ".join(line.partition(";")[0] for line in lines)
        yield client


def subscribe(client: httpx.Client, body: str = ONE) -> httpx.Response:
    form = {"Content-Type": "application/x-www-form-urlencoded"}
    return client.post("/subscription", content=body, headers=form)


def upgrade(
    client: httpx.Client,
    path: str,
    protocol: str = "robapi2_subscription",
    cookie: str | None = None,
    proof: str = "",
) -> str:
    """Status line and headers of the answer to the request for a WebSocket."""
    url = client.base_url
    lines = (
        f"GET {path} HTTP/1.1",
        f"Host: {url.host}:{url.port}",
        "Connection: Upgrade",
        "Upgrade: websocket",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Extensions: permessage-deflate",
        f"Sec-WebSocket-Protocol: {protocol}",
        f"Cookie: {client.headers['Cookie'] if cookie is None else cookie}",
        f"Authorization: {proof}",
    )
    with socket.create_connection((url.host, url.port or 80), timeout=5.0) as end:
        end.sendall("\r\n".join((*lines, "", "")).encode())
        return end.recv(4096).decode().partition("\r\n\r\n")[0]


def test_subscription_is_answered_with_its_web_socket_and_the_present_values(client: httpx.Client) -> None:
    reply = subscribe(client)
    root = f"{client.base_url.host}:{client.base_url.port}"
    assert (reply.status_code, reply.headers["Location"]) == (201, f"ws://{root}/poll/1")
    assert f'<a href="ws://{root}/poll/1" rel="self"></a>' in reply.text
    assert '<li class="pnl-speedratio-ev" title="speedratio">' in reply.text
    assert f'<a href="{RESOURCE}" rel="self"/><span class="speedratio">100</span>' in reply.text


def test_web_socket_opens_for_a_cookie_without_extensions(client: httpx.Client) -> None:
    subscribe(client)
    answer = upgrade(client, "/poll/1")
    assert answer.startswith("HTTP/1.1 101 ")
    assert "Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=" in answer
    assert "Sec-WebSocket-Protocol: robapi2_subscription" in answer
    assert "Sec-WebSocket-Extensions" not in answer


def test_web_socket_opens_for_the_connection_cookie_with_credentials(client: httpx.Client) -> None:
    subscribe(client)
    stranger = client.get("/rw", headers={"Cookie": ""})
    challenge = stranger.headers["WWW-Authenticate"]
    proof = authorization(challenge, user=USER, password=PASSWORD, method="GET", uri="/poll/1")
    cookie = client.headers["Cookie"].partition("; ")[2]
    assert cookie.startswith("ABBCX=")
    assert upgrade(client, "/poll/1", cookie=cookie, proof=proof).startswith("HTTP/1.1 101 ")


def test_web_socket_without_a_number_is_that_of_the_latest_subscription(client: httpx.Client) -> None:
    subscribe(client)
    assert upgrade(client, "/poll").startswith("HTTP/1.1 101 ")


@pytest.mark.parametrize(
    ("path", "protocol", "cookie", "status"),
    [
        ("/poll/1", "rws_subscription", None, 400),
        ("/poll/1", "robapi2_subscription", "", 403),
        ("/poll/2", "robapi2_subscription", None, 404),
        ("/poll/x", "robapi2_subscription", None, 404),
    ],
)
def test_web_socket_is_refused(
    refused: httpx.Client, path: str, protocol: str, cookie: str | None, status: int
) -> None:
    assert upgrade(refused, path, protocol, cookie).startswith(f"HTTP/1.1 {status} ")


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("1=x", "the body lacks resources"),
        ("resources=1&1=/rw/nothing&1-p=1", "Invalid resource URI in Create: /rw/nothing"),
        ("resources=1&1=/rw/iosystem/signals/no;state&1-p=1", "Invalid resource URI in Create"),
        ("resources=1&1=/rw/iosystem/signals/EGM_START_JOINT;lvalue&1-p=1", "Invalid resource URI in Create"),
        ("resources=1&1=/rw/panel/opmode&1-p=2", "/rw/panel/opmode has no priority 2"),
        ("resources=1&1=/rw/rapid/tasks/T_NO;excstate&1-p=1", "Invalid resource URI in Create"),
        ("resources=1&1=/rw/rapid/symbol/data/RAPID/T_ROB_R/no;value&1-p=1", "Symbol not found"),
        (
            "resources=1&1=/rw/rapid/symbol/data/RAPID/T_ROB_R/TRobMain/current_state;value&1-p=1",
            "is not persistent; only PERS can be subscribed",
        ),
    ],
)
def test_subscription_is_refused(refused: httpx.Client, body: str, sentence: str) -> None:
    reply = subscribe(refused, body)
    assert reply.status_code == 400
    assert sentence in reply.text


def test_priority_high_is_limited(refused: httpx.Client) -> None:
    signal = "/rw/iosystem/signals/EGM_START_JOINT;state"
    body = "&".join(f"resources={n}&{n}={signal}&{n}-p=2" for n in range(65))
    assert "64 resources have high priority at most" in subscribe(refused, body).text


def test_subscription_is_changed_shown_and_ended(client: httpx.Client) -> None:
    subscribe(client)
    form = {"Content-Type": "application/x-www-form-urlencoded"}
    body = "resources=1&1=/rw/panel/opmode&1-p=0&resources=2&2=/rw/panel/ctrlstate&2-p=0"
    assert client.put("/subscription/1", content=body, headers=form).status_code == 200
    assert client.delete("/subscription/1/rw/panel/ctrlstate").status_code == 200
    shown = client.get("/subscription/1?action=show").text
    assert ("pnl-opmode-ev" in shown, "pnl-ctrlstate-ev" in shown) == (True, False)
    assert [client.delete("/subscription/1").status_code for _ in range(2)] == [200, 404]


def test_subscription_of_another_client_is_left_alone(client: httpx.Client) -> None:
    subscribe(client)
    with logged_in(f"{client.base_url.host}:{client.base_url.port}") as other:
        assert "Group 1 does not belong to this client" in other.delete("/subscription/1").text
        assert upgrade(other, "/poll/1").startswith("HTTP/1.1 403 ")


def test_mastership_belongs_to_one_client_until_it_gives_it_back(client: httpx.Client) -> None:
    with logged_in(f"{client.base_url.host}:{client.base_url.port}") as other:
        assert client.post("/rw/mastership/rapid?action=request").status_code == 204
        assert "held by someone else" in other.post("/rw/mastership?action=request").text
        assert '"TRUE"' in client.get("/rw/mastership/rapid?json=1").text
        assert "held by someone else" in other.post("/rw/rapid/symbol/data/RAPID/T_ROB_R/x?action=set").text
        assert other.post("/rw/mastership/rapid?action=release").status_code == 403
        client.get("/logout")
        controller_forgets = other.post("/rw/mastership/rapid?action=request").status_code
    assert controller_forgets == 204


def test_modules_are_loaded_with_mastership_only(client: httpx.Client) -> None:
    load = "/rw/rapid/tasks/T_ROB_R?action=loadmod"
    body, form = "modulepath=HOME:/user.sys", {"Content-Type": "application/x-www-form-urlencoded"}
    assert "-1073445859" in client.post(load, content=body, headers=form).text
    client.post("/rw/mastership/rapid?action=request")
    assert client.post(load, content=body, headers=form).status_code == 204


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("PUT", "$home/a.mod", "MODULE a", 201),
        ("PUT", "$home/user.sys", "MODULE a", 200),
        ("PUT", "$nowhere/a.mod", "", 404),
        ("HEAD", "$HOME/user.sys", "", 204),
        ("GET", "HOME:/user.sys", "", 200),
        ("GET", "$home/none.mod", "", 404),
        ("DELETE", "$home/user.sys", "", 204),
        ("DELETE", "$home", "", 403),
        ("POST", "$home", "fs-action=create&fs-newname=sub", 201),
        ("POST", "$home/user.sys", "fs-action=copy&fs-newname=b.sys", 204),
        ("POST", "$home/user.sys", "fs-action=rename&fs-newname=user.sys", 409),
        ("POST", "$home/user.sys?fs-action=copy", "fs-newname=b.sys", 400),
        ("POST", "$home/user.sys", "fs-action=eat&fs-newname=b.sys", 400),
        ("POST", "$home/user.sys", "fs-action=copy&fs-newname=a/b.sys", 400),
    ],
)
def test_file_service_answers(client: httpx.Client, method: str, path: str, body: str, status: int) -> None:
    form = {"Content-Type": "application/x-www-form-urlencoded"} if method == "POST" else {}
    assert client.request(method, f"/fileservice/{path}", content=body, headers=form).status_code == status


def test_directory_is_listed(client: httpx.Client) -> None:
    (state,) = client.get("/fileservice/$home/?json=1").json()["_embedded"]["_state"]
    assert (state["_type"], state["_title"], state["fs-size"]) == ("fs-file", "user.sys", "33")


def test_restart_is_asked_for(client: httpx.Client, controller: PlainController) -> None:
    form = {"Content-Type": "application/x-www-form-urlencoded"}
    reply = client.post("/rw/panel?action=restart", content="restart-mode=a", headers=form)
    assert "restart-mode is restart or istart or pstart or bstart, not 'a'" in reply.text
    assert client.post("/rw/panel?action=restart", content="restart-mode=restart", headers=form).status_code == 204
    assert controller.restarts == 1
