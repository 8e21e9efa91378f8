"""Virtual robots for tests: one in memory and in virtual time, and a virtual controller in a process, in real time.

Between a test and :class:`VirtualYumi` is no socket: a client's requests go straight to the virtual controller, and its
messages straight back. :class:`ControllerProcess` serves Robot Web Services and EGM on ports.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from threading import RLock
from typing import Any

import httpx

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused
from abb_protocols.robot.joints import Side
from abb_runtime.clock import Clock, ManualClock
from abb_runtime.faults import Fault, inject_fault
from abb_runtime.process.command_process import Command
from abb_runtime.rws.client import DEFAULT_PASSWORD, DEFAULT_USER, RwsClient
from abb_runtime.rws.transport import ConnectionLost
from abb_runtime.rws.web_socket import Listener
from abb_runtime.udp import free_port, memory_links
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.rws.subscriptions import Upgrade
from virtual_irc5.world import FaultInjection, World, WorldSettings
from yumi.driver.bringup import Bringup
from yumi.driver.state_machine import EgmMotionSettings

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
        request_interval: shortest mean time between two requests [s]; 0 is no limit.

    Attributes:
        adapter: the controller's end of it.
    """

    address = "memory"

    def __init__(self, controller: Irc5, clock: Clock, request_interval: float = 0.0) -> None:
        self.request_interval = request_interval
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
            raise ConnectionLost(message("memory_gave_no_answer"))
        headers = httpx.Headers(list(reply.headers), encoding="utf-8")
        return httpx.Response(reply.status, headers=headers, content=reply.body)

    def open_socket(self, target: str, cookies: str, listener: Listener, timeout: float) -> MemorySocket:
        """A WebSocket; raises ControllerRefused when the controller opens none."""
        headers = (("Cookie", cookies), ("Upgrade", "websocket"), ("Sec-WebSocket-Protocol", listener.protocol))
        reply = self.handle(HttpRequest("GET", target, headers, peer="socket"))
        if not isinstance(reply, Upgrade):
            raise ControllerRefused(message("memory_opened_no_websocket"), status=reply.status if reply else 0)
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


_READY_TIMEOUT = 30.0  # [s] for a controller in a process of its own


class ControllerProcess:
    """``yumi controller`` as a child, in real time, on ports that are free; a context manager starts and stops it.

    Attributes:
        address: host and port of its Robot Web Services, ``127.0.0.1:49152``; known once it has started.
        user: who may log in.
        password: of the user.
        egm_ports: the UDP port where each arm expects the sensor, which the program under test has to listen on.

    Args:
        log: file for its output.
        options: of ``yumi controller``, by their names: ``left_object=0.02``, ``calibrated=True``.
    """

    def __init__(self, log: Path, options: Mapping[str, object] | None = None) -> None:
        given = dict(options or {})
        self.address = ""
        self.user = str(given.get("user", DEFAULT_USER))
        self.password = DEFAULT_PASSWORD
        self.egm_ports = {}
        for side in Side:
            self.egm_ports[side] = int(str(given.setdefault(f"{side.word}_egm_port", free_port())))
        arguments = ["controller"]
        for name, value in {"rws_port": 0, **given}.items():
            option = f"--{name.replace('_', '-')}"
            arguments += [] if value is False else [option] if value is True else [option, str(value)]
        self._command = Command("virtual controller", arguments, log, {"YUMI_PASSWORD": self.password})

    def __enter__(self) -> ControllerProcess:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def pid(self) -> int:
        """Number of its process."""
        return self._command.pid

    @property
    def rws_port(self) -> int:
        """HTTP port of its Robot Web Services."""
        return int(self.address.rpartition(":")[2])

    @property
    def connect_options(self) -> dict[str, Any]:
        """What ``yumi.connect`` needs: ``yumi.connect(**controller.connect_options)``."""
        return {
            "address": self.address,
            "left_egm_port": self.egm_ports[Side.LEFT],
            "right_egm_port": self.egm_ports[Side.RIGHT],
            "user": self.user,
            "password": self.password,
        }

    def start(self) -> None:
        """Start it and wait until it serves.

        Raises:
            RobotNotReady: it ended or did not serve in time; the message says why.
        """
        self._command.__enter__()
        try:
            self.address = self._command.wait_until_ready(_READY_TIMEOUT).rpartition("/")[2]
        except BaseException:
            self._command.stop()
            raise

    def stop(self) -> None:
        """End it in order."""
        self._command.stop()

    def inject(self, fault: Fault | str, **choices: object) -> None:
        """Inject a fault; raises as :func:`inject_fault`.

        Args:
            fault: which, or its name, as ``yumi fault`` lists them.
            choices: ``side``, ``duration`` [s], ``by`` and ``way``, as the options of ``yumi fault``.
        """
        name = fault.value.name if isinstance(fault, Fault) else fault
        inject_fault(self.address, name, {key: str(value) for key, value in choices.items()})
