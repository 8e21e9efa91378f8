"""Where the robot of an evaluation is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from yumi.hardware.rws_client import DEFAULT_PASSWORD, DEFAULT_USER
from yumi.settings import PASSWORD_VARIABLE

__all__ = ["DEFAULT_PASSWORD", "DEFAULT_USER", "RobotPlace"]


@dataclass(frozen=True, slots=True)
class RobotPlace:
    """A controller.

    Attributes:
        robot: address of a real one; None starts a virtual one.
        rws_port: of a real one.
        user, password: on it.
    """

    robot: str | None
    rws_port: int
    user: str = DEFAULT_USER
    password: str = field(default=DEFAULT_PASSWORD, repr=False)

    @property
    def secrets(self) -> Mapping[str, str]:
        """Environment variables that tell our commands the password: every user can read their arguments."""
        return {PASSWORD_VARIABLE: self.password}
