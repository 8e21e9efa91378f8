"""The virtual controller as a process: the world in the main thread, the HTTP server in another, under one lock.

What takes longer than a cycle (parsing, linking and compiling RAPID) is done in a third, without the lock: the result
is published at once.

RAPID programs get real TCP and UDP sockets that never wait. Unless the user allows another address, nothing leaves this
machine: whatever address of its cell a program binds or connects to, it means this machine, as the UDPUC devices of
``SIO.cfg`` do (docs/explanation/decisions/0036).
"""

from __future__ import annotations

import errno
import gc
import logging
import os
import socket
import time
import weakref
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from functools import partial
from queue import Queue
from threading import Event as Flag
from threading import Lock, Thread
from typing import TypeVar

from yumi.clock import Clock, SystemClock
from yumi.egm.udp import UdpClient, is_loopback, resolve
from yumi.errors import NoConnection
from yumi.process.realtime import prefer_process, prefer_thread, release_process, short_switch_interval
from yumi.rapid.parser import LONGEST_MODULE
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import CYCLE, Side
from yumi.rws.types import GRANTS, EventType, Grant
from yumi.virtual.controller.egm import Outgoing
from yumi.virtual.controller.system import System
from yumi.virtual.faults import FAULTS_PATH
from yumi.virtual.mechanics.gripper import CupObject, Workpiece
from yumi.virtual.mechanics.path import PREFETCH
from yumi.virtual.rws.http import HttpReply, HttpRequest
from yumi.virtual.rws.http_server import HttpServer, self_signed_context
from yumi.virtual.rws.operations import Failure
from yumi.virtual.rws.service import RwsService
from yumi.virtual.rws.subscriptions import Channel, Upgrade
from yumi.virtual.rws.version_2 import ROBOTWARE_7, RwsService2
from yumi.virtual.world import FaultInjection, World, WorldSettings

log = logging.getLogger(__name__)
T = TypeVar("T")


def world_settings(
    *,
    robot_name: str,
    egm_host: str,
    egm_ports: Mapping[Side, int],
    objects: Mapping[Side, float | None],
    grippers: Mapping[Side, GripperModules],
    leaks: Mapping[Side, float | None],
    are_calibrated: bool = False,
    system: System | None = None,
) -> WorldSettings:
    """A virtual robot whose clock shows the time of day.

    Args:
        robot_name: name of the controller's system.
        egm_host: where the arms send their datagrams.
        egm_ports: UDP port per arm.
        objects: width of what lies between each arm's fingers [m]; None for nothing.
        grippers: modules of each gripper.
        leaks: of the object under each gripper's cups, 0 (tight) to 1 (open); None for no object.
        are_calibrated: whether the grippers start calibrated.
        system: programs and system parameters; ours when it is None.
    """
    workpieces = {side: Workpiece(width) for side, width in objects.items() if width is not None}
    return WorldSettings(
        robot_name=robot_name,
        egm_host=resolve(egm_host),  # once, since looking a name up takes longer than a cycle
        egm_ports=egm_ports,
        workpieces=workpieces,
        gripper_modules=grippers,
        cup_objects={side: CupObject(leak) for side, leak in leaks.items() if leak is not None},
        grippers_are_calibrated=are_calibrated,
        start_time=time.time(),
        system=system,
    )


