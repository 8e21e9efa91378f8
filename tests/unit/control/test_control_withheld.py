"""What the limiter withheld from an arm is given up by who leads it no further; else it would follow later."""

from __future__ import annotations

import pytest

from yumi.control.collisions import CollisionLimiter
from yumi.control.controller import MemoryBuffer, write_speeds
from yumi.control.controllers.cartesian import CartesianController, ToolGoal, twist_goal
from yumi.control.controllers.joint_trajectory import CancelTrajectory
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.limiter import Limiter
from yumi.control.motion import AT_GOAL, EGM_GAIN
from yumi.control.shared_state import TrajectoryFeedback
from yumi.robot.collision import CollisionModel
from yumi.robot.description import SERVO_GRIPPERS
from yumi.robot.joints import YUMI_LIMITS, Side, home, joints
from yumi_evaluation.virtual_rig import VirtualArmRig

UPWARDS = (0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0)  # [m/s]; from home, the wrist meets the body
UP = joints([-0.27, 0.33, -0.14, 0.32, 0.08, 0.09, -0.03])  # [rad/s] about the same


def limited() -> Limiter:
    both = CollisionLimiter(CollisionModel(SERVO_GRIPPERS), YUMI_LIMITS, EGM_GAIN)
    return Limiter(YUMI_LIMITS, collisions=both.arm(Side.RIGHT))


def rests_where_it_is(rig: VirtualArmRig) -> bool:
    last = rig.cycles[-1]
    assert last.desired is not None
    assert not any(last.desired.velocity)
    return last.beyond < AT_GOAL and not rig.snapshot.limited_part


@pytest.mark.parametrize("is_cancelled", [False, True])
def test_tool_that_was_jogged_into_the_limit_stays_there_when_it_is_let_go(is_cancelled: bool) -> None:
    goals = MemoryBuffer[ToolGoal]()
    controller = CartesianController(Side.RIGHT, goals, MemoryBuffer[TrajectoryFeedback]())
    rig = VirtualArmRig({"jog": controller}, side=Side.RIGHT, limiter=limited(), position=home(Side.RIGHT))
    rig.start()
    rig.switch_to("jog")
    rig.run(0.1)
    for _ in range(200):
        goals.write(twist_goal(rig.snapshot.session, UPWARDS, time=rig.clock.now()))
        rig.cycle()
    assert rig.snapshot.limited_part == "right wrist"
    assert rig.cycles[-1].beyond > AT_GOAL
    if is_cancelled:
        rig.manager.receive("jog", CancelTrajectory(), rig.line.state)
    rig.run(2.5)
    assert rests_where_it_is(rig)


def test_joints_that_were_jogged_into_the_limit_stay_there_when_they_are_let_go() -> None:
    speeds = MemoryBuffer()
    rig = VirtualArmRig(
        {"jog": JointVelocityController(speeds)}, side=Side.RIGHT, limiter=limited(), position=home(Side.RIGHT)
    )
    rig.start()
    rig.switch_to("jog")
    rig.run(0.1)
    for _ in range(500):
        write_speeds(speeds, rig.snapshot.session, UP, rig.clock.now())
        rig.cycle()
    assert rig.snapshot.limited_part
    assert rig.cycles[-1].beyond > AT_GOAL
    rig.run(2.0)
    assert rests_where_it_is(rig)
