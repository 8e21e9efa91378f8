"""Prints how closely the virtual arm follows a reference on axis 6 that is streamed to it at 500 Hz.

In virtual time, with the virtual robot's default dynamics and the full-speed settings; in real time `yumi evaluate`
measures the same::

    python benchmarks/tracking/streamed_reference.py [--json FILE] [--picture FILE]
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from math import radians
from pathlib import Path
from typing import Any

from tracking_runs import FULL_SPEED_LIMITS, Run, Stream, draw_runs, follow

from abb_runtime.parameters import Values
from yumi_evaluation.experiments import AXIS_6, FEED_FORWARD, Sine, Step

DURATION = 17.0
"""Three periods and a start [s]."""

START = 2.0
"""The first seconds are reported apart: a sine that begins at full speed cannot be followed from its begin [s]."""

CONTROLLERS: tuple[tuple[str, Values, Stream], ...] = (
    ("P = 1.2, the thesis's", {"p": 1.2}, Stream()),
    ("P = 2.0, the thesis's best", {"p": 2.0}, Stream()),
    ("feed-forward", FEED_FORWARD, Stream()),
    ("feed-forward, goals 1 ms late on average", FEED_FORWARD, Stream(lateness=0.001)),
    ("feed-forward, goals at 100 Hz", FEED_FORWARD, Stream(rate=100.0)),
)
AMPLITUDES_DEG = (10.0, 60.0)


def main() -> None:
    parser = argparse.ArgumentParser(description="How closely a streamed reference is followed.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw the sines followed with feed-forward")
    options = parser.parse_args()
    runs = [
        (name, size, follow(Sine(radians(size)), DURATION, values, stream))
        for name, values, stream in CONTROLLERS
        for size in AMPLITUDES_DEG
    ]
    figures = [figures_of(name, size, run) for name, size, run in runs]
    report(figures)
    step = step_figures()
    if options.json:
        options.json.write_text(json.dumps({"start": START, "sines": figures, "step": step}, indent=2) + "\n")
    if options.picture:
        drawn = [(f"{name}, {size:g}°", run) for name, size, run in runs if name == "feed-forward"]
        draw_runs(drawn, options.picture)


def figures_of(name: str, size_deg: float, run: Run) -> dict[str, Any]:
    later = run.after(START)
    return {
        "controller": name,
        "amplitude_deg": size_deg,
        "mean_lag_ms": later.lag * 1e3,
        "max_error_deg": later.max_error_deg,
        "max_error_with_start_deg": run.max_error_deg,
        "mean_lag_with_start_ms": run.lag * 1e3,
        "within_1_percent_after_s": run.settling_time(0.01 * size_deg),
        "slowed_cycles": run.slowed,
    }


def report(rows: Iterable[dict[str, Any]]) -> None:
    print(f"{'sine of 0.2 Hz':42}{'ampl.':>7}{'mean lag':>11}{'max. error':>12}{'from the start:':>17}{'':>10}")
    for row in rows:
        print(
            f"{row['controller']:42}{row['amplitude_deg']:>5.0f} °{row['mean_lag_ms']:>8.2f} ms"
            f"{row['max_error_deg']:>10.4f} °{row['mean_lag_with_start_ms']:>14.2f} ms"
            f"{row['max_error_with_start_deg']:>8.2f} °"
        )


def step_figures() -> dict[str, float]:
    run = follow(Step(radians(10.0)), 2.0, FEED_FORWARD)
    figures = {
        "size_deg": 10.0,
        "overshoot_deg": run.overshoot_deg,
        "within_0.1_deg_after_s": run.settling_time(0.1) - 0.1,
        "acceleration": run.max_acceleration,
        "acceleration_limit": FULL_SPEED_LIMITS.acceleration[AXIS_6],
    }
    print(
        f"step of 10°: overshoot {figures['overshoot_deg']:.4f}°, within 0.1° after "
        f"{figures['within_0.1_deg_after_s']:.2f} s, acceleration {figures['acceleration']:.1f} of "
        f"{figures['acceleration_limit']:.0f} rad/s²"
    )
    return figures


if __name__ == "__main__":
    main()
