"""What the operating system does not give is said in a sentence: shared memory, processes, file descriptors, disks."""

from __future__ import annotations

import errno
import gc
import multiprocessing.heap
import os
import resource
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import NoReturn

import httpx
import pytest

from yumi.clock import SystemClock
from yumi.control.shared_state import new_event, shared_numbers
from yumi.errors import MissingPrerequisite, NoConnection, SettingsError
from yumi.process import supervision as command_module
from yumi.process.pipe import PROCESSES, ChildProcess, PipeEnd
from yumi.process.supervision import DRIVER_READY, Command
from yumi.rws.transport import HttpTransport, Listener, WebSocket, until
from yumi.virtual.rws.http_server import HttpServer, Upgrade

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
    with pytest.raises(MissingPrerequisite, match=r"no shared memory \(No space left on device\); see that /dev/shm"):
        shared_numbers(100_000_000)


def test_missing_semaphores_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PROCESSES, "Semaphore", refuse)
    with pytest.raises(MissingPrerequisite, match=r"no shared memory \(No space left on device\)"):
        new_event()


def test_process_without_a_descriptor_is_refused_in_a_sentence() -> None:
    with no_descriptor_left(), pytest.raises(MissingPrerequisite, match="does not let the process arm start"):
        ChildProcess("arm", end_at_once)


def test_connection_without_a_descriptor_is_refused_in_a_sentence() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        transport = HttpTransport(address)
        request = httpx.Request("GET", f"http://{address}/", extensions=until(SystemClock().now() + 1.0, 1.0))
        with no_descriptor_left(), pytest.raises(NoConnection) as refused:
            transport.handle_request(request)
        transport.close()
    assert (
        str(refused.value) == f"No file descriptor is left for a connection to {address}; raise the limit (ulimit -n)."
    )


def test_web_socket_without_a_descriptor_is_refused_in_a_sentence() -> None:
    with pytest.raises(NoConnection, match="cannot be reached"):
        WebSocket("127.0.0.1:9", "/poll/1", "", LISTENER, 1.0)  # its modules are read before the limit
    with no_descriptor_left(), pytest.raises(NoConnection) as refused:
        WebSocket("127.0.0.1:9", "/poll/1", "", LISTENER, 1.0)
    sentence = "No file descriptor is left for the WebSocket of 127.0.0.1:9; raise the limit (ulimit -n)."
    assert str(refused.value) == sentence


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # of a pair of sockets that websockets leaves to the collector
def test_web_socket_without_a_thread_is_refused_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    start = threading.Thread.start

    def no_thread_of_ours(thread: threading.Thread) -> None:
        if threading.current_thread() is threading.main_thread():
            raise RuntimeError("can't start new thread")
        start(thread)

    with HttpServer(lambda _: Upgrade("rws", lambda channel: None), 0) as server:
        monkeypatch.setattr(threading.Thread, "start", no_thread_of_ours)
        with pytest.raises(MissingPrerequisite, match="permits no further thread for the WebSocket"):
            WebSocket(server.address, "/poll/1", "", LISTENER, 1.0)
        monkeypatch.undo()
        gc.collect()


def test_output_of_a_child_is_read_on_when_the_disk_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    """A child whose output nobody reads stands still; /dev/full is a disk that is always full."""
    lines = 20_000  # more than a pipe holds
    script = f"import sys; [print('line', n) for n in range({lines})]; print('{DRIVER_READY}there'); sys.stdin.read()"
    start = subprocess.Popen
    monkeypatch.setattr(
        command_module.subprocess,
        "Popen",
        lambda arguments, **options: start([sys.executable, "-c", script], **options),
    )
    with Command("child", [], Path("/dev/full")) as child:
        assert child.wait_until_ready(20.0) == "there"


def test_output_of_a_child_that_cannot_be_written_is_refused_in_a_sentence(tmp_path: Path) -> None:
    log = tmp_path / "missing" / "log"
    with pytest.raises(SettingsError) as refused:
        Command("driver", ["up"], log).__enter__()
    assert str(refused.value) == f"The output of the driver cannot go to {log}: No such file or directory."


NO_ROOM_FOR_A_STACK = """
import resource
from pathlib import Path
from threading import Event
from yumi.errors import MissingPrerequisite
from yumi.process.supervision import SupervisedThread

used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 4_000_000, resource.RLIM_INFINITY))
try:
    SupervisedThread("watchdog", lambda: None, Event()).start()
except MissingPrerequisite as error:
    print(error)
"""


def test_thread_that_finds_no_memory_is_refused_in_a_sentence() -> None:
    """A real limit, in a process of its own."""
    done = subprocess.run([sys.executable, "-c", NO_ROOM_FOR_A_STACK], capture_output=True, text=True, check=True)
    assert done.stdout == (
        "The operating system permits no further thread for watchdog (can't start new thread); raise the limits of "
        "processes and memory (ulimit -u, ulimit -v) or end other programs.\n"
    )
