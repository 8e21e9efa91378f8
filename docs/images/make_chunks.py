"""The picture of docs/how-to/run-a-policy.md: the chunks of a policy, and what the arm makes of them, in virtual time.

Run it in the clone: `PYTHONPATH=benchmarks/tracking python docs/images/make_chunks.py` writes docs/images/chunks.png.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from chunk_runs import ChunkRun, Inference, follow_chunks, follow_upstream

from abb_protocols.robot.joints import CYCLE

HERE = Path(__file__).parent
POLICY = Inference(rate=10.0, points=10, duration=0.3)
SECONDS, SEED, JOINT = 6.0, 8, 1


def runs() -> tuple[ChunkRun, ChunkRun]:
    """The same policy here and with upstream's rule."""
    return follow_chunks(POLICY, SECONDS, SEED), follow_upstream(POLICY, SECONDS, SEED)


def main() -> None:
    import matplotlib.pyplot as plt  # noqa: PLC0415 - the figures need none

    plt.rcParams.update({"figure.dpi": 110, "axes.grid": True, "grid.alpha": 0.3, "font.size": 9})
    figure, axes = plt.subplots(3, 1, figsize=(8, 6), layout="constrained", sharex=True)
    labels = ("position [°]", "velocity [°/s]", "acceleration [°/s²]")
    for run, name, color in zip(runs(), ("follow_chunks", "positions_upsampling upstream"), ("C0", "C1"), strict=True):
        begin = run.times[0]
        for order, (each, label) in enumerate(zip(axes, labels, strict=True)):
            values = np.degrees(np.diff(run.desired[:, JOINT], order) / CYCLE**order)
            each.plot(run.times[: len(values)] - begin, values, color=color, lw=1, label=name, zorder=3 - order)
            each.set(ylabel=label)
        if color == "C0":
            for taken in run.taken:
                for each in axes:
                    each.axvline(taken.seam - begin, color="gray", lw=0.5, ls=":")
            for report in run.exhausted:
                for each in axes:
                    each.axvline(report.time - begin, color="C3", lw=0.8)
    axes[2].set(ylim=(-500, 500), xlabel="time [s]; dotted: a chunk comes; red: the points are exhausted")
    axes[0].legend()
    figure.savefig(HERE / "chunks.png")


if __name__ == "__main__":
    main()
