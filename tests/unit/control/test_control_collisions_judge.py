"""Another library with the meshes of the robot's covers finds no contact in what the limiter let pass."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from apart_arms import POST, TABLE, ApartArms, renew_drive
from soak import COLLISION_CYCLES, long, short, tell
from yumi.control.collisions import BODY_MARGIN, MARGIN
from yumi.robot.joints import Joints, Side, home, named_pose

pytest.importorskip("fcl", reason="python-fcl is not installed")
from cover_judge import CoverJudge

EPISODE, EVERY = 400, 10
ROUNDING = 1e-3
COASTS = 25  # cycles from the last one in which an arm was lost, in which it may coast


def margin(part: str, other: str) -> float:
    return BODY_MARGIN if other == "body" or "shoulder" in part + other else MARGIN


def within_margins(arms: ApartArms, positions: Mapping[Side, Joints]) -> dict[tuple[str, str], float]:
    """How near those parts are that are within their margins, by their names [m]."""
    near = arms.shapes.nearest(positions, 10_000, within=MARGIN)
    pairs = ((each.part, each.other, each.distance) for each in reversed(near))  # of the same names, the nearest
    return {(part, other): distance for part, other, distance in pairs if distance < margin(part, other)}


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
    nearest_commanded, nearest_measured, worst = np.inf, np.inf, 0.0
    arms, drives, left = ApartArms({side: named_pose(side, "ready") for side in Side}), {}, dict.fromkeys(Side, 0)
    coasted: dict[tuple[str, str], float] = {}
    last_lost = -COASTS
    for cycle in range(1, cycles + 1):
        if cycle % EPISODE == 0:
            arms, drives = ApartArms({side: named_pose(side, "ready") for side in Side}), {}
            coasted, last_lost = {}, -COASTS
            tell(
                f"{cycle} cycles: covers {nearest_commanded * 1e3:.1f} mm apart at least as commanded, "
                f"{nearest_measured * 1e3:.1f} mm as moved; shapes {worst * 1e3:.1f} mm beyond their margins"
            )
        for side in Side:
            if renew_drive(generator, arms, side, drives, left) and generator.integers(12) == 0:
                arms.silent[side] = int(generator.integers(1, 60))
        if any(arms.silent.values()):
            last_lost = cycle
        arms.cycle(drives)
        # An arm that was lost may have coasted into its margins: there it may be commanded to be, until it has left.
        moved = within_margins(arms, arms.measured())
        if cycle - last_lost < COASTS:
            coasted = {pair: min(distance, coasted.get(pair, np.inf)) for pair, distance in moved.items()}
        coasted = {pair: least for pair, least in coasted.items() if pair in moved}
        if cycle % EVERY:
            continue
        commanded, measured = arms.commanded(), arms.measured()
        nearest_commanded = min(nearest_commanded, judge.distance(commanded))
        nearest_measured = min(nearest_measured, judge.distance(measured))
        if cycle > last_lost:
            for pair, distance in within_margins(arms, commanded).items():
                worst = min(worst, distance - min(margin(*pair), coasted.get(pair, np.inf)))
        assert worst > -ROUNDING
        assert nearest_commanded > 0.0
        assert nearest_measured > 0.0
