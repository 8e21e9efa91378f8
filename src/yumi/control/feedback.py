"""What an arm's feedback is worth: whether it can be true.

That is decided by physics, not by the protocol, which does not prove it
(docs/explanation/decisions/0014-feedback-is-doubted.md).
"""

from __future__ import annotations

from collections.abc import Callable
from math import dist, inf

from yumi.robot.joints import CYCLE, YUMI_LIMITS, ZERO, ArmState, JointLimits, Joints, change_rate

DOUBTED = 5
"""An implausible position counts as a datagram that did not come; after so many in a row the arm holds."""

LOST = 20
"""After so many in a row the feedback is lost, as after 80 ms without a datagram."""

OUTSIDE = 0.01
"""How far outside of its range a joint may stand [rad]: its first command is the end of the range, so near that the
robot does not jump there. An arm further out gets no reply."""

LONGEST = 0.1
"""Longest motion that may explain a position while others are implausible [s]."""

FOLLOWED = 2.0 * CYCLE
"""The same of a robot that follows: it is on the way to what was sent [s]."""

EXCHANGED = 0.5
"""An implausible position as near to the other arm's as this is the other arm's [rad, over all joints]."""

_MARGIN = 0.02  # [rad] a measured position may differ by from what a joint's speed explains
_AGREEING = 3  # so many datagrams that agree with each other outweigh as many of the session before them
_FEW = 25  # a session that was plausible for longer is not outweighed
_SPEEDS = YUMI_LIMITS.velocity  # of the arm itself, whatever our limits are: RAPID may have moved it
_SLOWEST = min(_SPEEDS)


class FeedbackCheck:
    """Whether an arm can be where a datagram says, by the joints' highest speeds.

    Args:
        limits: of the joints.
        other_arm: where the robot's other arm was measured last [rad], (7,); None where that is not known.

    Attributes:
        implausible: states that no arm can have reached.
        in_a_row: those since the last plausible one.
        position: the implausible position that came last [rad], (7,).
        is_other_arm: whether that is where the other arm is, and not this one: their datagrams were exchanged.
    """

    def __init__(self, limits: JointLimits, other_arm: Callable[[], Joints | None]) -> None:
        self.implausible = self.in_a_row = 0
        self.position: Joints = ZERO
        self.is_other_arm = False
        self._limits = limits
        self._other_arm = other_arm
        self._last: ArmState | None = None  # the last plausible state
        self._support = 0  # plausible states since the session began
        self._doubt: ArmState | None = None  # the last implausible state since then
        self._agreeing = 0  # implausible states that agree with each other

    def begin(self) -> None:
        """A session begins with the next accepted state."""
        self._support = 0

    @property
    def is_lost(self) -> bool:
        """Whether so many states in a row were implausible that the arm is not known to be anywhere."""
        return self.in_a_row >= LOST

    def is_start(self, state: ArmState, sent: Joints) -> bool:
        """Whether an arm can be there that got no command since it was sent to the position ``sent`` [rad], (7,)."""
        rows = zip(self._limits.lower, self._limits.upper, state.position, strict=True)
        is_near_range = all(low - OUTSIDE <= now <= high + OUTSIDE for low, high, now in rows)
        return is_near_range and _is_near_plan(state) and (self._last is None or self._can_follow(state, sent, inf))

    def is_plausible(self, state: ArmState, sent: Joints) -> bool:
        """Whether the arm can be where ``state`` says, and plan to be where it says, after the last plausible state.

        While the robot may follow, it may have gone to the position ``sent`` last.
        """
        last = self._last
        if last is None:
            return self.is_start(state, sent)
        if not self.in_a_row:  # nearly always all joints together have moved less than one may
            reach = _SLOWEST * state.dt + _MARGIN
            if dist(state.position, last.position) <= reach and dist(state.planned, last.planned) <= reach:
                return True
        follows = state.is_running and last.is_running  # so nothing but what is sent has moved it
        return self._can_follow(state, sent, inf if not self.in_a_row else FOLLOWED if follows else LONGEST)

    def accept(self, state: ArmState) -> ArmState:
        """``state`` is plausible; its velocity is corrected where it was that from or to a false position."""
        if self.in_a_row and self._last is not None:
            passed = max(state.dt, state.time - self._last.time)
            velocity = change_rate(state.position, self._last.position, passed) if passed > 0.0 else ZERO
            state = state._replace(velocity=velocity)
        self.in_a_row, self._doubt = 0, None
        self._support += 1
        self._last = state
        return state

    def reject(self, state: ArmState) -> None:
        """``state`` is implausible."""
        self.implausible += 1
        self.in_a_row += 1
        self._doubt, self.position = state, state.position
        other = self._other_arm()
        own = dist(state.position, self._last.position) if self._last else inf
        self.is_other_arm = other is not None and dist(state.position, other) < min(EXCHANGED, own)

    def replace(self, state: ArmState) -> tuple[ArmState, bool]:
        """What to use in place of an implausible ``state``, which is counted, and whether it is the state itself.

        It is the last plausible position; or this one, at rest, if enough others agree with it and it is not the other
        arm's: as many of those agree with each other as datagrams are exchanged.
        """
        before = self._doubt
        self.reject(state)
        agrees = False
        if before is not None and _is_near_plan(state):  # an arm can be in both states, one after the other
            time = max(state.dt, state.time - before.time)
            rows = zip(before.position, state.position, _SPEEDS, strict=True)
            agrees = all(abs(new - old) <= speed * time + _MARGIN for old, new, speed in rows)
        self._agreeing = self._agreeing + 1 if agrees else 1
        is_outweighed = self._agreeing >= max(_AGREEING, self._support) and self._support < _FEW
        is_elsewhere = not state.is_running and self._agreeing >= _FEW  # motors off: it may have been moved by hand
        is_possible = not self.is_other_arm and self._limits.outside(state.position) is None
        if self._last is None or ((is_outweighed or is_elsewhere) and is_possible):
            self._last = state._replace(velocity=ZERO)
            return self.accept(state), True
        return self._last._replace(time=state.time, dt=state.dt, session=state.session), False

    def _can_follow(self, state: ArmState, sent: Joints, longest: float) -> bool:
        """Whether the joints' speeds explain the way from the last plausible state, or from there to ``sent``.

        The robot's clock and ours may differ by what a network delays.
        """
        last = self._last
        assert last is not None
        time = min(max(state.dt, state.time - last.time), longest)
        for before, after in ((last.position, state.position), (last.planned, state.planned)):
            for old, new, goal, speed in zip(before, after, sent, _SPEEDS, strict=True):
                room = speed * time + _MARGIN
                if not min(old, goal) - room <= new <= max(old, goal) + room:
                    return False
        return True


def _is_near_plan(state: ArmState) -> bool:
    """Whether the measured position is one that a servo has on the way to the planned one."""
    rows = zip(state.position, state.planned, _SPEEDS, strict=True)
    return all(abs(plan - now) <= speed * LONGEST + _MARGIN for now, plan, speed in rows)
