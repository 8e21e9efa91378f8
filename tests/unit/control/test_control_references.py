"""Which command a robot follows, of those that were sent."""

from __future__ import annotations

from math import exp

import pytest

from yumi.control.motion import EGM_GAIN
from yumi.control.references import LOST_AFTER, ReferenceMonitor
from yumi.robot.joints import CYCLE, YUMI_LIMITS, ZERO, ArmCommand, ArmState, Joints, joints

STEP = 0.008  # [rad] a command goes on in a cycle
LATE = 8  # cycles


def command(angle: float) -> ArmCommand:
    return ArmCommand(joints([angle, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))


class Robot:
    """A robot that follows the command it is given, and a monitor that sees its plan."""

    def __init__(self) -> None:
        self.monitor = ReferenceMonitor(EGM_GAIN, YUMI_LIMITS.velocity)
        self._state = ArmState(0.0, 0.0, 1, ZERO, ZERO, ZERO, is_running=True)
        self.monitor.begin(self._state, command(0.0))

    def cycle(self, followed: ArmCommand, sent: ArmCommand) -> None:
        left = exp(-EGM_GAIN * CYCLE)
        rows = zip(followed.position, self._state.planned, strict=True)
        planned: Joints = joints([goal - (goal - now) * left for goal, now in rows])
        state = self._state._replace(time=self._state.time + CYCLE, dt=CYCLE, position=planned, planned=planned)
        self.monitor.compare(state)
        self.monitor.observe(state, sent, is_valid=True, is_at_rest=False, is_waiting=False)
        self._state = state


@pytest.mark.parametrize("late", [1, LATE])
def test_robot_that_follows_each_command_some_cycles_late_repeats_none(late: int) -> None:
    robot = Robot()
    sent = [command(STEP * index) for index in range(100)]
    for index in range(1, 100):
        robot.cycle(sent[max(0, index - late)], sent[index])
        if index > 2 * LATE:
            assert not robot.monitor.is_repeating


def test_robot_repeats_a_command_after_more_cycles_where_each_command_shows_late() -> None:
    robot = Robot()
    sent = [command(STEP * index) for index in range(100)]
    for index in range(1, 50):
        robot.cycle(sent[max(0, index - LATE)], sent[index])
    for index in range(50, 50 + LOST_AFTER):
        robot.cycle(sent[49 - LATE], sent[index])
        assert not robot.monitor.is_repeating
    for index in range(50 + LOST_AFTER, 50 + LOST_AFTER + LATE):
        robot.cycle(sent[49 - LATE], sent[index])
    assert robot.monitor.is_repeating


def test_plan_that_looks_now_like_one_of_two_old_commands_now_like_the_other_shows_no_new_one() -> None:
    robot = Robot()
    sent = [command(STEP * index) for index in range(30)]
    for index in range(1, 20):
        robot.cycle(sent[index - 1], sent[index])
    followed, near = STEP * 19, command(STEP * 19 + 4.4e-4)  # nearly as alike as commands are that make the same
    for each in (*sent[20:28], *reversed(sent[20:28]), near, *sent[20:30]):  # they go on, come back, and go on
        for noise in (5e-5, -5e-5):
            robot.cycle(command(followed + noise), each)
    assert robot.monitor.is_repeating
