"""The controller and its state: ``/``, ``/rw/system``, ``/rw/retcode``, ``/rw/devices``, ``/rw/panel``, ``/rw/elog``.

Services, RobotWare, options and codes (reference/rws.md §4); motors, operating mode and speed ratio (§5); the event log
(§12).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from datetime import datetime, timezone

from yumi.rws.documents import Argument, Form, Link, Page, State
from yumi.rws.types import Code, Grant, OperatingMode, sentence
from yumi.virtual.controller.irc5 import Irc5
from yumi.virtual.controller_log import Event
from yumi.virtual.rws import ctrl
from yumi.virtual.rws.configuration import path_of_file
from yumi.virtual.rws.http import HttpReply, entry, resource
from yumi.virtual.rws.operations import Call, Failure, Operation, Values, invalid, not_there

_ROOT_SERVICES = ("ctrl", "rw", "progress", "fileservice", "users", "subscription")

_RW_SERVICES = (
    "cfg",
    "devices",
    "dipc",
    "elog",
    "iosystem",
    "mastership",
    "motionsystem",
    "panel",
    "rapid",
    "retcode",
    "system",
)

_BUILD, _BUILT = "1031", "2020-01-01"  # what RobotWare says of its build; clients show it
_NO_VISION = "integrated vision"

PANEL_VALUES: Mapping[str, Callable[[Irc5], str]] = {
    "ctrlstate": lambda controller: controller.controller_state.value,
    "opmode": lambda controller: controller.mode.value,
    "speedratio": lambda controller: str(controller.speed_ratio),
    "coldetstate": lambda controller: controller.collision_state.value,
}
"""What the panel shows, to read and to subscribe to."""

_RESTART_MODES = ("restart", "istart", "pstart", "bstart")
_MODES = {"auto": OperatingMode.AUTO, "man": OperatingMode.MANUAL_REDUCED, "manfs": OperatingMode.MANUAL_FULL}
_LOG_BASE = "/rw/elog/"
_LOG_PAGE = 50

_LOG_DOMAINS: Mapping[int, str] = {
    0: "Common",
    1: "Operational",
    2: "System",
    3: "Hardware",
    4: "Program",
    5: "Motion",
    7: "I/O & Communication",
    8: "User",
    9: "Safety",
    10: "Internal",
    11: "Process",
    12: "Configuration",
    15: "RAPID",
    17: "Connected Services",
}


# Services and RobotWare


def get_root(controller: Irc5, call: Call) -> Page:
    return resource("", "/", "", *(entry("srvlst-service-li", name) for name in _ROOT_SERVICES))


def get_services(controller: Irc5, call: Call) -> Page:
    return resource("rw", "/rw/", "", *(entry("rwservice-li", name) for name in _RW_SERVICES))


def get_system(controller: Irc5, call: Call) -> Page:
    identity = controller.identity
    major, minor, revision, sub_revision = (*identity.robotware.split("."), "0", "0", "0")[:4]
    build = (
        {}
        if identity.is_virtual
        else {
            "major": str(int(major)),
            "minor": str(int(minor)),
            "build": _BUILD,
            "revision": revision,
            "sub-revision": sub_revision,
            "buildtag": "",
            "robapi-compatibility-revision": "0",
            "title": "RobotWare",
            "type": "RobotWare",
            "description": "Controller Software",
            "date": _BUILT,
            "mctimestamp": f"#00:00:00/{_BUILT}#",
        }
    )
    fields = {
        **build,
        "name": identity.system_name,
        "rwversion": ".".join(identity.robotware.split(".")[:3]),
        "sysid": identity.system_id,
        "starttm": datetime.fromtimestamp(controller.started_at).strftime("%Y-%m-%d T %H:%M:%S"),
        "rwversionname": identity.robotware,
    }
    products = State("sys-products-li", "products", {}, (Link("self", "system/products"),))
    states = (State("sys-system-li", "system", fields), _option_list(controller, "system/options"), products)
    return resource("system", "/rw/", "system", *states)


def get_options(controller: Irc5, call: Call) -> Page:
    return resource("system", "/rw/system/", "options", _option_list(controller, "options"))


def _option_list(controller: Irc5, href: str) -> State:
    names = controller.identity.options
    options = tuple(State("sys-option-li", str(index), {"option": name}) for index, name in enumerate(names))
    return State("sys-options-li", "options", {}, (Link("self", href),), options)


def get_robot_type(controller: Irc5, call: Call) -> Page:
    """The robots: their names are options of their system."""
    types = [option for option in controller.identity.options if option.startswith("IRB ")]
    states = (State("sys-robottype", str(number), {"robot-type": name}) for number, name in enumerate(types, 1))
    return resource("system", "/rw/system/", "robottype", *states)


def get_license(controller: Irc5, call: Call) -> Page:
    state = State("sys-license", "license", {"license": controller.identity.system_id.strip("{}")})
    return resource("system", "/rw/system/", "license", state)


def get_products(controller: Irc5, call: Call) -> Page | HttpReply:
    """RobotWare and its add-ins; 204 for one that is not installed."""
    robotware = controller.identity.robotware
    products = {"RobotWare": robotware}
    products |= {
        name: "1.1.0.0" for name in ("StateMachine Core", "SmartGripper") if name in controller.identity.options
    }
    asked = call.option("name")
    states = [
        State("sys-product-li", name, {"title": name, "version-name": version})
        for name, version in products.items()
        if asked is None or name.lower() == asked.lower()
    ]
    return resource("system", "/rw/system/", "products", *states) if states else HttpReply(204)


def get_energy(controller: Irc5, call: Call) -> Page:
    """What the arms use is not measured here: the state says so (-1), as of a robot without its last interval."""
    shown = datetime.fromtimestamp(controller.energy_reset_at).strftime("%Y-%m-%d T %H:%M:%S")
    fields = {
        "state": "-1",
        "energy-state": "not-paused",
        "change-count": "0",
        "time-stamp": shown,
        "reset-time": shown,
        "interval-length": "0",
        "interval-energy": "0",
        "accumulated-energy": "0",
    }
    units = tuple(
        State(
            "sys-energy-mec-li",
            unit.name,
            {},
            (),
            tuple(State("sys-energy-axis-li", str(axis), {"interval-energy": "0"}) for axis in range(1, unit.axes + 1)),
        )
        for unit in controller.units
    )
    return resource("system", "/rw/system/", "energy", State("sys-energy-state-li", "energy", fields, (), units))


def get_energy_changes(controller: Irc5, call: Call) -> Page:
    state = State("sys-energy-changecount-li", "energy", {"change-count": "0"})
    return resource("system", "/rw/system/", "energy", state)


def reset_energy(controller: Irc5, call: Call) -> None:
    controller.energy_reset_at = controller.time


# Return codes and devices


def get_codes(controller: Irc5, call: Call) -> Page:
    """All return codes, or the one that is asked for."""
    asked = call.option("code")
    if asked is None:
        return resource("retcode", "/rw/", "retcode", *(_code_state("err-desc-li", code) for code in Code))
    known = next((code for code in Code if str(int(code)) == asked), None)
    if known is None:
        raise Failure(404, Code.NO_DATA, f"there is no return code {asked[:20]!r}")
    return resource("retcode", "/rw/", f"retcode?code={asked}", _code_state("err-desc", known))


def _code_state(type: str, code: Code) -> State:
    description = sentence(code) or code.name.replace("_", " ").capitalize()
    fields = {
        "name": f"SYS_CTRL_E_{code.name}",
        "code": str(int(code)),
        "severity": "Error",
        "description": description,
    }
    return State(type, str(int(code)), fields)


def _device_tree(controller: Irc5) -> Mapping[str, Mapping[str, str]]:
    """The tree of ``/rw/devices``: properties by the path of a device."""
    identity = controller.identity
    units = {f"HW_DEVICES/MECHANICAL_UNITS/{unit.name}": {"Type": unit.type} for unit in controller.units}
    return {
        "HW_DEVICES": {},
        "HW_DEVICES/CONTROLLER": {"Name": identity.controller_name, "State": controller.controller_state.value},
        "HW_DEVICES/CONTROLLER/COMPUTER_SYSTEM": {"Type": "DSQC1000"},
        "HW_DEVICES/MECHANICAL_UNITS": {},
        **units,
        "SW_RESOURCES": {},
        "SW_RESOURCES/SYSTEM": {"Name": identity.system_name, "RobotWare": identity.robotware},
    }


def get_devices(controller: Irc5, call: Call) -> Page:
    place = call.names.get("device", "").upper().strip("/")
    tree = _device_tree(controller)
    if place and place not in tree:
        raise Failure(404, Code.FAIL, f"there is no device {place[:80]!r}")
    inside = [path for path in tree if path.rpartition("/")[0] == place]
    children = tuple(entry("dev-id-li", path, f"devices/{path}", name=path.rpartition("/")[2]) for path in inside)
    properties = tuple(
        State("dev-propstr-li", name, {"name": name, "value": value, "unit": ""})
        for name, value in (tree[place] if place else {}).items()
    )
    state = State("dev-id-li", place or "devices", {"name": place.rpartition("/")[2] or "devices"}, (), children)
    return resource("devices", "/rw/", f"devices/{place}".rstrip("/"), state, *properties)


# The panel


def get_panel(controller: Irc5, call: Call) -> Page:
    return resource(
        "panel", "/rw/", "panel", *(entry(f"pnl-{name}-li", name, f"panel/{name}") for name in PANEL_VALUES)
    )


def get_panel_value(controller: Irc5, call: Call) -> Page:
    name = call.path[-1]
    text = PANEL_VALUES[name](controller)
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


def get_mode_lock(controller: Irc5, call: Call) -> Page:
    fields = {"lock-state": controller.own_settings.mode_lock}
    return resource("panel", "/rw/panel/", "opmode", State("pnl-opmode-lock", "lock-state", fields))


def lock_mode(controller: Irc5, call: Call) -> None:
    own, pin = controller.own_settings, call.required("pin")
    if not re.fullmatch(r"\d{4}", pin):
        raise invalid("pin has four digits")
    if own.mode_lock != "unlocked":
        raise Failure(403, Code.DENIED, "the operating mode is locked already")
    own.pin = pin
    own.mode_lock = "permlocked" if call.required("permanent") == "1" else "locked"


def unlock_mode(controller: Irc5, call: Call) -> None:
    own = controller.own_settings
    if own.mode_lock == "unlocked":
        raise invalid("the operating mode is not locked")
    if call.required("pin") != own.pin:
        raise Failure(403, Code.DENIED, "the pin is another one")
    own.mode_lock, own.pin = "unlocked", ""


def select_mode(controller: Irc5, call: Call) -> None:
    """The mode is selected by a key on the controller; RobotStudio's controllers alone have none."""
    mode = _MODES[call.required("opmode")]
    if not controller.identity.is_virtual:
        raise Failure(403, Code.MODE_REJECT, "the operating mode is selected by the key on the controller")
    if controller.own_settings.mode_lock != "unlocked":
        raise Failure(403, Code.MODE_REJECT, "the operating mode is locked")
    controller.select_mode(mode)


