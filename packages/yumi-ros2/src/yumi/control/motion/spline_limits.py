"""The limits of a spline: whether the joints keep them, by values, derivatives and extremes of its polynomials.

A polynomial is the sequence of its coefficients, the constant one first. Without numpy: its linear algebra starts
threads, not wanted in the control process, where blends are checked.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import comb, isfinite, nan
from typing import NamedTuple

from abb_protocols.catalogue import message
from abb_protocols.robot.joints import JointLimits
from yumi.control.motion.spline import Segment
from yumi.control.trajectory_commands import trajectory_refused

_HALVINGS = 50

_BERNSTEIN = {
    count: [[comb(i, k) / comb(count - 1, k) for k in range(i + 1)] for i in range(count)] for count in range(1, 7)
}
"""How much of each scaled coefficient is in each Bernstein coefficient, for polynomials of so many coefficients."""


class Excess(NamedTuple):
    """Where a polynomial is farthest outside of a range.

    Attributes:
        time: from the begin of its stretch.
        value: its value there.
    """

    time: float
    value: float


def value_at(polynomial: Sequence[float], time: float) -> float:
    """Its value, by Horner's rule."""
    value = 0.0
    for coefficient in reversed(polynomial):
        value = value * time + coefficient
    return value


def derivative(polynomial: Sequence[float]) -> tuple[float, ...]:
    """Its rate of change."""
    return tuple([power * coefficient for power, coefficient in enumerate(polynomial)][1:])


def hull(polynomial: Sequence[float], length: float) -> tuple[float, float]:
    """Two values between which it stays for times from 0 to ``length``: the ends of its Bernstein coefficients.

    They are not finite where its numbers are too large to be calculated with.
    """
    scaled = [coefficient * length**power for power, coefficient in enumerate(polynomial)]
    values = [sum([part * term for part, term in zip(row, scaled, strict=False)]) for row in _BERNSTEIN[len(scaled)]]
    return (min(values), max(values)) if all(map(isfinite, values)) else (nan, nan)


def excess(polynomial: Sequence[float], length: float, lowest: float, highest: float) -> Excess | None:
    """Where it is farthest outside of ``lowest`` to ``highest`` for times from 0 to ``length``; None if nowhere.

    Its Bernstein coefficients bound it from both sides, which is enough for most. A polynomial whose numbers are too
    large to be calculated with is nowhere inside: its value is NaN.
    """
    least, most = hull(polynomial, length)
    if not isfinite(least) or not isfinite(most):
        return Excess(0.0, nan)
    if lowest <= least and most <= highest:
        return None

    def outside(point: Excess) -> float:
        return max(lowest - point.value, point.value - highest)

    times = (0.0, *_roots(derivative(polynomial), length), length)
    worst = max((Excess(time, value_at(polynomial, time)) for time in times), key=outside)
    return None if outside(worst) <= 0.0 else worst


def _roots(polynomial: Sequence[float], length: float) -> list[float]:
    """Where it changes its sign between 0 and ``length``, in order: by halving between the points where it turns."""
    if len(polynomial) < 2:
        return []
    turns = (0.0, *_roots(derivative(polynomial), length), length)
    found = []
    for begin, end in pairwise(turns):
        low, high, start = begin, end, value_at(polynomial, begin)
        if start * value_at(polynomial, end) > 0.0:
            continue
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if value_at(polynomial, middle) * start > 0.0 else (low, middle)
        found.append(0.5 * (low + high))
    return found


ROUNDING = 1.0 + 1e-6  # a spline that uses a limit fully is not refused for its last digit
_RANGE_ROUNDING = 1e-9  # [rad]


def check_motion(segments: Sequence[Segment], names: Sequence[str], limits: JointLimits) -> None:
    """Refuse a way on which a joint leaves its range or is too fast, between the points, too.

    Raises:
        TrajectoryRefused: with the joint, the time and the limit.
    """
    bounds = list(zip(limits.lower, limits.upper, limits.velocity, limits.acceleration, strict=True))
    for segment in segments:
        length = segment.end - segment.begin
        for index, (row, (low, high, speed, strength)) in enumerate(zip(segment.rows, bounds, strict=True)):
            # Sums of what each term adds bound the motion; for dense points that is all there is to calculate.
            start, b, c, d, e, f = row
            b, c, d, e, f = abs(b), abs(c) * length, abs(d) * length**2, abs(e) * length**3, abs(f) * length**4
            way = length * (b + c + d + e + f)
            if not (
                low <= start - way
                and start + way <= high
                and b + 2.0 * c + 3.0 * d + 4.0 * e + 5.0 * f <= speed
                and 2.0 * c + 6.0 * d + 12.0 * e + 20.0 * f <= strength * length
            ):
                out = excess(row, length, min(low, start) - _RANGE_ROUNDING, max(high, start) + _RANGE_ROUNDING)
                if out is not None:
                    raise trajectory_refused(
                        message(
                            "trajectory_leaves_range",
                            joint=names[index],
                            position=out.value,
                            time=segment.begin + out.time,
                            lower=limits.lower[index],
                            upper=limits.upper[index],
                        )
                    )
                velocity = derivative(row)
                _check_rate("velocity", "rad/s", velocity, speed, names[index], segment)
                _check_rate("acceleration", "rad/s²", derivative(velocity), strength, names[index], segment)


def check_lead(lead: Segment, names: Sequence[str], limits: JointLimits) -> None:
    """As :func:`check_motion`; a chosen way must not jerk a joint too much, a given one may."""
    check_motion((lead,), names, limits)
    for name, row, limit in zip(names, lead.rows, limits.jerk, strict=True):
        _check_rate("jerk", "rad/s³", derivative(derivative(derivative(row))), limit, name, lead)


def _check_rate(quantity: str, unit: str, rate: Sequence[float], limit: float, name: str, segment: Segment) -> None:
    out = excess(rate, segment.end - segment.begin, -limit * ROUNDING, limit * ROUNDING)
    if out is not None:
        raise trajectory_refused(
            message(
                "trajectory_beyond_limit",
                joint=name,
                quantity=quantity,
                value=out.value,
                unit=unit,
                time=segment.begin + out.time,
                limit=limit,
            )
        )
