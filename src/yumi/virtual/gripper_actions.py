"""What the gripper can be doing: each action shows its state, moves the fingers and knows when it is over."""

from __future__ import annotations

from typing import Protocol

from yumi.robot.gripper import MAX_FORCE, TRAVEL, HandState
from yumi.virtual.gripper_fingers import Fingers

JOG_SPEED = 0.010
STALL_TIME = 0.5
"""How long a free move may push against an obstacle before it is an error [s]."""

_PUSH = MAX_FORCE  # a free move and a jog push with what the motor has


class Action(Protocol):
    """One thing the motor does.

    Attributes:
        state: what ``hand_SysState`` shows.
        is_over: whether the next action may begin.
    """

    state: HandState
    is_over: bool

    def advance(self, fingers: Fingers, dt: float) -> float:
        """Let ``dt`` [s] pass; what is left of it when the action was over sooner."""


class FreeMove:
    """Go to a position; an obstacle is an error."""

    def __init__(self, state: HandState, target: float, speed: float) -> None:
        self.state = state
        self.is_over = False
        self._target, self._speed = target, speed
        self._stalled = 0.0

    def advance(self, fingers: Fingers, dt: float) -> float:
        left = fingers.drive(self._target, self._speed, _PUSH, dt)
        if fingers.opening == self._target:
            self.state, self.is_over = HandState.ACTION_COMPLETED, True
            return left
        self._stalled += left
        if self._stalled >= STALL_TIME:
            self.state, self.is_over = HandState.ERROR, True
        return 0.0


class Grip:
    """Close in on something and hold it; coming to the end of the way means that there was nothing."""

    def __init__(self, state: HandState, target: float, speed: float, force: float) -> None:
        self.state = state
        self.is_over = False
        self._gripping = state
        self._target, self._speed, self._force = target, speed, force

    def advance(self, fingers: Fingers, dt: float) -> float:
        left = fingers.drive(self._target, self._speed, self._force, dt)
        if fingers.opening == self._target:
            self.state, self.is_over = HandState.ACTION_COMPLETED, True
            return left
        stands_with_force = fingers.speed == 0.0 and fingers.force >= self._force
        self.state = HandState.KEEP_OBJECT if stands_with_force else self._gripping
        return 0.0


class Jog:
    """Open or close without knowing where the fingers are, until told to stop or, if asked, until they stand."""

    def __init__(self, *, opens: bool, ends_at_standstill: bool = False) -> None:
        self.state = HandState.JOG_OPEN if opens else HandState.JOG_CLOSE
        self.is_over = False
        self._target = TRAVEL if opens else 0.0
        self._ends_at_standstill = ends_at_standstill

    def advance(self, fingers: Fingers, dt: float) -> float:
        left = fingers.drive(self._target, JOG_SPEED, _PUSH, dt)
        if fingers.speed != 0.0 or not self._ends_at_standstill:
            return 0.0
        self.is_over = True
        return left


class Pause:
    """Do nothing in a state for a while [s]."""

    def __init__(self, state: HandState, duration: float, *, state_after: HandState) -> None:
        self.state = state
        self.is_over = False
        self._left, self._state_after = duration, state_after

    def advance(self, fingers: Fingers, dt: float) -> float:
        fingers.rest()
        self._left -= dt
        if self._left > 0.0:
            return 0.0
        self.state, self.is_over = self._state_after, True
        return -self._left
