"""The counters of one arm, each declared once: values that its snapshot contains as they are."""

from __future__ import annotations

from typing import NamedTuple


class WireCounters(NamedTuple):
    """What an arm's connection has received: counts since the start, the rest of the session.

    Attributes:
        session: number of the session, 0 before the first.
        missed: states the robot sent that got no answer of their own; lost, late and stale ones.
        lost: states that never arrived (gaps in the sequence numbers).
        late: states that waited together with a newer one, which was answered instead.
        stale: states that arrived after a newer one was answered.
        repeated: states that arrived before.
        malformed: datagrams that could not be read.
        foreign: datagrams from other addresses than the robot's, while no session is open.
        jitter: mean difference of two datagrams' delays [s].
        worst_jitter: the largest such difference [s].
        drift_ppm: by how much the robot's clock is faster than ours [ppm].
        cycle_time: mean time between two datagrams the robot sent, by our clock [s].
    """

    session: int = 0
    missed: int = 0
    lost: int = 0
    late: int = 0
    stale: int = 0
    repeated: int = 0
    malformed: int = 0
    foreign: int = 0
    jitter: float = 0.0
    worst_jitter: float = 0.0
    drift_ppm: float = 0.0
    cycle_time: float = 0.0


class LimiterCounters(NamedTuple):
    """Cycles in which the limiter changed something.

    Attributes:
        refused: commands with a value that is no finite number; the arm held instead.
        position_limited: commands cut at a joint's range.
        slowed: commands that would have exceeded a joint's speed, acceleration or jerk.
        implausible: measured or planned positions that no arm can have reached.
        kept_apart: commands that would have led an arm too near to something.
        feedforward_withheld: speeds not fed forward, since the robot would have coasted too near to something.
        unanswered: datagrams that the core answered, since no controller had in time; the arm braked.
    """

    refused: int = 0
    position_limited: int = 0
    slowed: int = 0
    implausible: int = 0
    kept_apart: int = 0
    feedforward_withheld: int = 0
    unanswered: int = 0
