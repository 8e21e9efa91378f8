"""The formula that a controller gives the core is what it commands itself."""

from __future__ import annotations

from ctypes import string_at
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.robot.joints import CYCLE, ZERO_JOINTS, ArmState, Joints, Side, joint_names
from abb_runtime.parameters import Values
from yumi.control.controller import Controller, Sampled
from yumi.control.controllers.forward_command import JointGroupPositionController, JointGroupVelocityController
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.goals import MemoryBuffer, SessionGoal, write_goal
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.shared_memory import SharedBuffer
from yumi.core.library import SHARED_GOAL

STATE = ArmState(1.0, CYCLE, 2, ZERO_JOINTS, ZERO_JOINTS, ZERO_JOINTS, is_running=True)
POSITIONS = st.tuples(*[st.floats(-0.5, 0.5)] * 7)
NAME = "controller"


class Derived(JointPositionController):
    """Of a user, who commands something else with the same goals."""


def managed(controller: Controller, values: Values | None = None) -> ControllerManager:
    """With this controller active, at ``STATE``."""
    manager = ControllerManager(joint_names(Side.RIGHT))
    manager.load(NAME, controller)
    manager.set_parameters(NAME, values or {})
    manager.configure(NAME)
    manager.switch((NAME,), (), STATE)
    return manager


def position(sampled: Sampled, goals: SharedBuffer[SessionGoal], state: ArmState) -> Joints:
    """As ``core/sampled.hpp`` has it."""
    newest = goals.read()
    is_new = newest is not None and newest[0] != sampled.taken and newest[1].session == state.session
    goal = newest[1].position if newest is not None and is_new else sampled.goal
    if sampled.gains is None:
        return goal
    rows = zip(state.position, goal, sampled.gains, strict=True)
    return tuple([now + gain * (to - now) for now, to, gain in rows])  # type: ignore[return-value]


@pytest.mark.parametrize("forwards", [False, True])
@given(cycles=st.lists(st.tuples(POSITIONS, st.none() | st.tuples(st.integers(1, 3), POSITIONS)), max_size=6))
def test_formula_is_what_the_controller_commands(
    forwards: bool, cycles: list[tuple[Joints, tuple[int, Joints] | None]]
) -> None:
    goals = SharedBuffer(SessionGoal)
    controller: Controller = JointPositionController(goals)
    if forwards:
        controller = JointGroupPositionController(goals, SharedBuffer(SessionGoal))
    manager = managed(controller)
    for place, goal in cycles:
        sampled, state = manager.sampled, STATE._replace(position=place)
        if goal is not None:
            write_goal(goals, *goal)
        command = manager.update(state)
        assert sampled is None or (command is not None and position(sampled, goals, state) == command.position)
        assert sampled is not None or forwards  # which holds until its first goal


def shared(kind: type[JointPositionController] = JointPositionController) -> JointPositionController:
    return kind(SharedBuffer(SessionGoal))


@pytest.mark.parametrize(
    ("controller", "values"),
    [
        (shared(), {"i": 0.1}),
        (shared(), {"d": 0.01}),
        (shared(), {"gains.yumi_joint_1_r.d": 0.01}),
        (shared(), {"tracking.feed_forward": True}),
        (shared(Derived), {}),
        (JointPositionController(MemoryBuffer()), {}),
        (JointGroupPositionController(SharedBuffer(SessionGoal), SharedBuffer(SessionGoal)), {}),
        (JointGroupVelocityController(SharedBuffer(SessionGoal), SharedBuffer(SessionGoal)), {}),
    ],
    ids=["integral", "derivative", "of a joint", "prediction", "derived", "in memory", "no goal yet", "speeds"],
)
def test_controller_that_is_not_so_simple_is_asked_itself(controller: Controller, values: dict[str, Any]) -> None:
    assert managed(controller, values).sampled is None


def test_formula_ends_with_the_controllers_activity() -> None:
    manager = managed(shared())
    assert manager.sampled is not None
    manager.deactivate_commanding()
    assert manager.sampled is None


def test_goals_lie_in_shared_memory_as_the_core_reads_them() -> None:
    goals = SharedBuffer(SessionGoal)
    goal = SessionGoal(2, 3.0, (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7), (1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7), 0.5)
    goals.write(goal)
    written = SHARED_GOAL.unpack(string_at(goals.address, SHARED_GOAL.size))
    assert written == (1, 1, goal.session, goal.time, goal.delay, *goal.position, *goal.velocity)
