"""What happens on the virtual controller: its event log (reference/rws.md §12), refusals, and the faults to inject."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

from yumi.errors import YumiError
from yumi.rws.types import EventType

ALL_DOMAINS = 0
_LOG_CAPACITY = 1000
_DOMAIN_CAPACITY = 20


@dataclass(frozen=True, slots=True)
class Event:
    """One entry of the log.

    Attributes:
        number: rises by one with each event, over all domains.
        code: ABB's event number.
        time: when it happened, on the controller's clock [s].
        type: how serious it is.
        domain: the log it is in; domain 0 shows all.
        title: one line.
        description: what happened and what to do, in sentences.
        arguments: what of it differs from event to event.
    """

    number: int
    code: int
    time: float
    type: EventType
    domain: int
    title: str
    description: str
    arguments: tuple[str, ...] = ()


class EventLog:
    """Remembers the latest events, all of them together and each domain for itself.

    Attributes:
        watchers: called for each event.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self.watchers: list[Callable[[Event], None]] = []
        self._last_number = 0
        self._logs: dict[int, deque[Event]] = {ALL_DOMAINS: deque(maxlen=_LOG_CAPACITY)}

    def append(
        self,
        code: int,
        title: str,
        description: str = "",
        type: EventType = EventType.INFORMATION,
        domain: int | None = None,
        arguments: tuple[str, ...] = (),
    ) -> Event:
        """Log an event; its domain is the ten-thousands of its code unless another one is given."""
        self._last_number += 1
        place = code // 10000 if domain is None else domain
        event = Event(self._last_number, code, self._now(), type, place, title, description, arguments)
        self._logs[ALL_DOMAINS].appendleft(event)
        if place != ALL_DOMAINS:
            self._logs.setdefault(place, deque(maxlen=_DOMAIN_CAPACITY)).appendleft(event)
        for watcher in tuple(self.watchers):
            watcher(event)
        return event

    def entries(self, domain: int = ALL_DOMAINS) -> tuple[Event, ...]:
        """Events of a domain, newest first; domain 0 has all."""
        return tuple(self._logs.get(domain, ()))

    def clear(self, domain: int = ALL_DOMAINS) -> None:
        """Forget the events of a domain; domain 0 forgets all."""
        if domain == ALL_DOMAINS:
            self._logs = {ALL_DOMAINS: deque(maxlen=_LOG_CAPACITY)}
        else:
            self._logs.pop(domain, None)


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


class Way(Enum):
    """Direction of the datagrams that a fault changes."""

    TO_ROBOT = "to-robot"
    FROM_ROBOT = "from-robot"
    BOTH = "both"


@dataclass(frozen=True, slots=True)
class Amount:
    """The range of a fault's strength.

    Attributes:
        unit: of the number.
        default: None is random.
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
        name: in commands.
        meaning: what happens.
        has_side: whether it can be limited to one arm.
        has_duration: whether its duration can be chosen.
        default_duration: how long it lasts by default [s]; None is for ever.
        amount: its strength; None where there is nothing to choose.
        has_way: whether it can be limited to one direction.
    """

    name: str
    meaning: str
    has_side: bool = False
    has_duration: bool = False
    default_duration: float | None = None
    amount: Amount | None = None
    has_way: bool = False


def _of_arm(name: str, meaning: str, amount: Amount | None = None) -> FaultKind:
    return FaultKind(name, meaning, has_side=True, amount=amount)


def _lasting(
    name: str, meaning: str, amount: Amount | None = None, duration: float | None = None, *, has_way: bool = False
) -> FaultKind:
    return FaultKind(
        name, meaning, has_side=True, has_duration=True, default_duration=duration, amount=amount, has_way=has_way
    )


_DEGREES = Amount("degrees", 5.0, -360.0, 360.0)


