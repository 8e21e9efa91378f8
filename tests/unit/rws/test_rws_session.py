"""Requests as they go out, and the cookies that are kept, with a transport that remembers what it was given."""

from __future__ import annotations

import httpx
import pytest

from abb_protocols.rws.values import ControllerState
from abb_runtime.clock import ManualClock
from abb_runtime.rws.client import RwsClient
from abb_runtime.rws.session import RwsRequest, RwsSession

SET_COOKIES = [
    ("Set-Cookie", "-http-session-=16::http.session::5ed6; path=/; httponly"),
    ("set-cookie", "ABBCX=1507337; path=/; httponly"),
]
COOKIES = "-http-session-=16::http.session::5ed6; ABBCX=1507337"


class Recorder:
    """Answers everything with ``headers`` and an empty page."""

    address = "yumi"
    request_interval = 0.0

    def __init__(self) -> None:
        self.sent: list[httpx.Request] = []
        self.headers: list[tuple[str, str]] = []

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        self.sent.append(httpx.Request(request.method, request.url, headers=request.headers, content=request.read()))
        page = b'<html><body><div class="state"/></body></html>'
        headers = httpx.Headers([("Content-Type", "text/html"), *self.headers], encoding="utf-8")
        return httpx.Response(200, headers=headers, content=page)

    def close(self) -> None:
        """Nothing to close."""


@pytest.fixture
def recorder() -> Recorder:
    return Recorder()


@pytest.fixture
def client(recorder: Recorder) -> RwsClient:
    return RwsClient(recorder, clock=ManualClock())  # type: ignore[arg-type] # it opens no WebSocket


def cookie_after(recorder: Recorder, *answers: list[tuple[str, str]]) -> str | None:
    """What the request after ``answers`` carries."""
    session = RwsSession(recorder, user="u", password="p", timeout=4.0, clock=ManualClock())  # type: ignore[arg-type]
    for recorder.headers in (*answers, []):
        session.exchange(RwsRequest("GET", "/rw"))
    assert session.is_open == ("-http-session-" in (recorder.sent[-1].headers.get("Cookie") or ""))
    return recorder.sent[-1].headers.get("Cookie")


def test_nothing_is_sent_unasked(recorder: Recorder) -> None:
    assert cookie_after(recorder) is None
    assert "Authorization" not in recorder.sent[0].headers


def test_cookies_of_the_session_are_sent_once_there_are_some(recorder: Recorder) -> None:
    assert cookie_after(recorder, SET_COOKIES) == COOKIES


def test_newest_connection_cookie_is_kept(recorder: Recorder) -> None:
    newer = [("Set-Cookie", "ABBCX=7; path=/; httponly")]
    assert cookie_after(recorder, SET_COOKIES, newer) == "-http-session-=16::http.session::5ed6; ABBCX=7"


def test_cookies_of_others_are_not_kept(recorder: Recorder) -> None:
    others = [("Set-Cookie", f"tracker{number}={'x' * 100}; path=/") for number in range(50)]
    assert cookie_after(recorder, SET_COOKIES, others) == COOKIES


@pytest.mark.parametrize("value", ["", "x" * 257, "two words", "a\x01b", "ü"])
def test_cookie_that_no_controller_sets_is_not_kept(recorder: Recorder, value: str) -> None:
    assert cookie_after(recorder, [("Set-Cookie", f"-http-session-={value}; path=/")]) is None


@pytest.mark.parametrize(
    ("call", "line", "body"),
    [
        (lambda client: client.set_motors(True), "POST /rw/panel/ctrlstate?action=setctrlstate", b"ctrl-state=motoron"),
        (lambda client: client.modules("T_ROB_R"), "GET /rw/rapid/modules?task=T_ROB_R", b""),
        (RwsClient.move_pp_to_main, "POST /rw/rapid/execution?action=resetpp", b""),
        (
            RwsClient.start_rapid,
            "POST /rw/rapid/execution?action=start",
            b"regain=continue&execmode=continue&cycle=forever&condition=none&stopatbp=disabled&alltaskbytsp=false",
        ),
        (
            lambda client: client.set_symbol("T_ROB_L", "TRobRAPID", "routine_name_input", '"run me"'),
            "POST /rw/rapid/symbol/data/RAPID/T_ROB_L/TRobRAPID/routine_name_input?action=set",
            b"value=%22run%20me%22",
        ),
        (lambda client: client.set_signal("EGM_STOP", 1), "POST /rw/iosystem/signals/EGM_STOP?action=set", b"lvalue=1"),
        (lambda client: client.set_signal("AO_1", 2.5), "POST /rw/iosystem/signals/AO_1?action=set", b"lvalue=2.5"),
        (lambda client: client.download("HOME:/ä b"), "GET /fileservice/$home/%C3%A4%20b", b""),
        (lambda client: client.events(count=20), "GET /rw/elog/0?lang=en&order=lifo&start=1&limit=20", b""),
    ],
)
def test_request_is_what_the_controller_expects(
    client: RwsClient, recorder: Recorder, call: object, line: str, body: bytes
) -> None:
    call(client)  # type: ignore[operator]
    [request] = recorder.sent
    assert f"{request.method} {request.url.raw_path.decode()}" == line
    assert request.content == body


@pytest.mark.parametrize("path", ["/rw/panel/ctrlstate", "/rw/rapid/symbol/data/RAPID/T/M/a{1}", "/a;b/$home/50% ü"])
def test_httpx_puts_a_target_on_the_wire_as_it_is(recorder: Recorder, path: str) -> None:
    """The digest is over the path as it is sent, so nothing may escape it once more."""
    session = RwsSession(recorder, user="u", password="p", timeout=4.0, clock=ManualClock())  # type: ignore[arg-type]
    request = RwsRequest("GET", path, (("start", "1"), ("name", "a;b&c+d")))
    session.exchange(request)
    assert recorder.sent[0].url.raw_path.decode() == request.target


def test_states_that_are_written_are_spelled_as_the_controller_spells_them() -> None:
    assert (ControllerState.MOTORS_ON.value, ControllerState.MOTORS_OFF.value) == ("motoron", "motoroff")


def test_only_reading_is_repeatable() -> None:
    assert RwsRequest("GET", "/rw/rapid/tasks").is_repeatable
    assert not RwsRequest("POST", "/rw/rapid/execution").is_repeatable
