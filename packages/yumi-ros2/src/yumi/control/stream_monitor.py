"""The monitor of a stream of joint positions: its period, and reports where it leaves the range that is documented."""

from __future__ import annotations

from collections import deque
from math import inf
from statistics import median
from typing import NamedTuple

from abb_protocols.catalogue import Message, message
from abb_protocols.robot.joints import JointLimits, Joints
from yumi.control.motion.target_predictor import LONGEST_STREAM_INTERVAL

_LOWEST_RATE, _HIGHEST_RATE = 10.0, 500.0
"""Points a second in a stream that is followed as documented."""

_TOLERANCE = 1.1  # a clock is not exact
_INTERVALS = 9  # of which the period is the median: points may be lost
_WINDOW = 1.0  # [s] over which a rate is counted
_FEWEST = 4  # points make a rate
_REPEATED = 5.0  # [s] a report of one kind comes at most so often
_OFTEN = 0.2  # share of points that are late, of a stream whose delay is too short
_LATE = 0.010  # [s] a point is late that comes so long after it was needed; it is read once a cycle
_LIMITED = 5  # cycles in which a joint's limits let it not follow
_CATCHING_UP = 1.0  # [s] which the arm has at first, and after a jump
_OTHER_DELAY = 0.005  # [s] is worth a report
_JUMP = 1.05  # times a joint's highest speed


class StreamReport(NamedTuple):
    """A report about the stream that an arm follows.

    Attributes:
        said: the report for a person.
        is_warning: whether the stream is not followed as documented.
    """

    said: Message
    is_warning: bool

    def __str__(self) -> str:
        return str(self.said)


class StreamMonitor:
    """Watches the stream of one arm, and makes its reports.

    Args:
        limits: of the joints.

    Attributes:
        newest: the stamp of the newest point [s].
        period: of the stream, by its stamps [s]; 0 until there are two points.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._fastest = limits.velocity
        self._reports: list[StreamReport] = []
        self._reported: dict[str, float] = {}
        self._intervals: deque[float] = deque(maxlen=_INTERVALS)
        self.begin()

    def begin(self) -> None:
        """The next point is the first of a stream."""
        self.newest, self.period = -inf, 0.0
        self._position: Joints = ()
        self._intervals.clear()
        self._delay = inf  # that was reported
        self._limited, self._catches_up = 0, inf  # until then [s]
        self._count(-inf)

    def _count(self, begin: float) -> None:
        self._begin, self._points, self._seen, self._late, self._latest = begin, 0, 0, 0, 0.0

    def note_point(self, position: Joints, time: float, points: int, names: tuple[str, ...], now: float) -> None:
        """A point has come.

        Args:
            position: [rad], (7,).
            time: its stamp [s], which is newer than that of the point before.
            points: of the stream since the last call, of which the others were replaced before they were read.
            names: of the joints.
            now: the time [s].
        """
        interval, before = time - self.newest, self._position
        if interval > _WINDOW:
            self.begin()
            self._count(time)
            self._catches_up = now + _CATCHING_UP
        else:
            self._points, self._seen = self._points + points, self._seen + 1
        self.newest, self._position = time, position
        if interval < LONGEST_STREAM_INTERVAL:
            self._intervals.append(interval)
            self.period = median(self._intervals)
            rows = zip(position, before, self._fastest, names, strict=True)
            for new, old, top, name in rows:
                if abs(new - old) > _JUMP * top * interval:
                    self._catches_up = now + _CATCHING_UP
                    self._report("stream_jumps", now, joint=name, way=abs(new - old), interval=interval)
                    break

    def note_delay(self, delay: float, lateness: float, now: float) -> None:
        """With which delay the stream is followed since the last point came [s], and how much too late it came [s]."""
        if lateness > _LATE:
            self._late, self._latest = self._late + 1, max(self._latest, lateness)
        span = self.newest - self._begin
        if span < _WINDOW or self._points < _FEWEST:
            return
        rate = self._points / span
        if not _LOWEST_RATE / _TOLERANCE <= rate <= _HIGHEST_RATE * _TOLERANCE:
            self._report("stream_rate_out_of_range", now, rate=rate, lowest=_LOWEST_RATE, highest=_HIGHEST_RATE)
        elif abs(delay - self._delay) > _OTHER_DELAY:
            self._delay = delay
            self._report("stream_followed", now, is_warning=False, rate=rate, delay=delay)
        if self._late > _OFTEN * self._seen:
            self._report("stream_late", now, lateness=self._latest, delay=delay, better=delay + self._latest)
        self._count(self.newest)

    def note_limits(self, joint: str | None, now: float) -> None:
        """A cycle in which the limits of ``joint`` let it not follow; None where all follow."""
        self._limited = 0 if joint is None or now < self._catches_up else self._limited + 1
        if joint is not None and self._limited >= _LIMITED:
            self._report("stream_beyond_limits", now, joint=joint)

    def note_end(self, now: float) -> None:
        """The stream ended in motion: no point has come for too long."""
        self._report("stream_ended_in_motion", now, silence=now - self.newest)

    def take_reports(self) -> list[StreamReport]:
        """Those since the last call."""
        reports, self._reports = self._reports, []
        return reports

    def _report(self, code: str, now: float, *, is_warning: bool = True, **values: float | str) -> None:
        if now - self._reported.get(code, -inf) >= _REPEATED:
            self._reported[code] = now
            self._reports.append(StreamReport(message(code, **values), is_warning))
