"""Goals for the joints: positions, speeds, delays of streams; the buffers and inboxes by which controllers get them.

A buffer holds the latest value only: the one way state and goals cross between the control process and the driver.
"""

from __future__ import annotations

from enum import IntFlag
from math import isfinite, isnan, nan, pi, radians
from typing import Generic, Literal, NamedTuple, Protocol, TypeVar, get_args

from abb_protocols.catalogue import message, quoted
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import YUMI_LIMITS, Joints
from yumi.control.sampled import Sampled


class GoalKind(IntFlag):
    """What the controllers that command an arm take; each kind has a buffer of its own."""

    NONE = 0
    POSITION = 1
    VELOCITY = 2
    FORWARD_POSITION = 4
    FORWARD_VELOCITY = 8
    TOOL = 16


_V = TypeVar("_V")


class Buffer(Protocol[_V]):
    """The latest value of one kind; one side writes, any side reads, neither waits."""

    def write(self, value: _V) -> None:
        """Replace the value."""

    def read(self) -> tuple[int, _V] | None:
        """The number of the newest write, from 1, and its value; None while nothing was ever written."""


class MemoryBuffer(Generic[_V]):
    """A buffer inside one process."""

    def __init__(self) -> None:
        self._newest: tuple[int, _V] | None = None

    def write(self, value: _V) -> None:
        number = self._newest[0] if self._newest else 0
        self._newest = (number + 1, value)

    def read(self) -> tuple[int, _V] | None:
        return self._newest


UNKNOWN_JOINTS: Joints = (nan, nan, nan, nan, nan, nan, nan)
"""Positions or velocities that a goal does not have."""

CONFIGURED_DELAY = -1.0
"""The delay of a stream that the controller's parameters say."""

LONGEST_DELAY = 1.0
"""With which a stream is followed at most [s]."""

OLDEST_POINT, NEWEST_POINT = 5.0, 1.0
"""A point of a stream is for a time that is past for no longer, and no further in the future [s]."""

GoalTracking = Literal["feed_forward", "gains"]
"""How a stream is followed: by its stamps with speeds fed forward, or each point by the controller's gains alone."""


class SessionGoal(NamedTuple):
    """What the joints are to do.

    Attributes:
        session: the EGM session that it is meant for; a later session will not go there.
        time: when it was given, on the machine's monotonic clock [s]; NaN where that is not known.
        position: positions [rad], (7,); NaN in a goal of speeds.
        velocity: velocities [rad/s], (7,); NaN where they are not known.
        delay: how late the arm follows the stream that it is a point of [s]: 0 predicts, ``CONFIGURED_DELAY`` is what
            the parameters say; NaN where it is not a point of a stream, and the controller's gains lead there.
    """

    session: int
    time: float
    position: Joints
    velocity: Joints
    delay: float = nan


GoalBuffer = Buffer[SessionGoal]
"""Where an arm looks for goals."""


def write_goal(
    buffer: GoalBuffer,
    session: int,
    goal: Joints,
    velocity: Joints = UNKNOWN_JOINTS,
    time: float = nan,
    delay: float = nan,
) -> None:
    """Ask for ``goal`` [rad], which itself moves with ``velocity`` [rad/s], in EGM session ``session``.

    ``time`` and ``delay`` are as in :class:`SessionGoal`.
    """
    buffer.write(SessionGoal(session, time, goal, velocity, delay))


def write_speeds(buffer: GoalBuffer, session: int, velocity: Joints, time: float = nan) -> None:
    """Ask for speeds [rad/s], (7,), in EGM session ``session``; ``time`` as in :class:`SessionGoal`."""
    buffer.write(SessionGoal(session, time, UNKNOWN_JOINTS, velocity))


def stream_delay(tracking: str = "feed_forward", delay: float | None = None) -> float:
    """The delay of a goal, for :func:`write_goal`, by what a person says; raises CommandRefused.

    Args:
        tracking: as :data:`GoalTracking`.
        delay: how late the arm follows the stamps [s]; None as the controller's parameters say.
    """
    known = get_args(GoalTracking)
    if tracking not in known:
        raise CommandRefused(message("stream_tracking_unknown", given=str(tracking), known=known))
    if delay is None:
        return CONFIGURED_DELAY if tracking == "feed_forward" else nan
    try:
        value = float(delay)
    except (TypeError, ValueError):
        value = nan
    if not 0.0 <= value <= LONGEST_DELAY or tracking != "feed_forward":
        raise CommandRefused(message("stream_delay_out_of_range", given=quoted(delay), longest=LONGEST_DELAY))
    return value


class _SessionMessage(Protocol):
    @property
    def session(self) -> int: ...


_M = TypeVar("_M", bound=_SessionMessage)


class MessageInbox(Generic[_M]):
    """A controller's view of its buffer: every message is taken once."""

    def __init__(self, buffer: Buffer[_M]) -> None:
        self._buffer = buffer
        self._number = 0

    @property
    def number(self) -> int:
        """Of the newest write that was taken or forgotten; the numbers between two are of messages nothing took."""
        return self._number

    def forget(self) -> None:
        """What was sent until now belongs to the past: nothing of it begins after a stop, or after an activation."""
        newest = self._buffer.read()
        self._number = newest[0] if newest else 0

    def take_newest(self, session: int) -> _M | None:
        """The newest message, if it was not taken before and is meant for ``session``."""
        newest = self._buffer.read()
        if newest is None or newest[0] == self._number:
            return None
        self._number, received = newest
        return received if received.session == session else None


class GoalInbox(MessageInbox[SessionGoal]):
    """The view of goals for the joints."""

    def sampled(self, goal: Joints, gains: Joints | None = None) -> Sampled | None:
        """The formula of a controller that took ``goal`` last; None where the goals are not in shared memory."""
        address = getattr(self._buffer, "address", None)
        return None if address is None else Sampled(address, self._number, goal, gains)

    def take(self, session: int, now: float) -> SessionGoal | None:
        """The newest goal, if it was not taken before and is meant for ``session``.

        A goal of unknown time was given ``now`` [s], since it was not there a cycle ago.
        """
        goal = self.take_newest(session)
        return goal if goal is None or not isnan(goal.time) else goal._replace(time=now)


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
        raise CommandRefused(message("goal_joint_not_finite", joint=name, value=str(position)))
    lower, upper = YUMI_LIMITS.lower[index], YUMI_LIMITS.upper[index]
    if not lower <= position <= upper:
        raise CommandRefused(
            message(
                "goal_joint_in_degrees" if looks_like_degrees(index, position) else "goal_joint_out_of_range",
                joint=name,
                position=position,
                lower=lower,
                upper=upper,
            )
        )


def looks_like_degrees(index: int, position: float) -> bool:
    """Whether a position [rad] that a joint cannot have would be one in degrees.

    No range of a joint reaches a whole turn, so that a value beyond one was hardly meant in radians.
    """
    return abs(position) > 2.0 * pi and YUMI_LIMITS.lower[index] <= radians(position) <= YUMI_LIMITS.upper[index]
