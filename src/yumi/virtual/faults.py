"""What can happen to the virtual robot that nobody asked for over the network, for tests and for showing recovery."""

from __future__ import annotations

from yumi.robot.joints import Side
from yumi.rws.states import OperatingMode
from yumi.virtual.irc5 import Irc5


class Faults:
    """Hands and accidents at the cabinet.

    Args:
        controller: the controller they happen to.
    """

    def __init__(self, controller: Irc5) -> None:
        self._controller = controller

    def press_emergency_stop(self) -> None:
        """The brakes stop the arms, RAPID stops."""
        self._controller.press_emergency_stop()

    def release_emergency_stop(self) -> None:
        """Motors can be switched on again."""
        self._controller.release_emergency_stop()

    def switch_motors_off(self) -> None:
        """Someone presses motors off."""
        self._controller.set_motors(False)

    def stop_program(self) -> None:
        """Someone presses stop on the FlexPendant."""
        self._controller.stop_rapid()

    def select_manual_mode(self) -> None:
        """Someone turns the key to manual reduced speed."""
        self._controller.select_mode(OperatingMode.MANUAL_REDUCED)

    def select_automatic_mode(self) -> None:
        """Someone turns the key back to automatic and confirms it."""
        self._controller.select_mode(OperatingMode.AUTO)

    def overload(self, side: Side) -> None:
        """An arm that EGM guides is asked for more torque than it has."""
        self._controller.overload(side)

    def collide(self, side: Side) -> None:
        """An arm runs into something."""
        self._controller.collide(side)
