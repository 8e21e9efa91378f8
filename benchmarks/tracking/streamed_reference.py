"""Prints how closely the virtual arm follows a reference on axis 6 that is streamed to it at 500 Hz.

In virtual time, with the virtual robot's default dynamics and the full-speed settings::

    python benchmarks/tracking/streamed_reference.py [--json FILE] [--picture FILE]
    python benchmarks/tracking/streamed_reference.py --real-time [--json FILE]

With ``--real-time`` the same sines go through ROS 2 to a driver that drives a virtual controller over the wire.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from math import radians
from pathlib import Path
from typing import Any

from yumi.settings import Values
from yumi_evaluation.experiment import FEED_FORWARD, Run, Sine, Step, Stream, acceleration_limit, follow
from yumi_evaluation.pictures import draw_runs

DURATION = 17.0
"""Three periods and a start [s]."""

START = 2.0
"""The first seconds are told apart: a sine that begins at full speed cannot be followed from its first moment [s]."""

LAWS: tuple[tuple[str, Values, Stream], ...] = (
    ("P = 1.2, the thesis's", {"p": 1.2}, Stream()),
    ("P = 2.0, the thesis's best", {"p": 2.0}, Stream()),
    ("feed-forward", FEED_FORWARD, Stream()),
    ("feed-forward, goals 1 ms late on average", FEED_FORWARD, Stream(lateness=0.001)),
    ("feed-forward, goals at 100 Hz", FEED_FORWARD, Stream(rate=100.0)),
)
LONGEST_GAP = 0.02
"""Five cycles without a state tell of the machine, not of the controller [s]."""

OVER_THE_WIRE = "feed-forward, over the wire"
AMPLITUDES_DEG = (10.0, 60.0)


def main() -> None:
    parser = argparse.ArgumentParser(description="How closely a streamed reference is followed.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw the sines followed with feed-forward")
    parser.add_argument("--real-time", action="store_true", help="over ROS 2 and the wire, instead of in virtual time")
    options = parser.parse_args()
    if options.real_time:
        from real_time import stream_over_ros  # noqa: PLC0415 - the rest works without ROS 2

        runs = [(OVER_THE_WIRE, size, stream_over_ros(Sine(radians(size)), DURATION)) for size in AMPLITUDES_DEG]
    else:
        runs = [
            (name, size, follow(Sine(radians(size)), DURATION, values, stream))
            for name, values, stream in LAWS
            for size in AMPLITUDES_DEG
        ]
    figures = [figures_of(name, size, run) for name, size, run in runs]
    report(figures)
    step = None if options.real_time else step_figures()
    if options.json:
        options.json.write_text(json.dumps({"start": START, "sines": figures, "step": step}, indent=2) + "\n")
    if options.picture:
        drawn = [(f"{name}, {size:g}°", run) for name, size, run in runs if name in ("feed-forward", OVER_THE_WIRE)]
        draw_runs(drawn, options.picture)


def figures_of(name: str, size_deg: float, run: Run) -> dict[str, Any]:
    later = run.after(START)
    return {
        "law": name,
        "amplitude_deg": size_deg,
        "mean_lag_ms": later.lag * 1e3,
        "max_error_deg": later.max_error_deg,
        "max_error_with_start_deg": run.max_error_deg,
        "mean_lag_with_start_ms": run.lag * 1e3,
        "within_1_percent_after_s": run.settling_time(0.01 * size_deg),
        "slowed_cycles": run.slowed,
        "largest_gap_ms": run.largest_gap * 1e3,
    }


def report(rows: Iterable[dict[str, Any]]) -> None:
    print(f"{'sine of 0.2 Hz':42}{'ampl.':>7}{'mean lag':>11}{'max. error':>12}{'from the start:':>17}{'':>10}")
    for row in rows:
        print(
            f"{row['law']:42}{row['amplitude_deg']:>5.0f} °{row['mean_lag_ms']:>8.2f} ms"
            f"{row['max_error_deg']:>10.4f} °{row['mean_lag_with_start_ms']:>14.2f} ms"
            f"{row['max_error_with_start_deg']:>8.2f} °"
        )
        if row["largest_gap_ms"] > LONGEST_GAP * 1e3:
            print(f"  The machine was too busy: no state came for {row['largest_gap_ms']:.0f} ms; repeat it when idle.")


def step_figures() -> dict[str, float]:
    run = follow(Step(radians(10.0)), 2.0, FEED_FORWARD)
    figures = {
        "size_deg": 10.0,
        "overshoot_deg": run.overshoot_deg,
        "within_0.1_deg_after_s": run.settling_time(0.1) - 0.1,
        "acceleration": run.max_acceleration,
        "acceleration_limit": acceleration_limit(),
    }
    print(
        f"step of 10°: overshoot {figures['overshoot_deg']:.4f}°, within 0.1° after "
        f"{figures['within_0.1_deg_after_s']:.2f} s, acceleration {figures['acceleration']:.1f} of "
        f"{figures['acceleration_limit']:.0f} rad/s²"
    )
    return figures


if __name__ == "__main__":
    main()
