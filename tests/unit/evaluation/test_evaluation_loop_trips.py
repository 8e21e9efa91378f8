from __future__ import annotations

from dataclasses import astuple

import pytest

from yumi_evaluation.kpis import Measured, kpis, legs, machine_legs
from yumi_evaluation.round_trips import HeardState, LoopCycle, RoundTrip, SentGoal, join_trips

PERIOD = 0.004

CYCLES = [LoopCycle(1.0 + PERIOD * n, 1.0002 + PERIOD * n, float(n)) for n in range(6)]
STATES = [HeardState(cycle.arrived + 1e-5, cycle.arrived + 0.0005) for cycle in CYCLES]


def test_legs_of_a_trip_add_up_to_the_way_from_the_application_and_back() -> None:
    (trip,) = join_trips([SentGoal(1.0, 1.001, 1.0016)], CYCLES, STATES)
    assert astuple(trip) == pytest.approx((0.0006, 0.0024, 0.0002, 0.0078, 0.0005))
    assert trip.total == pytest.approx(STATES[3].heard - 1.001)


def test_goal_that_was_replaced_has_no_trip() -> None:
    assert join_trips([SentGoal(1.5, 1.001, 1.002)], CYCLES, STATES) == ()


def test_goal_whose_state_was_not_heard_has_no_trip() -> None:
    assert join_trips([SentGoal(1.0, 1.001, 1.002)], CYCLES, STATES[:3]) == ()


def test_goal_taken_before_its_echo_was_heard_spent_no_time_in_the_buffer() -> None:
    (trip,) = join_trips([SentGoal(1.0, 1.001, 1.006)], CYCLES, STATES)
    assert (trip.topic, trip.buffer) == (pytest.approx(0.003), 0.0)
    assert trip.total == pytest.approx(STATES[3].heard - 1.001)


def test_indicators_are_those_of_the_worse_path() -> None:
    trips = tuple(RoundTrip(0.0, 0.0, 0.0, total, 0.0) for total in (0.010, 0.010, 0.040))
    machine = {"ros_service": (0.1, 0.1), "robot_web_services": (0.1, 0.3)}
    found = {each.name: each for each in kpis(Measured(trips=trips, machine_trips=machine, datagrams=1000, lost=2))}
    assert found["worst_to_mean_round_trip"].value == pytest.approx(2.0)
    sentence = "to the state machine: of 2 the longest took 400 ms, the mean 300.0 ms"
    assert sentence in found["worst_to_mean_round_trip"].note
    assert found["end_to_end_s"].value == pytest.approx(0.15)
    assert found["jitter_s"].value == pytest.approx(0.05)
    assert (found["packet_loss"].value, found["packet_loss"].holds) == (0.002, False)


def test_indicators_that_were_not_measured_neither_hold_nor_fail() -> None:
    found = kpis(Measured())
    assert len(found) == 7
    assert {each.holds for each in found} == {None}


def test_legs_come_with_their_total() -> None:
    trips = (RoundTrip(0.001, 0.002, 0.0, 0.008, 0.001),)
    assert legs(trips)["total"].mean == pytest.approx(0.012)
    assert machine_legs({"ros_service": (0.001,), "robot_web_services": (0.002,)})["total"].mean == pytest.approx(0.003)
    assert machine_legs({}) == {}
