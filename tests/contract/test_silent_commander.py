"""Who commands an arm and falls silent: the arm brakes from the next reply on, and takes nothing that comes late."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from abb_protocols.robot.joints import CYCLE, Joints, Side, joints
from cartesian_bench import shares
from unit.robot.test_robot_kinematics import rad
from yumi.control.controller import Controller
from yumi.control.controllers.cartesian import CartesianController
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.goals import MemoryBuffer, write_goal, write_speeds
from yumi.control.loop_events import CommanderSilent
from yumi.control.shared_state import SharedDeadline
from yumi.control.tool_goal import twist_goal
from yumi_evaluation.virtual_time import VirtualArmRig

START = rad((-20, -90, 110, 10, -30, 60, -10))  # of the left arm
SPEED = 0.3  # [rad/s] of the stream
SILENCE = 0.2
NAME = "controller"


class Stream:
    """An arm that follows a stream of one kind.

    Attributes:
        rig: the arm.
        sent: the positions of each cycle.
    """

    def __init__(self, kind: str) -> None:
        self.buffer = MemoryBuffer()
        controller: Controller
        if kind == "tool":
            controller = CartesianController(Side.LEFT, self.buffer, MemoryBuffer())
        elif kind == "speeds":
            controller = JointVelocityController(self.buffer)
        else:
            controller = JointPositionController(self.buffer)
        self.rig = VirtualArmRig({NAME: controller}, position=START)
        if kind == "feed forward":
            self.rig.manager.set_parameters(NAME, {"tracking.feed_forward": True})
        self.rig.start()
        self.rig.run(0.5)
        self.rig.switch_to(NAME)
        self.begin = self.rig.clock.now()
        self.write: Callable[[], None] = {"tool": self._tool, "speeds": self._speeds}.get(kind, self._positions)

    @property
    def sent(self) -> np.ndarray:
        return np.array([cycle.sent.position for cycle in self.rig.cycles])

    @property
    def references(self) -> np.ndarray:
        """Positions and speeds that were sent in each cycle."""
        return np.array([(*cycle.sent.position, *cycle.sent.velocity) for cycle in self.rig.cycles])

    def _goal(self) -> Joints:
        return joints([value + SPEED * (self.rig.clock.now() - self.begin) for value in START])

    def _positions(self) -> None:
        write_goal(self.buffer, self.rig.snapshot.session, self._goal(), time=self.rig.clock.now())

    def _speeds(self) -> None:
        write_speeds(self.buffer, self.rig.snapshot.session, joints([SPEED] * 7), self.rig.clock.now())

    def _tool(self) -> None:
        goal = twist_goal(self.rig.snapshot.session, (0.0, 0.0, -0.1, 0.0, 0.0, 0.0, 0.0))
        self.buffer.write(goal._replace(time=self.rig.clock.now()))

    def go_on(self, seconds: float, *, is_heard: bool) -> None:
        """Stream for a time [s]; whether who commands is heard meanwhile."""
        for _ in range(round(seconds / CYCLE)):
            self.write()
            if is_heard:
                snapshot = self.rig.snapshot
                self.rig.deadline.write(SharedDeadline(self.rig.clock.now(), SILENCE, snapshot.activation))
            self.rig.cycle()


@pytest.mark.parametrize("kind", ["positions", "feed forward", "speeds", "tool"])
def test_arm_brakes_from_the_next_reply_on_and_stands_soon_whatever_comes_late(kind: str) -> None:
    stream, heard_on = Stream(kind), Stream(kind)
    for each in (stream, heard_on):
        each.go_on(1.0, is_heard=True)
    heard = stream.rig.clock.now() - CYCLE  # as the deadline has it
    stream.go_on(1.0, is_heard=False)
    heard_on.go_on(1.0, is_heard=True)
    assert not any(isinstance(event, CommanderSilent) for event in heard_on.rig.events)
    (silent,) = (event for event in stream.rig.events if isinstance(event, CommanderSilent))
    assert SILENCE < silent.silence <= SILENCE + CYCLE + 1e-9

    times = np.array([cycle.state.time for cycle in stream.rig.cycles])
    speeds = np.array([np.abs(cycle.state.velocity).max() for cycle in stream.rig.cycles])
    first = int(np.searchsorted(times, heard + SILENCE + 1e-9))  # the first reply after the timeout
    assert speeds[first] > 0.1
    differs = np.abs(stream.references - heard_on.references).max(axis=1) > 1e-12
    assert int(np.argmax(differs)) == first
    still = speeds[int(np.searchsorted(times, heard + SILENCE + 0.2)) :]
    assert still.max() < 0.01  # [rad/s] it stands 0.2 s later, and no late goal moves it
    assert max(shares(stream.sent)) <= 1.0 + 1e-5


def test_deadline_of_controllers_before_ends_no_later_ones() -> None:
    stream = Stream("positions")
    stream.go_on(0.5, is_heard=True)
    stream.rig.switch_to(NAME)
    stream.go_on(1.0, is_heard=False)
    assert not any(isinstance(event, CommanderSilent) for event in stream.rig.events)
