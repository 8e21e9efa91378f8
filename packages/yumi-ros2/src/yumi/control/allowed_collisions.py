"""Contact on purpose: pairs of parts that may touch for a while, slowly, where the collision limiter is on.

This is MoveIt's allowed collision matrix, but that each entry ends by itself, and that no arm is faster
than :data:`CONTACT_SPEED_SCALE` as long as there is one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from yumi.control.collisions import CollisionLimiter
from yumi.control.loop import ArmLoop
from yumi.control.loop_events import AllowedCollisionsChanged
from yumi.control.speed_scale import FULL_SPEED

CONTACT_SPEED_SCALE = 0.1
"""No arm is faster than this share of its speeds while a collision is allowed."""

_LONGEST_CONTACT = 60.0
"""A collision is allowed for so long at most [s]; asked for again, the time begins anew."""

_PartPair = tuple[str, str]


class AllowedCollisions:
    """The pairs of parts that may touch now: as soon as both arms are slow.

    Args:
        arms: both.
        collisions: what keeps them apart; None where nothing does.
        now: the time [s].
    """

    def __init__(self, arms: Sequence[ArmLoop], collisions: CollisionLimiter | None, now: Callable[[], float]) -> None:
        self._arms, self._collisions, self._now = arms, collisions, now
        self._until: dict[_PartPair, float] = {}
        self._first_end = inf
        self._permitted: tuple[_PartPair, ...] = ()
        self._running: list[bool] = []  # of each arm, when it was looked at last
        self._events: list[AllowedCollisionsChanged] = []

    def allow(self, part: str, other: str, seconds: float) -> None:
        """Let two parts touch for a time [s]; the same pair again begins anew.

        The arms become slow first, which takes a third of a second, and nothing may touch before.

        Raises:
            CommandRefused: the limiter is off, there are no such parts, the time is out of range, or an arm moves
                or is held before its goal.
        """
        if self._collisions is None:
            raise CommandRefused(message("nothing_to_allow"))
        if not 0.0 < seconds <= _LONGEST_CONTACT:  # NaN too
            raise CommandRefused(message("contact_time_out_of_range", time=seconds, longest=_LONGEST_CONTACT))
        _check_parts(self._collisions, part, other)
        if not self._until:
            try:
                for arm in self._arms:
                    arm.check_stands()
            except CommandRefused as why:
                raise CommandRefused(message("contact_is_for_slow_motions", reason=why.said)) from why
            self._running = [arm.is_running for arm in self._arms]
        self._until[_pair(part, other)] = self._now() + seconds
        self._update()

    def end(self, part: str, other: str) -> None:
        """Keep two parts apart again; nothing where they are.

        Raises:
            CommandRefused: there are no such parts: others would go on touching.
        """
        if self._until.pop(_pair(part, other), None) is not None:
            self._update()
        elif self._collisions is not None:
            _check_parts(self._collisions, part, other)

    def take_events(self) -> Sequence[AllowedCollisionsChanged]:
        """End what has lasted its time, permit what waits for the arms, and return what has changed since.

        All of it ends when an arm stops following or is not heard any more: what it was for is over.
        """
        if self._until and self._has_stopped():
            self._until.clear()
            self._update()
        elif self._now() >= self._first_end:
            now = self._now()
            self._until = {pair: until for pair, until in self._until.items() if until > now}
            self._update()
        elif len(self._permitted) < len(self._until):
            self._update()
        events, self._events = self._events, []
        return events

    def _has_stopped(self) -> bool:
        """Whether an arm that followed does no longer."""
        before, self._running = self._running, [arm.is_running for arm in self._arms]
        return any(was and not runs for was, runs in zip(before, self._running, strict=True))

    def _update(self) -> None:
        """Have the arms slow as long as anything is allowed, and permit that once they are."""
        assert self._collisions is not None  # else nothing is allowed
        self._first_end = min(self._until.values(), default=inf)
        highest = CONTACT_SPEED_SCALE if self._until else FULL_SPEED
        for arm in self._arms:
            arm.cap_speed(highest)
        permitted = tuple(self._until) if all(arm.speed_scale <= highest for arm in self._arms) else ()
        if permitted == self._permitted:
            return
        self._permitted = permitted
        self._collisions.permit(*permitted)
        self._events.append(AllowedCollisionsChanged(permitted))


def _check_parts(collisions: CollisionLimiter, part: str, other: str) -> None:
    if not collisions.pairs_of(part, other):
        raise CommandRefused(message("no_such_parts", part=part, other=other))


def _pair(part: str, other: str) -> _PartPair:
    """In one order, whichever is named first."""
    return (part, other) if part <= other else (other, part)
