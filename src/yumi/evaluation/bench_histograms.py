"""A picture of the benchmark: the distribution of reply latencies, one line a contender, latencies on a log scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import log10
from pathlib import Path
from typing import Any

from yumi.errors import MissingPrerequisite

BINS_PER_DECADE = 40
LOWEST_US, HIGHEST_US = 1.0, 100_000.0

# Matplotlib's palette "tab20": its ten strong colours, then the ten pale ones.
_COLOURS = (
    "#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22", "#17becf",
    "#aec7e8", "#ffbb78", "#98df8a", "#ff9896", "#c5b0d5", "#c49c94", "#f7b6d2", "#c7c7c7", "#dbdb8d", "#9edae5",
)  # fmt: skip


def histogram(latencies_us: Sequence[float]) -> tuple[list[float], list[float]]:
    """Edges [µs] of bins of equal width on a log scale, and the share of the latencies in each bin.

    What lies outside of 1 µs to 0.1 s is counted in the outermost bins.
    """
    count = round(BINS_PER_DECADE * log10(HIGHEST_US / LOWEST_US))
    edges = [LOWEST_US * 10.0 ** (index / BINS_PER_DECADE) for index in range(count + 1)]
    shares = [0.0] * count
    for latency in latencies_us:
        position = BINS_PER_DECADE * log10(max(latency, LOWEST_US) / LOWEST_US)
        shares[min(int(position), count - 1)] += 1.0 / len(latencies_us)
    return edges, shares


def draw_histograms(panels: Mapping[str, Mapping[str, Sequence[float]]], file: Path) -> None:
    """Draw one panel per title with the latencies [µs] of each contender, and save the picture as ``file``.

    Raises:
        MissingPrerequisite: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra; nothing else needs it
    except ImportError as error:
        raise MissingPrerequisite("Pictures need matplotlib; install yumi-ros2[plot].") from error
    figure = Figure(figsize=(10.0, 3.2 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    names = dict.fromkeys(name for contenders in panels.values() for name in contenders)
    styles = dict(zip(names, line_styles(len(names)), strict=True))  # a contender looks the same in all panels
    for panel, (title, contenders) in zip(axes, panels.items(), strict=True):
        _draw_panel(panel, title, contenders, styles)
    axes[-1].set_xlabel("send to reply [µs]")
    figure.savefig(file, dpi=150)


def line_styles(count: int) -> list[dict[str, Any]]:
    """As many looks of a line, no two alike: the strong colours first, then the pale ones, then both dashed."""
    return [
        {"color": _COLOURS[index % len(_COLOURS)], "linestyle": ("-", "--", ":")[index // len(_COLOURS) % 3]}
        for index in range(count)
    ]


def _draw_panel(
    panel: Any, title: str, contenders: Mapping[str, Sequence[float]], styles: Mapping[str, Mapping[str, Any]]
) -> None:
    for name, latencies in contenders.items():
        edges, shares = histogram(latencies)
        panel.stairs(shares, edges, label=f"{name} ({len(latencies)} replies)", linewidth=1.4, **styles[name])
    panel.set(title=title, xscale="log", yscale="log", ylabel="share of replies", xlim=(5.0, 20_000.0))
    panel.grid(alpha=0.3, which="both")
    panel.legend(loc="upper right", fontsize="small", frameon=False)
