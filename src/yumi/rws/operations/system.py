"""The controller's services, RobotWare, return codes, devices and vision."""

from __future__ import annotations

from yumi.rws.operations.operation import absent, get, post

ROOT = get("/")
SERVICES = get("/rw")
SYSTEM = get("/rw/system")
OPTIONS = get("/rw/system/options")
ROBOT_TYPE = get("/rw/system/robottype")
LICENSE = get("/rw/system/license")
PRODUCTS = get("/rw/system/products", "name")
ENERGY = get("/rw/system/energy")
ENERGY_CHANGES = get("/rw/system/energy", resource="change-count")
RESET_ENERGY = post("/rw/system/energy", "reset")
CODES = get("/rw/retcode", "code")
DEVICES = get("/rw/devices", "Lang")
DEVICE = get("/rw/devices/{device:.+}", "Lang")
ABSENT = (
    *absent(
        "integrated vision",
        "GET /rw/vision?resource",
        "GET /rw/vision/{name}",
        "POST /rw/vision?action=restart",
        "POST /rw/vision?action=flash-led",
        "POST /rw/vision?action=set-state",
        "POST /rw/vision?action=refresh",
        "POST /rw/vision?action=set-hostname",
        "POST /rw/vision?action=set-dhcp",
        "POST /rw/vision?action=set-dns-settings",
        "POST /rw/vision?action=set-cameraname",
        "POST /rw/vision?action=set-user-credential",
        "POST /rw/vision?action=set-ip-settings",
        "POST /rw/vision/{name}?action=trigger",
    ),
)
"""What this robot lacks."""
