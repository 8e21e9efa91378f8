"""Streams of joint positions, as delivered: how late and how smoothly both arms follow, in virtual time."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from yumi.control.motion.robot_response import RESPONSE_DELAY
from yumi_evaluation.followed_streams import HEAD, ROWS, Followed, SmoothPolicy, follow_stream

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "follow-a-stream.md"
CHECKED = (ROWS[0], ROWS[4], ROWS[-1])
"""Rows of the table that are followed again; ``python -m yumi_evaluation.followed_streams`` writes all of them."""

pytestmark = pytest.mark.timeout(180)


def assert_follows(found: Followed, lag: float) -> None:
    assert found.lag <= lag
    assert found.acceleration <= 1.2
    assert found.slowed == 0
    assert all("follows a stream" in said for said in found.said)


@pytest.mark.parametrize(
    ("rate", "lag", "fastest"),
    [(30.0, 0.060, 0.3), (30.0, 0.060, 1.0), (100.0, 0.040, 1.0), (10.0, 0.130, 0.3), (500.0, 0.040, 1.0)],
)
def test_fourteen_joints_follow_a_smooth_policy_one_period_late_and_as_smoothly(
    rate: float, lag: float, fastest: float
) -> None:
    assert_follows(follow_stream(rate, SmoothPolicy(fastest), duration=3.0), lag)


def test_points_that_arrive_late_are_followed_by_their_stamps() -> None:
    found = follow_stream(30.0, duration=3.0, lateness=0.004)
    assert found.lag == pytest.approx(1.0 / 30.0 + RESPONSE_DELAY, abs=0.002)
    assert found.acceleration <= 1.2


def test_more_delay_lets_points_arrive_much_later() -> None:
    found = follow_stream(30.0, duration=3.0, lateness=0.02, delay=0.15)
    assert found.lag == pytest.approx(0.15, abs=0.002)
    assert found.acceleration <= 1.2


def test_without_delay_the_stream_is_predicted() -> None:
    assert abs(follow_stream(30.0, duration=3.0, delay=0.0).lag) <= 0.005


def test_velocities_of_points_are_used() -> None:
    assert_follows(follow_stream(30.0, SmoothPolicy(1.0), duration=3.0, with_velocity=True), 0.060)


def test_noise_of_points_is_not_amplified() -> None:
    """Noise of 0.02° has the points themselves ask for 1.6 times the acceleration."""
    assert follow_stream(30.0, SmoothPolicy(1.0), duration=3.0, noise=3e-4).acceleration <= 1.4


@pytest.mark.parametrize("row", CHECKED)
def test_table_of_the_documentation_is_what_is_measured(row: object) -> None:
    written = PAGE.read_text(encoding="utf-8")
    assert row.text() in written  # type: ignore[attr-defined]


def test_table_of_the_documentation_has_all_rows() -> None:
    _, _, table = PAGE.read_text(encoding="utf-8").partition(HEAD)
    rows = re.findall(r"^\| .*", table.partition("\n\n")[0], re.MULTILINE)
    assert [row.split(" | ")[0] for row in rows] == [f"| {row.points}" for row in ROWS]
