"""One controller of one arm, from load to unload: its lifecycle and parameters."""

from __future__ import annotations

from sys import intern

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ArmState
from abb_runtime.parameters import Values
from yumi.control.controller import (
    TRANSITIONS,
    Controller,
    State,
    Transition,
    allowed_transitions,
    find_controller_parameter,
)
from yumi.control.controller_info import ControllerInfo, ParameterInfo
from yumi.control.stage_times import RunningStatistics


class LoadedController:
    """One controller of one arm, from load to unload.

    Attributes:
        name: its name.
        controller: what it is.
        state: its lifecycle state.
        required: the command interfaces it claims when active, known once it is configured.
        required_state: the state interfaces it needs when active, known once it is configured.
        execution_time: how long its updates took since it was activated last [s].

    Args:
        joint_names: the arm's joints, chain order.
    """

    def __init__(self, name: str, controller: Controller, joint_names: tuple[str, ...]) -> None:
        self.name = name
        self.controller = controller
        self.state = State.UNCONFIGURED
        self.required: tuple[str, ...] = ()
        self.required_state: tuple[str, ...] = ()
        self.execution_time = RunningStatistics()
        self._joint_names = joint_names
        self._parameters = {parameter.name: parameter for parameter in controller.parameters(joint_names)}
        self._values: Values = {key: parameter.default for key, parameter in self._parameters.items()}

    def configure(self) -> None:
        """Give the controller its parameters and become inactive; an inactive one is cleaned up first.

        Raises:
            CommandRefused: wrong state, nothing was changed; or the controller or its interfaces do not go with the
                values, then it is unconfigured.
        """
        if self.state is not State.INACTIVE:
            self.check(Transition.CONFIGURE)
        self.clean_up()
        self.controller.configure(self._values)
        # The interfaces may depend on the parameters, so they are asked for afterwards.
        required = _interned(self.controller.command_interfaces(self._joint_names))
        required_state = _interned(self.controller.state_interfaces(self._joint_names))
        for interfaces in (required, required_state):
            twice = next((name for name in interfaces if interfaces.count(name) > 1), None)
            if twice:
                raise CommandRefused(message("interface_named_twice", controller=self.name, interface=twice))
        self.required, self.required_state = required, required_state
        self.state = State.INACTIVE

    def set_parameters(self, values: Values) -> None:
        """Change parameters, all or none; an active controller uses them from the next cycle on.

        Raises:
            CommandRefused: unknown parameter, value not allowed, or it is settled by now; nothing was changed.
        """
        is_settled = self.state is not State.UNCONFIGURED
        complete = self._complete(values, is_settled=is_settled)
        if is_settled:
            self.controller.configure(complete)
        self._values = complete

    def clean_up(self) -> None:
        """Become unconfigured; nothing when it is so already.

        Raises:
            CommandRefused: it is active.
        """
        if self.state is State.UNCONFIGURED:
            return
        self.check(Transition.CLEANUP)
        self.state = TRANSITIONS[self.state, Transition.CLEANUP]
        self.required = self.required_state = ()
        self.controller.clean_up()

    def activate(self, state: ArmState) -> None:
        """Begin from ``state``; whatever the controller raises is passed on, and it stays inactive."""
        self.execution_time.reset()
        self.controller.activate(state)
        self.state = State.ACTIVE

    def deactivate(self) -> None:
        """End; inactive even when the controller raises, which is passed on."""
        self.state = State.INACTIVE
        self.controller.deactivate()

    def check(self, transition: Transition) -> None:
        """Whether it may make a transition.

        Raises:
            CommandRefused: it may not; the sentence says what it may.
        """
        if (self.state, transition) not in TRANSITIONS:
            raise CommandRefused(
                message(
                    "transition_not_allowed",
                    controller=self.name,
                    state=self.state.value,
                    transition=transition.value,
                    allowed=tuple(choice.value for choice in allowed_transitions(self.state)),
                )
            )

    def check_command(self, command: object, state: ArmState | None) -> None:
        """Whether it would take a command now.

        Raises:
            CommandRefused: it is not active, or it refuses.
        """
        if self.state is not State.ACTIVE:
            raise CommandRefused(message("controller_not_active", controller=self.name, state=self.state.value))
        self.controller.check(command, state)

    def parameters(self) -> tuple[ParameterInfo, ...]:
        """What can be set and what is set."""
        return tuple(ParameterInfo(parameter, self._values[key]) for key, parameter in self._parameters.items())

    def info(self) -> ControllerInfo:
        """The controller as the outside sees it."""
        return ControllerInfo(
            name=self.name,
            kind=self.controller.kind,
            state=self.state,
            required=self.required,
            claimed=self.required if self.state is State.ACTIVE else (),
            required_state=self.required_state,
            execution_time=self.execution_time.result(),
        )

    def _complete(self, values: Values, *, is_settled: bool) -> Values:
        complete = dict(self._values)
        for key, value in values.items():
            parameter = find_controller_parameter(self._parameters.values(), key)
            if parameter is None:
                known = tuple(each.name for each in self._parameters.values() if not each.fixed)
                raise CommandRefused(
                    message("controller_parameter_unknown", controller=self.name, parameter=key, parameters=known)
                )
            if parameter.fixed:
                continue
            try:
                accepted = parameter.accept(value)
            except CommandRefused as refusal:
                raise CommandRefused(
                    message("controller_parameter_refused", controller=self.name, parameter=key, reason=refusal.said)
                ) from refusal
            if is_settled and parameter.read_only and accepted != self._values[key]:
                raise CommandRefused(
                    message(
                        "controller_parameter_settled",
                        controller=self.name,
                        parameter=key,
                        state=self.state.value,
                    )
                )
            complete[key] = accepted
        return complete


def _interned(names: tuple[str, ...]) -> tuple[str, ...]:
    """The same names as one object each, which halves the time it takes to send lists of them."""
    return tuple(map(intern, names))
