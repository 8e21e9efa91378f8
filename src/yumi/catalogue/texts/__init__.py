"""The texts of all messages by their codes, a file for each subject; a page of the documentation lists them."""

from __future__ import annotations

from collections.abc import Mapping

from yumi.catalogue.text import Text
from yumi.catalogue.texts.actions import ACTIONS as ACTIONS
from yumi.catalogue.texts.arms import ARMS
from yumi.catalogue.texts.egm import EGM
from yumi.catalogue.texts.events import EVENTS
from yumi.catalogue.texts.motion import CONTROLLERS, MOTION
from yumi.catalogue.texts.robot import ROBOT
from yumi.catalogue.texts.robot_state import ROBOT_STATE

SUBJECTS: Mapping[str, Mapping[str, Text]] = {
    "May the robot move": ROBOT_STATE,
    "Events of the controller": EVENTS,
    "Arms": ARMS,
    "Motions": MOTION,
    "Controllers": CONTROLLERS,
    "EGM": EGM,
    "Model of the robot": ROBOT,
}
"""All texts by subject, as the documentation lists them."""

TEXTS: dict[str, Text] = {"text": Text("{text}")}
"""All texts by code; ``text`` is what others have said: the operating system, a library, the controller."""

for _texts in SUBJECTS.values():
    for _code, _text in _texts.items():
        assert _code not in TEXTS, _code
        TEXTS[_code] = _text
