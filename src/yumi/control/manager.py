"""The controller manager of one arm: which controllers exist, who is active, who claims which interface.

Switching happens between two cycles; an interface has one owner at a time; a controller whose update fails is
deactivated and the arm holds (reference/ros2_control.md §1.11).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from yumi.control.controller import Controller
from yumi.control.inventory import ControllerInfo, ParameterInfo
from yumi.control.lifecycle import TRANSITIONS, State, Transition, allowed
from yumi.control.parameter import Parameter, Value, Values
from yumi.errors import CommandRefused
from yumi.robot.joints import Joints
from yumi.robot.values import ArmCommand, ArmState


@dataclass(slots=True)
class _Loaded:
    controller: Controller
    state: State
    parameters: dict[str, Parameter]
    values: dict[str, Value]


class ControllerManager:
    """Owns the controllers of one arm.

    Attributes:
        failures: sentences about controllers that failed; whoever tells them takes them out.
        activations: how often a controller was activated.

    Args:
        joint_names: the arm's joints, chain order.
    """

    def __init__(self, joint_names: tuple[str, ...]) -> None:
        self.failures: list[str] = []
        self.activations = 0
        self._joint_names = joint_names
        self._loaded: dict[str, _Loaded] = {}
        self._commanding: tuple[tuple[str, Controller], ...] = ()
        self._watching: tuple[Controller, ...] = ()
        self._active: tuple[tuple[str, Controller], ...] = ()
        self._notices: list[tuple[str, object]] = []

    def load(self, name: str, controller: Controller) -> None:
        """Add a controller, unconfigured.

        Raises:
            CommandRefused: the name is taken.
        """
        if name in self._loaded:
            raise CommandRefused(f"Controller {name!r} is loaded already; unload it first or choose another name.")
        parameters = {parameter.name: parameter for parameter in controller.parameters(self._joint_names)}
        defaults = {key: parameter.default for key, parameter in parameters.items()}
        self._loaded[name] = _Loaded(controller, State.UNCONFIGURED, parameters, defaults)

    def configure(self, name: str, values: Values | None = None) -> None:
        """Give an unconfigured controller its parameters and make it inactive.

        Raises:
            CommandRefused: no such controller, wrong state, unknown parameter or value out of range.
        """
        self._check(name, Transition.CONFIGURE)
        self.set_parameters(name, values or {})
        self._move(name, Transition.CONFIGURE)

    def set_parameters(self, name: str, values: Values) -> None:
        """Change parameters; an active controller uses them from the next cycle on.

        Raises:
            CommandRefused: no such controller, unknown parameter or value out of range; nothing was changed.
        """
        loaded = self._find(name)
        accepted = {key: _accepted(name, loaded, key, value) for key, value in values.items()}
        complete = {**loaded.values, **accepted}
        loaded.controller.configure(complete)
        loaded.values = complete

    def parameters(self, name: str) -> tuple[ParameterInfo, ...]:
        """What can be set on a controller and what is set.

        Raises:
            CommandRefused: no such controller.
        """
        loaded = self._find(name)
        return tuple(ParameterInfo(parameter, loaded.values[key]) for key, parameter in loaded.parameters.items())

    def check(self, name: str, message: object, state: ArmState | None) -> None:
        """Whether :meth:`receive` would have a controller take ``message``; changes nothing.

        Raises:
            CommandRefused: it would not, and why.
        """
        loaded = self._find(name)
        if loaded.state is not State.ACTIVE:
            raise CommandRefused(f"Controller {name!r} is {loaded.state.value} and takes no orders; activate it first.")
        loaded.controller.check(message, state)

    def receive(self, name: str, message: object, state: ArmState | None) -> None:
        """Have an active controller take an order.

        Args:
            name: the controller.
            message: a value it knows.
            state: the arm's newest state; None while it is not heard.

        Raises:
            CommandRefused: no such controller, not active, or it refuses the order; nothing was changed.
        """
        self.check(name, message, state)
        self._find(name).controller.receive(message, state)

    def take_notices(self) -> Sequence[tuple[str, object]]:
        """What the controllers have to tell since the last call: their name and the notice."""
        for name, controller in self._active:
            for notice in controller.take_notices():
                self._notices.append((name, notice))
        if not self._notices:
            return ()
        notices, self._notices = self._notices, []
        return notices

    def switch(self, activate: Sequence[str], deactivate: Sequence[str], state: ArmState | None) -> None:
        """Deactivate and activate controllers as one step, or change nothing at all.

        Args:
            activate: names of inactive controllers.
            deactivate: names of active controllers.
            state: the arm's newest state; command controllers need one to begin from.

        Raises:
            CommandRefused: a name, a state or a claim stands against it.
        """
        if len({*activate, *deactivate}) != len(activate) + len(deactivate):
            raise CommandRefused(f"A controller is named twice in one switch: {', '.join([*activate, *deactivate])}.")
        for name in deactivate:
            self._check(name, Transition.DEACTIVATE)
        for name in activate:
            self._check(name, Transition.ACTIVATE)
        self._check_claims(activate, deactivate)
        begin = self._state_to_begin(activate, state)
        for name in deactivate:
            controller = self._find(name).controller
            controller.deactivate()
            self._notices += [(name, notice) for notice in controller.take_notices()]
            self._move(name, Transition.DEACTIVATE)
        for name in activate:
            self._find(name).controller.activate(begin)
            self._move(name, Transition.ACTIVATE)
            self.activations += 1

    def deactivate_commanding(self) -> tuple[str, ...]:
        """Deactivate whatever commands the arm, e.g. because the robot is lost; returns the names."""
        names = tuple(name for name, _ in self._commanding)
        self.switch((), names, None)
        return names

    def update(self, state: ArmState) -> ArmCommand | None:
        """What the active controllers want; None holds. Never raises: who fails is deactivated."""
        wanted = None
        for name, controller in self._commanding:
            try:
                wanted = controller.update(state)
            except Exception as error:
                self._fail(name, error)
                return None
        return wanted

    def watch(self, state: ArmState) -> None:
        """Let the controllers that only watch see ``state``; after the reply has left."""
        for controller in self._watching:
            controller.update(state)

    @property
    def is_commanding(self) -> bool:
        """Whether a controller commands the arm."""
        return bool(self._commanding)

    @property
    def reference(self) -> Joints | None:
        """Where the commanding controllers are going [rad]; None when nobody commands."""
        for _, controller in self._commanding:
            return controller.reference
        return None

    def controllers(self) -> tuple[ControllerInfo, ...]:
        """All loaded controllers in the order of loading."""
        return tuple(self._info(name, loaded) for name, loaded in self._loaded.items())

    def _info(self, name: str, loaded: _Loaded) -> ControllerInfo:
        required = loaded.controller.command_interfaces(self._joint_names)
        claimed = required if loaded.state is State.ACTIVE else ()
        needed = loaded.controller.state_interfaces(self._joint_names)
        return ControllerInfo(name, loaded.controller.kind, loaded.state, required, claimed, needed)

    def _find(self, name: str) -> _Loaded:
        if name not in self._loaded:
            names = ", ".join(self._loaded) or "none"
            raise CommandRefused(f"There is no controller {name!r}; loaded are: {names}.")
        return self._loaded[name]

    def _check(self, name: str, transition: Transition) -> None:
        state = self._find(name).state
        if (state, transition) not in TRANSITIONS:
            choices = ", ".join(choice.value for choice in allowed(state)) or "nothing"
            raise CommandRefused(
                f"Controller {name!r} is {state.value} and cannot {transition.value}; it can {choices}."
            )

    def _check_claims(self, activate: Sequence[str], deactivate: Sequence[str]) -> None:
        owners: dict[str, str] = {}
        staying = [name for name, item in self._loaded.items() if item.state is State.ACTIVE and name not in deactivate]
        for name in [*staying, *activate]:
            for interface in self._find(name).controller.command_interfaces(self._joint_names):
                if interface in owners:
                    raise CommandRefused(
                        f"Controller {name!r} needs {interface}, which {owners[interface]!r} has claimed; "
                        f"deactivate {owners[interface]!r} in the same switch."
                    )
                owners[interface] = name

    def _state_to_begin(self, activate: Sequence[str], state: ArmState | None) -> ArmState:
        if state is not None and state.is_running:
            return state
        needy = [name for name in activate if self._find(name).controller.is_command]
        if needy:
            raise CommandRefused(
                f"Controller {needy[0]!r} cannot start: EGM is not running on this arm; start EGM first."
            )
        return state or _NOWHERE

    def _move(self, name: str, transition: Transition) -> None:
        loaded = self._find(name)
        loaded.state = TRANSITIONS[loaded.state, transition]
        active = [(key, item.controller) for key, item in self._loaded.items() if item.state is State.ACTIVE]
        self._active = tuple(active)
        self._commanding = tuple(pair for pair in active if pair[1].is_command)
        self._watching = tuple(controller for _, controller in active if not controller.is_command)

    def _fail(self, name: str, error: Exception) -> None:
        self.failures.append(
            f"Controller {name!r} failed with {type(error).__name__}: {error}; it was deactivated and the arm holds."
        )
        self._move(name, Transition.DEACTIVATE)


_NOWHERE = ArmState(0.0, 0.0, 0, (0.0,) * 7, (0.0,) * 7, (0.0,) * 7, is_running=False)
"""Given to controllers that only watch, when no state has come yet."""


def _accepted(name: str, loaded: _Loaded, key: str, value: object) -> Value:
    if key not in loaded.parameters:
        known = ", ".join(loaded.parameters) or "none"
        raise CommandRefused(f"Controller {name!r} has no parameter {key!r}; it has: {known}.")
    parameter = loaded.parameters[key]
    if parameter.read_only and loaded.state is not State.UNCONFIGURED:
        raise CommandRefused(
            f"Parameter {key!r} of controller {name!r} is settled; clean the controller up to change it."
        )
    try:
        return parameter.accept(value)
    except CommandRefused as refusal:
        raise CommandRefused(f"Parameter {key!r} of controller {name!r} {refusal}") from refusal
