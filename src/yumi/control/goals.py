"""Goals for the joints of one arm, as they lie in a mailbox: the session they were meant for, then 7 positions."""

from __future__ import annotations

from yumi.control.mailbox import Mailbox
from yumi.robot.joints import Joints, joints

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
