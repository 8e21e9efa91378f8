"""The formula by which the core samples a controller itself, before Python runs."""

from __future__ import annotations

from typing import NamedTuple

from abb_protocols.robot.joints import Joints


class Sampled(NamedTuple):
    """The formula by which the core samples a controller itself: ``position + gains · (goal - position)``.

    The goal is the newest in shared memory that is meant for the session, or else the one that was taken last.

    Attributes:
        address: of the goals in memory, of a ``SharedBuffer[SessionGoal]``.
        taken: number of the goal that was taken last.
        goal: which was that [rad], (7,).
        gains: of the joints, (7,); None goes to the goal itself.
    """

    address: int
    taken: int
    goal: Joints
    gains: Joints | None = None
