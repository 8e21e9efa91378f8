"""What the operating system does not give is said in a sentence: shared memory, processes, file descriptors, disks."""

from __future__ import annotations

import errno
import gc
import itertools
import multiprocessing.heap
import os
import resource
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from math import dist
from pathlib import Path
from typing import NoReturn, cast

import httpx
import pytest

from abb_protocols.errors import MissingPrerequisite, NoConnection, SettingsError
from abb_protocols.robot.joints import CYCLE, Joints, Side, home, joints
from abb_runtime.clock import ManualClock, SystemClock
from abb_runtime.process import command_process
from abb_runtime.process.child import PROCESSES, ChildProcess, PipeEnd
from abb_runtime.process.command_process import DRIVER_READY, CommandProcess
from abb_runtime.rws.transport import ExchangeDeadline, HttpTransport
from abb_runtime.rws.web_socket import Listener
from abb_runtime.udp import UdpClient, UdpServer, free_port
from refusals import refused
from virtual_irc5.http_server import HttpServer
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.rws.subscriptions import Upgrade
from yumi.control.goals import write_goal
from yumi.control.loop_events import Event, is_fault
from yumi.control.shared_memory import new_cycle_event, shared_numbers
from yumi.control.shared_state import Snapshot, read_snapshot
from yumi.driver.control_process import ArmBuffers, ControlProcessStop, ControlServer
from yumi.driver.settings import read_controllers
from yumi.driver.wiring import EgmPlan, build_arms
from yumi_evaluation.virtual_time import FULL_SPEED, VirtualArmEnd

LISTENER = Listener("rws", lambda text: None, lambda sentence: None)


def refuse(*_: object, **__: object) -> NoReturn:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def end_at_once(pipe: PipeEnd) -> None:
    """In a child."""


