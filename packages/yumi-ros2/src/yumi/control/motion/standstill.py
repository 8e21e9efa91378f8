"""The standstill of an arm that a controller takes over, and what the arm is sent: whether it is held back."""

from __future__ import annotations

from collections import deque
from math import isfinite

from abb_protocols.robot.joints import CYCLE, ArmState, Joints
from yumi.control.motion.robot_response import SERVO_CYCLES, STANDING
from yumi.control.motion.setpoint import largest_difference

_CALM_CYCLES = 10  # the feedback is behind by less
_LONGEST_WAIT = 1.0  # [s] the limiter brings an arm to rest from full speed in less than half of it
_SENT_STANDS = 2e-5  # [rad] what is sent to an arm that stands moves no further in a cycle
_LATELY = SERVO_CYCLES + 2  # cycles: positions that are commanded with a speed are sent so much later, at most
_ELSEWHERE = 0.05  # [rad]
_DELAYED = 0.25  # [s] by so much of its speed an arm is behind what it is commanded
STANDSTILL_TOLERANCE = 1e-3
"""An arm that stands no further than this from where it is commanded to be is there [rad]."""


class SentPositions:
    """What one arm is sent, which is what it is commanded, unless something holds it back.

    Attributes:
        position: that was sent last [rad], (7,); None before the first cycle.
    """

    def __init__(self) -> None:
        self.position: Joints | None = None
        self._commanded: deque[Joints] = deque(maxlen=_LATELY)

    def note(self, commanded: Joints | None, sent: Joints) -> None:
        """After a reply: what was commanded, None where the arm holds, and what was sent [rad], (7,)."""
        if commanded is None or not all(map(isfinite, commanded)):  # the limiter holds the arm in place of the latter
            self._commanded.clear()
        else:
            if not self._commanded:
                self._commanded.append(self.position or sent)  # where the way to the first command begins
            self._commanded.append(commanded)
        self.position = sent

    def is_held_back(self, commanded: Joints, velocity: Joints, planned: Joints) -> bool:
        """Whether the limiter or the robot holds an arm back.

        The arm is sent elsewhere than it was commanded lately, or is further behind than by its delay.

        Args:
            commanded: the position [rad], (7,).
            velocity: of that [rad/s], (7,).
            planned: where the robot plans to be [rad], (7,).
        """
        if self.position is not None and self._commanded:
            rows = zip(self.position, *self._commanded, strict=True)
            if any(
                not min(lately) - STANDSTILL_TOLERANCE <= sent <= max(lately) + STANDSTILL_TOLERANCE
                for sent, *lately in rows
            ):
                return True
        behind = zip(commanded, velocity, planned, strict=True)
        return any(not abs(to - now) <= _ELSEWHERE + _DELAYED * abs(speed) for to, speed, now in behind)


class StandstillDetector:
    """Detects that an arm that is held stands: what it is sent, its plan and its measurement, which come later.

    Controllers command in different ways: the command of one runs ahead of the arm, that of another is where the arm
    has to be now, with its speed beside it. Neither is a start for the other; standstill is.

    Args:
        state: when the arm was held.
        sent: what it is sent.
    """

    def __init__(self, state: ArmState, sent: SentPositions) -> None:
        self._planned, self._sent_positions = state.planned, sent
        self._sent = sent.position or state.position
        self._calm_cycles = 0
        self._time = 0.0

    def is_over(self, state: ArmState) -> bool:
        """Whether the arm stands by this new state; one that trembles counts as standing after a second."""
        moved, self._planned = largest_difference(state.planned, self._planned), state.planned
        sent, last = self._sent_positions.position or self._sent, self._sent
        self._sent = sent
        is_calm = moved <= STANDING * CYCLE and max(map(abs, state.velocity)) < STANDING
        is_calm = is_calm and largest_difference(sent, last) <= _SENT_STANDS
        self._calm_cycles = self._calm_cycles + 1 if is_calm else 0
        self._time += state.dt
        return self._calm_cycles >= _CALM_CYCLES or self._time > _LONGEST_WAIT
