"""What an evaluation leaves beside its report: raw data as CSV, and every figure as JSON under stable names.

The names are those of ``docs/reference/evaluation.md``; names stay, new ones may come.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any

from yumi.evaluation.evaluation_results import Result, Results
from yumi.evaluation.experiment import Trace
from yumi.evaluation.gain_sweep import GainPoint, onset_of
from yumi.evaluation.kpis import Kpi, kpis, legs, machine_legs
from yumi.evaluation.lag_study import Lags, LagStudy, studied_sines
from yumi.evaluation.tracking_figures import compared, figures_document

FORMAT = "yumi-evaluation/1"


def write_series(results: Results, folder: Path) -> None:
    """One CSV file an experiment: ``data/<system>_<experiment>.csv``."""
    folder.mkdir(parents=True, exist_ok=True)
    for run in results.runs:
        with (folder / f"{run.name.replace('/', '_')}.csv").open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows(_rows(run.trace))


def write_json(results: Results, file: Path) -> None:
    """Every figure."""
    file.write_text(json.dumps(document(results), indent=2) + "\n", encoding="utf-8")


def document(results: Results) -> dict[str, Any]:
    """Every figure, ready for JSON; what is no number is null."""
    content = {
        "format": FORMAT,
        "complete": results.is_complete,
        "failures": results.failures,
        "repeats": {name: {"count": len(whys), "reasons": list(whys)} for name, whys in results.repeats.items()},
        **results.settings,
        "experiments": {
            run.name: {
                **_experiment(run),
                "ratio_to_virtual": results.ratio_to_virtual(run),
                "repeats": len(results.repeats.get(run.name, ())),
            }
            for run in results.runs
        },
        "study": _study(results.study) if results.study else None,
        "sweeps": {system.value: _sweep(points) for system, points in results.sweeps.items()},
        "kpis": {
            system.value: {each.name: _kpi(each) for each in kpis(measured)}
            for system, measured in results.measured.items()
        },
        "round_trips_s": {
            system.value: {
                "egm_loop": {leg: asdict(found) for leg, found in legs(measured.trips).items()},
                "state_machine": {leg: asdict(found) for leg, found in machine_legs(measured.machine_trips).items()},
            }
            for system, measured in results.measured.items()
        },
    }
    return dict(_finite(content))


def _rows(trace: Trace) -> list[list[str]]:
    joints = trace.experiment.moved
    series = [trace.measured_deg(joint) for joint in joints]
    header = ["what", "time_s", *(f"{trace.joint_name(joint)}_deg" for joint in joints)]
    sent = [["goal", f"{time:.6f}", *[f"{value:.6f}"] * len(joints)] for time, value in trace.sent_deg]
    measured = [
        ["measured", f"{rows[0][0]:.6f}", *(f"{value:.6f}" for _, value in rows)] for rows in zip(*series, strict=True)
    ]
    return [header, *sent, *measured]


def _experiment(run: Result) -> dict[str, Any]:
    experiment = run.experiment
    pairs = compared(run.trace, run.figures)
    return {
        "title": experiment.title,
        "thesis_figure": experiment.figure,
        "kind": experiment.kind,
        "size_deg": experiment.size_deg,
        "law": experiment.law.name,
        "mode": experiment.mode.word,
        "arm": experiment.side.word,
        "joints": [run.trace.joint_name(joint) for joint in experiment.moved],
        **figures_document(run.figures),
        "slowed_cycles": run.trace.slowed,
        "published": {name: published for name, (published, _, _) in pairs.items()},
        "ratio_to_published": {name: ratio for name, (_, _, ratio) in pairs.items()},
    }


def _sweep(points: tuple[GainPoint, ...]) -> dict[str, Any]:
    return {
        "oscillation_from_p": onset_of(points),
        "points": [{"p": point.gain, **asdict(point.figures)} for point in points],
    }


def _study(study: LagStudy) -> dict[str, Any]:
    """Lists of lags are in the order of ``sines``."""
    return {
        "sines": [each.name for each in studied_sines()],
        "superposition_error_deg": study.deviation_deg,
        "frequencies": [
            {"frequency_hz": frequency, "lags": _lags(lags)} for frequency, lags in study.frequencies.items()
        ],
        "control_lags": [
            {"control_lag_s": lag, "step_times_s": list(robot.step_times), "lags": _lags(robot.lags)}
            for lag, robot in study.robots.items()
        ],
        "matchings": [{"matching": words, "lags": _lags(lags)} for words, lags in study.matchings.items()],
    }


def _lags(lags: Iterable[Lags]) -> list[dict[str, float]]:
    return [{"mean_lag_s": each.mean, "max_lag_s": each.longest, "matched_share": each.share} for each in lags]


def _kpi(kpi: Kpi) -> Mapping[str, Any]:
    return {"value": kpi.value, "limit": kpi.limit, "unit": kpi.unit, "holds": kpi.holds}


def _finite(value: Any) -> Any:
    """JSON knows no nan."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value
