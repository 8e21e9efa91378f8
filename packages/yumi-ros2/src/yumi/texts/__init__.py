"""The texts of the messages of yumi, a file for each subject."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text
from yumi.texts.arms import ARMS
from yumi.texts.command_line import COMMAND_LINE
from yumi.texts.driver import DRIVER
from yumi.texts.endpoint import ENDPOINT
from yumi.texts.events import EVENTS
from yumi.texts.grippers import GRIPPERS
from yumi.texts.motions import CONTROLLERS, MOTIONS
from yumi.texts.page import PAGE
from yumi.texts.planning import PLANNING
from yumi.texts.recordings import RECORDINGS
from yumi.texts.results import RESULTS
from yumi.texts.robot_controller import ROBOT_CONTROLLER
from yumi.texts.robot_state import ROBOT_STATE
from yumi.texts.ros import ROS
from yumi.texts.script import SCRIPT
from yumi.texts.set_up import SET_UP
from yumi.texts.teleoperation import TELEOPERATION

SUBJECTS: Mapping[str, Mapping[str, Text]] = {
    "May the robot move": ROBOT_STATE,
    "Events of the controller": EVENTS,
    "The controller": ROBOT_CONTROLLER,
    "Arms": ARMS,
    "Requests to a driver": ENDPOINT,
    "ROS 2": ROS,
    "Page": PAGE,
    "Command line": COMMAND_LINE,
    "Grippers": GRIPPERS,
    "Driver": DRIVER,
    "Installation and doctor": SET_UP,
    "Recordings": RECORDINGS,
    "Motions": MOTIONS,
    "Planned paths": PLANNING,
    "Controllers": CONTROLLERS,
    "Scripts": SCRIPT,
    "Teleoperation": TELEOPERATION,
    "Results of commands": RESULTS,
}
"""The texts by subject, as the documentation lists them."""
