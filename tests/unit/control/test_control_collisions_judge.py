"""Another library with the meshes of the robot's covers finds no contact in what the limiter let pass."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from math import inf

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
    assert 0.02 < judge.distance({side: home(side) for side in Side}) < 0.03
    turned = {side: (sign * np.radians(100.0), *home(side)[1:]) for side, sign in zip(Side, (1.0, -1.0), strict=True)}
    assert judge.distance(turned) <= 0.0


@dataclass
class Nearest:
    """How near anything came [m].

    Attributes:
        commanded, measured: covers.
        beyond: shapes, less what they keep; negative within their margins.
    """

    commanded: float = inf
    measured: float = inf
    beyond: float = inf

    def check(self, cycle: str) -> None:
        figures = f"{self.commanded * 1e3:.1f} mm as commanded, {self.measured * 1e3:.1f} mm as moved"
        assert self.beyond > -ROUNDING, f"{-self.beyond * 1e3:.2f} mm within a margin in {cycle}"
        assert self.commanded > 0.0, f"contact in {cycle}: {figures}"
        assert self.measured > 0.0, f"contact in {cycle}: {figures}"


def judged(episode: int, cycles: int, judge: CoverJudge) -> Iterator[Nearest]:
    """Cycle after cycle of an episode, which its number makes what it is: how near all that moves came in it."""
    generator = np.random.default_rng((22, episode))
    arms, drives, left = ApartArms({side: named_pose(side, "ready") for side in Side}), {}, dict.fromkeys(Side, 0)
    coasted: dict[tuple[str, str], float] = {}
    last_lost = -COASTS
    for cycle in range(cycles):
        for side in Side:
            if renew_drive(generator, arms, side, drives, left) and generator.integers(12) == 0:
                arms.silent[side] = int(generator.integers(1, 60))
        if any(arms.silent.values()):
            last_lost = cycle
        arms.cycle(drives)
        # An arm that was lost may have coasted into its margins: there it may be commanded to be, until it has left.
        moved = within_margins(arms, arms.measured())
        if cycle - last_lost < COASTS:
            coasted = {pair: min(distance, coasted.get(pair, inf)) for pair, distance in moved.items()}
        coasted = {pair: least for pair, least in coasted.items() if pair in moved}
        now = Nearest()
        if cycle % EVERY == 0:
            commanded = arms.commanded()
            now.commanded, now.measured = judge.distance(commanded), judge.distance(arms.measured())
            if cycle > last_lost:
                for pair, distance in within_margins(arms, commanded).items():
                    now.beyond = min(now.beyond, distance - min(margin(*pair), coasted.get(pair, inf)))
        yield now


@pytest.mark.parametrize("cycles", [short(60), long(COLLISION_CYCLES, 48 * 3600.0)])
def test_nothing_touches_in_adversarial_cycles(cycles: int) -> None:
    """Arms are driven at each other, into the body and boxes, held, swung, and not heard for a while."""
    judge, least = CoverJudge((TABLE, POST)), Nearest()
    for episode in range(-(-cycles // EPISODE)):
        for cycle, now in enumerate(judged(episode, min(EPISODE, cycles - episode * EPISODE), judge)):
            now.check(f"cycle {cycle} of episode {episode}")
            for field in fields(now):
                setattr(least, field.name, min(getattr(least, field.name), getattr(now, field.name)))
        tell(
            f"{(episode + 1) * EPISODE} cycles: covers {least.commanded * 1e3:.1f} mm apart at least as commanded, "
            f"{least.measured * 1e3:.1f} mm as moved; shapes {least.beyond * 1e3:.1f} mm beyond their margins"
        )
