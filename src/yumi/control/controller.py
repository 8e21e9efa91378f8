"""What a controller is, the transitions of its lifecycle (REP-2007), and how others see the controllers of an arm."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

from yumi.control.commands import GoalKind
from yumi.control.statistics import Statistics
from yumi.errors import CommandRefused
from yumi.robot.joints import ArmCommand, ArmState, Joints
from yumi.settings import Parameter, Value, Values


class Controller(ABC):
    """One controller of one arm.

    The controller manager calls everything here, between two cycles or inside one, always in the control process.

    Attributes:
        kind: the type string of ros2_control, ``package/Class``.
        is_command: whether it wants commands, one at a time per interface; else it only watches.
        goal_kind: which goals it takes while it is active.
    """

    kind: str
    is_command = True
    goal_kind = GoalKind.NONE

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

        Positions and velocities of interfaces it does not claim count only where no controller claims them.
        """
        return None

    def check(self, message: object, state: ArmState | None) -> None:
        """Whether :meth:`receive` would take ``message`` now; changes nothing.

        Raises:
            CommandRefused: it would not, and why.
        """
        raise CommandRefused(f"A controller of type {self.kind} takes no commands.")

    def receive(self, message: object, state: ArmState | None) -> None:
        """Take a command between two cycles: a trajectory, a cancel. Only while active.

        Args:
            message: a picklable value the controller knows.
            state: the arm's newest state; None while it is not heard.

        Raises:
            CommandRefused: it breaks a rule; nothing was changed.
        """
        self.check(message, state)

    def take_reports(self) -> Sequence[object]:
        """Its reports since the last call, picklable and frozen; asked after each reply, cheap when empty."""
        return ()

    @property
    def reference(self) -> Joints | None:
        """Where the controller is going, chain order [rad]; None when it has nowhere to go."""
        return None


class State(Enum):
    """Primary states; the values are the labels that ros2_control tools compare."""

    UNCONFIGURED = "unconfigured"
    INACTIVE = "inactive"
    ACTIVE = "active"
    FINALIZED = "finalized"


class Transition(Enum):
    """What moves a controller from state to state."""

    CONFIGURE = "configure"
    ACTIVATE = "activate"
    DEACTIVATE = "deactivate"
    CLEANUP = "cleanup"
    SHUTDOWN = "shutdown"


TRANSITIONS: dict[tuple[State, Transition], State] = {
    (State.UNCONFIGURED, Transition.CONFIGURE): State.INACTIVE,
    (State.INACTIVE, Transition.ACTIVATE): State.ACTIVE,
    (State.ACTIVE, Transition.DEACTIVATE): State.INACTIVE,
    (State.INACTIVE, Transition.CLEANUP): State.UNCONFIGURED,
    (State.UNCONFIGURED, Transition.SHUTDOWN): State.FINALIZED,
    (State.INACTIVE, Transition.SHUTDOWN): State.FINALIZED,
    (State.ACTIVE, Transition.SHUTDOWN): State.FINALIZED,
}


def allowed(state: State) -> tuple[Transition, ...]:
    """The transitions that may leave ``state``."""
    return tuple(transition for (source, transition) in TRANSITIONS if source is state)


@dataclass(frozen=True, slots=True)
class ControllerInfo:
    """One controller as the manager knows it.

    Attributes:
        name: its name, unique on this arm.
        kind: ros2_control's type string.
        state: its lifecycle state.
        required: the command interfaces it needs when active.
        claimed: the command interfaces it holds now.
        required_state: the state interfaces it needs when active.
        execution_time: how long its updates took since it was activated last [s].
    """

    name: str
    kind: str
    state: State
    required: tuple[str, ...]
    claimed: tuple[str, ...]
    required_state: tuple[str, ...] = ()
    execution_time: Statistics = field(default_factory=Statistics)


class InterfaceInfo(NamedTuple):
    """One command or state interface; a tuple, since there are many in each answer.

    Attributes:
        name: ``<joint>/<kind>``.
        is_available: whether its component offers it now.
        is_claimed: whether an active controller holds it; state interfaces are never claimed.
    """

    name: str
    is_available: bool
    is_claimed: bool = False


@dataclass(frozen=True, slots=True)
class HardwareInfo:
    """The hardware component of one arm.

    Attributes:
        name: its name.
        state: its lifecycle state.
        command_interfaces: what can be commanded.
        state_interfaces: what is measured.
        read_time: how long reading the arm took, cycle by cycle [s].
        write_time: how long answering it took [s].
        period: time between two cycles [s].
    """

    name: str
    state: State
    command_interfaces: tuple[InterfaceInfo, ...]
    state_interfaces: tuple[InterfaceInfo, ...]
    read_time: Statistics = field(default_factory=Statistics)
    write_time: Statistics = field(default_factory=Statistics)
    period: Statistics = field(default_factory=Statistics)


@dataclass(frozen=True, slots=True)
class ParameterInfo:
    """A parameter of a controller and what it holds.

    Attributes:
        parameter: what may be set.
        value: what is set.
    """

    parameter: Parameter
    value: Value
