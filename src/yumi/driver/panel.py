"""The controller's cabinet over Robot Web Services: motors, program execution, speed ratio; what the pendant also does.

Each step looks first, says what forbids it, and waits for the state it asked for.

I/O signals and RAPID variables by name, as a person gives and reads them: text in, text out.
"""

from __future__ import annotations

import re
from math import isfinite

from yumi.clock import Clock, wait_until
from yumi.errors import CommandRefused, ControllerRefused, ProtocolError, RobotNotReady
from yumi.rws import types as rapid_values
from yumi.rws.client import RwsClient
from yumi.rws.types import ControllerState, ExecutionState, OperatingMode

DEADLINE = 5.0
"""Longest wait for motors or program to obey [s]."""

STOPPED_FOR_GOOD = {
    ControllerState.EMERGENCY_STOP: "an emergency stop is pressed; release it where it was pressed",
    ControllerState.GUARD_STOP: "a guard stop is active; close the guard, or press motors on at the controller",
    ControllerState.SYSTEM_FAILURE: "the controller is in system failure; restart it",
}
"""States that no request ends, and what does."""


class Cabinet:
    """Switches and buttons of one controller.

    Args:
        client: a connected client.
        clock: where waiting time comes from.
    """

    def __init__(self, client: RwsClient, clock: Clock) -> None:
        self._client = client
        self._clock = clock

    @property
    def are_motors_on(self) -> bool:
        return self._client.controller_state() is ControllerState.MOTORS_ON

    @property
    def is_running(self) -> bool:
        """Whether RAPID runs."""
        return self._client.execution() is ExecutionState.RUNNING

    def check_automatic(self) -> None:
        """See that requests are accepted at all.

        Raises:
            RobotNotReady: the mode switch is not in AUTO.
        """
        mode = self._client.operating_mode()
        if mode is not OperatingMode.AUTO:
            raise RobotNotReady(f"The controller is in {mode.value}; turn it to AUTO on the pendant, nothing else can.")

    def switch_motors_on(self) -> None:
        """Motors on, which also acknowledges an emergency stop that has been released.

        Raises:
            RobotNotReady: not in AUTO, or a stop keeps them off.
        """
        self.check_automatic()
        state = self._client.controller_state()
        if state in STOPPED_FOR_GOOD:
            raise RobotNotReady(
                f"Motors do not go on, the controller is in {state.value!r}: {STOPPED_FOR_GOOD[state]}."
            )
        if state is ControllerState.MOTORS_ON:
            return
        self._client.set_motors(True)
        wait_until(
            self._clock,
            lambda: self.are_motors_on,
            DEADLINE,
            lambda: (
                f"Motors do not go on, the controller is in {self._client.controller_state().value!r}; "
                "release the emergency stop and acknowledge it on the pendant."
            ),
        )

    def switch_motors_off(self) -> None:
        """Motors off; the brakes hold the arms and the program stops.

        Raises:
            RobotNotReady: they stay on.
        """
        if not self.are_motors_on:
            return
        self._client.set_motors(False)
        wait_until(
            self._clock, lambda: not self.are_motors_on, DEADLINE, lambda: "Motors do not go off; use the stop button."
        )

    def start_rapid(self) -> None:
        """Start the program where its pointers are.

        Raises:
            RobotNotReady: not in AUTO, motors off, or it does not run.
        """
        self.check_automatic()
        if self.is_running:
            return
        if not self.are_motors_on:
            raise RobotNotReady("The motors are off, the RAPID program cannot start; switch the motors on first.")
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
        """Program pointers of all tasks to main; all variables begin anew.

        Raises:
            RobotNotReady: not in AUTO, or the program runs.
        """
        self.check_automatic()
        if self.is_running:
            raise RobotNotReady("The RAPID program runs, its pointer cannot be moved; stop it first.")
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
            raise RobotNotReady(f"The controller keeps a speed ratio of {kept} %, not {percent} %; see the pendant.")

    def _wait_for(self, wanted: ExecutionState) -> None:
        wait_until(
            self._clock,
            lambda: self._client.execution() is wanted,
            DEADLINE,
            lambda: f"The RAPID program is not {wanted.value} after 5 s; look at the event log on the pendant.",
        )


_NAME = re.compile(r"[A-Za-z]\w{0,31}")
_SIGNAL = re.compile(r"[A-Za-z][\w/]{0,95}")
_BAD_VALUE, _FORBIDDEN, _UNKNOWN = 400, 403, 404


