"""What a client may ask of Robot Web Services, as frozen values (reference/rws.md §4-12)."""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import quote

from yumi.rws import forms
from yumi.rws.forms import Pairs
from yumi.rws.states import ControllerState

_PATH_SAFE = "/;:$@-._~"


@dataclass(frozen=True, slots=True)
class Request:
    """One request, free of connection and session.

    Attributes:
        method: of HTTP.
        path: resource, unescaped.
        query: parameters in the URL.
        form: parameters in the body; None for a request without a body.
    """

    method: str
    path: str
    query: Pairs = ()
    form: Pairs | None = None

    @property
    def target(self) -> str:
        """Path and query as on the request line."""
        path = quote(self.path, safe=_PATH_SAFE)
        return f"{path}?{forms.encode(self.query)}" if self.query else path

    @property
    def body(self) -> bytes:
        """The form, encoded."""
        return forms.encode(self.form or ()).encode("ascii")

    @property
    def is_repeatable(self) -> bool:
        """Whether asking twice does no more than asking once."""
        return self.method == "GET"


def get(path: str, *query: tuple[str, str]) -> Request:
    """Read ``path``."""
    return Request("GET", path, query)


def post(path: str, action: str, *form: tuple[str, str]) -> Request:
    """Do ``action`` on ``path``."""
    return Request("POST", path, (("action", action),), form)


def get_system() -> Request:
    """Name, RobotWare version and options."""
    return get("/rw/system")


def get_controller_state() -> Request:
    return get("/rw/panel/ctrlstate")


def set_controller_state(state: ControllerState) -> Request:
    """Motors on or off; the controller accepts no other state."""
    return post("/rw/panel/ctrlstate", "setctrlstate", ("ctrl-state", state.value))


def get_operating_mode() -> Request:
    return get("/rw/panel/opmode")


def get_speed_ratio() -> Request:
    return get("/rw/panel/speedratio")


def set_speed_ratio(percent: int) -> Request:
    """Override of all speeds, 0 to 100 %."""
    return post("/rw/panel/speedratio", "setspeedratio", ("speed-ratio", str(percent)))


def get_execution() -> Request:
    return get("/rw/rapid/execution")


def start_rapid() -> Request:
    """Start from the program pointer, for ever, in the tasks selected on the task panel."""
    return post(
        "/rw/rapid/execution",
        "start",
        ("regain", "continue"),
        ("execmode", "continue"),
        ("cycle", "forever"),
        ("condition", "none"),
        ("stopatbp", "disabled"),
        ("alltaskbytsp", "false"),
    )


def stop_rapid() -> Request:
    return post("/rw/rapid/execution", "stop", ("stopmode", "stop"))


def move_pp_to_main() -> Request:
    return post("/rw/rapid/execution", "resetpp")


def get_tasks() -> Request:
    return get("/rw/rapid/tasks")


def get_modules(task: str) -> Request:
    return get("/rw/rapid/modules", ("task", task))


def get_symbol(task: str, module: str, name: str) -> Request:
    return get(f"/rw/rapid/symbol/data/RAPID/{task}/{module}/{name}")


def get_symbol_properties(task: str, module: str, name: str) -> Request:
    return get(f"/rw/rapid/symbol/properties/RAPID/{task}/{module}/{name}")


def set_symbol(task: str, module: str, name: str, literal: str) -> Request:
    """Write a symbol; ``literal`` is the RAPID text of the value."""
    return post(f"/rw/rapid/symbol/data/RAPID/{task}/{module}/{name}", "set", ("value", literal))


def get_signal(name: str) -> Request:
    return get(f"/rw/iosystem/signals/{name}")


def set_signal(name: str, value: float) -> Request:
    """Write a signal's logical value; whole numbers are written without decimals."""
    text = str(int(value)) if float(value).is_integer() else repr(value)
    return post(f"/rw/iosystem/signals/{name}", "set", ("lvalue", text))


def get_joint_target(unit: str) -> Request:
    return get(f"/rw/motionsystem/mechunits/{unit}/jointtarget")


def get_events(domain: int, limit: int, page: int = 1) -> Request:
    """The event log, newest first, in English; pages count from 1 and hold ``limit`` (up to 50) messages."""
    return get(
        f"/rw/elog/{domain}",
        ("lang", "en"),
        ("order", "lifo"),
        ("start", str(page)),
        ("limit", str(limit)),
    )


def log_out() -> Request:
    return get("/logout")
