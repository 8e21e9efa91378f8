"""What two arms that follow one trajectory tell each other, through a mailbox each, in every cycle.

Each has the same trajectory with the same start on the machine's one monotonic clock, so neither waits for the other;
they only watch each other, and end together.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple, Protocol

from yumi.control.mailbox import Mailbox
from yumi.control.trajectory_feedback import Skew

PARTNER_SIZE = 6
"""Numbers in a partner's mailbox."""

PARTNER_SILENCE = 0.250
"""An arm that says nothing for so long follows no longer [s]. What ends its motion it tells at once, the loss of its
robot, too; what remains is a process that has died, and on a busy machine each may be late by tens of milliseconds."""


class Phase(IntEnum):
    """How far an arm is with its part."""

    RUNNING = 0
    REACHED = 1
    SUCCEEDED = 2
    CANCELED = 3
    ABORTED = 4


class PartnerReport(NamedTuple):
    """What an arm tells its partner.

    Attributes:
        goal: number of the order it is about.
        phase: how far it is.
        time: when it was so, on the machine's monotonic clock [s].
        first: when the first cycle came in which it was told to move, on the same clock; 0 before [s].
        progress: where on the trajectory it was told to be [s].
        code: the result code, once it has failed.
    """

    goal: int
    phase: Phase
    time: float
    first: float
    progress: float
    code: int = 0


class Partner(Protocol):
    """The arm that follows the other part of the trajectory, or nobody."""

    def tell(self, report: PartnerReport) -> None:
        """Let it know."""

    def hear(self) -> PartnerReport | None:
        """What it told last; None when there is nobody, or it has never told anything."""

    @property
    def is_there(self) -> bool:
        """Whether there is a partner at all."""


class Nobody:
    """The partner of an arm that follows a trajectory alone."""

    is_there = False

    def tell(self, report: PartnerReport) -> None: ...

    def hear(self) -> PartnerReport | None:
        return None


class OtherArm:
    """The other arm, in this process or another.

    Args:
        ours: where it looks.
        theirs: where it tells.
    """

    is_there = True

    def __init__(self, ours: Mailbox, theirs: Mailbox) -> None:
        self._ours = ours
        self._theirs = theirs

    def tell(self, report: PartnerReport) -> None:
        self._ours.put(tuple(map(float, report)))

    def hear(self) -> PartnerReport | None:
        letter = self._theirs.peek()
        if letter is None:
            return None
        goal, phase, time, first, progress, code = letter[1]
        return PartnerReport(int(goal), Phase(int(phase)), time, first, progress, int(code))


class SkewWatch:
    """The largest differences in time between two arms that follow one trajectory."""

    def __init__(self) -> None:
        self._start = self._worst = 0.0

    def note(self, ours: PartnerReport, theirs: PartnerReport, rate: float) -> None:
        """Compare where both are, at the same moment; ``rate`` is how fast time goes by on the trajectory."""
        if not ours.first or not theirs.first:
            return
        self._start = ours.first - theirs.first
        if rate > 0.0:
            difference = (ours.progress - theirs.progress) / rate - (ours.time - theirs.time)
            self._worst = max(self._worst, abs(difference))

    @property
    def skew(self) -> Skew:
        return Skew(self._start, self._worst)
