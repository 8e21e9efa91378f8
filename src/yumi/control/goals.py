"""Goals for the joints of one arm, as they lie in a mailbox: the session they were meant for, then 7 positions."""

from __future__ import annotations

from math import degrees, isfinite

from yumi.control.mailbox import Mailbox
from yumi.errors import CommandRefused
from yumi.robot.joints import Joints, joints
from yumi.robot.limits import YUMI_LIMITS

GOAL_SIZE = 8
"""Numbers in a goal mailbox."""


def put_goal(box: Mailbox, session: int, goal: Joints) -> None:
    """Ask for ``goal`` [rad] in EGM session ``session``; a later session will not go there."""
    box.put((float(session), *goal))


def peek_goal(box: Mailbox, session: int) -> tuple[int, Joints | None]:
    """The number of the newest goal and its positions [rad]; None when it is not meant for ``session``."""
    letter = box.peek()
    if letter is None:
        return 0, None
    number, values = letter
    if int(values[0]) != session:
        return number, None
    return number, joints(values[1:])


def check_position(name: str, index: int, position: float) -> None:
    """Refuse a position that a joint cannot have.

    Args:
        name: the joint's, for the refusal.
        index: its place in the chain.
        position: [rad].

    Raises:
        CommandRefused: it is no finite number, or out of the joint's range.
    """
    if not isfinite(position):
        raise CommandRefused(f"Goal refused: {name} is {position}; a position is a finite number of radians.")
    if not YUMI_LIMITS.lower[index] <= position <= YUMI_LIMITS.upper[index]:
        raise CommandRefused(
            f"Goal refused: {name} is {degrees(position):.1f}°; its range is {YUMI_LIMITS.range_deg(index)}."
        )
