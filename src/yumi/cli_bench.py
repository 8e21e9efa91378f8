"""``yumi bench``: how fast robot datagrams are answered, beside what else there is, on this machine in this hour."""

from __future__ import annotations

import json
import os
import platform
import sys
from array import array
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from yumi.errors import RobotNotReady, SettingsError
from yumi.evaluation.bench_build import Workshop, compile_programs, find_workshop, install_peers
from yumi.evaluation.bench_contenders import (
    WAKE_MODES,
    Case,
    Contender,
    Mode,
    Runtime,
    cases_of,
    contenders,
    fast_line,
    schedule,
)
from yumi.evaluation.bench_figures import Figures, Run
from yumi.evaluation.bench_histograms import draw_histograms
from yumi.evaluation.bench_processes import PERIOD_US, WARM_UP, run_case
from yumi.evaluation.bench_report import document, latency_table, ratio_table, target_table
from yumi.evaluation.bench_soak import ARMS, chunks_of, soak, soak_document

QUICK = (2, 500)
"""Rounds and cycles to look at, not to judge by."""

_INCOMPLETE = 1
_TABLE_WIDTH = 92  # a table that is cut says nothing, a line that a narrow terminal breaks still does
_START = 4.0  # [s] what a fresh server takes, for the announcement
_PANELS = {(Mode.PACED, 1): "one arm, 250 Hz", (Mode.PACED, 2): "two arms, 250 Hz", (Mode.PING_PONG, 1): "ping-pong"}


@click.command()
@click.option("--rounds", type=click.IntRange(1, 100), default=5, show_default=True, help="Each contender, so often.")
@click.option(
    "--cycles", type=click.IntRange(100, 500_000), default=4000, show_default=True, help="Counted cycles of a run."
)
@click.option("--quick", is_flag=True, help="Two rounds of 500 cycles: to look at, not to judge by.")
@click.option("--only", multiple=True, metavar="NAME", help="Only this contender; may be repeated.")
@click.option("--wake", multiple=True, type=click.Choice(WAKE_MODES), help="Only this egm.wake; may be repeated.")
@click.option("--seed", default=1, show_default=True, help="Of the order within the rounds.")
@click.option("--soak", "minutes", type=click.FloatRange(0.5, 1440.0), help="Instead: both arms for so many minutes.")
@click.option("--json", "report", type=click.Path(path_type=Path), help="Write every figure to this file.")
@click.option("--histograms", type=click.Path(path_type=Path), help="Where the picture goes.  [build/bench/*.png]")
def bench(
    rounds: int,
    cycles: int,
    quick: bool,
    only: tuple[str, ...],
    wake: tuple[str, ...],
    seed: int,
    minutes: float | None,
    report: Path | None,
    histograms: Path | None,
) -> None:
    """Measure the time from a robot datagram to its reply, interleaved with others.

    Every run starts a fresh server; a load generator plays the robot on this machine. Ctrl-C reports what is there.

    \b
    Examples:
      yumi bench --quick
      yumi bench --rounds 5 --cycles 15000 --json figures.json
      yumi bench --soak 10
    """
    workshop = find_workshop()
    console = Console(highlight=False)
    console.width = max(console.width, _TABLE_WIDTH)
    machine = _machine()
    if minutes is not None:
        compile_programs(workshop)
        _soak(workshop, console, machine, minutes, (wake or WAKE_MODES)[-1], report)
        return
    rounds, cycles = QUICK if quick else (rounds, cycles)
    chosen = _chosen(wake or WAKE_MODES, only)
    _prepare(workshop, console, chosen)
    plan = schedule(cases_of(chosen), rounds, seed)
    _announce(console, plan, rounds, cycles)
    figures, latencies = _run_all(workshop, console, plan, cycles)
    if not figures.runs:
        console.print("No run came to its end: there is nothing to report.")
        sys.exit(_INCOMPLETE)
    console.print(latency_table(figures), ratio_table(figures), target_table(figures))
    picture = histograms or workshop.products / "histograms.png"
    draw_histograms(_panels(latencies), picture)
    console.print(f"Histograms: {picture}")
    settings = {
        "rounds": rounds, "cycles": cycles, "warm_up_cycles": WARM_UP, "period_us": PERIOD_US, "seed": seed,
        "contenders": [each.name for each in chosen],
    }  # fmt: skip
    is_complete = len(figures.runs) == len(plan)
    _write(report, document(figures, settings, machine, is_complete=is_complete))
    sys.exit(0 if is_complete else _INCOMPLETE)


