from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from itertools import count

import pytest

from abb_protocols.catalogue import clause, message
from abb_protocols.egm.codec import MciState, MotorState, RapidState, RobotCodec, RobotMessage, SensorCodec
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, ArmCommand, Joints, Side, joints
from abb_runtime.clock import SystemClock
from abb_runtime.udp import MemoryLink, UdpClient, UdpServer, memory_links
from yumi.control.controller import Sampled
from yumi.control.goals import SessionGoal
from yumi.control.limiter import Limiter
from yumi.control.shared_memory import SharedBuffer
from yumi.control.shared_state import Limited, Snapshot
from yumi.control.stage_times import CYCLE_BEGIN, SEND_STAGE, StageClock
from yumi.driver.egm_arm import EgmArm, FallbackThread
from yumi.driver.reports import arm_report
from yumi.egm.egm_session import Session

HOME: Joints = (0.0, -2.0, 1.0, 0.5, 0.0, 0.7, 0.0)
MESSAGE = RobotMessage(
    0, 0, HOME, HOME, None, None, 1.0, 1.0, MotorState.ON, MciState.RUNNING, RapidState.RUNNING, False
)


class Robot:
    """The other end of the wire."""

    def __init__(self, link: MemoryLink) -> None:
        self._link = link
        self._codec = RobotCodec()

    def say(self, message: RobotMessage) -> None:
        self._link.send(self._codec.encode(message))

    def hear(self) -> Joints | None:
        (datagram,) = self._link.receive()
        return self._codec.decode(datagram).position  # type: ignore[return-value]


@pytest.fixture
def wire() -> tuple[EgmArm, Robot]:
    ours, theirs = memory_links()
    return EgmArm(ours, Session(), Limiter(YUMI_LIMITS)), Robot(theirs)


def test_arm_has_no_state_before_the_robot_speaks(wire: tuple[EgmArm, Robot]) -> None:
    arm, _ = wire
    assert arm.receive(0.0) is None


def test_arm_reports_position_and_zero_velocity_at_first(wire: tuple[EgmArm, Robot]) -> None:
    arm, robot = wire
    robot.say(MESSAGE)
    state = arm.receive(5.0)
    assert state is not None
    assert state.position == pytest.approx(HOME, abs=1e-6)
    assert (state.time, state.dt, state.session, state.velocity) == (5.0, 0.0, 1, ZERO_JOINTS)


def test_arm_derives_velocity_by_the_robots_own_clock(wire: tuple[EgmArm, Robot]) -> None:
    arm, robot = wire
    robot.say(MESSAGE)
    arm.receive(0.0)
    robot.say(replace(MESSAGE, seqno=1, measured=(0.01, *HOME[1:]), measured_time=1.0 + CYCLE))
    state = arm.receive(0.01)
    assert state is not None
    assert state.dt == pytest.approx(CYCLE, abs=1e-6)
    assert state.velocity[0] == pytest.approx(0.01 / CYCLE, rel=1e-3)


@pytest.mark.parametrize("time", [1.0, 99.0])
def test_arm_does_not_believe_a_clock_that_stands_or_jumps(wire: tuple[EgmArm, Robot], time: float) -> None:
    arm, robot = wire
    robot.say(MESSAGE)
    arm.receive(0.0)
    robot.say(replace(MESSAGE, seqno=1, measured_time=time))
    state = arm.receive(0.004)
    assert state is not None
    assert state.dt == CYCLE


@pytest.mark.parametrize(
    ("change", "is_running"),
    [
        ({}, True),
        ({"rapid": RapidState.UNDEFINED}, True),
        ({"motors": MotorState.OFF}, False),
        ({"mci": MciState.STOPPED}, False),
        ({"mci": MciState.ERROR}, False),
        ({"rapid": RapidState.STOPPED}, False),
    ],
)
def test_arm_runs_only_with_motors_and_rapid_and_egm(
    wire: tuple[EgmArm, Robot], change: dict[str, object], is_running: bool
) -> None:
    arm, robot = wire
    for seqno in range(2):  # the first of a robot that does not follow is not answered
        robot.say(replace(MESSAGE, seqno=seqno, measured_time=1.0 + seqno * CYCLE, **change))  # type: ignore[arg-type]
        state = arm.receive(seqno * CYCLE)
    assert state is not None
    assert state.is_running is is_running