# The event log


def get_logs(controller: Irc5, call: Call) -> Page:
    states = []
    for number, name in _LOG_DOMAINS.items():
        fields = {} if call.option("lang") is None else {"domain-name": name}
        if call.option("resource") == "count":
            fields["numevts"] = str(len(controller.events.entries(number)))
        fields["buffsize"] = "20" if number else "1000"
        states.append(State("elog-domain-li", str(number), fields, (Link("self", str(number)),)))
    return resource("Elog", _LOG_BASE, "", *states)


def get_events(controller: Irc5, call: Call) -> Page:
    """Newest first, in pages counted from 1."""
    domain = _log_domain(call)
    entries = controller.events.entries(domain)
    asked, since = call.option("resource"), call.number_option("elogseqnum", -1)
    if asked in ("count", "info"):
        fields = {"numevts": str(len(entries))}
        if asked == "info":
            fields["buffsize"] = "20" if domain else "1000"
        return resource("Elog", _LOG_BASE, str(domain), State("elog-domain", str(domain), fields))
    if since >= 0:
        entries = tuple(event for event in entries if event.number >= since)
    ordered = tuple(reversed(entries)) if call.option("order") == "fifo" else entries
    size = min(call.number_option("limit", _LOG_PAGE), _LOG_PAGE)
    number = max(call.number_option("start", 1), 1)
    shown = ordered[(number - 1) * size : number * size]
    asked_for = "".join(f"{name}={text}&" for name, text in call.query if name in ("lang", "order", "resource"))
    more = f"{domain}?{asked_for}start={number + 1}&limit={size}" if number * size < len(ordered) else None
    states = (_event_state("elog-message-li", domain, event, call) for event in shown)
    return resource("Elog", _LOG_BASE, str(domain), *states, next_href=more)


