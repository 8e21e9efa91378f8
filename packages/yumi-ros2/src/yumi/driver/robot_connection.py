"""The connection to the controller, which is opened, checked, monitored and closed as a whole."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock

from abb_protocols.errors import YumiError
from abb_protocols.rws.operations.system import SystemInfo
from abb_runtime.rws.client import RwsClient
from yumi.driver.robot_manager import RobotManager


class RobotConnection:
    """The connection between the driver and one controller.

    Args:
        client: its session.
        check_controller: sees that the controller can be used; raises RobotNotReady.
        manager: runs while it is open.
        on_close: called before it is closed.

    Attributes:
        is_open: whether requests to the robot may be made.
    """

    def __init__(
        self,
        client: RwsClient,
        check_controller: Callable[[], None],
        manager: RobotManager,
        on_close: Callable[[], None] = lambda: None,
    ) -> None:
        self._client = client
        self._check_controller = check_controller
        self._manager = manager
        self._on_close = on_close
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
        """Open it, as :meth:`check`, and monitor the robot; which controller it is."""
        with self._lock:
            system = self.check()
            if not self.is_open:
                self._manager.start()
                self.is_open = True
        return f"Connected to {self._client.address}: {system.name}, RobotWare {system.version}."

    def disconnect(self) -> str:
        """End the monitoring and log out; nothing where that has been done."""
        with self._lock:
            if self.is_open:
                self._manager.stop()
                self._on_close()
                self._client.close()
            self._system, self.is_open = None, False
        return f"Disconnected from {self._client.address}."
