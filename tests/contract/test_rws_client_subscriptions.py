"""The client is told of changes: by the whole virtual controller, in virtual time, and once over a true WebSocket."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, ControllerRefused, NoConnection
from abb_protocols.rws.values import OperatingMode, Priority, Resource
from abb_runtime.clock import ManualClock
from abb_runtime.rws import client as rws
from abb_runtime.rws.client import Change, RwsClient
from contract.rws_bench import PlainController
from memory_http import MemoryHttp
from refusals import refused
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.rws.subscriptions import POLL_PERIOD, Upgrade

SIGNAL = rws.signal_state("EGM_START_JOINT")
PERSISTENT = rws.variable_value("T_ROB_R", "TRobSystem", "routine_name_input")


class Told:
    """A client in virtual time, and what it has been told."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.controller = PlainController()
        self.http = MemoryHttp(self.controller, self.clock)
        self.client = RwsClient(self.http, clock=self.clock)
        self.changes: list[Change] = []
        self.losses: list[str] = []

    def subscribe(self, *resources: Resource) -> None:
        self.subscription = self.client.subscribe(resources, self.changes.append, self.losses.append)
        self.changes.clear()

    def news(self, seconds: float = POLL_PERIOD) -> list[Change]:
        """What comes after a while."""
        self.changes.clear()
        self.clock.advance(seconds)
        self.http.advance()
        return list(self.changes)


@pytest.fixture
def told() -> Told:
    return Told()


def test_present_values_come_with_the_subscription(told: Told) -> None:
    resources = (rws.CONTROLLER_STATE, rws.SPEED_RATIO, SIGNAL, PERSISTENT)
    told.client.subscribe(resources, told.changes.append, told.losses.append)
    assert told.changes == [
        Change(rws.CONTROLLER_STATE.path, {"ctrlstate": "motoroff"}),
        Change(rws.SPEED_RATIO.path, {"speedratio": "100"}),
        Change(SIGNAL.path, {"lvalue": "0", "lstate": "not simulated"}),
        Change(PERSISTENT.path, {"value": '""'}),
    ]


@pytest.mark.parametrize(
    ("resource", "happen", "fields"),
    [
        (rws.CONTROLLER_STATE, lambda c: c.set_motors(True), {"ctrlstate": "motoron"}),
        (rws.OPERATING_MODE, lambda c: setattr(c, "mode", OperatingMode.MANUAL_REDUCED), {"opmode": "MANR"}),
        (rws.SPEED_RATIO, lambda c: c.set_speed_ratio(30), {"speedratio": "30"}),
        (rws.EXECUTION, lambda c: setattr(c, "is_running", True), {"ctrlexecstate": "running"}),
        (rws.COLLISION_STATE, lambda c: setattr(c, "collision_state", OperatingMode.AUTO), {"coldetstate": "AUTO"}),
        (SIGNAL, lambda c: c.signals.set("EGM_START_JOINT", 1), {"lvalue": "1", "lstate": "not simulated"}),
        (PERSISTENT, lambda c: c.tasks["T_ROB_R"].write("TRobSystem", "routine_name_input", '"a"'), {"value": '"a"'}),
        (rws.event_log(), lambda c: c.events.append(10011, "Motors ON"), {"seqnum": "1"}),
    ],
)
def test_change_is_told_at_once(told: Told, resource: Resource, happen: object, fields: dict[str, str]) -> None:
    told.subscribe(resource)
    assert told.news() == []
    happen(told.controller)  # type: ignore[operator]
    assert told.news() == [Change(resource.path, fields)]
    assert told.news(10.0) == []


@pytest.mark.parametrize(("priority", "spacing"), [(Priority.LOW, 5.0), (Priority.MEDIUM, 0.2), (Priority.HIGH, 0.05)])
def test_priority_sets_the_time_between_two_changes(told: Told, priority: Priority, spacing: float) -> None:
    told.subscribe(rws.signal_state("EGM_START_JOINT", priority))
    told.controller.signals.set("EGM_START_JOINT", 1)
    assert len(told.news()) == 1
    told.controller.signals.set("EGM_START_JOINT", 0)
    assert told.news(spacing - 0.02) == []
    assert [change.fields["lvalue"] for change in told.news(0.03)] == ["0"]


def test_every_message_of_the_event_log_is_told(told: Told) -> None:
    told.subscribe(rws.event_log())
    for _ in range(3):
        told.controller.events.append(10011, "Motors ON")
    assert [change.fields["seqnum"] for change in told.news()] == ["1", "2", "3"]


def test_closed_subscription_tells_nothing(told: Told) -> None:
    told.subscribe(rws.SPEED_RATIO)
    told.subscription.close()
    told.controller.set_speed_ratio(30)
    assert (told.news(), told.losses) == ([], [])


def test_client_may_have_two_subscriptions(told: Told) -> None:
    told.subscribe(rws.SPEED_RATIO)
    told.subscribe(SIGNAL)
    reason = message("rws_max_limit_reached")
    with refused(ControllerRefused, "rws_refused", what="subscribing", reason=reason):
        told.subscribe(rws.SPEED_RATIO)
    told.subscription.close()
    told.subscribe(rws.SPEED_RATIO)


@pytest.mark.parametrize(
    ("happen", "is_there"),
    [(RwsService.drop_web_sockets, True), (RwsService.expire_sessions, False), (RwsService.reset_connections, True)],
)
def test_loss_is_told_once_and_a_new_subscription_works(told: Told, happen: object, is_there: bool) -> None:
    told.subscribe(rws.SPEED_RATIO)
    happen(told.http.adapter)  # type: ignore[operator]
    told.news()
    assert told.losses == ["The WebSocket of memory broke."]
    told.subscribe(rws.SPEED_RATIO)
    told.controller.set_speed_ratio(30)
    assert len(told.news()) == 1


