"""Motions to single points, from any state the joints may be in: what every one of them must keep."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import YUMI_LIMITS, JointLimits, Joints, Side, home, joints
from yumi.control.motion.point_motion import PointMotion, point_stop, point_travel
from yumi.control.motion.setpoint import Setpoint

STEP = 0.004
LOOSE = 1.0 + 1e-6


def positions() -> st.SearchStrategy[Joints]:
    ranges = zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)
    return st.tuples(*(st.floats(low, high) for low, high in ranges)).map(joints)


def limits() -> st.SearchStrategy[JointLimits]:
    return st.builds(YUMI_LIMITS.slower, st.floats(0.05, 1.0), st.floats(0.05, 1.0), st.just(pi))


@st.composite
def starts(draw: st.DrawFn) -> Setpoint:
    """What the joints do at some moment of a motion that keeps the limits."""
    motion = point_travel(Setpoint(draw(positions())), draw(positions()), draw(limits()))
    return motion.setpoint(draw(st.floats(0.0, 1.0)) * motion.duration)


def setpoints(motion: PointMotion) -> Iterator[Setpoint]:
    return (motion.setpoint(count * STEP) for count in range(int(motion.duration / STEP) + 2))


@settings(deadline=None)
@given(positions(), positions(), limits())
def test_motion_from_rest_keeps_every_limit_and_ends_at_its_goal(
    here: Joints, there: Joints, kept: JointLimits
) -> None:
    motion = point_travel(Setpoint(here), there, kept)
    for _, velocity, acceleration in setpoints(motion):
        assert all(abs(now) <= top * LOOSE for now, top in zip(velocity, kept.velocity, strict=True))
        assert all(abs(now) <= top * LOOSE for now, top in zip(acceleration, kept.acceleration, strict=True))
    assert motion.setpoint(motion.duration) == Setpoint(there)


@settings(deadline=None)
@given(starts(), positions(), limits())
def test_replanned_motion_begins_where_the_joints_are(start: Setpoint, goal: Joints, kept: JointLimits) -> None:
    try:
        first = point_travel(start, goal, kept).setpoint(0.0)
    except CommandRefused:
        first = point_stop(start, YUMI_LIMITS).setpoint(0.0)
    for now, before in zip(first, start, strict=True):
        assert now == pytest.approx(before, abs=1e-6)


@settings(deadline=None)
@given(starts(), positions(), limits())
def test_replanned_motion_stays_in_range_or_is_refused(start: Setpoint, goal: Joints, kept: JointLimits) -> None:
    try:
        motion = point_travel(start, goal, kept)
    except CommandRefused:
        motion = point_stop(start, YUMI_LIMITS)
    for position, _, _ in setpoints(motion):
        bounds = zip(YUMI_LIMITS.lower, position, YUMI_LIMITS.upper, strict=True)
        assert all(low - 1e-5 <= value <= high + 1e-5 for low, value, high in bounds)


@settings(deadline=None)
@given(starts())
def test_stop_ends_at_rest_within_the_shortest_time_of_the_slowest_joint(start: Setpoint) -> None:
    motion = point_stop(start, YUMI_LIMITS)
    assert motion.setpoint(motion.duration).velocity == pytest.approx([0.0] * 7)
    assert motion.duration < pi / 20.0 + 3.0 * 20.0 / 300.0


def test_motion_from_rest_is_a_straight_line_in_joint_space() -> None:
    here = home(Side.RIGHT)
    there = joints([value + step for value, step in zip(here, (0.5, 0.2, -0.3, 0.1, 0.4, -0.2, 1.0), strict=True)])
    motion = point_travel(Setpoint(here), there, YUMI_LIMITS)
    on_its_way = zip(motion.setpoint(motion.duration / 3.0).position, here, there, strict=True)
    shares = [(now - old) / (end - old) for now, old, end in on_its_way]
    assert shares == pytest.approx([shares[0]] * 7)
