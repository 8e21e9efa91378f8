"""Calls of the RWS client that wait for a controller poll it at their period, and end at their deadline."""

from __future__ import annotations

import httpx
import pytest

from abb_protocols.errors import NoConnection
from abb_protocols.rws.operations.rapid import TASKS
from abb_runtime.clock import ManualClock
from abb_runtime.rws.client import RwsClient
from abb_runtime.rws.session import OpenWebSocket
from abb_runtime.rws.transport import ConnectionLost
from abb_runtime.rws.web_socket import Listener
from refusals import refused

PENDING = """<html><body><div class="state"><ul><li class="progress" title="1">
<span class="code">294914</span><span class="state">PENDING</span></li></ul></div></body></html>"""
NO_TASKS = "<html><body><div class='state'/></body></html>"


class WaitingController:
    """A transport to a controller whose jobs never end, and which goes down in a restart if ``goes_down``."""

    address = "192.0.2.1"
    request_interval = 0.0

    def __init__(self, *, goes_down: bool = False) -> None:
        self.paths: list[str] = []
        self._goes_down = goes_down

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        path = request.url.path
        self.paths.append(path)
        if path == TASKS.path and self._goes_down:
            raise ConnectionLost("gone")
        if path == "/ctrl/backup":
            return httpx.Response(202, headers={"Location": "/progress/1"})
        headers = {"Content-Type": "application/xhtml+xml"}
        return httpx.Response(200, headers=headers, text=PENDING if path == "/progress/1" else NO_TASKS)

    def open_socket(self, target: str, cookies: str, listener: Listener, timeout: float) -> OpenWebSocket:
        raise NotImplementedError

    def close(self) -> None:
        """Nothing is open."""


def test_job_that_does_not_end_is_given_up_after_ten_minutes() -> None:
    controller, clock = WaitingController(), ManualClock()
    with refused(NoConnection, "job_not_ended", deadline=600.0):
        RwsClient(controller, clock=clock).backup("monday")
    assert clock.now() == 600.0
    assert controller.paths.count("/progress/1") == 1201


@pytest.mark.parametrize(("goes_down", "code"), [(False, "restart_not_begun"), (True, "restart_not_ended")])
def test_restart_that_does_not_happen_is_given_up_at_its_deadline(goes_down: bool, code: str) -> None:
    clock, said = ManualClock(), []
    with refused(NoConnection, code, deadline=20.0):
        RwsClient(WaitingController(goes_down=goes_down), clock=clock).wait_for_restart(said.append, 20.0)
    assert clock.now() == 20.0
    assert said[:2] == ["the controller restarts, 0 s", "the controller restarts, 1 s"]
    assert len(said) == 21
