"""The robot's side of EGM, item by item (reference/egm.md §10): input handling and dynamics, items 16 to 24."""

from __future__ import annotations

from math import exp, inf, nan, pi, radians

import pytest
from egm_robot_bench import (
    FULL_SPEED,
    HOME,
    KEEP_ALIVE,
    RAW,
    RobotBench,
    always,
    call_by_name,
    order,
    sensor,
    speed,
    turned,
)
from state_machine_bench import Bench

from abb_protocols.egm import egm_pb2 as pb
from abb_protocols.egm.codec import MciState, MotorState, RobotCodec
from abb_protocols.robot.joints import CYCLE, Side
from abb_protocols.robot.kinematics import quaternion_from_euler_zyx
from abb_protocols.rws.values import ControllerState
from virtual_irc5.mechanics.egm_client import EgmOptions, EgmOutcome, InvalidEgmReference
from virtual_irc5.mechanics.egm_motion import EgmActivation, ExternalMotionData


@pytest.fixture
def bench() -> RobotBench:
    return RobotBench().prepare()


@pytest.fixture
def robot() -> Bench:
    """The whole robot, idle."""
    bench = Bench()
    bench.bring_up()
    return bench


@pytest.fixture
def guided(robot: Bench) -> Bench:
    robot.set_egm("activate.max_speed_deviation", "400")
    robot.pulse("EGM_START_JOINT")
    robot.run(0.3)
    return robot


def codes(bench: Bench) -> list[int]:
    return [event.code for event in bench.controller.events.entries()]


# 16 and 17: which parts of a datagram count


def test_16_joints_count_and_poses_do_not_in_joint_mode(bench):
    both = sensor(turned(0, 0.1))
    both.planned.cartesian.pos.x = both.planned.cartesian.pos.y = both.planned.cartesian.pos.z = 5000.0
    both.planned.cartesian.orient.u0 = 1.0
    both.planned.cartesian.orient.u1 = both.planned.cartesian.orient.u2 = both.planned.cartesian.orient.u3 = 0.0
    both.speedRef.cartesians.value.extend([1000.0] * 6)
    bench.run().pass_time(2.0, always(both.SerializeToString()))
    assert bench.arm.position == pytest.approx(turned(0, 0.1), abs=1e-4)


def test_16_pose_mode_is_an_error_on_a_yumi_with_robotware_6(robot):
    call_by_name(robot, "guide", "EGMGetId egm; EGMActPose egm, frame, EGM_FRAME_BASE, frame, EGM_FRAME_BASE;")
    robot.run(0.1)
    assert 41826 in codes(robot)
    assert not robot.controller.is_running


@pytest.mark.parametrize(
    "header",
    [
        None,
        pb.EgmHeader(),
        pb.EgmHeader(seqno=7, tm=0),
        pb.EgmHeader(seqno=0, tm=123456, mtype=pb.EgmHeader.MSGTYPE_UNDEFINED),
    ],
    ids=["none", "empty", "tm 0", "seqno 0"],
)
def test_17_header_may_lack_anything(bench, header):
    message = sensor(turned(0, 0.1))
    if header is not None:
        message.header.CopyFrom(header)
    bench.run().pass_time(2.0, always(message.SerializeToString()))
    assert bench.arm.position == pytest.approx(turned(0, 0.1), abs=1e-4)


@pytest.mark.parametrize("numbers", [(1, 3, 5), (10, 50, 51), (9, 8, 7), (5, 0, 1), (4, 4, 4)])
def test_17_sequence_numbers_of_the_sensor_do_not_matter(bench, numbers):
    bench.run()
    for number, by in zip(numbers, (0.1, 0.2, 0.3), strict=True):
        message = sensor(turned(0, by))
        message.header.seqno = number
        bench.cycle(message.SerializeToString())
        assert bench.arm.egm.reference[0] == pytest.approx(by)


def test_17_empty_parts_count_as_absent(bench):
    empty = pb.EgmSensor()
    empty.planned.joints.SetInParent()
    empty.speedRef.joints.SetInParent()
    bench.run().cycle(order(turned(0, 0.1)))
    bench.pass_time(0.1, always(empty.SerializeToString()))
    assert bench.arm.egm.reference == pytest.approx(turned(0, 0.1))


def test_17_header_alone_keeps_the_session_alive(bench):
    bench.run().pass_time(3.0, always(KEEP_ALIVE))
    assert (bench.egm.outcome, bench.arm.position) == (EgmOutcome.RUNNING, HOME)


