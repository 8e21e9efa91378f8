"""Another library with the meshes of the robot's covers finds no contact in what the limiter let pass."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import repeat
from math import inf
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np
import pytest

from abb_protocols.robot.joints import Joints, Side, home, named_pose
from apart_arms import POST, TABLE, ApartArms, renew_drive
from soak import COLLISION_CYCLES, tell
from yumi.control.collisions import BODY_MARGIN, COLLISION_MARGIN

pytest.importorskip("fcl", reason="python-fcl is not installed")
from cover_judge import CoverJudge

EPISODE, EVERY = 400, 10
ROUNDING = 1e-3
COASTS = 25  # cycles from the last one in which an arm was lost, in which it may coast


def margin(part: str, other: str) -> float:
    return BODY_MARGIN if other == "body" or "shoulder" in part + other else COLLISION_MARGIN


def within_margins(arms: ApartArms, positions: Mapping[Side, Joints]) -> dict[tuple[str, str], float]:
    """How near those parts are that are within their margins, by their names [m]."""
    near = arms.shapes.nearest(positions, 10_000, within=COLLISION_MARGIN)
    pairs = ((each.part, each.other, each.distance) for each in reversed(near))  # of the same names, the nearest
    return {(part, other): distance for part, other, distance in pairs if distance < margin(part, other)}


def test_judge_knows_contact_and_a_free_robot() -> None:
    """Both arms at home are free; turned towards each other they overlap."""
    judge = CoverJudge()
    assert 0.02 < judge.distance({side: home(side) for side in Side}) < 0.03
    turned = {side: (sign * np.radians(100.0), *home(side)[1:]) for side, sign in zip(Side, (1.0, -1.0), strict=True)}
    assert judge.distance(turned) <= 0.0


class Nearest(NamedTuple):
    """How near anything came [m].

    Attributes:
        commanded, measured: covers.
        beyond: shapes, less what they keep; negative within their margins.
    """

    commanded: float = inf
    measured: float = inf
    beyond: float = inf

    def least(self, other: Nearest) -> Nearest:
        return Nearest(*map(min, self, other))


@cache
def judge_of_boxes() -> CoverJudge:
    return CoverJudge((TABLE, POST))


def judged(episode: int, cycles: int) -> Nearest:
    """How near all that moves came in an episode, which its number makes what it is; fails where that is too near."""
    judge, generator, least = judge_of_boxes(), np.random.default_rng((22, episode)), Nearest()
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
        if coasted or cycle - last_lost < COASTS:
            moved = within_margins(arms, arms.measured())
            if cycle - last_lost < COASTS:
                coasted = {pair: min(distance, coasted.get(pair, inf)) for pair, distance in moved.items()}
            coasted = {pair: least for pair, least in coasted.items() if pair in moved}
        if cycle % EVERY:
            continue
        commanded, beyond = arms.commanded(), inf
        if cycle > last_lost:
            for pair, distance in within_margins(arms, commanded).items():
                beyond = min(beyond, distance - min(margin(*pair), coasted.get(pair, inf)))
        now = Nearest(judge.distance(commanded), judge.distance(arms.measured()), beyond)
        assert now.beyond > -ROUNDING, (episode, cycle, now)
        assert now.commanded > 0.0, (episode, cycle, now)
        assert now.measured > 0.0, (episode, cycle, now)
        least = least.least(now)
    return least


# An arm that was lost coasted into the other one; positions were sent within the margin since a robot was nearer, which
# lagged, had coasted, or was lost.
@pytest.mark.parametrize(("episode", "cycles"), [(0, 60), (8, 240), (317, 380), (636, 160), (1010, 220)])
def test_nothing_touches_in_adversarial_cycles(episode: int, cycles: int) -> None:
    """Arms are driven at each other, into the body and boxes, held, swung, and not heard for a while."""
    judged(episode, cycles)


@pytest.mark.soak
@pytest.mark.timeout(48 * 3600.0)
def test_nothing_touches_in_many_adversarial_cycles() -> None:
    """The same, on all processors."""
    least, episodes = Nearest(), range(-(-COLLISION_CYCLES // EPISODE))
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as processes:
        for number, each in enumerate(processes.map(judged, episodes, repeat(EPISODE)), 1):
            least = least.least(each)
            if number % 25 == 0 or number == len(episodes):
                tell(
                    f"{number * EPISODE} cycles: covers {least.commanded * 1e3:.1f} mm apart at least as commanded, "
                    f"{least.measured * 1e3:.1f} mm as moved; shapes {least.beyond * 1e3:.1f} mm beyond their margins"
                )