def get_event(controller: Irc5, call: Call) -> Page:
    domain, number = _log_domain(call), call.names["number"]
    for event in controller.events.entries(domain):
        if str(event.number) == number:
            state = _event_state("elog-message", domain, event, call)
            return resource("Elog", _LOG_BASE, f"{domain}/{number}", state)
    raise Failure(404, Code.FAIL, f"domain {domain} has no message {number}")


def _log_domain(call: Call) -> int:
    text = call.names["domain"]
    if text not in map(str, _LOG_DOMAINS):
        raise Failure(404, Code.FAIL, f"there is no event log {text!r}")
    return int(text)


def _event_state(type: str, domain: int, event: Event, call: Call) -> State:
    fields = {
        "msgtype": str(int(event.type)),
        "code": str(event.code),
        "src-name": "MC0",
        "tstamp": datetime.fromtimestamp(event.time, timezone.utc).strftime("%Y-%m-%d T %H:%M:%S"),
        "argc": str(len(event.arguments)),
    }
    if call.option("lang") is not None and call.option("resource") == "title":
        fields["title"] = event.title
    elif call.option("lang") is not None:
        texts = {"title": event.title, "desc": event.description}
        fields |= {**texts, "conseqs": "", "causes": "", "actions": ""}
    title = f"/rw/elog/{domain}/{event.number}"
    arguments = tuple(Argument("string", text) for text in event.arguments)
    return State(type, title, fields, (Link("self", f"{domain}/{event.number}"),), arguments=arguments)


