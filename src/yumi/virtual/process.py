"""A virtual controller in a process of its own, seen by the program that has started it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import httpx

from yumi.egm.udp import free_port
from yumi.errors import CommandRefused, NoConnection
from yumi.process.supervision import Command
from yumi.robot.joints import Side
from yumi.rws.client import DEFAULT_PASSWORD, DEFAULT_USER
from yumi.virtual.controller.fault_names import Fault

_FAULTS = "/virtual/faults"
_FAULT_TIMEOUT = 4.0  # [s]
_LOOPBACK = ("127.0.0.1", "::1", "localhost")
_READY_TIMEOUT = 30.0  # [s]


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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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


def inject_fault(address: str, name: str, form: Mapping[str, str]) -> None:
    """Inject a fault into the virtual controller at ``address``.

    Raises:
        NoConnection: nothing answers there.
        CommandRefused: the fault is unknown or refused, or it is not a virtual controller.
    """
    try:
        try:
            reply = _posted(f"http://{address}{_FAULTS}/{name}", form)
        except (httpx.RemoteProtocolError, httpx.ReadError):  # it speaks TLS, with a certificate of its own
            reply = _posted(f"https://{address}{_FAULTS}/{name}", form)
    except httpx.HTTPError as error:
        raise NoConnection(
            f"Nothing answers at {address} ({error}). A virtual controller is started with `yumi controller`."
        ) from error
    if not reply.is_success:
        is_virtual = reply.headers.get("Content-Type", "").startswith("text/plain")
        sentence = reply.text if is_virtual else ""
        raise CommandRefused(sentence or f"What answers at {address} is not a virtual controller of this package.")


def _posted(url: str, form: Mapping[str, str]) -> httpx.Response:
    # The certificate that a virtual controller makes itself is trusted on this machine alone.
    is_far = httpx.URL(url).host not in _LOOPBACK
    return httpx.post(url, data=form, timeout=_FAULT_TIMEOUT, trust_env=False, verify=is_far)
