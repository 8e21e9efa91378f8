"""Actions of a person, in the words of each front end."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple


class FrontEnd(Enum):
    """Who reads a message, and by what means they act."""

    ROS = "ros"
    SCRIPT = "script"
    SHELL = "shell"
    PAGE = "page"
    VIRTUAL_PAGE = "virtual_page"


class Action(Enum):
    """What a person can do about something; the values are the names in the texts and on the wire."""

    START_EGM = "start_egm"
    STOP_EGM = "stop_egm"
    RESTART_EGM = "restart_egm"
    RECOVER = "recover"
    CONFIRM_STOP = "confirm_stop"
    CALIBRATE = "calibrate"
    MOTORS_ON = "motors_on"
    TURN_TO_AUTO = "turn_to_auto"
    RELEASE_STOP = "release_stop"
    RETREAT = "retreat"
    SWITCH = "switch"
    GIVE_RADIANS = "give_radians"
    GIVE_BACK = "give_back"


class Words(NamedTuple):
    """An action in the words of one front end.

    Attributes:
        do: as an order.
        name: what it is called.
    """

    do: str
    name: str


_ON_PAGE: dict[str, Words] = {
    "start_egm": Words("press “Start EGM”", "“Start EGM”"),
    "stop_egm": Words("press “Stop (ends EGM)”", "“Stop (ends EGM)”"),
    "restart_egm": Words("press “Stop (ends EGM)”, then “Start EGM”", "“Stop (ends EGM)”, then “Start EGM”"),
    "recover": Words("press “Recover…”", "“Recover…”"),
    "confirm_stop": Words("look at the robot and press “Recover…”", "“Recover…”"),
    "calibrate": Words("press “Calibrate grippers”", "“Calibrate grippers”"),
    "motors_on": Words("press “Recover…”", "“Recover…”"),
    "turn_to_auto": Words("set the controller to AUTO on the FlexPendant", "the operating mode on the FlexPendant"),
    "release_stop": Words("release it where it was pressed", "the button of the emergency stop"),
    "retreat": Words("run `yumi retreat`", "`yumi retreat`"),
    "switch": Words("choose the controller on this page", "the list of controllers"),
    "give_radians": Words("give radians", "radians"),
    "give_back": Words("press “Give arms back”", "“Give arms back”"),
}

_BY_FRONT_END: dict[str, dict[str, Words]] = {
    "ros": {
        **_ON_PAGE,
        "start_egm": Words("call start_egm", "start_egm"),
        "stop_egm": Words("call stop_egm", "stop_egm"),
        "restart_egm": Words("call stop_egm, then start_egm", "stop_egm, then start_egm"),
        "recover": Words("call recover", "recover"),
        "confirm_stop": Words("look at the robot and call recover with the id of the stop, {stop}", "recover"),
        "calibrate": Words("call the gripper's service calibrate", "the gripper's service calibrate"),
        "motors_on": Words("call start_egm", "start_egm"),
        "switch": Words("call controller_manager/switch_controller", "controller_manager/switch_controller"),
        "give_back": Words("call give_back", "give_back"),
    },
    "script": {
        **_ON_PAGE,
        "start_egm": Words("call robot.recover()", "robot.recover()"),
        "stop_egm": Words("end EGM with robot.close()", "robot.close()"),
        "restart_egm": Words("call robot.recover()", "robot.recover()"),
        "recover": Words("call robot.recover()", "robot.recover()"),
        "confirm_stop": Words("look at the robot and call robot.recover(confirm={stop!r})", "robot.recover()"),
        "calibrate": Words("call gripper.calibrate()", "gripper.calibrate()"),
        "motors_on": Words("call robot.recover()", "robot.recover()"),
        "retreat": Words("call robot.retreat()", "robot.retreat()"),
        "switch": Words("leave the arm to one controller", "the controller of the arm"),
        "give_radians": Words("use yumi.degrees(...)", "yumi.degrees"),
        "give_back": Words("call robot.give_back()", "robot.give_back()"),
    },
    "shell": {
        **_ON_PAGE,
        "start_egm": Words("run `yumi start`", "`yumi start`"),
        "stop_egm": Words("run `yumi stop`", "`yumi stop`"),
        "restart_egm": Words("run `yumi stop`, then `yumi start`", "`yumi stop`, then `yumi start`"),
        "recover": Words("run `yumi recover`", "`yumi recover`"),
        "confirm_stop": Words("look at the robot and confirm the stop {stop} with `yumi recover`", "`yumi recover`"),
        "calibrate": Words("run `yumi calibrate`", "`yumi calibrate`"),
        "motors_on": Words("run `yumi start`", "`yumi start`"),
        "switch": Words("run `yumi switch`", "`yumi switch`"),
        "give_radians": Words("add --degrees", "--degrees"),
        "give_back": Words("run `yumi give-back`", "`yumi give-back`"),
    },
    "page": _ON_PAGE,
    "virtual_page": {
        **_ON_PAGE,
        "turn_to_auto": Words("press “Turn the key to AUTO”", "“Turn the key to AUTO”"),
        "release_stop": Words("press “Release the emergency stop”", "“Release the emergency stop”"),
    },
}

ACTIONS: Mapping[str, Mapping[str, Words]] = {
    action: {front_end: words[action] for front_end, words in _BY_FRONT_END.items()} for action in _ON_PAGE
}
"""By action, then by front end."""
