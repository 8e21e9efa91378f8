"""The faults a virtual controller can be given while it runs: names, meaning, and what may be chosen."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Way(Enum):
    """In which direction datagrams meet a fault."""

    TO_ROBOT = "to-robot"
    FROM_ROBOT = "from-robot"
    BOTH = "both"


@dataclass(frozen=True, slots=True)
class Amount:
    """How strong a fault can be.

    Attributes:
        unit: of the number.
        default: unless chosen; None leaves it to chance.
        lowest: smallest number.
        highest: largest number.
        is_whole: whether the number has no fraction.
    """

    unit: str
    default: float | None
    lowest: float
    highest: float
    is_whole: bool = False

    @property
    def range(self) -> str:
        """For a sentence, e.g. ``0 to 100 %``."""
        return f"{self.lowest:g} to {self.highest:g} {self.unit}"


@dataclass(frozen=True, slots=True)
class FaultKind:
    """What a fault is.

    Attributes:
        name: as it is called for.
        meaning: what happens.
        has_side: whether it can be limited to one arm.
        has_duration: whether it can be given a time.
        default_duration: the time it takes unless told otherwise [s]; None is for ever.
        amount: how strong it can be; None where there is nothing to choose.
        has_way: whether it can be limited to one direction.
    """

    name: str
    meaning: str
    has_side: bool = False
    has_duration: bool = False
    default_duration: float | None = None
    amount: Amount | None = None
    has_way: bool = False


class Fault(Enum):
    """All of them."""

    EGM_SILENCE = FaultKind(
        "egm-silence", "the EGM datagrams of an arm are lost, both ways", has_side=True, has_duration=True
    )
    EGM_REPAIR = FaultKind("egm-repair", "the EGM datagrams of an arm come through as they are again", has_side=True)
    EGM_LOSS = FaultKind(
        "egm-loss",
        "EGM datagrams are lost; with --way to-robot the robot does not hear the driver",
        has_side=True,
        has_duration=True,
        amount=Amount("%", 100.0, 0.0, 100.0),
        has_way=True,
    )
    EGM_DELAY = FaultKind(
        "egm-delay",
        "EGM datagrams arrive later",
        has_side=True,
        has_duration=True,
        amount=Amount("ms", 50.0, 0.0, 5000.0),
        has_way=True,
    )
    EGM_DUPLICATE = FaultKind(
        "egm-duplicate",
        "EGM datagrams arrive more than once",
        has_side=True,
        has_duration=True,
        amount=Amount("copies", 1.0, 1.0, 10.0, is_whole=True),
        has_way=True,
    )
    EGM_REORDER = FaultKind(
        "egm-reorder",
        "EGM datagrams overtake each other, by so many cycles at most",
        has_side=True,
        has_duration=True,
        amount=Amount("cycles", 3.0, 1.0, 100.0, is_whole=True),
        has_way=True,
    )
    EGM_STALE = FaultKind(
        "egm-stale",
        "the EGM datagram so many before the last comes a second time",
        has_side=True,
        amount=Amount("datagrams", 30.0, 1.0, 999.0, is_whole=True),
    )
    EGM_TRUNCATE = FaultKind(
        "egm-truncate",
        "every second EGM datagram of the robot is cut off after so many bytes",
        has_side=True,
        has_duration=True,
        default_duration=1.0,
        amount=Amount("bytes", None, 1.0, 1000.0, is_whole=True),
    )
    EGM_FORGE = FaultKind(
        "egm-forge",
        "one forged EGM datagram with the next number, all joints elsewhere",
        has_side=True,
        amount=Amount("degrees", 5.0, -360.0, 360.0),
    )
    EGM_FORGE_OLD = FaultKind(
        "egm-forge-old",
        "one forged EGM datagram with a number that is 100 lower, all joints elsewhere",
        has_side=True,
        amount=Amount("degrees", 5.0, -360.0, 360.0),
    )
    EGM_FORGE_AHEAD = FaultKind(
        "egm-forge-ahead",
        "one forged EGM datagram with a number that is 1000 higher, all joints elsewhere",
        has_side=True,
        amount=Amount("degrees", 5.0, -360.0, 360.0),
    )
    EGM_OFFSET = FaultKind(
        "egm-offset",
        "the EGM datagrams of the robot say that all joints are elsewhere",
        has_side=True,
        has_duration=True,
        default_duration=0.5,
        amount=Amount("degrees", 5.0, -360.0, 360.0),
    )
    EGM_SWAP_ARMS = FaultKind(
        "egm-swap-arms",
        "the EGM datagrams of each arm go to the port of the other",
        has_duration=True,
        default_duration=1.0,
    )
    EGM_FOREIGN_PORT = FaultKind(
        "egm-foreign-port",
        "each EGM datagram of the robot comes from another port, too, and there first",
        has_side=True,
        has_duration=True,
        default_duration=1.0,
    )
    COMM_TIMEOUT = FaultKind(
        "comm-timeout", "the robot gives up waiting for datagrams, as after its CommTimeout", has_side=True
    )
    EGM_CONVERGENCE = FaultKind("egm-convergence", "an EGM motion ends as if it had converged", has_side=True)
    DYNAMIC_LOAD = FaultKind("dynamic-load", "an EGM motion asks too much of a drive: motors off", has_side=True)
    MOTORS_OFF = FaultKind("motors-off", "someone presses motors off")
    EMERGENCY_STOP = FaultKind("emergency-stop", "someone presses the emergency stop")
    EMERGENCY_STOP_RESET = FaultKind("emergency-stop-reset", "the emergency stop is pulled out and acknowledged")
    MANUAL_MODE = FaultKind("manual-mode", "someone turns the key to manual reduced speed")
    AUTO_MODE = FaultKind("auto-mode", "someone turns the key to AUTO and confirms it")
    COLLISION = FaultKind("collision", "an arm meets something: motion supervision stops the program", has_side=True)
    PROGRAM_STOP = FaultKind("program-stop", "someone presses stop on the FlexPendant")
    WRONG_PROGRAM = FaultKind("wrong-program", "someone loads another RAPID program into both tasks")
    RIGHT_PROGRAM = FaultKind("right-program", "the RAPID program of the configuration is loaded again")
    WARM_RESTART = FaultKind(
        "warm-restart", "the controller restarts: nothing answers meanwhile", has_duration=True, default_duration=20.0
    )
    RWS_RESET = FaultKind("rws-reset", "every TCP connection of Robot Web Services breaks")
    RWS_BUSY = FaultKind(
        "rws-busy", "Robot Web Services answer 503 to everything", has_duration=True, default_duration=5.0
    )
    RWS_SESSIONS_EXPIRED = FaultKind("rws-sessions-expired", "all sessions and subscriptions are forgotten")
    WEB_SOCKET_DROP = FaultKind("web-socket-drop", "every WebSocket breaks; the subscriptions stay")
    GRIPPER_NOT_CALIBRATED = FaultKind(
        "gripper-not-calibrated", "a gripper loses its power and calibration", has_side=True
    )
    GRIPPER_ERROR = FaultKind("gripper-error", "a gripper finds something wrong with itself", has_side=True)
    OBJECT_LOST = FaultKind("object-lost", "what a gripper's fingers or cups may hold is gone", has_side=True)


def kind_of(name: str) -> Fault | None:
    """The fault of a name."""
    return next((fault for fault in Fault if fault.value.name == name), None)
