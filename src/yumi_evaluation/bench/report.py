"""The benchmark's report: a JSON document under stable names (docs/reference/benchmark.md), and tables for a person."""

from __future__ import annotations

from dataclasses import asdict
from math import isfinite
from typing import Any

from rich.box import SIMPLE
from rich.table import Table

from yumi_evaluation.bench.build import Case
from yumi_evaluation.bench.figures import COUNTERS, LATENCIES, Figures, Run, Spread
from yumi_evaluation.bench.targets import targets

FORMAT = "yumi-bench/1"
LATENCY_TITLES = ("p50", "p99", "p99.9", "max")


def document(
    figures: Figures, settings: dict[str, Any], machine: dict[str, Any], *, is_complete: bool
) -> dict[str, Any]:
    """Every figure, ready for JSON; what is no number is null."""
    content = {
        "format": FORMAT,
        "complete": is_complete,
        "machine": machine,
        "settings": settings,
        "summary": {case.name: _summary(figures, case) for case in figures.cases},
        "targets": {
            each.name: {"bound": each.bound, **asdict(each.measured), "holds": each.holds} for each in targets(figures)
        },
        "runs": [_run(run) for run in figures.runs],
    }
    return dict(_finite(content))


def latency_table(figures: Figures) -> Table:
    """One line a case: latencies, and what went wrong in all rounds."""
    table = _table("send to reply [µs], median of rounds", *LATENCY_TITLES, *COUNTERS[:3])
    for case in figures.cases:
        runs = figures.of(case.name)
        table.add_row(
            case.name,
            *(_median(figures.spread(case, _latency(figure)), ".0f") for figure in LATENCIES),
            *(str(sum(run.count(counter) for run in runs)) for counter in COUNTERS[:3]),
        )
    return table


def ratio_table(figures: Figures) -> Table:
    """One line a case: the ratio to the better peer of the same round with its range, the rate, and the CPU used."""
    table = _table("to the better PyPI peer, median (range) of rounds", "p50", "p99", "cycles/s", "CPU %")
    for case in figures.cases:
        table.add_row(
            case.name,
            *(_with_range(figures.ratio_to_peers(case, figure)) for figure in ("p50_us", "p99_us")),
            _median(figures.spread(case, lambda run: run.cycles_per_second), ".0f"),
            _median(figures.spread(case, lambda run: run.cpu_percent), ".1f"),
        )
    return table


def target_table(figures: Figures) -> Table:
    """One line a target: bound, median, range, and whether it holds."""
    table = _table("targets", "at most", "median", "range", "holds")
    for each in targets(figures):
        spread = f"{each.measured.lowest:.2f}-{each.measured.highest:.2f}"
        verdict = "[green]yes[/]" if each.holds else "[red]no[/]"
        table.add_row(each.name, f"{each.bound:g}", f"{each.measured.median:.2f}", spread, verdict)
    return table


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


def _run(run: Run) -> dict[str, Any]:
    return {
        "round": run.round,
        "contender": run.case.contender.name,
        "mode": run.case.mode.value,
        "cycles": run.cycles,
        "cycles_per_second": run.cycles_per_second,
        "cpu_percent": run.cpu_percent,
        "cpu_all_percent": run.cpu_all_percent,
        "generator_late_max_us": run.generator_late_max_us,
        "arms": [asdict(arm.latency) | {counter: getattr(arm, counter) for counter in COUNTERS} for arm in run.arms],
        "heard": run.heard,
    }


def _latency(figure: str) -> Any:
    return lambda run: run.latency(figure)


def _median(spread: Spread | None, form: str, unit: str = "") -> str:
    return f"{spread.median:{form}}{unit}" if spread else "–"


def _with_range(spread: Spread | None) -> str:
    return f"{spread.median:.2f} ({spread.lowest:.2f}-{spread.highest:.2f})" if spread else "–"


def _finite(value: Any) -> Any:
    """JSON knows no nan."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value
