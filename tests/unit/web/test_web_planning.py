"""What the page's planner knows of the driver."""

from __future__ import annotations

import msgspec
import pytest

from yumi.driver.endpoint import Surroundings
from yumi.robot.joints import YUMI_LIMITS
from yumi.web.live import _planner


def test_motions_are_planned_for_the_speeds_that_the_driver_allows() -> None:
    pytest.importorskip("roboplan", reason="needs yumi-ros2[planning]")
    slow = YUMI_LIMITS.slowed_to(0.5)
    assert _planner(msgspec.json.encode(Surroundings(velocity=slow.velocity))).limits == slow
    assert _planner(msgspec.json.encode(Surroundings())).limits == YUMI_LIMITS
