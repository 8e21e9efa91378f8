"""RAPID's ``confdata``: which of the postures of a pose is meant."""

from __future__ import annotations

from math import floor, pi
from typing import NamedTuple

from abb_protocols.robot.joints import Joints

CONFIGURATION_TOLERANCE = 1e-4
"""So far below zero, or below another border of a configuration, an arm that stands there may be [rad].

Ten times the difference from the plan with which it counts as standing: axis 4 at 0 is not in the quarter below.
"""


class Confdata(NamedTuple):
    """RAPID's ``confdata``: which of the postures of a pose and an arm angle is meant (reference/robots.md).

    Attributes:
        cf1: quarter turn of axis 1, rounded down: 0 from 0° to 90°, -1 from -90° to 0°.
        cf4: the same of axis 4.
        cf6: the same of axis 6.
        cfx: the branch, 0 to 7: 4 if a2 < 0°, 2 if a5 < 0°, 1 if a3 < -90°, added up.
    """

    cf1: int
    cf4: int
    cf6: int
    cfx: int


def quarter_turn(angle: float) -> int:
    """The quarter turn an angle [rad] is in, for ``confdata``: 0 from 0° to 90°, -1 below."""
    return floor((angle + CONFIGURATION_TOLERANCE) / (pi / 2.0))


def configuration(position: Joints) -> Confdata:
    """The configuration of a posture [rad].

    Quarter turns rounded down are ABB's rule. Between two branches the arm passes a singularity.
    That a2 counts 4 and a3 counts 1 is inferred from public targets of YuMi arms, that a5 counts 2 from what is left;
    ABB's manual was not at hand.
    """
    a1, a2, _, a3, a4, a5, a6 = position
    below = -CONFIGURATION_TOLERANCE
    cfx = 4 * (a2 < below) + 2 * (a5 < below) + (a3 < below - pi / 2.0)
    return Confdata(quarter_turn(a1), quarter_turn(a4), quarter_turn(a6), cfx)
