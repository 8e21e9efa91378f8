"""Logins as foreign clients do them, byte for byte, against our server on loopback."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from http.client import HTTPConnection, HTTPResponse

import httpx
import pytest

from contract.rws_bench import PASSWORD, USER, PlainController, serving
from digest_client import authorization

RESOURCE = "/rw/panel/ctrlstate"
SPEED = "/rw/panel/speedratio?action=setspeedratio"


@pytest.fixture
def controller() -> PlainController:
    return PlainController()


@pytest.fixture
def address(controller: PlainController) -> Iterator[str]:
    with serving(controller) as address:
        yield address


@pytest.fixture
def connection(address: str) -> Iterator[HTTPConnection]:
    connection = HTTPConnection(address, timeout=5.0)
    yield connection
    connection.close()


def ask(connection: HTTPConnection, target: str = RESOURCE, **headers: str) -> HTTPResponse:
    connection.request("GET", target, headers=headers)
    response = connection.getresponse()
    response.read()
    return response


def proof(response: HTTPResponse, password: str = PASSWORD, target: str = RESOURCE) -> str:
    challenge = response.headers["WWW-Authenticate"]
    return authorization(challenge, user=USER, password=password, method="GET", uri=target)


def read_challenge(response: HTTPResponse) -> dict[str, str]:
    return dict(re.findall(r'(\w+)="([^"]*)"', response.headers["WWW-Authenticate"]))


def md5(text: str) -> str:
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


def set_cookies(response: HTTPResponse) -> list[str]:
    return response.headers.get_all("Set-Cookie") or []


def cookie(*lines: str) -> str:
    return "; ".join(line.partition(";")[0] for line in lines)


def test_stranger_is_challenged_and_gets_no_session(connection: HTTPConnection) -> None:
    response = ask(connection, "/")
    assert response.status == 401
    assert response.headers["WWW-Authenticate"].startswith(
        'Digest realm="validusers@robapi.abb", domain="/", qop="auth", nonce="'
    )
    assert response.headers["WWW-Authenticate"].endswith('opaque="799d5", algorithm="MD5", stale="FALSE"')
    assert set_cookies(response) == []


def test_right_password_gets_session_cookie_first_and_connection_cookie_last(
    connection: HTTPConnection,
) -> None:
    response = ask(connection, Authorization=proof(ask(connection)))
    assert response.status == 200
    assert [line.partition("=")[0] for line in set_cookies(response)] == ["-http-session-", "ABBCX"]
    assert all(line.endswith("; path=/; httponly") for line in set_cookies(response))


def test_client_may_log_in_as_before_qop(connection: HTTPConnection) -> None:
    challenge = read_challenge(ask(connection))
    user = md5(f"{USER}:{challenge['realm']}:{PASSWORD}")
    fields = {
        "username": USER,
        "realm": challenge["realm"],
        "nonce": challenge["nonce"],
        "uri": RESOURCE,
        "response": md5(f"{user}:{challenge['nonce']}:{md5(f'GET:{RESOURCE}')}"),
    }
    header = "Digest " + ", ".join(f'{name}="{text}"' for name, text in fields.items())
    assert ask(connection, Authorization=header.replace(fields["response"], "0" * 32)).status == 401
    assert ask(connection, Authorization=header).status == 200


def test_cookies_may_be_quoted(connection: HTTPConnection) -> None:
    cookies = cookie(*set_cookies(ask(connection, Authorization=proof(ask(connection)))))
    name, _, value = cookies.partition("; ")[0].partition("=")
    assert ask(connection, Cookie=f'$Version=1; {name}="{value}"; $Path="/"').status == 200


def test_wrong_password_is_challenged_again(connection: HTTPConnection) -> None:
    assert ask(connection, Authorization=proof(ask(connection), password="wrong")).status == 401


def test_proof_for_one_resource_does_not_open_another(connection: HTTPConnection) -> None:
    assert ask(connection, "/rw/system", Authorization=proof(ask(connection))).status == 401


def test_cookies_alone_authorize_and_are_not_set_again(connection: HTTPConnection) -> None:
    cookies = cookie(*set_cookies(ask(connection, Authorization=proof(ask(connection)))))
    response = ask(connection, Cookie=cookies)
    assert response.status == 200
    assert set_cookies(response) == []


def test_session_moves_to_another_connection_with_a_new_connection_cookie(
    connection: HTTPConnection, address: str
) -> None:
    cookies = cookie(*set_cookies(ask(connection, Authorization=proof(ask(connection)))))
    other = HTTPConnection(address, timeout=5.0)
    response = ask(other, Cookie=cookies, Connection="close")
    other.close()
    assert response.status == 200
    assert [line.partition("=")[0] for line in set_cookies(response)] == ["ABBCX"]


def test_connection_cookie_needs_a_proof_and_then_leads_to_its_session(connection: HTTPConnection) -> None:
    _, number = set_cookies(ask(connection, Authorization=proof(ask(connection))))
    challenge = ask(connection, Cookie=cookie(number))
    assert challenge.status == 401
    response = ask(connection, Cookie=cookie(number), Authorization=proof(challenge))
    assert response.status == 200
    assert set_cookies(response) == []


def test_same_credentials_are_accepted_again(connection: HTTPConnection) -> None:
    authorization = proof(ask(connection))
    assert ask(connection, Authorization=authorization).status == 200
    assert ask(connection, Authorization=authorization).status == 200


def test_same_credentials_are_accepted_for_another_body_since_the_controller_does_not_count_them(
    connection: HTTPConnection, controller: PlainController
) -> None:
    challenge = ask(connection, SPEED).headers["WWW-Authenticate"]
    proof_of_post = authorization(challenge, user=USER, password=PASSWORD, method="POST", uri=SPEED)
    headers = {"Authorization": proof_of_post, "Content-Type": "application/x-www-form-urlencoded"}

    def post(body: str) -> int:
        connection.request("POST", SPEED, body, headers)
        response = connection.getresponse()
        response.read()
        return response.status

    assert [post("speed-ratio=50"), post("speed-ratio=7")] == [204, 204]
    controller.clock.advance(300.1)
    assert post("speed-ratio=9") == 401


def test_seventy_first_session_is_refused_until_the_others_are_idle(
    connection: HTTPConnection, controller: PlainController
) -> None:
    authorization = proof(ask(connection))
    statuses = [ask(connection, Authorization=authorization).status for _ in range(71)]
    assert statuses == [200] * 70 + [503]
    controller.clock.advance(300.1)
    assert ask(connection, Authorization=proof(ask(connection))).status == 200


def test_old_nonce_is_called_stale(connection: HTTPConnection, controller: PlainController) -> None:
    authorization = proof(ask(connection))
    controller.clock.advance(300.1)
    response = ask(connection, Authorization=authorization)
    assert response.status == 401
    assert response.headers["WWW-Authenticate"].endswith('stale="TRUE"')


def test_idle_session_must_log_in_again(connection: HTTPConnection, controller: PlainController) -> None:
    cookies = cookie(*set_cookies(ask(connection, Authorization=proof(ask(connection)))))
    controller.clock.advance(300.1)
    assert ask(connection, Cookie=cookies).status == 401


def test_logout_ends_the_session(connection: HTTPConnection) -> None:
    cookies = cookie(*set_cookies(ask(connection, Authorization=proof(ask(connection)))))
    assert ask(connection, "/logout", Cookie=cookies).status == 204
    assert ask(connection, Cookie=cookies).status == 401


def test_connection_is_kept_alive_unless_the_client_ends_it(connection: HTTPConnection) -> None:
    assert ask(connection).headers["Connection"] == "Keep-Alive"
    response = ask(connection, Connection="close")
    assert response.headers["Connection"] == "close"
    assert response.will_close


def test_stock_digest_client_logs_in_once_and_stays_in(address: str) -> None:
    with httpx.Client(base_url=f"http://{address}", auth=httpx.DigestAuth(USER, PASSWORD)) as client:
        assert client.get(RESOURCE, params={"json": "1"}).status_code == 200
        client.auth = None
        assert client.post(RESOURCE, params={"action": "setctrlstate"}, data={"ctrl-state": "motoron"}).is_success