def test_arm_answers_on_the_wire(wire: tuple[EgmArm, Robot]) -> None:
    arm, robot = wire
    robot.say(MESSAGE)
    arm.receive(0.0)
    arm.reply(ArmCommand(HOME))
    assert robot.hear() == pytest.approx(HOME)


def test_arm_tells_what_its_wire_has_seen(wire: tuple[EgmArm, Robot]) -> None:
    arm, robot = wire
    for seqno, arrival in ((0, 5.0), (1, 5.004), (3, 5.013), (3, 5.014)):
        robot.say(replace(MESSAGE, seqno=seqno, measured_time=1.0 + 0.004 * seqno))
        if (state := arm.receive(arrival)) is not None:
            arm.reply(ArmCommand(HOME))
            arm.settle(state)
    wire_counters = arm.wire_counters()
    assert (wire_counters.session, wire_counters.missed, wire_counters.lost, wire_counters.repeated) == (1, 1, 1, 1)
    assert wire_counters.cycle_time == pytest.approx(0.013 / 3)
    assert wire_counters.worst_jitter == pytest.approx(0.001, abs=1e-6)


def test_arm_is_lost_once_when_the_robot_is_silent(wire: tuple[EgmArm, Robot]) -> None:
    arm, robot = wire
    robot.say(MESSAGE)
    arm.receive(1.0)
    assert arm.lost_after(1.019) is None
    assert arm.lost_after(1.021) == pytest.approx(0.021)
    assert arm.lost_after(1.03) is None


@pytest.mark.parametrize(("pause", "left"), [(CYCLE, 1), (0.1 * CYCLE, 0), (2.0 * CYCLE, 0)])
def test_arm_looks_for_a_newer_datagram_unless_the_robot_is_on_time(pause: float, left: int) -> None:
    with UdpServer("127.0.0.1", 0) as server:
        robot, arm = Sender(server), EgmArm(server, Session(), Limiter(YUMI_LIMITS))
        robot.send(0)
        arm.receive(0.0)
        for seqno in (1, 2):
            robot.send(seqno)
        arm.receive(pause)
        assert len(server.receive()) == left
        robot.close()


class Sender:
    """Sends datagrams to a real socket and waits until they are there."""

    def __init__(self, server: UdpServer) -> None:
        self._link = UdpClient("127.0.0.1", server.port)
        self._codec = RobotCodec()

    def send(self, seqno: int, *, measured: Joints = HOME) -> None:
        time = 1000.0 + seqno * CYCLE
        self._link.send(self._codec.encode(replace(MESSAGE, seqno=seqno, measured=measured, measured_time=time)))

    def send_junk(self) -> None:
        self._link.send(b"junk")

    def answers(self) -> int:
        return len(self._link.receive())

    def close(self) -> None:
        self._link.close()


def test_arm_answers_the_robot_and_never_another_port_of_its_address() -> None:
    """Loopback delivers before ``send`` returns, so nothing has to be waited for."""
    with UdpServer("127.0.0.1", 0, remote="127.0.0.1") as server:
        robot, forger = Sender(server), Sender(server)
        arm = EgmArm(server, Session(), Limiter(YUMI_LIMITS))
        answered = 0
        for seqno in range(50):
            now = seqno * CYCLE
            robot.send(seqno)
            forger.send(seqno + 1000, measured=(1.0, *HOME[1:]))
            forger.send_junk()
            while (state := arm.receive(now)) is not None:
                assert state.position == pytest.approx(HOME, abs=1e-6)
                arm.reply(ArmCommand(HOME))
                answered += 1
        assert (answered, robot.answers(), forger.answers()) == (50, 50, 0)
        assert arm.wire_counters().foreign == 2  # those that waited when the robot's first had come
        assert arm.wire_counters().malformed == 0
        robot.close()
        forger.close()


