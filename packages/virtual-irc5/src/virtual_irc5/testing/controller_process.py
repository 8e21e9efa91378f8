"""A virtual controller as a process, in real time, for tests of any program that speaks to a controller."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from abb_protocols.robot.joints import Side
from abb_runtime.faults import Fault, inject_fault
from abb_runtime.process.command_process import CommandProcess
from abb_runtime.rws.client import DEFAULT_PASSWORD, DEFAULT_USER
from abb_runtime.udp import free_port

_READY_TIMEOUT = 30.0  # [s] for a controller in a process of its own


class ControllerProcess:
    """``virtual-irc5 run`` as a child, in real time, on ports that are free; a context manager starts and stops it.

    Attributes:
        address: host and port of its Robot Web Services, ``127.0.0.1:49152``; known once it has started.
        user: who may log in.
        password: of the user.
        egm_ports: the UDP port where each arm expects the sensor, which the program under test has to listen on.

    Args:
        log: file for its output.
        options: of ``virtual-irc5 run``, by their names: ``left_object=0.02``, ``calibrated=True``; one that may be
            repeated is a list.
    """

    def __init__(self, log: Path, options: Mapping[str, object] | None = None) -> None:
        given = dict(options or {})
        self.address = ""
        self.user = str(given.get("user", DEFAULT_USER))
        self.password = DEFAULT_PASSWORD
        self.egm_ports = {}
        for side in Side:
            self.egm_ports[side] = int(str(given.setdefault(f"{side.word}_egm_port", free_port())))
        arguments = ["run"]
        for name, value in {"rws_port": 0, **given}.items():
            option = f"--{name.replace('_', '-')}"
            for each in value if isinstance(value, list) else [value]:
                arguments += [] if each is False else [option] if each is True else [option, str(each)]
        self._command = CommandProcess(
            "virtual controller", "virtual_irc5", arguments, log, {"YUMI_PASSWORD": self.password}
        )

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
            fault: which, or its name, as ``virtual-irc5 fault`` lists them.
            choices: ``side``, ``duration`` [s], ``by`` and ``way``, as the options of ``virtual-irc5 fault``.
        """
        name = fault.value.name if isinstance(fault, Fault) else fault
        inject_fault(self.address, name, {key: str(value) for key, value in choices.items()})
