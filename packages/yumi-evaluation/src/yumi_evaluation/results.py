"""Everything one evaluation found, the run in virtual time that finds it, and its raw data as CSV and JSON.

The names of the JSON are those of ``docs/reference/evaluation.md``.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import Enum
from math import isfinite
from pathlib import Path
from typing import Any

from abb_runtime.process.realtime import paused_collector
from virtual_irc5.mechanics.arm_motion import ArmModel
from yumi_evaluation.experiments import (
    PREDICTION,
    Experiment,
    Figures,
    SineFigures,
    System,
    Trace,
    better_experiments,
    compared,
    figures_of,
    joint_experiments,
    main_figure,
    other_frequencies,
    proportional,
    published_experiments,
    sine,
    step,
    step_figures_of,
)
from yumi_evaluation.gain_sweep import GAINS, GainPoint, onset_of, sweep
from yumi_evaluation.kpis import Measured, kpis, legs, machine_legs, motion_delay
from yumi_evaluation.round_trips import virtual_machine_trips, virtual_trips
from yumi_evaluation.virtual_time import FITTED, run_virtually

FORMAT = "yumi-evaluation/1"

TRIPS, MACHINE_TRIPS = 2500, 250
"""Round trips to the EGM loop and to the state machine in virtual time, where they repeat themselves."""

OnStep = Callable[[str], None]
"""Called with the title of each step; may raise to end the evaluation early."""


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


class Variant(Enum):
    """Steps of 10° with P = 1.2 that separate two causes: the limiter, and the acceleration of the robot's EGM."""

    SHIPPED_ROBOT = (System.BARE, ArmModel())
    LIMITED_FIT = (System.SHIPPED, FITTED)

    def run(self) -> float | None:
        """How long the step takes [s]; None when it does not settle."""
        system, model = self.value
        return step_figures_of(run_virtually(step(proportional(1.2)), system, model)).settling_s


@dataclass(slots=True)
class Results:
    """What there is so far.

    Attributes:
        runs: experiments that were completed.
        failures: why an experiment could not be run, by its name.
        repeats: why runs of an experiment were discarded and repeated, by its name.
        variants: times of the steps that show where differences come from [s].
        sweeps: steps with one gain after another.
        measured: what the indicators are made of, by system.
        is_complete: whether everything that was planned was done.
        settings: what was chosen, and the versions of what ran.
    """

    runs: list[Result] = field(default_factory=list)
    failures: dict[str, str] = field(default_factory=dict)
    repeats: dict[str, tuple[str, ...]] = field(default_factory=dict)
    variants: dict[Variant, float | None] = field(default_factory=dict)
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

    def of(self, system: System, experiments: Sequence[Experiment]) -> list[Result]:
        """The runs of these experiments that were made."""
        found = [self.find(system, experiment) for experiment in experiments]
        return [run for run in found if run is not None]

    def ratio_to_virtual(self, run: Result) -> float | None:
        """Step time or mean lag of a networked run, divided by that of the same one in virtual time."""
        shipped = self.find(System.SHIPPED, run.experiment)
        if run.system is not System.NETWORKED or shipped is None:
            return None
        own, virtual = main_figure(run.figures), main_figure(shipped.figures)
        return own / virtual if own and virtual else None

    def close(self) -> None:
        """Fill in what the indicators take from the experiments that ran, however early it ended."""
        for system in (System.SHIPPED, System.NETWORKED):
            if any(run.system is system for run in self.runs):
                self.close_measured(system)

    def close_measured(self, system: System) -> None:
        """The same for one system."""
        steps = [run for run in self.runs if run.system is system and run.experiment.is_step]
        delays = [motion_delay(run.trace.measured_deg(run.experiment.moved[0])) for run in steps]
        lag, error = self.find(system, sine(proportional(2.0))), self.find(system, sine(PREDICTION))
        self.measured[system] = replace(
            self.measured.get(system, Measured()),
            motion_delays=tuple(delay for delay in delays if delay is not None),
            control_lag=lag.figures.max_lag_s if lag and isinstance(lag.figures, SineFigures) else None,
            precision_deg=error.figures.max_error_deg if error and isinstance(error.figures, SineFigures) else None,
        )


