"""How regularly a robot's datagrams arrive: running estimates, a few additions per datagram and no memory of them."""

from __future__ import annotations

from math import inf

_SMOOTHING = 16.0  # of the jitter, as in RFC 3550
_WINDOW = 1.0  # [s] in which the fastest datagram is taken as undelayed
_CLOCK_JUMP = 1.0  # [s] by which a clock was set, not a datagram delayed


class Arrivals:
    """The arrivals of one session, by our clock and the robot's.

    Attributes:
        jitter: mean difference of two datagrams' delays, as RFC 3550 smooths it [s].
        worst_jitter: the largest such difference of the session [s].
        drift_ppm: by how much the robot's clock is faster than ours, from the fastest datagrams of its first and its
            last full second [ppm]; 0 before the second of them.
    """

    def __init__(self) -> None:
        self._offset = self._lowest = self._lowest_at = self._window_end = 0.0
        self._before: tuple[float, float] | None = None
        self.begin(0.0, 0.0)

    @property
    def cycle_time(self) -> float:
        """Mean time between two datagrams that the robot sent, by our clock [s]; 0 before the second."""
        return (self._last_arrival - self._first_arrival) / self._count if self._count else 0.0

    def begin(self, now: float, robot_time: float) -> None:
        """The first datagram of a session arrived [s], with a robot's time [s]."""
        self.jitter = self.worst_jitter = self.drift_ppm = 0.0
        self._count = 0
        self._first_arrival = self._last_arrival = now
        self._set_clock(now, now - robot_time)

    def note(self, now: float, robot_time: float, sent: int) -> None:
        """Another arrived, after ``sent`` that the robot sent since the one before, itself included."""
        offset = now - robot_time
        deviation = abs(offset - self._offset)
        self._count += sent
        self._last_arrival = now
        if deviation > _CLOCK_JUMP:
            self._set_clock(now, offset)
            return
        self._offset = offset
        self.jitter += (deviation - self.jitter) / _SMOOTHING
        self.worst_jitter = max(self.worst_jitter, deviation)
        if offset < self._lowest:
            self._lowest, self._lowest_at = offset, now
        if now >= self._window_end:
            self._close_window(now)

    def _set_clock(self, now: float, offset: float) -> None:
        self._offset = self._lowest = offset
        self._lowest_at = now
        self._before = None
        self._window_end = now + _WINDOW

    def _close_window(self, now: float) -> None:
        if self._before is None:
            self._before = (self._lowest, self._lowest_at)
        else:
            offset, since = self._before
            self.drift_ppm = (offset - self._lowest) / (self._lowest_at - since) * 1e6
        self._lowest, self._window_end = inf, now + _WINDOW