def save_events(controller: Irc5, call: Call) -> HttpReply:
    path = path_of_file(call.required("path"))

    def work() -> None:
        events = reversed(controller.events.entries())
        lines = (f"{e.number} {e.time:.3f} {int(e.type)} {e.code} {e.title} {e.description}" for e in events)
        controller.files[path] = "\n".join(lines) + "\n"

    job = controller.jobs.begin(work, 1.0)
    return HttpReply(202, (("Location", f"/progress/{job.number}"), ("Content-Type", Form.XHTML.value)))


_VISION = "/rw/vision"
_LANG: Values = {"lang": ()}

_LOG_QUERY: Values = {
    **_LANG,
    "resource": ("count", "info", "title"),
    "order": ("lifo", "fifo"),
    "elogseqnum": (),
    "start": (),
    "limit": (),
}

OPERATIONS = (
    Operation("GET", "/", get_root),
    Operation("GET", "/rw", get_services),
    Operation("GET", "/rw/system", get_system),
    Operation("GET", "/rw/system/options", get_options),
    Operation("GET", "/rw/system/robottype", get_robot_type),
    Operation("GET", "/rw/system/license", get_license),
    Operation("GET", "/rw/system/products", get_products, query={"name": ()}),
    Operation("GET", "/rw/system/energy", get_energy),
    Operation("GET", "/rw/system/energy", get_energy_changes, resource="change-count"),
    Operation("POST", "/rw/system/energy", reset_energy, "reset"),
    Operation("GET", "/rw/retcode", get_codes, query={"code": ()}),
    Operation("GET", "/rw/devices", get_devices, query={"Lang": ()}),
    Operation("GET", "/rw/devices/{device:.+}", get_devices, query={"Lang": ()}),
    Operation("GET", _VISION, not_there, query={"resource": ()}, lacks=_NO_VISION),
    Operation("GET", f"{_VISION}/{{name}}", not_there, lacks=_NO_VISION),
    *(
        Operation("POST", _VISION, not_there, action, lacks=_NO_VISION)
        for action in ("restart", "flash-led", "set-state", "refresh", "set-hostname", "set-dhcp", "set-dns-settings")
    ),
    *(
        Operation("POST", _VISION, not_there, action, lacks=_NO_VISION)
        for action in ("set-cameraname", "set-user-credential", "set-ip-settings")
    ),
    Operation("POST", f"{_VISION}/{{name}}", not_there, "trigger", lacks=_NO_VISION),
    Operation("GET", "/rw/panel", get_panel),
    Operation(
        "POST",
        "/rw/panel",
        ctrl.restart,
        "restart",
        {"restart-mode": _RESTART_MODES},
        needs_grant=Grant.REMOTE_WARMSTART,
    ),
    Operation(
        "POST",
        "/rw/panel",
        ctrl.set_language,
        "setlang",
        {"lang-code": ()},
        needs_grant=Grant.CONTROLLER_PROPERTIES_WRITE,
    ),
    *(Operation("GET", f"/rw/panel/{name}", get_panel_value) for name in PANEL_VALUES),
    Operation(
        "POST",
        "/rw/panel/ctrlstate",
        set_controller_state,
        "setctrlstate",
        {"ctrl-state": ("motoron", "motoroff")},
    ),
    Operation("POST", "/rw/panel/opmode", select_mode, values={"opmode": tuple(_MODES)}, status=403),
    Operation("POST", "/rw/panel/opmode", acknowledge, "acknowledge", {"opmode": ("auto", "manf", "coldet")}),
    Operation("GET", "/rw/panel/opmode", get_mode_lock, resource="lock-state"),
    Operation("POST", "/rw/panel/opmode", lock_mode, "lock", {"pin": (), "permanent": ("0", "1")}),
    Operation("POST", "/rw/panel/opmode", unlock_mode, "unlock", {"pin": ()}),
    Operation(
        "POST",
        "/rw/panel/speedratio",
        set_speed_ratio,
        "setspeedratio",
        {"speed-ratio": ()},
        needs_grant=Grant.SPEED_DECREASE,
    ),
    Operation("GET", "/rw/elog", get_logs, query={**_LANG, "resource": ("count",)}),
    Operation(
        "POST",
        "/rw/elog",
        lambda controller, _: controller.events.clear(),
        "clearall",
        needs_grant=Grant.EVENTLOG_CLEAR,
    ),
    Operation("POST", "/rw/elog", save_events, "saveraw", {"path": ()}, status=202, needs_grant=Grant.FTP_WRITE),
    Operation("GET", "/rw/elog/{domain}", get_events, query=_LOG_QUERY),
    Operation(
        "POST",
        "/rw/elog/{domain}",
        lambda controller, call: controller.events.clear(_log_domain(call)),
        "clear",
        needs_grant=Grant.EVENTLOG_CLEAR,
    ),
    Operation("GET", "/rw/elog/{domain}/{number}", get_event, query=_LANG),
)