def _chosen(wake: tuple[str, ...], only: tuple[str, ...]) -> list[Contender]:
    everybody = contenders(wake)
    for name in only:
        if name not in {each.name for each in everybody}:
            known = ", ".join(each.name for each in everybody)
            raise SettingsError(f"There is no contender {name!r}; there are: {known}.")
    return [each for each in everybody if not only or each.name in only]


def _prepare(workshop: Workshop, console: Console, chosen: list[Contender]) -> None:
    compile_programs(workshop)
    if any(each.runtime is Runtime.PEERS for each in chosen):
        console.print("Peers from PyPI: into build/bench-venv, if they are not there yet")
        install_peers(workshop)


def _announce(console: Console, plan: list[tuple[int, Case]], rounds: int, cycles: int) -> None:
    paced = sum(case.mode is Mode.PACED for _, case in plan)
    seconds = paced * (cycles + WARM_UP) * PERIOD_US / 1e6 + len(plan) * _START
    console.print(f"{len(plan)} runs in {rounds} rounds of {cycles} cycles: about {seconds / 60.0:.0f} minutes.")


def _run_all(
    workshop: Workshop, console: Console, plan: list[tuple[int, Case]], cycles: int
) -> tuple[Figures, dict[Case, array[int]]]:
    runs: list[Run] = []
    latencies: dict[Case, array[int]] = defaultdict(lambda: array("q"))
    with _bar(console, len(plan)) as advance:
        try:
            for number, case in plan:
                advance(f"round {number}: {case.name}", 0)
                try:
                    run, measured = run_case(workshop, case, number, cycles)
                except RobotNotReady as error:
                    console.print(f"Round {number}: {error}")
                    continue
                runs.append(run)
                for arm in measured:
                    latencies[case].extend(arm)
                advance("", 1)
        except KeyboardInterrupt:
            console.print("Interrupted: the report is about the runs that have ended.")
    return Figures(tuple(runs)), latencies


@contextmanager
def _bar(console: Console, total: int) -> Iterator[Any]:
    """A progress bar that is drawn between the runs only: a redraw during one would be measured along."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console, auto_refresh=False) as progress:
        task = progress.add_task("", total=total)

        def advance(what: str, steps: int) -> None:
            progress.update(task, description=what, advance=steps)
            progress.refresh()

        yield advance


def _panels(latencies: dict[Case, array[int]]) -> dict[str, dict[str, list[float]]]:
    panels: dict[str, dict[str, list[float]]] = {}
    for (mode, arms), title in _PANELS.items():
        contents = {
            case.contender.title: [value / 1000.0 for value in values if value > 0]
            for case, values in sorted(latencies.items(), key=lambda item: item[0].name)
            if case.mode is mode and case.arms == arms
        }
        if contents:
            panels[title] = contents
    return panels


def _soak(
    workshop: Workshop, console: Console, machine: dict[str, Any], minutes: float, wake: str, report: Path | None
) -> None:
    chunks = chunks_of(minutes)
    console.print(f"{ARMS} arms, {minutes:g} minutes each for the fast line ({wake}) and the C echo, in turns.")
    with _bar(console, 2 * chunks) as advance:
        endured = soak(workshop, fast_line(wake), minutes, lambda: advance("soak", 1))
    figures = soak_document(endured)
    for name, each in figures.items():
        console.print(
            f"{name}: missed {each['missed']} of {ARMS * each['cycles_per_arm']}, bad {each['bad']}, worst p99 "
            f"{each['worst_p99_us']:.0f} µs, max {each['worst_max_us']:.0f} µs, memory {each['growth_kib']:+d} KiB "
            f"after the first chunk ({each['resident_kib'][-1]} KiB)"
        )
    settings = {"minutes": minutes, "period_us": PERIOD_US, "arms": ARMS, "wake": wake}
    _write(report, {"format": "yumi-bench-soak/1", "machine": machine, "settings": settings, "soak": figures})


def _machine() -> dict[str, Any]:
    return {
        "cpus": os.cpu_count(),
        "processor": platform.machine(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "load_before": os.getloadavg()[0],
    }


def _write(report: Path | None, content: dict[str, Any]) -> None:
    if report:
        report.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
