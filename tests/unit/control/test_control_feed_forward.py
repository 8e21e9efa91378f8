"""What the robot makes of position and speed references together stays within what its joints may do."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import cos, inf, pi, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abb_protocols.robot.joints import (
    CYCLE,
    YUMI_LIMITS,
    ZERO_JOINTS,
    ArmCommand,
    ArmState,
    Joints,
    Side,
    home,
    joints,
)
from reported_limiter import ReportedLimiter
from trajectories import change_rate
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_motion import EgmMotion, EgmMotionParameters
from virtual_irc5.mechanics.servo import Servo
from yumi.control.controller import Controller
from yumi.control.limiter import Limiter
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.driver.state_machine import EgmMotionSettings
from yumi_evaluation.virtual_time import FULL_SPEED, VirtualArmRig

FAST = EgmMotionSettings(max_speed_deviation=400.0, ramp_in_time=0.0)
"""Nothing on the robot's side slows the arm down."""

MOVING = (0, 6)

MISPREDICTED = 0.5 * EGM_GAIN * (2.0 * CYCLE) ** 2 * YUMI_LIMITS.acceleration[0] / (YUMI_LIMITS.jerk[0] * CYCLE**2)
"""More than the jerk that is allowed, as a share: the limiter knows where the robot will report to be two cycles later,
when it takes a command, but for what its acceleration adds meanwhile, and the robot's loop makes a speed of that."""


class Dictated(Controller):
    """Wants what a function of time [s] says."""

    kind = "test/Dictated"

    def __init__(self, wants: Callable[[float], tuple[float, float]]) -> None:
        self._wants = wants

    def activate(self, state: ArmState) -> None:
        self._base, self._begin = state.position, state.time

    def update(self, state: ArmState) -> ArmCommand:
        position, velocity = self._wants(state.time - self._begin)
        return ArmCommand(added(self._base, position), ZERO_JOINTS if velocity == 0.0 else added(ZERO_JOINTS, velocity))


def added(base: Joints, value: float) -> Joints:
    return joints([each + value * (index in MOVING) for index, each in enumerate(base)])


def dictated(wants: Callable[[float], tuple[float, float]], motion: EgmMotionSettings = FAST) -> VirtualArmRig:
    arm = VirtualArmRig({"dictated": Dictated(wants)}, limiter=Limiter(YUMI_LIMITS, gain=5.0 * motion.pos_corr_gain))
    arm.start(motion)
    arm.switch_to("dictated")
    return arm


def planned_speeds(arm: VirtualArmRig, seconds: float) -> list[Joints]:
    speeds = []
    for _ in range(round(seconds / CYCLE)):
        arm.cycle()
        speeds.append(arm.robot.arm.velocity)
    return speeds


def shares(speeds: list[Joints]) -> list[tuple[float, float, float]]:
    """Highest speed, acceleration and jerk of the moving joints, as shares of their limits."""
    found = []
    for index in MOVING:
        speed = [each[index] for each in speeds]
        rate = [(new - old) / CYCLE for old, new in pairwise(speed)]
        jerk = [(new - old) / CYCLE for old, new in pairwise(rate)]
        limits = (YUMI_LIMITS.velocity[index], YUMI_LIMITS.acceleration[index], YUMI_LIMITS.jerk[index])
        values = (speed, rate, jerk)
        top, strength, rush = (max(map(abs, v)) / limit for v, limit in zip(values, limits, strict=True))
        found.append((top, strength, rush))
    return found


def sine(time: float) -> tuple[float, float]:
    """A smooth motion and its speed; the amplitude is 0.8 rad, the period 2 s."""
    return 0.8 * (time - sin(pi * time) / pi) / 2.0, 0.4 * (1.0 - cos(pi * time))


@settings(derandomize=True)
@given(orders=st.lists(st.tuples(st.floats(-4.0, 4.0), st.floats(-9.0, 9.0)), min_size=1, max_size=20))
def test_robot_stays_within_its_limits_whatever_position_and_speed_are_wanted(
    orders: list[tuple[float, float]],
) -> None:
    arm = dictated(lambda time: orders[int(time / 0.08) % len(orders)])
    for top, strength, rush in shares(planned_speeds(arm, 0.08 * len(orders) + 0.4)):
        assert max(top, strength) <= 1.02
        assert rush <= 1.0 + MISPREDICTED
    assert arm.robot.arm.overload is None


