"""The thesis's experiments in virtual time: what is published is reproduced, and the report says so."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from math import hypot, inf, sqrt
from pathlib import Path

import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import Message, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.robot.joints import CYCLE
from virtual_irc5.mechanics.arm_motion import ArmModel
from yumi.cli.main import main
from yumi_evaluation import results as evaluation_results
from yumi_evaluation.experiments import (
    PREDICTION,
    Experiment,
    SineFigures,
    System,
    Trace,
    compared,
    figures_of,
    proportional,
    published_experiments,
    sine,
    step,
    step_figures_of,
)
from yumi_evaluation.kpis import Measured
from yumi_evaluation.report import (
    headline,
    kpis_of,
    long_trips,
    real_time_table,
    render,
    repeats_table,
    write_report,
)
from yumi_evaluation.results import Results, Variant, document
from yumi_evaluation.round_trips import virtual_machine_trips, virtual_trips
from yumi_evaluation.virtual_time import FITTED, arm_with, run_virtually

RUNS: dict[tuple[str, System, ArmModel | None], Trace] = {}


def ran(experiment: Experiment, system: System = System.SHIPPED, model: ArmModel | None = None) -> Trace:
    """An experiment, run once for all tests."""
    key = experiment.name, system, model
    if key not in RUNS:
        RUNS[key] = run_virtually(experiment, system, model)
    return replace(RUNS[key], experiment=experiment)


def step_time_error(model: ArmModel | None = None) -> float:
    """Of the fitted arm, or another one: root mean square of the differences to the published step times [s]."""
    errors = []
    for experiment in published_experiments():
        if experiment.published.settling_s is not None:
            time = step_figures_of(ran(experiment, System.BARE, model)).settling_s
            errors.append((time or inf) - experiment.published.settling_s)
    return hypot(*errors) / sqrt(len(errors))


def published(experiment: Experiment) -> Experiment:
    return next(each for each in published_experiments() if each.name == experiment.name)


@pytest.mark.parametrize("gain", [1.2, 2.0])
def test_published_mean_lags_are_predicted_within_a_twentieth(gain: float) -> None:
    trace = ran(published(sine(proportional(gain))), System.BARE)
    (_, _, ratio) = compared(trace, figures_of(trace))["mean_lag_s"]
    assert ratio == pytest.approx(1.0, abs=0.05)


def test_oscillation_begins_at_the_published_gain_without_the_limiter() -> None:
    calm, oscillating = (step_figures_of(ran(step(proportional(gain)), System.BARE)) for gain in (1.8, 2.0))
    assert calm.overshoot_deg < 0.1 < oscillating.overshoot_deg


def test_oscillation_begins_a_little_earlier_where_the_command_is_limited() -> None:
    calm, oscillating = (step_figures_of(ran(step(proportional(gain)))) for gain in (1.7, 1.8))
    assert calm.overshoot_deg < 0.1 < oscillating.overshoot_deg


def test_better_controller_has_neither_the_lag_nor_the_error() -> None:
    figures = figures_of(ran(sine(PREDICTION)))
    assert isinstance(figures, SineFigures)
    assert abs(figures.delay_s) < 0.003
    assert figures.max_error_deg < 0.05


def test_committed_acceleration_fits_the_published_step_times_better_than_less_or_more() -> None:
    less, fitted, more = map(step_time_error, (arm_with(4.0), None, arm_with(10.0)))
    assert fitted < min(less, more)


def test_sharing_delay_and_lag_differently_hardly_changes_the_steps() -> None:
    dead_time = FITTED.delay + FITTED.lag
    one, other = (
        step_time_error(replace(FITTED, delay=delay, lag=dead_time - delay)) for delay in (dead_time / 2.0, dead_time)
    )
    assert one == pytest.approx(other, abs=0.003)


def test_all_published_figures_but_those_of_the_widest_sine_are_reproduced_within_a_tenth() -> None:
    far = []
    for experiment in published_experiments():
        trace = ran(experiment, System.BARE)
        for name, (_, _, ratio) in compared(trace, figures_of(trace)).items():
            if abs(ratio - 1.0) > 0.1:
                far.append((experiment.figure, name))
    assert far == [("5.7", "mean_lag_s"), ("5.7", "max_lag_s")]


def test_round_trip_in_virtual_time_is_two_cycles_and_the_wait_for_the_first() -> None:
    trips, datagrams, lost = virtual_trips(50)
    assert (len(trips), lost) == (50, 0)
    assert datagrams > 50
    assert all(0.008 < trip.total < 0.0121 for trip in trips)


def test_state_machine_answers_in_virtual_time_within_a_cycle() -> None:
    legs = virtual_machine_trips(40)
    assert set(legs["request"]) == {0.0}
    assert 0.0 < min(legs["answer"]) < 0.5 * CYCLE
    assert max(legs["answer"]) < 1.001 * CYCLE


@pytest.fixture(scope="module")
def results() -> Results:
    """A few experiments of many."""
    results = Results(settings={"versions": {"python": "3"}})
    for experiment in (step(proportional(1.2)), sine(proportional(1.2))):
        results.add(System.BARE, ran(published(experiment), System.BARE))
    results.measured[System.BARE] = Measured(trips=virtual_trips(20)[0])
    results.close_measured(System.BARE)
    return results


def test_report_has_tables_pictures_for_both_themes_and_raw_data(results: Results, tmp_path: Path) -> None:
    page = write_report(results, tmp_path).read_text(encoding="utf-8")
    cells = [re.sub("<.*?>", "|", line).replace("&nbsp;", " ") for line in page.splitlines()]
    steps = "||Step of 10°, P = 1.2: time until within 0.1°||5.1a||0.80 s||0.78 s||0.97||reproduced||"
    assert steps in cells
    assert any("||5.3||184 ms||196 ms||1.06||reproduced||" in line for line in cells)
    assert page.count("<svg ") == 6
    assert page.count("var(--ink)") > 5
    rows = (tmp_path / "data" / "bare_step10_fullspeed_p1.2_right.csv").read_text(encoding="utf-8").splitlines()
    assert rows[:2] == ["what,time_s,yumi_joint_6_r_deg", "goal,0.000000,10.000000"]
    assert "is not complete" in page


def test_json_has_the_documented_names(results: Results) -> None:
    content = json.loads(json.dumps(document(results)))
    assert content == document(results)
    assert (content["format"], content["complete"]) == ("yumi-evaluation/1", False)
    found = content["experiments"]["bare/sine10_fullspeed_p1.2_right"]
    assert found["published"] == {"mean_lag_s": 0.156, "max_lag_s": 0.184}
    assert found["ratio_to_published"]["mean_lag_s"] == pytest.approx(found["mean_lag_s"] / 0.156)
    assert len(content["kpis"]["bare"]) == 7
    assert "total" in content["round_trips_s"]["bare"]["egm_loop"]


def test_report_says_what_the_limiter_costs_where_that_was_run(results: Results) -> None:
    both = Results(runs=list(results.runs), variants={Variant.SHIPPED_ROBOT: 0.70, Variant.LIMITED_FIT: 0.82})
    both.add(System.SHIPPED, ran(step(proportional(1.2))))
    page = render(both).replace("&nbsp;", " ")
    assert "takes 0.81 s as shipped and 0.78 s without the limiter" in page
    assert "behind the limiter takes 0.82 s, the shipped robot without it 0.70 s" in page
    assert "behind the limiter takes" not in render(results)


def test_round_trips_that_took_too_long_are_counted_with_the_leg_that_did() -> None:
    machine = {"ros_service": (0.005,) * 100, "robot_web_services": (*(0.001,) * 99, 0.08)}
    (sentence,) = long_trips(Results(measured={System.NETWORKED: Measured(machine_trips=machine)}))
    assert "1 of 100 round trips took longer than 5 times the mean of 6.8 ms" in sentence
    assert "the leg 'robot web services' alone took 80 ms" in sentence
    assert list(long_trips(Results())) == []


def test_real_time_stands_beside_virtual_time(results: Results) -> None:
    (bare, *_) = results.runs
    both = Results(runs=[replace(bare, system=system) for system in (System.SHIPPED, System.NETWORKED)])
    both.repeats["networked/step10_fullspeed_p1.2_right"] = ("No joint state came.", "No joint state came.")
    table = real_time_table(both)
    assert table is not None
    assert table.rows[0] == ("Step of 10°, P = 1.2", "0.78 s", "0.78 s", "+0.0 ms", "1.00", "within 15 %")
    found = document(both)["experiments"]["networked/step10_fullspeed_p1.2_right"]
    assert (found["ratio_to_virtual"], found["repeats"]) == (1.0, 2)


def test_headline_counts_what_is_reproduced_and_which_indicators_hold(results: Results) -> None:
    text = headline(results)
    assert "3 of 3 published times and lags are reproduced within a tenth" in text
    assert "4 of 4 measured indicators are inside their limits without the limiter (3 not run)." in text
    assert headline(Results()) == ""


def test_indicators_of_what_ran_are_reported_however_early_it_ended() -> None:
    early = Results()
    early.add(System.SHIPPED, ran(step(proportional(2.0))))
    early.close()
    assert [each.holds for each in kpis_of(early, System.SHIPPED)][:2] == [True, None]


def test_repeated_experiments_are_reported_with_count_and_reason() -> None:
    disturbed = Results(repeats={"networked/step": ("No joint state came.", "EGM has ended.", "EGM has ended.")})
    table = repeats_table(disturbed)
    assert table is not None
    assert table.rows == (("networked/step", "3", "No joint state came. EGM has ended."),)
    assert document(disturbed)["repeats"]["networked/step"]["count"] == 3
    assert repeats_table(Results()) is None


def test_same_experiment_gives_the_same_figures(results: Results) -> None:
    again = figures_of(run_virtually(step(proportional(1.2)), System.BARE))
    assert again == results.runs[0].figures


def test_command_reports_what_was_done_when_it_is_interrupted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import os
    import signal

    def interrupted(results: Results, on_step: evaluation_results.OnStep) -> None:
        results.add(System.BARE, ran(step(proportional(1.6)), System.BARE))
        os.kill(os.getpid(), signal.SIGINT)
        on_step("never begins")

    monkeypatch.setattr(evaluation_results, "evaluate_virtually", interrupted)
    result = CliRunner().invoke(main, ["evaluate", "--virtual-time", "--output", str(tmp_path)])
    assert result.exit_code == 130
    assert "Ended early" in result.output
    assert (tmp_path / "report.html").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("evaluate", "--virtual-time", "--robot", "1.2.3.4"), message("real_robot_in_virtual_time")),
        (("tune", "--from", "2", "--to", "1"), message("gains_not_in_order", lowest=2.0, highest=1.0)),
    ],
    ids=lambda value: value.code if isinstance(value, Message) else value[0],
)
def test_command_refuses_what_makes_no_sense(arguments: tuple[str, ...], said: Message) -> None:
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 1
    assert sentence(said, FrontEnd.SHELL) in result.output


def test_tune_recommends_a_gain_with_a_picture(tmp_path: Path) -> None:
    picture = tmp_path / "tune.svg"
    result = CliRunner().invoke(main, ["tune", "--from", "1.5", "--to", "1.7", "--picture", str(picture)])
    assert result.exit_code == 0
    assert "Recommended: P = " in result.output
    assert picture.read_text(encoding="utf-8").startswith("<?xml")
