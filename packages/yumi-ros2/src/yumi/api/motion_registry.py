"""The motions of a script: how far each one is, how it ends, and what has stopped an arm since the last recovery."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NotInTime
from itertools import count
from threading import Lock
from typing import NamedTuple

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import GoalNotReached
from abb_protocols.robot.joints import Side
from yumi.control.chunk_commands import ChunksExhausted
from yumi.control.controllers.joint_goal import GoalEnded, GoalOutcome
from yumi.control.loop_events import (
    ControllerReport,
    Event,
    RobotStoppedFollowing,
    SessionLost,
    SessionStarted,
    is_fault,
    is_warning,
)
from yumi.control.shared_state import Limited
from yumi.control.stream_monitor import StreamReport
from yumi.control.tool_limits import ToolLimited
from yumi.control.trajectory_commands import TrajectoryEnded, TrajectoryOutcome
from yumi.driver.stops import Cause, Explain, explained

_log = logging.getLogger(__name__)


class MotionWay(NamedTuple):
    """How far a motion is: from 0 to 1, and the time it still takes [s], None where that is unknown."""

    progress: float
    remaining: float | None


class Motion:
    """One motion of one arm; ``future`` is done when it has ended, and raises what :meth:`wait` raises."""

    def __init__(self, side: Side, identity: int) -> None:
        self.side = side
        self.identity = identity
        self.future: Future[None] = Future()
        self.future.set_running_or_notify_cancel()  # a wait that is given up does not end the motion
        self._way: Callable[[], MotionWay] = lambda: MotionWay(0.0, None)
        self._last = 0.0  # progress when it was asked for last

    def __repr__(self) -> str:
        way = "ended" if self.is_done else f"under way, {self.progress:.0%}"
        return f"<yumi.Motion {self.identity} of the {self.side.word} arm: {way}>"

    def follow_way(self, way: Callable[[], MotionWay]) -> None:
        """Know from now on how far it is, until it ends."""
        self._way = way
        # It leads to Ruckig, which lists on standard error what is left of it at the program's end.
        self.future.add_done_callback(self._forget_way)

    def _forget_way(self, _: object) -> None:
        self._way = lambda: MotionWay(self._last, None)

    @property
    def way(self) -> MotionWay:
        """How far it is: :attr:`progress` and :attr:`remaining` at the same moment."""
        if not self.is_done:
            way = self._way()
            self._last = way.progress
            return way
        return MotionWay(1.0 if self.future.exception() is None else self._last, 0.0)

    @property
    def progress(self) -> float:
        """How much of its way the arm has covered, 0 to 1; stays where a motion that ended elsewhere was seen last."""
        return self.way.progress

    @property
    def remaining(self) -> float | None:
        """How long it still takes at the present ``speed_scale`` [s]; 0 when it has ended, None when it is unknown."""
        return self.way.remaining

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
            raise GoalNotReached(message("goal_not_reached_yet", arm=self.side.word, timeout=timeout)) from None


class MotionRegistry:
    """All motions under way, and what has gone wrong since the last recovery; safe from any thread.

    Args:
        is_script: whether it is a script's: a fault is logged, and an arm that had one takes no goal before
            ``robot.recover()``. A driver with ROS logs events by itself, and recovers on several ways.

    Attributes:
        explain: a fault ends motions with the cause that it calls back with.
        cause: what has stopped the robot, as far as it is known now; a goal is refused with it.
        limited_by: what an arm is kept apart from now, which may be why it does not arrive.
    """

    def __init__(self, *, is_script: bool = True) -> None:
        self.explain: Explain = lambda then: then(Cause())
        self.cause: Callable[[], Cause] = Cause
        self.limited_by: Callable[[Side], Limited | None] = lambda side: None
        self._is_script = is_script
        self._log = _log.log if is_script else _no_log
        self._recoveries = 0
        self._numbers = count(1)  # people read them; those of ROS are far beyond
        self._open: dict[int, Motion] = {}
        self._faults: dict[Side, tuple[Message, str]] = {}  # and the stop that a person must confirm
        self._lock = Lock()

    def begin(self, side: Side) -> Motion:
        """A new motion, to be sent under its number."""
        with self._lock:
            motion = Motion(side, next(self._numbers))
            self._open[motion.identity] = motion
        return motion

    def forget(self, motions: Iterable[Motion]) -> None:
        """They were refused: no arm moves."""
        with self._lock:
            for motion in motions:
                self._open.pop(motion.identity, None)

    def is_open(self, side: Side) -> bool:
        """Whether a motion of the arm has not ended."""
        with self._lock:
            return any(motion.side is side for motion in self._open.values())

    def fault(self, side: Side) -> Message | None:
        """What stopped the arm; None when nothing did."""
        fault = self._faults.get(side) if self._is_script else None
        return fault[0] if fault else None

    def stop(self, side: Side) -> str:
        """Id of the stop that a person must confirm before the arm moves again; empty where there is none."""
        fault = self._faults.get(side)
        return fault[1] if fault else ""

    def clear_faults(self) -> None:
        """The robot is ready again."""
        with self._lock:
            self._recoveries += 1
            self._faults.clear()

    def note(self, event: Event) -> None:
        """Take an event of the control process."""
        if isinstance(event, ControllerReport):
            self._note_report(event)
            return
        if not is_fault(event):
            self._log(logging.INFO, event.said)
            return
        # The motions of the arm have failed: whatever else is reported of them does not count any more.
        with self._lock:
            self._faults[event.side] = (event.said, "")
            failed = [motion for motion in self._open.values() if motion.side is event.side]
            for motion in failed:
                del self._open[motion.identity]
            recoveries = self._recoveries

        def end(cause: Cause) -> None:
            said = explained(event, cause)
            self._log(logging.WARNING, said)
            with self._lock:
                if self._recoveries == recoveries:
                    self._faults[event.side] = (said, cause.stop)
            for motion in failed:
                motion.future.set_exception(GoalNotReached(said, cause.stop))

        if isinstance(event, SessionLost | SessionStarted | RobotStoppedFollowing):
            self.explain(end)  # EGM's end arrives before the controller's event that says why
        else:
            end(Cause())

    def _note_report(self, event: ControllerReport) -> None:
        report = event.report
        if isinstance(report, GoalEnded):
            self._end(report.identity, report.outcome is GoalOutcome.REACHED, report.said)
        elif isinstance(report, TrajectoryEnded):
            self._end(report.goal, report.outcome is TrajectoryOutcome.SUCCEEDED, report.said)
        elif isinstance(report, ToolLimited | ChunksExhausted):
            self._log(logging.INFO, f"{event.side.word.capitalize()} arm: {report}")
        elif isinstance(report, StreamReport):
            self._log(logging.WARNING if is_warning(event) else logging.INFO, event.said)

    def _end(self, identity: int, is_reached: bool, reason: Message) -> None:
        with self._lock:
            motion = self._open.pop(identity, None)
        if motion is None:
            return
        if is_reached:
            motion.future.set_result(None)
        else:
            held = self.limited_by(motion.side)
            if held is None:
                said = message("goal_not_reached", arm=motion.side.word, reason=reason)
            else:
                said = message("goal_not_reached_limited", arm=motion.side.word, reason=reason, limited=held.said)
            motion.future.set_exception(GoalNotReached(said))


def _no_log(level: int, said: Message | str) -> None:
    """Who has the events logs them."""
