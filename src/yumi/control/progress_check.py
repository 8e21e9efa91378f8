"""The progress check: an arm that is limited and comes no nearer to where it is commanded is held."""

from __future__ import annotations

from collections.abc import Callable
from math import dist, inf
from typing import NamedTuple

from yumi.control.shared_state import Limited
from yumi.robot.collision import Array
from yumi.robot.joints import ZERO, ArmCommand, Joints


class Surroundings(NamedTuple):
    """What an arm is limited by, besides what stands still.

    Attributes:
        position: that the other arm is sent to [rad], (7,); None of one that is unknown.
        heard: what is known of it: whether it is heard, was read, and may not have come to where it was sent.
        margins: of all pairs of parts.
        is_limited: whether the other arm is limited itself.
    """

    position: Joints | None
    heard: tuple[bool, bool, bool]
    margins: Array
    is_limited: bool


_LIMITED_FOR = 0.15  # [s] an arm may be limited for so long without getting nearer to where it is commanded
_NEARER = 1e-3  # [rad] by less it is no nearer
_NEARER_SHARE = 0.1  # nor by less than this share of what is left
_SAME = 5e-4  # [rad] a position desired that changes by less is the same
_OWN = 0.5  # a proportional controller's changes with the arm itself, by less than this share of its motion
_SAME_SPEED = 1e-2  # [rad/s]
_ELSEWHERE = 0.02  # [rad] when the other arm has moved by this, an arm that is held tries again


class ProgressCheck:
    """Whether an arm that is limited still comes nearer to where it is commanded; else it is held.

    Two arms that are pushed at each other each slide along a boundary that the other one moves, for ever. So an arm
    that is limited has to come nearer in joint space, or it holds until it is commanded something else, or what limits
    it has changed. If the other arm is limited itself, it has to move twice as far each time that trying again was of
    no use; so both come to rest.

    Attributes:
        limited: what limits an arm that is held.
    """

    def __init__(self) -> None:
        self.limited: Limited | None = None
        self._held_by: Surroundings | None = None  # as they were when it was held; None while it is not
        self._desired: ArmCommand | None = None
        self._measured: Joints = ZERO  # where it was when it was commanded that
        self._nearest = inf  # [rad] how near it was sent to the position desired since
        self._limited_for = 0.0  # [s] without getting nearer than that
        self._elsewhere = _ELSEWHERE

    @property
    def is_limited(self) -> bool:
        """Whether it has been limited since it came nearer to where it is commanded."""
        return self._limited_for > 0.0 or self._held_by is not None

    def holds(
        self,
        desired: ArmCommand | None,
        measured: Joints,
        sent: Joints,
        dt: float,
        limited: Limited | None,
        surroundings: Callable[[], Surroundings],
    ) -> bool:
        """Whether the arm is to hold whatever is desired; to be asked in every cycle.

        Args:
            desired: what it is commanded; None for nothing.
            measured: where it is [rad], (7,).
            sent: the position it was sent last [rad], (7,).
            dt: time since the cycle before [s].
            limited: what limited it in that cycle, unless it was too fast to be led along a boundary.
            surroundings: returns them as they are now.
        """
        if desired is None or not self._is_same(desired, measured):
            self._begin(desired, measured, inf if desired is None else dist(desired.position, sent))
            return False
        if self._held_by is not None:
            if not self._have_changed(self._held_by, surroundings()):
                return True
            self._held_by, self.limited, self._limited_for = None, None, 0.0
            return False
        far = dist(desired.position, sent)
        if far < self._nearest - min(_NEARER, _NEARER_SHARE * self._nearest):
            self._begin(desired, measured, far)
        elif limited is not None:
            self._limited_for += dt
            if self._limited_for > _LIMITED_FOR:
                self._held_by, self.limited = surroundings(), limited
                self._desired, self._measured = desired, measured
        return self._held_by is not None

    def _begin(self, desired: ArmCommand | None, measured: Joints, far: float) -> None:
        self._desired, self._measured, self._nearest = desired, measured, far
        self._held_by, self.limited = None, None
        self._limited_for, self._elsewhere = 0.0, _ELSEWHERE

    def _have_changed(self, before: Surroundings, now: Surroundings) -> bool:
        """Whether what holds the arm has changed by so much that it tries again."""
        if before.heard != now.heard or before.margins is not now.margins:
            self._elsewhere = _ELSEWHERE
            return True
        if before.position is now.position or before.position is None or now.position is None:
            return before.position is not now.position
        if not now.is_limited:  # it goes where it wants to: it is not pushed away by this one
            self._elsewhere = _ELSEWHERE
        if dist(before.position, now.position) <= self._elsewhere:
            return False
        self._elsewhere *= 2.0
        return True

    def _is_same(self, desired: ArmCommand, measured: Joints) -> bool:
        """Whether the arm is commanded the same as before, but for noise and for what its own motion makes of it."""
        last = self._desired
        if last is None:
            return False
        if desired.position == last.position and desired.velocity == last.velocity:
            return True
        moved = dist(measured, self._measured)
        is_same_speed = dist(desired.velocity, last.velocity) <= _SAME_SPEED
        return is_same_speed and dist(desired.position, last.position) <= _SAME + _OWN * moved
