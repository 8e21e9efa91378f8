"""The robot's side of EGM, item by item (reference/egm.md §10): transport, messages and sessions, items 1 to 15."""

from __future__ import annotations

import socket
import struct
from dataclasses import replace
from itertools import pairwise

import pytest
from egm_robot_bench import FULL_SPEED, HOME, KEEP_ALIVE, RAW, RobotBench, always, call_by_name, order, speed, turned
from state_machine_bench import ARMS, Bench

from abb_protocols.egm import egm_pb2 as pb
from abb_protocols.egm.codec import MciState, MotorState, RapidState
from abb_protocols.robot.joints import CYCLE, Side, abb_from_chain, chain_from_abb
from abb_protocols.robot.kinematics import euler_zyx, tool0_to_body
from abb_runtime.udp import UdpClient
from virtual_irc5.mechanics.egm_client import EgmOptions, EgmOutcome, EgmRobotWare
from virtual_irc5.mechanics.egm_motion import EgmActivation, EgmStopMode, ExternalMotionData
from virtual_irc5.world import World, WorldSettings

VIRTUAL_CYCLE = 0.004  # of ABB's own virtual controller [s]


@pytest.fixture
def bench() -> RobotBench:
    return RobotBench().prepare()


@pytest.fixture
def guided() -> Bench:
    """The whole robot, both arms under EGM."""
    bench = Bench()
    bench.bring_up()
    bench.set_egm("activate.max_speed_deviation", "400")
    bench.pulse("EGM_START_JOINT")
    bench.run_until(lambda: all(bench.sensors[side].heard for side in ARMS), limit=1.0)
    return bench


# 1: one independent client per arm


def test_01_left_arm_sends_to_port_6511_and_right_arm_to_6512():
    world = World(WorldSettings(egm_host="192.168.125.50"))
    destinations = [world.egm_destination(side) for side in (Side.LEFT, Side.RIGHT)]
    assert destinations == [("192.168.125.50", 6511), ("192.168.125.50", 6512)]


def test_01_ports_can_be_chosen():
    assert World(WorldSettings(egm_ports={Side.LEFT: 6510})).egm_destination(Side.LEFT) == ("127.0.0.1", 6510)


def test_01_each_arm_has_its_own_session(guided):
    guided.sensors[Side.LEFT].is_silent = True
    guided.run_until(lambda: guided.states[1] == 0, limit=4.0)
    heard = len(guided.sensors[Side.RIGHT].heard)
    guided.run(0.1)
    assert len(guided.sensors[Side.RIGHT].heard) == heard + round(0.1 / CYCLE)


@pytest.mark.parametrize("cycle_time", [CYCLE, VIRTUAL_CYCLE])
def test_01_cycle_is_4_032_ms_or_4_000_as_an_option(cycle_time):
    bench = RobotBench(EgmOptions(cycle_time=cycle_time)).prepare().run().pass_time(0.2, always(KEEP_ALIVE))
    periods = [b.measured_time - a.measured_time for a, b in pairwise(bench.sent)]
    assert periods == pytest.approx([cycle_time] * len(periods), abs=2e-6)


def test_01_option_of_the_cycle_is_that_of_the_whole_robot():
    world = World(WorldSettings(egm=EgmOptions(cycle_time=VIRTUAL_CYCLE)))
    world.cycle({})
    assert (world.cycle_time, world.controller.time) == (0.004, 0.004)


# 2: who speaks first, and to whom the robot listens


def test_02_robot_speaks_first(bench):
    assert bench.run().cycle().seqno == 0


def test_02_datagrams_count_from_the_configured_address_only_from_any_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        client = UdpClient(*server.getsockname())
        client.send(b"")
        arm = server.recvfrom(1)[1]
    for address in ("127.0.0.1", "127.0.0.2", "127.0.0.1"):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.bind((address, 0))
            sender.sendto(address.encode(), arm)
    assert client.receive() == [b"127.0.0.1", b"127.0.0.1"]
    client.close()


# 3: the newest datagram of a cycle, without a queue


def test_03_newest_datagram_of_a_cycle_is_taken_and_kept(bench):
    bench.run().cycle(*(order(turned(0, by)) for by in (0.1, 0.2, 0.3)))
    taken = [bench.arm.egm.reference[0]]
    for inbox in ((), (order(turned(0, 0.4)),), ()):
        bench.cycle(*inbox)
        taken.append(bench.arm.egm.reference[0])
    assert taken == pytest.approx([0.3, 0.3, 0.4, 0.4])


