"""The texts of all messages by their codes, a file for each subject; a page of the documentation lists them."""

from __future__ import annotations

from collections.abc import Mapping

from yumi.catalogue.text import Text
from yumi.catalogue.texts.arms import ARMS
from yumi.catalogue.texts.command_line import COMMAND_LINE
from yumi.catalogue.texts.controller import CONTROLLER
from yumi.catalogue.texts.debugger import DEBUGGER
from yumi.catalogue.texts.driver import DRIVER
from yumi.catalogue.texts.egm import EGM
from yumi.catalogue.texts.endpoint import ENDPOINT
from yumi.catalogue.texts.errors import ERRORS
from yumi.catalogue.texts.evaluation import EVALUATION
from yumi.catalogue.texts.events import EVENTS
from yumi.catalogue.texts.grippers import GRIPPERS
from yumi.catalogue.texts.motion import CONTROLLERS, MOTION
from yumi.catalogue.texts.options import OPTIONS
from yumi.catalogue.texts.page import PAGE
from yumi.catalogue.texts.planning import PLANNING
from yumi.catalogue.texts.prerequisites import PREREQUISITES
from yumi.catalogue.texts.recordings import RECORDINGS
from yumi.catalogue.texts.robot import ROBOT
from yumi.catalogue.texts.robot_state import ROBOT_STATE
from yumi.catalogue.texts.ros import ROS
from yumi.catalogue.texts.rws import RWS
from yumi.catalogue.texts.script import SCRIPT
from yumi.catalogue.texts.set_up import SET_UP
from yumi.catalogue.texts.settings import SETTINGS
from yumi.catalogue.texts.teleoperation import TELEOPERATION

SUBJECTS: Mapping[str, Mapping[str, Text]] = {
    "May the robot move": ROBOT_STATE,
    "Events of the controller": EVENTS,
    "The controller": CONTROLLER,
    "Arms": ARMS,
    "Requests to a driver": ENDPOINT,
    "ROS 2": ROS,
    "Page": PAGE,
    "Command line": COMMAND_LINE,
    "Options of command lines": OPTIONS,
    "RAPID, checked and debugged": DEBUGGER,
    "Grippers": GRIPPERS,
    "Driver": DRIVER,
    "Settings": SETTINGS,
    "Prerequisites": PREREQUISITES,
    "Extras": ERRORS,
    "Installation and doctor": SET_UP,
    "Recordings": RECORDINGS,
    "Motions": MOTION,
    "Planned paths": PLANNING,
    "Controllers": CONTROLLERS,
    "EGM": EGM,
    "Model of the robot": ROBOT,
    "Robot Web Services": RWS,
    "Scripts": SCRIPT,
    "Teleoperation": TELEOPERATION,
    "Evaluation": EVALUATION,
}
"""All texts by subject, as the documentation lists them."""
