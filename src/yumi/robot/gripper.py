"""The Smart Gripper: its ranges and modules, what it says and hears by number, and how a command can end."""

from __future__ import annotations

from enum import Enum, IntEnum

TOP_SPEED = 0.025
"""Highest speed of each finger [m/s] (reference/yumi.md §2.1)."""

LOWEST_SPEED = 0.003
"""Lowest speed the drive takes [m/s] (reference/statemachine.md §5.3)."""

TRAVEL = 0.025
"""From closed to open, per finger [m] (reference/yumi.md §2.1)."""

MAX_FORCE = 20.0
"""Largest holding force [N]."""

ALLOWANCE = 0.001
"""How far from where they were sent the fingers may end [m]; the hand's own (reference/yumi.md §2.1)."""

THINNEST = 0.0005
"""Nothing fits between fingers that are nearer than this to the middle [m]."""


ATMOSPHERE = 100_000.0
"""What the pressure sensor of a vacuum module shows at rest [Pa]."""


class GripperModules(Enum):
    """What a hand is made of: each has the servo with its fingers; the value is the word in the settings."""

    SERVO = "servo"
    VISION = "servo+vision"
    VACUUM = "servo+vacuum"
    VISION_VACUUM = "servo+vision+vacuum"
    TWO_VACUUMS = "servo+vacuum+vacuum"

    @property
    def has_camera(self) -> bool:
        return "vision" in self.value

    @property
    def vacuum_channels(self) -> tuple[int, ...]:
        """The numbers of its vacuum modules: none, 1, or 1 and 2."""
        return tuple(range(1, 1 + self.value.count("vacuum")))


class Direction(Enum):
    """Which way the fingers grip."""

    INWARDS = "inwards"
    OUTWARDS = "outwards"


class HandCommand(IntEnum):
    """``hand_CmdGripper`` (reference/statemachine.md §5.3)."""

    NONE = 0
    JOG_OPEN = 1
    JOG_CLOSE = 2
    FREE_MOVE_TO_MAX_POS = 3
    FREE_MOVE_TO_MIN_POS = 4
    GO_TO_ERROR = 9
    GO_TO_READY = 10
    GO_TO_CALIBRATION = 11
    AGILE_GRIP_INWARD = 15
    AGILE_GRIP_OUTWARD = 16


class HandState(IntEnum):
    """``hand_SysState`` (reference/statemachine.md §5.3)."""

    READY = 0
    ERROR = 1
    FREE_MOVE_TO_MAX_POS = 2
    FREE_MOVE_TO_MIN_POS = 3
    GRIP_OUTWARD_IN = 4
    GRIP_INWARD_OUT = 5
    ACTION_COMPLETED = 6
    FORCING_OUTWARD_IN = 7
    FORCING_INWARD_OUT = 8
    KEEP_OBJECT = 9
    CALIBRATION = 10
    JOG_OPEN = 11
    JOG_CLOSE = 12
    CHIRALITY_CHANGING = 15
    AGILE_GRIP_INWARD = 16
    AGILE_GRIP_OUTWARD = 17


_CLOSING = frozenset(
    {
        HandState.FREE_MOVE_TO_MIN_POS,
        HandState.GRIP_OUTWARD_IN,
        HandState.FORCING_OUTWARD_IN,
        HandState.JOG_CLOSE,
        HandState.AGILE_GRIP_INWARD,
    }
)


def signed_speed(speed: float, state: HandState) -> float:
    """Speed of each finger, positive when opening [m/s]; the hand itself tells only how fast."""
    return -speed if state in _CLOSING else speed


class Outcome(Enum):
    """How a gripper command ended; the value says it in words."""

    OPEN = "open"
    CLOSED = "closed"
    IN_PLACE = "in place"
    HOLDING = "holding"
    STALLED = "stalled"


def outcome_of(position: float, effort: float, *, stalled: bool, reached_goal: bool) -> Outcome:
    """How a command ended, from the result as ``control_msgs/action/GripperCommand`` has it.

    Args:
        position: distance of each finger from the middle [m].
        effort: what the fingers press with [N]; 0 when they hold nothing.
        stalled: whether something stopped the fingers.
        reached_goal: whether they are where they were sent.
    """
    if stalled and effort > 0.0:
        return Outcome.HOLDING
    if stalled or not reached_goal:
        return Outcome.STALLED
    if position <= ALLOWANCE:
        return Outcome.CLOSED
    return Outcome.OPEN if position >= TRAVEL - ALLOWANCE else Outcome.IN_PLACE