def test_restart_ends_subscriptions_and_answers_nothing_while_it_lasts(told: Told) -> None:
    told.subscribe(rws.SPEED_RATIO)
    told.controller.is_restarting = True
    told.news()
    with refused(NoConnection, "memory_gave_no_answer"):
        told.client.speed_ratio()
    told.controller.is_restarting = False
    assert told.client.speed_ratio() == 100
    assert len(told.losses) == 1


def test_session_with_an_open_web_socket_does_not_expire(told: Told) -> None:
    told.subscribe(rws.SPEED_RATIO)
    for _ in range(4):
        told.news(200.0)
    assert told.losses == []


def test_subscription_to_nothing_is_refused(told: Told) -> None:
    with refused(CommandRefused, "no_resource_named"):
        told.client.subscribe([], told.changes.append, told.losses.append)


def test_busy_controller_refuses_and_serves_again(told: Told) -> None:
    told.client.speed_ratio()
    told.http.adapter.be_busy(5.0)
    with refused(ControllerRefused, "sessions_taken", address="memory", most=70):
        told.client.speed_ratio()
    told.clock.advance(5.0)
    assert told.client.speed_ratio() == 100


class Wire:
    """A controller on a true WebSocket; ``news`` waits for what it tells."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.controller = PlainController()
        self.server = HttpServer(self._handle, port=0)
        self.adapter = RwsService(
            self.controller, user="Default User", password="robotics", hang_up=self.server.hang_up
        )
        self.changes: list[Change] = []
        self.losses: list[str] = []
        self.arrived = threading.Event()

    def _handle(self, request: HttpRequest) -> HttpReply | Upgrade | None:
        return self.adapter.handle(request, self.clock.now())

    def on_change(self, change: Change) -> None:
        self.changes.append(change)
        self.arrived.set()

    def on_lost(self, sentence: str) -> None:
        self.losses.append(sentence)
        self.arrived.set()

    def until(self, has_come: Callable[[], object]) -> None:
        """Let the controller look until what is waited for has come: something older may arrive before it."""
        for _ in range(500):
            if has_come():
                break
            self.clock.advance(POLL_PERIOD)
            self.adapter.advance(self.clock.now())
            self.arrived.wait(0.01)
            self.arrived.clear()


@pytest.fixture
def wire() -> Iterator[Wire]:
    wire = Wire()
    with wire.server:
        yield wire


@pytest.fixture
def client(wire: Wire) -> Iterator[RwsClient]:
    with RwsClient(wire.server.address) as client:
        client.subscribe([rws.SPEED_RATIO], wire.on_change, wire.on_lost)
        yield client


def test_change_comes_over_the_wire(wire: Wire, client: RwsClient) -> None:
    known = len(wire.changes)
    wire.controller.set_speed_ratio(30)
    wire.until(lambda: len(wire.changes) > known)
    assert wire.changes[-1] == Change(rws.SPEED_RATIO.path, {"speedratio": "30"})


def test_host_is_looked_up_once_for_requests_and_web_sockets(wire: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    look_up, names = socket.getaddrinfo, []

    def local(host: str, *args: int, **kinds: int) -> object:
        names.append(host)
        return look_up("127.0.0.1", *args, **kinds)

    monkeypatch.setattr(socket, "getaddrinfo", local)
    with RwsClient(f"yumi.test:{wire.server.port}") as client:
        client.subscribe([rws.SPEED_RATIO], wire.on_change, wire.on_lost)
    assert names.count("yumi.test") == 1


def test_broken_web_socket_is_told(wire: Wire, client: RwsClient) -> None:
    wire.adapter.drop_web_sockets()
    wire.until(lambda: wire.losses)
    assert wire.losses == [str(message("websocket_broke", address=wire.server.address))]


def test_web_socket_that_the_controller_closes_is_told(wire: Wire, client: RwsClient) -> None:
    wire.adapter.expire_sessions()
    wire.until(lambda: wire.losses)
    assert wire.losses == [str(message("websocket_closed", address=wire.server.address, number=1000))]


def test_broken_connections_are_told_and_made_again(wire: Wire, client: RwsClient) -> None:
    wire.adapter.reset_connections()
    wire.until(lambda: wire.losses)
    assert wire.losses == [str(message("websocket_broke", address=wire.server.address))]
    assert client.speed_ratio() == 100


def test_client_that_is_closed_hears_nothing(wire: Wire, client: RwsClient) -> None:
    client.close()
    wire.adapter.advance(0.0)
    assert wire.losses == []


def test_listener_that_fails_is_told_of_the_loss_and_can_subscribe_again(
    wire: Wire, caplog: pytest.LogCaptureFixture
) -> None:
    """Its thread ends, and is not begun again: who listens opens another WebSocket."""

    def fail(change: Change) -> None:
        if change.fields.get("speedratio") == "30":
            raise RecursionError("maximum recursion depth exceeded")

    with RwsClient(wire.server.address) as client:
        client.subscribe([rws.SPEED_RATIO], fail, wire.on_lost)
        wire.controller.set_speed_ratio(30)
        wire.until(lambda: wire.losses)
        assert len(wire.losses) == 1
        wire.controller.set_speed_ratio(40)
        client.subscribe([rws.SPEED_RATIO], wire.on_change, wire.on_lost)
        assert wire.changes[-1] == Change(rws.SPEED_RATIO.path, {"speedratio": "40"})
    failed = [record for record in caplog.records if "failed: maximum recursion" in record.getMessage()]
    assert [record.exc_info is not None for record in failed] == [True]
