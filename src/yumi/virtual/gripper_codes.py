"""What the Smart Gripper says and hears on its I/O: commands and states by number (reference/statemachine.md §5.3)."""

from __future__ import annotations

from enum import IntEnum


class GripperCommand(IntEnum):
    """``hand_CmdGripper``."""

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


class GripperState(IntEnum):
    """``hand_SysState``."""

    READY = 0
    ERROR = 1
    FREE_MOVE_TO_MAX_POS = 2
    FREE_MOVE_TO_MIN_POS = 3
    ACTION_COMPLETED = 6
    KEEP_OBJECT = 9
    CALIBRATION = 10
    JOG_OPEN = 11
    JOG_CLOSE = 12
    AGILE_GRIP_INWARD = 16
    AGILE_GRIP_OUTWARD = 17
