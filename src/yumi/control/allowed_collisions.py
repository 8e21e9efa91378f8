"""Contact on purpose: pairs of parts that may touch for a while, slowly, where the collision limiter is on.

MoveIt's word: an allowed collision matrix. An entry here ends by itself, and as long as there is one no arm is faster
than :data:`CONTACT_SPEED_SCALE`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import TYPE_CHECKING

from yumi.control.collisions import CollisionLimiter
from yumi.control.events import AllowedCollisionsChanged
from yumi.control.limiter import FULL
from yumi.errors import CommandRefused

if TYPE_CHECKING:
    from yumi.control.loop import ArmLoop  # it has these

CONTACT_SPEED_SCALE = 0.1
"""No arm is faster than this share of its speeds while a collision is allowed."""

LONGEST = 60.0
"""A collision is allowed for so long at most [s]; asked for again, the time begins anew."""

Pair = tuple[str, str]


class AllowedCollisions:
    """The pairs of parts that may touch now: as soon as both arms are slow.

    Args:
        arms: both.
        collisions: what keeps them apart; None where nothing does.
        now: the time [s].
    """

    def __init__(self, arms: Sequence[ArmLoop], collisions: CollisionLimiter | None, now: Callable[[], float]) -> None:
        self._arms, self._collisions, self._now = arms, collisions, now
        self._until: dict[Pair, float] = {}
        self._first_end = inf
        self._permitted: tuple[Pair, ...] = ()
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
            raise CommandRefused(
                "There is nothing to allow: nothing keeps the arms apart, as collision.enabled is false in the "
                "driver's settings."
            )
        if not 0.0 < seconds <= LONGEST:  # NaN too
            raise CommandRefused(
                f"Collision not allowed: the time is {seconds:g} s; give more than 0, up to {LONGEST:g} s."
            )
        _check_parts(self._collisions, part, other, "Collision not allowed")
        if not self._until:
            try:
                for arm in self._arms:
                    arm.check_stands()
            except CommandRefused as why:
                raise CommandRefused(f"Collision not allowed, since contact is for slow motions: {why}") from why
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
            _check_parts(self._collisions, part, other, "Nothing was changed")

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
        if not self._events:
            return ()
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
        highest = CONTACT_SPEED_SCALE if self._until else FULL
        for arm in self._arms:
            arm.cap_speed(highest)
        permitted = tuple(self._until) if all(arm.speed_scale <= highest for arm in self._arms) else ()
        if permitted == self._permitted:
            return
        self._permitted = permitted
        self._collisions.permit(*permitted)
        self._events.append(AllowedCollisionsChanged(permitted))


def _check_parts(collisions: CollisionLimiter, part: str, other: str, what: str) -> None:
    if not collisions.pairs_of(part, other):
        raise CommandRefused(
            f"{what}: there are no two parts {part[:40]!r} and {other[:40]!r} that are kept apart; name them as the "
            "log does: 'right gripper' (with its fingers), 'right arm' (all of it), 'body', or a declared box."
        )


def _pair(part: str, other: str) -> Pair:
    """In one order, whichever is named first."""
    return (part, other) if part <= other else (other, part)
