"""How an arm follows its trajectory, as it lies in a mailbox: what is desired, what is, and the arms' skew."""

from __future__ import annotations

from typing import NamedTuple

from yumi.control.mailbox import Mailbox
from yumi.robot.joints import JOINT_COUNT, Joints, joints

FEEDBACK_SIZE = 6 + 4 * JOINT_COUNT
"""Numbers in a feedback mailbox."""


class Skew(NamedTuple):
    """How far apart in time two arms were that follow one trajectory.

    Attributes:
        start: between their first cycles [s].
        worst: largest difference of where they were told to be on it [s].
    """

    start: float = 0.0
    worst: float = 0.0


class TrajectoryFeedback(NamedTuple):
    """One look at an arm that a trajectory controller commands.

    Attributes:
        goal: number of the order it follows, 0 while it holds.
        time: of the state, on the machine's monotonic clock [s].
        progress: the desired time on the trajectory [s].
        scale: how fast time goes by on the trajectory.
        skew: of the arms that follow it together; zeros for one arm.
        desired: where it should be [rad], (7,).
        desired_velocity: [rad/s], (7,).
        actual: where it is [rad], (7,).
        actual_velocity: [rad/s], (7,).
    """

    goal: int
    time: float
    progress: float
    scale: float
    skew: Skew
    desired: Joints
    desired_velocity: Joints
    actual: Joints
    actual_velocity: Joints


def put_feedback(box: Mailbox, feedback: TrajectoryFeedback) -> None:
    """Let others see ``feedback``."""
    goal, time, progress, scale, skew, *rows = feedback
    numbers = (float(goal), time, progress, scale, skew.start, skew.worst)
    box.put((*numbers, *(value for row in rows for value in row)))


def peek_feedback(box: Mailbox) -> tuple[int, TrajectoryFeedback] | None:
    """The number of the newest feedback, and the feedback; None before the first."""
    letter = box.peek()
    if letter is None:
        return None
    number, (goal, time, progress, scale, start, worst, *values) = letter
    rows = [joints(values[begin : begin + JOINT_COUNT]) for begin in range(0, len(values), JOINT_COUNT)]
    return number, TrajectoryFeedback(int(goal), time, progress, scale, Skew(start, worst), *rows)
