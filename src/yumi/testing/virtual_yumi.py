"""The virtual robot in virtual time: a clock of its own, Robot Web Services and EGM in memory.

No socket is between: a client's requests go straight to the virtual controller, and its messages straight back.
"""

from __future__ import annotations

import logging
from threading import RLock

import httpx

from yumi.clock import Clock, ManualClock
from yumi.driver.bringup import Bringup
from yumi.driver.state_machine import EgmMotionSettings
from yumi.egm.udp import memory_links
from yumi.errors import ControllerRefused
from yumi.robot.joints import Side
from yumi.rws.client import DEFAULT_PASSWORD, DEFAULT_USER, RwsClient
from yumi.rws.transport import ConnectionLost, Listener
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.fault_injection import FaultInjection
from yumi.virtual.rws.http import HttpReply, HttpRequest
from yumi.virtual.rws.service import RwsService
from yumi.virtual.rws.subscriptions import Upgrade
from yumi.virtual.world import World, WorldSettings

log = logging.getLogger(__name__)


class VirtualYumi(ManualClock):
    """A virtual robot with a clock of its own: time passes when a test waits, as fast as it can be computed.

    Attributes:
        world: the robot: its controller, arms, grippers and EGM clients.
        rws: its Robot Web Services, the transport of an ``RwsClient``; ``handle_request`` answers requests of httpx.
        egm: per arm what takes the place of the sensor's UDP socket: ``receive()`` and ``send(datagram)``.
        faults: injects faults into it.

    Args:
        settings: what the robot is like; a stock YuMi when left out.
    """

    def __init__(self, settings: WorldSettings | None = None) -> None:
        super().__init__()
        self.world = World(settings)
        links = {side: memory_links() for side in Side}
        self.egm = {side: sensor for side, (sensor, _) in links.items()}
        self._robot_ends = {side: robot for side, (_, robot) in links.items()}
        self.rws = MemoryRws(self.world.controller, self)
        self.faults = FaultInjection(self.world, self.rws.adapter)

    def wait(self, seconds: float) -> None:
        """Let the robot go on for ``seconds``, in whole cycles, at least one."""
        for _ in range(max(1, round(seconds / self.world.cycle_time))):
            self.advance(self.world.cycle_time)
            inboxes = {side: end.receive() for side, end in self._robot_ends.items()}
            for side, datagram, is_foreign in self.world.exchange(inboxes):
                if not is_foreign:  # memory has one sender only
                    self._robot_ends[side].send(datagram)
            self.rws.advance()

    def client(self) -> RwsClient:
        """A client of its Robot Web Services, to be used in a ``with`` block."""
        return RwsClient(self.rws, clock=self)

    def start_egm(self, motion: EgmMotionSettings | None = None) -> None:
        """Bring the robot to ready and start EGM on both arms, as the driver does.

        Args:
            motion: of EGM; the driver's own when left out.

        Raises:
            RobotNotReady: it did not become ready, or EGM did not start; the message says why.
        """
        with self.client() as client:
            bringup = Bringup(client, motion or EgmMotionSettings(), self, log.info)
            bringup.make_ready()
            bringup.start_egm()


class MemoryChannel:
    """The controller's end of a WebSocket."""

    def __init__(self, listener: Listener) -> None:
        self.is_open = True
        self.has_left = False
        self._listener = listener

    def send(self, text: str) -> None:
        if self.is_open:
            self._listener.on_text(text)

    def abort(self) -> None:
        if self.is_open:
            self.is_open = False
            self._listener.on_lost("The WebSocket of memory broke.")

    def close(self) -> None:
        """The controller's end goes in order."""
        self.abort()


class MemorySocket:
    """The client's end."""

    def __init__(self, channel: MemoryChannel) -> None:
        self._channel = channel

    def close(self) -> None:
        self._channel.has_left = self._channel.is_open
        self._channel.is_open = False


class MemoryRws:
    """A transport to ``controller``; call ``advance`` whenever time has passed.

    Args:
        controller: the virtual one.
        clock: of both ends.

    Attributes:
        adapter: the controller's end of it.
    """

    address = "memory"

    def __init__(self, controller: Irc5, clock: Clock) -> None:
        self.adapter = RwsService(controller, user=DEFAULT_USER, password=DEFAULT_PASSWORD, hang_up=self.hang_up)
        self._clock = clock
        self._channels: list[MemoryChannel] = []
        self._lock = RLock()  # the driver's threads ask side by side, a controller answers one after another

    def advance(self) -> None:
        """Send what has changed to the subscribers."""
        with self._lock:
            self.adapter.advance(self._clock.now())

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """The response, at once; raises ConnectionLost when there is none."""
        target = request.url.raw_path.decode("ascii")
        reply = self.handle(HttpRequest(request.method, target, tuple(request.headers.items()), request.read()))
        if not isinstance(reply, HttpReply):
            raise ConnectionLost("memory closed the connection without an HTTP answer.")
        headers = httpx.Headers(list(reply.headers), encoding="utf-8")
        return httpx.Response(reply.status, headers=headers, content=reply.body)

    def open_socket(self, target: str, cookies: str, listener: Listener, timeout: float) -> MemorySocket:
        """A WebSocket; raises ControllerRefused when the controller opens none."""
        headers = (("Cookie", cookies), ("Upgrade", "websocket"), ("Sec-WebSocket-Protocol", listener.protocol))
        reply = self.handle(HttpRequest("GET", target, headers, peer="socket"))
        if not isinstance(reply, Upgrade):
            raise ControllerRefused("memory does not open a WebSocket.", status=reply.status if reply else 0)
        channel = MemoryChannel(listener)
        self._channels.append(channel)
        reply.attach(channel)
        return MemorySocket(channel)

    def handle(self, request: HttpRequest) -> HttpReply | Upgrade | None:
        """What the controller makes of a request; None closes the connection."""
        with self._lock:
            return self.adapter.handle(request, self._clock.now())

    def hang_up(self) -> None:
        """The controller breaks all WebSockets."""
        for channel in self._channels:
            channel.abort()

    def close(self) -> None:
        """Nothing to close."""
