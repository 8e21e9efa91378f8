"""A gripper that follows a stream of goals: the newest goal counts, and who gives it waits for nothing."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import SupportsFloat

from abb_protocols.catalogue import Message, message, quoted
from abb_protocols.errors import CommandRefused, YumiError
from abb_protocols.robot.gripper_values import FINGER_TRAVEL, GripDirection, GripperGoal, finger_position_goal, grip
from yumi.driver.gripper import GripperCheck, RwsGripper, forbid_nothing


def goal_of(closed: float, force: float) -> GripperGoal:
    """The goal of a value from 0, open, to 1, which grips with ``force`` [N]."""
    return grip(GripDirection.INWARDS, force) if closed >= 1.0 else finger_position_goal(FINGER_TRAVEL * (1.0 - closed))


_RESOLUTION = 0.01  # goals of a stream that differ by less are the same one: half a millimetre


def closed_of(arm: str, width: object) -> float:
    """How far a gripper is closed, 0 to 1, whose fingers are ``width`` [m] apart; raises CommandRefused."""
    most = 2.0 * FINGER_TRAVEL
    if not isinstance(width, SupportsFloat) or not 0.0 <= float(width) <= most:
        raise CommandRefused(message("stream_grippers_malformed", arm=arm, given=quoted(width), most=most))
    return 1.0 - float(width) / most


class GripperFollower:
    """Gives a gripper the newest of its goals, one command at a time: a command takes requests, of which there are few.

    Args:
        gripper: that follows.
        force: of its grips [N].
        check: raises when it may not move.

    Attributes:
        refusal: why the last goal was not taken; None where it was.
    """

    def __init__(self, gripper: RwsGripper, force: float, check: GripperCheck = forbid_nothing) -> None:
        self.refusal: Message | None = None
        self._gripper, self._force, self._check = gripper, force, check
        self._lock = Lock()
        self._newest: float | None = None
        self._streamed: float | None = None  # the last one that was taken
        self._is_working = False

    def take(self, closed: float) -> Callable[[], None] | None:
        """A new goal, from 0, open, to 1, closed.

        Returns:
            What has to be called on a thread that may wait, to give the gripper its goals; None while that is done.
        """
        with self._lock:
            self._newest = self._streamed = closed
            if self._is_working:
                return None
            self._is_working = True
        return self._work

    def follow(self, closed: float, report: Callable[[Message], None]) -> Callable[[], None] | None:
        """The next goal of a stream, from 0 to 1; one that the gripper has is left out, unless it was refused.

        Args:
            closed: as for :meth:`take`.
            report: given why a goal was refused.

        Returns:
            As :meth:`take`.
        """
        if self._has(closed) and self.refusal is None:
            return None
        work = self.take(closed)
        if work is None:
            return None

        def follow() -> None:
            before = self.refusal
            work()
            if self.refusal is not None and self.refusal != before:
                report(self.refusal)

        return follow

    def _has(self, closed: float) -> bool:
        """Whether this goal was the last one, and nothing else has moved the fingers since."""
        with self._lock:
            last, is_working = self._streamed, self._is_working
        if last is None or abs(closed - last) >= _RESOLUTION:
            return False
        return is_working or self._gripper.goal == goal_of(last, self._force)

    def forget(self) -> None:
        """A goal that was not given to the gripper yet is not given any more."""
        with self._lock:
            self._newest = None

    def _work(self) -> None:
        while True:
            with self._lock:
                closed, self._newest = self._newest, None
                if closed is None:
                    self._is_working = False
                    return
            try:
                with self._gripper.alone():
                    self._gripper.begin(goal_of(closed, self._force), self._check)
                self.refusal = None
            except YumiError as error:
                self.refusal = error.said
            except BaseException:
                with self._lock:
                    self._is_working = False
                raise
