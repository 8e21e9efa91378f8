"""What kind of controller the robot's side of EGM is: its datagrams, its clock, its faults."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

CYCLE = 0.004032
"""Period of the motion control of a real controller [s] (reference/egm.md §2.5)."""

VIRTUAL_CYCLE = 0.004
"""Period of ABB's own virtual controller [s]."""


class RobotWare(Enum):
    """Whose datagrams the arm sends (reference/egm.md §1.4)."""

    RW_6_09 = auto()
    RW_6_10 = auto()


class InvalidReference(Enum):
    """What a reference that is no finite number does."""

    SYSTEM_FAILURE = auto()
    """The controller fails and has to be restarted, as real ones did (reference/egm.md §4.5)."""

    REJECT = auto()
    """The datagram is left aside and counted."""


@dataclass(frozen=True, slots=True)
class EgmOptions:
    """Options of one arm's EGM client.

    Attributes:
        robotware: whose profile the datagrams have.
        cycle_time: period of motion control [s].
        queue_length: datagrams the operating system keeps for a reader that takes one per cycle; the newest beyond
            are lost.
        invalid_reference: what NaN and infinity do.
        tells_rapid_state: False for the fault some controllers have after a restart: their datagrams call RAPID's
            state undefined, whatever it is (reference/egm.md §3.3).
    """

    robotware: RobotWare = RobotWare.RW_6_09
    cycle_time: float = CYCLE
    queue_length: int = 256
    invalid_reference: InvalidReference = InvalidReference.SYSTEM_FAILURE
    tells_rapid_state: bool = True
