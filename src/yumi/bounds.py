"""Bounds of a setting, declared beside its default; whoever reads settings checks and quotes them."""

from __future__ import annotations

from dataclasses import field
from typing import Any


def bounded(default: float | None, lowest: float, highest: float, unit: str = "") -> Any:
    """A dataclass field with a range that includes both ends."""
    return field(default=default, metadata={"lowest": lowest, "highest": highest, "unit": unit})
