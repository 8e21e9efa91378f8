"""What the publication leaves open, varied: superposition is as good as running, and the findings hold."""

from __future__ import annotations

import pytest

from yumi_evaluation.experiment import FREQUENCY, System, Trace, proportional, sine, step
from yumi_evaluation.explanations import explanations
from yumi_evaluation.lag_study import PARTS, LagStudy, largest_difference, studied_sines, study_lags, superpose
from yumi_evaluation.report import study_tables
from yumi_evaluation.results import Results
from yumi_evaluation.tracking_figures import SineFigures, figures_of
from yumi_evaluation.virtual_machine import CONTROL_LAG, run_virtually

parts: list[None] = []


@pytest.fixture(scope="module")
def run() -> Trace:
    return run_virtually(studied_sines()[0], System.BARE)


@pytest.fixture(scope="module")
def study(run: Trace) -> LagStudy:
    parts.clear()
    bare = {each.experiment.name: each for each in (run, *_steps())}
    return study_lags(bare, lambda: parts.append(None))


def _steps() -> list[Trace]:
    return [run_virtually(step(proportional(gain)), System.BARE) for gain in (1.2, 1.6, 2.0)]


def test_superposed_steps_are_the_sine_that_was_run() -> None:
    experiment = sine(proportional(1.2), size_deg=60.0, frequency=0.5)
    run, steps = run_virtually(experiment, System.BARE), run_virtually(step(proportional(1.2)), System.BARE)
    assert largest_difference(superpose(steps, experiment).measured_deg(6), run.measured_deg(6)) < 0.02


def test_study_predicts_what_was_run_at_our_frequency(run: Trace, study: LagStudy) -> None:
    figures, (lags, *_) = figures_of(run), study.frequencies[FREQUENCY]
    assert isinstance(figures, SineFigures)
    assert lags.mean == pytest.approx(figures.mean_lag_s, abs=2e-4)
    assert lags.longest == pytest.approx(figures.max_lag_s, abs=0.0045)
    assert study.deviation_deg < 0.002
    assert len(parts) == PARTS


def test_all_published_lags_of_the_small_sines_are_reproduced_within_a_tenth_at_some_frequency(study: LagStudy) -> None:
    fitting = [
        frequency
        for frequency, lags in study.frequencies.items()
        if all(all(each.are_near(one)) for each, one in list(zip(lags, studied_sines(), strict=True))[:2])
    ]
    assert fitting == [0.125, 0.15]


def test_no_control_lag_and_no_matching_explains_the_large_sine_at_our_frequency(study: LagStudy) -> None:
    large = [robot.lags[2] for robot in study.robots.values()] + [lags[2] for lags in study.matchings.values()]
    assert min(each.mean for each in large) > 1.1 * 0.141


def test_longer_control_lags_make_longer_lags_and_hardly_other_steps(study: LagStudy) -> None:
    means = [robot.lags[0].mean for robot in study.robots.values()]
    assert means == sorted(means)
    assert study.robots[CONTROL_LAG].lags == study.frequencies[FREQUENCY]


def test_report_shows_the_study_where_it_is_explained(study: LagStudy, run: Trace) -> None:
    results = Results(study=study)
    results.add(System.BARE, run)
    tables = study_tables(study)
    assert set(tables) <= {each.name for each in explanations(results)}
    assert tables["frequency"].rows[0] == ("published", "156 | 184", "92 | 106", "141 | 189")
    assert "at 0.125 and 0.15 Hz" in explanations(results)[0].text
