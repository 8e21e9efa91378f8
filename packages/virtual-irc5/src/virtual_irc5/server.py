"""The virtual controller in real time, on sockets: :class:`VirtualController` is its process.

The world is in the main thread, the HTTP server with its WebSockets in another, under one lock. What takes longer than
a cycle (parsing, linking and compiling RAPID) is done in a third, without the lock: the result is published at once.
"""

from __future__ import annotations

import gc
import logging
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from functools import partial
from threading import Event as Flag
from threading import Lock

from abb_protocols.errors import NoConnection
from abb_protocols.robot.joints import CYCLE, Side
from abb_protocols.rws.values import GRANTS, EventType, Grant
from abb_runtime.clock import SystemClock
from abb_runtime.faults import FAULTS_PATH
from abb_runtime.process.certificate import self_signed_context
from abb_runtime.process.realtime import prefer_process, prefer_thread, release_process, short_switch_interval
from abb_runtime.udp import UdpClient
from virtual_irc5.background import Background
from virtual_irc5.fault_injection import FaultInjection
from virtual_irc5.http_server import HttpServer
from virtual_irc5.mechanics.egm_network import OutgoingDatagram
from virtual_irc5.mechanics.path import PREFETCH
from virtual_irc5.pace import Pace
from virtual_irc5.program_sockets import ProgramNetwork
from virtual_irc5.rapid.parser import LONGEST_MODULE
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.rws_call import CallFailure
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.rws.subscriptions import SubscriptionChannel, Upgrade
from virtual_irc5.rws.version_2 import ROBOTWARE_7, RwsService2
from virtual_irc5.world import World, WorldSettings

_log = logging.getLogger(__name__)

_LARGEST_UPLOAD = 16 * 1024 * 1024  # bytes; RAPID modules and cfg files have thousands
_LARGEST_FORM = 256 * 1024  # bytes
_LARGEST_TEXT = 3 * LONGEST_MODULE + 1024  # bytes of a form with the text of a module, of which a character may take 3
LONGEST_BEGINNING = 2.0
"""How long programs may execute at the beginning before the controller is ready all the same; robot time [s]."""

_RARELY = 1000  # young collections for each full one; 10 by default


