"""Operations on the system (``/rw/system``, ``/rw/retcode``, ``/rw/devices``): RobotWare, products, return codes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from abb_protocols.rws.operations.operation import absent, get, post
from abb_protocols.rws.operations.operation_answer import TEXT, WHOLE, record, single


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


ROOT = get("/")
SERVICES = get("/rw")
SYSTEM = get("/rw/system")
OPTIONS = get("/rw/system/options")
ROBOT_TYPE = get("/rw/system/robottype").shows(single("sys-robottype", "robot-type", TEXT))
LICENSE = get("/rw/system/license").shows(single("sys-license", "license", TEXT))
PRODUCTS = get("/rw/system/products", "name").shows(record("sys-product-li", Product))
ENERGY = get("/rw/system/energy")
ENERGY_CHANGES = get("/rw/system/energy", resource="change-count").shows(
    single("sys-energy-changecount-li", "change-count", WHOLE)
)
RESET_ENERGY = post("/rw/system/energy", "reset")
CODES = get("/rw/retcode", "code").shows(record("err-desc-li", ReturnCode))
DEVICES = get("/rw/devices", "Lang")
DEVICE = get("/rw/devices/{device:.+}", "Lang")
ABSENT = (
    *absent(
        "integrated vision",
        "GET /rw/vision?resource | GET /rw/vision/{name} | POST /rw/vision?action=restart"
        " | POST /rw/vision?action=flash-led | POST /rw/vision?action=set-state"
        " | POST /rw/vision?action=refresh | POST /rw/vision?action=set-hostname"
        " | POST /rw/vision?action=set-dhcp | POST /rw/vision?action=set-dns-settings"
        " | POST /rw/vision?action=set-cameraname | POST /rw/vision?action=set-user-credential"
        " | POST /rw/vision?action=set-ip-settings | POST /rw/vision/{name}?action=trigger",
    ),
)
"""What this robot lacks."""
