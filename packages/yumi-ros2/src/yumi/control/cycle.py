"""The cycle: one datagram in, one reply out, through the port of an arm.

The robot's datagram is the clock; nothing else runs here.

:class:`ArmPort` is what it needs of an arm's hardware, real or virtual.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from abb_protocols.robot.joints import ArmCommand, ArmState
from yumi.control.counters import WireCounters
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.motion.setpoint import largest_difference
from yumi.control.sampled import Sampled
from yumi.control.stage_times import UPDATE_STAGE, StageClock


class ArmPort(Protocol):
    """One arm that reports a state and takes one command for it."""

    def receive(self, now: float) -> ArmState | None:
        """The newest state to be answered, as far as it is plausible, or None; never waits.

        Args:
            now: time on the machine's monotonic clock [s].
        """

    def reply(self, desired: ArmCommand | None) -> ArmCommand | None:
        """Answer the state received last; to be called once after each state.

        Args:
            desired: by the controllers; None holds.

        Returns:
            The command that was sent, within the limits; None where the state was answered meanwhile.
        """

    def settle(self, state: ArmState) -> None:
        """After the reply to ``state``: what the next one depends on."""

    def prepare(self, sampled: Sampled | None, session: int) -> None:
        """Answer the next state by this formula as soon as it comes; :meth:`receive` and :meth:`reply` still follow.

        It holds for the next wait for states only.

        Args:
            sampled: the formula; None: nothing is answered before.
            session: in which it holds, that of the state received last.
        """

    def take_braked(self) -> Sequence[Cycle]:
        """The cycles since the last call that were answered for the controllers, oldest first."""

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


def run_cycle(arm: ArmPort, manager: ControllerManager, now: float, timing: StageClock) -> Cycle | None:
    """Reply to the newest state of ``arm``; None when there is no new one that can be replied to."""
    state = arm.receive(now)
    if state is None:
        return None
    desired = manager.update(state)
    timing.note(UPDATE_STAGE)
    sent = arm.reply(desired)
    return None if sent is None else Cycle(state, desired, sent)
