"""The texts of the messages of abb_runtime, a file for each subject."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text
from abb_runtime.texts.options import OPTIONS
from abb_runtime.texts.prerequisites import PREREQUISITES
from abb_runtime.texts.settings import SETTINGS

SUBJECTS: Mapping[str, Mapping[str, Text]] = {
    "Options of command lines": OPTIONS,
    "Settings": SETTINGS,
    "Prerequisites": PREREQUISITES,
}
"""The texts by subject, as the documentation lists them."""
