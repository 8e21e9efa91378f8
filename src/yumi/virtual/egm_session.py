"""One EGM session on the robot's side: its counters, its queue, and when it is over."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from yumi.egm.messages import MciState
from yumi.robot.joints import Joints
from yumi.virtual.egm_settings import Axes, Bands


@dataclass(slots=True)
class EgmSession:
    """From the first datagram, number 0, to the last.

    Attributes:
        is_guided: whether EGMRun made it, so that replies move the arm; a position stream otherwise.
        cycles_per_datagram: SampleRate in cycles.
        queue_length: how many datagrams can wait for their cycle; the newest beyond are lost.
        cycle: cycles since the session began.
        seqno: number of the next datagram.
        mci: state that the next datagram tells.
        is_over: whether the next datagram is the last.
        has_sensor: whether any datagram of the sensor was accepted.
        silence: time since the sensor was last heard, or since the start [s].
        is_in_band: whether all selected joints are in their convergence bands.
        time_in_band: how long they have been there without a break [s].
        queue: datagrams that wait for their cycle, oldest first.
    """

    is_guided: bool
    cycles_per_datagram: int = 1
    queue_length: int = 256
    cycle: int = -1
    seqno: int = 0
    mci: MciState = MciState.STOPPED
    is_over: bool = False
    has_sensor: bool = False
    silence: float = 0.0
    is_in_band: bool = False
    time_in_band: float = 0.0
    queue: deque[bytes] = field(default_factory=deque)

    @property
    def is_due(self) -> bool:
        """Whether EGM exchanges datagrams in this cycle."""
        return self.is_over or self.cycle % self.cycles_per_datagram == 0

    def advance(self, dt: float, inbox: Iterable[bytes]) -> None:
        """Begin the next cycle with the datagrams that arrived since the last."""
        self.cycle += 1
        self.silence += dt if self.cycle else 0.0
        for datagram in inbox:
            if len(self.queue) < self.queue_length:
                self.queue.append(datagram)

    def next_seqno(self) -> int:
        seqno = self.seqno
        self.seqno += 1
        return seqno

    def hear(self) -> None:
        """Note that the sensor is alive."""
        self.has_sensor = True
        self.silence = 0.0

    def end(self, mci: MciState) -> None:
        """Let the next datagram be the last and tell ``mci``."""
        self.is_over, self.mci = True, mci

    def dwell(self, dt: float, *, is_in_band: bool) -> None:
        """Count the time in the convergence bands; it begins when the sensor has been heard."""
        self.time_in_band = self.time_in_band + dt if is_in_band and self.has_sensor else 0.0
        self.is_in_band = is_in_band

    def has_converged(self, cond_time: float) -> bool:
        """Whether the joints have been in their bands for ``cond_time`` [s]."""
        return self.is_in_band and self.has_sensor and self.time_in_band >= cond_time


def in_bands(ordered: Joints, measured: Joints, bands: Bands, axes: Axes) -> bool:
    """Whether every selected joint is within its band around the ordered position."""
    return all(
        low <= is_at - goal <= high
        for goal, is_at, (low, high), selected in zip(ordered, measured, bands, axes, strict=True)
        if selected
    )
