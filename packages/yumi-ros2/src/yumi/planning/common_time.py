"""Plans of several arms that begin and end at the same time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from abb_protocols.robot.joints import Side
from yumi.control.motion.spline import Coefficients, Segment, Segments, Spline
from yumi.control.trajectory_commands import ArmPlan

_TOGETHER = 0.1  # [s] each arm has a short trajectory by then
_HANDING_OVER = 30e-6  # [s] for each point, to both arms, twice


def started_together(plans: Mapping[Side, ArmPlan], now: float) -> Mapping[Side, ArmPlan]:
    """Plans of several arms, which start at the same moment after ``now`` [s]: each arm has its plan by then.

    One arm alone starts at once.
    """
    if len(plans) < 2:
        return plans
    start = now + time_to_start(max(len(each.spline.segments) + 1 for each in plans.values()))
    return {side: replace(each, start=start) for side, each in plans.items()}


def time_to_start(points: int) -> float:
    """So long after it was asked for do both arms start a trajectory of so many points [s]."""
    return max(_TOGETHER, points * _HANDING_OVER)


def ended_together(plans: Mapping[Side, ArmPlan]) -> Mapping[Side, ArmPlan]:
    """Plans of several arms, which end at the same time: those that are shorter take more time for the same way."""
    longest = max(each.spline.end for each in plans.values())
    return {side: stretched(each, longest) for side, each in plans.items()}


def stretched(plan: ArmPlan, end: float) -> ArmPlan:
    """The same way in more time: it ends at ``end`` [s], at or after its own end."""
    spline, factor = plan.spline, end / plan.spline.end if plan.spline.end else 1.0
    if factor == 1.0:
        return plan

    def slower(row: Coefficients) -> Coefficients:
        a, b, c, d, e, f = row
        return a, b / factor, c / factor**2, d / factor**3, e / factor**4, f / factor**5

    segments = Segments(
        Segment(each.begin * factor, each.end * factor, tuple(map(slower, each.rows))) for each in spline.segments
    )
    return replace(plan, spline=Spline(segments, spline.last._replace(time=end, velocity=(), acceleration=())))
