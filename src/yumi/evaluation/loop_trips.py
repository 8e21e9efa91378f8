"""Round trips from an application to the EGM loop, the robot and back, leg by leg, by joining three lists of times.

Every goal bears a value of its own, so that it can be found again as the reference of the cycle that took it::

    sent ─ topic ─ heard ─ mailbox ─ datagram ─ cycle ─ reply ─ robot ─ the next datagram but one ─ topic ─ application

The robot takes a reply in the cycle after it and shows the motion it makes of it in the datagram after that.
All times are of one clock [s].
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

SHOWN_AFTER = 2
"""Datagrams from the one that was answered to the one that shows what the robot made of the answer."""

_SAME = 0.001  # [s] a state and its cycle are the same instant, but for the conversion between two clocks


class SentGoal(NamedTuple):
    """A goal.

    Attributes:
        value: by which it is known again.
        sent: when the application published it.
        heard: when it had come through the topic.
    """

    value: float
    sent: float
    heard: float


class LoopCycle(NamedTuple):
    """A cycle of the EGM loop.

    Attributes:
        arrived: when the robot's datagram came.
        replied: when the reply had left.
        value: of the goal it worked with.
    """

    arrived: float
    replied: float
    value: float


class HeardState(NamedTuple):
    """A joint state.

    Attributes:
        stamp: the time of its cycle.
        heard: when the application had it.
    """

    stamp: float
    heard: float


@dataclass(frozen=True, slots=True)
class Trip:
    """A round trip, leg by leg [s].

    Attributes:
        topic: from the application through ROS 2 to the driver.
        mailbox: until a datagram of the robot came and the cycle began.
        cycle: until the reply had left.
        robot: over UDP, through the robot and back.
        state_topic: from the driver through ROS 2 to the application.
    """

    topic: float
    mailbox: float
    cycle: float
    robot: float
    state_topic: float

    @property
    def total(self) -> float:
        """[s]."""
        return self.topic + self.mailbox + self.cycle + self.robot + self.state_topic


LEGS = tuple(item.name for item in fields(Trip))
"""The legs in their order."""


def join_trips(
    goals: Iterable[SentGoal], cycles: Sequence[LoopCycle], states: Sequence[HeardState]
) -> tuple[Trip, ...]:
    """The round trips of all goals that a cycle took and whose state was heard; newer goals replaced the others."""
    taken = _first_cycles(cycles)
    stamps = [state.stamp for state in states]
    trips = []
    for goal in goals:
        index = taken.get(goal.value)
        if index is None or index + SHOWN_AFTER >= len(cycles):
            continue
        cycle, shown = cycles[index], cycles[index + SHOWN_AFTER]
        state = _state_of(shown, states, stamps)
        if state is not None:
            trips.append(_trip(goal, cycle, shown, state))
    return tuple(trips)


def _first_cycles(cycles: Sequence[LoopCycle]) -> Mapping[float, int]:
    first: dict[float, int] = {}
    for index, cycle in enumerate(cycles):
        first.setdefault(cycle.value, index)
    return first


def _state_of(cycle: LoopCycle, states: Sequence[HeardState], stamps: Sequence[float]) -> HeardState | None:
    index = bisect_left(stamps, cycle.arrived - _SAME)
    if index < len(states) and abs(stamps[index] - cycle.arrived) < _SAME:
        return states[index]
    return None


def _trip(goal: SentGoal, cycle: LoopCycle, shown: LoopCycle, state: HeardState) -> Trip:
    """A goal that a cycle took before the second listener had heard it spent no time in the mailbox."""
    heard = min(goal.heard, cycle.arrived) if cycle.arrived >= goal.sent else cycle.replied
    return Trip(
        topic=heard - goal.sent,
        mailbox=max(0.0, cycle.arrived - heard),
        cycle=cycle.replied - max(cycle.arrived, heard),
        robot=shown.arrived - cycle.replied,
        state_topic=state.heard - shown.arrived,
    )
