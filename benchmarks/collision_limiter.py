"""What the limiter costs in a cycle of both arms, in processor time, motion by motion: all of it, and what keeps the
arms apart, which is all but one calculation of a command within the joints' limits for each arm.

The motions are those of the tests, in virtual time, so each run has the same cycles. Each cycle counts with the
quickest of some runs: what other processes take from it is left out as far as that is possible.

Run it as ``python benchmarks/collision_limiter.py [runs]`` in a clone.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

_TESTS = Path(__file__).parent.parent / "tests"
sys.path[:0] = [str(_TESTS), str(_TESTS / "unit" / "control")]

from test_control_collisions import BEFORE_MEETING, FORWARD, MEETING  # noqa: E402

from apart_arms import ApartArms, Drive, at_speed, renew_drive, to  # noqa: E402
from yumi.control.collisions import ArmCollisionLimiter  # noqa: E402
from yumi.control.limiter import Limiter, SentMotion  # noqa: E402
from yumi.robot.joints import Side, home, named_pose  # noqa: E402

HOME = {side: home(side) for side in Side}
READY = {side: named_pose(side, "ready") for side in Side}


def at_rest() -> list[float]:
    arms = ApartArms(READY)
    for _ in range(500):
        arms.cycle({side: to(READY[side]) for side in Side})
    return arms.costs[1:]


def slow_jog() -> list[float]:
    """All joints back and forth at 0.1 rad/s, with room on all sides."""
    arms = ApartArms(FORWARD, obstacles=())
    for cycle in range(500):
        speed = 0.1 if cycle // 125 % 2 else -0.1
        arms.cycle({side: at_speed((speed,) * 7) for side in Side})
    return arms.costs[1:]


def home_to_ready() -> list[float]:
    """At full speed, and back; half of the time both arms stand."""
    arms = ApartArms(HOME, obstacles=())
    for cycle in range(1400):
        goals = HOME if cycle // 350 % 2 else READY
        arms.cycle({side: to(goals[side]) for side in Side})
    return arms.costs[1:]


def meeting() -> list[float]:
    """Until they rest, and then."""
    arms = ApartArms(BEFORE_MEETING, obstacles=())
    for _ in range(1000):
        arms.cycle({side: to(MEETING[side]) for side in Side})
    return arms.costs[1:]


def adversarial() -> list[float]:
    generator, costs = np.random.default_rng(22), []
    for _ in range(4):
        arms, drives, left = ApartArms(READY), dict[Side, Drive](), dict.fromkeys(Side, 0)
        for _ in range(400):
            for side in Side:
                renew_drive(generator, arms, side, drives, left)
            arms.cycle(drives)
        costs += arms.costs[1:]
    return costs


MOTIONS: dict[str, tuple[Callable[[], list[float]], slice]] = {
    "at rest": (at_rest, slice(None)),
    "at rest and pushed": (meeting, slice(-300, None)),
    "slow jog": (slow_jog, slice(None)),
    "home to ready": (home_to_ready, slice(None)),
    "driven at each other": (meeting, slice(350)),
    "adversarial": (adversarial, slice(None)),
}
"""What moves, and the cycles of it that count."""


class JointLimits:
    """How long the first command of each cycle and arm took within the joints' limits, in the run so far [s]."""

    def __init__(self) -> None:
        self.costs: list[float] = []
        self._is_first = False
        begin_cycle, calculate = ArmCollisionLimiter.begin_cycle, Limiter._step

        def begin(arm: ArmCollisionLimiter, *arguments: Any) -> bool:
            self._is_first = True
            self.costs.append(0.0)
            return begin_cycle(arm, *arguments)

        def timed(limiter: Limiter, *arguments: Any) -> SentMotion:
            begun = process_time()
            motion = calculate(limiter, *arguments)
            if self._is_first:
                self.costs[-1] = process_time() - begun
            self._is_first = False
            return motion

        setattr(ArmCollisionLimiter, "begin_cycle", begin)  # noqa: B010
        setattr(Limiter, "_step", timed)  # noqa: B010


def main(runs: int) -> None:
    """Print the median, one cycle of a hundred and the most of each motion."""
    gc.disable()  # as in the control process
    joint_limits = JointLimits()
    for name, (motion, counted) in MOTIONS.items():
        all_of_it, apart = [], []
        for _ in range(runs):
            joint_limits.costs.clear()
            costs = np.array(motion())
            both_arms = np.array(joint_limits.costs).reshape(-1, 2).sum(1)
            all_of_it.append(costs[counted])
            apart.append((costs - both_arms)[counted])
        figures = [
            "median {:6.3f} ms, one of a hundred {:6.3f} ms, most {:5.2f} ms".format(
                *np.percentile(each, (50.0, 99.0)), each.max()
            )
            for each in (np.min(rows, axis=0) * 1e3 for rows in (all_of_it, apart))
        ]
        print(f"{name:20s} {figures[0]}; to keep apart {figures[1]}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
