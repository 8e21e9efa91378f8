"""What holds for every spline: it passes through its points, and never leaves what it was checked against."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.robot.joints import ZERO_JOINTS
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.spline import SplineSampler, TrajectoryPoint, spline_through
from yumi.control.motion.spline_limits import derivative, excess, value_at

angles = st.floats(-1.5, 1.5)
sevens = st.tuples(*[angles] * 7)
steps = st.floats(0.05, 2.0)
polynomials = st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=6)


@st.composite
def points(draw: st.DrawFn, fields: int) -> list[TrajectoryPoint]:
    """Two to six points with positions and as many of the other two ``fields``."""
    times = list(itertools.accumulate(draw(st.lists(steps, min_size=2, max_size=6))))
    return [TrajectoryPoint(time, *(draw(sevens) for _ in range(fields))) for time in times]


@given(st.one_of(points(1), points(2), points(3)))
def test_spline_passes_through_its_points(way: list[TrajectoryPoint]) -> None:
    walk = SplineSampler(spline_through(way))
    for point in way:
        assert walk.position(point.time) == pytest.approx(point.position, abs=1e-9)


@given(st.one_of(points(2), points(3)))
def test_spline_has_the_velocities_of_its_points_from_both_sides(way: list[TrajectoryPoint]) -> None:
    for piece, start, end in zip(spline_through(way).segments, way, way[1:], strict=False):
        for index, row in enumerate(piece.rows):
            speed = derivative(row)
            assert value_at(speed, 0.0) == pytest.approx(start.velocity[index], abs=1e-9)
            assert value_at(speed, piece.end - piece.begin) == pytest.approx(end.velocity[index], abs=1e-6)


@given(points(3))
def test_quintic_spline_has_the_accelerations_of_its_points_from_both_sides(way: list[TrajectoryPoint]) -> None:
    for piece, start, end in zip(spline_through(way).segments, way, way[1:], strict=False):
        for index, row in enumerate(piece.rows):
            acceleration = derivative(derivative(row))
            assert value_at(acceleration, 0.0) == pytest.approx(start.acceleration[index], abs=1e-9)
            assert value_at(acceleration, piece.end - piece.begin) == pytest.approx(end.acceleration[index], abs=1e-4)


@given(points(3), st.lists(st.floats(-1.0, 20.0), min_size=1, max_size=10))
def test_walk_tells_the_same_at_times_in_any_order(way: list[TrajectoryPoint], times: list[float]) -> None:
    spline = spline_through(way)
    walk = SplineSampler(spline)
    for time in times:
        assert walk.setpoint(time) == SplineSampler(spline).setpoint(time)
        assert walk.motion(time)[0] == walk.position(time)


@given(points(2))
def test_walk_rests_before_the_begin_and_after_the_end(way: list[TrajectoryPoint]) -> None:
    walk = SplineSampler(spline_through(way))
    assert walk.setpoint(way[0].time - 0.01) == Setpoint(pytest.approx(way[0].position))
    assert walk.motion(way[-1].time)[1] is ZERO_JOINTS


@given(polynomials, st.floats(0.01, 3.0), st.floats(-4.0, 0.0), st.floats(0.0, 4.0))
def test_excess_is_at_least_what_any_moment_shows(
    polynomial: list[float], length: float, lowest: float, highest: float
) -> None:
    values = [value_at(polynomial, length * share / 200.0) for share in range(201)]
    worst = excess(polynomial, length, lowest, highest)
    shown = max(max(lowest - value, value - highest) for value in values)
    if worst is None:
        assert shown <= 1e-9
    else:
        assert max(lowest - worst.value, worst.value - highest) >= shown - 1e-6
        assert value_at(polynomial, worst.time) == pytest.approx(worst.value, abs=1e-9)
