"""The vacuum modules of one hand: commands through the state machine, state from the hand's own signals."""

from __future__ import annotations

from collections.abc import Callable

from yumi.clock import Clock
from yumi.errors import CommandRefused, RobotNotReady
from yumi.hardware.gripper_routines import GripperRoutines
from yumi.hardware.hand_io import HandIo
from yumi.hardware.state_machine import SgCommand
from yumi.robot.gripper import ATMOSPHERE
from yumi.robot.hand import CupReading, pressure_of

CHANNELS = (1, 2)

_MOMENT = 1.0  # [s] for the hand to switch
_GLANCE = 0.05  # [s]
_VENTED = 0.95 * ATMOSPHERE

_COMMANDS = {
    ("Vacuum", 1, True): SgCommand.VACUUM_ON_1,
    ("Vacuum", 2, True): SgCommand.VACUUM_ON_2,
    ("Vacuum", 1, False): SgCommand.VACUUM_OFF_1,
    ("Vacuum", 2, False): SgCommand.VACUUM_OFF_2,
    ("Blowoff", 1, True): SgCommand.BLOW_ON_1,
    ("Blowoff", 2, True): SgCommand.BLOW_ON_2,
    ("Blowoff", 1, False): SgCommand.BLOW_OFF_1,
    ("Blowoff", 2, False): SgCommand.BLOW_OFF_2,
}


class Vacuum:
    """The vacuum modules of one hand, by their numbers 1 and 2.

    All methods raise CommandRefused where the hand has no such module.

    Args:
        io: the hand's signals.
        routines: shared by both hands.
        clock: where waiting time comes from.
        timeout: a command that was not taken after this time has failed [s].
    """

    def __init__(self, io: HandIo, routines: GripperRoutines, clock: Clock, timeout: float) -> None:
        self._io = io
        self._routines = routines
        self._clock = clock
        self._timeout = timeout

    def check(self, channel: int) -> None:
        """Refuse what the hand does not have.

        Raises:
            CommandRefused: the hand has no such module.
        """
        if channel not in CHANNELS:
            raise CommandRefused(f"A gripper has vacuum 1 and 2 at most, not {channel}.")
        channels = self._io.modules.vacuum_channels
        if channel in channels:
            return
        side = self._io.side.word
        has = f"vacuum {channels[0]} only" if channels else "no vacuum"
        raise CommandRefused(
            f"The {side} gripper has {has}: it is configured as {self._io.modules.value}. If it has vacuum {channel}, "
            f"set gripper.{side} in yumi.yaml."
        )

    def switch(self, channel: int, *, is_on: bool) -> None:
        """Switch the vacuum of a module; its blow-off ends.

        Raises:
            RobotNotReady: the gripper is not calibrated, or did not obey.
        """
        self._switch("Vacuum", channel, is_on)

    def blow(self, channel: int, *, is_on: bool) -> None:
        """Switch the blow-off of a module; its vacuum ends.

        Raises:
            RobotNotReady: the gripper is not calibrated, or did not obey.
        """
        self._switch("Blowoff", channel, is_on)

    def reading(self, channel: int) -> CupReading:
        """A module as it is now."""
        self.check(channel)
        return CupReading(
            sucks=self._io.value(f"hand_StatusVacuum{channel}") != 0,
            blows=self._io.value(f"hand_StatusBlowoff{channel}") != 0,
            pressure=pressure_of(self._io.value(f"hand_ActualPressure{channel}")),
        )

    def wait_until_picked(self, channel: int, threshold: float, timeout: float) -> bool:
        """Wait until the pressure shows that something closes the cup; whether it does.

        Args:
            channel: which module.
            threshold: the pressure at which it does [Pa].
            timeout: longest wait [s].
        """
        return self._becomes(lambda: self.reading(channel).has_picked(threshold), timeout)

    def drop(self, channel: int) -> None:
        """Blow off what is held: blow until the cup is vented, but no longer than a second.

        Raises:
            RobotNotReady: the gripper is not calibrated, or did not obey.
        """
        self.blow(channel, is_on=True)
        self._becomes(lambda: self.reading(channel).pressure >= _VENTED, _MOMENT)
        self.blow(channel, is_on=False)

    def _switch(self, kind: str, channel: int, is_on: bool) -> None:
        self.check(channel)
        side = self._io.side
        if self._io.ask("hand_StatusCalibrated") == 0:  # the robot's routine would do nothing
            raise RobotNotReady(f"The {side.word} gripper is not calibrated; calibrate it first.")
        self._routines.run(side, _COMMANDS[kind, channel, is_on], self._timeout)
        if not self._becomes(lambda: (self._io.ask(f"hand_Status{kind}{channel}") != 0) is is_on, _MOMENT):
            word = "vacuum" if kind == "Vacuum" else "blow-off"
            raise RobotNotReady(
                f"The {side.word} gripper did not switch {word} {channel} {'on' if is_on else 'off'}; check that the "
                "module is there and look at the event log."
            )

    def _becomes(self, is_so: Callable[[], bool], timeout: float) -> bool:
        end = self._clock.now() + timeout
        while not is_so():
            if self._clock.now() >= end:
                return False
            self._clock.wait(_GLANCE)
        return True
