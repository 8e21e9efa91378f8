"""The robot's side of EGM for one arm, in virtual time and with real datagrams (reference/egm.md §10)."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import inf, nan, radians

import pytest

from abb_protocols.egm.codec import MciState, MotorState, RapidState, RobotMessage, SensorCodec, SensorMessage
from abb_protocols.egm.egm_pb2 import EgmSensor
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import CYCLE, Joints, Pose, Side, abb_from_chain, home
from abb_protocols.robot.kinematics import tool0_to_body
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.egm_client import (
    EgmClient,
    EgmClientState,
    EgmOptions,
    EgmOutcome,
    EgmRobotWare,
    InvalidEgmReference,
)
from virtual_irc5.mechanics.egm_motion import EgmActivation, EgmRun, EgmStopMode, ExternalMotionData, same_egm_band

HOME = home(Side.LEFT)
RAW = ExternalMotionData(level=0)
FULL_SPEED = EgmActivation(lp_filter=0.0, max_speed_deviation=radians(400.0))


class Bench:
    """A left arm with its EGM client, and a sensor that answers every datagram one cycle later."""

    def __init__(self, options: EgmOptions | None = None) -> None:
        self.arm = VirtualArm(Side.LEFT)
        self.arm.switch_motors_on()
        self.egm = EgmClient(self.arm, options)
        self.codec = SensorCodec()
        self.sent: list[RobotMessage] = []
        self.raw: list[bytes] = []

    def prepare(self, activation: EgmActivation = FULL_SPEED, comm_timeout: float = 1.0) -> Bench:
        self.egm.get_id()
        self.egm.setup(comm_timeout, RAW)
        self.egm.activate(activation)
        return self

    def run(self, **arguments: object) -> Bench:
        self.egm.run_joint(EgmRun(**{"cond_time": 1000.0, **arguments}))
        return self

    def cycle(self, *inbox: bytes) -> RobotMessage | None:
        datagram = self.egm.cycle(inbox)
        self.arm.advance(CYCLE)
        if datagram is None:
            return None
        self.raw.append(datagram)
        self.sent.append(self.codec.decode(datagram))
        return self.sent[-1]

    def converse(self, seconds: float, answer: Callable[[RobotMessage], bytes]) -> RobotMessage | None:
        message, inbox = None, ()
        for _ in range(round(seconds / CYCLE)):
            message = self.cycle(*inbox)
            inbox = () if message is None else (answer(message),)
        return message

    def order(self, position: Joints | None = None, velocity: Joints | None = None) -> bytes:
        return self.codec.encode(SensorMessage(0, position, velocity))


@pytest.fixture
def bench() -> Bench:
    return Bench().prepare()


def beside(turn: float, axis: int = 0) -> Joints:
    values = list(HOME)
    values[axis] += turn
    return tuple(values)


def in_axes(chain: Joints, *, speed: Joints | None = None) -> bytes:
    """A datagram as anybody may build it, without the checks of our own encoder."""
    sensor = EgmSensor()
    robax, eax_a = abb_from_chain(chain)
    sensor.planned.joints.joints.extend(value * 57.29577951308232 for value in robax)
    sensor.planned.externalJoints.joints.append(eax_a * 57.29577951308232)
    if speed is not None:
        robax, eax_a = abb_from_chain(speed)
        sensor.speedRef.joints.joints.extend(value * 57.29577951308232 for value in robax)
    return sensor.SerializeToString()


# sessions


def test_nothing_is_sent_before_egm_runs(bench):
    assert bench.cycle() is None
    assert bench.egm.state is EgmClientState.CONNECTED


def test_states_go_from_disconnected_to_running_and_back():
    bench = Bench()
    states = [bench.egm.state]
    bench.prepare()
    states.append(bench.egm.state)
    bench.run()
    states.append(bench.egm.state)
    bench.egm.reset()
    states.append(bench.egm.state)
    names = ["DISCONNECTED", "CONNECTED", "RUNNING", "DISCONNECTED"]
    assert [state.name for state in states] == names
    assert sorted(states) == [EgmClientState.DISCONNECTED] * 2 + [EgmClientState.CONNECTED, EgmClientState.RUNNING]


def test_first_datagram_is_complete_and_running(bench):
    message = bench.run().cycle()
    assert message.seqno == 0
    assert (message.motors, message.mci, message.rapid) == (MotorState.ON, MciState.RUNNING, RapidState.RUNNING)
    assert message.measured == pytest.approx(HOME, abs=1e-6)
    assert message.planned == pytest.approx(HOME, abs=1e-6)
    assert message.measured_pose.position == pytest.approx(tool0_to_body(Side.LEFT, HOME).position, abs=1e-6)


def test_datagrams_are_numbered_and_stamped_every_cycle(bench):
    bench.run().converse(0.1, lambda _: bench.order())
    assert [message.seqno for message in bench.sent] == list(range(len(bench.sent)))
    times = [message.measured_time for message in bench.sent]
    assert all(b - a == pytest.approx(0.004032, abs=1.5e-6) for a, b in pairwise(times))
    assert all(4 <= b.sent_ms - a.sent_ms <= 5 for a, b in pairwise(bench.sent))


def test_clocks_of_a_datagram_agree(bench):
    message = bench.run().cycle()
    assert message.sent_ms / 1000.0 - message.measured_time == pytest.approx(0.0045, abs=0.0011)
    assert message.planned_time - message.measured_time == pytest.approx(0.016, abs=1e-6)


@pytest.mark.parametrize(("robotware", "size"), [(EgmRobotWare.RW_6_09, 381), (EgmRobotWare.RW_6_10, 392)])
def test_datagram_has_the_size_of_its_robotware(robotware, size):
    bench = Bench(EgmOptions(robotware)).prepare().run()
    bench.cycle()
    assert len(bench.raw[0]) == pytest.approx(size, abs=2)  # varints of the clock
    assert (bench.sent[0].utilization is None) == (robotware is EgmRobotWare.RW_6_09)


def test_each_run_is_a_session_of_its_own(bench):
    bench.run().converse(0.1, lambda _: bench.order())
    bench.egm.stop()
    bench.converse(0.1, lambda _: bench.order())
    assert bench.run().cycle().seqno == 0


def test_sample_rate_thins_out_the_datagrams(bench):
    bench.egm.activate(EgmActivation(sample_rate_ms=12))
    bench.run()
    sent = [bench.cycle(bench.order()) is not None for _ in range(9)]
    assert sent == [True, False, False] * 3


def test_tool_and_work_object_move_the_reported_pose(bench):
    tip = Pose((0.0, 0.0, 0.1142), (1.0, 0.0, 0.0, 0.0))
    table = Pose((0.3, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0))
    bench.egm.activate(EgmActivation(tool=tip, wobj=table))
    x, y, z = tool0_to_body(Side.LEFT, HOME, tip).position
    assert bench.run().cycle().measured_pose.position == pytest.approx((x - 0.3, y, z - 0.1), abs=1e-6)


# references


def test_arm_goes_where_the_sensor_orders(bench):
    bench.run().converse(3.0, lambda _: bench.order(beside(0.2)))
    assert bench.arm.position == pytest.approx(beside(0.2), abs=radians(0.005))
    assert bench.sent[-1].is_converged


def test_arm_follows_speeds_when_the_gain_is_zero(bench):
    speed = (0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    bench.run(pos_corr_gain=0.0).converse(1.0, lambda _: bench.order(HOME, speed))
    assert bench.arm.velocity == pytest.approx(speed)


def test_last_reference_holds_when_nothing_arrives(bench):
    bench.run()
    bench.cycle(bench.order(beside(0.2)))
    for _ in range(240):
        bench.cycle()
    assert bench.arm.planned[0] == pytest.approx(0.2, abs=0.005)


def test_header_alone_keeps_the_session_alive_and_moves_nothing(bench):
    bench.run().converse(2.0, lambda _: b"\x0a\x04\x08\x01\x18\x03")
    assert bench.egm.outcome is EgmOutcome.RUNNING
    assert bench.arm.planned == HOME


def test_axes_left_out_keep_their_reference(bench):
    sensor = EgmSensor()
    sensor.planned.joints.joints.extend([5.0, -130.0])
    bench.run().converse(2.0, lambda _: sensor.SerializeToString())
    assert bench.arm.planned == pytest.approx(beside(radians(5.0)), abs=1e-4)


def test_newest_datagram_of_a_cycle_is_taken_and_the_others_are_lost(bench):
    bench.run()
    bench.cycle(bench.order(beside(0.1)), bench.order(beside(0.2)), bench.order(beside(0.3)))
    taken = [bench.arm.egm.reference[0]]
    for _ in range(3):
        bench.cycle()
        taken.append(bench.arm.egm.reference[0])
    assert taken == pytest.approx([0.3, 0.3, 0.3, 0.3])


def test_datagrams_from_before_the_session_are_lost(bench):
    bench.cycle(bench.order(beside(0.3)))
    bench.run().cycle()
    assert bench.arm.egm.reference == HOME


def test_nonsense_is_ignored_and_counted(bench):
    bench.run()
    bench.cycle(bench.order(beside(0.1)))
    bench.cycle(b"\xff\xff\xff")
    assert bench.egm.ignored_datagrams == 1
    assert bench.arm.egm.reference[0] == pytest.approx(0.1)


@pytest.mark.parametrize("value", [nan, inf])
def test_reference_that_is_no_number_makes_the_controller_fail(bench, value):
    bench.run()
    bench.cycle(in_axes((value, *HOME[1:])))
    assert bench.egm.outcome is EgmOutcome.SYSTEM_FAILURE
    assert bench.egm.fault == "The left arm got an EGM reference that is not a finite number."
    assert (bench.cycle().mci, bench.arm.motors_on) == (MciState.ERROR, False)
    assert bench.arm.planned == HOME


@pytest.mark.parametrize("value", [nan, inf])
def test_reference_that_is_no_number_can_be_rejected(value):
    bench = Bench(EgmOptions(invalid_reference=InvalidEgmReference.REJECT)).prepare().run()
    bench.cycle(in_axes((value, *HOME[1:])))
    assert (bench.egm.outcome, bench.egm.ignored_datagrams) == (EgmOutcome.RUNNING, 1)
    assert bench.arm.egm.reference == HOME


def test_reference_out_of_range_switches_the_motors_off(bench):
    bench.run()
    bench.cycle(in_axes(beside(radians(60.0), axis=3)))
    assert bench.egm.outcome is EgmOutcome.OUT_OF_BOUNDS
    assert bench.egm.fault == (
        "External Motion Interface input out of bounds: yumi_joint_3_l at 90.0°, range -123.5° to 80.0°."
    )
    last = bench.cycle()
    assert (last.motors, last.mci) == (MotorState.OFF, MciState.ERROR)
    assert bench.cycle() is None


def test_reference_at_the_limit_in_degrees_is_in_range(bench):
    bench.run()
    bench.cycle(in_axes((*HOME[:4], radians(290.0), *HOME[5:])))
    assert bench.egm.outcome is EgmOutcome.RUNNING


def test_speed_that_leaves_the_range_switches_the_motors_off(bench):
    speed = (2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    bench.run(pos_corr_gain=0.0).converse(3.0, lambda _: bench.order(None, speed))
    assert bench.egm.outcome is EgmOutcome.OUT_OF_BOUNDS
    assert bench.arm.is_stationary


def test_utilization_tells_that_the_motion_is_slowed_down():
    bench = Bench(EgmOptions(EgmRobotWare.RW_6_10)).prepare(EgmActivation(lp_filter=0.0)).run()
    bench.converse(0.1, lambda _: bench.order(beside(0.2)))
    assert bench.sent[-1].utilization > 10.0


# ends


def test_silence_ends_the_run_with_a_communication_error(bench):
    bench.run()
    cycles = 0
    while bench.egm.outcome is EgmOutcome.RUNNING:
        bench.cycle()
        cycles += 1
    assert cycles * CYCLE == pytest.approx(1.0, abs=2 * CYCLE)
    assert bench.egm.outcome is EgmOutcome.COMM_TIMEOUT
    assert bench.egm.fault == "No datagram has come for 1 s."
    assert bench.sent[-1].mci is MciState.ERROR


def test_silence_after_motion_stops_the_arm(bench):
    speed = (0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    bench.run(pos_corr_gain=0.0)
    bench.cycle(bench.order(None, speed))
    for _ in range(round(2.0 / CYCLE)):
        bench.cycle()
    assert bench.arm.is_stationary
    assert bench.arm.position[0] == pytest.approx(0.2 * (1.0 + 0.5 / 2.0), abs=0.01)  # coasts, then ramps down


def test_convergence_ends_the_run_when_the_arm_stays_for_the_condition_time(bench):
    bench.run(cond_time=0.5).converse(0.3, lambda _: bench.order(HOME))
    assert bench.egm.outcome is EgmOutcome.RUNNING
    bench.converse(0.3, lambda _: bench.order(HOME))
    assert bench.egm.outcome is EgmOutcome.CONVERGED
    assert bench.egm.state is EgmClientState.CONNECTED
    assert bench.sent[-1].mci is MciState.STOPPED


def test_convergence_waits_for_a_sensor(bench):
    bench.run(cond_time=0.1)
    for _ in range(100):
        bench.cycle()
    assert bench.egm.outcome is EgmOutcome.RUNNING


def test_convergence_band_of_nothing_never_converges_while_moving(bench):
    bench.egm.activate(EgmActivation(lp_filter=0.0, cond_min_max=same_egm_band(0.0, 0.0)))
    bench.run(cond_time=0.1).converse(0.5, lambda _: bench.order(beside(0.1)))
    assert bench.egm.outcome is EgmOutcome.RUNNING


def test_only_selected_axes_have_to_converge(bench):
    bench.egm.activate(EgmActivation(max_speed_deviation=radians(1.0)))
    bench.run(cond_time=0.1, axes=(False, True, True, True, True, True, True))
    bench.converse(0.5, lambda _: bench.order(beside(0.5)))
    assert bench.egm.outcome is EgmOutcome.CONVERGED


def test_run_without_any_axis_moves_nothing_and_goes_on(bench):
    bench.run(axes=(False,) * 7)
    assert bench.egm.outcome is EgmOutcome.CONVERGED
    assert bench.cycle() is None


def test_stop_ends_the_run_with_one_last_datagram(bench):
    bench.run().converse(0.1, lambda _: bench.order(HOME))
    bench.egm.stop()
    assert bench.egm.outcome is EgmOutcome.STOPPED
    assert bench.cycle().mci is MciState.STOPPED
    assert bench.cycle() is None


def test_ramp_down_returns_to_where_egm_began(bench):
    bench.run().converse(2.0, lambda _: bench.order(beside(0.2)))
    bench.egm.stop(EgmStopMode.RAMP_DOWN, 0.5)
    bench.converse(1.0, lambda _: bench.order(beside(0.2)))
    assert bench.arm.position == pytest.approx(HOME, abs=1e-5)


def test_program_stop_ramps_the_speed_down_and_ends_the_session(bench):
    speed = (0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    bench.run(pos_corr_gain=0.0).converse(0.5, lambda _: bench.order(None, speed))
    before = bench.arm.planned[0]
    bench.egm.rapid = RapidState.STOPPED
    bench.egm.abort()
    last = bench.cycle()
    assert (bench.egm.outcome, last.mci, last.rapid) == (EgmOutcome.ABORTED, MciState.STOPPED, RapidState.STOPPED)
    bench.converse(1.0, lambda _: bench.order())
    assert bench.arm.position[0] - before == pytest.approx(0.2 * 0.5 / 2.0, rel=0.1)


def test_motors_that_go_off_end_the_session(bench):
    bench.run().converse(0.1, lambda _: bench.order(HOME))
    bench.arm.switch_motors_off()
    assert bench.cycle().motors is MotorState.OFF
    assert bench.egm.outcome is EgmOutcome.MOTORS_OFF
    assert bench.egm.fault == "The left arm was stopped while EGM was running."
    assert bench.cycle() is None


def test_new_session_begins_where_the_arm_stands(bench):
    bench.run().converse(1.0, lambda _: bench.order(beside(0.2)))
    bench.egm.stop()
    bench.converse(0.5, lambda _: bench.order())
    stands_at = bench.arm.position
    bench.run().converse(0.2, lambda message: bench.order(message.measured))
    assert bench.arm.position == pytest.approx(stands_at, abs=1e-5)


# stream


def test_stream_sends_positions_and_uses_no_reply(bench):
    bench.egm.stream_start()
    bench.converse(2.0, lambda _: bench.order(beside(0.2)))
    assert bench.sent[-1].mci is MciState.STOPPED
    assert bench.egm.state is EgmClientState.RUNNING
    assert bench.arm.position == HOME


def test_stream_goes_on_when_the_motors_go_off(bench):
    bench.egm.stream_start()
    bench.arm.switch_motors_off()
    assert bench.cycle().motors is MotorState.OFF


def test_stream_ends_when_it_is_stopped(bench):
    bench.egm.stream_start()
    bench.cycle()
    bench.egm.stream_stop()
    assert bench.egm.state is EgmClientState.CONNECTED
    assert [bench.cycle() is None for _ in range(2)] == [False, True]


def test_run_on_a_stream_begins_a_session(bench):
    bench.egm.stream_start()
    bench.cycle()
    message = bench.run().cycle()
    assert (message.seqno, message.mci) == (0, MciState.RUNNING)


# refusals


@pytest.mark.parametrize(
    "request_", [lambda egm: egm.setup(), lambda egm: egm.run_joint(EgmRun()), lambda egm: egm.stream_start()]
)
def test_requests_without_an_identity_are_refused(request_):
    with pytest.raises(RobotNotReady, match="EGM of the left arm is disconnected: it has to be connected for this"):
        request_(Bench().egm)


def test_second_run_is_refused_while_one_is_going_on(bench):
    bench.run().cycle()
    with pytest.raises(RobotNotReady, match="EGM of the left arm is running: it has to be connected"):
        bench.run()


def test_run_is_refused_when_motors_are_off(bench):
    bench.arm.switch_motors_off()
    with pytest.raises(RobotNotReady, match="motors of the left arm are off"):
        bench.run()
    assert bench.egm.state is EgmClientState.CONNECTED