@pytest.mark.parametrize("first", [0.0039, 0.5])
def test_speed_that_sets_in_on_a_motion_goes_on_from_how_fast_the_robot_will_be_then(first: float) -> None:
    """The robot takes it a cycle after it was sent, and is faster by then."""
    arm = dictated(lambda time: (1.0, 0.0) if time % 0.16 >= 0.08 else (0.0, first))
    for _, _, rush in shares(planned_speeds(arm, 0.5)):
        assert rush <= 1.02


def test_smooth_motion_with_its_speed_passes_unchanged() -> None:
    arm = dictated(sine)
    arm.run(3.0)
    for cycle in arm.cycles[60:]:
        assert cycle.desired is not None
        assert cycle.sent.velocity == pytest.approx(cycle.desired.velocity, abs=2e-3)


def test_speed_that_the_position_runs_ahead_of_already_is_not_added() -> None:
    """Each alone is within the joint's speed; together they ask for nearly twice as much."""
    top = YUMI_LIMITS.velocity[0]
    arm = dictated(lambda time: (0.9 * top * time, 0.9 * top * (time > 0.3)))
    speeds = planned_speeds(arm, 0.6)
    assert max(abs(speed[0]) for speed in speeds) <= top * 1.001
    assert arm.snapshot.limiter.slowed > 20


def test_robot_that_follows_speeds_only_stops_before_the_end_of_its_range() -> None:
    motion = EgmMotionSettings(max_speed_deviation=400.0, pos_corr_gain=0.0)
    arm = dictated(lambda time: (0.0, 2.0), motion)
    arm.run(4.0)
    for index in MOVING:
        assert YUMI_LIMITS.upper[index] - 0.02 < arm.robot.arm.planned[index] <= YUMI_LIMITS.upper[index]
    assert arm.robot.egm.fault == ""


@pytest.mark.parametrize("gain", [0.0, 1.0])
def test_arm_that_is_told_to_hold_stops_on_its_way_and_does_not_turn_back(gain: float) -> None:
    arm = dictated(sine, EgmMotionSettings(pos_corr_gain=gain))
    arm.run(0.9)
    speed, before = arm.robot.arm.velocity[6], arm.robot.arm.planned[6]
    arm.manager.deactivate_commanding()
    speeds = planned_speeds(arm, 2.0)
    assert min(each[6] for each in speeds) > -0.04
    assert abs(speeds[-1][6]) < 1e-4
    assert arm.robot.arm.planned[6] - before < speed * 0.012 + speed * (speed / 40.0 + 40.0 / 600.0)
    assert arm.cycles[-1].sent == ArmCommand(arm.cycles[-100].sent.position)


def test_guard_refuses_a_speed_that_is_no_number() -> None:
    arm = dictated(lambda time: (0.0, inf), FULL_SPEED)
    arm.run(0.1)
    assert arm.snapshot.limiter.refused >= 24
    assert arm.cycles[-1].sent.velocity is ZERO_JOINTS


def bent(position: Joints, angle: float) -> Joints:
    return joints([each + angle * (index == 3) for index, each in enumerate(position)])


@pytest.mark.parametrize("deflection", [0.0, 3e-4, 1e-3, 1e-2])
def test_arm_that_a_load_keeps_off_its_plan_stands_when_it_is_held(deflection: float) -> None:
    start, model = home(Side.LEFT), ArmModel()
    limiter, motion, servo = (
        ReportedLimiter(YUMI_LIMITS),
        EgmMotion(start, EgmMotionParameters(max_speed=10.0), model),
        Servo(start, model),
    )
    reported, places = start, []
    for cycle in range(1500):
        last, reported = reported, bent(servo.position, -deflection)
        speed = change_rate(reported, last, CYCLE) if cycle else ZERO_JOINTS
        state = ArmState(
            cycle * CYCLE, CYCLE if cycle else 0.0, 1, reported, speed, motion.state.position, is_running=True
        )
        is_led = cycle < 400
        command = limiter.limit(state, ArmCommand(bent(start, min(0.05, 5e-4 * cycle))) if is_led else None)
        limiter.observe(state)
        motion.reported = reported
        motion.advance(CYCLE)
        servo.advance(motion.state.position, CYCLE)
        motion.reference, motion.reference_velocity = command.position, command.velocity
        places.append(reported[3])
    assert limiter.is_at_rest
    assert max(places[900:]) - min(places[900:]) < 1e-4
    assert places[-1] == pytest.approx(places[400], abs=5e-3)
