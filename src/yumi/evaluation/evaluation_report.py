"""The evaluation's report: a summary on top, then pictures, tables, explanations with their evidence, settings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from yumi.evaluation.document import Block, Heading, Paragraph, Picture, to_html, to_markdown
from yumi.evaluation.evaluation_files import write_series
from yumi.evaluation.evaluation_pictures import draw_pictures
from yumi.evaluation.evaluation_results import Results
from yumi.evaluation.evaluation_tables import (
    headline,
    kpi_table,
    kpis_of,
    leg_table,
    real_time_table,
    repeats_table,
    result_table,
    settings_table,
    study_tables,
    summary_table,
    systems_table,
)
from yumi.evaluation.experiment import System
from yumi.evaluation.experiments import better_experiments, joint_experiments, published_experiments
from yumi.evaluation.explanations import explanations
from yumi.evaluation.kpis import legs, machine_legs

TITLE = "Evaluation of the YuMi's joint control"

_INTRODUCTION = (
    "The experiments of the master's thesis this system comes from, repeated: axis 6 makes steps and follows sines, "
    "an application sends the goals, and what counts is the measured position. Our figures stand beside the published "
    "ones, with their ratio. They are of a virtual robot unless the settings at the end name a real one."
)
_TERMS = (
    "The words below: 'without a guard' is the thesis's system, in virtual time, with a virtual robot fitted to its "
    "step times; 'as shipped' is what everybody gets, in virtual time, with a guard that limits the speed, "
    "acceleration and jerk of commands; 'over the wire' is the same in real time, through ROS 2 and the network. P is "
    "the controller's gain. A control lag is the time from a goal until the joint is within 0.1° of it."
)
_PARTIAL = "This evaluation is not complete: what is missing was not run."


def write_report(results: Results, folder: Path) -> Path:
    """Write report, pictures and raw data into ``folder``; returns the HTML page.

    Raises:
        MissingPrerequisite: matplotlib is not installed.
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_series(results, folder / "data")
    blocks = report_blocks(results, draw_pictures(results, folder))
    (folder / "report.md").write_text(to_markdown(blocks), encoding="utf-8")
    page = folder / "report.html"
    page.write_text(to_html(blocks, TITLE), encoding="utf-8")
    return page


def report_blocks(results: Results, pictures: Mapping[str, Picture]) -> list[Block]:
    """The report from top to bottom; ``pictures`` that are missing are left out."""
    return [
        Heading(TITLE, 1),
        Paragraph(_INTRODUCTION),
        Paragraph(_TERMS),
        *([] if results.is_complete else [Paragraph(_PARTIAL)]),
        *(Paragraph(f"{name} could not be run: {why}") for name, why in results.failures.items()),
        Paragraph(headline(results)),
        summary_table(results),
        *_indicators(results),
        *_systems(results),
        *_differences(results, pictures),
        *_steps(results, pictures),
        *_sines(results, pictures),
        *_better(results),
        *_real_time(results),
        *_round_trips(results, pictures),
        Heading("Settings and versions"),
        settings_table(results.settings),
        Paragraph("Raw data: data/*.csv, one file for each experiment, angles in degrees from where the joint began."),
    ]


def _indicators(results: Results) -> list[Block]:
    blocks: list[Block] = []
    words = {System.SHIPPED: "in virtual time", System.WIRE: "in real time"}
    for system, title in words.items():
        found = kpis_of(results, system)
        if found:
            blocks += [Heading(f"Key performance indicators {system.title}, {title}"), kpi_table(found)]
    return blocks


def _systems(results: Results) -> list[Block]:
    table = systems_table(results)
    return [Heading("What a user gets"), table] if table else []


def _steps(results: Results, pictures: Mapping[str, Picture]) -> list[Block]:
    experiments = [each for each in published_experiments() if each.is_step]
    table = result_table(results, experiments, System)
    return [Heading("Step responses"), *_shown(pictures, "steps"), table, *_shown(pictures, "sweep")]


def _sines(results: Results, pictures: Mapping[str, Picture]) -> list[Block]:
    experiments = [each for each in published_experiments() if not each.is_step]
    return [
        Heading("Followed sines"),
        *_shown(pictures, "sines", "lags", "reduced"),
        result_table(results, experiments, System),
    ]


def _better(results: Results) -> list[Block]:
    sines = [each for each in (*better_experiments(), *joint_experiments()) if not each.is_step]
    return [
        Heading("Better control laws, both arms, all joints"),
        Paragraph(
            "Feed-forward tells the robot the goal's speed beside its position; prediction forecasts where the goal "
            "will be when the robot gets there; a trajectory with look-ahead is known as a whole, and is sent ahead by "
            "the robot's delay. Where all joints move at once, the figures are those of the joint that follows worst."
        ),
        result_table(results, [each for each in better_experiments() if each.is_step], System),
        result_table(results, sines, System),
    ]


def _real_time(results: Results) -> list[Block]:
    table, repeats = real_time_table(results), repeats_table(results)
    if table is None:
        return []
    undisturbed = Paragraph("No experiment had to be repeated: no run was disturbed.")
    return [Heading("Real time beside virtual time"), table, repeats or undisturbed]


def _round_trips(results: Results, pictures: Mapping[str, Picture]) -> list[Block]:
    blocks: list[Block] = []
    for system, measured in results.measured.items():
        if measured.trips:
            caption = f"From the application to the EGM loop and back ({system.title})"
            blocks += [*_shown(pictures, f"trips_{system.value}"), leg_table(legs(measured.trips), caption)]
        if measured.machine_trips:
            caption = f"From the application to the state machine and back ({system.title})"
            blocks.append(leg_table(machine_legs(measured.machine_trips), caption))
    return [Heading("Round trips, leg by leg"), *blocks] if blocks else []


def _differences(results: Results, pictures: Mapping[str, Picture]) -> list[Block]:
    tables = study_tables(results.study) if results.study else {}
    blocks: list[Block] = [Heading("Where our figures differ, and why")]
    for each in explanations(results):
        blocks += [Heading(each.title, 3), Paragraph(each.text), *_shown(pictures, each.name)]
        blocks += [tables[each.name]] if each.name in tables else []
    return blocks


def _shown(pictures: Mapping[str, Picture], *names: str) -> list[Block]:
    return [pictures[name] for name in names if name in pictures]
