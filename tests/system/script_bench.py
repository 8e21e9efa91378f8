"""What the tests of the Python API work with: a virtual controller in a process of its own, and scripts in theirs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from abb_protocols.robot.joints import Side
from abb_protocols.rws import rapid_values
from abb_runtime.fault_command import fault as fault_command
from abb_runtime.faults import Fault
from abb_runtime.process.command_process import CommandProcess
from abb_runtime.rws.client import RwsClient
from abb_runtime.udp import free_port
from yumi.driver.state_machine import MAIN_MODULE, MachineState

TIMEOUT = 60.0


class VirtualRobot:
    """A virtual controller; can be killed and started again at the same address.

    Args:
        folder: for logs and scripts.
        are_calibrated: whether its grippers are when it starts, so that no bring-up takes seconds for that.
        dynamics: settings with which its arms follow EGM; None is as delivered.
    """

    def __init__(self, folder: Path, *, are_calibrated: bool = True, dynamics: Path | None = None) -> None:
        self._folder = folder
        self._options = ["--left-object", "0.02", *(["--calibrated"] if are_calibrated else [])]
        self._options += ["--dynamics", str(dynamics)] if dynamics else []
        self._rws_port = 0
        self._ports = {"left_egm_port": free_port(), "right_egm_port": free_port()}
        self._command: CommandProcess | None = None

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self._rws_port}"

    @property
    def options(self) -> dict[str, Any]:
        """For ``yumi.connect``."""
        return {"address": self.address, **self._ports}

    def start(self) -> None:
        ports = [text for name, port in self._ports.items() for text in (f"--{name.replace('_', '-')}", str(port))]
        arguments = ["controller", "--rws-port", str(self._rws_port), *self._options, *ports]
        self._command = CommandProcess(
            "virtual controller", "yumi", arguments, self._folder / "controller.log"
        ).__enter__()
        self._rws_port = int(self._command.wait_until_ready(TIMEOUT).rpartition(":")[2])

    def kill(self) -> None:
        """As a power cut."""
        assert self._command is not None
        self._command.kill()
        self._command = None

    def stop(self) -> None:
        if self._command is not None:
            self._command.stop()

    def inject(self, fault: Fault) -> None:
        """``yumi fault``."""
        fault_command.main([fault.value.name, "--robot", f"127.0.0.1:{self._rws_port}"], standalone_mode=False)

    def is_guided(self, side: Side) -> bool:
        """Whether EGM runs on an arm, as the controller says."""
        with RwsClient(self.address) as client:
            state = rapid_values.decode(client.symbol(side.task, MAIN_MODULE, "current_state"))
        return state == MachineState.RUN_EGM_ROUTINE

    def script(self, text: str) -> subprocess.Popen[str]:
        """A script in a process of its own that finds the robot's options as ``OPTIONS``."""
        file = self._folder / "script.py"
        file.write_text(f"OPTIONS = {self.options!r}\n{text}", encoding="utf-8")
        return run_python(self._folder, str(file))


def output_of(process: subprocess.Popen[str], timeout: float = TIMEOUT) -> str:
    """What a process prints until its end; one that goes on after ``timeout`` is ended, and no other test meets it."""
    try:
        return process.communicate(timeout=timeout)[0]
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()


def run_python(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """A Python of its own in which ROS cannot be imported."""
    (folder / "rclpy.py").write_text("raise ImportError('there is no ROS here')\n", encoding="utf-8")
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONPATH": path, "PYTHONUNBUFFERED": "1"},
        start_new_session=True,
    )