_LARGEST_UPLOAD = 16 * 1024 * 1024  # bytes; RAPID modules and cfg files have thousands
_LARGEST_FORM = 256 * 1024  # bytes
_LARGEST_TEXT = 3 * LONGEST_MODULE + 1024  # bytes of a form with the text of a module, of which a character may take 3
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
        link: Callable[[str, int], UdpClient] = UdpClient,
        rapid_sockets: str | None = None,
        is_robotware_7: bool = False,
    ) -> None:
        self._speed = speed
        self._is_started = is_started
        self._clock = SystemClock()
        self._lock = Lock()
        self.world = World(replace(settings, robotware=ROBOTWARE_7) if is_robotware_7 else settings)
        self.world.controller.devices.network = ProgramNetwork(rapid_sockets or host)
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
        self._no_destination: dict[Side, str] = {}
        for side in self.world.arms:
            self._follow_device(side)

    def run(self, is_over: Flag, on_ready: Callable[[int], None]) -> None:
        """Serve until ``is_over``; ``on_ready`` gets the HTTP port.

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
                        self.world.controller.start_rapid()
                on_ready(server.port)
                pace = Pace(self._clock, self._speed)
                while not is_over.is_set():
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

    def _cycle(self, inboxes: Mapping[Side, Sequence[bytes]]) -> list[Outgoing]:
        """One cycle; a fault of this program stops RAPID, and the controller goes on."""
        try:
            departures = self.world.exchange(inboxes)
            self._service.advance(self._clock.now())
        except Exception as error:
            controller, sentence = self.world.controller, f"{type(error).__name__}: {error}"
            if sentence == self._last_fault and not controller.execution.is_running:  # in every cycle
                return []
            self._last_fault = sentence
            log.exception("A fault of the virtual controller stops RAPID.")
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
            if self._no_destination.get(side) != str(error):
                self._no_destination[side] = str(error)
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

        def attach_locked(channel: Channel) -> None:
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
        except Failure:  # the answer says what is wrong
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
            operation, call = self._service.find(request)
            if operation.prepare is None:
                return None
            with self._lock:
                work = operation.prepare(self.world.controller, call)
        except Failure:  # the answer says what is wrong
            return None
        return None if work is None else self._background.submit(partial(_try_to_prepare, work))


TIME_TO_ANSWER = 0.3 * CYCLE
"""Shortest time from a datagram to the next cycle, for its answer to arrive [s]."""

LONGEST_LAG = 5 * CYCLE
"""A machine that has fallen behind by more skips cycles [s]."""


class Pace:
    """When the cycles of a robot that keeps real time begin.

    A machine that has fallen behind catches up, but not at once: the answer to one datagram has to be there for the
    next cycle. Answers that come two at a time wait in the robot's queue, which it takes them from one a cycle, and
    every command after them is a cycle late until the session ends (reference/egm.md §4.3). On a machine whose cycles
    take longer than what is left beside that, the robot is slower than real time.

    Args:
        clock: the machine's.
        speed: how many times faster than real time the robot is; whatever this is, one cycle is 4.032 ms to it.
    """

    def __init__(self, clock: Clock, speed: float = 1.0) -> None:
        self._clock = clock
        self._speed = speed
        self._due = clock.now()

    def wait(self) -> None:
        """From the end of a cycle, when its datagrams have left, until the next one begins."""
        self._due += CYCLE / self._speed
        self._clock.wait(max(self._due - self._clock.now(), TIME_TO_ANSWER / self._speed))
        if self._clock.now() - self._due > LONGEST_LAG:
            self._due = self._clock.now()


class Background:
    """Does long work in a thread of its own, one piece after another, while the robot goes on."""

    def __init__(self, name: str = "background") -> None:
        self._work: Queue[Callable[[], None] | None] = Queue()
        # A daemon, since parsing a long module takes seconds, and the process must end before.
        self._thread = Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Do nothing more; what is under way goes on."""
        self._work.put(None)

    def submit(self, work: Callable[[], T]) -> Future[T]:
        """What ``work`` will have returned or raised."""
        result: Future[T] = Future()
        self._work.put(partial(_run_for, work, result))
        return result

    def _run(self) -> None:
        while (work := self._work.get()) is not None:
            work()
            del work  # a thread that waits holds nothing: what it held would be freed after the libraries it came from


def _run_for(work: Callable[[], T], result: Future[T]) -> None:
    if not result.set_running_or_notify_cancel():  # the client is gone
        return
    try:
        result.set_result(work())
    except Exception as error:  # raised where the result is awaited
        result.set_exception(error)
    finally:
        del work, result  # the error's traceback leads here, and from here a result would lead back to it


def _try_to_prepare(work: Callable[[], object]) -> None:
    """Do the preparation of a call; what fails in it fails in the handler again, which answers it."""
    try:
        work()
    except Exception as error:
        log.info("A call could not be prepared (%s: %s); its answer says why.", type(error).__name__, error)


LOOPBACK = "127.0.0.1"

MOST_SOCKETS = 32
"""Sockets that are open at a time (RAPID reference manual, SocketCreate)."""

