"""What a person sees of an evaluation on the terminal: the summary, the indicators, the gain to take."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table as RichTable

from yumi_evaluation.document import Table
from yumi_evaluation.experiment import System
from yumi_evaluation.experiments import HIGHEST, SLOWER, Recommendation
from yumi_evaluation.pictures import draw_sweep, save_figure
from yumi_evaluation.report import headline, kpi_table, kpis_of, summary_table
from yumi_evaluation.results import Results


def print_results(results: Results, console: Console) -> None:
    """The summary table and the indicators."""
    console.print(headline(results))
    console.print(_rich(summary_table(results), "what is published, and what we measured"))
    for system in System:
        found = kpis_of(results, system)
        if found:
            console.print(_rich(kpi_table(found), f"key performance indicators ({system.title})"))


def recommendation_text(found: Recommendation) -> str:
    """Which gain to take, and why."""
    onset = "not seen" if found.onset is None else f"seen from P = {found.onset:g}"
    if found.gain is None:
        return f"No gain up to {HIGHEST:g} settles without overshoot; oscillation is {onset}."
    return (
        f"Recommended: P = {found.gain:g}; the step is within 0.1° after {found.settling_s:.2f} s at worst, without "
        f"overshoot. Oscillation is {onset}; P = {HIGHEST:g} is the highest the controller takes. Streams are followed "
        "far better with tracking.feed_forward than with any gain."
    )


def draw_recommendation(found: Recommendation, file: Path) -> None:
    """Save the sweeps as an SVG picture.

    Raises:
        MissingPrerequisite: matplotlib is not installed.
        OSError: the file cannot be written.
    """

    def draw(figure: Any) -> None:
        panels = figure.subplots(1, 2)
        draw_sweep((("virtual robot", found.points), (f"{1e3 * SLOWER:g} ms slower", found.slower)), panels)
        for panel in panels if found.gain is not None else ():
            panel.axvline(found.gain, color="#009e73", linestyle="--", linewidth=1.0)

    light, _ = save_figure(draw, 3.4, is_transparent=False)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(light, encoding="utf-8")


def _rich(table: Table, title: str) -> RichTable:
    shown = RichTable(title=title, box=SIMPLE, pad_edge=False)
    for index, name in enumerate(table.header):
        shown.add_column(name, justify="left" if index in table.texts else "right")
    for row in table.rows:
        shown.add_row(*row)
    return shown
