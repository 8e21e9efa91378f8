"""Texts that errors have of their own."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

ERRORS: Mapping[str, Text] = {
    "extra_missing": Text(
        "{what}",
        "run `pip install '{package}[{extra}]'`, or `make setup WITH={extra}` in a clone of yumi-ros2",
    ),
}
