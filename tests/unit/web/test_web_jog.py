"""Jogging the tool: the speeds of the joints are followed, and where the fingertips get to is looked at."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest

from yumi.errors import CommandRefused
from yumi.robot.inverse_kinematics import arm_angle
from yumi.robot.joints import YUMI_LIMITS, Joints, Side, Vector, joints, named_pose
from yumi.robot.kinematics import matrix
from yumi.web.jog import MAX_JOINT_SPEED, Frame, ToolJog, fingertips

STEP = 1.0 / 30.0
STILL: Vector = (0.0, 0.0, 0.0)


def follow(jog: ToolJog, position: Joints, seconds: float) -> Joints:
    """Where the arm gets to when the jog is asked thirty times a second."""
    for _ in range(round(seconds / STEP)):
        speeds = jog.speeds(position)
        assert max(map(abs, speeds)) <= MAX_JOINT_SPEED + 1e-9
        position = joints([value + STEP * speed for value, speed in zip(position, speeds, strict=True)])
    return position


def turned(side: Side, start: Joints, end: Joints) -> float:
    """By how much the tool has turned [rad]."""
    before, after = (matrix(fingertips(side, each).orientation) for each in (start, end))
    return float(np.arccos(np.clip((np.trace(after @ before.T) - 1.0) / 2.0, -1.0, 1.0)))


@pytest.mark.parametrize("side", list(Side))
@pytest.mark.parametrize("frame", ["base", "tool"])
@pytest.mark.parametrize("direction", [(0.0, 0.0, 0.1), (0.08, 0.0, 0.0), (0.0, -0.05, 0.0)])
def test_tool_goes_along_a_line_and_does_not_turn(side: Side, frame: Frame, direction: Vector) -> None:
    start = named_pose(side, "ready")
    end = follow(ToolJog(side, start, frame, direction, STILL), start, 0.6)
    axes = matrix(fingertips(side, start).orientation) if frame == "tool" else np.eye(3)
    moved = np.array(fingertips(side, end).position) - np.array(fingertips(side, start).position)
    assert moved == pytest.approx(0.6 * axes @ np.array(direction), abs=1.5e-3)
    assert turned(side, start, end) < radians(0.3)


def test_tool_turns_about_its_fingertips() -> None:
    start = named_pose(Side.RIGHT, "ready")
    end = follow(ToolJog(Side.RIGHT, start, "tool", STILL, (0.0, 0.0, 0.5)), start, 0.8)
    assert turned(Side.RIGHT, start, end) == pytest.approx(0.4, abs=0.01)
    assert fingertips(Side.RIGHT, end).position == pytest.approx(fingertips(Side.RIGHT, start).position, abs=1e-3)


@pytest.mark.parametrize("speed", [0.4, -0.4])
def test_elbow_moves_while_the_tool_stands(speed: float) -> None:
    start = named_pose(Side.RIGHT, "ready")
    end = follow(ToolJog(Side.RIGHT, start, "base", STILL, STILL, speed), start, 1.0)
    assert fingertips(Side.RIGHT, end).position == pytest.approx(fingertips(Side.RIGHT, start).position, abs=1e-3)
    assert turned(Side.RIGHT, start, end) < radians(0.3)
    assert abs(arm_angle(Side.RIGHT, end) - arm_angle(Side.RIGHT, start)) > 0.1


def test_jog_of_the_tool_ends_where_a_joint_does() -> None:
    start = named_pose(Side.RIGHT, "ready")
    jog = ToolJog(Side.RIGHT, start, "base", (0.0, 0.0, -0.2), STILL)
    with pytest.raises(CommandRefused, match=r"axis \d of the right arm is at the end of its range"):
        follow(jog, start, 20.0)


def test_joints_are_not_fast_where_the_arm_is_singular() -> None:
    stretched = joints([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert YUMI_LIMITS.outside(stretched) is None
    assert max(map(abs, ToolJog(Side.RIGHT, stretched, "base", (0.2, 0.0, 0.0), STILL).speeds(stretched))) <= 1.0
