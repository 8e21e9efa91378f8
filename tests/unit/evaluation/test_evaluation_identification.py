"""What is identified of logs of virtual robots is what they were made with; what a log does not show has no number."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, inf, radians

import numpy as np
import pytest
from virtual_logs import HOME, VirtualRobot, motions, random_robot, times

from abb_protocols.catalogue import message
from abb_protocols.robot.joints import CYCLE
from virtual_irc5.mechanics.arm_motion import ArmModel
from yumi_evaluation.identification import Dynamics, Identified, answer, identify, limited

EXPECTED = Dynamics()


def judged(robot: VirtualRobot, found: Identified) -> None:
    """k and lag within 5 %, dead time within 1 ms, noise within 20 %."""
    true = robot.dynamics
    assert found.gain.value == pytest.approx(true.gain, rel=0.05)
    assert found.lag.value == pytest.approx(true.lag(CYCLE), rel=0.05)
    assert found.dead_time.value == pytest.approx(true.dead_time(CYCLE), abs=1e-3)
    assert found.noise.value == pytest.approx(robot.noise, rel=0.2)


@pytest.mark.timeout(120)
def test_identification_finds_the_robot_that_made_a_log() -> None:
    random = np.random.default_rng(8)
    robot = random_robot(random)
    judged(robot, identify([robot.log(motions(random), random)], EXPECTED))


@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_identification_finds_fifty_random_robots() -> None:
    unknown = 0
    for seed in range(100, 150):
        random = np.random.default_rng(seed)
        robot = random_robot(random)
        found = identify([robot.log(motions(random), random)], EXPECTED)
        if found.gain.value is None:  # of much noise and small steps: then there is no number
            unknown += 1
            assert found.lag.value == pytest.approx(robot.dynamics.lag(CYCLE), rel=0.05)
            assert found.noise.value == pytest.approx(robot.noise, rel=0.2)
        else:
            judged(robot, found)
    assert unknown <= 3


def test_answer_of_steps_is_that_of_the_virtual_robot_run_as_a_whole() -> None:
    random = np.random.default_rng(1)
    robot = replace(random_robot(random), noise=0.0, lost=0.0)
    log = robot.log(motions(random), random)
    assert np.abs(answer(log, robot.dynamics) - log.measured).max() < 1e-7
    speeds = np.gradient(log.commands, axis=0) / log.cycle
    fed, dynamics = replace(log, speeds=speeds), robot.dynamics
    whole = replace(dynamics, model=replace(dynamics.model, egm_acceleration=(1e9,) * 7))
    assert np.abs(answer(fed, dynamics) - answer(fed, whole)).max() < 1e-7
    assert np.abs(answer(fed, dynamics) - answer(log, dynamics)).max() > 1e-3


def robot_of(noise_deg: float = 0.0005, **model: float) -> VirtualRobot:
    return VirtualRobot(Dynamics(5.0, replace(ArmModel(), **model)), radians(noise_deg), 0.0)


def test_nothing_is_determined_but_noise_where_no_joint_moves() -> None:
    random = np.random.default_rng(5)
    robot = robot_of()
    found = identify([robot.log(np.tile(HOME, (500, 1)), random)], EXPECTED)
    assert [found.gain.value, found.dead_time.value, found.lag.value] == [None] * 3
    assert {each.value for each in found.limits} == {None}
    assert found.gain.reason == message("no_joint_moves")
    assert found.noise.value == pytest.approx(robot.noise, rel=0.2)
    assert found.dynamics == EXPECTED


def test_slow_motion_does_not_determine_dead_time_and_k_but_lag() -> None:
    random = np.random.default_rng(6)
    time = times(8.0)
    moved = np.zeros((len(time), 7))
    moved[:, 1] = radians(3.0) * 0.5 * (1.0 - np.cos(2.0 * np.pi * time / 8.0))
    robot = robot_of(noise_deg=0.01)
    found = identify([robot.log(HOME + moved, random)], EXPECTED)
    assert found.dead_time.value is None
    assert found.gain.value is None
    assert found.dead_time.reason == message("not_shown_by_motion")
    assert found.lag.value is None or found.lag.value == pytest.approx(robot.dynamics.lag(CYCLE), rel=0.05)


def limited_log(cap_deg: float) -> tuple[VirtualRobot, np.ndarray]:
    """A ramp of one joint that is faster than its limit, and one that is slower."""
    velocity = [1e3] * 7
    velocity[0] = radians(cap_deg)
    model = ArmModel()
    model = replace(model, limits=replace(model.limits, velocity=tuple(velocity)))
    time = times(3.2)
    moved = np.zeros((len(time), 7))
    moved[:, 0] = radians(40.0) * np.clip(time - 2.0, 0.0, 0.7) + radians(8.0) * (np.clip(time - 0.2, 0.0, 1.2))
    return VirtualRobot(Dynamics(5.0, model), radians(0.0005), 0.0), HOME + moved


@pytest.mark.timeout(120)
def test_limit_is_the_speed_of_a_joint_that_is_asked_for_more() -> None:
    robot, commands = limited_log(25.0)
    found = identify([robot.log(commands, np.random.default_rng(7))], EXPECTED)
    assert degrees(found.limits[0].value or inf) == pytest.approx(25.0, rel=0.02)
    assert {each.value for each in found.limits[1:]} == {None}
    assert found.gain.value is None or found.gain.value == pytest.approx(5.0, rel=0.05)
    assert found.lag.value == pytest.approx(robot.dynamics.lag(CYCLE), rel=0.05)


@pytest.mark.timeout(120)
def test_joint_that_is_never_asked_for_more_has_no_limit() -> None:
    robot, commands = limited_log(300.0)
    log = robot.log(commands, np.random.default_rng(8))
    found = identify([log], EXPECTED)
    assert {each.value for each in found.limits} == {None}
    assert found.limits[0].reason == message("never_asked_for_more")
    assert not limited(log, found.dynamics).any()


def test_limited_rows_begin_where_the_joint_is_slower_than_asked() -> None:
    robot, commands = limited_log(25.0)
    log = robot.log(commands, np.random.default_rng(9))
    late = limited(log, robot.dynamics)
    assert not late[:, 1:].any()
    first = log.times[np.argmax(late[:, 0])]
    assert 2.0 < first < 2.3  # 40 °/s with k 5: 25 °/s after 0.2 s


@pytest.mark.timeout(120)
def test_of_a_long_log_the_part_counts_in_which_most_happens() -> None:
    random = np.random.default_rng(6)
    robot = random_robot(random)
    commands = np.vstack((np.tile(HOME, (4500, 1)), motions(random), np.tile(HOME, (500, 1))))
    judged(robot, identify([robot.log(commands, random)], EXPECTED))