@contextmanager
def no_descriptor_left() -> Iterator[None]:
    """A real limit: every free file descriptor is taken."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with ExitStack() as taken:
        probe = taken.enter_context(socket.socket())
        resource.setrlimit(resource.RLIMIT_NOFILE, (probe.fileno() + 1, hard))
        try:
            with suppress(OSError):  # the last one finds no place
                while True:
                    taken.enter_context(socket.socket())
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_full_shared_memory_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(multiprocessing.heap.os, "ftruncate", refuse)  # type: ignore[attr-defined]
    with refused(MissingPrerequisite, "no_shared_memory", why="No space left on device"):
        shared_numbers(100_000_000)


def test_missing_semaphores_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PROCESSES, "Semaphore", refuse)
    with refused(MissingPrerequisite, "no_shared_memory", why="No space left on device"):
        new_cycle_event()


def test_process_without_a_descriptor_is_refused_in_a_sentence() -> None:
    with no_descriptor_left(), refused(MissingPrerequisite, "no_further_process", process="arm"):
        ChildProcess("arm", end_at_once)


def test_long_value_without_a_descriptor_for_it_is_refused_and_the_next_one_comes() -> None:
    ours, theirs = map(PipeEnd, socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET))
    ours.send(bytes(100_000))
    ours.send("next")
    with no_descriptor_left(), pytest.raises(OSError, match="Too many open files"):
        theirs.receive()
    assert theirs.receive() == "next"
    ours.close()
    theirs.close()


def test_connection_without_a_descriptor_is_refused_in_a_sentence() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        transport = HttpTransport(address)
        request = httpx.Request(
            "GET", f"http://{address}/", extensions={"deadline": ExchangeDeadline(SystemClock().now() + 1.0)}
        )
        with no_descriptor_left(), refused(NoConnection, "no_descriptor_for_connection", address=address):
            transport.handle_request(request)
        transport.close()


def test_web_socket_without_a_descriptor_is_refused_in_a_sentence() -> None:
    with refused(NoConnection, "websocket_not_reached"):
        HttpTransport("127.0.0.1:9").open_socket("/poll/1", "", LISTENER, 1.0)  # its modules are read before the limit
    with no_descriptor_left(), refused(NoConnection, "no_descriptor_for_websocket", address="127.0.0.1:9"):
        HttpTransport("127.0.0.1:9").open_socket("/poll/1", "", LISTENER, 1.0)


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # of a pair of sockets that websockets leaves to the collector
def test_web_socket_without_a_thread_is_refused_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    start = threading.Thread.start

    def no_thread_of_ours(thread: threading.Thread) -> None:
        if threading.current_thread() is threading.main_thread():
            raise RuntimeError("can't start new thread")
        start(thread)

    with HttpServer(lambda _: Upgrade("rws", lambda channel: None), 0) as server:
        monkeypatch.setattr(threading.Thread, "start", no_thread_of_ours)
        with refused(MissingPrerequisite, "no_further_thread", thread="the WebSocket"):
            HttpTransport(server.address).open_socket("/poll/1", "", LISTENER, 1.0)
        monkeypatch.undo()
    gc.collect()  # that pair, which another test would be told of


def test_output_of_a_child_is_read_on_when_the_disk_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    """A child whose output nobody reads stands still; /dev/full is a disk that is always full."""
    lines = 20_000  # more than a pipe holds
    script = f"import sys; [print('line', n) for n in range({lines})]; print('{DRIVER_READY}there'); sys.stdin.read()"
    start = subprocess.Popen
    monkeypatch.setattr(
        command_process.subprocess,
        "Popen",
        lambda arguments, **options: start([sys.executable, "-c", script], **options),
    )
    with CommandProcess("child", "yumi", [], Path("/dev/full")) as child:
        assert child.wait_until_ready(20.0) == "there"


def test_output_of_a_child_that_cannot_be_written_is_refused_in_a_sentence(tmp_path: Path) -> None:
    log = tmp_path / "missing" / "log"
    reason = "No such file or directory"
    with refused(SettingsError, "output_not_writable", program="driver", file=str(log), reason=reason):
        CommandProcess("driver", "yumi", ["up"], log).__enter__()


class MovingRobots:
    """Both virtual arms, and the parent's end of the pipe; the control server's every look at it is one cycle of them.

    Args:
        script: what is done before which cycle.
        cycles: after so many the parent ends the control server.
    """

    def __init__(self, script: Mapping[int, Callable[[], None]], cycles: int) -> None:
        self.clock = ManualClock(100.0)
        self.received: list[object] = []
        ports = {side: free_port() for side in Side}
        plan = EgmPlan("127.0.0.1", "127.0.0.1", ports, 0.08, CYCLE, {side: read_controllers(side) for side in Side})
        self.buffers = {side: ArmBuffers() for side in Side}
        self.arms = build_arms(plan, self.buffers)
        self.robots = {side: VirtualArmEnd(side, ArmModel(supervises_load=False)) for side in Side}
        self._links = {side: UdpClient("127.0.0.1", port) for side, port in ports.items()}
        self._script = script
        self._left = cycles
        self._reader, self._writer = os.pipe()

    def run(self) -> None:
        cycle_done = {side: each.cycle_done for side, each in self.buffers.items()}
        ControlServer(cast("PipeEnd", self), self.arms, cycle_done, self.clock.now).run()

    def activate(self) -> None:
        for arm in self.arms.values():
            arm.loop.manager.switch(("joint_position_controller",), (), arm.loop.state)

    def go(self, goals: Mapping[Side, Joints]) -> None:
        for side, goal in goals.items():
            write_goal(self.buffers[side].goals, 1, goal)

    def snapshot(self, side: Side) -> Snapshot:
        return read_snapshot(self.buffers[side].snapshots)

    def close(self) -> None:
        for arm in self.arms.values():
            cast("UdpServer", arm.socket).close()
        for link in self._links.values():
            link.close()
        os.close(self._reader)
        os.close(self._writer)

    def flush(self) -> bool:
        self._left -= 1
        if self._left == 0:
            os.write(self._writer, b"x")
        self._script.get(self._left, lambda: None)()
        self.clock.advance(CYCLE)
        for side, robot in self.robots.items():
            datagram = robot.cycle(self._links[side].receive())
            if datagram is not None:
                self._links[side].send(datagram)
        return True

    def fileno(self) -> int:
        return self._reader

    def receive(self) -> ControlProcessStop:
        os.read(self._reader, 1)
        return ControlProcessStop()

    def send_soon(self, value: object) -> bool:
        self.received.append(value)
        return True


def test_moving_arms_are_served_while_the_operating_system_gives_nothing_and_the_time_of_day_is_set(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The loop of the control process with its sockets and shared memory, in this process and in virtual time."""
    goals = {side: joints([value + 0.3 for value in home(side)]) for side in Side}
    with ExitStack() as limits:

        def begin() -> None:
            robots.activate()
            robots.go(goals)

        def take_all() -> None:
            assert all(robots.snapshot(side).is_commanded for side in Side)
            limits.enter_context(no_descriptor_left())
            monkeypatch.setattr(threading.Thread, "start", refuse)
            monkeypatch.setattr(PROCESSES, "Semaphore", refuse)
            monkeypatch.setattr(multiprocessing.heap.os, "ftruncate", refuse)  # type: ignore[attr-defined]
            days = itertools.cycle((-86_400.0, 86_400.0))
            monkeypatch.setattr(time, "time", lambda: 1.8e9 + next(days))
            with pytest.raises(OSError, match="Too many open files"):
                os.open("/dev/null", os.O_RDONLY)

        robots = MovingRobots({800: begin, 750: take_all}, 900)
        try:
            for robot in robots.robots.values():
                robot.start(FULL_SPEED)
            robots.run()
            limits.close()
            snapshots = {side: robots.snapshot(side) for side in Side}
        finally:
            limits.close()
            monkeypatch.undo()
            robots.close()
    assert not [event for event in robots.received if is_fault(cast("Event", event))]
    for side, goal in goals.items():
        assert snapshots[side].session == 1
        assert (snapshots[side].cycles >= 850, snapshots[side].wire.missed) == (True, 0)
        assert dist(snapshots[side].position, goal) < 0.01


NO_ROOM_FOR_A_STACK = """
import resource
from pathlib import Path
from threading import Event
from abb_protocols.errors import MissingPrerequisite
from abb_runtime.process.supervision import SupervisedThread

used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 4_000_000, resource.RLIM_INFINITY))
try:
    SupervisedThread("watchdog", lambda: None, Event()).start()
except MissingPrerequisite as error:
    print(error.said.code, error.said.values["thread"], error.said.values["reason"])
"""


def test_thread_that_finds_no_memory_is_refused_in_a_sentence() -> None:
    """A real limit, in a process of its own."""
    done = subprocess.run([sys.executable, "-c", NO_ROOM_FOR_A_STACK], capture_output=True, text=True, check=True)
    assert done.stdout == "no_further_thread watchdog can't start new thread\n"
