"""The texts of the messages of abb_view, a file for each subject."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text
from abb_view.texts.view import VIEW

SUBJECTS: Mapping[str, Mapping[str, Text]] = {"View in the browser": VIEW}
"""The texts by subject, as the documentation lists them."""
