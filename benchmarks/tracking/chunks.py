"""Chunks of a random policy in virtual time: how the command changes at the seams, here and with upstream's rule.

Run it in the clone: `python benchmarks/tracking/chunks.py [seconds]` prints the table of docs/how-to/run-a-policy.md.
"""

from __future__ import annotations

import sys
from math import ceil

from chunk_runs import Inference, follow_chunks, follow_upstream, steps_of


def main(seconds: float) -> None:
    sys.stdout.write("| points | inference | chunks, lost | exhausted | in a cycle | of the jerk limit | rms ")
    sys.stdout.write("| upstream: in a cycle | of the jerk limit | rms |\n|---|---|---|---|---|---|---|---|---|---|\n")
    for rate in (5.0, 10.0, 50.0):
        for duration in (0.0, 0.1, 0.3, 0.8):
            points = min(50, max(8, ceil((2.0 * duration + 0.3) * rate)))
            inference = Inference(rate, points, duration)
            ours, theirs = (run(inference, seconds, 1) for run in (follow_chunks, follow_upstream))
            cells = [f"{points} at {rate:g} Hz", f"{1e3 * duration:.0f} ms"]
            cells += [f"{len(ours.taken) + ours.lost + len(ours.refused)}, {ours.lost}", str(len(ours.exhausted))]
            for run in (ours, theirs):
                steps = steps_of(run.desired)
                cells += [f"{steps.acceleration:.2f} rad/s²", f"{steps.share:.2f}", f"{steps.rms:.2f} rad/s²"]
            sys.stdout.write(f"| {' | '.join(cells)} |\n")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
