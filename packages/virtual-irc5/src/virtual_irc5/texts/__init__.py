"""The texts of the messages of virtual_irc5, a file for each subject."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text
from virtual_irc5.texts.debugger import DEBUGGER
from virtual_irc5.texts.testing import TESTING

SUBJECTS: Mapping[str, Mapping[str, Text]] = {
    "RAPID, checked and debugged": DEBUGGER,
    "Fixtures of pytest": TESTING,
}
"""The texts by subject, as the documentation lists them."""
