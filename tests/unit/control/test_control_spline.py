"""Polynomials, and the segments of a long spline: in this process and after crossing to another."""

from __future__ import annotations

import pickle
from itertools import pairwise
from math import inf, isnan, nan

import pytest

from abb_protocols.robot.joints import Side, home
from trajectories import moved
from yumi.control.motion.spline import (
    Segment,
    Segments,
    Spline,
    SplineSampler,
    TrajectoryPoint,
    segment_between,
    spline_through,
)
from yumi.control.motion.spline_limits import excess

HOME = home(Side.LEFT)
POINTS = [TrajectoryPoint(0.1 * number, moved(HOME, 0.01 * (number % 3))) for number in range(3200)]
SEGMENTS = [segment_between(*pair) for pair in pairwise(POINTS)]


@pytest.fixture(scope="module")
def segments() -> Segments:
    return Segments(SEGMENTS)


def test_segments_are_what_they_were_made_of(segments: Segments) -> None:
    assert list(segments) == SEGMENTS
    assert (segments[-1], segments[1500], segments.end(3)) == (SEGMENTS[-1], SEGMENTS[1500], SEGMENTS[3].end)
    assert segments[1499:1502] == tuple(SEGMENTS[1499:1502])
    with pytest.raises(IndexError):
        segments[len(SEGMENTS)]


@pytest.mark.parametrize("protocol", [4, 5])
def test_segments_cross_to_another_process_as_blocks_of_bounded_size(segments: Segments, protocol: int) -> None:
    blocks: list[pickle.PickleBuffer] = []
    callback = blocks.append if protocol == 5 else None
    pickled = pickle.dumps(segments, protocol, buffer_callback=callback)
    crossed = pickle.loads(pickled, buffers=[bytes(block.raw()) for block in blocks])
    assert list(crossed) == SEGMENTS
    if protocol == 5:
        assert len(pickled) < 1000
        assert max(block.raw().nbytes for block in blocks) <= 1 << 20


def test_lead_takes_the_place_of_the_pieces_that_are_over_by_its_end(segments: Segments) -> None:
    lead = Segment(-1.0, 200.05, SEGMENTS[0].rows)
    joined = segments.after(lead)
    assert list(joined) == [lead, *(segment for segment in SEGMENTS if segment.end > lead.end)]
    assert list(pickle.loads(pickle.dumps(joined))) == list(joined)
    assert len(segments) == len(SEGMENTS)


def test_sampler_finds_the_segment_of_any_time(segments: Segments) -> None:
    spline = Spline(segments, POINTS[-1])
    sampler = SplineSampler(spline)
    for time in (0.0, 0.05, 0.15, 250.0, 249.9, 319.89, 1.0, 0.1, 320.0, 150.00001):
        assert sampler.setpoint(time) == SplineSampler(spline).setpoint(time)
    assert spline_through(POINTS).segments[7] == SEGMENTS[7]


def test_polynomial_inside_of_its_range_has_no_excess() -> None:
    assert excess((0.0, 1.0, 0.0), 1.0, -1.0, 1.0) is None


def test_polynomial_outside_of_its_range_is_farthest_out_somewhere() -> None:
    out = excess((0.0, 0.0, 3.0), 1.0, -1.0, 1.0)
    assert out is not None
    assert (out.time, out.value) == (1.0, 3.0)


@pytest.mark.parametrize("polynomial", [(nan, 0.0), (0.0, inf), (0.0, nan, 1.0), (0.0, 1e308, 1e308, -1e308)])
def test_polynomial_that_cannot_be_calculated_with_is_nowhere_inside(polynomial: tuple[float, ...]) -> None:
    out = excess(polynomial, 10.0, -1e300, 1e300)
    assert out is not None
    assert isnan(out.value)
