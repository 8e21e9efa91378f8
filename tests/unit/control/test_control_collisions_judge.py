"""Another library with the meshes of the robot's covers finds no contact in what the limiter let pass."""

from __future__ import annotations

import numpy as np
import pytest

from apart_arms import POST, TABLE, ApartArms, renew_drive
from soak import COLLISION_CYCLES, long, short, tell
from yumi.control.collisions import BODY_MARGIN, MARGIN
from yumi.robot.joints import Side, home, named_pose

pytest.importorskip("fcl", reason="python-fcl is not installed")
from cover_judge import CoverJudge

EPISODE, EVERY = 400, 10
ROUNDING = 1e-3


def test_judge_knows_contact_and_a_free_robot() -> None:
    """Both arms at home are free; turned towards each other they overlap."""
    judge = CoverJudge()
    assert 0.005 < judge.distance({side: home(side) for side in Side}) < 0.02
    turned = {side: (sign * np.radians(100.0), *home(side)[1:]) for side, sign in zip(Side, (1.0, -1.0), strict=True)}
    assert judge.distance(turned) <= 0.0


@pytest.mark.parametrize("cycles", [short(60), long(COLLISION_CYCLES, 48 * 3600.0)])
def test_nothing_touches_in_adversarial_cycles(cycles: int) -> None:
    """Arms are driven at each other, into the body and boxes, held, swung, and not heard for a while."""
    judge, generator = CoverJudge((TABLE, POST)), np.random.default_rng(22)
    nearest_commanded, nearest_measured, worst = np.inf, np.inf, np.inf
    arms, drives, left = ApartArms({side: named_pose(side, "ready") for side in Side}), {}, dict.fromkeys(Side, 0)
    for cycle in range(1, cycles + 1):
        if cycle % EPISODE == 0:
            arms, drives = ApartArms({side: named_pose(side, "ready") for side in Side}), {}
            tell(
                f"{cycle} cycles: covers {nearest_commanded * 1e3:.1f} mm apart at least as commanded, "
                f"{nearest_measured * 1e3:.1f} mm as moved; shapes {worst * 1e3:.1f} mm beyond their margins"
            )
        for side in Side:
            if renew_drive(generator, arms, side, drives, left) and generator.integers(12) == 0:
                arms.silent[side] = int(generator.integers(1, 60))
        was_lost = any(arms.silent.values())
        arms.cycle(drives)
        if cycle % EVERY:
            continue
        commanded, measured = arms.commanded(), arms.measured()
        nearest_commanded = min(nearest_commanded, judge.distance(commanded))
        nearest_measured = min(nearest_measured, judge.distance(measured))
        if not was_lost:
            for each in arms.shapes.nearest(commanded, 10_000):
                is_body = each.other == "body" or "shoulder" in each.part + each.other
                worst = min(worst, each.distance - (BODY_MARGIN if is_body else MARGIN))
        assert worst > -ROUNDING
        assert nearest_commanded > 0.0
        assert nearest_measured > 0.0
