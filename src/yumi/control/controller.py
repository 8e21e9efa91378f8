"""What a controller is: a calculation from state to command that claims interfaces and has a life."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from yumi.robot.joints import Joints
from yumi.robot.values import ArmCommand, ArmState


@dataclass(frozen=True, slots=True)
class Parameter:
    """A value of a controller that may be changed while it runs.

    Attributes:
        name: as in ros2_control's parameter files.
        default: value until told otherwise.
        lowest: smallest value allowed.
        highest: largest value allowed.
        unit: unit of the value, empty for a bare number.
        description: one sentence.
    """

    name: str
    default: float
    lowest: float
    highest: float
    unit: str
    description: str


class Controller(ABC):
    """One controller of one arm.

    The controller manager calls everything here, between two cycles or inside one, always from the fast line.

    Attributes:
        kind: the type string of ros2_control, ``package/Class``.
        parameters: what can be set, see :meth:`configure`.
        is_command: whether it wants commands, one at a time per interface; else it only watches.
    """

    kind: str
    parameters: tuple[Parameter, ...] = ()
    is_command = True

    def configure(self, values: dict[str, float]) -> None:
        """Take parameter values, complete and inside their ranges; may be called again while active."""

    @abstractmethod
    def activate(self, state: ArmState) -> None:
        """Begin from ``state``; whatever was commanded before is forgotten."""

    def deactivate(self) -> None:
        """End; the arm holds from now on."""

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        """The interfaces it claims, ``<joint>/position`` and the like."""
        return tuple(f"{name}/position" for name in joint_names) if self.is_command else ()

    def update(self, state: ArmState) -> ArmCommand | None:
        """The command for ``state``; None holds. Reads ``state.dt`` for the time that passed."""
        return None

    @property
    def reference(self) -> Joints | None:
        """Where the controller is going, chain order [rad]; None when it has nowhere to go."""
        return None
