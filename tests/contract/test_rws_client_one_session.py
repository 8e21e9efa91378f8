"""Whatever happens to requests, a client has one session, and what it watches goes on."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from random import Random

import httpx
import pytest

from abb_protocols.errors import ControllerRefused, NoConnection
from abb_runtime.clock import ManualClock
from abb_runtime.rws.client import EXECUTION, SPEED_RATIO, Change, Interruption, RwsClient
from abb_runtime.rws.transport import AnswerTimeout, ConnectionLost
from contract.rws_bench import PlainController
from memory_http import MemoryHttp
from soak import long, short
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.subscriptions import Upgrade

SHARE = 0.2
"""Of the requests, something happens to so many."""

KINDS = ("dropped", "lost", "too late", "busy", "forgotten", "restarted")
"""A reset before the controller has the request, a reset and a timeout after it, 503, 401, and a restart."""


class Unreliable(MemoryHttp):
    """A controller that is gone, restarts, forgets sessions, is busy, or whose answers are lost, at random.

    Attributes:
        happened: how often each.
        sessions: those that the client may hold: given to it, and not forgotten by the controller since.
        most: the largest number of them at a time.
        share: of the requests, something happens to so many.
    """

    def __init__(self, controller: PlainController, clock: ManualClock, seed: int) -> None:
        super().__init__(controller, clock)  # type: ignore[arg-type]
        self.happened: Counter[str] = Counter()
        self.sessions: set[str] = set()
        self.most = 0
        self.share = SHARE
        self._random = Random(seed)
        self._clock = clock

    def handle(self, request: HttpRequest) -> HttpReply | Upgrade | None:
        kind = self._random.choice(KINDS) if self._random.random() < self.share else ""
        # An answer to a login that is lost leaves a session that no client can know of: RWS has no way to end it.
        if kind in ("lost", "too late") and request.header("Authorization"):
            kind = "dropped"
        self.happened[kind] += 1
        if kind == "dropped":
            raise ConnectionLost("The connection was reset.")
        if kind == "busy":
            return HttpReply(503)
        if kind in ("forgotten", "restarted"):  # both forget the sessions; a restart breaks the WebSockets, too
            self._forget()
            self.hang_up()
        reply = super().handle(request)
        if isinstance(reply, HttpReply):
            for name, value in reply.headers:
                if name == "Set-Cookie" and value.startswith("-http-session-"):
                    self.sessions.add(value.partition(";")[0])
            self.most = max(self.most, len(self.sessions))
        if kind == "lost":
            raise ConnectionLost("The connection was reset.")
        if kind == "too late":
            raise AnswerTimeout("The answer did not end in time.")
        return reply

    def _forget(self) -> None:
        """Ask as a client would whose session has ended: log out with each cookie."""
        for cookie in sorted(self.sessions):
            super().handle(HttpRequest("GET", "/logout", (("Cookie", cookie),)))
        self.sessions.clear()


@pytest.mark.parametrize("requests", [short(400), long(10_000, seconds=300)])
def test_client_has_one_session_and_watches_on_whatever_happens(requests: int) -> None:
    clock = ManualClock()
    controller = PlainController()
    http = Unreliable(controller, clock, seed=7)
    client = RwsClient(http, clock=clock)
    http.share = 0.0
    changes = client.watch([SPEED_RATIO])
    next(changes)  # the first subscription is not tried again
    http.share = SHARE
    seen, interruptions, done = "", 0, 0
    for number in range(requests):
        with suppress(NoConnection, ControllerRefused):
            if number % 3:
                assert client.speed_ratio() == controller.speed_ratio
            else:
                client.set_speed_ratio(number % 100)
                assert controller.speed_ratio == number % 100
            done += 1
        clock.advance(0.3)  # more than there is between two events
        http.advance()
        while number % 10 == 0 and seen != str(controller.speed_ratio):  # were the change lost, this would not end
            item = next(changes)
            interruptions += isinstance(item, Interruption)
            seen = item.fields["speedratio"] if isinstance(item, Change) else ""
    assert min(http.happened[kind] for kind in KINDS) > requests / 100
    assert http.most == 1
    assert interruptions > requests / 100
    assert done > 0.7 * requests


def test_watch_subscribes_again_after_a_break_says_so_and_misses_no_value() -> None:
    clock = ManualClock()
    controller = PlainController()
    http = MemoryHttp(controller, clock)  # type: ignore[arg-type]
    with RwsClient(http, clock=clock) as client:
        changes = client.watch([SPEED_RATIO, EXECUTION])
        seen = [next(changes), next(changes)]
        assert [item.fields for item in seen if isinstance(item, Change)] == [
            {"speedratio": "100"},
            {"ctrlexecstate": "stopped"},
        ]
        http.hang_up()
        controller.speed_ratio = 30  # while nothing is subscribed
        assert isinstance(next(changes), Interruption)
        assert next(changes) == Change(SPEED_RATIO.path, {"speedratio": "30"})
        changes.close()


def test_watch_waits_for_a_controller_that_is_gone() -> None:
    clock = Returning()
    http = MemoryHttp(PlainController(), clock)  # type: ignore[arg-type]
    clock.http = http
    with RwsClient(http, clock=clock) as client:
        changes = client.watch([SPEED_RATIO])
        next(changes)
        http.hang_up()
        http.is_there = False
        assert isinstance(next(changes), Interruption)
        assert next(changes) == Change(SPEED_RATIO.path, {"speedratio": "100"})
        assert clock.now() >= 5.0
        changes.close()


class Returning(ManualClock):
    """After five seconds the controller is there again."""

    http: MemoryHttp

    def wait(self, seconds: float) -> None:
        super().wait(seconds)
        self.http.is_there = self.now() >= 5.0


def test_watch_leaves_no_subscription_behind() -> None:
    clock = ManualClock()
    http = MemoryHttp(PlainController(), clock)  # type: ignore[arg-type]
    deleted: list[str] = []
    handle = http.handle_request

    def counted(request: httpx.Request) -> httpx.Response:
        if request.method == "DELETE":
            deleted.append(request.url.path)
        return handle(request)

    http.handle_request = counted  # type: ignore[method-assign]
    with RwsClient(http, clock=clock) as client:
        for _ in range(5):  # a controller gives a session two subscriptions at most
            changes = client.watch([SPEED_RATIO])
            next(changes)
            changes.close()
    assert len(deleted) == 5