_PEEKED = 65536  # bytes


class ProgramNetwork:
    """Makes the sockets of all tasks.

    Args:
        address: this machine's, which programs may use; 127.0.0.1 keeps them on this machine, 0.0.0.0 allows all.

    Attributes:
        count: how many sockets are open.
    """

    def __init__(self, address: str = LOOPBACK) -> None:
        self.address = address
        self.count = 0

    @property
    def is_local(self) -> bool:
        """Whether nothing leaves this machine."""
        return is_loopback(self.address)

    def tcp(self) -> ProgramSocket:
        """A TCP socket."""
        return self._made(socket.SOCK_STREAM)

    def udp(self) -> ProgramSocket:
        """A UDP socket."""
        return self._made(socket.SOCK_DGRAM)

    def _made(self, kind: socket.SocketKind) -> ProgramSocket:
        self.check_room()
        return ProgramSocket(self, socket.socket(socket.AF_INET, kind))

    def check_room(self) -> None:
        """Raise OSError where there are too many sockets."""
        if self.count >= MOST_SOCKETS:
            raise OSError(errno.ENOBUFS, f"{MOST_SOCKETS} sockets are open already")

    def remote(self, address: str, port: int) -> tuple[str, int]:
        """Where a program's address leads to."""
        return (self.address if self.is_local else address), port


class ProgramSocket:
    """A socket of this machine that never waits; see :class:`yumi.rapid.devices.Socket`."""

    def __init__(self, network: ProgramNetwork, made: socket.socket) -> None:
        self._network = network
        self._socket = made
        network.count += 1
        # Also closed when nothing refers to it any more: the program pointer went to main, a routine ended.
        self._close = weakref.finalize(self, _close_and_count, network, made)
        made.setblocking(False)
        if made.type == socket.SOCK_STREAM:
            made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def bind(self, address: str, port: int) -> None:
        """Take a port of the address this controller may use."""
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, self._socket.type == socket.SOCK_STREAM)
        self._socket.bind((self._network.address, port))

    def listen(self) -> None:
        """Let others connect."""
        self._socket.listen()

    def accept(self) -> tuple[ProgramSocket, str] | None:
        """The next connection with the other side's address."""
        self._network.check_room()
        try:
            connection, (address, _) = self._socket.accept()
        except BlockingIOError:
            return None
        return ProgramSocket(self._network, connection), address

    def connect(self, address: str, port: int) -> None:
        """Begin to connect."""
        failure = self._socket.connect_ex(self._network.remote(address, port))
        if failure not in (0, errno.EINPROGRESS):
            raise OSError(failure, os.strerror(failure))

    def is_connected(self) -> bool:
        """Whether the connection is there."""
        failure = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if failure:
            raise OSError(failure, os.strerror(failure))
        try:
            self._socket.getpeername()
        except OSError as error:
            if error.errno == errno.ENOTCONN:
                return False
            raise
        return True

    def send(self, data: bytes) -> int:
        """Send what the other side takes."""
        try:
            return self._socket.send(data, socket.MSG_NOSIGNAL)
        except BlockingIOError:
            return 0

    def receive(self, size: int) -> bytes | None:
        """What is there."""
        try:
            return self._socket.recv(size)
        except BlockingIOError:
            return None

    def send_to(self, data: bytes, address: str, port: int) -> None:
        """Send a datagram."""
        self._socket.sendto(data, self._network.remote(address, port))

    def receive_from(self, size: int) -> tuple[bytes, str, int] | None:
        """The next datagram and its sender."""
        try:
            data, (address, port) = self._socket.recvfrom(size)
        except BlockingIOError:
            return None
        return data, address, port

    def waiting(self) -> int:
        """How much can be received at once."""
        try:
            found = self._socket.recv(_PEEKED, socket.MSG_PEEK)
        except BlockingIOError:
            return 0
        if not found and self._socket.type == socket.SOCK_STREAM:
            raise ConnectionResetError(errno.ECONNRESET, "the other side has closed the connection")
        return len(found)

    def close(self) -> None:
        """Close it; nothing happens where it is closed."""
        self._close()


def _close_and_count(network: ProgramNetwork, made: socket.socket) -> None:
    network.count -= 1
    made.close()
