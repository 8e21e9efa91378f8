"""The driver's end of the watchdog: a sign of life to the robot, which stops its program without one.

The robot's end is ``controller_files/TRobWatchdog.mod``. A driver whose fast line has died gives no sign either: nobody
guides the arm then.

The connection to one controller: opened, checked, watched and ended as a whole.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from threading import Event as Flag
from threading import Lock
from typing import Protocol

from yumi.driver.state_machine import EXTERNAL_STATUS, WATCHDOG
from yumi.errors import ControllerRefused, YumiError
from yumi.process.supervision import SupervisedThread
from yumi.robot.joints import Side
from yumi.rws import types as rapid_values
from yumi.rws.client import RwsClient
from yumi.rws.replies import SystemInfo
from yumi.settings import bounded

SIGNS_PER_TIMEOUT = 5
"""So many signs of life come within the time after which the robot stops."""


@dataclass(frozen=True, slots=True)
class WatchdogSettings:
    """The watchdog on the robot.

    Attributes:
        enabled: whether the robot shall stop when the driver gives no sign of life while EGM runs.
        timeout: after this time [s].
    """

    enabled: bool = True
    timeout: float = bounded(5.0, 1.0, 60.0, "s")


class Watchdog:
    """Has the robot watch the driver, and gives it signs of life.

    Args:
        client: a connected client.
        check: sees that the fast lines run; raises RobotNotReady.
        settings: whether, and how.

    Attributes:
        is_armed: whether the robot watches.
    """

    def __init__(self, client: RwsClient, check: Callable[[], None], settings: WatchdogSettings) -> None:
        self.is_armed = False
        self._client = client
        self._check = check
        self._settings = settings
        self._is_over = Flag()
        self._thread: SupervisedThread | None = None

    def start(self) -> None:
        """Give signs of life whenever it is armed; nothing to do when it is switched off."""
        if self._settings.enabled:
            self._is_over.clear()
            thread = SupervisedThread("watchdog", self._run, self._is_over)
            thread.start()
            self._thread = thread

    def stop(self) -> None:
        """Give none any more."""
        self._is_over.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def arm(self) -> str:
        """Have the robot watch from now on, if somebody is there to give signs of life.

        Returns:
            What there is to say: the robot may have no watchdog.
        """
        if self._thread is None or self.is_armed:
            return ""
        try:
            self.have_robot_watch()
        except ControllerRefused as error:
            return f"no watchdog, the robot will not notice when this program dies: {error}"
        return ""

    def have_robot_watch(self) -> None:
        """Arm it, whoever gives the signs of life; raises ControllerRefused when the robot has no watchdog."""
        for level in (0, 1):  # a sign that met a stopped program was not taken back, and no other would be an edge
            self._client.set_signal(EXTERNAL_STATUS, level)
        for side in Side:
            self._write(side, "external_timeout", self._settings.timeout)
            self._write(side, "check_external_status", True)
            self._write(side, "active", True)
        self.is_armed = True

    def take_over(self) -> None:
        """Disarm what an earlier driver has armed: it would stop a program that nobody guides."""
        self.is_armed = False
        with suppress(ControllerRefused):  # the robot has none
            for side in Side:
                self._write(side, "active", False)

    def disarm(self) -> None:
        """Have the robot watch no longer; one without a program has stopped watching by itself."""
        if self.is_armed:
            self.is_armed = False
            for side in Side:
                self._write(side, "active", False)

    def give_sign(self) -> None:
        """Give one sign of life, if the fast lines are alive, too; where one is lost, the next one follows."""
        try:
            self._check()
            self._client.set_signal(EXTERNAL_STATUS, 1)
        except YumiError:
            return

    def _run(self) -> None:
        while not self._is_over.wait(self._settings.timeout / SIGNS_PER_TIMEOUT):
            if self.is_armed:
                self.give_sign()

    def _write(self, side: Side, name: str, value: rapid_values.RapidValue) -> None:
        self._client.set_symbol(side.task, WATCHDOG, name, rapid_values.encode(value))


class Watching(Protocol):
    """What keeps watch over the robot while there is a connection."""

    def start(self) -> None:
        """Watch from now on."""

    def stop(self) -> None:
        """Watch no longer."""


class RobotConnection:
    """What is open between the driver and one controller.

    Attributes:
        is_open: whether the robot may be asked.

    Args:
        client: its session.
        check_controller: sees that the controller can be used; raises RobotNotReady.
        watching: kept up while it is open.
        let_go: called before it ends, for what else hangs on it.
    """

    def __init__(
        self,
        client: RwsClient,
        check_controller: Callable[[], None],
        watching: Watching,
        let_go: Callable[[], None] = lambda: None,
    ) -> None:
        self._client = client
        self._check_controller = check_controller
        self._watching = watching
        self._let_go = let_go
        self._lock = Lock()
        self._system: SystemInfo | None = None
        self.is_open = False

    def check(self) -> SystemInfo:
        """Log in and see that the controller can be used, unless that has been done; which one it is.

        Raises:
            YumiError: there is no way to it, or it cannot be used; nothing is open.
        """
        if self._system is None:
            try:
                self._system = self._client.connect()
                self._check_controller()
            except YumiError:
                self._system = None
                self._client.close()
                raise
        return self._system

    def connect(self) -> str:
        """Open it, as :meth:`check`, and keep watch over the robot; which controller it is."""
        with self._lock:
            system = self.check()
            if not self.is_open:
                self._watching.start()
                self.is_open = True
        version = ".".join(map(str, system.robotware))
        return f"Connected to {self._client.address}: {system.name}, RobotWare {version}."

    def disconnect(self) -> str:
        """End the watch and log out; nothing where that has been done."""
        with self._lock:
            if self.is_open:
                self._watching.stop()
                self._let_go()
                self._client.close()
            self._system, self.is_open = None, False
        return f"Disconnected from {self._client.address}."
