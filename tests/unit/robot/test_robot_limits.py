from __future__ import annotations

from math import radians

from yumi.robot.joints import YUMI_LIMITS


def test_joints_can_be_slowed_down_together() -> None:
    slow = YUMI_LIMITS.slowed_to(radians(200.0))
    assert slow.velocity == (*YUMI_LIMITS.velocity[:4], *(radians(200.0),) * 3)
    assert slow.acceleration == YUMI_LIMITS.acceleration
