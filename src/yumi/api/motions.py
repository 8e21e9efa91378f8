"""Motions under way, and how each of them ends: what a script waits for."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NotInTime
from itertools import count
from threading import Lock

from yumi.control.requests import (
    ControllerNotice,
    Event,
    RobotStoppedFollowing,
    SessionLost,
    SessionStarted,
    is_fault,
)
from yumi.controllers.joint_goal import GoalEnded, GoalOutcome
from yumi.controllers.trajectory_orders import Outcome, TrajectoryEnded
from yumi.errors import GoalNotReached
from yumi.hardware.stops import Cause, explained
from yumi.robot.joints import Side

LAST_STOP = 5.0
"""An arm must have come to rest within this time [s]; it takes a tenth of it."""

log = logging.getLogger(__name__)


class Motion:
    """One motion of one arm.

    Attributes:
        side: the arm.
        identity: its number.
        future: done when the motion has ended; raises what :meth:`wait` raises.
    """

    def __init__(self, side: Side, identity: int) -> None:
        self.side = side
        self.identity = identity
        self.future: Future[None] = Future()
        self.future.set_running_or_notify_cancel()  # who no longer waits does not end the motion

    def __repr__(self) -> str:
        return f"<yumi.Motion {self.identity} of the {self.side.word} arm: {'ended' if self.is_done else 'under way'}>"

    @property
    def is_done(self) -> bool:
        """Whether it has ended, at its goal or elsewhere."""
        return self.future.done()

    def wait(self, timeout: float | None = None) -> None:
        """Wait until the arm stands at its goal; waiting longer than ``timeout`` [s] does not stop the arm.

        Raises:
            GoalNotReached: the motion ended elsewhere, or its time is up; the message says why.
        """
        try:
            self.future.result(timeout)
        except NotInTime:
            raise GoalNotReached(
                f"The {self.side.word} arm has not reached its goal within {timeout:g} s; it is still on its way."
            ) from None


Explain = Callable[[Callable[[Cause], None]], None]
"""Calls back with what stopped the robot, once that is known."""


class MotionBook:
    """All motions under way, and what has gone wrong since the last recovery; safe from any thread.

    Attributes:
        explain: a fault ends motions with the cause that it calls back with.
    """

    def __init__(self) -> None:
        self.explain: Explain = lambda then: then(Cause())
        self._recoveries = 0
        self._numbers = count(1)
        self._open: dict[int, Motion] = {}
        self._faults: dict[Side, tuple[str, str]] = {}  # a sentence, and the stop that a person must confirm
        self._lock = Lock()

    def begin(self, side: Side) -> Motion:
        """A new motion, to be ordered under its number."""
        with self._lock:
            motion = Motion(side, next(self._numbers))
            self._open[motion.identity] = motion
        return motion

    def forget(self, motions: Iterable[Motion]) -> None:
        """They were refused: nobody moves."""
        with self._lock:
            for motion in motions:
                self._open.pop(motion.identity, None)

    def fault(self, side: Side) -> str | None:
        """What stopped the arm, in a sentence; None when nothing did."""
        fault = self._faults.get(side)
        return fault[0] if fault else None

    def stop(self, side: Side) -> str:
        """Id of the stop that a person must confirm before the arm moves again; empty where there is none."""
        return self._faults.get(side, ("", ""))[1]

    def clear_faults(self) -> None:
        """The robot is ready again."""
        with self._lock:
            self._recoveries += 1
            self._faults.clear()

    def tell(self, event: Event) -> None:
        """Take in what the fast line tells."""
        if isinstance(event, ControllerNotice):
            self._settle(event.notice)
            return
        if not is_fault(event):
            log.info(_for_script(str(event)))
            return
        failed, recoveries = self._take_failed(event.side, _for_script(str(event)))

        def end(cause: Cause) -> None:
            sentence = _for_script(explained(event, cause))
            log.warning(sentence)
            with self._lock:
                if self._recoveries == recoveries:
                    self._faults[event.side] = (sentence, cause.stop)
            for motion in failed:
                motion.future.set_exception(GoalNotReached(sentence, cause.stop))

        if isinstance(event, SessionLost | SessionStarted | RobotStoppedFollowing):
            self.explain(end)  # EGM's end arrives before the controller's event that tells why
        else:
            end(Cause())

    def _take_failed(self, side: Side, sentence: str) -> tuple[list[Motion], int]:
        """The motions of an arm that something has stopped; whatever else is told of them counts no more."""
        with self._lock:
            self._faults[side] = (sentence, "")
            failed = [motion for motion in self._open.values() if motion.side is side]
            for motion in failed:
                del self._open[motion.identity]
            return failed, self._recoveries

    def _settle(self, notice: object) -> None:
        if isinstance(notice, GoalEnded):
            self._end(notice.identity, notice.outcome is GoalOutcome.REACHED, notice.sentence)
        elif isinstance(notice, TrajectoryEnded):
            self._end(notice.goal, notice.outcome is Outcome.SUCCEEDED, notice.sentence)

    def _end(self, identity: int, is_reached: bool, sentence: str) -> None:
        with self._lock:
            motion = self._open.pop(identity, None)
        if motion is None:
            return
        if is_reached:
            motion.future.set_result(None)
        else:
            reason = sentence.rstrip(".")
            motion.future.set_exception(GoalNotReached(f"The {motion.side.word} arm did not reach its goal: {reason}."))


def _for_script(sentence: str) -> str:
    """In a script the way back is a method, with ROS it is a service."""
    return sentence.replace("start_egm", "robot.recover()").replace("(recover)", "(robot.recover(confirm=...))")
