"""Tests of robot programs without a robot: where yumi-ros2 is installed, pytest finds both fixtures by itself."""

import pytest

import yumi
from abb_protocols.robot.joints import CYCLE, Side
from virtual_irc5.testing.controller_process import ControllerProcess
from yumi.egm.joint_codec import JointCodec
from yumi.testing.virtual_yumi import VirtualYumi

GOAL = yumi.degrees(20, -110, -135, 30, 0, 40, 0)


@pytest.mark.abb_controller(calibrated=True)
def test_arm_arrives_in_real_time(abb_controller: ControllerProcess) -> None:
    with yumi.connect(**abb_controller.connect_options) as robot:
        robot.right.move_to(GOAL)
        assert robot.right.position == pytest.approx(GOAL, abs=0.002)


def test_arm_follows_my_egm_loop_in_virtual_time(virtual_yumi: VirtualYumi) -> None:
    virtual_yumi.start_egm()
    codec, arm = JointCodec(), virtual_yumi.egm[Side.LEFT]
    start = goal = virtual_yumi.world.arms[Side.LEFT].position
    for _ in range(500):
        virtual_yumi.wait(CYCLE)
        for datagram in arm.receive():  # what a UDP socket would have received
            seqno = codec.decode(datagram).seqno
            goal = (start[0] + min(0.001 * seqno, 0.3), *start[1:])  # a quarter of a radian a second
            arm.send(codec.encode_joints(seqno, goal, None))
    assert virtual_yumi.world.arms[Side.LEFT].position == pytest.approx(goal, abs=0.002)
