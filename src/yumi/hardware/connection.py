"""The connection to one controller: opened, checked, watched and ended as a whole."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import Protocol

from yumi.errors import YumiError
from yumi.hardware.rws_client import RwsClient
from yumi.rws.replies import SystemInfo


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