def test_03_newest_datagram_waits_for_the_cycle_that_exchanges_datagrams():
    bench = RobotBench().prepare(replace(FULL_SPEED, sample_rate_ms=12)).run()
    bench.cycle()
    bench.cycle(order(turned(0, 0.1)))
    bench.cycle(order(turned(0, 0.2)))
    assert bench.arm.egm.reference[0] == 0.0
    bench.cycle()
    assert bench.arm.egm.reference[0] == pytest.approx(0.2)


def test_03_feedback_is_from_before_the_datagram_it_is_answered_with(bench):
    bench.run()
    first = bench.cycle(order(turned(0, 0.3)))
    assert first.planned == pytest.approx(HOME, abs=1e-6)
    bench.cycle()
    assert bench.cycle().planned[0] > 0.001


# 4: size and numbers


@pytest.mark.parametrize(("robotware", "size"), [(EgmRobotWare.RW_6_09, 381), (EgmRobotWare.RW_6_10, 392)])
def test_04_datagrams_are_far_below_1024_bytes(robotware, size):
    bench = RobotBench(EgmOptions(robotware)).prepare().run()
    bench.cycle()
    assert len(bench.raw[0]) == pytest.approx(size, abs=2)


def test_04_repeated_doubles_are_not_packed(bench):
    bench.run().cycle()
    robax, _ = abb_from_chain(bench.sent[0].measured)
    assert b"".join(b"\x09" + struct.pack("<d", value) for value in bench.last.feedBack.joints.joints) in bench.raw[0]
    assert len(robax) == 6


def test_04_values_are_single_precision(bench):
    bench.run().pass_time(0.3, always(order(turned(0, 0.2))))
    part = bench.last.feedBack
    values = [*part.joints.joints, part.cartesian.pos.x, part.cartesian.orient.u0, *part.externalJoints.joints]
    assert [struct.unpack("<f", struct.pack("<f", value))[0] for value in values] == values


# 5 to 8: what a datagram says


def test_05_header_counts_from_0_with_rising_time_and_type_data(bench):
    bench.run().pass_time(0.2, always(KEEP_ALIVE))
    headers = [pb.EgmRobot.FromString(datagram).header for datagram in bench.raw]
    assert [header.seqno for header in headers] == list(range(len(headers)))
    assert all(4 <= later.tm - earlier.tm <= 5 for earlier, later in pairwise(headers))
    assert {header.mtype for header in headers} == {pb.EgmHeader.MSGTYPE_DATA}


def test_06_feedback_and_planned_have_axes_1_to_6_and_axis_7_apart(bench):
    bench.run().cycle()
    for part in (bench.last.feedBack, bench.last.planned):
        assert (len(part.joints.joints), len(part.externalJoints.joints)) == (6, 1)
        assert part.joints.joints == pytest.approx((0.0, -130.0, 30.0, 0.0, 40.0, 0.0), abs=1e-4)
        assert part.externalJoints.joints[0] == pytest.approx(135.0, abs=1e-4)


def test_06_feedback_is_about_4_5_ms_older_than_the_datagram_on_the_same_clock(bench):
    bench.run().pass_time(0.2, always(KEEP_ALIVE))
    last = bench.last
    measured = last.feedBack.time.sec + last.feedBack.time.usec * 1e-6
    assert last.header.tm / 1000.0 - measured == pytest.approx(0.0045, abs=0.0011)
    assert last.planned.time.sec + last.planned.time.usec * 1e-6 > measured


def test_07_states_are_always_told_and_test_signals_are_empty(bench):
    bench.run().cycle()
    for name in ("motorState", "mciState", "mciConvergenceMet", "rapidExecState", "testSignals"):
        assert bench.last.HasField(name)
    assert list(bench.last.testSignals.signals) == []


def test_07_robotware_6_09_sends_no_field_from_10_on(bench):
    bench.run().cycle()
    assert max(descriptor.number for descriptor, _ in bench.last.ListFields()) == 8


