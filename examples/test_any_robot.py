"""Tests of RAPID for an IRB 120, without a robot: where virtual-irc5 is installed, pytest finds both fixtures."""

from math import radians
from pathlib import Path

import pytest

from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import ControllerState
from abb_runtime.rws.client import RwsClient
from virtual_irc5.commands.check import check_program
from virtual_irc5.testing.controller_process import ControllerProcess
from virtual_irc5.testing.virtual_robot import VirtualRobot

PROGRAM = Path(__file__).with_name("six_axes.mod")
GOAL = tuple(map(radians, (20, 10, -10, 15, 40, 25)))


def test_program_has_no_error() -> None:
    assert check_program([PROGRAM], robot="irb120") == []


@pytest.mark.virtual_robot(model="irb120", programs={"T_ROB1": [PROGRAM]})
def test_program_moves_the_arm_in_virtual_time(virtual_robot: VirtualRobot) -> None:
    virtual_robot.start_rapid(once=True)
    virtual_robot.wait(5.0)
    assert not virtual_robot.is_running
    assert virtual_robot.written == [("T_ROB1", "arrived")]
    assert virtual_robot.world.arms[Side.RIGHT].position == pytest.approx(GOAL, abs=0.001)


@pytest.mark.abb_controller(model="irb120", program=f"T_ROB1={PROGRAM}")
def test_client_switches_the_motors_on_in_real_time(abb_controller: ControllerProcess) -> None:
    with RwsClient(abb_controller.address) as client:
        client.set_motors(True)
        assert client.controller_state() is ControllerState.MOTORS_ON
