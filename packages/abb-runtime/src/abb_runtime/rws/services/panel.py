"""The client's service for the panel: motors, operating mode, speed, collision detection, restart of RobotWare."""

from __future__ import annotations

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.rws.operations import panel as table
from abb_protocols.rws.values import CollisionState, ControllerState, OperatingMode, RestartMode
from abb_runtime.rws.services.service import Service


class PanelService(Service):
    """``/rw/panel``."""

    def controller_state(self) -> ControllerState:
        """Motors on or off, or the stop that keeps them off."""
        return self._answer("reading the state of the motors", table.CONTROLLER_STATE)

    def set_motors(self, on: bool) -> None:
        """Switch the motors; they may need a moment after the call until ``controller_state`` says so."""
        state = ControllerState.MOTORS_ON if on else ControllerState.MOTORS_OFF
        self._call(f"switching the motors {'on' if on else 'off'}", table.SET_CONTROLLER_STATE, ctrl_state=state)

    def operating_mode(self) -> OperatingMode:
        """Position of the mode switch."""
        return self._answer("reading the operating mode", table.OPERATING_MODE)

    def collision_state(self) -> CollisionState:
        """State of the collision detection."""
        return self._answer("reading the collision state", table.COLLISION_STATE)

    def speed_ratio(self) -> int:
        """Override of all speeds [%]."""
        return self._answer("reading the speed ratio", table.SPEED_RATIO)

    def set_speed_ratio(self, percent: int) -> None:
        """Set the override of all speeds, 0 to 100 %.

        Raises:
            CommandRefused: outside that range.
        """
        if not 0 <= percent <= 100:
            raise CommandRefused(message("speed_ratio_out_of_range", percent=percent, lowest=0, highest=100))
        self._call(f"setting the speed ratio to {percent} %", table.SET_SPEED_RATIO, speed_ratio=percent)

    def restart(self, mode: RestartMode = RestartMode.WARM) -> None:
        """Restart: every connection and session ends, and the controller does not answer for some time."""
        self._call("restarting the controller", table.RESTART, restart_mode=mode)

    def acknowledge_operating_mode(self, mode: OperatingMode) -> None:
        """Confirm a change of the mode switch to AUTO or MANUAL_FULL, which waits for it."""
        name = {OperatingMode.AUTO: "auto", OperatingMode.MANUAL_FULL: "manf"}.get(mode)
        if name is None:
            raise CommandRefused(message("mode_needs_no_confirmation", mode=mode.value))
        self._call("confirming the operating mode", table.ACKNOWLEDGE, opmode=name)

    def acknowledge_collision(self) -> None:
        """Confirm that the collision detection was triggered, after a person has looked at the robot."""
        self._call("confirming the collision", table.ACKNOWLEDGE, opmode="coldet")

    def is_operating_mode_locked(self) -> bool:
        """Whether the mode switch is locked with a PIN."""
        return self._answer("reading the lock of the operating mode", table.MODE_LOCK) != "unlocked"

    def lock_operating_mode(self, pin: str, *, permanent: bool = False) -> None:
        """Lock the mode switch; ``permanent`` outlives a restart."""
        self._call("locking the operating mode", table.LOCK_MODE, pin=pin, permanent="1" if permanent else "0")

    def unlock_operating_mode(self, pin: str) -> None:
        """Unlock the mode switch."""
        self._call("unlocking the operating mode", table.UNLOCK_MODE, pin=pin)

    def set_language(self, code: str) -> None:
        """Language of the FlexPendant, such as ``en``."""
        self._call("setting the language", table.SET_LANGUAGE, lang_code=code)
