"""The panel: motors, operating mode, speed, collision detection, restart."""

from __future__ import annotations

from yumi.rws.operations.operation import get, post
from yumi.rws.types import Grant

_MODE = "/rw/panel/opmode"

PANEL = get("/rw/panel")
RESTART = post("/rw/panel", "restart", "restart-mode=restart|istart|pstart|bstart", grant=Grant.REMOTE_WARMSTART)
SET_LANGUAGE = post("/rw/panel", "setlang", "lang-code", grant=Grant.CONTROLLER_PROPERTIES_WRITE)
CONTROLLER_STATE = get("/rw/panel/ctrlstate")
OPERATING_MODE = get(_MODE)
SPEED_RATIO = get("/rw/panel/speedratio")
COLLISION_STATE = get("/rw/panel/coldetstate")
SET_CONTROLLER_STATE = post("/rw/panel/ctrlstate", "setctrlstate", "ctrl-state=motoron|motoroff")
SELECT_MODE = post(_MODE, None, "opmode=auto|man|manfs", status=403)
ACKNOWLEDGE = post(_MODE, "acknowledge", "opmode=auto|manf|coldet")
MODE_LOCK = get(_MODE, resource="lock-state")
LOCK_MODE = post(_MODE, "lock", "pin, permanent=0|1")
UNLOCK_MODE = post(_MODE, "unlock", "pin")
SET_SPEED_RATIO = post("/rw/panel/speedratio", "setspeedratio", "speed-ratio", grant=Grant.SPEED_DECREASE)
