"""The cycle: one datagram in, one reply out. The robot's datagram is the clock; nothing else runs here."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.control.guard import Guard
from yumi.control.manager import ControllerManager
from yumi.control.port import ArmPort
from yumi.control.stations import ADMIT, DECODE, UPDATE, StationClock
from yumi.robot.values import ArmCommand, ArmState


@dataclass(frozen=True, slots=True)
class Cycle:
    """What happened in one cycle.

    Attributes:
        state: what the arm reported, as far as the guard believes it.
        wanted: what the controllers wanted; None where they wanted it to hold.
        admitted: what the guard let through and the arm was told.
    """

    state: ArmState
    wanted: ArmCommand | None
    admitted: ArmCommand


def run_cycle(
    arm: ArmPort, manager: ControllerManager, guard: Guard, now: float, stations: StationClock
) -> Cycle | None:
    """Answer the newest state of ``arm``; None when there is no new one that can be. ``stations`` only looks on."""
    reported = stations.timed(DECODE, arm.read(now))
    state = None if reported is None else guard.believe(reported)
    if state is None:
        return None
    wanted = stations.timed(UPDATE, manager.update(state))
    admitted = stations.timed(ADMIT, guard.admit(state, wanted))
    arm.write(admitted)
    return Cycle(state, wanted, admitted)
