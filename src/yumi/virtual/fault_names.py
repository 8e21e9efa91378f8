"""The faults a virtual controller can be given while it runs: names, meaning, and what may be chosen."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


@dataclass(frozen=True, slots=True)
class FaultKind:
    """What a fault is.

    Attributes:
        name: as it is called for.
        meaning: what happens.
        has_side: whether it can be limited to one arm.
        has_duration: whether it can be given a time.
        default_duration: the time it takes unless told otherwise [s]; None is for ever.
    """

    name: str
    meaning: str
    has_side: bool = False
    has_duration: bool = False
    default_duration: float | None = None


class Fault(Enum):
    """All of them."""

    EGM_SILENCE = FaultKind(
        "egm-silence", "the EGM datagrams of an arm are lost, both ways", has_side=True, has_duration=True
    )
    EGM_REPAIR = FaultKind("egm-repair", "the EGM datagrams of an arm come through again", has_side=True)
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
    GRIPPER_NOT_CALIBRATED = FaultKind("gripper-not-calibrated", "a gripper forgets its calibration", has_side=True)
    OBJECT_LOST = FaultKind("object-lost", "what lies between the fingers is gone", has_side=True)


def kind_of(name: str) -> Fault | None:
    """The fault of a name."""
    return next((fault for fault in Fault if fault.value.name == name), None)