def test_07_robotware_6_10_adds_the_utilization_above_100_percent_when_limited():
    slow = EgmActivation(lp_filter=0.0)
    bench = RobotBench(EgmOptions(EgmRobotWare.RW_6_10)).prepare(slow).run()
    bench.pass_time(0.1, always(order(turned(0, 0.2))))
    assert bench.last.utilizationRate > 100.0


def test_08_pose_is_the_forward_kinematics_of_the_joints(bench):
    bench.run().pass_time(0.5, always(order(turned(0, 0.5))))
    part = bench.last.feedBack
    joints_deg = chain_from_abb(part.joints.joints, part.externalJoints.joints[0])
    pose = tool0_to_body(Side.LEFT, tuple(value * 0.017453292519943295 for value in joints_deg))
    cartesian = part.cartesian
    assert (cartesian.pos.x, cartesian.pos.y, cartesian.pos.z) == pytest.approx(
        [value * 1000.0 for value in pose.position], abs=1e-3
    )
    assert (cartesian.euler.x, cartesian.euler.y, cartesian.euler.z) == pytest.approx(
        [value * 57.29577951308232 for value in euler_zyx(pose.orientation)], abs=1e-3
    )


# 9 to 15: sessions


def test_09_nothing_is_sent_at_setup_and_activation(bench):
    assert [bench.cycle() for _ in range(10)] == [None] * 10


def test_09_run_and_stream_begin_with_number_0(bench):
    assert bench.run().pass_time(0.1, always(KEEP_ALIVE)).sent[0].seqno == 0
    bench.egm.stop()
    bench.pass_time(0.1)
    bench.egm.stream_start()
    assert bench.cycle().seqno == 0


def test_10_stream_says_stopped_and_run_says_running_from_the_first_datagram(bench):
    bench.egm.stream_start()
    assert bench.cycle().mci is MciState.STOPPED
    assert bench.run().cycle().mci is MciState.RUNNING


@pytest.mark.parametrize(
    ("end", "mci"),
    [
        (lambda bench: bench.egm.stop(), MciState.STOPPED),
        (lambda bench: bench.egm.abort(), MciState.STOPPED),
        (lambda bench: bench.pass_time(1.02), MciState.ERROR),
    ],
    ids=["EGMStop", "program stop", "silent sensor"],
)
def test_10_end_says_stopped_or_error(bench, end, mci):
    bench.run().cycle(KEEP_ALIVE)
    end(bench)
    bench.pass_time(0.1)
    assert bench.sent[-1].mci is mci


def test_11_run_ends_when_all_selected_axes_stay_in_their_bands(bench):
    bench.run(cond_time=0.3).pass_time(0.25, always(order(HOME)))
    assert (bench.egm.outcome, bench.sent[-1].is_converged) == (EgmOutcome.RUNNING, True)
    bench.pass_time(0.1, always(order(HOME)))
    assert bench.egm.outcome is EgmOutcome.CONVERGED


def test_11_time_in_the_bands_begins_anew_when_an_axis_leaves_them(bench):
    bench.run(cond_time=0.5).pass_time(0.4, always(order(HOME)))
    bench.pass_time(0.1, always(order(turned(5, 0.1))))
    bench.pass_time(0.4, always(order(HOME)))
    assert bench.egm.outcome is EgmOutcome.RUNNING


@pytest.mark.parametrize("end", ["stop", "abort"])
def test_11_silence_follows_the_end(bench, end):
    bench.run().pass_time(0.1, always(KEEP_ALIVE))
    getattr(bench.egm, end)()
    assert bench.cycle() is not None
    assert [bench.cycle(KEEP_ALIVE) for _ in range(10)] == [None] * 10


def test_11_two_runs_in_a_row_are_two_sessions(bench):
    for _ in range(2):
        bench.run(cond_time=0.1).pass_time(0.2, always(order(HOME)))
    starts = [index for index, message in enumerate(bench.sent) if message.seqno == 0]
    assert len(starts) == 2


def test_12_ramp_down_returns_to_the_start_in_its_time(bench):
    bench.run().pass_time(2.0, always(order(turned(6, 0.2))))
    bench.egm.stop(EgmStopMode.RAMP_DOWN, 1.0)
    bench.pass_time(0.5)
    assert 0.02 < bench.arm.planned[6] < 0.18
    bench.pass_time(0.6)
    assert bench.arm.position == pytest.approx(HOME, abs=1e-5)


