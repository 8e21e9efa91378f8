"""``/rw/panel``: motors, operating mode, speed ratio (reference/rws.md §5)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from yumi.rws.documents import Page, State
from yumi.rws.types import Code
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.rws.operations import Call, Failure, Operation, entry, resource

VALUES: Mapping[str, Callable[[Irc5], str]] = {
    "ctrlstate": lambda controller: controller.controller_state.value,
    "opmode": lambda controller: controller.mode.value,
    "speedratio": lambda controller: str(controller.speed_ratio),
    "coldetstate": lambda controller: controller.collision_state.value,
}
"""What the panel shows, to read and to subscribe to."""

_RESTARTS = ("restart", "istart", "pstart", "bstart")


def get_panel(controller: Irc5, call: Call) -> Page:
    return resource("panel", "/rw/", "panel", *(entry(f"pnl-{name}-li", name, f"panel/{name}") for name in VALUES))


def get_value(controller: Irc5, call: Call) -> Page:
    name = call.path[-1]
    text = VALUES[name](controller)
    if name == "coldetstate":  # the other title and the trailing blank are ABB's
        state = State("pnl-coldetstate", "collisiondetectstate", {"coldetstate ": text})
    else:
        state = State(f"pnl-{name}", name, {name: text})
    return resource("panel", "/rw/panel/", name, state)


def set_controller_state(controller: Irc5, call: Call) -> None:
    controller.set_motors(call.required("ctrl-state") == "motoron")


def set_speed_ratio(controller: Irc5, call: Call) -> None:
    controller.set_speed_ratio(int(call.number("speed-ratio")))


def acknowledge(controller: Irc5, call: Call) -> None:
    what = call.required("opmode")
    if what != "coldet":
        raise Failure(403, Code.MODE_REJECT, f"{what} is acknowledged on the FlexPendant")
    controller.acknowledge_collision()


def restart(controller: Irc5, call: Call) -> None:
    mode = call.required("restart-mode")
    if mode != "restart":
        raise Failure(400, Code.NOTIMPL, f"the virtual controller does not support {mode}; use restart")
    controller.restart()


OPERATIONS = (
    Operation("GET", "/rw/panel", get_panel),
    Operation("POST", "/rw/panel", restart, "restart", {"restart-mode": _RESTARTS}),
    *(Operation("GET", f"/rw/panel/{name}", get_value) for name in VALUES),
    Operation(
        "POST",
        "/rw/panel/ctrlstate",
        set_controller_state,
        "setctrlstate",
        {"ctrl-state": ("motoron", "motoroff")},
    ),
    Operation("POST", "/rw/panel/opmode", acknowledge, "acknowledge"),
    Operation("POST", "/rw/panel/speedratio", set_speed_ratio, "setspeedratio"),
)
