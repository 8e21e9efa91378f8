"""The cycle: one datagram in, one reply out. The robot's datagram is the clock; nothing else runs here.

:class:`ArmPort` is what it needs of an arm's hardware, real or virtual.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from yumi.control.controller import DECODE, LIMIT, UPDATE, StageClock
from yumi.control.controller_manager import ControllerManager
from yumi.control.counters import WireCounters
from yumi.control.limiter import Limiter
from yumi.control.motion import largest_difference
from yumi.robot.joints import ArmCommand, ArmState


class ArmPort(Protocol):
    """One arm that reports a state and takes one command for it."""

    def read(self, now: float) -> ArmState | None:
        """The newest state that has not been read yet, or None; never waits.

        Args:
            now: time on the machine's monotonic clock [s].
        """

    def write(self, command: ArmCommand) -> None:
        """Answer the state read last; to be called once after each state."""

    def silence(self, now: float) -> float:
        """Time since the newest state [s]."""

    def lost_after(self, now: float) -> float | None:
        """How long the robot has been silent [s], returned once, when it has become too long; else None."""

    def wire_counters(self) -> WireCounters:
        """What the connection has seen so far."""


class Cycle(NamedTuple):
    """What happened in one cycle.

    Attributes:
        state: what the arm reported, as far as it is plausible.
        desired: the command of the controllers; None where they hold.
        sent: the command that the limiter made of it.
    """

    state: ArmState
    desired: ArmCommand | None
    sent: ArmCommand

    @property
    def beyond(self) -> float:
        """How much further the controllers command the arm than it is sent [rad]."""
        return largest_difference(self.desired.position, self.sent.position) if self.desired is not None else 0.0


def run_cycle(
    arm: ArmPort, manager: ControllerManager, limiter: Limiter, now: float, timing: StageClock
) -> Cycle | None:
    """Reply to the newest state of ``arm``; None when there is no new one that can be replied to."""
    reported = timing.timed(DECODE, arm.read(now))
    state = None if reported is None else limiter.check(reported)
    if state is None:
        return None
    desired = timing.timed(UPDATE, manager.update(state))
    sent = timing.timed(LIMIT, limiter.limit(state, desired))
    if limiter.was_late:  # the core has answered
        return None
    arm.write(sent)
    return Cycle(state, desired, sent)
