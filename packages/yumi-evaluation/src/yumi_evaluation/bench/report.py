"""The benchmark's report: a JSON document (docs/reference/benchmark.md), tables, and a picture of the latencies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from math import log10, nan
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from rich.box import SIMPLE
from rich.table import Table

from yumi_evaluation.bench.contenders import Case, Mode, Runtime
from yumi_evaluation.bench.figures import COUNTERS, LATENCIES, Figures, Run, Spread, targets
from yumi_evaluation.results import finite

FORMAT = "yumi-bench/1"
CORE_STAGES = ("decode", "limit", "encode")
"""What of a reply is compiled code, but for the calls of it."""

LATENCY_TITLES = ("p50", "p99", "p99.9", "max")
BINS_PER_DECADE = 40
LOWEST_US, HIGHEST_US = 1.0, 100_000.0

_ECHO, _PEER, _OURS = "#8b949e", "#d98200", "#2f81f7"
_PANELS = {
    (Mode.PACED, 1, False): "one arm, 250 Hz",
    (Mode.PACED, 2, False): "two arms, 250 Hz",
    (Mode.PING_PONG, 1, False): "ping-pong",
    (Mode.PACED, 1, True): "one arm, busy machine",
}


def document(
    figures: Figures, settings: dict[str, Any], machine: dict[str, Any], *, is_complete: bool
) -> dict[str, Any]:
    """Every figure, ready for JSON."""
    content = {
        "format": FORMAT,
        "complete": is_complete,
        "machine": machine,
        "settings": settings,
        "summary": {case.name: _summary(figures, case) for case in figures.cases},
        "targets": {
            each.name: {"bound": each.bound, **asdict(each.measured), "holds": each.holds} for each in targets(figures)
        },
        "runs": [
            {
                "round": run.round,
                "contender": run.case.contender.name,
                "mode": run.case.mode.value,
                "cycles": run.cycles,
                "cycles_per_second": run.cycles_per_second,
                "cpu_percent": run.cpu_percent,
                "cpu_all_percent": run.cpu_all_percent,
                "generator_late_max_us": run.generator_late_max_us,
                "arms": [asdict(arm.latency) | {each: getattr(arm, each) for each in COUNTERS} for arm in run.arms],
                "heard": run.heard,
                "stages_us": run.stages,
                "unanswered": run.unanswered,
            }
            for run in figures.runs
        ],
    }
    return dict(finite(content))


def latency_table(figures: Figures) -> Table:
    """One line a case: latencies, and what went wrong in all rounds."""
    table = _table("send to reply [µs], median of rounds", *LATENCY_TITLES, *COUNTERS[:3])
    for case in figures.cases:
        medians = [_median(figures.spread(case, _latency(figure)), ".0f") for figure in LATENCIES]
        counts = [str(sum(run.count(counter) for run in figures.of(case.name))) for counter in COUNTERS[:3]]
        table.add_row(case.name, *medians, *counts)
    return table


def ratio_table(figures: Figures) -> Table:
    """One line a case: the ratio to the better peer of the same round with its range, the rate, and the CPU used."""
    table = _table("to the better PyPI peer, median (range) of rounds", "p50", "p99", "cycles/s", "CPU %")
    for case in figures.cases:
        spreads = [figures.ratio_to_peers(case, figure) for figure in ("p50_us", "p99_us")]
        table.add_row(
            case.name,
            *(f"{each.median:.2f} ({each.lowest:.2f}-{each.highest:.2f})" if each else "–" for each in spreads),
            _median(figures.spread(case, lambda run: run.cycles_per_second), ".0f"),
            _median(figures.spread(case, lambda run: run.cpu_percent), ".1f"),
        )
    return table


def part_table(figures: Figures) -> Table:
    """One line a paced case of ours with one arm that lets the processors halt, as the C echo does: whose time is what.

    The C echo's reply is all kernel and wake-up. What the stages leave is Python between them.
    """
    table = _table("parts of a reply [µs], medians", "kernel and wake-up", "core", "controller", "all else", "reply")
    echo = next((each for each in figures.cases if each.name == "c_echo/paced/1"), None)
    floor = figures.spread(echo, _latency("p50_us")) if echo else None
    for case in figures.cases:
        parts = [figures.spread(case, _stages(*names)) for names in (CORE_STAGES, ("update",))]
        whole = figures.spread(case, _latency("p50_us"))
        waits_like_echo = case.contender.options[:2] == ("--wake", "blocking")
        is_alike = waits_like_echo and case.is_paced and case.arms == 1 and not case.is_machine_busy
        if not is_alike or None in parts or not whole or not floor:
            continue
        known = [floor.median, *(part.median for part in parts if part)]
        table.add_row(case.name, *(f"{each:.0f}" for each in (*known, whole.median - sum(known), whole.median)))
    return table


def target_table(figures: Figures) -> Table:
    """One line a target: bound, median, range, and whether it holds."""
    table = _table("targets", "at most", "median", "range", "holds")
    for each in targets(figures):
        spread = f"{each.measured.lowest:.2f}-{each.measured.highest:.2f}"
        verdict = "[green]yes[/]" if each.holds else "[red]no[/]"
        table.add_row(each.name, f"{each.bound:g}", f"{each.measured.median:.2f}", spread, verdict)
    return table


def draw_histograms(figures: Figures, file: Path) -> None:
    """Draw the latencies of each contender in a row of its own, a column a mode and number of arms, into ``file``."""
    panels = {key: title for key, title in _PANELS.items() if any(_key(run) == key for run in figures.runs)}
    contenders = list(dict.fromkeys(case.contender for case in sorted(figures.cases, key=lambda each: each.name)))
    rows, columns = max(1, len(contenders)), max(1, len(panels))
    figure = Figure(figsize=(2.2 + 4.0 * columns, 1.2 + 0.55 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
    for row, contender in enumerate(contenders):
        color = _PEER if contender.is_peer else _OURS if contender.runtime is Runtime.OURS else _ECHO
        for column, (key, title) in enumerate(panels.items()):
            panel = axes[row][column]
            runs = [run for run in figures.runs if _key(run) == key and run.case.contender == contender]
            latencies = np.concatenate([run.latencies.ravel() for run in runs]) if runs else np.empty(0)
            answered = latencies[latencies > 0] / 1000.0
            if answered.size:
                edges, shares = histogram(answered)
                panel.stairs(shares / shares.max(), edges, fill=True, color=color, alpha=0.75)
                p50, p99 = np.quantile(answered, (0.5, 0.99))
                panel.plot([p50, p99, answered.max()], [0.1] * 3, "|", color="black", markersize=9.0)
                panel.text(0.995, 0.92, f"{p50:.0f} · {p99:.0f} · {answered.max():.0f}", va="top", ha="right",
                           fontsize=7.5, transform=panel.transAxes)  # fmt: skip
            else:
                panel.text(0.5, 0.4, "not run", ha="center", style="italic", color="0.5", transform=panel.transAxes)
            panel.set(xscale="log", xlim=(5.0, 20_000.0), ylim=(0.0, 1.25), yticks=[])
            panel.grid(alpha=0.3, axis="x")
            panel.spines[["top", "right", "left"]].set_visible(False)
            if row == 0:
                panel.set_title(title)
        axes[row][0].set_ylabel(contender.title, rotation=0, ha="right", va="center", fontsize=9)
    for panel in axes[-1]:
        panel.set_xlabel("send to reply [µs]")
    figure.suptitle("Reply latency; marks and numbers: p50 · p99 · max [µs]", fontsize=10)
    figure.savefig(file, dpi=150)


def histogram(latencies_us: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Edges [µs] of bins of equal width on a log scale, and the fraction of the latencies in each bin.

    What lies outside of 1 µs to 0.1 s is counted in the outermost bins.
    """
    latencies = np.asarray(latencies_us, dtype=np.float64)
    decades = log10(HIGHEST_US / LOWEST_US)
    edges = LOWEST_US * 10.0 ** (np.arange(round(BINS_PER_DECADE * decades) + 1) / BINS_PER_DECADE)
    counts, _ = np.histogram(np.clip(latencies, edges[0], edges[-1]), edges)
    return edges, counts / latencies.size


