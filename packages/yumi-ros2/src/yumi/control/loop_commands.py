"""The commands of the control loop, served between two cycles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Concatenate, ParamSpec, Protocol, TypeVar

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import CommandRefused, SwitchFailed
from abb_protocols.robot.joints import Joints, Side
from abb_runtime.parameters import Values
from yumi.control.allowed_collisions import AllowedCollisions
from yumi.control.controller import State
from yumi.control.controller_info import ControllerInfo, HardwareInfo, ParameterInfo
from yumi.control.loop import ArmLoop
from yumi.control.manager.controller_switch import Strictness


@dataclass(frozen=True, slots=True)
class ControllerCommand:
    """What one active controller is commanded, see :meth:`yumi.control.controller.Controller.receive`.

    Attributes:
        controller: its name.
        message: a picklable value it knows.
        activation: of the controllers that it was planned for, see :meth:`Commands.check_commands`; 0 is any.
        takes_over: whether a controller that is inactive is activated for it, in place of those that move nothing.
    """

    side: Side
    controller: str
    message: object
    activation: int = 0
    takes_over: bool = False


@dataclass(frozen=True, slots=True)
class CommandsTaken:
    """What became of commands that were taken.

    Attributes:
        replaced: the arms on which a controller was activated for its command, and the controllers that it replaced.
        made: what each arm's controller made of its command, see :meth:`yumi.control.controller.Controller.receive`.
    """

    replaced: Mapping[Side, tuple[str, ...]]
    made: Mapping[Side, object]


class Commands:
    """Everything that can be asked of the control loop, served between two cycles: each method is one command.

    Another process names the method, see :class:`CommandPort`.

    Args:
        arms: the arms of the loop.
        now: the time [s].

    Attributes:
        allowed: parts that may touch, whose time has to be watched.
    """

    def __init__(self, arms: Mapping[Side, ArmLoop], now: Callable[[], float]) -> None:
        self._arms = arms
        self._now = now
        self.allowed = AllowedCollisions(
            tuple(arms.values()), next((arm.collisions for arm in arms.values()), None), now
        )

    def load_controller(self, side: Side, name: str, kind: str) -> None:
        """Make a controller of type ``kind``, unconfigured."""
        self._arms[side].manager.load_kind(name, kind)
        self._publish(side)

    def configure_controller(self, side: Side, name: str) -> None:
        """Give an unconfigured or inactive controller its parameters; it is inactive then."""
        try:
            self._arms[side].manager.configure(name)
        finally:
            self._publish(side)

    def clean_up_controller(self, side: Side, name: str) -> None:
        """Make an inactive controller unconfigured."""
        self._arms[side].manager.clean_up(name)
        self._publish(side)

    def unload_controller(self, side: Side, name: str) -> None:
        """Forget a controller that is not active."""
        self._arms[side].manager.unload(name)
        self._publish(side)

    def switch_controllers(
        self,
        side: Side,
        activate: Sequence[str] = (),
        deactivate: Sequence[str] = (),
        strictness: Strictness = Strictness.STRICT,
    ) -> str:
        """Deactivate and activate controllers as one step, see :meth:`.ControllerManager.switch`."""
        arm = self._arms[side]
        try:
            return arm.manager.switch(activate, deactivate, arm.state, strictness)
        finally:
            self._publish(side)

    def hold(self, side: Side) -> None:
        """Deactivate whatever commands an arm; it comes to rest and holds."""
        self._arms[side].manager.deactivate_commanding()
        self._publish(side)

    def set_parameters(self, side: Side, controller: str, values: Values) -> None:
        """Change parameters of one controller from the next cycle on, all or none."""
        self._arms[side].manager.set_parameters(controller, values)

    def list_parameters(self, side: Side, controller: str) -> tuple[ParameterInfo, ...]:
        """What can be set on one controller and what is set."""
        return self._arms[side].manager.parameters(controller)

    def list_controllers(self, side: Side) -> tuple[ControllerInfo, ...]:
        """The controllers of one arm, in the order of loading."""
        return self._arms[side].manager.controllers()

    def list_controller_kinds(self, side: Side) -> tuple[str, ...]:
        """The types of controllers that can be loaded."""
        return self._arms[side].manager.kinds

    def hardware(self, side: Side) -> HardwareInfo:
        """The state of an arm's hardware component and of its interfaces."""
        return self._arms[side].manager.hardware()

    def set_hardware_state(self, side: Side, name: str, state: State) -> HardwareInfo:
        """Lead an arm's hardware component to ``state``; who uses what it no longer offers is deactivated."""
        info = self._arms[side].manager.set_hardware_state(name, state)
        self._publish(side)
        return info

    def allow_collision(self, part: str, other: str, seconds: float) -> None:
        """Let two parts touch for a time [s], see :meth:`.AllowedCollisions.allow`."""
        self.allowed.allow(part, other, seconds)

    def end_allowed_collision(self, part: str, other: str) -> None:
        """Keep two parts apart again that may touch."""
        self.allowed.end(part, other)

    def commanded_positions(self, *sides: Side) -> Mapping[Side, Joints]:
        """Where each arm's active controller commands it to be [rad], (7,); where it is without one."""
        positions = {}
        for side in sides:
            position = self._arms[side].manager.reference or self._arms[side].position
            if position is None:
                raise CommandRefused(message("no_position_yet", arm=side.word))
            positions[side] = position
        return positions

    def check_commands(self, *commands: ControllerCommand) -> Mapping[Side, int]:
        """Whether the controllers would take their commands now; nothing is changed.

        Returns:
            The activation of each arm's controllers: what is planned now is for no later one.
        """
        # A second command for a controller could rest on what the first changes.
        for (side, name), count in Counter((each.side, each.controller) for each in commands).items():
            if count > 1:
                raise CommandRefused(message("several_commands", controller=name, arm=side.word, count=count))
        for each in commands:
            arm = self._arms[each.side]
            arm.check_follows()
            if each.activation not in (0, arm.activation):
                reason = message("interrupted_while_planned", arm=each.side.word)
                raise CommandRefused(message("goal_refused", reason=reason))
            if each.takes_over and arm.manager.is_inactive(each.controller):
                arm.manager.check_take_over(each.controller, arm.state, self._now())
                arm.check_stands()
            else:
                arm.manager.check(each.controller, each.message, arm.state)
        return {each.side: self._arms[each.side].activation for each in commands}

    def send_commands(self, *commands: ControllerCommand) -> Mapping[Side, tuple[str, ...]]:
        """Have controllers of one or both arms take their commands between the same two cycles, all or none.

        Returns:
            The arms on which a controller was activated for its command, and the controllers that it has replaced.
        """
        return self.take_commands(*commands).replaced

    def take_commands(self, *commands: ControllerCommand) -> CommandsTaken:
        """As :meth:`send_commands`, and what the controllers made of the commands."""
        self.check_commands(*commands)
        replaced: dict[Side, tuple[str, ...]] = {}
        try:
            for each in commands:
                arm = self._arms[each.side]
                if each.takes_over and arm.manager.is_inactive(each.controller):
                    before = arm.manager.check_take_over(each.controller, arm.state, self._now())
                    replaced[each.side] = before
                    self.switch_controllers(each.side, (each.controller,), before)
                    arm.manager.check(each.controller, each.message, arm.state)
        except Exception:
            for each in commands:
                if each.side in replaced:
                    arm = self._arms[each.side]
                    is_active = not arm.manager.is_inactive(each.controller)
                    self.switch_controllers(each.side, replaced[each.side], (each.controller,) if is_active else ())
            raise
        made = {}
        for each in commands:
            arm = self._arms[each.side]
            made[each.side] = arm.manager.receive(each.controller, each.message, arm.state)
        return CommandsTaken(replaced, made)

    def _publish(self, side: Side) -> None:
        self._arms[side].publish(self._now())


COMMANDS: Mapping[str, Callable[..., object]] = {
    name: command for name, command in vars(Commands).items() if not name.startswith("_")
}
"""The commands by name; nothing else is called from another process."""

_P = ParamSpec("_P")
_T = TypeVar("_T")


def serve(
    commands: Commands, command: Callable[Concatenate[Commands, _P], _T], *args: _P.args, **kwargs: _P.kwargs
) -> _T:
    """Carry out one command of :class:`Commands`.

    Raises:
        CommandRefused: a rule stands against it, or it failed; the sentence says what a failed switch has left.
    """
    try:
        return command(commands, *args, **kwargs)
    except (CommandRefused, SwitchFailed) as error:
        raise CommandRefused(error.said) from error
    except Exception as error:
        name = getattr(command, "__name__", "")
        raise CommandRefused(
            message("command_failed", command=name, kind=type(error).__name__, why=said_by(error))
        ) from error


class CommandPort(Protocol):
    """Where commands are given, from any thread."""

    def call(self, command: Callable[Concatenate[Commands, _P], _T], /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Have ``command``, a method of :class:`Commands`, served between two cycles; returns its answer.

        Raises:
            CommandRefused: a rule stands against it.
            RobotNotReady: the control process has ended or does not answer.
        """
