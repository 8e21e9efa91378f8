"""What controllers under test are given: states of an arm, parameters, and goals."""

from __future__ import annotations

from typing import TypeVar

from abb_protocols.robot.joints import CYCLE, ZERO_JOINTS, ArmState, Joints, Side, joint_names, joints
from abb_runtime.parameters import Value
from yumi.control.controller import Controller
from yumi.control.goals import GoalBuffer, SessionGoal

AnyController = TypeVar("AnyController", bound=Controller)

JOINTS = joint_names(Side.RIGHT)


def state(
    position: Joints,
    *,
    time: float = 2.5,
    session: int = 1,
    velocity: Joints = ZERO_JOINTS,
    planned: Joints | None = None,
) -> ArmState:
    """A running arm, one cycle after the state before."""
    return ArmState(time, CYCLE, session, position, velocity, planned or position, is_running=True)


def configured(controller: AnyController, **values: Value) -> AnyController:
    """The controller with its default parameters but for ``values``."""
    defaults = {parameter.name: parameter.default for parameter in controller.parameters(JOINTS)}
    assert not values.keys() - defaults.keys()
    controller.configure({**defaults, **values})
    return controller


def moved(position: Joints, index: int, by: float) -> Joints:
    """``position`` with one joint elsewhere."""
    return joints([value + by * (place == index) for place, value in enumerate(position)])


def read_goal(buffer: GoalBuffer, session: int) -> tuple[int, SessionGoal | None]:
    """The number of the newest goal, and the goal; None when it is not meant for ``session``."""
    newest = buffer.read()
    if newest is None:
        return 0, None
    number, goal = newest
    return number, goal if goal.session == session else None
