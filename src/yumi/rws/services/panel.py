"""The panel: motors, operating mode, speed, collision detection, restart."""

from __future__ import annotations

from enum import Enum

from yumi.errors import CommandRefused
from yumi.rws import replies
from yumi.rws.services.requests import Requests, get, given, post
from yumi.rws.types import CollisionState, ControllerState, OperatingMode


class RestartMode(Enum):
    """What a restart keeps."""

    WARM = "restart"
    """All: programs and configuration; a changed configuration takes effect."""
    RESET_SYSTEM = "istart"
    """Nothing: the system becomes as it was installed."""
    RESET_RAPID = "pstart"
    """The configuration; programs are removed."""
    LAST_SAVED = "bstart"
    """The state of the last good shutdown."""


class Panel(Requests):
    """``/rw/panel``."""

    def controller_state(self) -> ControllerState:
        """Motors on or off, or the stop that keeps them off."""
        return self._read(get("/rw/panel/ctrlstate"), replies.controller_state, "reading the state of the motors")

    def set_motors(self, on: bool) -> None:
        """Switch the motors; they may need a moment after the call until ``controller_state`` says so."""
        state = ControllerState.MOTORS_ON if on else ControllerState.MOTORS_OFF
        self._do(
            post("/rw/panel/ctrlstate", "setctrlstate", ("ctrl-state", state.value)),
            f"switching the motors {'on' if on else 'off'}",
        )

    def operating_mode(self) -> OperatingMode:
        """Position of the mode switch."""
        return self._read(get("/rw/panel/opmode"), replies.operating_mode, "reading the operating mode")

    def collision_state(self) -> CollisionState:
        """State of the collision detection."""
        return self._read(get("/rw/panel/coldetstate"), replies.collision_state, "reading the collision state")

    def speed_ratio(self) -> int:
        """Override of all speeds [%]."""
        return self._read(get("/rw/panel/speedratio"), replies.speed_ratio, "reading the speed ratio")

    def set_speed_ratio(self, percent: int) -> None:
        """Set the override of all speeds, 0 to 100 %.

        Raises:
            CommandRefused: outside that range.
        """
        if not 0 <= percent <= 100:
            raise CommandRefused(f"A speed ratio of {percent} % is not possible; give 0 to 100.")
        self._do(
            post("/rw/panel/speedratio", "setspeedratio", ("speed-ratio", str(percent))),
            f"setting the speed ratio to {percent} %",
        )

    def restart(self, mode: RestartMode = RestartMode.WARM) -> None:
        """Restart: every connection and session ends, and the controller does not answer for some time."""
        self._do(post("/rw/panel", "restart", ("restart-mode", mode.value)), "restarting the controller")

    def acknowledge_operating_mode(self, mode: OperatingMode) -> None:
        """Confirm a change of the mode switch to AUTO or MANUAL_FULL, which waits for it."""
        name = {OperatingMode.AUTO: "auto", OperatingMode.MANUAL_FULL: "manf"}.get(mode)
        if name is None:
            raise CommandRefused(f"A change to {mode.value} needs no confirmation; AUTO and MANF do.")
        self._do(post("/rw/panel/opmode", "acknowledge", ("opmode", name)), "confirming the operating mode")

    def acknowledge_collision(self) -> None:
        """Confirm that the collision detection was triggered, after a person has looked at the robot."""
        self._do(post("/rw/panel/opmode", "acknowledge", ("opmode", "coldet")), "confirming the collision")

    def is_operating_mode_locked(self) -> bool:
        """Whether the mode switch is locked with a PIN."""
        what = "reading the lock of the operating mode"
        state = self._state(what, "/rw/panel/opmode", "pnl-opmode-lock", ("resource", "lock-state"))
        return state.text("lock-state") != "unlocked"

    def lock_operating_mode(self, pin: str, *, permanent: bool = False) -> None:
        """Lock the mode switch; ``permanent`` outlives a restart."""
        form = (("pin", pin), ("permanent", "1" if permanent else "0"))
        self._do(post("/rw/panel/opmode", "lock", *form), "locking the operating mode")

    def unlock_operating_mode(self, pin: str) -> None:
        """Unlock the mode switch."""
        self._do(post("/rw/panel/opmode", "unlock", ("pin", pin)), "unlocking the operating mode")

    def set_language(self, code: str) -> None:
        """Language of the FlexPendant, such as ``en``."""
        self._do(post("/rw/panel", "setlang", *given(lang_code=code)), "setting the language")
