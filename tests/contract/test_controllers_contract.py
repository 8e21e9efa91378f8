"""What every arm must let every controller do: the perfect arm in memory and the virtual arm over the wire."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import radians

import pytest

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, home, joints
from controller_arms import CASES, ArmUnderTest, Case, PerfectArmUnderTest, VirtualArmUnderTest

MakeArm = Callable[[Case], ArmUnderTest]

GOAL = joints(
    [value + radians(step) for value, step in zip(home(Side.RIGHT), (20, 10, -15, 5, 30, -20, 40), strict=True)]
)


@pytest.fixture(scope="module", params=[PerfectArmUnderTest, VirtualArmUnderTest], ids=["perfect arm", "virtual arm"])
def make_arm(request: pytest.FixtureRequest) -> MakeArm:
    return request.param  # type: ignore[no-any-return]


@pytest.fixture(scope="module", params=CASES, ids=[case.name for case in CASES])
def case(request: pytest.FixtureRequest) -> Case:
    return request.param  # type: ignore[no-any-return]


@pytest.fixture
def arm(case: Case, make_arm: MakeArm) -> ArmUnderTest:
    return make_arm(case)


@pytest.fixture(scope="module")
def path(case: Case, make_arm: MakeArm) -> list[Joints]:
    """The measured positions of a motion from home to the goal."""
    return make_arm(case).go(GOAL, 6.0)


def test_arm_arrives_and_stays(path: list[Joints]) -> None:
    assert path[-1] == pytest.approx(GOAL, abs=radians(0.05))
    assert path[-100] == pytest.approx(path[-1], abs=radians(0.05))


def test_arm_starts_from_where_it_is(path: list[Joints]) -> None:
    assert path[0] == pytest.approx(home(Side.RIGHT), abs=1e-6)


def test_arm_that_has_no_goal_yet_stays(arm: ArmUnderTest) -> None:
    for position in arm.run(0.5):
        assert position == pytest.approx(home(Side.RIGHT), abs=1e-6)


def test_no_joint_is_faster_than_it_may_be(path: list[Joints]) -> None:
    for before, after in pairwise(path):
        for old, new, speed in zip(before, after, YUMI_LIMITS.velocity, strict=True):
            assert abs(new - old) <= speed * CYCLE * 1.001


def test_no_joint_accelerates_more_than_it_may(path: list[Joints]) -> None:
    for before, now, after in zip(path, path[1:], path[2:], strict=False):
        for old, middle, new, strength in zip(before, now, after, YUMI_LIMITS.acceleration, strict=True):
            assert abs(new - 2.0 * middle + old) <= 1.02 * strength * CYCLE * CYCLE


def test_joints_that_have_nowhere_to_go_stay(arm: ArmUnderTest) -> None:
    goal: Joints = (GOAL[0], *home(Side.RIGHT)[1:])
    for position in arm.go(goal, 1.0):
        assert position[1:] == pytest.approx(home(Side.RIGHT)[1:], abs=1e-6)


def test_no_joint_leaves_its_range(arm: ArmUnderTest) -> None:
    for position in arm.go(YUMI_LIMITS.upper, 4.0):
        assert all(now <= high + 1e-6 for now, high in zip(position, YUMI_LIMITS.upper, strict=True))


def test_arm_stops_and_stays_when_its_controller_is_deactivated(arm: ArmUnderTest) -> None:
    arm.go(GOAL, 0.3)
    arm.deactivate()
    path = arm.run(2.0)
    assert path[-1] == pytest.approx(path[-200], abs=1e-5)


def test_goal_from_before_the_activation_is_forgotten(arm: ArmUnderTest) -> None:
    arm.deactivate()
    arm.order(GOAL)
    arm.activate()
    assert arm.run(0.5)[-1] == pytest.approx(home(Side.RIGHT), abs=1e-6)
