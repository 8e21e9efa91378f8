"""Where the robot of an evaluation is."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.hardware.rws_client import DEFAULT_PASSWORD, DEFAULT_USER

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
    password: str = DEFAULT_PASSWORD