def test_12_hold_stays(bench):
    bench.run().pass_time(2.0, always(order(turned(6, 0.2))))
    bench.egm.stop(EgmStopMode.HOLD, 1.0)
    assert bench.pass_time(1.0).arm.position == pytest.approx(turned(6, 0.2), abs=1e-4)


@pytest.mark.parametrize(("timeout", "outcome"), [(0.5, EgmOutcome.COMM_TIMEOUT), (1e5, EgmOutcome.RUNNING)])
def test_13_sensor_may_be_silent_for_the_comm_timeout(timeout, outcome):
    bench = RobotBench().prepare(comm_timeout=timeout).run()
    bench.pass_time(0.4, always(KEEP_ALIVE)).pass_time(0.48)
    assert bench.egm.outcome is EgmOutcome.RUNNING
    assert bench.pass_time(0.03).egm.outcome is outcome


def test_13_silence_is_an_error_that_a_waiting_program_handles(guided):
    guided.sensors[Side.LEFT].is_silent = True
    guided.run_until(lambda: guided.states[1] == 0, limit=4.0)
    assert guided.controller.events.entries()[0].code == 41822
    assert guided.controller.is_running


def test_13_silence_stops_a_program_that_does_not_wait(bench):
    bench.run(is_waited=False).pass_time(1.1)
    failure = bench.egm.take_failure()
    assert (failure.outcome, failure.sentence) == (
        EgmOutcome.COMM_TIMEOUT,
        "No datagram has come for 1 s.",
    )
    assert bench.egm.take_failure() is None


def test_13_silence_stops_the_real_program_that_does_not_wait_even_while_it_does_other_things():
    robot = Bench()
    robot.bring_up()
    call_by_name(
        robot,
        "guide",
        "MoveAbsJ CJointT(), v100, fine, tool0; EGMGetId egm;"
        'EGMSetupUC ROB_L, egm, "ROB_L", "ROB_L" \\Joint \\CommTimeout:=0.5; EGMActJoint egm;'
        "EGMRunJoint egm, EGM_STOP_HOLD \\NoWaitCond \\J1; WaitTime 10;",
    )
    robot.sensors[Side.LEFT].is_silent = True
    robot.run(1.0)
    assert not robot.controller.is_running
    assert [event.code for event in robot.controller.events.entries()[:2]] == [10125, 41822]


def test_14_program_stop_ramps_down_over_the_default_ramp_time():
    bench = RobotBench().prepare(data=ExternalMotionData(level=0, ramp_time=1.0)).run(pos_corr_gain=0.0)
    bench.pass_time(0.5, always(order(velocity=speed(0, 0.2))))
    before = bench.arm.planned[0]
    bench.egm.abort()
    bench.pass_time(0.9)
    assert not bench.arm.is_stationary
    bench.pass_time(0.3)
    assert bench.arm.is_stationary
    assert bench.arm.position[0] - before == pytest.approx(0.2 * 1.0 / 2.0, rel=0.1)


def test_14_program_stop_is_told(guided):
    guided.controller.stop_rapid()
    guided.run(0.01)
    last = guided.sensors[Side.LEFT].heard[-1]
    assert (last.motors, last.mci, last.rapid) == (MotorState.ON, MciState.STOPPED, RapidState.STOPPED)


def test_14_motors_off_are_told(guided):
    guided.controller.set_motors(False)
    guided.run(0.01)
    assert guided.sensors[Side.LEFT].heard[-1].motors is MotorState.OFF


def test_14_rapid_state_is_undefined_after_a_restart_as_an_option():
    bench = RobotBench(EgmOptions(sends_rapid_state=False)).prepare(FULL_SPEED, data=RAW).run()
    assert bench.cycle().rapid is RapidState.UNDEFINED


def test_15_what_happens_to_one_arm_does_not_delay_the_other(guided):
    calm, late = guided, Bench()
    late.bring_up()
    late.set_egm("activate.max_speed_deviation", "400")
    late.pulse("EGM_START_JOINT")
    late.sensors[Side.LEFT].is_silent = True
    for bench in (calm, late):
        bench.run(0.5)
    told = [[(m.seqno, m.measured_time) for m in bench.sensors[Side.RIGHT].heard[:100]] for bench in (calm, late)]
    assert told[0] == told[1]