def planned_virtually() -> tuple[tuple[System, Experiment], ...]:
    """Every experiment of the run in virtual time."""
    bare = (*published_experiments(), *other_frequencies())
    shipped = (*published_experiments(), *better_experiments(), *joint_experiments())
    return (*((System.BARE, each) for each in bare), *((System.SHIPPED, each) for each in shipped))


def virtual_step_count() -> int:
    """How often ``on_step`` is called."""
    return len(planned_virtually()) + len(Variant) + 2 * len(GAINS) + 2


def evaluate_virtually(results: Results, on_step: OnStep) -> None:
    """Run everything in virtual time into ``results``."""
    with paused_collector():
        for system, experiment in planned_virtually():
            on_step(experiment.title)
            results.add(system, run_virtually(experiment, system))
        for variant in Variant:
            on_step("Where differences come from")
            results.variants[variant] = variant.run()
        for system in (System.BARE, System.SHIPPED):
            results.sweeps[system] = sweep(GAINS, system, on_point=lambda: on_step("Steps with one gain after another"))
        on_step("Round trips to the EGM loop")
        trips, datagrams, lost = virtual_trips(TRIPS)
        on_step("Round trips to the state machine")
        machine = virtual_machine_trips(MACHINE_TRIPS)
        results.measured[System.SHIPPED] = Measured(trips=trips, machine_trips=machine, datagrams=datagrams, lost=lost)
    results.close()


def write_csv(results: Results, folder: Path) -> None:
    """One CSV file an experiment: ``<system>_<experiment>.csv``."""
    folder.mkdir(parents=True, exist_ok=True)
    for run in results.runs:
        trace, joints = run.trace, run.experiment.moved
        rows = [["what", "time_s", *(f"{trace.joint_name(joint)}_deg" for joint in joints)]]
        rows += [["goal", f"{time:.6f}", *[f"{value:.6f}"] * len(joints)] for time, value in trace.sent_deg]
        for samples in zip(*(trace.measured_deg(joint) for joint in joints), strict=True):
            rows.append(["measured", f"{samples[0][0]:.6f}", *(f"{value:.6f}" for _, value in samples)])
        with (folder / f"{run.name.replace('/', '_')}.csv").open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows(rows)


def document(results: Results) -> dict[str, Any]:
    """Every figure, ready for JSON."""
    experiments = {}
    for run in results.runs:
        experiment, pairs = run.experiment, compared(run.trace, run.figures)
        experiments[run.name] = {
            "title": experiment.title,
            "thesis_figure": experiment.figure,
            "kind": experiment.kind,
            "size_deg": experiment.size_deg,
            "controller": experiment.controller.name,
            "mode": experiment.mode.word,
            "arm": experiment.side.word,
            "joints": [run.trace.joint_name(joint) for joint in experiment.moved],
            **asdict(run.figures),
            "slowed_cycles": run.trace.slowed,
            "published": {name: published for name, (published, _, _) in pairs.items()},
            "ratio_to_published": {name: ratio for name, (_, _, ratio) in pairs.items()},
            "ratio_to_virtual": results.ratio_to_virtual(run),
            "repeats": len(results.repeats.get(run.name, ())),
        }
    content = {
        "format": FORMAT,
        "complete": results.is_complete,
        "failures": results.failures,
        "repeats": {name: {"count": len(whys), "reasons": list(whys)} for name, whys in results.repeats.items()},
        **results.settings,
        "experiments": experiments,
        "sweeps": {
            system.value: {
                "oscillation_from_p": onset_of(points),
                "points": [{"p": point.gain, **asdict(point.figures)} for point in points],
            }
            for system, points in results.sweeps.items()
        },
        "kpis": {
            system.value: {
                each.name: {"value": each.value, "limit": each.limit, "unit": each.unit, "holds": each.holds}
                for each in kpis(measured)
            }
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
    return dict(finite(content))


def finite(value: Any) -> Any:
    """``value`` with null for each number that JSON does not have."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value
