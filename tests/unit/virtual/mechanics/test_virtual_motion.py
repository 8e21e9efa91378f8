"""EGM's control law, and the behaviour it gives a P controller on top: the published measurements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import exp, pi, radians

import pytest

from abb_protocols.robot.joints import ZERO_JOINTS, JointLimits, Joints, Side
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.arm_motion import ARM_MODELS, ArmModel
from virtual_irc5.mechanics.egm_motion import EgmActivation, EgmMotion, EgmMotionParameters, EgmRun, ExternalMotionData
from virtual_irc5.mechanics.servo import follow_references

CYCLE = 0.004032
FAST = 400.0
AT_ONCE = ArmModel(reference_delay=0.0)
THESIS = ArmModel(egm_acceleration=(6.0,) * 7)
FULL_SPEED = EgmMotionParameters(gain=5.0, bandwidth=0.0, ramp_in_time=0.1, max_speed=radians(400.0))


def only(index: int, value: float) -> Joints:
    values = [0.0] * 7
    values[index] = value
    return tuple(values)


def law(**settings: float) -> EgmMotion:
    defaults = {"gain": 5.0, "bandwidth": 0.0, "max_speed": FAST}
    return EgmMotion(ZERO_JOINTS, EgmMotionParameters(**{**defaults, **settings}), AT_ONCE)


def advanced(motion: EgmMotion, duration: float, dt: float = CYCLE) -> EgmMotion:
    """The motion of a robot that is where it plans to be."""
    for _ in range(round(duration / dt)):
        motion.reported = motion.state.position
        motion.advance(dt)
    return motion


@dataclass
class Sample:
    time: float
    measured: float
    planned: float


def p_controlled(gain: float, goal_at: Callable[[float], float], duration: float) -> list[Sample]:
    """Axis 6 with command = measured + P·(goal - measured), each command one cycle late."""
    arm = VirtualArm(Side.LEFT, ZERO_JOINTS, THESIS)
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


@pytest.mark.parametrize("gain", [1.2, 2.0])
def test_ramp_is_followed_with_the_lag_of_both_loops(gain):
    trace = p_controlled(gain, lambda time: 0.2 * time, 3.0)
    # A command counts two cycles after its measurement: one until EGM takes it, one until EGM uses it.
    last = trace[-1]
    assert last.time - last.measured / 0.2 == pytest.approx((1.0 / 5.0 + 2.0 * CYCLE) / gain, abs=1e-5)
    assert (last.planned - last.measured) / 0.2 == pytest.approx(0.010 + 0.006, abs=1e-5)


def test_position_is_approached_by_the_gain_times_the_distance_in_each_cycle():
    motion = law(gain=5.0)
    motion.reference = only(0, 0.1)
    advanced(motion, 50 * CYCLE)
    assert motion.state.position[0] == pytest.approx(0.1 * (1.0 - (1.0 - 5.0 * CYCLE) ** 50), rel=1e-9)


def test_loop_is_closed_over_what_the_robot_reports():
    motion = law(gain=5.0)
    motion.reference, motion.reported = only(0, 0.1), only(0, 0.04)
    motion.advance(CYCLE)
    motion.advance(CYCLE)
    assert motion.state.position[0] == pytest.approx(5.0 * (0.1 - 0.04) * 2.0 * CYCLE)


def test_references_are_used_when_their_delay_is_over():
    model = ArmModel(reference_delay=2.5 * CYCLE)
    motion = EgmMotion(ZERO_JOINTS, EgmMotionParameters(gain=0.0, bandwidth=0.0, max_speed=FAST), model)
    motion.reference_velocity = only(0, 0.1)
    speeds = []
    for _ in range(5):
        motion.advance(CYCLE)
        speeds.append(motion.state.velocity[0])
    assert speeds == pytest.approx([0.0, 0.0, 0.05, 0.1, 0.1])


def test_reference_that_lasts_less_than_a_step_counts_for_its_part_of_it():
    model = ArmModel(reference_delay=0.001)
    motion = EgmMotion(ZERO_JOINTS, EgmMotionParameters(gain=0.0, bandwidth=0.0, max_speed=FAST), model)
    for speed in (0.1, 0.2, 0.4):
        motion.reference_velocity = only(0, speed)
        motion.advance(0.001)
    motion.advance(0.004)
    assert motion.state.velocity[0] == pytest.approx((0.4 + 3.0 * 0.4) / 4.0)
    assert motion.state.position[0] == pytest.approx(0.001 * (0.0 + 0.1 + 0.2) + 0.004 * 0.4)


def discrete_ramp(settings: EgmMotionParameters, taken: Sequence[float], delay: int, cycle: float) -> list[float]:
    """What is reported of ``v = keep·v + (1 - keep)·k·(r - y); p += v·T``, y being p some cycles before."""
    keep = exp(-2.0 * pi * settings.bandwidth * cycle)
    planned, speed = [0.0], 0.0
    for number, reference in enumerate(taken):
        reported = planned[max(0, number - delay)]
        speed = keep * speed + (1.0 - keep) * settings.gain * (reference - reported)
        planned.append(planned[-1] + speed * cycle)
    return [planned[max(0, number - delay)] for number in range(len(taken))]


@pytest.mark.parametrize(("count", "cycle"), [(6, 0.004), (7, 0.004032), (1, 0.004032)])
def test_arm_follows_references_as_the_controllers_own_cycles_do(count: int, cycle: float) -> None:
    model = ArmModel(JointLimits.unlimited(count), delay=4.0 * cycle, lag=0.0, reference_delay=2.0 * cycle)
    settings = EgmMotionParameters(gain=5.0, bandwidth=100.0, max_speed=FAST)
    ramp = [0.001 * number for number in range(300)]
    answer = follow_references([(value,) * count for value in ramp], (0.0,) * count, model, settings, cycle=cycle)
    expected = discrete_ramp(settings, [0.0, 0.0, *ramp[:-2]], 4, cycle)
    for joint in range(count):
        assert [each.measured[joint] for each in answer] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("delay", [0.0, 0.010, 0.050])
def test_dead_time_inside_the_loop_leaves_the_lag_of_a_ramp_at_one_over_the_gain(delay: float) -> None:
    model = ArmModel(JointLimits.unlimited(1), delay=delay, lag=0.0, reference_delay=0.0)
    ramp = [(0.2 * number * CYCLE,) for number in range(1000)]
    settings = EgmMotionParameters(gain=5.0, bandwidth=20.0, max_speed=FAST)
    last = follow_references(ramp, (0.0,), model, settings)[-1].measured[0]
    assert (ramp[-1][0] - last) / 0.2 == pytest.approx(1.0 / 5.0, abs=1e-4)


@pytest.mark.parametrize(("robot", "cycle", "lag"), [("IRB 6640", CYCLE, 0.205), ("RobotStudio", 0.004, 0.206)])
def test_measured_robots_lag_on_a_ramp_as_in_their_records(robot: str, cycle: float, lag: float) -> None:
    ramp = [(0.2 * number * cycle,) * 6 for number in range(1000)]
    settings = EgmMotionParameters(gain=5.0, bandwidth=100.0, max_speed=FAST)
    answer = follow_references([(0.0,) * 6, *ramp[:-1]], (0.0,) * 6, ARM_MODELS[robot], settings, cycle=cycle)
    # Records begin with a cycle; the lag is that of a reference that changes in the middle of one.
    assert (ramp[-1][0] - answer[-1].measured[0]) / 0.2 == pytest.approx(lag + cycle / 2.0, abs=0.0025)


def test_feed_forward_removes_the_lag_of_a_ramp():
    motion = law(gain=5.0)
    motion.reference_velocity = only(0, 0.2)
    for cycle in range(1000):
        motion.reference = only(0, 0.2 * cycle * CYCLE)
        advanced(motion, CYCLE)
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


def test_change_of_speed_is_capped_with_one_scale_for_all_joints():
    model = ArmModel(reference_delay=0.0, egm_acceleration=(5.0,) * 7)
    motion = EgmMotion(ZERO_JOINTS, EgmMotionParameters(gain=0.0, bandwidth=0.0, max_speed=FAST), model)
    motion.reference_velocity = (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for _ in range(100):
        motion.advance(CYCLE)
    motion.reference_velocity = (0.0, 1.0, -0.4, 0.2, 0.0, 0.0, 0.0)
    motion.advance(CYCLE)
    # The joint that goes on as before is not slowed; the others change towards what is asked, in that direction.
    assert motion.state.velocity[1:4] == pytest.approx((1.0, -5.0 * CYCLE, 2.5 * CYCLE))
    assert motion.utilization == pytest.approx(0.4 / (5.0 * CYCLE))


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
    settings = EgmMotionParameters.of(data, activation, EgmRun(pos_corr_gain=0.5, ramp_in_time=0.2))
    assert settings == EgmMotionParameters(4.0, 30.0, 0.2, 0.3, 0.4, 0)


def test_filter_of_the_activation_goes_before_the_configured_one():
    settings = EgmMotionParameters.of(ExternalMotionData(bandwidth=30.0), EgmActivation(lp_filter=0.0), EgmRun())
    assert settings.bandwidth == 0.0
