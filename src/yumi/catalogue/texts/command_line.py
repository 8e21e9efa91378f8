"""Refusals of the command line itself."""

from __future__ import annotations

from collections.abc import Mapping

from yumi.catalogue.text import Text

COMMAND_LINE: Mapping[str, Text] = {
    "confirm_by_option": Text(
        "the robot was stopped by {causes:full}",
        "look at the robot; when no person is near it and nothing is in its way, confirm this stop: yumi recover "
        "--confirm {stop}",
    ),
    "not_confirmed": Text("not confirmed; nothing was changed"),
    "no_driver_for_shell": Text("{error:sentence} Or connect the prompt to a robot: yumi shell --robot <address>"),
}
