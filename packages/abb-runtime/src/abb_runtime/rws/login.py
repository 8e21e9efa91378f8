"""The usual port of a virtual controller, and where a program finds the password of a controller."""

from __future__ import annotations

import os

from abb_runtime.udp import is_loopback

MAX_PORT = 65535
VIRTUAL_RWS_PORT = 8080
"""The default port of ``virtual-irc5 run`` and ``yumi controller``."""

PASSWORD_VARIABLE = "YUMI_PASSWORD"
"""The environment variable with the robot's password; it wins over the settings file."""


def with_usual_port(address: str) -> str:
    """An address of a controller, with the port of a virtual one where it has none and is of this machine."""
    return f"{address}:{VIRTUAL_RWS_PORT}" if ":" not in address and is_loopback(address) else address


def password_of_environment() -> str | None:
    """The password that ``YUMI_PASSWORD`` holds; None where it is not set."""
    return os.environ.get(PASSWORD_VARIABLE) or None
