"""Degrees for people; everything else is in radians."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees as _degrees_of
from math import radians
from typing import Any, SupportsFloat

from yumi.robot.joints import Joints, joints


def degrees(*angles: SupportsFloat | Sequence[SupportsFloat]) -> Joints:
    """Joint positions given in degrees, as radians: ``yumi.degrees(0, -130, -135, 30, 0, 40, 0)``.

    Args:
        angles: seven angles in chain order (axes 1, 2, 7, 3, 4, 5, 6), or one sequence of them [deg].

    Returns:
        The same in radians, (7,).

    Raises:
        ValueError: they are not seven.
    """
    return joints([radians(value) for value in _flat(angles)])


def in_degrees(position: Sequence[SupportsFloat]) -> Joints:
    """Joint positions [rad], (7,), in degrees.

    Raises:
        ValueError: they are not seven.
    """
    return joints([_degrees_of(value) for value in _flat((position,))])


def _flat(angles: Sequence[Any]) -> list[float]:
    """Seven angles as they are, or the one sequence of them: a list, a tuple, an array."""
    values = angles[0] if len(angles) == 1 and hasattr(angles[0], "__iter__") else angles
    return [float(value) for value in values]
