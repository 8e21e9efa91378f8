"""The states a controller reports, spelled as on the wire (reference/rws.md §5-6)."""

from __future__ import annotations

from enum import Enum


class OperatingMode(Enum):
    """The mode switch of the controller, ``/rw/panel/opmode``."""

    INIT = "INIT"
    AUTO_REQUESTED = "AUTO_CH"
    MANUAL_FULL_REQUESTED = "MANF_CH"
    MANUAL_REDUCED = "MANR"
    MANUAL_FULL = "MANF"
    AUTO = "AUTO"
    UNDEFINED = "UNDEF"


class ControllerState(Enum):
    """Motors and stops, ``/rw/panel/ctrlstate``."""

    INIT = "init"
    MOTORS_OFF = "motoroff"
    MOTORS_ON = "motoron"
    GUARD_STOP = "guardstop"
    EMERGENCY_STOP = "emergencystop"
    EMERGENCY_STOP_RESET = "emergencystopreset"
    SYSTEM_FAILURE = "sysfail"


class CollisionState(Enum):
    """What the collision detection has to say, ``/rw/panel/coldetstate``."""

    INIT = "INIT"
    TRIGGERED = "TRIGGERED"
    CONFIRMED = "CONFIRMED"
    TRIGGERED_ACKNOWLEDGED = "TRIGGERED_ACK"


class ExecutionState(Enum):
    """Whether RAPID runs, ``/rw/rapid/execution``."""

    RUNNING = "running"
    STOPPED = "stopped"


class TaskExecution(Enum):
    """Execution of one task, ``excstate`` of ``/rw/rapid/tasks``; four letters on the wire."""

    READY = "read"
    STOPPED = "stop"
    STARTED = "star"
    UNINITIALIZED = "unin"


class SignalType(Enum):
    """Digital, analog or group; input or output."""

    DIGITAL_INPUT = "DI"
    DIGITAL_OUTPUT = "DO"
    ANALOG_INPUT = "AI"
    ANALOG_OUTPUT = "AO"
    GROUP_INPUT = "GI"
    GROUP_OUTPUT = "GO"


class EventType(Enum):
    """Weight of an event log message."""

    INFORMATION = 1
    WARNING = 2
    ERROR = 3
