"""Fits the virtual arm's control lag, delay and servo lag together, to the published step times, and to nothing else.

In virtual time, without a guard, as the publication's system was; about ten seconds::

    python benchmarks/tracking/fit_model.py
"""

from __future__ import annotations

from dataclasses import replace

from yumi_evaluation.lag_study import LONGEST, Trial, attempt, fit, timed_steps
from yumi_evaluation.virtual_machine import CONTROL_LAG


def main() -> None:
    steps = timed_steps()
    print("step times [s]")
    print(f"{'delay':>11}{'lag':>11}", *(f"{each.law.title + ' ' + each.mode.word:>18}" for each in steps), end="")
    print(f"{'rms error':>12}")
    print(f"{'published':>22}", *(f"{each.published.settling:>18.3f}" for each in steps))
    best = fit(show)
    print("the same control lag, shared differently:")
    for delay in (0.0, best.control_lag):
        attempt(replace(best.model, delay=delay, lag=best.control_lag - delay), show)
    print(f"Best between 0 and {LONGEST * 1e3:g} ms: a control lag of {best.control_lag * 1e3:.1f} ms;", end=" ")
    print(f"committed are {CONTROL_LAG * 1e3:g} ms.")


def show(trial: Trial) -> None:
    times = (f"{time:>18.4f}" for time in trial.times)
    print(
        f"{trial.model.delay * 1e3:>8.2f} ms{trial.model.lag * 1e3:>8.2f} ms", *times, f"{trial.error * 1e3:>9.3f} ms"
    )


if __name__ == "__main__":
    main()
