"""The path of RAPID's moves, where a move is so short that its samples are one place."""

from __future__ import annotations

import pytest

from abb_protocols.robot.joints import Joints, Side
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.path_geometry import STOP_CORNER, LegFrames, LegSpeed, joint_leg


@pytest.mark.parametrize(
    "offset", [0.0, *(digits * 10.0**-power for power in range(6, 13) for digits in (1.0, 2.0, 5.0))]
)
def test_move_to_where_the_arm_nearly_is_can_be_planned(offset: float) -> None:
    arm = VirtualArm(Side.LEFT)
    end: Joints = tuple(angle + offset for angle in arm.planned)
    leg = joint_leg(arm.kinematics, arm.planned, end, LegFrames(), LegSpeed(tool=0.1), STOP_CORNER)
    passage = arm.path.append(leg)
    assert 0.0 <= passage.end < 1e-4
