"""Dynamic load too high (50375): provoked as the thesis reports it when nothing guards the references.

The thesis ran a proportional controller on full-speed settings: steps of several joints at once stopped the robot,
the larger the more often; ten degrees of one joint, a sine, and a MaxSpeedDeviation of 10 deg/s did not.
"""

from __future__ import annotations

import random
from dataclasses import replace
from math import pi, radians, sin

import pytest
from state_machine_bench import ARMS, Bench

from abb_protocols.egm.codec import MciState, MotorState
from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Side, home
from abb_protocols.rws.values import ControllerState
from egm_loop import CONTROLLER, CYCLE, FULL_SPEED, SUPERVISED, EgmLoop, OpenLimiter
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_client import EgmOutcome
from virtual_irc5.world import WorldSettings
from yumi.control.loop_events import RobotStoppedFollowing

HOME = home(Side.LEFT)
SLOW = replace(FULL_SPEED, max_speed_deviation=10.0)


@pytest.fixture
def loop() -> EgmLoop:
    """EGM runs at full speed, ramped in; nothing guards."""
    return begun()


def begun(motion: object = FULL_SPEED) -> EgmLoop:
    loop = EgmLoop(limiter=OpenLimiter())
    loop.begin(motion)
    loop.run(0.15)
    return loop


def beside(by_deg: dict[int, float], start: Joints = HOME) -> Joints:
    return tuple(value + radians(by_deg.get(index, 0.0)) for index, value in enumerate(start))


def several(chance: random.Random, by_deg: float) -> Joints:
    """Home with three to seven joints turned by the angle, in the range even for what P makes of it."""
    while True:
        chosen = chance.sample(range(7), chance.randint(3, 7))
        turn = {index: chance.choice((-by_deg, by_deg)) for index in chosen}
        if YUMI_LIMITS.outside(beside({index: 1.3 * value for index, value in turn.items()})) is None:
            return beside(turn)


# without a guard


def test_step_of_several_joints_at_once_is_too_high_a_load(loop):
    loop.go(beside({0: 40.0, 2: -40.0, 3: 40.0, 5: 40.0}))
    loop.run_until(lambda: loop.robot.egm.outcome is not EgmOutcome.RUNNING, limit=0.1)
    assert loop.robot.egm.outcome is EgmOutcome.OVERLOADED
    assert loop.robot.egm.fault.endswith("limit the acceleration of the reference.")
    assert not loop.robot.arm.motors_on


def test_our_end_sees_the_robot_stop_and_its_controllers_end(loop):
    loop.go(beside({0: 40.0, 2: -40.0, 3: 40.0, 5: 40.0}))
    loop.run(0.1)
    stopped = [event for event in loop.events if isinstance(event, RobotStoppedFollowing)]
    assert [event.deactivated for event in stopped] == [(CONTROLLER,)]


def test_larger_steps_are_too_high_a_load_more_often_than_smaller_ones():
    chance, counts = random.Random(50375), []
    for by_deg in (10.0, 20.0, 40.0):
        loops = [begun() for _ in range(20)]
        for loop in loops:
            loop.go(several(chance, by_deg))
            loop.run(0.1)
        counts.append(sum(loop.robot.egm.outcome is EgmOutcome.OVERLOADED for loop in loops))
    assert counts[0] <= 2
    assert counts[0] < counts[1] < counts[2]
    assert counts[2] >= 15


@pytest.mark.parametrize("index", range(7))
def test_step_of_one_joint_by_ten_degrees_is_bearable(loop, index):
    loop.go(beside({index: 10.0}))
    loop.run(1.0)
    assert loop.robot.egm.outcome is EgmOutcome.RUNNING


@pytest.mark.parametrize("gain", [1.2, 1.6, 2.0])
def test_step_of_axis_6_is_bearable_with_each_gain_of_the_thesis(loop, gain):
    loop.manager.set_parameters(CONTROLLER, {"p": gain})
    loop.go(beside({6: 10.0}))
    loop.run(1.0)
    assert loop.robot.egm.outcome is EgmOutcome.RUNNING


def test_sine_of_one_joint_is_bearable(loop):
    for cycle in range(round(5.0 / CYCLE)):
        loop.go(beside({6: 10.0 * sin(2.0 * pi * 0.2 * cycle * CYCLE)}))
        loop.cycle()
    assert loop.robot.egm.outcome is EgmOutcome.RUNNING


def test_ten_degrees_per_second_make_every_step_bearable():
    chance = random.Random(10)
    for _ in range(20):
        loop = begun(SLOW)
        loop.go(several(chance, 40.0))
        loop.run(0.2)
        assert loop.robot.egm.outcome is EgmOutcome.RUNNING


def test_arm_that_is_not_supervised_bears_everything():
    loop = EgmLoop(limiter=OpenLimiter(), model=ArmModel(supervises_load=False))
    loop.begin()
    loop.run(0.15)
    loop.go(beside({0: 40.0, 2: -40.0, 3: 40.0, 5: 40.0}))
    loop.run(1.0)
    assert loop.robot.egm.outcome is EgmOutcome.RUNNING


# the whole robot


@pytest.fixture
def stopped() -> Bench:
    """Both arms guided; the left one got a step of several joints."""
    bench = Bench(WorldSettings(arm_model=SUPERVISED))
    bench.bring_up()
    bench.set_egm("activate.max_speed_deviation", "180")
    bench.set_egm("activate.lp_filter", "0")
    bench.set_egm("run.ramp_in_time", "0.1")
    bench.set_egm("setup_uc.use_filtering", "FALSE")
    bench.pulse("EGM_START_JOINT")
    bench.run_until(lambda: all(bench.sensors[side].heard for side in ARMS), limit=1.0)
    bench.run(0.15)
    bench.sensors[Side.LEFT].goal = beside({0: 40.0, 2: -40.0, 3: 40.0, 5: 40.0})
    bench.run(0.1)
    return bench


def test_overload_stops_motors_and_program_of_both_arms(stopped):
    assert stopped.controller.controller_state is ControllerState.MOTORS_OFF
    assert not any(arm.motors_on for arm in stopped.world.arms.values())
    assert not stopped.controller.is_running


def test_overload_is_event_50375(stopped):
    event = next(event for event in stopped.controller.events.entries() if event.code == 50375)
    assert event.title == "Dynamic load too high"
    assert "whose drive gives" in event.description


def test_overload_ends_the_session_with_an_error(stopped):
    last = stopped.sensors[Side.LEFT].heard[-1]
    assert (last.motors, last.mci) == (MotorState.OFF, MciState.ERROR)
    assert stopped.sensors[Side.RIGHT].heard[-1].mci is MciState.STOPPED


def test_robot_goes_on_after_motors_and_program_are_started_again(stopped):
    stopped.sensors[Side.LEFT].goal = None
    stopped.run(1.0)
    stopped.bring_up()
    assert stopped.controller.controller_state is ControllerState.MOTORS_ON
    assert stopped.states == (0, 0)
