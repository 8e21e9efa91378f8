"""A client that leads a managed node of the driver through its life."""

from __future__ import annotations

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState

from yumi.errors import CommandRefused
from yumi.ros.service_calls import ServiceCalls
from yumi.ros.spinner import Spinner

_ANSWER = 30.0  # [s]


class ManagedNodeClient:
    """One of ``yumi_robot``, ``r/arm``, ``r/gripper``, ``l/arm`` and ``l/gripper``.

    Every transition raises CommandRefused when it is not possible now or failed; the driver's log says why.

    Args:
        spinner: spins the node it belongs to.
        name: of the managed node.
    """

    def __init__(self, spinner: Spinner, name: str) -> None:
        self._name = name
        self._services = ServiceCalls(spinner, name)

    @property
    def state(self) -> str:
        """``unconfigured``, ``inactive``, ``active`` or ``finalized``."""
        return str(self._services.call(GetState, "get_state", _ANSWER).current_state.label)

    def configure(self) -> None:
        """Connect and check."""
        self._lead("configure")

    def activate(self) -> None:
        """Permit motion."""
        self._lead("activate")

    def deactivate(self) -> None:
        """Hold, and permit no motion."""
        self._lead("deactivate")

    def cleanup(self) -> None:
        """Disconnect."""
        self._lead("cleanup")

    def _lead(self, label: str) -> None:
        transition = Transition(label=label)
        if not self._services.call(ChangeState, "change_state", _ANSWER, transition=transition).success:
            raise CommandRefused(f"{self._name} does not {label}: it is {self.state}; the driver's log says why.")
