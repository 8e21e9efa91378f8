"""The texts of the messages of abb_protocols, a file for each subject."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text
from abb_protocols.texts.egm import EGM
from abb_protocols.texts.errors import ERRORS
from abb_protocols.texts.robot import ROBOT
from abb_protocols.texts.rws import RWS

SUBJECTS: Mapping[str, Mapping[str, Text]] = {
    "Extras": ERRORS,
    "EGM": EGM,
    "Model of the robot": ROBOT,
    "Robot Web Services": RWS,
}
"""The texts by subject, as the documentation lists them."""
