from __future__ import annotations

from base64 import b64encode
from dataclasses import replace

import pytest

from yumi.errors import ProtocolError
from yumi.rws import auth as digest

NONCE = "MGY0Yjc2MGY2Y2QyZjAwNzp2YWxpZHVzZXJzQHJvYmFwaS5hYmI6MTkwMjg5NjRlNGE6MA=="
USER, PASSWORD = "Default User", "robotics"
SECRET = "0f4b760f6cd2f007"

# Captured from a RobotWare 6 controller: reference/rws.md §2.1.
CAPTURED = (
    f'Digest realm="validusers@robapi.abb", domain="/", qop="auth", nonce="{NONCE}", opaque="799d5", '
    'algorithm="MD5", stale="FALSE"'
)


def answered(method: str, uri: str) -> digest.Credentials:
    challenge = digest.Challenge(NONCE)
    return digest.answer(challenge, user=USER, password=PASSWORD, method=method, uri=uri, cnonce="0a4f113b")


def is_genuine(credentials: digest.Credentials, target: str = "/rw", method: str = "GET") -> bool:
    return digest.is_genuine(credentials, user=USER, password=PASSWORD, method=method, target=target)


def test_challenge_is_the_one_a_controller_sends() -> None:
    assert digest.Challenge(NONCE).header() == CAPTURED


def test_challenge_is_read_from_a_controllers_header() -> None:
    assert digest.read_challenge(CAPTURED) == digest.Challenge(NONCE)


def test_challenge_is_stale_in_quotes() -> None:
    assert digest.read_challenge(CAPTURED.replace("FALSE", "TRUE")).is_stale


@pytest.mark.parametrize(
    ("method", "uri", "response"),
    [
        ("GET", "/rw/panel/ctrlstate?json=1", "71736cc89f242d2ff73ae1a73dc12d07"),
        ("POST", "/rw/panel/ctrlstate?action=setctrlstate", "46249511547a5e77b8bbd1a45c4710c2"),
    ],
)
def test_response_is_that_of_the_test_vector(method: str, uri: str, response: str) -> None:
    assert answered(method, uri).response == response


def test_credentials_survive_their_header() -> None:
    credentials = replace(answered("GET", "/rw"), user='a "quoted" \\ user')
    assert digest.read_credentials(credentials.header()) == credentials


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
    challenge = digest.Challenge(NONCE)
    other = digest.answer(challenge, user="Other", password=PASSWORD, method="GET", uri="/rw", cnonce="0a4f113b")
    assert not is_genuine(other)


def test_basic_login_is_refused_with_a_sentence() -> None:
    with pytest.raises(ProtocolError, match="logs in with HTTP digest, not with 'Basic'"):
        digest.read_challenge('Basic realm="validusers@robapi.abb"')


def test_protection_of_the_body_is_refused_with_a_sentence() -> None:
    with pytest.raises(ProtocolError, match="'auth-int'; only 'auth' is known"):
        digest.read_challenge('Digest realm="r", nonce="n", qop="auth-int"')


def test_credentials_without_a_field_are_refused_with_its_name() -> None:
    with pytest.raises(ProtocolError, match="lacks uri, response"):
        digest.read_credentials('Digest username="u", realm="r", nonce="n", nc=1, cnonce="c"')


def test_nonce_tells_its_age_to_its_maker() -> None:
    nonce = digest.make_nonce(SECRET, now=1000.0, count=3)
    assert digest.nonce_age(nonce, SECRET, now=1007.5) == 7.5


@pytest.mark.parametrize("nonce", [NONCE.lower(), "no base64", "", digest.make_nonce("0" * 16, 1.0, 1)])
def test_nonce_of_another_maker_has_no_age(nonce: str) -> None:
    assert digest.nonce_age(nonce, SECRET, now=1000.0) is None


@pytest.mark.parametrize("field", ["user", "response", "uri", "cnonce", "nc", "nonce"])
def test_credentials_that_are_no_text_are_not_genuine(field: str) -> None:
    """Bytes of a header that are no UTF-8 reach us as lone surrogates."""
    challenge = digest.Challenge(digest.make_nonce("s", 0.0, 1))
    login = digest.answer(challenge, user="u", password="p", method="GET", uri="/", cnonce="c")
    forged = replace(login, **{field: "\udcff"})
    assert not digest.is_genuine(forged, user="u", password="p", method="GET", target="/")


def test_nonce_of_a_time_without_end_is_not_ours() -> None:
    nonce = b64encode(f"secret:{digest.REALM}:{'f' * 400}:1".encode()).decode()
    assert digest.nonce_age(nonce, "secret", 0.0) is None
