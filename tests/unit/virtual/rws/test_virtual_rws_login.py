from __future__ import annotations

from base64 import b64encode
from dataclasses import replace

import pytest

from abb_protocols.errors import ProtocolError
from digest_client import authorization
from virtual_irc5.rws import http

NONCE = "MGY0Yjc2MGY2Y2QyZjAwNzp2YWxpZHVzZXJzQHJvYmFwaS5hYmI6MTkwMjg5NjRlNGE6MA=="
USER, PASSWORD = "Default User", "robotics"
SECRET = "0f4b760f6cd2f007"

# Captured from a RobotWare 6 controller: reference/rws.md §2.1.
CAPTURED = (
    f'Digest realm="validusers@robapi.abb", domain="/", qop="auth", nonce="{NONCE}", opaque="799d5", '
    'algorithm="MD5", stale="FALSE"'
)


def answered(method: str, uri: str, user: str = USER) -> http.Credentials:
    """What httpx answers to the challenge of a controller."""
    return http.read_credentials(authorization(CAPTURED, user=user, password=PASSWORD, method=method, uri=uri))


def is_genuine(credentials: http.Credentials, target: str = "/rw", method: str = "GET") -> bool:
    return http.is_genuine(credentials, user=USER, password=PASSWORD, method=method, target=target)


def test_challenge_is_the_one_a_controller_sends() -> None:
    assert http.digest_challenge(NONCE) == CAPTURED


@pytest.mark.parametrize(
    ("method", "uri", "response"),
    [
        ("GET", "/rw/panel/ctrlstate?json=1", "71736cc89f242d2ff73ae1a73dc12d07"),
        ("POST", "/rw/panel/ctrlstate?action=setctrlstate", "46249511547a5e77b8bbd1a45c4710c2"),
    ],
)
def test_response_is_that_of_the_test_vector(method: str, uri: str, response: str) -> None:
    captured = http.Credentials(USER, http.REALM, NONCE, uri, response, "00000001", "0a4f113b")
    assert is_genuine(captured, uri, method)


def test_credentials_are_read_with_what_is_escaped_in_them() -> None:
    fields = 'realm="r", nonce="n", uri="/", response="x", nc=1, cnonce="c"'
    assert http.read_credentials(f'Digest username="a \\"quoted\\" \\\\ user", {fields}').user == 'a "quoted" \\ user'


def test_credentials_are_genuine_for_their_request() -> None:
    assert is_genuine(answered("GET", "/rw"))


def test_credentials_are_genuine_when_the_client_escapes_the_uri_otherwise() -> None:
    assert is_genuine(answered("GET", "/rw/%24HOME"), target="/rw/$HOME")


@pytest.mark.parametrize(
    "change",
    [{"user": "Other"}, {"realm": "elsewhere"}, {"uri": "/ctrl"}, {"response": "0" * 32}, {"nonce": "x"}],
)
def test_credentials_are_not_genuine_when_one_field_is_changed(change: dict[str, str]) -> None:
    assert not is_genuine(replace(answered("GET", "/rw"), **change))


def test_credentials_are_not_genuine_for_another_method() -> None:
    assert not is_genuine(answered("GET", "/rw"), method="POST")


def test_credentials_of_another_user_with_the_right_password_are_not_genuine() -> None:
    assert not is_genuine(answered("GET", "/rw", user="Other"))


def test_basic_login_is_refused_with_a_sentence() -> None:
    with pytest.raises(ProtocolError, match="logs in with HTTP digest, not with 'Basic'"):
        http.read_credentials("Basic dTpw")


def test_credentials_without_a_field_are_refused_with_its_name() -> None:
    with pytest.raises(ProtocolError, match="lacks uri, response"):
        http.read_credentials('Digest username="u", realm="r", nonce="n", nc=1, cnonce="c"')


def test_nonce_tells_its_age_to_its_maker() -> None:
    nonce = http.make_nonce(SECRET, now=1000.0, count=3)
    assert http.nonce_age(nonce, SECRET, now=1007.5) == 7.5


@pytest.mark.parametrize("nonce", [NONCE.lower(), "no base64", "", http.make_nonce("0" * 16, 1.0, 1)])
def test_nonce_of_another_maker_has_no_age(nonce: str) -> None:
    assert http.nonce_age(nonce, SECRET, now=1000.0) is None


@pytest.mark.parametrize("field", ["user", "response", "uri", "cnonce", "nc", "nonce"])
def test_credentials_that_are_no_text_are_not_genuine(field: str) -> None:
    """Bytes of a header that are no UTF-8 reach us as lone surrogates."""
    forged = replace(answered("GET", "/rw"), **{field: "\udcff"})
    assert not is_genuine(forged)


def test_nonce_of_a_time_without_end_is_not_ours() -> None:
    nonce = b64encode(f"secret:{http.REALM}:{'f' * 400}:1".encode()).decode()
    assert http.nonce_age(nonce, "secret", 0.0) is None
