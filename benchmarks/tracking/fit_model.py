"""Finds the acceleration of EGM with which the virtual arm fits the published step times best, and prints each trial.

The times of the virtual arm are those measured on another robot; one number is fitted. The step times are published in
tenths of a second, so seconds count and not ratios. The minimum is flat; what the evaluation uses is where oscillation
begins at the published gain, too::

    python benchmarks/tracking/fit_model.py
"""

from __future__ import annotations

from math import nan

import numpy as np

from yumi_evaluation.experiments import System, published_experiments, step_figures_of
from yumi_evaluation.virtual_time import FITTED_ACCELERATION, arm_with, run_virtually

STEPS = [each for each in published_experiments() if each.published.settling_s is not None]
PUBLISHED = np.array([each.published.settling_s for each in STEPS])


def main() -> None:
    print(
        f"{'acceleration':>16}",
        *(f"{each.controller.title + ' ' + each.mode.word:>18}" for each in STEPS),
        " rms error",
    )
    print(f"{'published':>16}", *(f"{time:>18.3f}" for time in PUBLISHED))
    coarse = min((error(most), most) for most in (3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 14.0, 20.0, 40.0))[1]
    best = min((error(most), most) for most in np.arange(coarse - 0.75, coarse + 0.8, 0.25))[1]
    print(f"Best between 3 and 40 rad/s²: {best:.2f} rad/s²; the evaluation uses {FITTED_ACCELERATION:g} rad/s².")


def error(acceleration: float) -> float:
    """Root mean square of the differences to the published step times [s]."""
    runs = [run_virtually(each, System.BARE, arm_with(acceleration)) for each in STEPS]
    times = [nan if (time := step_figures_of(run).settling_s) is None else time for run in runs]
    found = float(np.sqrt(np.mean((np.array(times) - PUBLISHED) ** 2)))
    print(f"{acceleration:>9.2f} rad/s²", *(f"{time:>18.4f}" for time in times), f"{1e3 * found:>7.3f} ms")
    return found


if __name__ == "__main__":
    main()
