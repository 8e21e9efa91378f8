"""The signals of one hand: as the controller told them last, or asked for."""

from __future__ import annotations

from yumi.errors import ControllerRefused, RobotNotReady
from yumi.hardware.hand_signals import HandSignals
from yumi.hardware.rws_client import RwsClient
from yumi.robot.gripper import GripperModules
from yumi.robot.hand import HandReading, read_hand
from yumi.robot.joints import Side

_UNKNOWN = 404


class HandIo:
    """Signals by their names without the arm's suffix.

    What was told lags behind by what a subscription takes, 50 ms or so; what is asked for costs a request, of which
    there are few a second (see :mod:`yumi.hardware.rws_pace`).

    Args:
        side: which arm carries the hand.
        client: a connected client.
        signals: what the controller tells by itself; None asks for everything.
        modules: what the hand is made of.
    """

    def __init__(
        self,
        side: Side,
        client: RwsClient,
        signals: HandSignals | None = None,
        modules: GripperModules = GripperModules.SERVO,
    ) -> None:
        self.side = side
        self.modules = modules
        self._client = client
        self._signals = signals

    @property
    def is_told(self) -> bool:
        """Whether the controller tells of this hand by itself."""
        return self._signals is not None and self._signals.value(self.side, "hand_SysState") is not None

    def value(self, name: str) -> float:
        """A signal as it was told, or else as ``ask``."""
        told = None if self._signals is None else self._signals.value(self.side, name)
        return self.ask(name) if told is None else told

    def ask(self, name: str) -> float:
        """A signal as it is now.

        Raises:
            RobotNotReady: the controller has no such signal.
        """
        full = self._full(name)
        try:
            return self._client.signal(full).value
        except ControllerRefused as error:
            if error.status != _UNKNOWN:
                raise
            raise RobotNotReady(
                f"The controller has no signal {full}; it has no {self.side.word} Smart Gripper."
            ) from error

    def write(self, name: str, value: float) -> None:
        """Write a signal of the controller to the hand."""
        self._client.set_signal(self._full(name), value)

    def reading(self) -> HandReading:
        """Everything the hand shows; raises as ``ask``."""
        return read_hand(self.value, self.modules)

    def _full(self, name: str) -> str:
        return f"{name}_{self.side.name[0]}"