class VirtualController:
    """A virtual IRC5 on the network: RWS over HTTP or HTTPS, EGM over UDP, advancing in real time.

    Args:
        settings: what the virtual robot is like.
        rws_port: port of the HTTP server, 0 for any.
        user: user name that may log in.
        password: its password.
        granted: what the user may do.
        host: address to listen on.
        speed: how many times faster than real time it runs.
        is_started: whether the motors are on and RAPID runs from the beginning.
        runs_once: whether the programs then end with main, instead of beginning it again.
        show: called with a task and each line that its program writes to the FlexPendant.
        link: makes the sockets of the arms, to an address and port.
        rapid_sockets: the address RAPID programs may use, ``host`` without it (:class:`ProgramNetwork`).
        is_robotware_7: whether Robot Web Services are those of RobotWare 7: 2.0, over HTTPS.
    """

    def __init__(
        self,
        settings: WorldSettings,
        *,
        rws_port: int,
        user: str,
        password: str,
        granted: Collection[Grant] = GRANTS,
        host: str,
        speed: float = 1.0,
        is_started: bool = False,
        runs_once: bool = False,
        show: Callable[[str, str], None] | None = None,
        link: Callable[[str, int], UdpClient] = UdpClient,
        rapid_sockets: str | None = None,
        is_robotware_7: bool = False,
    ) -> None:
        self._speed = speed
        self._is_started, self._runs_once = is_started, runs_once
        self._clock = SystemClock()
        self._lock = Lock()
        self.world = World(replace(settings, robotware=ROBOTWARE_7) if is_robotware_7 else settings)
        self.world.controller.devices.network = ProgramNetwork(rapid_sockets or host)
        if show is not None:
            for installed in self.world.controller.execution.installed.values():
                installed.host.show = show
        self._server = HttpServer(
            self._handle,
            host=host,
            port=rws_port,
            body_limit=self._body_limit,
            prepare=self._prepare,
            tls=self_signed_context(host) if is_robotware_7 else None,
        )
        service = RwsService2 if is_robotware_7 else RwsService
        self._service = service(
            self.world.controller, user=user, password=password, granted=granted, hang_up=self._server.hang_up
        )
        self._faults = FaultInjection(self.world, self._service)
        self._background, self._planning = Background(), Background("planning")
        self._last_fault = ""
        for task in self.world.controller.tasks.values():
            task.clock = time.thread_time  # without the time of other threads and processes
            task.background, task.planning = self._background.submit, self._planning.submit
        for arm in self.world.arms.values():  # planning takes its time however fast the robot is
            arm.path.prefetch = PREFETCH * max(speed, 1.0)
        self._link_to = link
        self._destinations: dict[Side, tuple[str, int]] = {}
        self._links: dict[Side, UdpClient] = {}
        self._foreign_links: dict[Side, UdpClient] = {}
        self._no_destination: dict[Side, tuple[object, ...]] = {}
        for side in self.world.arms:
            self._follow_device(side)

    def run(self, is_over: Flag, on_ready: Callable[[int], None]) -> None:
        """Serve until ``is_over``.

        ``on_ready`` gets the HTTP port once every task that runs has come to an instruction that waits: what a program
        does first, such as listening on a socket, is done by then. A task that executes for longer than
        :data:`LONGEST_BEGINNING` without waiting is not waited for.

        Raises:
            NoConnection: the port is taken.
            Refused: RAPID is to be started and cannot be.
        """
        prefer_process()
        gc.set_threshold(700, 10, _RARELY)  # a full collection takes longer than a cycle once programs are long
        self._background.start()
        self._planning.start()
        try:
            with short_switch_interval(), self._server as server:
                prefer_thread()  # the robot's; those of the server and of the background have begun and stay ordinary
                if self._is_started:
                    with self._lock:
                        self.world.controller.set_motors(True)
                        cycle = "once" if self._runs_once else ""
                        self.world.controller.start_rapid(cycle, stop_at_breakpoints=True)  # as RobotStudio starts it
                until_ready = round(LONGEST_BEGINNING / CYCLE)  # cycles
                pace = Pace(self._clock, self._speed)
                while not is_over.is_set():
                    if until_ready:
                        with self._lock:
                            has_begun = all(task.is_waiting for task in self.world.controller.tasks.values())
                        until_ready = 0 if has_begun else until_ready - 1
                        if not until_ready:
                            on_ready(server.port)
                    inboxes = {side: link.receive() for side, link in self._links.items()}
                    with self._lock:
                        departures = self._cycle(inboxes)
                    for side, datagram, is_foreign in departures:
                        if not self._has_destination(side):
                            continue
                        (self._foreign_links if is_foreign else self._links)[side].send(datagram)
                    pace.wait()
        finally:
            self._background.stop()
            self._planning.stop()
            release_process()
            for link in (*self._links.values(), *self._foreign_links.values()):
                link.close()

    def _cycle(self, inboxes: Mapping[Side, Sequence[bytes]]) -> list[OutgoingDatagram]:
        """One cycle; a fault of this program stops RAPID, and the controller goes on."""
        try:
            departures = self.world.exchange(inboxes)
            self._service.advance(self._clock.now())
        except Exception as error:
            controller, sentence = self.world.controller, f"{type(error).__name__}: {error}"
            if sentence == self._last_fault and not controller.execution.is_running:  # in every cycle
                return []
            self._last_fault = sentence
            _log.exception("A fault of the virtual controller stops RAPID.")
            controller.events.append(20999, "System error", sentence, EventType.ERROR)
            with suppress(Exception):  # what is broken may be what stops
                controller.execution.stop("RAPID has been stopped by a fault of the virtual controller.")
            return []
        return departures

    def _has_destination(self, side: Side) -> bool:
        """Follow an arm's device; why nothing can be sent is logged once."""
        try:
            self._follow_device(side)
        except (NoConnection, OSError, ValueError, OverflowError) as error:
            if self._no_destination.get(side) != error.args:
                self._no_destination[side] = error.args
                with self._lock:
                    self.world.controller.events.append(
                        41830, "Not possible to open the UdpUc device", str(error), EventType.ERROR
                    )
            return False
        self._no_destination.pop(side, None)
        return True

    def _follow_device(self, side: Side) -> None:
        """Send an arm's datagrams where its UDPUC device says: another one may be chosen, or act after a restart.

        Raises:
            NoConnection: the device names no address or port, or there is no way to it.
        """
        destination = self.world.egm_destination(side)
        if destination == self._destinations.get(side):
            return
        for links in (self._links, self._foreign_links):
            link = self._link_to(*destination)
            if side in links:
                links[side].close()
            links[side] = link
        self._destinations[side] = destination

    def _handle(self, request: HttpRequest) -> HttpReply | Upgrade | None:
        with self._lock:
            if request.target.startswith(FAULTS_PATH):
                return self._faults.answer(request)
            answer = self._service.handle(request, self._clock.now())
        if not isinstance(answer, Upgrade):
            return answer
        attach = answer.attach

        def attach_locked(channel: SubscriptionChannel) -> None:
            with self._lock:
                attach(channel)

        return replace(answer, attach=attach_locked)

    def _body_limit(self, request: HttpRequest) -> int:
        """The body of a request without a session or a login is not read."""
        if request.target.startswith(FAULTS_PATH):
            return _LARGEST_FORM
        with self._lock:
            if not self._service.may_enter(request, self._clock.now()):
                return 0
        if request.method == "PUT":
            return _LARGEST_UPLOAD
        try:
            has_module = self._service.find(request)[0].prepare is not None
        except CallFailure:  # the answer says what is wrong
            return _LARGEST_FORM
        return _LARGEST_TEXT if has_module else _LARGEST_FORM

    def _prepare(self, request: HttpRequest) -> Future[object] | None:
        """Begin what is too long for the world to stand still: parsing a module or a long value, compiling.

        The answer then finds it done, and raises its errors again.
        """
        if request.method != "POST":
            return None
        with self._lock:  # first: nothing of a request is kept that belongs to no session
            if not self._service.may_enter(request, self._clock.now()):
                return None
        try:
            route, call = self._service.find(request)
            if route.prepare is None:
                return None
            with self._lock:
                work = route.prepare(self.world.controller, call)
        except CallFailure:  # the answer says what is wrong
            return None
        return None if work is None else self._background.submit(partial(_try_to_prepare, work))


def _try_to_prepare(work: Callable[[], object]) -> None:
    """Do the preparation of a call; what fails in it fails in the handler again, which answers it."""
    try:
        work()
    except Exception as error:
        _log.info("A call could not be prepared (%s: %s); its answer says why.", type(error).__name__, error)