def test_17_unknown_fields_are_left_aside(bench):
    unknown = bytes([15 << 3 | 2, 3]) + b"abc"
    bench.run().cycle(order(turned(0, 0.1)) + unknown)
    assert bench.arm.egm.reference[0] == pytest.approx(0.1)


# 18 to 20: unusual values


def test_18_missing_axes_keep_their_last_reference(bench):
    bench.run().cycle(order(turned(3, 0.2)))
    short = pb.EgmSensor()
    short.planned.joints.joints.extend([5.0])
    bench.cycle(short.SerializeToString())
    assert bench.arm.egm.reference == pytest.approx((radians(5.0), *turned(3, 0.2)[1:]))


def test_18_extra_axes_are_ignored(bench):
    long = sensor(turned(0, 0.1))
    long.planned.joints.joints.extend([77.0])
    long.planned.externalJoints.joints.extend([88.0, 99.0])
    bench.run().cycle(long.SerializeToString())
    assert bench.arm.egm.reference == pytest.approx(turned(0, 0.1))


@pytest.mark.parametrize("nonsense", [b"\xff" * 20, b"\x0a\x7f", bytes(2000)], ids=["ff", "cut", "long"])
def test_19_bad_protobuf_is_ignored(bench, nonsense):
    bench.run()
    bench.cycle(nonsense, order(turned(0, 0.1)))
    bench.cycle()
    assert bench.arm.egm.reference[0] == pytest.approx(0.1)


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_19_reference_that_is_no_number_is_a_system_failure(guided, value):
    datagram = order((value, *HOME[1:]))
    guided.sensors[Side.LEFT].answer = lambda _: [datagram]
    guided.run(0.05)
    assert guided.controller.controller_state is ControllerState.SYSTEM_FAILURE
    assert {10014, 20192} <= set(codes(guided))
    assert not guided.controller.is_running


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_19_reference_that_is_no_number_is_rejected_as_an_option(value):
    bench = RobotBench(EgmOptions(invalid_reference=InvalidEgmReference.REJECT)).prepare().run()
    bench.cycle(order(turned(0, 0.1)))
    bench.cycle(order((value, *HOME[1:])))
    assert bench.egm.ignored_datagrams == 1
    assert (bench.egm.outcome, bench.arm.egm.reference[0]) == (EgmOutcome.RUNNING, pytest.approx(0.1))


def test_20_euler_angles_win_over_the_quaternion_which_is_normalised():
    message = pb.EgmSensor()
    cartesian = message.planned.cartesian
    cartesian.pos.x = cartesian.pos.y = cartesian.pos.z = 100.0
    cartesian.orient.u0, cartesian.orient.u1, cartesian.orient.u2, cartesian.orient.u3 = 0.0, 3.0, 0.0, 4.0
    codec = RobotCodec()
    assert codec.decode(message.SerializeToString()).tool_orientation == pytest.approx((0.0, 0.6, 0.0, 0.8))
    cartesian.euler.x, cartesian.euler.y, cartesian.euler.z = 90.0, 0.0, 0.0
    expected = quaternion_from_euler_zyx((pi / 2.0, 0.0, 0.0))
    assert codec.decode(message.SerializeToString()).tool_orientation == pytest.approx(expected)


# 21: limits


def test_21_reference_out_of_the_range_is_an_error_and_switches_the_motors_off(guided):
    guided.sensors[Side.LEFT].goal = turned(3, radians(60.0))
    guided.run(0.05)
    last = guided.sensors[Side.LEFT].heard[-1]
    assert (last.motors, last.mci) == (MotorState.OFF, MciState.ERROR)
    assert guided.controller.controller_state is ControllerState.MOTORS_OFF
    event = next(event for event in guided.controller.events.entries() if event.code == 50027)
    assert "input out of bounds: yumi_joint_3_l at 90.0°, range -123.5° to 80.0°" in event.description


def test_21_speed_is_capped_with_one_scale_for_all_joints(bench):
    bench.egm.activate(EgmActivation(lp_filter=0.0, max_speed_deviation=0.1))
    far = tuple(value + by for value, by in zip(HOME, (0.4, 0.2, -0.1, 0.0, 0.0, 0.0, 0.0), strict=True))
    bench.run().pass_time(0.1, always(order(far)))
    assert bench.arm.velocity == pytest.approx((0.1, 0.05, -0.025, 0.0, 0.0, 0.0, 0.0))


