"""What a page's plans know of the driver, and the process that makes them."""

from __future__ import annotations

import asyncio

import msgspec
import pytest

from abb_protocols.robot.joints import YUMI_LIMITS, Pose, Side, home
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION
from yumi.driver.surroundings import Surroundings, SurroundingsBox, SurroundingsTool, limits_of, shapes_of
from yumi.planning.planner import Plan
from yumi.planning.planning_process import PlanningProcess


def test_motions_are_planned_for_the_speeds_that_the_driver_allows() -> None:
    slow = YUMI_LIMITS.slowed_to(0.5)
    assert limits_of(Surroundings(velocity=slow.velocity)) == slow
    assert limits_of(Surroundings()) == YUMI_LIMITS


def test_process_plans_for_what_the_driver_has_told() -> None:
    pytest.importorskip("roboplan", reason="needs yumi-ros2[planning]")
    told = msgspec.json.encode(
        Surroundings(
            tools={"right": (SurroundingsTool(name="pen", start=(0.0, 0.0, 0.1), end=(0.0, 0.0, 0.15), radius=0.005),)},
            boxes=(SurroundingsBox(name="far", pose=Pose((1.5, 0.0, 0.0), IDENTITY_QUATERNION), size=(0.1, 0.1, 0.1)),),
        )
    )
    start = {side: home(side) for side in Side}
    goals = [(start[Side.RIGHT][0] + turn, *start[Side.RIGHT][1:]) for turn in (0.1, 0.2)]

    async def make() -> list[Plan]:
        process = PlanningProcess()
        try:
            plans = []
            for goal in goals:
                surroundings = msgspec.json.decode(told, type=Surroundings)
                grippers, tools, obstacles = shapes_of(surroundings)
                plans.append(
                    await process.plan(
                        start,
                        {Side.RIGHT: goal},
                        timeout=20.0,
                        speed_scale=0.5,
                        grippers=grippers,
                        tools=tools,
                        obstacles=obstacles,
                        limits=limits_of(surroundings),
                    )
                )
            return plans
        finally:
            process.close()

    ends = [plan.points[Side.RIGHT][-1].position for plan in asyncio.run(make())]
    assert ends == [pytest.approx(goal) for goal in goals]
