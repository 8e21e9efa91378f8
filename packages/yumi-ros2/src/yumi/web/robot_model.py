"""The robot model of the page of ``yumi view``: that of a YuMi, with the commands of the driver."""

from __future__ import annotations

from typing import Any

from abb_protocols.catalogue.actions import FrontEnd
from abb_view.robot_model import yumi_model
from yumi.driver.commands import offered_to


def robot_model() -> dict[str, Any]:
    """As :func:`abb_view.robot_model.yumi_model` has it, and the buttons of commands without arguments."""
    return {
        **yumi_model(),
        "commands": [
            {"method": kind.method(), "button": kind.button, "title": kind.summary()}
            for kind in offered_to(FrontEnd.PAGE)
            if kind.button
        ],
    }
