"""The fixture ``virtual_robot``: any ABB robot in memory, with the RAPID of a user, which no driver moves."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from math import radians
from pathlib import Path

import pytest

from abb_protocols.errors import SettingsError
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import ControllerState
from abb_runtime.clock import comes_true
from virtual_irc5.testing.virtual_robot import VirtualRobot, virtual_robot_settings

PROGRAM = Path(__file__).parents[3] / "examples" / "six_axes.mod"
GOAL = tuple(map(radians, (20, 10, -10, 15, 40, 25)))


@pytest.mark.virtual_robot(model="irb120", programs={"T_ROB1": [PROGRAM]})
def test_program_of_six_axes_moves_the_arm_and_ends(virtual_robot: VirtualRobot) -> None:
    assert not virtual_robot.is_running
    virtual_robot.start_rapid(once=True)
    assert comes_true(virtual_robot, lambda: not virtual_robot.is_running, timeout=10.0)
    assert virtual_robot.world.arms[Side.RIGHT].position == pytest.approx(GOAL, abs=1e-3)
    assert virtual_robot.written == [("T_ROB1", "arrived")]
    assert virtual_robot.now() > 0.2  # [s]: the arm has moved no faster than a robot


@pytest.mark.virtual_robot(model="irb120", programs={"T_ROB1": [PROGRAM]})
def test_requests_of_other_threads_are_answered_between_two_cycles(virtual_robot: VirtualRobot) -> None:
    """Else a request in the middle of an instruction starts RAPID while RAPID runs."""
    answered: list[bool] = []
    with ThreadPoolExecutor(1) as other:

        def note(task: str, line: str) -> None:
            answered.append(other.submit(virtual_robot.rws.lock.acquire, blocking=False).result())

        virtual_robot.world.controller.execution.installed["T_ROB1"].host.show = note
        virtual_robot.start_rapid(once=True)
        assert comes_true(virtual_robot, lambda: not virtual_robot.is_running, timeout=10.0)
        assert answered == [False]  # the program shows one line
        assert other.submit(virtual_robot.rws.lock.acquire, blocking=False).result()


@pytest.mark.virtual_robot(model="irb14050", robot_name="Cell_7")
def test_mark_chooses_model_and_settings_together(virtual_robot: VirtualRobot) -> None:
    assert virtual_robot.egm.keys() == {Side.RIGHT}
    assert len(virtual_robot.world.arms[Side.RIGHT].position) == 7
    with virtual_robot.client() as client:
        assert client.controller_state() is ControllerState.MOTORS_OFF
        assert client.system().name == "Cell_7"


def test_robot_without_a_mark_is_a_yumi(virtual_robot: VirtualRobot) -> None:
    assert virtual_robot.egm.keys() == set(Side)


def test_program_for_a_task_that_is_not_there_is_refused() -> None:
    with pytest.raises(SettingsError, match="no task T_ROB_R; there are T_ROB1"):
        virtual_robot_settings("irb120", {"T_ROB_R": [PROGRAM]})
