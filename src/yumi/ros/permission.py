"""Who may ask the robot for what: the managed nodes that must be configured or active."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

from yumi.robot.joints import Side


class Managed(Protocol):
    """A managed node."""

    def why_not_active(self) -> str | None:
        """What must be done before motion is permitted; None when it is."""

    def why_not_configured(self) -> str | None:
        """What must be done before there is a connection; None when there is one."""


class Permission:
    """The robot and its arms together: no part moves before the whole is connected and permitted.

    Args:
        robot: the robot manager's managed node.
        arms: those of the arms.
    """

    def __init__(self, robot: Managed, arms: Mapping[Side, Managed]) -> None:
        self._robot = robot
        self._arms = arms

    def to_ask(self) -> str | None:
        """Why the robot cannot be asked; None when it can."""
        return self._robot.why_not_configured()

    def to_move(self, arms: Iterable[Side] = ()) -> str | None:
        """Why the robot, or one of ``arms``, may not move; None when it may."""
        reasons = (self._robot.why_not_active(), *(self._arms[side].why_not_active() for side in arms))
        return next((reason for reason in reasons if reason is not None), None)
