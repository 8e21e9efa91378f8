"""Ratios within a round, targets, and the order of the runs."""

from __future__ import annotations

from dataclasses import replace

import pytest
from bench_runs import LOOP, figures, run
from hypothesis import given
from hypothesis import strategies as st

from yumi_evaluation.bench.contenders import ECHO, PEERS, Case, Mode, cases_of, contenders, schedule
from yumi_evaluation.bench.figures import Figures, Spread, targets


def test_ratio_to_peers_takes_the_better_one_of_each_round() -> None:
    spread = figures().ratio_to_peers(Case(LOOP, Mode.PACED, 1), "p50_us")
    assert spread == Spread(median=pytest.approx(0.7), lowest=0.6, highest=0.8, rounds=2)


def test_ratio_to_peers_is_none_when_no_peer_took_part() -> None:
    alone = Figures((run(1, LOOP, 80.0),))
    assert alone.ratio_to_peers(Case(LOOP, Mode.PACED, 1), "p50_us") is None


def test_ratio_to_peers_does_not_mix_paced_and_ping_pong() -> None:
    mixed = Figures((run(1, LOOP, 80.0), run(1, PEERS[0], 40.0, mode=Mode.PING_PONG)))
    assert mixed.ratio_to_peers(Case(LOOP, Mode.PACED, 1), "p50_us") is None


def test_ratio_to_peers_does_not_mix_a_busy_machine_and_a_quiet_one() -> None:
    busy = Case(LOOP, Mode.PACED, 1, is_machine_busy=True)
    runs = [replace(run(1, contender, 40.0), case=replace(busy, contender=contender)) for contender in (LOOP, PEERS[0])]
    mixed = Figures((run(1, PEERS[0], 400.0), *runs))
    ratio = mixed.ratio_to_peers(busy, "p50_us")
    assert ratio is not None
    assert ratio.median == 1.0
    assert [each.name for each in targets(mixed)] == ["bad_replies"]  # they are for a quiet machine


def test_two_arms_count_by_the_slower_one() -> None:
    spread = figures().ratio_to_case("control_loop_blocking/paced/2", "control_loop_blocking/paced/1", "p50_us")
    assert spread == Spread(median=pytest.approx(1.1), lowest=1.0, highest=pytest.approx(1.2), rounds=2)


def test_excess_over_the_echo_is_taken_within_a_round() -> None:
    spread = figures().excess_over("control_loop_blocking/paced/1", "c_echo/paced/1", "max_us")
    assert spread == Spread(median=180.0, lowest=120.0, highest=240.0, rounds=2)


def test_targets_are_met_or_missed_by_the_median() -> None:
    holds = {each.name: each.holds for each in targets(figures())}
    assert holds == {
        "bad_replies": True,
        "control_loop_blocking/p50_us_to_peer": True,
        "control_loop_blocking/p99_us_to_peer": True,
        "control_loop_blocking/p50_us_to_echo": False,
        "control_loop_blocking/p99_us_to_echo": False,
        "control_loop_blocking/max_us_over_echo": True,
        "ros_graph_busy_blocking/p99_us_to_calm": False,
    }


def test_one_bad_reply_in_many_runs_misses_its_target() -> None:
    runs = [run(number, LOOP, 80.0, bad=int(number == 1)) for number in range(1, 6)]
    (target,) = [each for each in targets(Figures(tuple(runs))) if each.name == "bad_replies"]
    assert not target.holds


@pytest.mark.parametrize(("answered", "holds"), [(1, True), (0, False)])
def test_command_by_which_the_core_brakes_for_a_late_controller_is_no_bad_reply(answered: int, holds: bool) -> None:
    late = replace(run(1, LOOP, 80.0, bad=1), unanswered={"right": answered})
    calm = replace(run(2, LOOP, 80.0), unanswered={"right": 3})  # which explains nothing of another run
    (target,) = [each for each in targets(Figures((late, calm))) if each.name == "bad_replies"]
    assert target.holds is holds


@given(st.integers(1, 6), st.integers(0, 1000))
def test_schedule_has_every_case_once_a_round(rounds: int, seed: int) -> None:
    cases = cases_of(contenders())
    plan = schedule(cases, rounds, seed)
    for number in range(1, rounds + 1):
        assert sorted(case.name for each, case in plan if each == number) == sorted(case.name for case in cases)


def test_schedule_is_the_same_for_a_seed_and_differs_between_rounds() -> None:
    cases = cases_of(contenders())
    plan = schedule(cases, 2, 1)
    assert plan == schedule(cases, 2, 1)
    assert [case for _, case in plan[: len(cases)]] != [case for _, case in plan[len(cases) :]]


def test_contenders_have_ours_in_every_wake_mode_and_distinct_names() -> None:
    names = [each.name for each in contenders(("blocking", "auto"))]
    assert len(set(names)) == len(names)
    assert {"control_loop_auto", "ros_graph_auto", "ros_graph_busy_auto", ECHO.name} <= set(names)
