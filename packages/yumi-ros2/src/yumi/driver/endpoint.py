"""The local endpoint of a running driver: requests (attach, subscribe), failures, its socket, the client's end of it.

A driver listens on a Unix socket that only its own user may open. A client writes one JSON document a line: a request
with an ``id`` of its choice and a ``method``, see :mod:`yumi.driver.commands`. It gets documents of the same ``id``
back: ``step`` and ``motions`` while the request is carried out, then ``result`` or ``error``. After ``subscribe`` it
gets the state at the rate it asked for, with the events since the last one. A connection without a request is closed
after :data:`FIRST_REQUEST`. Everything is in SI units; joints are in chain order.
"""

from __future__ import annotations

import os
import re
import socket
import stat
from collections.abc import Callable, Iterator
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec

from abb_protocols import errors
from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.errors import ProtocolError, RobotNotReady, YumiError
from abb_runtime.process.single_instance import lock_folder
from yumi.driver.command import Command, EndpointRequest
from yumi.driver.reports import DriverState, EventReport, MotionReport, Said

MAX_REQUEST = 1 << 20
"""A request is no longer than this [bytes]: a plan of some minutes."""

FIRST_REQUEST = 5.0
"""A client sends its first request within this time [s], ``attach`` where it wants nothing yet, or is disconnected."""

ENDPOINT_ANSWER_TIME = 10.0
"""What needs no motion is answered within this time [s]."""


# ---- what is said beside commands


class Attach(EndpointRequest, frozen=True, tag="attach"):
    """Keep the connection although nothing is asked for yet; the only request without an answer.

    ``is_page``: the client is a page that a person operates, whose motions come before those of programs.
    """

    is_page: bool = False


class Subscribe(EndpointRequest, frozen=True, tag="subscribe"):
    """The state again and again, ``rate`` times a second."""

    rate: Annotated[float, msgspec.Meta(ge=0.1, le=60.0)] = 30.0


class EndpointFailure(msgspec.Struct, frozen=True):
    """Why a request was refused or failed: the class of the error, what it says, and the stop to confirm."""

    kind: str
    said: Said
    stop: str = ""


