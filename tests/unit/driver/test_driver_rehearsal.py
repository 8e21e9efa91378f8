from __future__ import annotations

from collections.abc import Iterator

import pytest

from yumi.clock import ManualClock
from yumi.control.controller_manager import ControllerManager
from yumi.control.limiter import Limiter
from yumi.driver.arm import CYCLE, EgmArm
from yumi.driver.control_process import Rehearsal
from yumi.egm.codec import JointCodec, RobotCodec
from yumi.egm.messages import MciState, MotorState, RapidState, RobotMessage
from yumi.egm.session import SensorSession
from yumi.egm.udp import UdpClient, UdpServer
from yumi.robot.joints import YUMI_LIMITS, Joints, Side, joint_names

HOME: Joints = (0.0, -2.0, 1.0, 0.5, 0.0, 0.7, 0.0)


class Stage:
    """A robot that speaks, and a stand-in for the arm that hears it."""

    def __init__(self, heard: UdpServer, stand_in: UdpServer) -> None:
        self.clock = ManualClock()
        self.heard = heard
        self.robot = UdpClient("127.0.0.1", heard.port)
        self.session = SensorSession(JointCodec())
        manager = ControllerManager(joint_names(Side.RIGHT))
        arm = EgmArm(stand_in, self.session)
        self.rehearsal = Rehearsal(heard, stand_in, arm, manager, Limiter(YUMI_LIMITS), self.clock)

    def say(self, seqno: int) -> None:
        running = (MotorState.ON, MciState.RUNNING, RapidState.RUNNING)
        message = RobotMessage(seqno, 0, HOME, HOME, None, None, seqno * CYCLE, 1.0, *running, False)
        self.robot.send(RobotCodec().encode(message))
        self.heard.receive()


@pytest.fixture
def stage() -> Iterator[Stage]:
    with UdpServer("127.0.0.1", 0) as heard, UdpServer("127.0.0.1", 0) as stand_in:
        stage = Stage(heard, stand_in)
        yield stage
        stage.robot.close()
        stage.rehearsal.close()


def test_nothing_is_rehearsed_before_the_robot_spoke(stage: Stage) -> None:
    stage.rehearsal.run()
    assert stage.session.counters.received == 0


def test_rehearsal_answers_what_the_robot_said_last_and_the_robot_hears_nothing(stage: Stage) -> None:
    for seqno in range(3):
        stage.say(seqno)
        stage.rehearsal.run()
        stage.clock.advance(CYCLE)
    assert (stage.session.counters.received, stage.session.next_seqno()) == (3, 3)
    assert stage.robot.receive() == []
