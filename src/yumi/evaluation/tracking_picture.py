"""A picture of arms that followed references: the angle, what was measured, and the error below."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from pathlib import Path
from typing import Any

from yumi.errors import MissingPrerequisite
from yumi.evaluation.streamed_reference import Run


def draw_runs(runs: Sequence[tuple[str, Run]], file: Path) -> None:
    """Draw each named run in a column of its own and save the picture as ``file``.

    Raises:
        MissingPrerequisite: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra; nothing else needs it
    except ImportError as error:
        raise MissingPrerequisite("Pictures need matplotlib; install yumi-ros2[plot].") from error
    figure = Figure(figsize=(4.5 * len(runs), 6.0), layout="constrained")
    panels = figure.subplots(2, len(runs), sharex="col", squeeze=False, height_ratios=(2, 1))
    for (name, run), upper, lower in zip(runs, panels[0], panels[1], strict=True):
        _draw(upper, lower, run)
        upper.set_title(name)
    panels[0][0].set_ylabel("angle [°]")
    panels[1][0].set_ylabel("error [°]")
    panels[0][-1].legend(frameon=False)
    figure.savefig(file, dpi=150)


def _draw(upper: Any, lower: Any, run: Run) -> None:
    times = [each.time for each in run.samples]
    upper.plot(times, [degrees(each.reference) for each in run.samples], label="reference", linewidth=3.0, alpha=0.4)
    upper.plot(times, [degrees(each.measured) for each in run.samples], label="measured")
    lower.plot(times, [degrees(each.measured - each.reference) for each in run.samples])
    lower.set_xlabel("time [s]")
    for panel in (upper, lower):
        panel.grid(alpha=0.3)
