from __future__ import annotations

from dataclasses import replace

import pytest

from yumi.egm.codec import RobotCodec
from yumi.egm.joint_codec import JointCodec
from yumi.egm.messages import MciState, MotorState, RapidState, RobotMessage
from yumi.egm.session import SensorSession
from yumi.hardware.egm_arm import EgmArm
from yumi.links.memory import MemoryLink, memory_links
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Joints
from yumi.robot.values import ZERO, ArmCommand

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
    return EgmArm(ours, SensorSession(JointCodec())), Robot(theirs)


def test_arm_has_no_state_before_the_robot_speaks(wire: tuple[EgmArm, Robot]) -> None:
    arm, _ = wire
    assert arm.read(0.0) is None


def test_arm_reports_position_and_zero_velocity_at_first(wire: tuple[EgmArm, Robot]) -> None:
    arm, robot = wire
    robot.say(MESSAGE)
    state = arm.read(5.0)
    assert state is not None
    assert state.position == pytest.approx(HOME, abs=1e-6)
    assert (state.time, state.dt, state.session, state.velocity) == (5.0, 0.0, 1, ZERO)


def test_arm_derives_velocity_by_the_robots_own_clock(wire: tuple[EgmArm, Robot]) -> None:
    arm, robot = wire
    robot.say(MESSAGE)
    arm.read(0.0)
    robot.say(replace(MESSAGE, seqno=1, measured=(0.01, *HOME[1:]), measured_time=1.0 + CYCLE))
    state = arm.read(0.01)
    assert state is not None
    assert state.dt == pytest.approx(CYCLE, abs=1e-6)
    assert state.velocity[0] == pytest.approx(0.01 / CYCLE, rel=1e-3)


@pytest.mark.parametrize("time", [1.0, 0.5, 99.0])
def test_arm_does_not_believe_a_clock_that_stands_or_jumps(wire: tuple[EgmArm, Robot], time: float) -> None:
    arm, robot = wire
    robot.say(MESSAGE)
    arm.read(0.0)
    robot.say(replace(MESSAGE, seqno=1, measured_time=time))
    state = arm.read(0.004)
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
    robot.say(replace(MESSAGE, **change))  # type: ignore[arg-type]
    state = arm.read(0.0)
    assert state is not None
    assert state.is_running is is_running


def test_arm_answers_on_the_wire(wire: tuple[EgmArm, Robot]) -> None:
    arm, robot = wire
    robot.say(MESSAGE)
    arm.read(0.0)
    arm.write(ArmCommand(HOME))
    assert robot.hear() == pytest.approx(HOME)


def test_arm_tells_what_its_wire_has_seen(wire: tuple[EgmArm, Robot]) -> None:
    arm, robot = wire
    for seqno, arrival in ((0, 5.0), (1, 5.004), (3, 5.013), (3, 5.014)):
        robot.say(replace(MESSAGE, seqno=seqno, measured_time=1.0 + 0.004 * seqno))
        if arm.read(arrival) is not None:
            arm.write(ArmCommand(HOME))
    wire_counters = arm.wire_counters()
    assert (wire_counters.session, wire_counters.missed, wire_counters.lost, wire_counters.repeated) == (1, 1, 1, 1)
    assert wire_counters.cycle_time == pytest.approx(0.013 / 3)
    assert wire_counters.worst_jitter == pytest.approx(0.001, abs=1e-6)


def test_arm_is_lost_once_when_the_robot_is_silent(wire: tuple[EgmArm, Robot]) -> None:
    arm, robot = wire
    robot.say(MESSAGE)
    arm.read(1.0)
    assert arm.lost_after(1.019) is None
    assert arm.lost_after(1.021) == pytest.approx(0.021)
    assert arm.lost_after(1.03) is None


@pytest.mark.parametrize(("pause", "left"), [(CYCLE, 1), (0.1 * CYCLE, 0), (2.0 * CYCLE, 0)])
def test_arm_looks_for_a_newer_datagram_unless_the_robot_is_on_time(pause: float, left: int) -> None:
    ours, theirs = memory_links()
    arm, robot = EgmArm(ours, SensorSession(JointCodec())), Robot(theirs)
    robot.say(MESSAGE)
    arm.read(0.0)
    for seqno in (1, 2):
        robot.say(replace(MESSAGE, seqno=seqno, measured_time=1.0 + seqno * CYCLE))
    arm.read(pause)
    assert len(ours.receive()) == left
