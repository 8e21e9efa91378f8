"""The seven key performance indicators of the thesis's table 4.2, with the limits it suggests.

It measured only the last two. Its limits are suggestions, not requirements of a standard.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from yumi_evaluation.experiments import TOLERANCE_DEG
from yumi_evaluation.metrics import Distribution, Series, distribution
from yumi_evaluation.round_trips import LEGS, RoundTrip

MOTION_DELAY = 0.300
"""From a command until the joint moves [s]."""

WORST_TO_MEAN = 5.0
"""The worst round trip, as a multiple of the mean one."""

LONGEST_TRIP = 0.250
"""What that comes to with the mean round trip the thesis expects, 50 ms [s]."""

END_TO_END = 0.175
"""From the application to the robot: half of a round trip [s]."""

JITTER = 0.045
"""Mean deviation of the end-to-end latency from its mean [s]."""

LOSS = 0.001
"""Fraction of the datagrams; the thesis says "little expected", the number is ours."""

CONTROL_LAG = 0.300
"""Of a followed reference [s]."""

MOVED_DEG = 0.01
"""By how much a joint has moved when one sees that it moves [°]."""


@dataclass(frozen=True, slots=True)
class Kpi:
    """One indicator.

    Attributes:
        name: stable, for JSON.
        title: in tables.
        value: what was measured; None when it was not.
        limit: what the thesis suggests; the value must not be higher.
        unit: of both.
        note: how it was measured.
    """

    name: str
    title: str
    value: float | None
    limit: float
    unit: str
    note: str

    @property
    def holds(self) -> bool | None:
        return None if self.value is None else self.value <= self.limit


@dataclass(frozen=True, slots=True)
class Measured:
    """What the indicators are made of.

    Attributes:
        motion_delays: from goals until the joint moved [s].
        trips: round trips to the EGM loop.
        machine_trips: round trips to the state machine, leg by leg: name to times [s].
        datagrams: how many the robot sent while they were counted.
        lost: how many of them, or of the answers to them, did not arrive in time.
        control_lag: the longest of a followed sine [s].
        precision_deg: largest distance of the joint from the reference of the moment [°].
    """

    motion_delays: tuple[float, ...] = ()
    trips: tuple[RoundTrip, ...] = ()
    machine_trips: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    datagrams: int = 0
    lost: int = 0
    control_lag: float | None = None
    precision_deg: float | None = None


def kpis(measured: Measured) -> tuple[Kpi, ...]:
    """All seven, in the order of the table."""
    ends = {
        "to the EGM loop": distribution([trip.total for trip in measured.trips]),
        "to the state machine": distribution(machine_totals(measured.machine_trips)),
    }
    found = {where: each for where, each in ends.items() if each.count}
    half_mean = max((0.5 * each.mean for each in found.values()), default=None)
    half_jitter = max((0.5 * each.jitter for each in found.values()), default=None)
    worst = max((each.highest / each.mean for each in found.values() if each.mean > 0.0), default=None)
    longest = "; ".join(
        f"{where}: of {each.count} the longest took {1e3 * each.highest:.0f} ms, the mean {1e3 * each.mean:.1f} ms"
        for where, each in found.items()
    )
    # The limit rests on a mean of 50 ms; a loop that is quicker is held to less.
    allowed = f"with the mean of 50 ms that the thesis expects, {1e3 * LONGEST_TRIP:g} ms would be allowed"
    paths = " or ".join(found) + (", whichever takes longer" if len(found) > 1 else "")
    steps = f"the longest of {len(measured.motion_delays)} steps"
    loss = measured.lost / measured.datagrams if measured.datagrams else None
    return (
        Kpi(
            "motion_delay_s",
            "motion delay",
            max(measured.motion_delays, default=None),
            MOTION_DELAY,
            "s",
            f"from a goal until the joint has moved by {MOVED_DEG:g}°; {steps}",
        ),
        Kpi(
            "worst_to_mean_round_trip",
            "worst round trip to mean round trip",
            worst,
            WORST_TO_MEAN,
            "",
            f"{longest}; {allowed}" if longest else "none was made",
        ),
        Kpi("end_to_end_s", "end-to-end latency", half_mean, END_TO_END, "s", f"half of the mean round trip {paths}"),
        Kpi("jitter_s", "mean jitter", half_jitter, JITTER, "s", "mean deviation of the latency from its mean"),
        Kpi("packet_loss", "packet loss", loss, LOSS, "", f"{measured.lost} of {measured.datagrams} datagrams"),
        Kpi(
            "control_lag_s",
            "control lag of a followed sine",
            measured.control_lag,
            CONTROL_LAG,
            "s",
            "the longest; a sine of 10° with P = 2, the thesis's controller",
        ),
        Kpi(
            "precision_deg",
            "distance from a followed sine",
            measured.precision_deg,
            TOLERANCE_DEG,
            "°",
            "the largest after the start; a sine of 10° with feed-forward and prediction",
        ),
    )


def legs(trips: Sequence[RoundTrip]) -> Mapping[str, Distribution]:
    """Every leg of the round trips to the EGM loop, and ``total``."""
    found = {leg: distribution([getattr(trip, leg) for trip in trips]) for leg in LEGS}
    return found | {"total": distribution([trip.total for trip in trips])}


def machine_legs(times: Mapping[str, Sequence[float]]) -> Mapping[str, Distribution]:
    """Every leg of the round trips to the state machine, and ``total``."""
    found = {leg: distribution(each) for leg, each in times.items()}
    return found | {"total": distribution(machine_totals(times))} if times else {}


def machine_totals(times: Mapping[str, Sequence[float]]) -> list[float]:
    """Whole round trips: the legs were measured one after the other."""
    return [sum(each) for each in zip(*times.values(), strict=True)] if times else []


def motion_delay(measured_deg: Series) -> float | None:
    """When a joint that got its goal at time 0 had visibly begun to move [s]; None when it did not."""
    times, angles = measured_deg.T
    has_moved = np.abs(angles - angles[0]) > MOVED_DEG
    return float(times[has_moved.argmax()]) if has_moved.any() else None