def test_21_position_is_capped_around_the_start(bench):
    bench.egm.activate(EgmActivation(lp_filter=0.0, max_speed_deviation=4.0, max_pos_deviation=radians(10.0)))
    bench.run().pass_time(2.0, always(order(turned(0, 0.5))))
    assert bench.arm.position == pytest.approx(turned(0, radians(10.0)), abs=1e-6)
    assert bench.arm.velocity == speed(0, 0.0)


# 22 to 24: how it moves


def test_22_speed_alone_moves_the_arm_when_the_gain_is_0(bench):
    bench.run(pos_corr_gain=0.0).pass_time(1.0, always(order(velocity=speed(4, 0.3))))
    assert bench.arm.velocity == pytest.approx(speed(4, 0.3))


def test_22_speed_alone_pulls_against_the_start_position_when_there_is_a_gain(bench):
    bench.run().pass_time(3.0, always(order(velocity=speed(4, 0.3))))
    assert bench.arm.position == pytest.approx(turned(4, 0.3 / 5.0), abs=1e-5)


@pytest.mark.parametrize("gain", [0.2, 1.0])
def test_23_position_is_approached_with_gain_times_5_per_second(bench, gain):
    bench.run(pos_corr_gain=gain).cycle(order(turned(0, 0.1)))
    bench.cycle()
    for _ in range(50):
        bench.cycle()
        reported = bench.sent[-1].measured[0]
        assert bench.arm.velocity[0] == pytest.approx(5.0 * gain * (0.1 - reported), rel=1e-4)
    assert reported > 0.01 * gain


def test_23_low_pass_of_the_configuration_counts_unless_the_activation_names_one():
    data = ExternalMotionData(level=0, bandwidth=2.0)
    reached = []
    for lp_filter in (None, 0.0):
        activation = EgmActivation(lp_filter=lp_filter, max_speed_deviation=4.0)
        bench = RobotBench().prepare(activation, data=data).run(pos_corr_gain=0.0)
        bench.pass_time(CYCLE + 1.0 / (2.0 * pi * 2.0), always(order(velocity=speed(0, 0.1))))
        reached.append(bench.arm.velocity[0] / 0.1)
    assert reached == pytest.approx([1.0 - exp(-1.0), 1.0], abs=0.03)


def test_23_contribution_fades_in(bench):
    bench.run(pos_corr_gain=0.0, ramp_in_time=1.0).pass_time(0.5, always(order(velocity=speed(0, 0.1))))
    assert bench.arm.velocity[0] == pytest.approx(0.05, rel=0.02)


@pytest.mark.parametrize(("level", "lag"), [(0, 0.016), (1, 0.032)])
def test_23_measured_position_is_late_by_the_servo_and_by_the_filtering_level(level, lag):
    bench = RobotBench().prepare(FULL_SPEED, data=ExternalMotionData(level=level, bandwidth=0.0))
    bench.run(pos_corr_gain=0.0).pass_time(0.5, always(order(velocity=speed(0, 0.2))))
    assert (bench.arm.planned[0] - bench.arm.position[0]) / 0.2 == pytest.approx(lag, abs=1e-4)


def test_23_datagram_is_taken_in_its_cycle_and_used_in_the_next(bench):
    bench.run().cycle(order(turned(0, 0.1)))
    assert bench.sent[-1].planned == pytest.approx(HOME, abs=1e-6)
    assert bench.cycle().planned == pytest.approx(HOME, abs=1e-6)
    assert bench.cycle().planned[0] == pytest.approx(0.1 * 5.0 * CYCLE, rel=1e-3)


def test_23_feedback_settles_within_5_thousandths_of_a_degree(bench):
    bench.run().pass_time(3.0, always(order(turned(4, 1.0))))
    assert bench.sent[-1].measured == pytest.approx(turned(4, 1.0), abs=radians(0.005))


def test_24_speed_goes_on_when_the_sensor_is_silent_until_the_comm_timeout():
    bench = RobotBench().prepare(comm_timeout=0.5, data=RAW).run(pos_corr_gain=0.0)
    bench.pass_time(0.2, always(order(velocity=speed(0, 0.2))))
    before = bench.arm.planned[0]
    bench.pass_time(0.49)
    assert bench.arm.planned[0] - before == pytest.approx(0.2 * 0.49, rel=0.02)
    bench.pass_time(1.0)
    assert (bench.egm.outcome, bench.arm.is_stationary) == (EgmOutcome.COMM_TIMEOUT, True)
