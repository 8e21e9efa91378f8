"""The virtual controller's answers on ``/rw/system``, ``/rw/retcode`` and ``/rw/devices``: RobotWare, codes."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime

from abb_protocols.rws.documents import Page, RwsLink, RwsState
from abb_protocols.rws.operations import system as table
from abb_protocols.rws.values import RwsCode, code_sentence
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.render import page_at, page_entry
from virtual_irc5.rws.router import Routes, absent_routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall

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

ROUTES = Routes()


# Services and RobotWare


@ROUTES.answer(table.RWS_ROOT)
def _get_root(controller: Irc5, call: RwsCall) -> Page:
    return page_at("", "/", "", *(page_entry("srvlst-service-li", name) for name in _ROOT_SERVICES))


@ROUTES.answer(table.RWS_SERVICES)
def _get_services(controller: Irc5, call: RwsCall) -> Page:
    return page_at("rw", "/rw/", "", *(page_entry("rwservice-li", name) for name in _RW_SERVICES))


@ROUTES.answer(table.SYSTEM)
def _get_system(controller: Irc5, call: RwsCall) -> Page:
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
    products = RwsState("sys-products-li", "products", {}, (RwsLink("self", "system/products"),))
    states = (RwsState("sys-system-li", "system", fields), _option_list(controller, "system/options"), products)
    return page_at("system", "/rw/", "system", *states)


@ROUTES.answer(table.SYSTEM_OPTIONS)
def _get_options(controller: Irc5, call: RwsCall) -> Page:
    return page_at("system", "/rw/system/", "options", _option_list(controller, "options"))


def _option_list(controller: Irc5, href: str) -> RwsState:
    names = controller.identity.options
    options = tuple(RwsState("sys-option-li", str(index), {"option": name}) for index, name in enumerate(names))
    return RwsState("sys-options-li", "options", {}, (RwsLink("self", href),), options)


@ROUTES.answer(table.ROBOT_TYPE)
def _get_robot_type(controller: Irc5, call: RwsCall) -> Mapping[str, str]:
    """The robots: their names are options of their system."""
    types = [option for option in controller.identity.options if option.startswith("IRB ")]
    return {str(number): name for number, name in enumerate(types, 1)}


@ROUTES.answer(table.SYSTEM_LICENSE)
def _get_license(controller: Irc5, call: RwsCall) -> str:
    return controller.identity.system_id.strip("{}")


@ROUTES.answer(table.PRODUCTS)
def _get_products(controller: Irc5, call: RwsCall) -> Mapping[str, table.Product] | HttpReply:
    """RobotWare and its add-ins; 204 for one that is not installed."""
    robotware = controller.identity.robotware
    products = {"RobotWare": robotware}
    products |= {
        name: "1.1.0.0" for name in ("StateMachine Core", "SmartGripper") if name in controller.identity.options
    }
    asked = call.option("name")
    found = {name: table.Product(name, version) for name, version in products.items()}
    fitting = {name: each for name, each in found.items() if asked is None or name.lower() == asked.lower()}
    return fitting or HttpReply(204)


@ROUTES.answer(table.SYSTEM_ENERGY)
def _get_energy(controller: Irc5, call: RwsCall) -> Page:
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
        RwsState(
            "sys-energy-mec-li",
            unit.name,
            {},
            (),
            tuple(
                RwsState("sys-energy-axis-li", str(axis), {"interval-energy": "0"}) for axis in range(1, unit.axes + 1)
            ),
        )
        for unit in controller.units
    )
    return page_at("system", "/rw/system/", "energy", RwsState("sys-energy-state-li", "energy", fields, (), units))


@ROUTES.answer(table.ENERGY_CHANGES)
def _get_energy_changes(controller: Irc5, call: RwsCall) -> int:
    return 0


@ROUTES.answer(table.RESET_ENERGY)
def _reset_energy(controller: Irc5, call: RwsCall) -> None:
    controller.energy_reset_at = controller.time


# Return codes and devices


@ROUTES.answer(table.RETURN_CODES)
def _get_codes(controller: Irc5, call: RwsCall) -> Page:
    """All return codes, or the one that is asked for."""
    asked = call.option("code")
    if asked is None:
        return page_at("retcode", "/rw/", "retcode", *(_code_state("err-desc-li", code) for code in RwsCode))
    known = next((code for code in RwsCode if str(int(code)) == asked), None)
    if known is None:
        raise CallFailure(404, RwsCode.NO_DATA, f"there is no return code {asked[:20]!r}")
    return page_at("retcode", "/rw/", f"retcode?code={asked}", _code_state("err-desc", known))


def _code_state(type: str, code: RwsCode) -> RwsState:
    description = code_sentence(code) or code.name.replace("_", " ").capitalize()
    shown = table.ReturnCode(name=f"SYS_CTRL_E_{code.name}", code=int(code), severity="Error", description=description)
    return RwsState(type, str(int(code)), table.RETURN_CODES.answered.write(shown))


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


@ROUTES.answer(table.DEVICES, table.DEVICE)
def _get_devices(controller: Irc5, call: RwsCall) -> Page:
    place = call.names.get("device", "").upper().strip("/")
    tree = _device_tree(controller)
    if place and place not in tree:
        raise CallFailure(404, RwsCode.FAIL, f"there is no device {place[:80]!r}")
    inside = [path for path in tree if path.rpartition("/")[0] == place]
    children = tuple(page_entry("dev-id-li", path, f"devices/{path}", name=path.rpartition("/")[2]) for path in inside)
    properties = tuple(
        RwsState("dev-propstr-li", name, {"name": name, "value": value, "unit": ""})
        for name, value in (tree[place] if place else {}).items()
    )
    state = RwsState("dev-id-li", place or "devices", {"name": place.rpartition("/")[2] or "devices"}, (), children)
    return page_at("devices", "/rw/", f"devices/{place}".rstrip("/"), state, *properties)


ROUTES += absent_routes(table.ABSENT_FROM_SYSTEM)