class EndpointAnswer(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One line of a driver."""

    id: int = 0
    result: msgspec.Raw = msgspec.Raw()
    error: EndpointFailure | None = None
    step: str = ""
    motions: dict[str, MotionReport] = {}
    state: msgspec.Raw = msgspec.Raw()
    events: tuple[EventReport, ...] = ()


# ---- where it is

_SUFFIX = ".sock"
_NO_FILE_NAME = re.compile(r"[^\w.:@-]")
_LONGEST_PATH = 107  # of a Unix socket [bytes]


def endpoint_folder() -> Path:
    """The folder of the sockets, which only this user may enter.

    Raises:
        RobotNotReady: it cannot be made, or others may enter it.
    """
    folder = lock_folder() / "yumi"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise RobotNotReady(message("no_endpoint_folder", folder=str(folder), why=error.strerror)) from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise RobotNotReady(message("endpoint_folder_open_to_others", folder=str(folder)))
    return folder


def endpoint_path(robot: str, namespace: str = "") -> Path:
    """The socket of the driver of ``robot`` (``host:port``), in a ROS namespace if it has one.

    Raises:
        RobotNotReady: there is no folder for it, or its path is too long.
    """
    name = f"{namespace.strip('/')}@{robot}" if namespace.strip("/") else robot
    path = endpoint_folder() / f"{_NO_FILE_NAME.sub('_', name)}{_SUFFIX}"
    if len(os.fsencode(path)) > _LONGEST_PATH:
        raise RobotNotReady(message("endpoint_path_too_long", path=str(path)))
    return path


def find_driver(robot: str = "") -> Path:
    """The socket of the one driver that runs, or of the one named by its robot's address or its namespace.

    Raises:
        RobotNotReady: there is none, or more than one; the message says what to do.
    """
    drivers = {path.name.removesuffix(_SUFFIX): path for path in sorted(endpoint_folder().glob(f"*{_SUFFIX}"))}
    if len(drivers) > 1:
        drivers = {name: path for name, path in drivers.items() if _is_alive(path)}
    if not drivers:
        raise RobotNotReady(message("no_driver_runs"))
    names = {name: {name, *name.split("@"), name.rpartition("@")[2].partition(":")[0]} for name in drivers}
    chosen = [path for name, path in drivers.items() if not robot or robot.strip("/") in names[name]]
    if len(chosen) == 1:
        return chosen[0]
    if not chosen:
        raise RobotNotReady(message("no_driver_of_robot", robot=robot, drivers=tuple(drivers)))
    raise RobotNotReady(message("several_drivers_run", drivers=tuple(drivers)))


def _is_alive(path: Path) -> bool:
    try:
        _connect(path).close()
    except OSError:
        return False
    return True


def _connect(path: Path) -> socket.socket:
    """Raises OSError where no driver listens any more; what a driver that was killed has left is removed."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        connection.settimeout(ENDPOINT_ANSWER_TIME)
        connection.connect(os.fspath(path))
    except BaseException as error:
        connection.close()
        if isinstance(error, ConnectionRefusedError):
            path.unlink(missing_ok=True)
        raise
    return connection


def connect_driver(path: Path) -> socket.socket:
    """A connection to the driver behind a socket.

    Raises:
        RobotNotReady: it has ended, or takes no further client.
    """
    try:
        return _connect(path)
    except (ConnectionRefusedError, FileNotFoundError) as error:
        raise RobotNotReady(message("no_driver_runs")) from error
    except OSError as error:
        raise RobotNotReady(message("driver_does_not_answer", path=str(path), why=said_by(error))) from error


# ---- the client

_R = TypeVar("_R")


class EndpointClient:
    """A connection to a running driver; one request at a time, from one thread.

    Args:
        path: of its socket, see :func:`find_driver`.

    Raises:
        RobotNotReady: the driver has ended, or takes no further client.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._socket = connect_driver(path)
        self._received = b""
        self._number = 0
        self._send(Attach(), ENDPOINT_ANSWER_TIME)

    def __enter__(self) -> EndpointClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect; a motion that was asked for is stopped."""
        self._socket.close()

    def call(
        self,
        command: Command[_R],
        on_step: Callable[[str], None] = lambda step: None,
        on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None,
        timeout: float | None = ENDPOINT_ANSWER_TIME,
    ) -> _R:
        """Send a command and wait for its result.

        Args:
            command: what is asked for.
            on_step: given each step of what is done.
            on_motion: given how far motions are.
            timeout: longest wait for the next line of the driver [s]; None waits for as long as it runs.

        Raises:
            YumiError: the driver refuses, or has failed to do it: the class and the sentence are the driver's.
        """
        self._number += 1
        self._send(msgspec.structs.replace(command, id=self._number), timeout)
        while True:
            answer = self._receive()
            if answer.id not in (0, self._number):
                continue
            if answer.error is not None:
                raise error_of(answer.error)
            if answer.step:
                on_step(answer.step)
            if answer.motions:
                on_motion(answer.motions)
            if answer.result:
                return self._decode(answer.result, command.result_type())

    def watch(self, rate: float) -> Iterator[DriverState]:
        """The state ``rate`` times a second, with the events since the one before; raises as :meth:`call`."""
        self._number += 1
        self._send(Subscribe(id=self._number, rate=rate), ENDPOINT_ANSWER_TIME + 1.0 / rate)
        while True:
            answer = self._receive()
            if answer.error is not None:
                raise error_of(answer.error)
            if answer.state:
                state = self._decode(answer.state, DriverState)
                yield msgspec.structs.replace(state, events=answer.events)

    def _send(self, request: EndpointRequest, timeout: float | None) -> None:
        for name in request.__struct_fields__:
            value = getattr(request, name)
            if isinstance(value, float) and not isfinite(value):  # JSON has none: it would be taken for left out
                raise errors.CommandRefused(message("value_not_finite", name=name, value=value))
        self._socket.settimeout(timeout)
        try:
            self._socket.sendall(msgspec.json.encode(request) + b"\n")
        except (BrokenPipeError, ConnectionResetError):
            return  # why it closed the connection may be there to be read
        except OSError as error:
            raise self._lost(said_by(error)) from error

    def _receive(self) -> EndpointAnswer:
        while b"\n" not in self._received:
            try:
                data = self._socket.recv(1 << 16)
            except OSError as error:
                raise self._lost(said_by(error)) from error
            if not data:
                raise self._lost(message("driver_closed_connection"))
            self._received += data
        line, _, self._received = self._received.partition(b"\n")
        return self._decode(line, EndpointAnswer)

    def _decode(self, data: bytes | msgspec.Raw, kind: type[_R]) -> _R:
        try:
            return msgspec.json.decode(data, type=kind)
        except msgspec.DecodeError as error:
            raise ProtocolError(message("driver_of_other_version", why=said_by(error))) from error

    def _lost(self, why: Message) -> RobotNotReady:
        return RobotNotReady(message("driver_connection_lost", name=self.path.name, why=why))


def error_of(failure: EndpointFailure) -> YumiError:
    """The exception that a driver's failure stands for."""
    kind: Any = getattr(errors, failure.kind, RobotNotReady)
    if issubclass(kind, errors.RobotNotReady | errors.GoalNotReached):
        error: YumiError = kind(failure.said.message, failure.stop)
        return error
    return (
        errors.CommandRefused(failure.said.message)
        if issubclass(kind, errors.CommandRefused)
        else YumiError(failure.said.message)
    )


def failure_of(error: YumiError) -> EndpointFailure:
    """What a client gets of an exception."""
    return EndpointFailure(type(error).__name__, Said.of(error.said), getattr(error, "stop", ""))
