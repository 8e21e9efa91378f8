"""Calls of one node's services: waited for, and raised in the driver's words when they are refused."""

from __future__ import annotations

from typing import Any

from yumi.errors import RobotNotReady
from yumi.ros.spinner import Spinner


class ServiceCalls:
    """Calls services below one name.

    Args:
        spinner: spins the node it belongs to.
        prefix: what their names begin with, e.g. ``r/gripper``.
    """

    def __init__(self, spinner: Spinner, prefix: str) -> None:
        self._spinner = spinner
        self._prefix = prefix
        self._clients: dict[str, Any] = {}

    def prepare(self, kind: Any, name: str) -> None:
        """Look for a service before it is called: finding it takes a moment."""
        self._client(kind, name)

    def call(self, kind: Any, name: str, timeout: float, /, **fields: object) -> Any:
        """The service's response, whatever it says.

        Raises:
            RobotNotReady: there is no such service, or no answer within ``timeout`` [s].
        """
        client = self._client(kind, name)
        self._spinner.until(client.service_is_ready, timeout, f"The service {name} of the driver: its appearance")
        future = client.call_async(kind.Request(**fields))
        self._spinner.until(future.done, timeout, f"The answer of {name}")
        return future.result()

    def demand(self, kind: Any, name: str, timeout: float, /, **fields: object) -> Any:
        """The service's response, which says that it was done.

        Raises:
            RobotNotReady: it was refused or failed; the message says why.
        """
        response = self.call(kind, name, timeout, **fields)
        if not response.success:
            raise RobotNotReady(str(response.message))
        return response

    def _client(self, kind: Any, name: str) -> Any:
        if name not in self._clients:
            self._clients[name] = self._spinner.node.create_client(kind, f"{self._prefix}/{name}")
        return self._clients[name]
