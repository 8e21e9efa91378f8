"""Operations on the system (``/rw/system``, ``/rw/retcode``, ``/rw/devices``): products, energy, return codes.

With the client's calls of them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated

from abb_protocols.catalogue import message
from abb_protocols.errors import ProtocolError
from abb_protocols.rws.documents import Page
from abb_protocols.rws.operations.operation import absent_operations, get, post
from abb_protocols.rws.operations.operation_answer import TEXT, WHOLE, record, single
from abb_protocols.rws.operations.service import Service

_VERSION = re.compile(r"\d+(\.\d+)+")
_ROBOT = re.compile(r"IRB \d+\w*")  # of an option such as "IRB 120-3/0.6"


@dataclass(frozen=True, slots=True)
class SystemInfo:
    """The controller's system, e.g. version (6, 13, 0, 0); a new installation of RobotWare has another ``id``."""

    name: str
    robotware: tuple[int, ...]
    options: tuple[str, ...]
    id: str = ""

    @property
    def version(self) -> str:
        """Of RobotWare, as ABB writes it: ``6.13.0.0``."""
        return ".".join(map(str, self.robotware))

    @property
    def robot(self) -> str:
        """ABB's name of the robot without its variant, such as ``IRB 120``; empty where no option names one."""
        names = (match[0] for option in self.options if (match := _ROBOT.match(option)))
        return next(names, "")


@dataclass(frozen=True, slots=True)
class Energy:
    """What the robot has consumed since ``reset_at`` [J]."""

    total: float
    reset_at: str


@dataclass(frozen=True, slots=True)
class Product:
    """An installed product."""

    name: Annotated[str, "title"]
    version: Annotated[str, "version-name"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReturnCode:
    """What one of ABB's return codes means; severity is Success, Warning or Error."""

    name: str
    code: int
    severity: str
    description: str


RWS_ROOT = get("/")
RWS_SERVICES = get("/rw")
SYSTEM = get("/rw/system")
SYSTEM_OPTIONS = get("/rw/system/options")
ROBOT_TYPE = get("/rw/system/robottype").shows(single("sys-robottype", "robot-type", TEXT))
SYSTEM_LICENSE = get("/rw/system/license").shows(single("sys-license", "license", TEXT))
PRODUCTS = get("/rw/system/products", "name").shows(record("sys-product-li", Product))
SYSTEM_ENERGY = get("/rw/system/energy")
ENERGY_CHANGES = get("/rw/system/energy", resource="change-count").shows(
    single("sys-energy-changecount-li", "change-count", WHOLE)
)
RESET_ENERGY = post("/rw/system/energy", "reset")
RETURN_CODES = get("/rw/retcode", "code").shows(record("err-desc-li", ReturnCode))
DEVICES = get("/rw/devices", "Lang")
DEVICE = get("/rw/devices/{device:.+}", "Lang")
ABSENT_FROM_SYSTEM = absent_operations(
    "integrated vision",
    "GET /rw/vision?resource | GET /rw/vision/{name} | POST /rw/vision?action=restart"
    " | POST /rw/vision?action=flash-led | POST /rw/vision?action=set-state"
    " | POST /rw/vision?action=refresh | POST /rw/vision?action=set-hostname"
    " | POST /rw/vision?action=set-dhcp | POST /rw/vision?action=set-dns-settings"
    " | POST /rw/vision?action=set-cameraname | POST /rw/vision?action=set-user-credential"
    " | POST /rw/vision?action=set-ip-settings | POST /rw/vision/{name}?action=trigger",
)
"""What this robot lacks."""


def read_system(page: Page) -> SystemInfo:
    """``/rw/system``."""
    state = page.one("sys-system-li")
    version = state.text("rwversionname")
    if not _VERSION.fullmatch(version):
        raise ProtocolError(message("version_not_numbers", version=version))
    options = tuple(child.text("option") for each in page.of_type("sys-options-li") for child in each.children)
    robotware = tuple(int(part) for part in version.split("."))
    return SystemInfo(state.text("name"), robotware, options, state.fields.get("sysid", ""))


class SystemService(Service):
    """``/rw/system``, ``/rw/devices`` and ``/rw/retcode``."""

    def system(self) -> SystemInfo:
        """Name, RobotWare version and options."""
        return read_system(self._shown("reading the system", SYSTEM))

    def options(self) -> tuple[str, ...]:
        """Names of the system's options."""
        page = self._shown("reading the options", SYSTEM_OPTIONS)
        return tuple(child.text("option") for state in page.states for child in state.children)

    def robot_types(self) -> tuple[str, ...]:
        """Types of the robots, such as ``IRB 14000-0.5/0.5``."""
        return self._answers("reading the type", ROBOT_TYPE)

    def license(self) -> str:
        """The system's licence."""
        return self._answer("reading the licence", SYSTEM_LICENSE)

    def products(self) -> dict[str, str]:
        """Versions of the installed products by name."""
        return {each.name: each.version for each in self._answers("reading the products", PRODUCTS)}

    def energy(self) -> Energy:
        """What the robot has consumed."""
        state = self._shown("reading the energy", SYSTEM_ENERGY).one("sys-energy-state-li")
        return Energy(state.number("accumulated-energy"), state.text("reset-time"))

    def energy_change_count(self) -> int:
        """Rises with every change of what the robot has consumed."""
        return self._answer("reading the energy", ENERGY_CHANGES)

    def reset_energy(self) -> None:
        """Begin to count anew."""
        self._call("resetting the energy", RESET_ENERGY)

    def return_codes(self) -> tuple[ReturnCode, ...]:
        """All of the controller's return codes."""
        return self._answers("reading the return codes", RETURN_CODES)

    def hardware(self, path: str = "") -> tuple[str, ...]:
        """Paths of the hardware below ``path``, such as ``HW_DEVICES/CONTROLLER``."""
        what, place = "reading the hardware", path.rstrip("/")
        page: Page = self._shown(what, DEVICE, place) if place else self._shown(what, DEVICES)
        return tuple(child.title for state in page.of_type("dev-id-li") for child in state.children)

    def hardware_properties(self, path: str) -> dict[str, str]:
        """Properties of a piece of hardware, with their units."""
        states = self._listed("reading the hardware", DEVICE, path)
        return {
            state.text("name"): f"{state.text('value')} {state.fields.get('unit', '')}".rstrip()
            for state in states
            if state.type.startswith("dev-prop")
        }
