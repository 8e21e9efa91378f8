"""What an arm's feedback is worth: whether it can be true.

That is decided by physics, not by the protocol, which does not prove it
(docs/explanation/decisions/0014-feedback-is-doubted.md): have the joints' highest speeds led the arm there?
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
"""By what a joint moves in this time, a measured position may be behind the planned one [s]."""

FOLLOWED = 2.0 * CYCLE
"""A robot that follows is on the way to what was sent, or was by so much longer on the way before [s]."""

EXCHANGED = 0.5
"""An implausible position as near to the other arm's as this is the other arm's [rad, over all joints]."""

_MARGIN = 0.02  # [rad] a measured position may differ by from what a joint's speed explains
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

    @property
    def is_lost(self) -> bool:
        """Whether so many states in a row were implausible that the arm is not known to be anywhere."""
        return self.in_a_row >= LOST

    def is_start(self, state: ArmState, sent: Joints) -> bool:
        """Whether an arm can be there at the begin of a session, that was sent to the position ``sent`` [rad], (7,).

        It may have been moved to where the other one is since the last plausible state, but not in a doubt.
        """
        rows = zip(self._limits.lower, self._limits.upper, state.position, strict=True)
        is_near_range = all(low - OUTSIDE <= now <= high + OUTSIDE for low, high, now in rows)
        is_exchanged = self.in_a_row > 0 and self._is_of_other_arm(state)
        is_possible = is_near_range and _is_near_plan(state) and not is_exchanged
        return is_possible and (self._last is None or self._can_reach(self._last, state, sent, inf))

    def is_plausible(self, state: ArmState, sent: Joints) -> bool:
        """Whether the arm can be where ``state`` says, and plan to be where it says, after the last plausible state.

        While the robot may follow, it may have gone to the position ``sent`` last. In doubt a robot that follows can be
        on this way only. An arm that does not, with its motors off, may have been moved by hand: then its time since
        the last plausible state explains it.
        """
        last = self._last
        assert last is not None  # a session begins with a plausible state
        if not self.in_a_row:  # nearly always all joints together have moved less than one may
            reach = _SLOWEST * state.dt + _MARGIN
            if dist(state.position, last.position) <= reach and dist(state.planned, last.planned) <= reach:
                return True
        elif self._is_of_other_arm(state) or not _is_near_plan(state):
            return False
        is_led = self.in_a_row and state.is_running and last.is_running  # so nothing but what is sent has moved it
        return self._can_reach(last, state, sent, FOLLOWED if is_led else inf)

    def accept(self, state: ArmState) -> ArmState:
        """``state`` is plausible; its velocity is corrected where it was that from or to a false position."""
        if self.in_a_row and self._last is not None:
            passed = max(state.dt, state.time - self._last.time)
            velocity = change_rate(state.position, self._last.position, passed) if passed > 0.0 else ZERO
            state = state._replace(velocity=velocity)
        self.in_a_row = 0
        self._last = state
        return state

    def reject(self, state: ArmState) -> ArmState:
        """``state`` is implausible; the last plausible position in place of it, or itself before the first."""
        self.implausible += 1
        self.in_a_row += 1
        self.position, self.is_other_arm = state.position, self._is_of_other_arm(state)
        return (self._last or state)._replace(time=state.time, dt=state.dt, session=state.session)

    def _is_of_other_arm(self, state: ArmState) -> bool:
        """Whether a position is near where the other arm was measured, and nearer than to where this one was."""
        other = self._other_arm()
        own = dist(state.position, self._last.position) if self._last else inf
        return other is not None and dist(state.position, other) < min(EXCHANGED, own)

    def _can_reach(self, last: ArmState, state: ArmState, sent: Joints, longest: float) -> bool:
        """Whether the joints' speeds explain the way from ``last``, or from there to ``sent``, in the time between.

        The robot's clock and ours may differ by what a network delays.
        """
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
