"""Jogging the tool: joint speeds that move the fingertips along a line, about an axis, or the elbow alone.

Speeds come from the Jacobian where the arm stands, thirty times a second. What a line must not do, turn the tool or
leave the line, is measured from where the jog began and taken back, so that errors do not add up.
"""

from __future__ import annotations

from math import radians
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from yumi.errors import CommandRefused
from yumi.robot.description import FINGERTIPS
from yumi.robot.inverse_kinematics import jacobian
from yumi.robot.joints import CHAIN_AXES, YUMI_LIMITS, Joints, Pose, Side, Vector, joints
from yumi.robot.kinematics import compose, matrix, tool0_to_body

MAX_JOINT_SPEED = 1.0
"""No joint is jogged faster than this [rad/s], before speed_scale."""

MAX_LINEAR, MAX_ANGULAR = 0.2, 1.0
"""The tool is not jogged faster than this [m/s], [rad/s], before speed_scale."""

Frame = Literal["base", "tool"]

_CORRECTION = 2.0  # [1/s] with which a deviation from the line is taken back
_LARGEST_CORRECTION = 0.05  # [m/s], [rad/s]
_DAMPING = 0.03  # below this singular value the speed of the joints is limited at the cost of the tool's
_MARGIN = radians(1.0)  # to the end of a joint's range, where a jog of the tool ends
_CLOSE = 1e-9


class ToolJog:
    """One jog of the tool of an arm, from when a key is pressed until it is released.

    Args:
        side: the arm.
        position: where it stands when the jog begins, chain order [rad], (7,).
        frame: in which the speeds are given: the robot's base, or the tool as it stands then.
        linear: speed of the fingertips [m/s].
        angular: angular speed of the tool about the fingertips [rad/s].
        elbow: speed of the elbow while the tool stands, of the fastest joint [rad/s]; then the others must be 0.
    """

    def __init__(
        self, side: Side, position: Joints, frame: Frame, linear: Vector, angular: Vector, elbow: float = 0.0
    ) -> None:
        self._side, self._elbow = side, elbow
        start = fingertips(side, position)
        self._point, self._rotation = np.array(start.position), matrix(start.orientation)
        turn = self._rotation if frame == "tool" else np.eye(3)
        self._linear, self._angular = turn @ np.array(linear), turn @ np.array(angular)
        self._null: NDArray[np.float64] | None = None

    def speeds(self, position: Joints) -> Joints:
        """The joint speeds [rad/s] where the arm stands now [rad].

        Raises:
            CommandRefused: a joint has come to the end of its range.
        """
        here = fingertips(self._side, position)
        turned = self._rotation @ matrix(here.orientation).T
        missing_turn = 0.5 * np.array(
            [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
        )
        twist = np.concatenate(
            [
                self._linear + _across(self._point - np.array(here.position), self._linear),
                self._angular + _across(missing_turn, self._angular),
            ]
        )
        left, values, right = np.linalg.svd(jacobian(self._side, position, FINGERTIPS))
        gains = values / np.maximum(values * values, _DAMPING * _DAMPING)
        speeds = right[:6].T @ (gains * (left.T @ twist))
        if self._elbow:
            null = right[6] / np.max(np.abs(right[6]))
            before = np.eye(7)[2] if self._null is None else self._null  # upwards is where axis 7 turns forwards
            self._null = null if null @ before >= 0.0 else -null
            speeds = speeds + self._elbow * self._null
        fastest = float(np.max(np.abs(speeds)))
        if fastest > MAX_JOINT_SPEED:
            speeds *= MAX_JOINT_SPEED / fastest
        for index, (value, speed) in enumerate(zip(position, speeds, strict=True)):
            end = YUMI_LIMITS.upper[index] if speed > 0.0 else YUMI_LIMITS.lower[index]
            if abs(end - value) < _MARGIN and abs(speed) > radians(0.1):
                raise CommandRefused(
                    f"The tool cannot go on this way: axis {CHAIN_AXES[index]} of the {self._side.word} arm is at the "
                    f"end of its range ({YUMI_LIMITS.range_deg(index)}); jog another way, or that joint back."
                )
        return joints(speeds)


def fingertips(side: Side, position: Joints) -> Pose:
    """Where the fingertips of an arm are in the robot's base."""
    return compose(tool0_to_body(side, position), FINGERTIPS)


def _across(missing: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64]:
    """The speed that takes back what is missing, but for what lies along the jog itself."""
    length = float(np.linalg.norm(along))
    if length > _CLOSE:
        direction = along / length
        missing = missing - (missing @ direction) * direction
    speed = _CORRECTION * missing
    size = float(np.linalg.norm(speed))
    return np.asarray(speed * min(1.0, _LARGEST_CORRECTION / size) if size > _CLOSE else np.zeros(3))
