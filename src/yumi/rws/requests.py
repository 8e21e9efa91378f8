"""What a client may ask of Robot Web Services, as frozen values (reference/rws.md §4-12)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote

from yumi.rws import forms
from yumi.rws.forms import Pairs
from yumi.rws.states import ControllerState
from yumi.rws.subscriptions import Resource, write_resources

_PATH_SAFE = "/;:$@-._~"


@dataclass(frozen=True, slots=True)
class Request:
    """One request, free of connection and session.

    Attributes:
        method: of HTTP.
        path: resource, unescaped.
        query: parameters in the URL.
        form: parameters in the body; None for a request without a body.
        content: a file in the body instead of a form.
    """

    method: str
    path: str
    query: Pairs = ()
    form: Pairs | None = None
    content: bytes | None = None

    @property
    def target(self) -> str:
        """Path and query as on the request line."""
        path = quote(self.path, safe=_PATH_SAFE)
        return f"{path}?{forms.encode(self.query)}" if self.query else path

    @property
    def body(self) -> bytes:
        """The file, or the form, encoded."""
        return forms.encode(self.form or ()).encode("ascii") if self.content is None else self.content

    @property
    def content_type(self) -> str | None:
        """What the body is; None for a request without one."""
        if self.content is not None:
            return "application/octet-stream"
        return None if self.form is None else forms.CONTENT_TYPE

    @property
    def is_repeatable(self) -> bool:
        """Whether asking twice does no more than asking once."""
        return self.method in ("GET", "PUT")


def get(path: str, *query: tuple[str, str]) -> Request:
    """Read ``path``."""
    return Request("GET", path, query)


def post(path: str, action: str, *form: tuple[str, str]) -> Request:
    """Do ``action`` on ``path``."""
    return Request("POST", path, (("action", action),), form)


def get_system() -> Request:
    """Name, RobotWare version and options."""
    return get("/rw/system")


def get_clock() -> Request:
    return get("/ctrl/clock")


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


def get_module_text(task: str, module: str) -> Request:
    return get(f"/rw/rapid/modules/{module}", ("resource", "module-text"), ("task", task))


def get_symbol(task: str, module: str, name: str) -> Request:
    return get(f"/rw/rapid/symbol/data/RAPID/{task}/{module}/{name}")


def get_symbol_properties(task: str, module: str, name: str) -> Request:
    return get(f"/rw/rapid/symbol/properties/RAPID/{task}/{module}/{name}")


def set_symbol(task: str, module: str, name: str, literal: str) -> Request:
    """Write a symbol; ``literal`` is the RAPID text of the value."""
    return post(f"/rw/rapid/symbol/data/RAPID/{task}/{module}/{name}", "set", ("value", literal))


def get_signal(name: str) -> Request:
    return get(f"/rw/iosystem/signals/{name}")


def get_signals(*query: tuple[str, str]) -> Request:
    """All signals, or the page of them that ``query`` names."""
    return get("/rw/iosystem/signals", *query)


def set_signal(name: str, value: float) -> Request:
    """Write a signal's logical value; whole numbers are written without decimals."""
    text = str(int(value)) if float(value).is_integer() else repr(value)
    return post(f"/rw/iosystem/signals/{name}", "set", ("lvalue", text))


def get_cfg(domain: str, type: str) -> Request:
    """All instances of a configuration type."""
    return get(f"/rw/cfg/{domain}/{type}/instances")


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


def clear_events(domain: int) -> Request:
    """Empty one event log; domain 0 holds all."""
    return post(f"/rw/elog/{domain}", "clear")


def restart() -> Request:
    """Warm restart: everybody is cut off, programs and configuration stay."""
    return post("/rw/panel", "restart", ("restart-mode", "restart"))


def get_mastership(domain: str) -> Request:
    return get(f"/rw/mastership/{domain}")


def request_mastership(domain: str) -> Request:
    """The right to change what ``domain`` stands for: ``cfg``, ``motion`` or ``rapid``."""
    return post(f"/rw/mastership/{domain}", "request")


def release_mastership(domain: str) -> Request:
    return post(f"/rw/mastership/{domain}", "release")


def load_module(task: str, path: str, *, replace: bool) -> Request:
    """Load a file such as ``HOME:/yumi/pick.mod`` as a module of ``task``."""
    place = f"/rw/rapid/tasks/{task}"
    return post(place, "loadmod", ("modulepath", path), ("replace", "true" if replace else "false"))


def unload_module(task: str, module: str) -> Request:
    return post(f"/rw/rapid/tasks/{task}", "unloadmod", ("module", module))


def get_file(path: str) -> Request:
    """The content of a file, or the list of a directory; ``path`` such as ``HOME:/yumi/pick.mod``."""
    return get(_file_service(path))


def put_file(path: str, content: bytes) -> Request:
    """Create a file, or replace its content."""
    return Request("PUT", _file_service(path), content=content)


def delete_file(path: str) -> Request:
    """Remove a file or a directory."""
    return Request("DELETE", _file_service(path))


def _file_service(path: str) -> str:
    """Where RAPID's ``HOME:/pick.mod`` is on the network; the device's name stands behind ``$`` there."""
    device, _, rest = path.partition(":")
    return f"/fileservice/${device.lower()}/{rest.lstrip('/')}"


def subscribe(resources: Sequence[Resource]) -> Request:
    """A new group of resources to be told about."""
    return Request("POST", "/subscription", form=write_resources(resources))


def unsubscribe(group: int) -> Request:
    return Request("DELETE", f"/subscription/{group}")


def log_out() -> Request:
    return get("/logout")