class ControllerData:
    """Signals and variables of one controller.

    Args:
        client: a connected client.
        cabinet: says whether requests are accepted.
    """

    def __init__(self, client: RwsClient, cabinet: Cabinet) -> None:
        self._client = client
        self._cabinet = cabinet

    def read_signal(self, name: str) -> str:
        """The logical value of an I/O signal.

        Raises:
            CommandRefused: the controller has no such signal.
        """
        return _number(self._signal(name))

    def write_signal(self, name: str, value: str | float) -> None:
        """Set an I/O signal, and see that it keeps the value.

        Raises:
            CommandRefused: no such signal, or no such value; nothing was changed.
            RobotNotReady: not in AUTO, where this controller takes none.
            ControllerRefused: the controller does not let remote clients write it.
        """
        wanted = _checked_number(name, value)
        self._signal(name)
        self._set_signal(name, wanted)
        kept = self._signal(name)
        if kept != wanted:
            raise CommandRefused(
                f"Signal {name} is {_number(kept)} after {_number(wanted)} was written; see who sets it."
            )

    def read_variable(self, task: str, module: str, name: str) -> str:
        """The value of a RAPID variable as RAPID writes it.

        Raises:
            CommandRefused: there is none of that name.
        """
        self._type_of(task, module, name)
        return self._client.symbol(task, module, name)

    def write_variable(self, task: str, module: str, name: str, value: str) -> None:
        """Write a RAPID variable.

        Args:
            task: as ``T_ROB_R``.
            module: that declares it.
            name: its name.
            value: as RAPID writes it: ``1.5``, ``TRUE``, ``"text"``, ``[1,[2,3]]``.

        Raises:
            CommandRefused: there is none of that name, ``value`` is no RAPID value or not of its type, or it is a
                constant; nothing was changed.
            RobotNotReady: not in AUTO.
        """
        self._cabinet.check_automatic()
        kind = self._type_of(task, module, name)
        try:
            rapid_values.decode(value)
        except ProtocolError as error:
            raise CommandRefused(
                f"{value!r} is no RAPID value; {module}/{name} of {task} takes a {kind}, such as {_example(kind)}."
            ) from error
        try:
            self._client.set_symbol(task, module, name, value)
        except ControllerRefused as error:
            if error.status != _BAD_VALUE:
                raise
            raise CommandRefused(
                f"The controller does not take {value} for {module}/{name} of {task}: it is a {kind}, such as "
                f"{_example(kind)}, or a constant, which cannot be written."
            ) from error

    def _set_signal(self, name: str, value: float) -> None:
        try:
            self._client.set_signal(name, value)
        except ControllerRefused as error:
            if error.status == _FORBIDDEN:
                self._cabinet.check_automatic()  # what may be written in AUTO may be forbidden in manual
            if error.status != _BAD_VALUE:
                raise
            raise CommandRefused(
                f"The controller does not take {_number(value)} for signal {name}; a digital signal is 0 or 1, another "
                "one has the range of its configuration."
            ) from error

    def _signal(self, name: str) -> float:
        if not _SIGNAL.fullmatch(name):
            raise CommandRefused(f"{name!r} is no name of a signal; give one of the controller's I/O signals.")
        try:
            return self._client.signal(name).value
        except ControllerRefused as error:
            if error.status != _UNKNOWN:
                raise
            raise CommandRefused(f"The controller has no signal {name}; look at its list of I/O signals.") from error

    def _type_of(self, task: str, module: str, name: str) -> str:
        for word in (task, module, name):
            if not _NAME.fullmatch(word):
                raise CommandRefused(f"{word!r} is no RAPID name; give task, module and variable.")
        try:
            return self._client.symbol_type(task, module, name)
        except ControllerRefused as error:
            raise CommandRefused(f"The controller has no {module}/{name} in task {task}; check the names.") from error


def _checked_number(name: str, value: str | float) -> float:
    try:
        number = float(value)
    except ValueError as error:
        raise CommandRefused(f"{value!r} is no value for signal {name}; give a number.") from error
    if not isfinite(number):
        raise CommandRefused(f"Signal {name} cannot be {number}; give a finite number.")
    return number


def _number(value: float) -> str:
    return str(int(value)) if value.is_integer() else repr(value)


def _example(kind: str) -> str:
    return {"bool": "TRUE", "string": '"text"', "num": "1.5", "dnum": "1.5"}.get(kind, "[1,[2,3]]")