def test_arm_keeps_no_datagram_of_another_sender_that_waited_with_the_robots_first() -> None:
    kept: list[bytes] = []
    with UdpServer("127.0.0.1", 0, remote="127.0.0.1") as server:
        robot, forger = Sender(server), Sender(server)
        arm = EgmArm(server, Session(), Limiter(YUMI_LIMITS), keep=kept.append)
        for seqno in range(3):
            robot.send(seqno)
            forger.send(seqno + 1000)
        for seqno in range(3):
            if (state := arm.receive(seqno * CYCLE)) is not None:
                arm.reply(ArmCommand(HOME))
                arm.settle(state)
        assert {SensorCodec().decode(datagram).seqno for datagram in kept} <= {0, 1, 2}
        assert len(kept) >= 2
        assert arm.wire_counters().foreign == 3
        robot.close()
        forger.close()


def test_datagram_is_answered_by_the_formula_that_was_prepared_before_it_is_received() -> None:
    """Where the machine was not late: then it is received and answered as ever."""
    goals, clock = SharedBuffer(SessionGoal), SystemClock()
    goal = joints([angle + 1e-3 for angle in HOME])
    with UdpServer("127.0.0.1", 0) as server:
        robot, stages = Sender(server), StageClock(clock.now)
        arm = EgmArm(server, Session(1.0), Limiter(YUMI_LIMITS), stages)
        core, before, sampled = FallbackThread([arm]), 0, 0
        for seqno in count():
            assert core.wait(-1, CYCLE) == ((), False)
            arm.prepare(Sampled(goals.address, 0, goal), 1)
            robot.send(seqno)
            assert core.wait(-1, 1.0) == ((0,), False)
            before = robot.answers()
            stages.begin(clock.now())
            state = arm.receive(clock.now())
            assert state is not None
            sent = arm.reply(ArmCommand(goal))
            assert sent is not None
            assert before + robot.answers() == 1
            arm.settle(state)
            if before:
                sampled += 1
                assert stages.marks[: SEND_STAGE + 1] == sorted(stages.marks[: SEND_STAGE + 1])
                assert stages.marks[CYCLE_BEGIN] > 0.0
            if sampled == 20:
                break
        assert sent.position == pytest.approx(goal, abs=1e-6)
        core.close()
        robot.close()


def test_formula_that_was_prepared_in_another_session_answers_nothing() -> None:
    goals, clock = SharedBuffer(SessionGoal), SystemClock()
    with UdpServer("127.0.0.1", 0) as server:
        robot, session = Sender(server), Session(1.0)
        arm = EgmArm(server, session, Limiter(YUMI_LIMITS))
        core, sampled = FallbackThread([arm]), 0
        for seqno in count():
            assert core.wait(-1, CYCLE) == ((), False)
            is_same = seqno % 2 == 0
            arm.prepare(Sampled(goals.address, 0, HOME), 1 if is_same else 2)
            robot.send(seqno)
            assert core.wait(-1, 1.0) == ((0,), False)
            answered = robot.answers()
            assert is_same or not answered
            sampled += answered
            state = arm.receive(clock.now())
            assert state is not None
            assert state.session == 1
            assert arm.reply(ArmCommand(HOME)) is not None
            assert answered + robot.answers() == 1
            arm.settle(state)
            if sampled == 20:  # where the machine was not late
                break
        core.close()
        robot.close()


FLOOD = """
import socket, sys
flooder = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
flooder.bind(("127.0.0.2", 0))
for count in range(10**9):
    flooder.sendto(bytes(200), ("127.0.0.1", int(sys.argv[1])))
    if count == 1000:
        print("begun", flush=True)
"""


