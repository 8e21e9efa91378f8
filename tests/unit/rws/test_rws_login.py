from __future__ import annotations

import pytest

from yumi.rws import auth as digest
from yumi.rws.auth import Login

SET_COOKIES = (
    ("Set-Cookie", "-http-session-=16::http.session::5ed6; path=/; httponly"),
    ("set-cookie", "ABBCX=1507337; path=/; httponly"),
)


def login() -> Login:
    return Login("Default User", "robotics", make_cnonce=lambda: "0a4f113b")


def test_login_sends_nothing_unasked() -> None:
    assert login().headers() == ()
    assert not login().has_session


def test_login_answers_a_challenge_for_one_request() -> None:
    [(name, value)] = login().answer(digest.Challenge("abc"), "GET", "/rw")
    credentials = digest.read_credentials(value)
    assert name == "Authorization"
    assert digest.is_genuine(credentials, user="Default User", password="robotics", method="GET", target="/rw")


def test_login_lives_on_cookies_once_it_has_them() -> None:
    session = login()
    session.accept(SET_COOKIES)
    assert session.headers() == (("Cookie", "-http-session-=16::http.session::5ed6; ABBCX=1507337"),)
    assert session.has_session


def test_login_keeps_the_newest_connection_cookie() -> None:
    session = login()
    session.accept(SET_COOKIES)
    session.accept((("Set-Cookie", "ABBCX=7; path=/; httponly"),))
    assert session.headers() == (("Cookie", "-http-session-=16::http.session::5ed6; ABBCX=7"),)


def test_login_forgets_the_old_session_when_it_is_challenged() -> None:
    session = login()
    session.accept(SET_COOKIES)
    session.answer(digest.Challenge("abc"), "GET", "/rw")
    assert not session.has_session


def test_login_keeps_no_cookie_of_others() -> None:
    session = login()
    session.accept(SET_COOKIES)
    known = session.headers()
    session.accept(tuple(("Set-Cookie", f"tracker{number}={'x' * 100}; path=/") for number in range(50)))
    assert session.headers() == known


@pytest.mark.parametrize("value", ["", "x" * 257, "two words", "a\x01b", "ü"])
def test_login_keeps_no_cookie_that_no_controller_sets(value: str) -> None:
    session = login()
    session.accept((("Set-Cookie", f"-http-session-={value}; path=/"),))
    assert session.headers() == ()
