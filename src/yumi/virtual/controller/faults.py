"""What can happen to the virtual robot that nobody asked for over the network, for tests and for showing recovery."""

from __future__ import annotations

from yumi.errors import CommandRefused
from yumi.rws.types import ControllerState, OperatingMode
from yumi.virtual.controller.controller import Irc5


class Faults:
    """Hands and accidents at the cabinet; what would change nothing is refused with CommandRefused.

    Args:
        controller: the controller they happen to.
    """

    def __init__(self, controller: Irc5) -> None:
        self._controller = controller

    def press_emergency_stop(self) -> None:
        """The brakes stop the arms, RAPID stops."""
        if self._controller.controller_state is ControllerState.EMERGENCY_STOP:
            raise CommandRefused("The emergency stop is pressed already; emergency-stop-reset releases it.")
        self._controller.press_emergency_stop()

    def release_emergency_stop(self) -> None:
        """Motors can be switched on again."""
        if self._controller.controller_state is not ControllerState.EMERGENCY_STOP:
            raise CommandRefused("The emergency stop is not pressed; there is nothing to reset.")
        self._controller.release_emergency_stop()

    def switch_motors_off(self) -> None:
        """Someone presses motors off."""
        if self._controller.controller_state is not ControllerState.MOTORS_ON:
            raise CommandRefused("The motors are off already.")
        self._controller.set_motors(False)

    def stop_program(self) -> None:
        """Someone presses stop on the FlexPendant."""
        if not self._controller.is_running:
            raise CommandRefused("No RAPID program runs; there is nothing to stop.")
        self._controller.stop_rapid()

    def select_manual_mode(self) -> None:
        """Someone turns the key to manual reduced speed."""
        self._select(OperatingMode.MANUAL_REDUCED)

    def select_automatic_mode(self) -> None:
        """Someone turns the key back and confirms it."""
        self._select(OperatingMode.AUTO)

    def _select(self, mode: OperatingMode) -> None:
        if self._controller.mode is mode:
            raise CommandRefused(f"The key stands at {mode.value} already.")
        self._controller.select_mode(mode)

    def load_wrong_program(self) -> None:
        """Someone loads a program of their own into both tasks and puts the program pointers on its main."""
        self._controller.replace_program({_WRONG_FILE: _WRONG_PROGRAM})

    def load_right_program(self) -> None:
        """The program of the configuration is in both tasks again, the program pointers on its main."""
        self._controller.replace_program({})


_WRONG_FILE = "HOME:/Pick.mod"
_WRONG_PROGRAM = """MODULE Pick
    PROC main()
        WHILE TRUE DO
            WaitTime 1;
        ENDWHILE
    ENDPROC
ENDMODULE
"""
