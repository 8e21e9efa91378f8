"""Finds the control lag of the virtual arm that fits the published step times best, and prints each trial.

Of delay and servo lag only the sum matters to a step: one number is fitted, and shared as in the virtual robot that is
shipped. The times are published in tenths of a second, so seconds count and not ratios::

    python benchmarks/tracking/fit_model.py
"""

from __future__ import annotations

from math import nan

import numpy as np

from yumi_evaluation.experiments import System, published_experiments, step_figures_of
from yumi_evaluation.virtual_time import CONTROL_LAG, arm_with, run_virtually

STEPS = [each for each in published_experiments() if each.published.settling_s is not None]
PUBLISHED = np.array([each.published.settling_s for each in STEPS])


def main() -> None:
    print(
        f"{'control lag':>14}", *(f"{each.controller.title + ' ' + each.mode.word:>18}" for each in STEPS), " rms error"
    )
    print(f"{'published':>14}", *(f"{time:>18.3f}" for time in PUBLISHED))
    coarse = min((error(lag), lag) for lag in np.arange(0.0, 0.0605, 0.005))[1]
    best = min((error(lag), lag) for lag in np.arange(max(0.0, coarse - 0.005), coarse + 0.005, 0.0005))[1]
    print(f"Best between 0 and 60 ms: {1e3 * best:.1f} ms; the evaluation uses {1e3 * CONTROL_LAG:g} ms.")


def error(lag: float) -> float:
    """Root mean square of the differences to the published step times [s]."""
    runs = [run_virtually(each, System.BARE, arm_with(lag)) for each in STEPS]
    times = [nan if (time := step_figures_of(run).settling_s) is None else time for run in runs]
    found = float(np.sqrt(np.mean((np.array(times) - PUBLISHED) ** 2)))
    print(f"{1e3 * lag:>11.1f} ms", *(f"{time:>18.4f}" for time in times), f"{1e3 * found:>7.3f} ms")
    return found


if __name__ == "__main__":
    main()
