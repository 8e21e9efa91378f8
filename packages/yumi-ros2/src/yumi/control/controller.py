"""The base class of controllers, and the transitions of their lifecycle (REP-2007).

To add one: a subclass of :class:`Controller` in a module of its own in ``control/controllers/``, where the driver finds
it by its ``kind``; and its name and type in ``config/controllers.yaml``. For its test, ``VirtualArmRig`` of
``yumi_evaluation`` runs it with a virtual arm in virtual time.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from enum import Enum

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ArmCommand, ArmState, Joints
from abb_runtime.parameters import Parameter, Values, texts
from yumi.control.goals import GoalKind
from yumi.control.motion.standstill import SentPositions
from yumi.control.place import Place
from yumi.control.sampled import Sampled

CONTROLLER_IDLE_TIME = 1.0
"""A controller that follows what it is sent is idle when nothing has come for so long [s]."""


class Controller(ABC):
    """One controller of one arm.

    The controller manager calls everything here, between two cycles or inside one, always in the control process.

    Attributes:
        kind: the type string of ros2_control, ``package/Class``.
        is_command: whether it wants commands, one at a time per interface; else it only watches.
        goal_kind: which goals it takes while it is active.
        sent: what the arm is sent, from the controller manager; nothing is known without one.
    """

    kind: str
    is_command = True
    goal_kind = GoalKind.NONE
    sent = SentPositions()

    @classmethod
    def make(cls, place: Place) -> Controller:
        """A controller for an arm; a class whose constructor takes something takes it from ``place``."""
        return cls()

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        """What can be set, with one parameter for each joint where it differs: ``gains.<joint>.p``.

        What upstream's controller of the same type has and this one does not is a fixed one, with the reason.
        """
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

    @property
    def sampled(self) -> Sampled | None:
        """The formula of the next :meth:`update`, if that is so simple; it may then be called after the reply."""
        return None

    def check(self, command: object, state: ArmState | None) -> None:
        """Whether :meth:`receive` would take ``command`` now; changes nothing.

        Raises:
            CommandRefused: it would not, and why.
        """
        raise CommandRefused(message("controller_takes_no_commands", type=self.kind))

    def receive(self, command: object, state: ArmState | None) -> object:
        """Take a command between two cycles: a trajectory, a cancel. Only while active.

        Args:
            command: a picklable value the controller knows.
            state: the arm's newest state; None while it is not heard.

        Returns:
            What it made of the command, picklable, where the sender needs that; mostly None.

        Raises:
            CommandRefused: it breaks a rule; nothing was changed.
        """
        self.check(command, state)
        return None

    def end_stream(self, state: ArmState) -> bool:
        """Bring the arm to rest, and take nothing until it is activated anew: who streams was silent for too long.

        Returns:
            Whether it does; else it is deactivated, and the limiter brings the arm to rest.
        """
        return False

    def note_withheld(self, position: Joints) -> None:
        """The limiter holds the arm at ``position`` [rad], (7,), short of what is commanded.

        It would make up for that as soon as the way is free, so a controller that leads the arm no further gives it up.
        """

    def note_waiting(self, position: Joints) -> None:
        """Replies are lost: the command stands at ``position`` [rad], (7,), until the robot follows it again.

        A motion without a time base outside the controller is planned again from there.
        """

    def is_idle(self, now: float) -> bool:
        """Whether nothing asks it to move the arm at ``now`` [s], so that a goal for another one may replace it."""
        return False

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


def allowed_transitions(state: State) -> tuple[Transition, ...]:
    """The transitions that may leave ``state``."""
    return tuple(transition for (source, transition) in TRANSITIONS if source is state)


def find_controller_parameter(parameters: Iterable[Parameter], name: str) -> Parameter | None:
    """The parameter called ``name``, or the group of fixed ones that it belongs to."""
    known = {parameter.name: parameter for parameter in parameters}
    words = name.split(".")
    groups = (known.get(".".join(words[:count])) for count in range(len(words) - 1, 0, -1))
    return known.get(name) or next((each for each in groups if each and each.is_group), None)


def foreign_command(controller: Controller, command: object, *allowed: type) -> CommandRefused:
    """The refusal of a command that has none of the types which the controller takes."""
    names, given = tuple(each.__name__ for each in allowed), type(command).__name__
    return CommandRefused(message("command_of_other_controller", type=controller.kind, allowed=names, command=given))


def check_controller_joints(values: Values, joint_names: Sequence[str], *, in_order: bool) -> None:
    """Refuse a parameter ``joints`` that does not name the joints of the arm.

    Args:
        values: complete values of parameters.
        joint_names: of the arm, chain order.
        in_order: whether the order counts.

    Raises:
        CommandRefused: it names others, or in another order.
    """
    given = texts(values, "joints")
    if given == tuple(joint_names) or (not in_order and sorted(given) == sorted(joint_names)):
        return
    foreign = next((name for name in given if name not in joint_names), None)
    if foreign is not None:
        raise CommandRefused(message("parameter_joint_foreign", joint=foreign, joints=tuple(joint_names)))
    raise CommandRefused(
        message(
            "parameter_joints_out_of_order" if in_order else "parameter_joints_incomplete",
            given=", ".join(given),
            joints=tuple(joint_names),
        )
    )
