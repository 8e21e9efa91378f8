"""Everything one evaluation found, and the run in virtual time that finds it.

What an evaluation leaves beside its report: raw data as CSV, and every figure as JSON under stable names.

The names are those of ``docs/reference/evaluation.md``; names stay, new ones may come.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import Enum
from math import isfinite
from pathlib import Path
from typing import Any

from yumi.process.realtime import paused_collector
from yumi.virtual.mechanics.arm import ArmModel
from yumi_evaluation.experiment import PREDICTION, Experiment, System, Trace, proportional, sine, step
from yumi_evaluation.experiments import (
    GAINS,
    GainPoint,
    better_experiments,
    joint_experiments,
    onset_of,
    other_frequencies,
    published_experiments,
    sweep,
)
from yumi_evaluation.kpis import Kpi, Measured, kpis, legs, machine_legs, motion_delay
from yumi_evaluation.lag_study import PARTS, Lags, LagStudy, studied_sines, study_lags
from yumi_evaluation.round_trips import virtual_machine_trips, virtual_trips
from yumi_evaluation.tracking_figures import Figures, SineFigures, StepFigures, compared, figures_document, figures_of
from yumi_evaluation.virtual_machine import FITTED, run_virtually

TRIPS, MACHINE_TRIPS = 2500, 250
"""Round trips to the EGM loop and to the state machine in virtual time, where they repeat themselves."""

OnStep = Callable[[str], None]
"""Told what begins."""


@dataclass(frozen=True, slots=True)
class Result:
    """An experiment that was run.

    Attributes:
        system: between which parts.
        trace: what became of it.
        figures: of the trace.
    """

    system: System
    trace: Trace
    figures: Figures

    @property
    def experiment(self) -> Experiment:
        return self.trace.experiment

    @property
    def name(self) -> str:
        return f"{self.system.value}/{self.experiment.name}"


def main_figure(figures: Figures) -> float | None:
    """Step time or mean lag [s]."""
    return figures.settling_s if isinstance(figures, StepFigures) else figures.mean_lag_s


class Variant(Enum):
    """Steps of 10° with P = 1.2 that tell what a difference comes from: the guard, or the robot's delay and lag."""

    SHIPPED_ROBOT = (System.BARE, ArmModel())
    GUARDED_FIT = (System.SHIPPED, FITTED)

    def run(self) -> float | None:
        """How long the step takes [s]; None when it does not settle."""
        system, model = self.value
        figures = figures_of(run_virtually(step(proportional(1.2)), system, model))
        return figures.settling_s if isinstance(figures, StepFigures) else None


@dataclass(slots=True)
class Results:
    """What there is so far.

    Attributes:
        runs: experiments that came to their end.
        failures: why an experiment could not be run, by its name.
        repeats: why runs of an experiment were thrown away and it was run again, by its name.
        variants: times of the steps that tell where differences come from [s].
        study: what the things the publication leaves open do to its lags; None when that was not looked at.
        sweeps: steps with one gain after another.
        measured: what the indicators are made of, by system.
        is_complete: whether everything that was planned was done.
        settings: what was chosen, and the versions of what ran; for people and JSON.
    """

    runs: list[Result] = field(default_factory=list)
    failures: dict[str, str] = field(default_factory=dict)
    repeats: dict[str, tuple[str, ...]] = field(default_factory=dict)
    variants: dict[Variant, float | None] = field(default_factory=dict)
    study: LagStudy | None = None
    sweeps: dict[System, tuple[GainPoint, ...]] = field(default_factory=dict)
    measured: dict[System, Measured] = field(default_factory=dict)
    is_complete: bool = False
    settings: Mapping[str, Mapping[str, object]] = field(default_factory=dict)

    def add(self, system: System, trace: Trace) -> None:
        self.runs.append(Result(system, trace, figures_of(trace)))

    def find(self, system: System, experiment: Experiment) -> Result | None:
        """The run of ``experiment``, if it was made."""
        name = f"{system.value}/{experiment.name}"
        return next((run for run in self.runs if run.name == name), None)

    def variant(self, variant: Variant) -> float | None:
        """How long its step took [s]; None when it was not run, or did not settle."""
        return self.variants.get(variant)

    def of(self, system: System, experiments: Sequence[Experiment]) -> list[Result]:
        """The runs of these experiments that were made."""
        found = [self.find(system, experiment) for experiment in experiments]
        return [run for run in found if run is not None]

    def ratio_to_virtual(self, run: Result) -> float | None:
        """Step time or mean lag of a run over the wire, divided by that of the same one in virtual time."""
        shipped = self.find(System.SHIPPED, run.experiment)
        if run.system is not System.WIRE or shipped is None:
            return None
        own, virtual = main_figure(run.figures), main_figure(shipped.figures)
        return own / virtual if own and virtual else None

    def close(self) -> None:
        """Fill in the indicators of whatever ran, however early it ended."""
        for system in (System.SHIPPED, System.WIRE):
            if any(run.system is system for run in self.runs):
                self.close_measured(system)

    def close_measured(self, system: System) -> None:
        """Fill in what the indicators take from the experiments."""
        delays = [motion_delay(run.trace.measured_deg(run.experiment.moved[0])) for run in self._steps(system)]
        lag, error = self.find(system, sine(proportional(2.0))), self.find(system, sine(PREDICTION))
        self.measured[system] = replace(
            self.measured.get(system, Measured()),
            motion_delays=tuple(delay for delay in delays if delay is not None),
            control_lag=lag.figures.max_lag_s if lag and isinstance(lag.figures, SineFigures) else None,
            precision_deg=error.figures.max_error_deg if error and isinstance(error.figures, SineFigures) else None,
        )

    def _steps(self, system: System) -> list[Result]:
        return [run for run in self.runs if run.system is system and run.experiment.is_step]


def planned_virtually() -> tuple[tuple[System, Experiment], ...]:
    """Every experiment of the run in virtual time."""
    return (
        *((System.BARE, each) for each in published_experiments()),
        *((System.BARE, each) for each in other_frequencies()),
        *((System.SHIPPED, each) for each in published_experiments()),
        *((System.SHIPPED, each) for each in better_experiments()),
        *((System.SHIPPED, each) for each in joint_experiments()),
    )


def virtual_step_count() -> int:
    """How often ``on_step`` is called."""
    return len(planned_virtually()) + len(Variant) + PARTS + 2 * len(GAINS) + 2


def evaluate_virtually(results: Results, on_step: OnStep) -> None:
    """Run everything in virtual time into ``results``; ``on_step`` may raise to end it early."""
    with paused_collector():
        _run_virtually(results, on_step)
    results.close()


def _run_virtually(results: Results, on_step: OnStep) -> None:
    for system, experiment in planned_virtually():
        on_step(experiment.title)
        results.add(system, run_virtually(experiment, system))
    for variant in Variant:
        on_step("Where differences come from")
        results.variants[variant] = variant.run()
    bare = {run.experiment.name: run.trace for run in results.runs if run.system is System.BARE}
    results.study = study_lags(bare, lambda: on_step("What the thesis leaves open"))
    for system in (System.BARE, System.SHIPPED):
        results.sweeps[system] = sweep(GAINS, system, on_point=lambda: on_step("Steps with one gain after another"))
    on_step("Round trips to the EGM loop")
    trips, datagrams, lost = virtual_trips(TRIPS)
    on_step("Round trips to the state machine")
    results.measured[System.SHIPPED] = Measured(
        trips=trips, machine_trips=virtual_machine_trips(MACHINE_TRIPS), datagrams=datagrams, lost=lost
    )


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