def test_arm_answers_each_datagram_of_the_robot_beside_a_flood_from_another_address() -> None:
    with UdpServer("127.0.0.1", 0, remote="127.0.0.1") as server:
        robot, arm = Sender(server), EgmArm(server, Session(), Limiter(YUMI_LIMITS))
        robot.send(0)
        assert arm.receive(0.0) is not None
        command = (sys.executable, "-c", FLOOD, str(server.port))
        with subprocess.Popen(command, stdout=subprocess.PIPE) as flooder:
            try:
                assert flooder.stdout is not None
                assert flooder.stdout.readline() == b"begun\n"
                for seqno in range(1, 400):
                    robot.send(seqno)
                    assert arm.receive(seqno * CYCLE) is not None
                    arm.reply(ArmCommand(HOME))
                    assert robot.answers() == 1
                assert flooder.poll() is None
            finally:
                flooder.kill()
        assert arm.wire_counters().foreign == 0
        robot.close()


def test_arm_hears_another_port_when_the_robot_has_fallen_silent() -> None:
    with UdpServer("127.0.0.1", 0, remote="127.0.0.1") as server:
        robot, again = Sender(server), Sender(server)
        arm = EgmArm(server, Session(), Limiter(YUMI_LIMITS))
        robot.send(0)
        assert arm.receive(0.0) is not None
        again.send(500)
        assert arm.receive(CYCLE) is None
        assert arm.lost_after(1.5) is not None
        again.send(500)
        assert arm.receive(2.0) is not None
        arm.reply(ArmCommand(HOME))
        assert (robot.answers(), again.answers()) == (0, 1)
        robot.close()
        again.close()


def test_arm_begins_with_the_robot_when_junk_of_another_sender_waits_before_it() -> None:
    with UdpServer("127.0.0.1", 0, remote="127.0.0.1") as server:
        robot, other = Sender(server), Sender(server)
        arm = EgmArm(server, Session(), Limiter(YUMI_LIMITS))
        other.send_junk()
        robot.send(0)
        other.send_junk()
        assert arm.receive(0.0) is not None
        arm.reply(ArmCommand(HOME))
        assert (robot.answers(), other.answers()) == (1, 0)
        robot.close()
        other.close()


def test_arm_keeps_the_datagram_that_it_has_answered(wire: tuple[EgmArm, Robot]) -> None:
    kept: list[bytes] = []
    ours, theirs = memory_links()
    arm, robot = EgmArm(ours, Session(), Limiter(YUMI_LIMITS), keep=kept.append), Robot(theirs)
    message = replace(MESSAGE, utilization=0.5, torque=(1.0,) * 7)
    robot.say(message)
    state = arm.receive(0.0)
    assert state is not None
    arm.reply(ArmCommand(HOME))
    assert kept == []
    arm.settle(state)
    (datagram,) = kept
    report = arm_report(Side.RIGHT, Snapshot(is_streaming=True, is_running=True, position=HOME), datagram)
    assert report.planned == pytest.approx(MESSAGE.planned, abs=1e-6)
    assert report.egm is not None
    assert (report.egm.utilization, report.egm.torque, report.egm.time) == (0.5, (1.0,) * 7, MESSAGE.measured_time)
    assert (report.egm.motors, report.egm.motion, report.egm.rapid) == ("on", "running", "running")


def test_report_names_what_the_arm_is_kept_apart_from() -> None:
    running = Snapshot(is_streaming=True, is_running=True, position=HOME)
    assert arm_report(Side.RIGHT, running).limited is None
    limited = running._replace(limited_part="right gripper", limited_other="post", limited_distance=0.0114)
    report = arm_report(Side.RIGHT, limited)
    assert report.limited == Limited("right gripper", "post", 0.0114)
    near = message("parts_near", part="right gripper", other="post", distance=0.0114)
    assert report.limited.said == near
    assert str(report.limited) == clause(near)
    assert arm_report(Side.RIGHT, limited._replace(is_streaming=False)).limited is None
