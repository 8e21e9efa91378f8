"""The port of an arm: what the fast line needs from hardware, real, virtual or perfect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from yumi.robot.values import ArmCommand, ArmState


@dataclass(frozen=True, slots=True)
class WireCounters:
    """What an arm's connection has seen so far.

    Attributes:
        session: number of the session, 0 before the first.
        missed: states the robot sent that got no answer of their own.
        stale: old or repeated states left aside.
        malformed: datagrams that could not be read.
    """

    session: int = 0
    missed: int = 0
    stale: int = 0
    malformed: int = 0


class ArmPort(Protocol):
    """One arm that reports a state and takes one command for it."""

    def read(self, now: float) -> ArmState | None:
        """The newest state that has not been read yet, or None; never waits.

        Args:
            now: time on the machine's monotonic clock [s].
        """

    def write(self, command: ArmCommand) -> None:
        """Answer the state read last; to be called once after each state."""

    def lost_after(self, now: float) -> float | None:
        """How long the robot has been silent [s], told once when it has become too long; else None."""

    def wire_counters(self) -> WireCounters:
        """What the connection has seen so far."""
