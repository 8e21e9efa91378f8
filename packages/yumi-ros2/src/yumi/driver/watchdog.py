"""The watchdog: a heartbeat to the robot, which stops its program without one.

On the robot it is ``controller_files/TRobWatchdog.mod``. A driver whose control process has died sends no heartbeat
either: nothing controls the arm then.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from threading import Event as Flag

from abb_protocols.errors import ControllerRefused, YumiError
from abb_protocols.robot.joints import Side
from abb_protocols.rws.rapid_values import RapidValue
from abb_runtime.parameters import bounded
from abb_runtime.process.supervision import SupervisedThread
from abb_runtime.rws.client import RwsClient
from yumi.driver.state_machine import EXTERNAL_STATUS_SIGNAL, WATCHDOG_MODULE

_BEATS_PER_TIMEOUT = 5
"""So many heartbeats come within the time after which the robot stops."""


@dataclass(frozen=True, slots=True)
class WatchdogSettings:
    """The watchdog on the robot.

    Attributes:
        enabled: whether the robot stops when the driver sends no heartbeat while EGM runs.
        timeout: after this time [s].
    """

    enabled: bool = True
    timeout: float = bounded(5.0, 1.0, 60.0, "s")


class Watchdog:
    """Arms the robot's watchdog, and sends it heartbeats.

    Args:
        client: a connected client.
        check: sees that the control loop runs; raises RobotNotReady.
        settings: whether, and how.

    Attributes:
        is_armed: whether the robot stops without heartbeats.
    """

    def __init__(self, client: RwsClient, check: Callable[[], None], settings: WatchdogSettings) -> None:
        self.is_armed = False
        self._client = client
        self._check = check
        self._settings = settings
        self._is_over = Flag()
        self._thread: SupervisedThread | None = None

    def start(self) -> None:
        """Send heartbeats whenever it is armed; nothing to do when it is switched off."""
        if self._settings.enabled:
            self._is_over.clear()
            thread = SupervisedThread("watchdog", self._run, self._is_over)
            thread.start()
            self._thread = thread

    def stop(self) -> None:
        self._is_over.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def arm(self) -> str:
        """Arm it, if a thread sends heartbeats; returns a remark where the robot has no watchdog, else nothing."""
        if self._thread is None or self.is_armed:
            return ""
        try:
            self.arm_robot()
        except ControllerRefused as error:
            return f"no watchdog, the robot will not notice when this program dies: {error}"
        return ""

    def arm_robot(self) -> None:
        """Arm it, whatever sends the heartbeats; raises ControllerRefused when the robot has no watchdog."""
        for level in (0, 1):  # a beat that met a stopped program was not taken back, and no other would be an edge
            self._client.set_signal(EXTERNAL_STATUS_SIGNAL, level)
        for side in Side:
            self._write(side, "external_timeout", self._settings.timeout)
            self._write(side, "check_external_status", True)
            self._write(side, "active", True)
        self.is_armed = True

    def take_over(self) -> None:
        """Disarm what an earlier driver has armed: it would stop a program that has no EGM."""
        self.is_armed = False
        with suppress(ControllerRefused):  # the robot has none
            for side in Side:
                self._write(side, "active", False)

    def disarm(self) -> None:
        """Disarm it; a robot whose program ended has disarmed it by itself."""
        if self.is_armed:
            self.is_armed = False
            for side in Side:
                self._write(side, "active", False)

    def beat(self) -> None:
        """Send one heartbeat, if the control loop runs, too; where one is lost, the next one follows."""
        try:
            self._check()
            self._client.set_signal(EXTERNAL_STATUS_SIGNAL, 1)
        except YumiError:
            return

    def _run(self) -> None:
        while not self._is_over.wait(self._settings.timeout / _BEATS_PER_TIMEOUT):
            if self.is_armed:
                self.beat()

    def _write(self, side: Side, name: str, value: RapidValue) -> None:
        self._client.set_value(side.task, WATCHDOG_MODULE, name, value)
