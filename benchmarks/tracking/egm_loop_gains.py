"""Prints with which gains EGM's own loop overshoots and becomes unstable, predicted and simulated; draws steps.

EGM closes its loop over the position that the robot reports, so that dead time ``d`` and gain ``k`` decide about it: a
step overshoots from ``k·d = 1/e`` on, and the loop is unstable from ``k·d = π/2`` on. A cycle holds its speed, which
adds half a cycle to the delay of the robot::

    python benchmarks/tracking/egm_loop_gains.py [--picture FILE]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import e, inf, pi
from pathlib import Path

from matplotlib.figure import Figure

from abb_protocols.robot.joints import CYCLE, JointLimits
from virtual_irc5.mechanics.arm_motion import ARM_MODELS, ArmModel
from virtual_irc5.mechanics.egm_motion import EgmMotionParameters
from virtual_irc5.mechanics.servo import follow_references

GAINS = (5.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 25.0, 30.0)
"""PosCorrGain times 5, which ABB allows up to 20, and beyond [1/s]."""

DELAYS = (0.016, 0.020, 0.026, 0.032, 0.050)
"""Of a robot without a servo's lag [s]."""

_OVERSHOOT = 1e-6  # of the step; less is rounding
_STEPS = 24  # of the bisection


def pure_delay(delay: float) -> ArmModel:
    """An arm of one joint that is where it planned to be some time ago."""
    return ArmModel(JointLimits.unlimited(1), reference_delay=0.0, delay=delay, lag=0.0, supervises_load=False)


def step_response(gain: float, model: ArmModel, duration: float, bandwidth: float = 0.0, level: int = 0) -> list[float]:
    """What an arm reports after a step of 1 rad, cycle by cycle [rad]; EGM limits nothing."""
    settings = EgmMotionParameters(gain, bandwidth, max_speed=inf, max_deviation=inf, level=level)
    free = replace(model, limits=JointLimits.unlimited(1))
    answer = follow_references([(1.0,)] * round(duration / CYCLE), (0.0,), free, settings)
    return [each.measured[0] for each in answer]


def overshoot(gain: float, model: ArmModel, bandwidth: float = 0.0, level: int = 0) -> float:
    """Fraction of a step by which it is overshot."""
    return max(0.0, max(step_response(gain, model, 3.0, bandwidth, level)) - 1.0)


def overshoot_gain(delay: float) -> float:
    """The simulated gain from which on a step overshoots, of an arm with a pure delay [s]."""
    return _first(lambda gain: overshoot(gain, pure_delay(delay)) > _OVERSHOOT, 0.2 / delay, 1.0 / delay)


def unstable_gain(delay: float) -> float:
    """The simulated gain from which on the distance from the goal grows, of an arm with a pure delay [s]."""

    def grows(gain: float) -> bool:
        distances = [abs(value - 1.0) for value in step_response(gain, pure_delay(delay), 50.0 * delay)]
        quarter = len(distances) // 4
        return max(distances[-quarter:]) > max(distances[quarter : 2 * quarter])

    return _first(grows, 0.5 / delay, 4.0 / delay)


def predicted_gains(delay: float) -> tuple[float, float]:
    """From which gain on a step should overshoot, and the loop be unstable [1/s]."""
    dead_time = delay + 0.5 * CYCLE
    return 1.0 / (e * dead_time), pi / 2.0 / dead_time


def _first(holds: Callable[[float], bool], lowest: float, highest: float) -> float:
    for _ in range(_STEPS):
        middle = 0.5 * (lowest + highest)
        lowest, highest = (lowest, middle) if holds(middle) else (middle, highest)
    return highest


ROBOTS: Mapping[str, tuple[ArmModel, float, int]] = {
    "YuMi, level 0, no filter": (ARM_MODELS["YuMi"], 0.0, 0),
    "YuMi, level 0, 20 Hz": (ARM_MODELS["YuMi"], 20.0, 0),
    "YuMi, level 1, 20 Hz": (ARM_MODELS["YuMi"], 20.0, 1),
    "IRB 6640, 100 Hz": (ARM_MODELS["IRB 6640"], 100.0, 0),
    "RobotStudio, 100 Hz": (ARM_MODELS["RobotStudio"], 100.0, 0),
}
"""Model, bandwidth of the low-pass filter [Hz] and level."""


def main() -> None:
    parser = argparse.ArgumentParser(description="The gains with which EGM's own loop overshoots and becomes unstable.")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw steps with some gains")
    options = parser.parse_args()
    print("delay of the robot: overshoot from k = predicted, simulated [1/s]; unstable from k = predicted, simulated")
    for delay in DELAYS:
        begins, ends = predicted_gains(delay)
        simulated = overshoot_gain(delay), unstable_gain(delay)
        print(f"{1e3 * delay:5.0f} ms: {begins:6.1f} {simulated[0]:6.1f}; {ends:6.1f} {simulated[1]:6.1f}")
    print("overshoot of a step [%], k =", *(f"{gain:5g}" for gain in GAINS))
    for name, (model, bandwidth, level) in ROBOTS.items():
        print(f"{name:>27}", *(f"{100.0 * overshoot(gain, model, bandwidth, level):5.1f}" for gain in GAINS))
    if options.picture:
        draw(options.picture)


def draw(file: Path) -> None:
    """Steps of the YuMi with some gains, at both levels."""
    figure = Figure(figsize=(9.0, 3.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for panel, name in zip(panels, ("YuMi, level 0, no filter", "YuMi, level 1, 20 Hz"), strict=True):
        model, bandwidth, level = ROBOTS[name]
        for gain in (5.0, 10.0, 15.0, 20.0):
            values = step_response(gain, model, 0.8, bandwidth, level)
            panel.plot([number * CYCLE for number in range(len(values))], values, label=f"k = {gain:g} s⁻¹")
        panel.set(title=name, xlabel="time [s]")
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("fraction of the step")
    panels[0].legend(frameon=False)
    figure.savefig(file, dpi=150)


if __name__ == "__main__":
    main()
