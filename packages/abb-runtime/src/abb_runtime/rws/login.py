"""The usual port of a virtual controller, and where a program finds the password of a controller."""

from __future__ import annotations

import os

MAX_PORT = 65535
VIRTUAL_RWS_PORT = 8080
"""The default port of ``yumi controller``."""

PASSWORD_VARIABLE = "YUMI_PASSWORD"
"""The environment variable with the robot's password; it wins over the settings file."""


def password_of_environment() -> str | None:
    """The password that ``YUMI_PASSWORD`` holds; None where it is not set."""
    return os.environ.get(PASSWORD_VARIABLE) or None
