"""Why the virtual controller says no; each wire adapter gives the reason its own code."""

from __future__ import annotations

from enum import Enum, auto

from yumi.errors import YumiError


class Refusal(Enum):
    """The reason of a refusal; what the caller may do about it follows from it."""

    WRONG_MODE = auto()
    MOTORS_OFF = auto()
    NOT_STOPPED = auto()
    ALREADY_RUNNING = auto()
    NO_PROGRAM_POINTER = auto()
    READ_ONLY = auto()
    UNKNOWN = auto()
    OUT_OF_RANGE = auto()
    EMERGENCY_STOP = auto()
    BAD_VALUE = auto()
    NO_FILE = auto()
    NO_MODULE = auto()
    NAME_TAKEN = auto()
    BAD_PROGRAM = auto()
    NO_SPACE = auto()


class Refused(YumiError):
    """The virtual controller refuses a request and has changed nothing.

    Attributes:
        reason: the kind of refusal.
    """

    def __init__(self, reason: Refusal, sentence: str) -> None:
        super().__init__(sentence)
        self.reason = reason
