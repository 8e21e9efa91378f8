"""A gripper that follows a stream of goals: the newest goal counts, and who gives it waits for nothing."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock

from yumi.catalogue import Message
from yumi.driver.gripper import Check, Gripper, forbid_nothing
from yumi.errors import YumiError
from yumi.robot.gripper import TRAVEL, Direction, GripperGoal, go_to, grip


def goal_of(closed: float, force: float) -> GripperGoal:
    """The goal of a value from 0, open, to 1, which grips with ``force`` [N]."""
    return grip(Direction.INWARDS, force) if closed >= 1.0 else go_to(TRAVEL * (1.0 - closed))


class GripperFollower:
    """Gives a gripper the newest of its goals, one command at a time: a command takes requests, of which there are few.

    Args:
        gripper: that follows.
        force: of its grips [N].
        check: raises when it may not move.

    Attributes:
        refusal: why the last goal was not taken; None where it was.
    """

    def __init__(self, gripper: Gripper, force: float, check: Check = forbid_nothing) -> None:
        self.refusal: Message | None = None
        self._gripper, self._force, self._check = gripper, force, check
        self._lock = Lock()
        self._newest: float | None = None
        self._is_working = False

    def take(self, closed: float) -> Callable[[], None] | None:
        """A new goal, from 0, open, to 1, closed.

        Returns:
            What has to be called on a thread that may wait, to give the gripper its goals; None while that is done.
        """
        with self._lock:
            self._newest = closed
            if self._is_working:
                return None
            self._is_working = True
        return self._work

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
