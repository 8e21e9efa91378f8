"""EGM's control law, and the behaviour it gives a P controller on top: the published measurements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, radians, sin

import pytest

from yumi.robot.joints import YUMI_LIMITS, ZERO, Joints, Side
from yumi.virtual.mechanics.arm import VirtualArm
from yumi.virtual.mechanics.motion import EgmActivation, EgmMotion, EgmRun, EgmSettings, ExternalMotionData

CYCLE = 0.004032
FAST = 400.0
FULL_SPEED = EgmSettings(gain=5.0, bandwidth=0.0, ramp_in_time=0.1, max_speed=radians(400.0))


def only(index: int, value: float) -> Joints:
    values = [0.0] * 7
    values[index] = value
    return tuple(values)


def law(**settings: float) -> EgmMotion:
    defaults = {"gain": 5.0, "bandwidth": 0.0, "max_speed": FAST}
    return EgmMotion(ZERO, EgmSettings(**{**defaults, **settings}), YUMI_LIMITS)


def advanced(motion: EgmMotion, duration: float, dt: float = CYCLE) -> EgmMotion:
    for _ in range(round(duration / dt)):
        motion.advance(dt)
    return motion


@dataclass
class Sample:
    time: float
    measured: float
    planned: float


def p_controlled(gain: float, goal_at: Callable[[float], float], duration: float) -> list[Sample]:
    """Axis 6 with command = measured + P·(goal - measured), each command one cycle late."""
    arm = VirtualArm(Side.LEFT, ZERO)
    arm.switch_motors_on()
    arm.start_egm(FULL_SPEED)
    trace, time = [], 0.0
    while time < duration:
        measured = arm.position[6]
        trace.append(Sample(time, measured, arm.planned[6]))
        arm.advance(CYCLE)
        arm.set_reference(only(6, measured + gain * (goal_at(time) - measured)), None)
        time += CYCLE
    return trace


@pytest.mark.parametrize(("gain", "published"), [(1.2, 0.80), (1.6, 0.58)])
def test_step_of_ten_degrees_settles_in_the_published_time(gain, published):
    trace = p_controlled(gain, lambda _: radians(10.0), 2.0)
    settled = max(sample.time for sample in trace if abs(radians(10.0) - sample.measured) > radians(0.1))
    assert settled == pytest.approx(published, rel=0.10)


def sine_lags(gain: float) -> tuple[float, float]:
    """Phase lags [s] of planned and measured behind a sine of 10° at 0.2 Hz, over the last two periods."""
    omega = 2.0 * pi * 0.2
    trace = [s for s in p_controlled(gain, lambda t: radians(10.0) * sin(omega * t), 15.0) if s.time >= 5.0]
    lags = []
    for values in ([s.planned for s in trace], [s.measured for s in trace]):
        in_phase = sum(value * sin(omega * s.time) for value, s in zip(values, trace, strict=True))
        quadrature = sum(value * cos(omega * s.time) for value, s in zip(values, trace, strict=True))
        lags.append(-quadrature / in_phase / omega)
    return lags[0], lags[1]


@pytest.mark.parametrize(("gain", "published"), [(1.2, 0.162), (2.0, 0.086)])
def test_sine_is_followed_with_the_published_lag(gain, published):
    planned, measured = sine_lags(gain)
    assert planned == pytest.approx(published, rel=0.05)
    assert measured - planned == pytest.approx(0.026 + CYCLE, abs=0.005)  # the servo's delay and lag


def test_position_is_approached_with_the_gain_as_rate():
    motion = law(gain=5.0)
    motion.reference = only(0, 0.1)
    advanced(motion, 0.2016)
    assert motion.state.position[0] == pytest.approx(0.1 * (1.0 - 2.718281828 ** (-5.0 * 0.2016)), rel=1e-6)


@pytest.mark.parametrize("dt", [0.0005, 0.001, 0.05])
def test_law_is_the_same_however_time_is_divided(dt):
    motion, once = law(gain=20.0), law(gain=20.0)
    motion.reference = once.reference = only(0, 0.1)
    motion.reference_velocity = once.reference_velocity = only(0, 0.2)
    advanced(motion, 0.2, dt)
    once.advance(0.2)
    assert motion.state.position == pytest.approx(once.state.position, abs=1e-12)


def test_ramp_is_followed_one_time_constant_late_without_feed_forward():
    motion = law(gain=5.0)
    for cycle in range(1000):
        motion.reference = only(0, 0.2 * cycle * CYCLE)
        motion.advance(CYCLE)
    assert (motion.reference[0] - motion.state.position[0]) / 0.2 == pytest.approx(1.0 / 5.0, rel=0.03)


def test_feed_forward_removes_the_lag_of_a_ramp():
    motion = law(gain=5.0)
    motion.reference_velocity = only(0, 0.2)
    for cycle in range(1000):
        motion.reference = only(0, 0.2 * cycle * CYCLE)
        motion.advance(CYCLE)
    assert motion.state.position[0] == pytest.approx(motion.reference[0] + 0.2 * CYCLE / 2.0, abs=0.2 * CYCLE)


def test_position_is_ignored_when_the_gain_is_zero():
    motion = law(gain=0.0)
    motion.reference, motion.reference_velocity = only(0, 1.0), only(0, 0.1)
    assert advanced(motion, 1.0).state.position[0] == pytest.approx(0.1, rel=0.01)


def test_speed_is_capped_with_one_scale_for_all_joints():
    motion = law(max_speed=0.1)
    motion.reference = (0.5, -0.25, 0.0, 0.0, 0.0, 0.0, 0.0)
    motion.advance(CYCLE)
    assert motion.state.velocity[:2] == pytest.approx((0.1, -0.05))
    assert motion.utilization == pytest.approx(25.0, rel=0.02)


def test_speed_is_capped_at_what_the_joint_can_do():
    motion = law(max_speed=FAST)
    motion.reference = only(0, 2.9)
    motion.advance(CYCLE)
    assert motion.state.velocity[0] == pytest.approx(pi)


def test_low_pass_lets_speed_grow_with_its_time_constant():
    motion = law(gain=0.0, bandwidth=20.0)
    motion.reference_velocity = only(0, 0.1)
    advanced(motion, 1.0 / (2.0 * pi * 20.0), 1e-5)
    assert motion.state.velocity[0] == pytest.approx(0.1 * 0.632, rel=0.01)


def test_contribution_fades_in_linearly():
    motion = law(gain=0.0, ramp_in_time=1.0)
    motion.reference_velocity = only(0, 0.1)
    assert advanced(motion, 0.5, 0.01).state.velocity[0] == pytest.approx(0.05, rel=0.02)
    assert motion.state.position[0] == pytest.approx(0.1 * 0.5**2 / 2.0)
    assert advanced(motion, 1.0, 0.01).state.position[0] == pytest.approx(0.1 * (0.5 + 0.5))


def test_ramp_in_is_exact_when_a_step_goes_beyond_it():
    motion = law(gain=0.0, ramp_in_time=0.1)
    motion.reference_velocity = only(0, 0.1)
    motion.advance(0.3)
    assert motion.state.position[0] == pytest.approx(0.1 * (0.05 + 0.2))


def test_joints_stay_within_the_position_deviation():
    motion = law(max_deviation=0.05)
    motion.reference = only(0, 1.0)
    assert advanced(motion, 2.0).state.position[0] == 0.05


def test_law_takes_its_numbers_from_configuration_activation_and_run():
    data = ExternalMotionData(level=0, position_gain=8.0, bandwidth=30.0)
    activation = EgmActivation(lp_filter=None, max_speed_deviation=0.3, max_pos_deviation=0.4)
    settings = EgmSettings.of(data, activation, EgmRun(pos_corr_gain=0.5, ramp_in_time=0.2))
    assert settings == EgmSettings(4.0, 30.0, 0.2, 0.3, 0.4, 0)


def test_filter_of_the_activation_goes_before_the_configured_one():
    settings = EgmSettings.of(ExternalMotionData(bandwidth=30.0), EgmActivation(lp_filter=0.0), EgmRun())
    assert settings.bandwidth == 0.0
