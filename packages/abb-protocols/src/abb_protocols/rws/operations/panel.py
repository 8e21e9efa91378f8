"""Operations on the panel (``/rw/panel``) and their calls: motors, mode, speed, collision detection, restart."""

from __future__ import annotations

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.rws.documents import RwsState, member
from abb_protocols.rws.operations.operation import get, post
from abb_protocols.rws.operations.operation_answer import TEXT, WHOLE, Spelling, one_of, single
from abb_protocols.rws.operations.service import Service
from abb_protocols.rws.values import CollisionState, ControllerState, Grant, OperatingMode, RestartMode

_MODE = "/rw/panel/opmode"


def _collision_state(state: RwsState, name: str) -> CollisionState:
    """The field's name has a blank at its end on some versions."""
    return member(CollisionState, {known.strip(): text for known, text in state.fields.items()}.get(name.strip(), ""))


_COLLISION = Spelling(_collision_state, lambda name, state: {name: state.value})

PANEL = get("/rw/panel")
RESTART_BY_PANEL = post(
    "/rw/panel", "restart", "restart-mode=restart|istart|pstart|bstart", grant=Grant.REMOTE_WARMSTART
)
SET_PANEL_LANGUAGE = post("/rw/panel", "setlang", "lang-code", grant=Grant.CONTROLLER_PROPERTIES_WRITE)
CONTROLLER_STATE = get("/rw/panel/ctrlstate").shows(single("pnl-ctrlstate", "ctrlstate", one_of(ControllerState)))
OPERATING_MODE = get(_MODE).shows(single("pnl-opmode", "opmode", one_of(OperatingMode)))
SPEED_RATIO = get("/rw/panel/speedratio").shows(single("pnl-speedratio", "speedratio", WHOLE))
COLLISION_STATE = get("/rw/panel/coldetstate").shows(single("pnl-coldetstate", "coldetstate ", _COLLISION))
SET_CONTROLLER_STATE = post("/rw/panel/ctrlstate", "setctrlstate", "ctrl-state=motoron|motoroff")
SELECT_MODE = post(_MODE, None, "opmode=auto|man|manfs", status=403)
ACKNOWLEDGE_MODE = post(_MODE, "acknowledge", "opmode=auto|manf|coldet")
MODE_LOCK = get(_MODE, resource="lock-state").shows(single("pnl-opmode-lock", "lock-state", TEXT))
LOCK_MODE = post(_MODE, "lock", "pin, permanent=0|1")
UNLOCK_MODE = post(_MODE, "unlock", "pin")
SET_SPEED_RATIO = post("/rw/panel/speedratio", "setspeedratio", "speed-ratio", grant=Grant.SPEED_DECREASE)


class PanelService(Service):
    """``/rw/panel``."""

    def controller_state(self) -> ControllerState:
        """Motors on or off, or the stop that keeps them off."""
        return self._answer("reading the state of the motors", CONTROLLER_STATE)

    def set_motors(self, on: bool) -> None:
        """Switch the motors; they may need a moment after the call until ``controller_state`` says so."""
        state = ControllerState.MOTORS_ON if on else ControllerState.MOTORS_OFF
        self._call(f"switching the motors {'on' if on else 'off'}", SET_CONTROLLER_STATE, ctrl_state=state)

    def operating_mode(self) -> OperatingMode:
        """Position of the mode switch."""
        return self._answer("reading the operating mode", OPERATING_MODE)

    def collision_state(self) -> CollisionState:
        """State of the collision detection."""
        return self._answer("reading the collision state", COLLISION_STATE)

    def speed_ratio(self) -> int:
        """Override of all speeds [%]."""
        return self._answer("reading the speed ratio", SPEED_RATIO)

    def set_speed_ratio(self, percent: int) -> None:
        """Set the override of all speeds, 0 to 100 %.

        Raises:
            CommandRefused: outside that range.
        """
        if not 0 <= percent <= 100:
            raise CommandRefused(message("speed_ratio_out_of_range", percent=percent, lowest=0, highest=100))
        self._call(f"setting the speed ratio to {percent} %", SET_SPEED_RATIO, speed_ratio=percent)

    def restart(self, mode: RestartMode = RestartMode.WARM) -> None:
        """Restart: every connection and session ends, and the controller does not answer for some time."""
        self._call("restarting the controller", RESTART_BY_PANEL, restart_mode=mode)

    def acknowledge_operating_mode(self, mode: OperatingMode) -> None:
        """Confirm a change of the mode switch to AUTO or MANUAL_FULL, which waits for it."""
        name = {OperatingMode.AUTO: "auto", OperatingMode.MANUAL_FULL: "manf"}.get(mode)
        if name is None:
            raise CommandRefused(message("mode_needs_no_confirmation", mode=mode.value))
        self._call("confirming the operating mode", ACKNOWLEDGE_MODE, opmode=name)

    def acknowledge_collision(self) -> None:
        """Confirm that the collision detection was triggered, after a person has looked at the robot."""
        self._call("confirming the collision", ACKNOWLEDGE_MODE, opmode="coldet")

    def is_operating_mode_locked(self) -> bool:
        """Whether the mode switch is locked with a PIN."""
        return self._answer("reading the lock of the operating mode", MODE_LOCK) != "unlocked"

    def lock_operating_mode(self, pin: str, *, permanent: bool = False) -> None:
        """Lock the mode switch; ``permanent`` outlives a restart."""
        self._call("locking the operating mode", LOCK_MODE, pin=pin, permanent="1" if permanent else "0")

    def unlock_operating_mode(self, pin: str) -> None:
        """Unlock the mode switch."""
        self._call("unlocking the operating mode", UNLOCK_MODE, pin=pin)

    def set_language(self, code: str) -> None:
        """Language of the FlexPendant, such as ``en``."""
        self._call("setting the language", SET_PANEL_LANGUAGE, lang_code=code)
