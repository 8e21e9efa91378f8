"""Everything one evaluation found, and the run in virtual time that finds it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

from yumi.evaluation.experiment import PREDICTION, Experiment, System, Trace, proportional, sine, step
from yumi.evaluation.experiments import (
    better_experiments,
    joint_experiments,
    other_frequencies,
    published_experiments,
)
from yumi.evaluation.fitted_model import FITTED
from yumi.evaluation.gain_sweep import GAINS, GainPoint, sweep
from yumi.evaluation.kpis import Measured, motion_delay
from yumi.evaluation.lag_study import PARTS, LagStudy, study_lags
from yumi.evaluation.tracking_figures import Figures, SineFigures, StepFigures, figures_of
from yumi.evaluation.virtual_experiment import run_virtually
from yumi.evaluation.virtual_machine_trips import virtual_machine_trips
from yumi.evaluation.virtual_trips import virtual_trips
from yumi.links.realtime import paused_collector
from yumi.virtual.arm_model import ArmModel

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
