"""Motors, program, speed ratio, I/O signals and RAPID variables of one controller, over Robot Web Services."""

from __future__ import annotations

import re
from math import isfinite

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, ControllerRefused, ProtocolError, RobotNotReady
from abb_protocols.rws import rapid_values
from abb_protocols.rws.values import ControllerState, ExecutionState
from abb_runtime.clock import Clock, wait_until
from abb_runtime.rws.client import RwsClient
from yumi.driver.readiness import ConditionalRequest, check_request
from yumi.driver.robot_state import RobotState

OBEY_TIMEOUT = 5.0
"""Longest wait for motors, program or state machines to obey [s]."""

RAPID_NAME = re.compile(r"[A-Za-z]\w{0,31}")
_SIGNAL_NAME = re.compile(r"[A-Za-z][\w/]{0,95}")
_BAD_VALUE, _FORBIDDEN, _UNKNOWN = 400, 403, 404  # status of HTTP
_LITERALS = {"bool": "TRUE", "string": '"text"', "num": "1.5", "dnum": "1.5"}


class ControllerPanel:
    """Motors, program, speed ratio, I/O signals and RAPID variables of one controller.

    Signals and variables are text in, text out, as a person gives and reads them.

    Args:
        client: a connected client.
        clock: for waiting.
    """

    def __init__(self, client: RwsClient, clock: Clock) -> None:
        self._client = client
        self._clock = clock

    @property
    def are_motors_on(self) -> bool:
        return self._client.controller_state() is ControllerState.MOTORS_ON

    @property
    def is_running(self) -> bool:
        """Whether the RAPID program runs."""
        return self._client.execution() is ExecutionState.RUNNING

    def state(self) -> RobotState:
        """Mode, motors and program, read now; nothing else of the state is known."""
        client = self._client
        return RobotState(True, client.operating_mode(), client.controller_state(), client.execution())

    def check_automatic(self) -> None:
        """See that requests which change something are accepted at all.

        Raises:
            RobotNotReady: the mode switch is not in AUTO.
        """
        check_request(ConditionalRequest.WRITE, RobotState(True, self._client.operating_mode()))

    def switch_motors_on(self) -> None:
        """Motors on, which also acknowledges an emergency stop that has been released.

        Raises:
            RobotNotReady: not in AUTO, or a stop keeps them off.
        """
        state = self.state()
        check_request(ConditionalRequest.BRING_UP, state)
        if state.controller_state is not ControllerState.MOTORS_ON:
            self._client.set_motors(True)
            wait_until(
                self._clock,
                lambda: self.are_motors_on,
                OBEY_TIMEOUT,
                lambda: message("motors_stay_off", state=self._client.controller_state().value),
            )

    def switch_motors_off(self) -> None:
        """Motors off; the brakes hold the arms and the program stops.

        Raises:
            RobotNotReady: they stay on.
        """
        if self.are_motors_on:
            self._client.set_motors(False)
            wait_until(self._clock, lambda: not self.are_motors_on, OBEY_TIMEOUT, message("motors_stay_on"))

    def start_rapid(self) -> None:
        """Start the program where its pointers are.

        Raises:
            RobotNotReady: not in AUTO, motors off, or it does not run.
        """
        state = self.state()
        check_request(ConditionalRequest.START_RAPID, state)
        if state.execution is not ExecutionState.RUNNING:
            self._client.start_rapid()
            self._wait_for(ExecutionState.RUNNING)

    def stop_rapid(self) -> None:
        """Stop the program; the arms come to rest on their paths.

        Raises:
            RobotNotReady: it still runs.
        """
        if self.is_running:
            self._client.stop_rapid()
            self._wait_for(ExecutionState.STOPPED)

    def move_pp_to_main(self) -> None:
        """Program pointers of all tasks to main; all variables get their initial values.

        Raises:
            RobotNotReady: not in AUTO, or the program runs.
        """
        check_request(ConditionalRequest.MOVE_PP, self.state())
        self._client.move_pp_to_main()

    def set_speed_ratio(self, percent: int) -> None:
        """Override of the speeds of RAPID motions, 0 to 100 %; it counts from the next motion on.

        Raises:
            CommandRefused: outside that range.
            RobotNotReady: not in AUTO, or the controller keeps another value.
        """
        self.check_automatic()
        self._client.set_speed_ratio(percent)
        kept = self._client.speed_ratio()
        if kept != percent:
            raise RobotNotReady(message("speed_ratio_not_kept", kept=kept, asked=percent))

    def _wait_for(self, state: ExecutionState) -> None:
        wait_until(
            self._clock,
            lambda: self._client.execution() is state,
            OBEY_TIMEOUT,
            message("program_does_not_obey", state=state.value, duration=OBEY_TIMEOUT),
        )

    def read_signal(self, name: str) -> str:
        """The logical value of an I/O signal; raises CommandRefused when the controller has no such signal."""
        return _signal_text(self._signal(name))

    def write_signal(self, name: str, value: str | float) -> None:
        """Set an I/O signal, and see that it keeps the value.

        Raises:
            CommandRefused: no such signal, or no such value; nothing was changed.
            RobotNotReady: not in AUTO, where this controller takes none.
            ControllerRefused: the controller does not let remote clients write it.
        """
        try:
            number = float(value)
        except ValueError as error:
            raise CommandRefused(message("no_number_for_signal", value=value, signal=name)) from error
        if not isfinite(number):
            raise CommandRefused(message("signal_not_finite", signal=name, value=number))
        self._signal(name)
        try:
            self._client.set_signal(name, number)
        except ControllerRefused as error:
            if error.status == _FORBIDDEN:
                self.check_automatic()  # what may be written in AUTO may be forbidden in manual
            if error.status != _BAD_VALUE:
                raise
            raise CommandRefused(message("signal_value_refused", value=_signal_text(number), signal=name)) from error
        kept = self._signal(name)
        if kept != number:
            raise CommandRefused(
                message("signal_not_kept", signal=name, kept=_signal_text(kept), written=_signal_text(number))
            )

    def _signal(self, name: str) -> float:
        if not _SIGNAL_NAME.fullmatch(name):
            raise CommandRefused(message("no_signal_name", name=name))
        try:
            return self._client.signal(name).value
        except ControllerRefused as error:
            if error.status != _UNKNOWN:
                raise
            raise CommandRefused(message("signal_unknown", signal=name)) from error

    def read_variable(self, task: str, module: str, name: str) -> str:
        """The value of a RAPID variable as RAPID writes it; raises CommandRefused when there is none of that name."""
        self._type_of(task, module, name)
        return self._client.symbol(task, module, name)

    def write_variable(self, task: str, module: str, name: str, value: str) -> None:
        """Write a RAPID variable; ``value`` as RAPID writes it: ``1.5``, ``TRUE``, ``"text"``, ``[1,[2,3]]``.

        Raises:
            CommandRefused: there is none of that name, ``value`` is not a RAPID value or not of its type, or it is a
                constant; nothing was changed.
            RobotNotReady: not in AUTO.
        """
        self.check_automatic()
        kind = self._type_of(task, module, name)
        example = _LITERALS.get(kind, "[1,[2,3]]")
        try:
            rapid_values.decode(value)
        except ProtocolError as error:
            raise CommandRefused(
                message(
                    "no_rapid_value", value=value, module=module, variable=name, task=task, kind=kind, example=example
                )
            ) from error
        try:
            self._client.set_symbol(task, module, name, value)
        except ControllerRefused as error:
            if error.status != _BAD_VALUE:
                raise
            raise CommandRefused(
                message(
                    "variable_refused", value=value, module=module, variable=name, task=task, kind=kind, example=example
                )
            ) from error

    def _type_of(self, task: str, module: str, name: str) -> str:
        for word in (task, module, name):
            if not RAPID_NAME.fullmatch(word):
                raise CommandRefused(message("no_rapid_name", name=word))
        try:
            return self._client.symbol_type(task, module, name)
        except ControllerRefused as error:
            raise CommandRefused(message("variable_unknown", module=module, variable=name, task=task)) from error


def _signal_text(value: float) -> str:
    return str(int(value)) if value.is_integer() else repr(value)
