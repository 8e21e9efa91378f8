"""Inverse dynamics: the published estimates, rest, friction."""

from __future__ import annotations

import random

import pytest

from abb_protocols.robot.description import JOINT_FRICTION, Mass
from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, Joints, Side
from virtual_irc5.mechanics.dynamics import DRIVE_INERTIA, ArmDynamics

HALF_KILO = Mass(0.5, (0.0, 0.0, 0.05), (0.0,) * 6)


@pytest.fixture(scope="module")
def poses() -> list[Joints]:
    chance = random.Random(14000)
    ranges = list(zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True))
    return [tuple(chance.uniform(low, high) for low, high in ranges) for _ in range(6000)]


# reference/yumi.md §1.9
@pytest.mark.parametrize(
    ("payload", "published"),
    [(None, (13.9, 14.1, 5.1, 3.9, 0.28, 0.11, 0.0)), (HALF_KILO, (16.8, 16.8, 6.9, 5.5, 0.76, 0.42, 0.0))],
)
def test_holding_torque_reaches_the_published_maxima(
    poses: list[Joints], payload: Mass | None, published: Joints
) -> None:
    arm = ArmDynamics(Side.RIGHT, payload)
    highest = [max(abs(moment) for moment in joint) for joint in zip(*map(arm.torque, poses), strict=True)]
    assert highest == pytest.approx(published, rel=0.05, abs=0.01)


def test_inertia_at_the_joints_reaches_the_published_maxima(poses: list[Joints]) -> None:
    arm = ArmDynamics(Side.RIGHT, HALF_KILO, drive_inertia=ZERO_JOINTS, gravity=0.0)
    published = (0.85, 0.74, 0.21, 0.15, 0.009, 0.005)
    for index, most in enumerate(published):
        one = tuple(float(index == other) for other in range(7))
        assert max(arm.torque(pose, ZERO_JOINTS, one)[index] for pose in poses) == pytest.approx(most, rel=0.05)


def test_arm_at_rest_without_gravity_needs_no_torque(middle: Joints) -> None:
    assert ArmDynamics(Side.LEFT, HALF_KILO, gravity=0.0).torque(middle) == ZERO_JOINTS


def test_friction_is_full_when_the_joints_move_and_none_when_they_stand(middle: Joints) -> None:
    arm, smooth = ArmDynamics(Side.LEFT), ArmDynamics(Side.LEFT, friction=ZERO_JOINTS)
    moving = (0.1,) * 7
    lost = [a - b for a, b in zip(arm.torque(middle, moving), smooth.torque(middle, moving), strict=True)]
    assert lost == pytest.approx(JOINT_FRICTION)
    assert arm.torque(middle) == smooth.torque(middle)


def test_drives_add_their_inertia_to_each_joint(middle: Joints) -> None:
    arm, light = ArmDynamics(Side.LEFT), ArmDynamics(Side.LEFT, drive_inertia=ZERO_JOINTS)
    heavier, lighter = (dynamics.torque(middle, ZERO_JOINTS, (1.0,) * 7) for dynamics in (arm, light))
    added = [more - less for more, less in zip(heavier, lighter, strict=True)]
    assert added == pytest.approx(DRIVE_INERTIA)
