"""What the limiter costs in a cycle of both arms, in processor time, motion by motion.

The motions are those of the tests, in virtual time, so each run has the same cycles. Each cycle counts with the
quickest of some runs: what other processes take from it is left out as far as that is possible.

Run it as ``python benchmarks/collision_limiter.py [runs]`` in a clone.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

_TESTS = Path(__file__).parent.parent / "tests"
sys.path[:0] = [str(_TESTS), str(_TESTS / "unit" / "control")]

from test_control_collisions import BEFORE_MEETING, FORWARD, MEETING  # noqa: E402

from abb_protocols.robot.joints import Side, home, named_pose  # noqa: E402
from apart_arms import ApartArms, Drive, at_speed, renew_drive, to  # noqa: E402

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


def main(runs: int) -> None:
    """Print the median, one cycle of a hundred and the most of each motion."""
    gc.disable()  # as in the control process
    for name, (motion, counted) in MOTIONS.items():
        costs = 1e3 * np.min([np.array(motion())[counted] for _ in range(runs)], axis=0)
        median, rare = np.percentile(costs, (50.0, 99.0))
        print(f"{name:20s} median {median:6.3f} ms, one of a hundred {rare:6.3f} ms, most {costs.max():5.2f} ms")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
