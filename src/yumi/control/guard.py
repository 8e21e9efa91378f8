"""The last station before the wire: no command leaves that a robot must never see.

It refuses what is not a number, keeps positions inside the joint limits, and lets the command move only as fast, and
change its motion only as quickly, as the joints may, measured from the command admitted before. Hold means: come to
rest, then repeat the last admitted command, not the measured position, which creeps under load.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, isfinite

from yumi.control.feed_forward import EGM_GAIN, FeedForward
from yumi.control.point_motion import slower
from yumi.control.shaper import MotionShaper
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Joints, joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO, ArmCommand, ArmState

FEEDBACK_DELAY = 0.050
"""By how much the measured speed may be behind the robot's own, at most [s]."""

_NO_LEAD = 1e-4  # [rad] less than the joints' resolution
_NO_TIME = 0.1  # of a period: nothing follows from how far something moved meanwhile
LATE_CYCLE = 1.25
"""A gap in the feedback gives no more room to move than a cycle late by a quarter: the robot takes it at once."""


@dataclass(slots=True)
class GuardCounters:
    """What the guard changed, in cycles.

    Attributes:
        refused: commands with a value that is no finite number; the arm held instead.
        position_limited: commands cut at a joint's range.
        slowed: commands that would have exceeded a joint's speed, acceleration or jerk.
    """

    refused: int = 0
    position_limited: int = 0
    slowed: int = 0


class Guard:
    """Admits commands of one arm.

    Attributes:
        counters: what it changed so far.
        longest_step: no command moves further than the joints may within this time [s].
        is_at_rest: whether the robot is told to stand, and no command leads it any more.

    Args:
        limits: what the joints may do; speeds, accelerations and jerks bound how the admitted position moves, and how
            the robot moves where a speed is fed forward too.
        period: time between two states of the arm [s].
        gain: of the robot's position loop [1/s].
    """

    def __init__(self, limits: JointLimits, period: float = CYCLE, gain: float = EGM_GAIN) -> None:
        self.counters = GuardCounters()
        self.longest_step = LATE_CYCLE * period
        self._shortest_step = _NO_TIME * period
        self._limits = limits
        self._session = 0
        self._shaper = MotionShaper(limits)
        self._feed_forward = FeedForward(limits, gain)
        self.is_at_rest = True

    def admit(self, state: ArmState, wanted: ArmCommand | None) -> ArmCommand:
        """The command that may leave, next to ``wanted``; None holds.

        The first command of a session, and every command while the robot does not follow, equals the measured
        position: a robot that begins to follow finds no step.
        """
        if wanted is not None and self._passes_at_once(state, wanted):
            return wanted
        dt = min(state.dt, self.longest_step)
        if state.session != self._session or not state.is_running:
            self._session = state.session
            return self._begin(state.position)
        if dt < self._shortest_step:
            return ArmCommand(self._shaper.position, self._feed_forward.velocity)
        if wanted is None or not self._may_go_on(state, wanted):
            return self._hold(state, dt)
        self.is_at_rest = False
        position = self._shape(self._inside(wanted.position), dt, state.dt)
        velocity = self._feed_forward.admit(state.planned, position, wanted.velocity, dt)
        if self._feed_forward.is_bounded and position == wanted.position:  # else it is counted already
            self.counters.slowed += 1
        return ArmCommand(position, velocity)

    def scale_speed(self, scale: float) -> None:
        """Lead no joint faster than ``scale`` times its limit, from the next command on."""
        limits = slower(self._limits, scale)
        self._shaper.limit(limits)
        self._feed_forward.limit(limits)

    def settle(self, state: ArmState) -> None:
        """After the reply to ``state``: prepare what makes the next one fast."""
        self._feed_forward.note(state.planned, self._shaper.position)
        if not self.is_at_rest and state.dt > 0.0 and self._is_near(state, 0.8):
            self._shaper.look_ahead(min(state.dt, self.longest_step))

    def _passes_at_once(self, state: ArmState, wanted: ArmCommand) -> bool:
        """Whether there is nothing to do about ``wanted``: what most commands are."""
        return (
            not self.is_at_rest
            and state.session == self._session
            and state.is_running
            and wanted.velocity is ZERO
            and self._feed_forward.velocity is ZERO
            and self._shaper.glides(wanted.position, state.dt)
        )

    def _begin(self, position: Joints) -> ArmCommand:
        self._shaper.rest_at(position)
        self._feed_forward.end()
        self.is_at_rest = True
        return ArmCommand(position)

    def _hold(self, state: ArmState, dt: float) -> ArmCommand:
        """Come to rest, then repeat the last admitted command.

        A command runs ahead of the robot by its speed over the loop gain; taking this lead back at the rate the
        acceleration allows brings the robot to rest on its way, not where the lead points.
        """
        if not self.is_at_rest:
            self._shaper.rest_at(self._with_less_lead(state, dt))
        position = self._shaper.position
        return ArmCommand(position, self._feed_forward.admit(state.planned, position, ZERO, dt))

    def _with_less_lead(self, state: ArmState, dt: float) -> Joints:
        last, planned = self._shaper.position, state.planned
        leads = [ahead - now for ahead, now in zip(last, planned, strict=True)]
        self.is_at_rest = max(map(abs, leads)) < _NO_LEAD and self._feed_forward.velocity is ZERO
        limits = zip(leads, state.velocity, self._limits.acceleration, strict=True)
        less = [_less_lead(lead, speed, gain, dt) for lead, speed, gain in limits]
        steps = zip(last, planned, less, self._limits.velocity, strict=True)
        return joints([old + max(-top * dt, min(top * dt, now + lead - old)) for old, now, lead, top in steps])

    def _shape(self, position: Joints, dt: float, elapsed: float) -> Joints:
        if self._shaper.passes(position, dt):
            return position
        self.counters.slowed += 1
        return self._shaper.approach(position, dt, elapsed)

    def _may_go_on(self, state: ArmState, wanted: ArmCommand) -> bool:
        if not isfinite(sum(wanted.position) + sum(wanted.velocity)):
            self.counters.refused += 1
            return False
        if not self._is_near(state, 1.0):
            self.counters.slowed += 1
            return False
        return True

    def _is_near(self, state: ArmState, share: float) -> bool:
        """Whether the robot's speed, and a ``share`` of what its acceleration can add, explain how far we are ahead.

        Else the robot does not get what we say, and all that piles up would reach it as one blow.
        """
        leads = zip(self._shaper.position, state.planned, state.velocity, self._limits.acceleration, strict=True)
        return all(abs(last - now) < share * _useful_lead(speed, gain) for last, now, speed, gain in leads)

    def _inside(self, position: Joints) -> Joints:
        """Cut at the range; an arm that stands outside of it may come back but not go further."""
        lower, upper, last = self._limits.lower, self._limits.upper, self._shaper.position
        if self._limits.outside(position) is None:
            return position
        self.counters.position_limited += 1
        ranges = zip(lower, upper, last, position, strict=True)
        return joints([max(min(low, now), min(max(high, now), value)) for low, high, now, value in ranges])


def _useful_lead(speed: float, acceleration: float) -> float:
    """The lead [rad] at which a robot seen at ``speed`` [rad/s] may have come to move; more does not move it faster."""
    return (abs(speed) + acceleration * FEEDBACK_DELAY) / EGM_GAIN


def _less_lead(lead: float, speed: float, acceleration: float, dt: float) -> float:
    """A lead [rad] after one step of braking."""
    return copysign(max(0.0, min(abs(lead), _useful_lead(speed, acceleration)) - acceleration / EGM_GAIN * dt), lead)
