"""The controller's cabinet over Robot Web Services: motors, program execution, speed ratio; what the pendant also does.

Each step looks first, says what forbids it, and waits for the state it asked for.
"""

from __future__ import annotations

from yumi.clock import Clock
from yumi.errors import RobotNotReady
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.waiting import wait_until
from yumi.rws.states import ControllerState, ExecutionState, OperatingMode

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
