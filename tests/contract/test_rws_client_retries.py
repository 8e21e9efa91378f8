"""Which requests are sent again and which never are, with a transport that answers by script."""

from __future__ import annotations

import httpx
import pytest

from abb_protocols.errors import LoginRefused, NoConnection
from abb_runtime.clock import ManualClock
from abb_runtime.rws.session import REQUEST_BURST, RwsRequest, RwsSession
from abb_runtime.rws.transport import EXCHANGE_INTERVAL, ConnectionLost
from refusals import refused
from virtual_irc5.rws import http

TIMEOUT = 4.0
READ = RwsRequest("GET", "/rw/rapid/execution")
WRITE = RwsRequest("POST", "/rw/rapid/execution", (("action", "start"),), (("cycle", "forever"),))

OK = httpx.Response(200, headers={"Set-Cookie": "-http-session-=1; path=/"})
BUSY = httpx.Response(503)
STRANGER = httpx.Response(401, headers={"WWW-Authenticate": http.digest_challenge("abc")})
LOST = ConnectionLost("the connection broke")
DEAD = NoConnection("nothing answers")


class ScriptedTransport:
    """Answers with the script's entries in turn, each after half a second."""

    address = "yumi"
    request_interval = EXCHANGE_INTERVAL

    def __init__(self, clock: ManualClock, *script: httpx.Response | NoConnection) -> None:
        self._clock = clock
        self._script = list(script)
        self.sent: list[httpx.Request] = []
        self.timeouts: list[float] = []

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        self.sent.append(httpx.Request(request.method, request.url, headers=request.headers, content=request.read()))
        self.timeouts.append(request.extensions["deadline"].end - self._clock.now())
        self._clock.advance(0.5)
        reply = self._script.pop(0)
        if isinstance(reply, NoConnection):
            raise reply
        return reply

    def close(self) -> None:
        self._script.clear()


def ask(request: RwsRequest, *script: httpx.Response | NoConnection, timeout: float = TIMEOUT) -> ScriptedTransport:
    """The transport after one request; an error of the session passes through."""
    clock = ManualClock()
    transport = ScriptedTransport(clock, *script)
    session = RwsSession(transport, user="u", password="p", timeout=timeout, clock=clock)
    assert session.exchange(request).status_code == (BUSY if script[-1] is BUSY else OK).status_code
    return transport


@pytest.mark.parametrize("script", [(LOST, OK), (LOST, LOST, OK), (BUSY, LOST, OK), (BUSY, BUSY, BUSY)])
def test_reading_is_tried_up_to_three_times(script: tuple[httpx.Response | NoConnection, ...]) -> None:
    assert len(ask(READ, *script).sent) == len(script)


def test_reading_gives_up_when_the_connection_breaks_three_times() -> None:
    with pytest.raises(ConnectionLost, match="the connection broke"):
        ask(READ, LOST, LOST, LOST, OK)


def test_reading_is_not_tried_again_when_nothing_answers() -> None:
    with pytest.raises(NoConnection, match="nothing answers"):
        ask(READ, DEAD, OK)


def test_writing_is_never_tried_again_when_the_connection_breaks() -> None:
    with pytest.raises(ConnectionLost, match="the connection broke"):
        ask(WRITE, LOST, OK)


def test_writing_is_not_tried_again_when_the_controller_is_busy() -> None:
    assert len(ask(WRITE, BUSY).sent) == 1


def test_writing_is_sent_again_after_a_challenge_with_a_proof() -> None:
    first, second = ask(WRITE, STRANGER, OK).sent
    credentials = http.read_credentials(second.headers["Authorization"])
    assert "Authorization" not in first.headers
    target = second.url.raw_path.decode()
    assert http.is_genuine(credentials, user="u", password="p", method="POST", target=target)
    assert first.content == second.content == b"cycle=forever"


def test_second_challenge_refuses_the_login() -> None:
    with refused(LoginRefused, "login_refused", address="yumi", user="u"):
        ask(READ, STRANGER, STRANGER, OK)


def test_attempts_share_one_deadline() -> None:
    assert ask(READ, LOST, LOST, OK).timeouts == [4.0, 3.5, 3.0]


def test_no_attempt_begins_after_the_deadline() -> None:
    with refused(NoConnection, "no_answer_in_time", address="yumi", timeout=1.0):
        ask(READ, LOST, LOST, OK, timeout=1.0)


@pytest.fixture
def limited() -> tuple[RwsSession, ManualClock]:
    """A session of a controller that answers at once, once it has let the user in."""
    clock = ManualClock()
    transport = ScriptedTransport(clock)
    transport.handle_request = lambda request: OK if {"authorization", "cookie"} & {*request.headers} else STRANGER  # type: ignore[method-assign]
    return RwsSession(transport, user="u", password="p", timeout=TIMEOUT, clock=clock), clock


def test_every_request_on_the_wire_counts_for_the_rate_limit(limited: tuple[RwsSession, ManualClock]) -> None:
    session, clock = limited
    for _ in range(40):
        session.exchange(READ)
    assert clock.now() == pytest.approx((40 + 1 - REQUEST_BURST) * EXCHANGE_INTERVAL)


def test_no_request_waits_once_the_rate_limit_is_lifted(limited: tuple[RwsSession, ManualClock]) -> None:
    session, clock = limited
    session.lift_rate_limit()
    for _ in range(40):
        session.exchange(READ)
    assert clock.now() == 0.0


def test_rate_limit_is_kept_again_once_another_controller_may_answer(limited: tuple[RwsSession, ManualClock]) -> None:
    session, clock = limited
    session.exchange(READ)
    session.lift_rate_limit()
    session.close()  # as a controller that does not know the session
    for _ in range(41):
        session.exchange(READ)
    assert session.login_count == 2
    assert clock.now() == pytest.approx((2 + 40 - REQUEST_BURST) * EXCHANGE_INTERVAL)


def test_waiting_for_its_turn_is_no_part_of_the_timeout() -> None:
    clock = ManualClock()
    transport = ScriptedTransport(clock, *[OK] * 40)
    clock.advance = lambda seconds: None  # type: ignore[method-assign] # the controller answers at once
    session = RwsSession(transport, user="u", password="p", timeout=0.1, clock=clock)
    clock.wait = lambda seconds: ManualClock.advance(clock, seconds)  # type: ignore[method-assign]
    for _ in range(40):
        session.exchange(READ)
    assert transport.timeouts == pytest.approx([0.1] * 40)
