"""What a controller is: a calculation from state to command that claims interfaces and has a life."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from yumi.control.parameter import Parameter, Values
from yumi.errors import CommandRefused
from yumi.robot.joints import Joints
from yumi.robot.values import ArmCommand, ArmState


class Controller(ABC):
    """One controller of one arm.

    The controller manager calls everything here, between two cycles or inside one, always from the fast line.

    Attributes:
        kind: the type string of ros2_control, ``package/Class``.
        is_command: whether it wants commands, one at a time per interface; else it only watches.
    """

    kind: str
    is_command = True

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        """What can be set, with one parameter for each joint where it differs: ``gains.<joint>.p``."""
        return ()

    def configure(self, values: Values) -> None:
        """Take parameter values, complete, of their own types and inside their ranges; also while active.

        Raises:
            CommandRefused: the values do not go together; nothing was changed.
        """

    def clean_up(self) -> None:
        """Forget what configuring prepared; called before it is configured anew or unloaded."""

    @abstractmethod
    def activate(self, state: ArmState) -> None:
        """Begin from ``state``; whatever was commanded before is forgotten."""

    def deactivate(self) -> None:
        """End; the arm holds from now on."""

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        """The interfaces it claims while active, ``<joint>/position`` and the like."""
        return tuple(f"{name}/position" for name in joint_names) if self.is_command else ()

    def state_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        """The interfaces it reads while active."""
        return tuple(f"{name}/{kind}" for name in joint_names for kind in ("position", "velocity"))

    def update(self, state: ArmState) -> ArmCommand | None:
        """The command for ``state``; None holds the arm. Reads ``state.dt`` for the time that passed.

        Positions and velocities of interfaces it does not claim count only where nobody claims them.
        """
        return None

    def check(self, message: object, state: ArmState | None) -> None:
        """Whether :meth:`receive` would take ``message`` now; changes nothing.

        Raises:
            CommandRefused: it would not, and why.
        """
        raise CommandRefused(f"A controller of type {self.kind} takes no orders.")

    def receive(self, message: object, state: ArmState | None) -> None:
        """Take an order between two cycles: a trajectory, a cancel. Only while active.

        Args:
            message: a picklable value the controller knows.
            state: the arm's newest state; None while it is not heard.

        Raises:
            CommandRefused: it breaks a rule; nothing was changed.
        """
        self.check(message, state)

    def take_notices(self) -> Sequence[object]:
        """What it has to tell since the last call, picklable and frozen; asked after each reply, cheap when empty."""
        return ()

    @property
    def reference(self) -> Joints | None:
        """Where the controller is going, chain order [rad]; None when it has nowhere to go."""
        return None
