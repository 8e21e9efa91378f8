"""The seven key performance indicators of the publication's table 4.2, with the limits it suggests.

It measured only the last two. Its limits are suggestions, not requirements of a standard.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isnan

from yumi_evaluation.experiment import TOLERANCE_DEG
from yumi_evaluation.metrics import Distribution, Series, distribution
from yumi_evaluation.round_trips import LEGS, Trip

MOTION_DELAY = 0.300
"""From a command until the joint moves [s]."""

WORST_TO_MEAN = 5.0
"""The worst round trip, as a multiple of the mean one."""

LONGEST_TRIP = 0.250
"""What that comes to with the mean round trip the publication expects, 50 ms [s]."""

END_TO_END = 0.175
"""From the application to the robot: half of a round trip [s]."""

JITTER = 0.045
"""Mean deviation of the end-to-end latency from its mean [s]."""

LOSS = 0.001
"""Share of the datagrams; the publication says "little expected"."""

CONTROL_LAG = 0.300
"""Of a followed reference [s]."""

MOVED_DEG = 0.01
"""By how much a joint has moved when one sees that it moves [°]."""


@dataclass(frozen=True, slots=True)
class Kpi:
    """One indicator.

    Attributes:
        name: stable, for JSON.
        title: for people.
        value: what was measured; None when it was not.
        limit: what the publication suggests; the value shall not be higher.
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
        machine_trips: round trips to the state machine, leg by leg: name to times [s]; None where there were none.
        datagrams: how many the robot sent while they were counted.
        lost: how many of them, or of the answers to them, did not arrive in time.
        control_lag: the longest of a followed sine [s].
        precision_deg: how far the joint is from the reference of the moment, at most [°].
    """

    motion_delays: tuple[float, ...] = ()
    trips: tuple[Trip, ...] = ()
    machine_trips: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    datagrams: int = 0
    lost: int = 0
    control_lag: float | None = None
    precision_deg: float | None = None


def kpis(measured: Measured) -> tuple[Kpi, ...]:
    """All seven, in the order of the table."""
    egm = distribution([trip.total for trip in measured.trips])
    machine = distribution(machine_totals(measured.machine_trips))
    mean, jitter = _worst(egm.mean, machine.mean), _worst(egm.jitter, machine.jitter)
    worst_to_mean = _worst(_ratio(egm), _ratio(machine))
    delay = max(measured.motion_delays, default=None)
    loss = measured.lost / measured.datagrams if measured.datagrams else None
    paths = "to the EGM loop" + (" or to the state machine, whichever takes longer" if machine.count else "")
    return (
        Kpi("motion_delay_s", "motion delay", delay, MOTION_DELAY, "s", _motion_note(measured)),
        Kpi(
            "worst_to_mean_round_trip",
            "worst round trip to mean round trip",
            worst_to_mean,
            WORST_TO_MEAN,
            "",
            _worst_note(egm, machine),
        ),
        Kpi("end_to_end_s", "end-to-end latency", _half(mean), END_TO_END, "s", f"half of the mean round trip {paths}"),
        Kpi("jitter_s", "mean jitter", _half(jitter), JITTER, "s", "mean deviation of the latency from its mean"),
        Kpi("packet_loss", "packet loss", loss, LOSS, "", f"{measured.lost} of {measured.datagrams} datagrams"),
        Kpi(
            "control_lag_s",
            "control lag of a followed sine",
            measured.control_lag,
            CONTROL_LAG,
            "s",
            "the longest; a sine of 10° with P = 2, the thesis's law",
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


def legs(trips: Sequence[Trip]) -> Mapping[str, Distribution]:
    """Every leg of the round trips, and ``total``."""
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
    """When a joint that was told to move at time 0 had visibly begun to [s]."""
    first = measured_deg[0][1]
    return next((time for time, value in measured_deg if abs(value - first) > MOVED_DEG), None)


def _worst_note(egm: Distribution, machine: Distribution) -> str:
    """The publication's limit rests on a mean of 50 ms; a loop that is quicker is held to less."""
    ends = (("to the EGM loop", egm), ("to the state machine", machine))
    told = [_longest_note(where, found) for where, found in ends if found.count]
    if not told:
        return "none was made"
    allowed = f"with the mean of 50 ms that the thesis expects, {1e3 * LONGEST_TRIP:g} ms would be allowed"
    return f"{'; '.join(told)}; {allowed}"


def _longest_note(where: str, found: Distribution) -> str:
    return (
        f"{where}: of {found.count} the longest took {1e3 * found.highest:.0f} ms, the mean {1e3 * found.mean:.1f} ms"
    )


def _motion_note(measured: Measured) -> str:
    return (
        f"from a goal until the joint has moved by {MOVED_DEG:g}°; the longest of {len(measured.motion_delays)} steps"
    )


def _ratio(found: Distribution) -> float | None:
    return found.highest / found.mean if found.count and found.mean > 0.0 else None


def _worst(*values: float | None) -> float | None:
    return max([value for value in values if value is not None and not isnan(value)], default=None)


def _half(value: float | None) -> float | None:
    return None if value is None else 0.5 * value
