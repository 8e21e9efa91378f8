"""The pieces of a long spline: one block of numbers after the other, in this process and after crossing to another."""

from __future__ import annotations

import pickle
from itertools import pairwise

import pytest

from trajectories import moved
from yumi.control.trajectory import (
    Segment,
    Segments,
    Spline,
    SplineSampler,
    TrajectoryPoint,
    segment_between,
    spline_through,
)
from yumi.robot.joints import Side, home

HOME = home(Side.LEFT)
POINTS = [TrajectoryPoint(0.1 * number, moved(HOME, 0.01 * (number % 3))) for number in range(3200)]
PIECES = [segment_between(*pair) for pair in pairwise(POINTS)]


@pytest.fixture(scope="module")
def pieces() -> Segments:
    return Segments(PIECES)


def test_pieces_are_what_they_were_made_of(pieces: Segments) -> None:
    assert list(pieces) == PIECES
    assert (pieces[-1], pieces[1500], pieces.end(3)) == (PIECES[-1], PIECES[1500], PIECES[3].end)
    assert pieces[1499:1502] == tuple(PIECES[1499:1502])
    with pytest.raises(IndexError):
        pieces[len(PIECES)]


@pytest.mark.parametrize("protocol", [4, 5])
def test_pieces_cross_to_another_process_as_blocks_of_bounded_size(pieces: Segments, protocol: int) -> None:
    blocks: list[pickle.PickleBuffer] = []
    callback = blocks.append if protocol == 5 else None
    pickled = pickle.dumps(pieces, protocol, buffer_callback=callback)
    crossed = pickle.loads(pickled, buffers=[bytes(block.raw()) for block in blocks])
    assert list(crossed) == PIECES
    if protocol == 5:
        assert len(pickled) < 1000
        assert max(block.raw().nbytes for block in blocks) <= 1 << 20


def test_lead_takes_the_place_of_the_pieces_that_are_over_by_its_end(pieces: Segments) -> None:
    lead = Segment(-1.0, 200.05, PIECES[0].rows)
    joined = pieces.after(lead)
    assert list(joined) == [lead, *(piece for piece in PIECES if piece.end > lead.end)]
    assert list(pickle.loads(pickle.dumps(joined))) == list(joined)
    assert len(pieces) == len(PIECES)


def test_walk_finds_its_way_wherever_it_is_asked_for(pieces: Segments) -> None:
    spline = Spline(pieces, POINTS[-1])
    walk = SplineSampler(spline)
    for time in (0.0, 0.05, 0.15, 250.0, 249.9, 319.89, 1.0, 0.1, 320.0, 150.00001):
        assert walk.setpoint(time) == SplineSampler(spline).setpoint(time)
    assert spline_through(POINTS).segments[7] == PIECES[7]
