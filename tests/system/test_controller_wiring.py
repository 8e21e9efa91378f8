"""Each delivered controller, made as the driver makes it, takes the goals of its own mailbox."""

from __future__ import annotations

import pytest

from controller_states import moved
from yumi.control.controller import GoalKind, write_goal
from yumi.control.limiter import SpeedScale
from yumi.driver.control_process import ArmBuffers
from yumi.driver.settings import read_controllers
from yumi.driver.wiring import CONTROLLER_KINDS, Place
from yumi.robot.joints import CYCLE, YUMI_LIMITS, ZERO, Side
from yumi_evaluation.virtual_rig import VirtualArmRig

SIDE = Side.LEFT


@pytest.mark.parametrize(
    ("name", "box", "kind"),
    [
        ("joint_position_controller", "goals", GoalKind.POSITION),
        ("joint_velocity_controller", "speeds", GoalKind.VELOCITY),
        ("forward_position_controller", "forward_positions", GoalKind.FORWARD_POSITION),
        ("forward_velocity_controller", "forward_speeds", GoalKind.FORWARD_VELOCITY),
    ],
)
def test_delivered_controller_takes_the_goals_of_its_mailbox(name: str, box: str, kind: GoalKind) -> None:
    kinds = {entry.name: entry.kind for entry in read_controllers(SIDE)}
    buffers = ArmBuffers()
    place = Place(name, SIDE, buffers, ArmBuffers(), YUMI_LIMITS, CYCLE, SpeedScale(buffers.speed_scale))
    arm = VirtualArmRig({name: CONTROLLER_KINDS[kinds[name]](place)}, side=SIDE)
    arm.start()
    arm.switch_to(name)
    start = arm.robot.arm.planned
    assert arm.snapshot.goal_kind is GoalKind.NONE
    arm.cycle()
    assert arm.snapshot.goal_kind is kind
    write_goal(getattr(buffers, box), 1, moved(start, 6, 0.3), moved(ZERO, 6, 0.3))
    arm.run(0.2)
    assert arm.robot.arm.planned[6] > start[6] + 0.02
