from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from yumi.control.position_limiter import PositionLimiter, PositionMotion, resting_at
from yumi.robot.joints import CYCLE, YUMI_LIMITS, Side, home, joints

HOME = home(Side.LEFT)
LIMITER = PositionLimiter(YUMI_LIMITS)
OFFSETS = st.lists(st.tuples(*[st.floats(-0.5, 0.5)] * 7), min_size=1, max_size=10)


def after(motion: PositionMotion, offsets: list[tuple[float, ...]]) -> PositionMotion:
    """The motion after one step towards each of some goals."""
    for offset in offsets:
        goal = joints([place + each for place, each in zip(HOME, offset, strict=True)])
        motion = LIMITER.step(motion, goal, CYCLE, CYCLE)
    return motion


def test_step_that_is_smooth_ends_at_the_very_position_that_is_desired() -> None:
    desired = joints([place + 1e-6 for place in HOME])
    assert LIMITER.step(resting_at(HOME), desired, CYCLE, CYCLE).position is desired


@settings(max_examples=20)
@given(offsets=OFFSETS)
def test_steps_from_one_motion_are_the_same_again_and_leave_it_as_it_was(offsets: list[tuple[float, ...]]) -> None:
    before = after(resting_at(HOME), offsets)
    kept = before._replace()
    one, braked = after(before, offsets), LIMITER.brake(before, CYCLE)
    assert before == kept
    assert (one, braked) == (after(before, offsets), LIMITER.brake(before, CYCLE))


@settings(max_examples=20)
@given(offsets=OFFSETS)
def test_joints_that_brake_come_to_the_place_that_was_foretold(offsets: list[tuple[float, ...]]) -> None:
    motion = after(resting_at(HOME), offsets)
    place, cycles = LIMITER.place_to_stop(motion), 0
    while not motion.stands(CYCLE):
        motion, cycles = LIMITER.brake(motion, CYCLE), cycles + 1
        assert cycles < 500
    assert max(abs(a - b) for a, b in zip(motion.position, place, strict=True)) < 0.02
