"""Fits the virtual arm's delay and servo lag to the published step times, and to nothing else.

In virtual time, without a guard, as the publication's system was; about ten seconds::

    python benchmarks/tracking/fit_model.py
"""

from __future__ import annotations

from yumi.evaluation.fitted_model import FITTED
from yumi.evaluation.model_fit import LONGEST, SHORTEST, Trial, fit, timed_steps


def main() -> None:
    names = [f"{each.law.title} {each.mode.word}" for each in timed_steps()]
    print("ratio of our step times to the published ones")
    print(f"{'delay':>8}{'lag':>8}", *(f"{name:>18}" for name in names), f"{'root mean square':>18}")
    best, *_ = fit(on_trial=show)
    print(f"Best of a control lag of {SHORTEST * 1e3:g} to {LONGEST * 1e3:g} ms: ", end="")
    print(f"delay {best.delay * 1e3:g} ms, lag {best.lag * 1e3:g} ms;", end=" ")
    print(f"committed are {FITTED.delay * 1e3:g} ms and {FITTED.lag * 1e3:g} ms.")


def show(trial: Trial) -> None:
    ratios = (f"{ratio:>18.3f}" for ratio in trial.ratios)
    print(f"{trial.delay * 1e3:>5.0f} ms{trial.lag * 1e3:>5.0f} ms", *ratios, f"{trial.cost**0.5:>18.4f}")


if __name__ == "__main__":
    main()
