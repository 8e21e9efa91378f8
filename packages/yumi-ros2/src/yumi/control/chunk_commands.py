"""Commands of chunks, a policy's next points: what a controller is to follow, and what it made of that."""

from __future__ import annotations

from dataclasses import dataclass

from abb_protocols.catalogue import Message, message
from yumi.control.motion.spline import Spline

MOST_JUMP = 0.2
"""A chunk is at most so far from where the arm is commanded to be, where its sender allows no more or less [rad]."""


@dataclass(frozen=True, slots=True)
class FollowChunk:
    """A command: follow the points of a chunk, in place of those that have not been executed yet.

    Attributes:
        number: by which its end is reported.
        start: when the time 0 of the spline is due, on the machine's monotonic clock [s].
        spline: through its points, seven joints in chain order; its last point has a velocity and an acceleration.
        jump: at most so far from the chunk the arm may be commanded [rad], beside the time that the chunk gives.
        is_of_both: whether its sender leads both arms: where one is led on by something else, or stopped, the other one
            brakes.
    """

    number: int
    start: float
    spline: Spline
    jump: float = MOST_JUMP
    is_of_both: bool = False


@dataclass(frozen=True, slots=True)
class ChunkTaken:
    """What an arm made of a chunk.

    All times are on the machine's monotonic clock [s]; where the speed scale is below 1, they hold while that stays.

    Attributes:
        late: how many of its points were dropped, since they were due already.
        replaced: how many points of the chunks before are not executed, since this chunk has replaced them.
        seam: when the arm leaves the chunks before.
        joined: when it has arrived on the path through the points of this chunk.
        until: when the last point is due.
    """

    late: int
    replaced: int
    seam: float
    joined: float
    until: float


@dataclass(frozen=True, slots=True)
class ChunksExhausted:
    """A report: the points of all chunks have been executed, and the arm brakes.

    Attributes:
        number: of the last chunk.
        time: when the last point was due, on the machine's monotonic clock [s].
    """

    number: int
    time: float

    @property
    def said(self) -> Message:
        """The same for a person."""
        return message("chunks_exhausted", number=self.number)

    def __str__(self) -> str:
        return str(self.said)