class Fault(Enum):
    """The faults that can be injected into a running virtual controller."""

    EGM_SILENCE = _lasting("egm-silence", "the EGM datagrams of an arm are lost, both ways")
    EGM_REPAIR = _of_arm("egm-repair", "all EGM faults of an arm end")
    EGM_LOSS = _lasting(
        "egm-loss",
        "EGM datagrams are lost; with --way to-robot the robot does not receive the driver",
        Amount("%", 100.0, 0.0, 100.0),
        has_way=True,
    )
    EGM_DELAY = _lasting("egm-delay", "EGM datagrams arrive later", Amount("ms", 50.0, 0.0, 5000.0), has_way=True)
    EGM_DUPLICATE = _lasting(
        "egm-duplicate",
        "EGM datagrams arrive more than once",
        Amount("copies", 1.0, 1.0, 10.0, is_whole=True),
        has_way=True,
    )
    EGM_REORDER = _lasting(
        "egm-reorder",
        "EGM datagrams overtake each other, by this many cycles at most",
        Amount("cycles", 3.0, 1.0, 100.0, is_whole=True),
        has_way=True,
    )
    EGM_STALE = _of_arm(
        "egm-stale",
        "an old EGM datagram, this many before the last, comes a second time",
        Amount("datagrams", 30.0, 1.0, 999.0, is_whole=True),
    )
    EGM_TRUNCATE = _lasting(
        "egm-truncate",
        "every second EGM datagram of the robot is truncated to this many bytes",
        Amount("bytes", None, 1.0, 1000.0, is_whole=True),
        1.0,
    )
    EGM_FORGE = _of_arm("egm-forge", "one forged EGM datagram with the next number, all joints shifted", _DEGREES)
    EGM_FORGE_OLD = _of_arm(
        "egm-forge-old", "one forged EGM datagram with a number that is 100 lower, all joints shifted", _DEGREES
    )
    EGM_FORGE_AHEAD = _of_arm(
        "egm-forge-ahead", "one forged EGM datagram with a number that is 1000 higher, all joints shifted", _DEGREES
    )
    EGM_OFFSET = _lasting(
        "egm-offset", "the positions of all joints in the robot's EGM datagrams are shifted", _DEGREES, 0.5
    )
    EGM_SWAP_ARMS = FaultKind(
        "egm-swap-arms",
        "the EGM datagrams of each arm go to the port of the other",
        has_duration=True,
        default_duration=1.0,
    )
    EGM_FOREIGN_PORT = _lasting(
        "egm-foreign-port",
        "each EGM datagram of the robot comes from another port too, and first from there",
        duration=1.0,
    )
    COMM_TIMEOUT = _of_arm("comm-timeout", "the robot receives no datagrams for its CommTimeout")
    EGM_CONVERGENCE = _of_arm("egm-convergence", "an EGM motion ends as if it had converged")
    DYNAMIC_LOAD = _of_arm("dynamic-load", "an EGM motion overloads a drive: motors off")
    MOTORS_OFF = FaultKind("motors-off", "Motors Off is pressed")
    EMERGENCY_STOP = FaultKind("emergency-stop", "the emergency stop is pressed")
    EMERGENCY_STOP_RESET = FaultKind("emergency-stop-reset", "the emergency stop is released and acknowledged")
    MANUAL_MODE = FaultKind("manual-mode", "the key is turned to manual reduced speed")
    AUTO_MODE = FaultKind("auto-mode", "the key is turned to AUTO and confirmed")
    COLLISION = _of_arm("collision", "an arm collides: motion supervision stops the program")
    ARM_PUSHED = _of_arm(
        "arm-pushed",
        "someone pushes an arm's elbow aside and lets go",
        Amount("degrees", 5.0, -20.0, 20.0),
    )
    PROGRAM_STOP = FaultKind("program-stop", "Stop is pressed on the FlexPendant")
    WRONG_PROGRAM = FaultKind("wrong-program", "another RAPID program is loaded into both tasks")
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
    GRIPPER_NOT_CALIBRATED = _of_arm("gripper-not-calibrated", "a gripper loses its power and calibration")
    GRIPPER_ERROR = _of_arm("gripper-error", "a gripper reports an internal error")
    OBJECT_PLACED = _of_arm(
        "object-placed", "an object of this width is put between a gripper's fingers", Amount("mm", 20.0, 1.0, 50.0)
    )
    OBJECT_UNDER_CUPS = _of_arm(
        "object-under-cups",
        "an object is put under a gripper's cups; a leak of 1 is as if none",
        Amount("leak", 0.0, 0.0, 1.0),
    )
    OBJECT_LOST = _of_arm("object-lost", "the object at a gripper's fingers or cups is removed")


def fault_named(name: str) -> Fault | None:
    """The fault of a name."""
    return next((fault for fault in Fault if fault.value.name == name), None)
