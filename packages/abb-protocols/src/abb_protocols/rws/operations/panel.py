"""Operations on the panel (``/rw/panel``): motors, operating mode, speed, collision detection, restart."""

from __future__ import annotations

from abb_protocols.rws.documents import RwsState, member
from abb_protocols.rws.operations.operation import get, post
from abb_protocols.rws.operations.operation_answer import TEXT, WHOLE, Spelling, one_of, single
from abb_protocols.rws.values import CollisionState, ControllerState, Grant, OperatingMode

_MODE = "/rw/panel/opmode"


def _collision_state(state: RwsState, name: str) -> CollisionState:
    """The field's name has a blank at its end on some versions."""
    return member(CollisionState, {known.strip(): text for known, text in state.fields.items()}.get(name.strip(), ""))


_COLLISION = Spelling(_collision_state, lambda name, state: {name: state.value})

PANEL = get("/rw/panel")
RESTART = post("/rw/panel", "restart", "restart-mode=restart|istart|pstart|bstart", grant=Grant.REMOTE_WARMSTART)
SET_LANGUAGE = post("/rw/panel", "setlang", "lang-code", grant=Grant.CONTROLLER_PROPERTIES_WRITE)
CONTROLLER_STATE = get("/rw/panel/ctrlstate").shows(single("pnl-ctrlstate", "ctrlstate", one_of(ControllerState)))
OPERATING_MODE = get(_MODE).shows(single("pnl-opmode", "opmode", one_of(OperatingMode)))
SPEED_RATIO = get("/rw/panel/speedratio").shows(single("pnl-speedratio", "speedratio", WHOLE))
COLLISION_STATE = get("/rw/panel/coldetstate").shows(single("pnl-coldetstate", "coldetstate ", _COLLISION))
SET_CONTROLLER_STATE = post("/rw/panel/ctrlstate", "setctrlstate", "ctrl-state=motoron|motoroff")
SELECT_MODE = post(_MODE, None, "opmode=auto|man|manfs", status=403)
ACKNOWLEDGE = post(_MODE, "acknowledge", "opmode=auto|manf|coldet")
MODE_LOCK = get(_MODE, resource="lock-state").shows(single("pnl-opmode-lock", "lock-state", TEXT))
LOCK_MODE = post(_MODE, "lock", "pin, permanent=0|1")
UNLOCK_MODE = post(_MODE, "unlock", "pin")
SET_SPEED_RATIO = post("/rw/panel/speedratio", "setspeedratio", "speed-ratio", grant=Grant.SPEED_DECREASE)
