"""The delay of positions that are desired with a speed.

A robot's plan takes a speed at once, and the robot reports the position that goes with the speed later, by its servo's
delay. Its position loop is closed over what it reports: sent together, position and speed would both ask for the
distance of that delay (docs/explanation/decisions/0051-position-behind-its-speed.md).
"""

from __future__ import annotations

from collections import deque
from math import inf

from yumi.control.motion import SERVO_CYCLES
from yumi.robot.joints import CYCLE, ZERO, ArmCommand, Joints, joints

BEHIND = (SERVO_CYCLES + 0.5) * CYCLE
"""By so much a position is sent later than its speed [s]: the servo's delay, and half of the cycle for which a speed
counts."""


class PositionDelay:
    """What was desired with speeds, by the robot's time."""

    def __init__(self) -> None:
        self._now = 0.0
        self._with_speed = -inf  # when a speed was desired last
        self._places: deque[tuple[float, Joints]] = deque()  # when they were desired, the oldest first

    def clear(self) -> None:
        """What was desired is over."""
        self._places.clear()
        self._with_speed = -inf

    def next(self, desired: ArmCommand, dt: float, sent: Joints) -> ArmCommand:
        """``desired`` with the position that goes with its speed; itself where no speeds are desired any more.

        Args:
            desired: of finite numbers.
            dt: the robot's time since the last call [s].
            sent: the position sent last [rad], (7,), from which the first one is gone to.
        """
        self._now += dt
        if not self._places:
            self._places.append((self._now - dt, sent))
        self._places.append((self._now, desired.position))
        if desired.velocity is not ZERO:
            self._with_speed = self._now
        due = self._now - BEHIND
        while len(self._places) > 2 and self._places[1][0] <= due:
            self._places.popleft()
        if due > self._with_speed + CYCLE:  # the position has come to where the speeds ended
            return desired
        (older_time, older), (newer_time, newer) = self._places[0], self._places[1]
        if due >= newer_time:
            return desired._replace(position=newer)
        share = max(0.0, due - older_time) / (newer_time - older_time) if newer_time > older_time else 1.0
        return desired._replace(position=joints([a + share * (b - a) for a, b in zip(older, newer, strict=True)]))