def _key(run: Run) -> tuple[Mode, int, bool]:
    return run.case.mode, run.case.arms, run.case.is_machine_busy


def _table(title: str, *columns: str) -> Table:
    """The first column names the line and is never broken."""
    table = Table(title=title, box=SIMPLE, pad_edge=False)
    table.add_column(no_wrap=True)
    for column in columns:
        table.add_column(column, justify="right", no_wrap=True)
    return table


def _summary(figures: Figures, case: Case) -> dict[str, Any]:
    runs = figures.of(case.name)
    values = {figure: figures.spread(case, _latency(figure)) for figure in LATENCIES}
    values |= {f"{figure}_to_peer": figures.ratio_to_peers(case, figure) for figure in LATENCIES}
    values["cycles_per_second"] = figures.spread(case, lambda run: run.cycles_per_second)
    values["cpu_percent"] = figures.spread(case, lambda run: run.cpu_percent)
    values["cpu_all_percent"] = figures.spread(case, lambda run: run.cpu_all_percent)
    totals: dict[str, Any] = {counter: sum(run.count(counter) for run in runs) for counter in COUNTERS}
    totals["cycles"] = sum(run.cycles * len(run.arms) for run in runs)
    return totals | {name: asdict(value) if value else None for name, value in values.items()}


def _latency(figure: str) -> Callable[[Run], float]:
    return lambda run: run.latency(figure)


def _stages(*names: str) -> Callable[[Run], float]:
    """The time of some stages together [µs]; nan for a server that reports none."""
    return lambda run: sum(run.stages.get(name, nan) for name in names)


def _median(spread: Spread | None, form: str) -> str:
    return f"{spread.median:{form}}" if spread else "–"
