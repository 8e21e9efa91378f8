"""Why the virtual controller refuses a request; each protocol has its own code for the reason."""

from __future__ import annotations

from enum import Enum, auto

from yumi.errors import YumiError


class Refusal(Enum):
    """The reason of a refusal; it shows the caller what to do."""

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
