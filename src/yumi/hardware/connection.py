"""The connection to one controller: opened, checked and ended as a whole."""

from __future__ import annotations

from yumi.errors import YumiError
from yumi.hardware.bringup import Bringup
from yumi.hardware.rws_client import RwsClient


class RobotConnection:
    """What is open between the driver and one controller.

    Attributes:
        is_open: whether the robot may be asked.

    Args:
        client: its session.
        bringup: what checks the controller.
    """

    def __init__(self, client: RwsClient, bringup: Bringup) -> None:
        self._client = client
        self._bringup = bringup
        self.is_open = False

    def connect(self) -> str:
        """Log in and check the controller, unless that has been done; which one it is.

        Raises:
            YumiError: there is no way to it, or it cannot be used; nothing is open.
        """
        system = self._client.connect()
        if not self.is_open:
            try:
                self._bringup.check_controller()
            except YumiError:
                self._client.close()
                raise
        self.is_open = True
        version = ".".join(map(str, system.robotware))
        return f"Connected to {self._client.address}: {system.name}, RobotWare {version}."

    def disconnect(self) -> str:
        """Log out; whoever asks the robot after this opens a session of its own."""
        self.is_open = False
        self._client.close()
        return f"Disconnected from {self._client.address}."
