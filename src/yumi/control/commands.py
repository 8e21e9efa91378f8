"""Goals for the joints of one arm, as they lie in a mailbox, and how a controller takes them out.

A mailbox holds the latest value only: the one way state and goals cross between the fast line and the rest.
"""

from __future__ import annotations

from enum import IntFlag
from math import degrees, isfinite, isnan, nan, pi, radians
from typing import NamedTuple, Protocol

from yumi.errors import CommandRefused
from yumi.robot.joints import JOINT_COUNT, YUMI_LIMITS, Joints, joints

Values = tuple[float, ...]


class Mailbox(Protocol):
    """Numbers of a fixed count; one side puts, any side peeks, nobody waits."""

    def put(self, values: Values) -> None:
        """Replace what is in the box."""

    def peek(self) -> tuple[int, Values] | None:
        """The number of the letter, from 1, and its values; None while nothing was ever put."""


class MemoryMailbox:
    """A mailbox inside one process."""

    def __init__(self) -> None:
        self._letter: tuple[int, Values] | None = None

    def put(self, values: Values) -> None:
        number = self._letter[0] if self._letter else 0
        self._letter = (number + 1, values)

    def peek(self) -> tuple[int, Values] | None:
        return self._letter


GOAL_SIZE = 2 + 2 * JOINT_COUNT
"""Numbers in a goal mailbox: the session it is meant for, its time, 7 positions, 7 velocities."""

UNKNOWN: Joints = (nan, nan, nan, nan, nan, nan, nan)
"""Positions or velocities that a goal does not have."""


class GoalKind(IntFlag):
    """What the controllers that command an arm take; each kind has a mailbox of its own."""

    NONE = 0
    POSITION = 1
    VELOCITY = 2
    FORWARD_POSITION = 4
    FORWARD_VELOCITY = 8


class Goal(NamedTuple):
    """What the joints shall do.

    Attributes:
        position: positions [rad], (7,); NaN in a goal of speeds.
        velocity: velocities [rad/s], (7,); NaN where they are not known.
        time: when it was given, on the machine's monotonic clock [s]; NaN where that is not known.
    """

    position: Joints
    velocity: Joints = UNKNOWN
    time: float = nan


def put_goal(box: Mailbox, session: int, goal: Joints, velocity: Joints = UNKNOWN, time: float = nan) -> None:
    """Ask for ``goal`` [rad] in EGM session ``session``; a later session will not go there.

    Args:
        box: where the arm looks for it.
        session: the session it was meant for.
        goal: positions [rad], (7,).
        velocity: speeds with which the goal itself moves [rad/s], (7,); NaN where they are not known.
        time: when it was given, on the machine's monotonic clock [s]; NaN when that is not known.
    """
    box.put((float(session), time, *goal, *velocity))


def put_speeds(box: Mailbox, session: int, velocity: Joints, time: float = nan) -> None:
    """Ask for speeds [rad/s], (7,), in EGM session ``session``; ``time`` as in :func:`put_goal`."""
    put_goal(box, session, UNKNOWN, velocity, time)


def peek_goal(box: Mailbox, session: int) -> tuple[int, Goal | None]:
    """The number of the newest goal, and the goal; None when it is not meant for ``session``."""
    letter = box.peek()
    if letter is None:
        return 0, None
    number, values = letter
    if int(values[0]) != session:
        return number, None
    return number, Goal(joints(values[2 : 2 + JOINT_COUNT]), joints(values[2 + JOINT_COUNT :]), values[1])


class GoalInbox:
    """A controller's view of its mailbox: every goal is taken once.

    Args:
        box: where goals arrive.
    """

    def __init__(self, box: Mailbox) -> None:
        self._box = box
        self._number = 0

    def forget(self) -> None:
        """What was sent until now belongs to the past."""
        letter = self._box.peek()
        self._number = letter[0] if letter else 0

    def take(self, session: int, now: float) -> Goal | None:
        """The newest goal, if it was not taken before and is meant for ``session``.

        A goal of unknown time was given ``now`` [s], since it was not there a cycle ago.
        """
        letter = self._box.peek()
        if letter is None or letter[0] == self._number:
            return None
        self._number, goal = peek_goal(self._box, session)
        if goal is None or not isnan(goal.time):
            return goal
        return goal._replace(time=now)


def check_position(name: str, index: int, position: float, advice: str = "positions are in radians") -> None:
    """Refuse a position that a joint cannot have.

    Args:
        name: the joint's, for the refusal.
        index: its place in the chain.
        position: [rad].
        advice: what to do about a value that looks like degrees.

    Raises:
        CommandRefused: it is no finite number, or out of the joint's range.
    """
    if not isfinite(position):
        raise CommandRefused(f"Goal refused: {name} is {position}; a position is a finite number of radians.")
    if YUMI_LIMITS.lower[index] <= position <= YUMI_LIMITS.upper[index]:
        return
    refusal = f"Goal refused: {name} is {degrees(position):.1f}°; its range is {YUMI_LIMITS.range_deg(index)}"
    if looks_like_degrees(index, position):
        refusal += f"; {position:g} looks like degrees: {advice}"
    raise CommandRefused(f"{refusal}.")


def looks_like_degrees(index: int, position: float) -> bool:
    """Whether a position [rad] that a joint cannot have would be one in degrees.

    No range of a joint reaches a whole turn, so that a value beyond one was hardly meant in radians.
    """
    return abs(position) > 2.0 * pi and YUMI_LIMITS.lower[index] <= radians(position) <= YUMI_LIMITS.upper[index]
