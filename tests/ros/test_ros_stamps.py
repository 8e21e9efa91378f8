from __future__ import annotations

import pytest

from yumi.clock import ManualClock

pytestmark = pytest.mark.ros
messages = pytest.importorskip("yumi.ros.messages")

EPOCH = 1_700_000_000_000_000_000


class RosClock:
    """Runs with the monotonic clock, and can be set."""

    def __init__(self, clock: ManualClock) -> None:
        self.offset = EPOCH
        self.interruption = 0.0
        self._clock = clock

    def now(self) -> int:
        self._clock.advance(self.interruption)
        return self.offset + round(self._clock.now() * 1e9)


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def ros_clock(clock: ManualClock) -> RosClock:
    return RosClock(clock)


def test_stamp_is_the_ros_time_of_a_moment_past(clock: ManualClock, ros_clock: RosClock) -> None:
    stamps = messages.Stamps(ros_clock.now, clock.now)
    clock.advance(2.0)
    assert stamps.at(1.5) == EPOCH + 1_500_000_000


def test_stamps_keep_their_distance_when_reading_the_clocks_is_interrupted(
    clock: ManualClock, ros_clock: RosClock
) -> None:
    stamps = messages.Stamps(ros_clock.now, clock.now)
    first = stamps.at(0.0)
    clock.advance(0.004)
    ros_clock.interruption = 0.003
    assert stamps.at(0.004) - first == pytest.approx(4_000_000, abs=5_000)


def test_stamps_follow_a_clock_that_was_set(clock: ManualClock, ros_clock: RosClock) -> None:
    stamps = messages.Stamps(ros_clock.now, clock.now)
    first = stamps.at(0.0)
    ros_clock.offset += 10**9
    assert stamps.at(0.0) - first == 10**9
