"""The Smart Gripper as values in SI: speeds and travel of its fingers, vacuum pressures, signals, goals, outcomes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum, IntEnum

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, ProtocolError

TOP_FINGER_SPEED = 0.025
"""Highest speed of each finger [m/s] (reference/yumi.md §2.1)."""

LOWEST_FINGER_SPEED = 0.003
"""Lowest speed the drive takes [m/s] (reference/statemachine.md §5.3)."""

FINGER_TRAVEL = 0.025
"""From closed to open, per finger [m] (reference/yumi.md §2.1)."""

MAX_GRIP_FORCE = 20.0
"""Largest holding force [N]."""

FINGER_ALLOWANCE = 0.001
"""How far from where they were sent the fingers may end [m]; the gripper's own (reference/yumi.md §2.1)."""

THINNEST_GRIPPED = 0.0005
"""Nothing fits between fingers that are nearer than this to the middle [m]."""


ATMOSPHERIC_PRESSURE = 100_000.0
"""What the pressure sensor of a vacuum module shows at rest [Pa]."""


class GripperModules(Enum):
    """What a gripper is made of: each has the servo with its fingers; the value is the word in the settings."""

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


class GripDirection(Enum):
    """Which way the fingers grip."""

    INWARDS = "inwards"
    OUTWARDS = "outwards"


class ServoCommand(IntEnum):
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


class ServoState(IntEnum):
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
        ServoState.FREE_MOVE_TO_MIN_POS,
        ServoState.GRIP_OUTWARD_IN,
        ServoState.FORCING_OUTWARD_IN,
        ServoState.JOG_CLOSE,
        ServoState.AGILE_GRIP_INWARD,
    }
)


class GripOutcome(Enum):
    """How a gripper command ended; the value says it in words."""

    OPEN = "open"
    CLOSED = "closed"
    IN_PLACE = "in place"
    HOLDING = "holding"
    STALLED = "stalled"


def outcome_of(position: float, effort: float, *, stalled: bool, reached_goal: bool) -> GripOutcome:
    """How a command ended, from the result as ``control_msgs/action/GripperCommand`` has it.

    Args:
        position: distance of each finger from the middle [m].
        effort: what the fingers press with [N]; 0 when they hold nothing.
        stalled: whether something stopped the fingers.
        reached_goal: whether they are where they were sent.
    """
    if stalled and effort > 0.0:
        return GripOutcome.HOLDING
    if stalled or not reached_goal:
        return GripOutcome.STALLED
    if position <= FINGER_ALLOWANCE:
        return GripOutcome.CLOSED
    return GripOutcome.OPEN if position >= FINGER_TRAVEL - FINGER_ALLOWANCE else GripOutcome.IN_PLACE


_M_PER_COUNT = 1e-4  # positions and speeds count 0.1 mm
_N_PER_COUNT = 0.1
_PA_PER_COUNT = 1e3

_SERVO_SIGNALS = (
    "hand_SysState",
    "hand_SysError",
    "hand_StatusCalibrated",
    "hand_ActualPosition",
    "hand_ActualSpeed",
    "hand_HoldForce",
)


@dataclass(frozen=True, slots=True)
class VacuumState:
    """One vacuum module as the gripper shows it.

    Attributes:
        sucks: whether its vacuum is on.
        blows: whether its blow-off is on.
        pressure: absolute [Pa].
    """

    sucks: bool
    blows: bool
    pressure: float

    def has_picked(self, threshold: float) -> bool:
        """Whether something closes the cup: it sucks, and the pressure is not above ``threshold`` [Pa]."""
        return self.sucks and self.pressure <= threshold


@dataclass(frozen=True, slots=True)
class GripperState:
    """A gripper as its signals show it.

    Attributes:
        state: what it is doing.
        error: its own error number; 0 is none.
        is_calibrated: whether its position means anything.
        position: of each finger from the middle [m].
        speed: of each finger, positive when opening [m/s].
        force: what it holds an object with; 0 while it holds none [N].
        is_camera_linked: whether its camera is connected; False where it has none.
        cups: its vacuum modules by number.
    """

    state: ServoState
    error: int
    is_calibrated: bool
    position: float
    speed: float
    force: float
    is_camera_linked: bool = False
    cups: Mapping[int, VacuumState] = field(default_factory=dict)

    @property
    def is_holding(self) -> bool:
        """Whether the fingers press on something; closed ones press on each other."""
        return self.state is ServoState.KEEP_OBJECT and self.position > THINNEST_GRIPPED


def signal_names(modules: GripperModules) -> tuple[str, ...]:
    """The signals a state of a gripper needs, without the arm's suffix (reference/statemachine.md §5.4)."""
    names = list(_SERVO_SIGNALS)
    if modules.has_camera:
        names.append("hand_StatusCamLinked")
    for channel in modules.vacuum_channels:
        names += [f"hand_StatusVacuum{channel}", f"hand_StatusBlowoff{channel}", f"hand_ActualPressure{channel}"]
    return tuple(names)


def servo_state(value: float) -> ServoState:
    """The state of ``hand_SysState``.

    Raises:
        ProtocolError: no Smart Gripper has it.
    """
    try:
        return ServoState(int(value))
    except ValueError as error:
        raise ProtocolError(message("gripper_state_unknown", state=value)) from error


def position_of(value: float) -> float:
    """The position of ``hand_ActualPosition`` [m]."""
    return value * _M_PER_COUNT


def speed_count(speed: float) -> int:
    """``hand_MaxSpeed`` of a speed [m/s]."""
    return round(speed / _M_PER_COUNT)


def read_gripper(value: Callable[[str], float], modules: GripperModules) -> GripperState:
    """The state that signals make up.

    Args:
        value: of a signal by its name without the arm's suffix.
        modules: what the gripper is made of.

    Raises:
        ProtocolError: it reports a state that no Smart Gripper has.
    """
    state = servo_state(value("hand_SysState"))
    speed = value("hand_ActualSpeed") * _M_PER_COUNT  # the gripper reports only how fast
    return GripperState(
        state=state,
        error=int(value("hand_SysError")),
        is_calibrated=value("hand_StatusCalibrated") != 0,
        position=position_of(value("hand_ActualPosition")),
        speed=-speed if state in _CLOSING else speed,
        force=value("hand_HoldForce") * _N_PER_COUNT if state is ServoState.KEEP_OBJECT else 0.0,
        is_camera_linked=modules.has_camera and value("hand_StatusCamLinked") != 0,
        cups={channel: read_vacuum(value, channel) for channel in modules.vacuum_channels},
    )


def read_vacuum(value: Callable[[str], float], channel: int) -> VacuumState:
    """The state of a vacuum module that signals make up; ``value`` gives a signal by its name."""
    return VacuumState(
        sucks=value(f"hand_StatusVacuum{channel}") != 0,
        blows=value(f"hand_StatusBlowoff{channel}") != 0,
        pressure=value(f"hand_ActualPressure{channel}") * _PA_PER_COUNT,
    )


@dataclass(frozen=True, slots=True)
class GripperGoal:
    """What the fingers are to do: go to a position, or grip in a direction.

    Attributes:
        position: where they go, at most [m].
        direction: which way they grip; None when they only go there.
        force: what they hold with, when they grip [N].
        speed: how fast they go [m/s]; None as usual.

    Raises:
        CommandRefused: a value is out of range.
    """

    position: float
    direction: GripDirection | None = None
    force: float = 0.0
    speed: float | None = None

    def is_held(self, state: ServoState, position: float) -> bool:
        """Whether a gripper that came to rest in ``state`` at ``position`` [m] holds something as ordered."""
        is_free = (
            position <= THINNEST_GRIPPED
            if self.direction is GripDirection.INWARDS
            else position >= FINGER_TRAVEL - THINNEST_GRIPPED
        )
        return self.direction is not None and state is ServoState.KEEP_OBJECT and not is_free

    def __post_init__(self) -> None:
        if not 0.0 <= self.position <= FINGER_TRAVEL:  # NaN too
            raise CommandRefused(message("gripper_position_out_of_range", position=self.position, most=FINGER_TRAVEL))
        if self.direction is not None and not 0.0 < self.force <= MAX_GRIP_FORCE:
            raise CommandRefused(message("gripper_force_out_of_range", force=self.force, most=MAX_GRIP_FORCE))
        if self.speed is not None and not LOWEST_FINGER_SPEED <= self.speed <= TOP_FINGER_SPEED:
            raise CommandRefused(
                message(
                    "gripper_speed_out_of_range", speed=self.speed, lowest=LOWEST_FINGER_SPEED, highest=TOP_FINGER_SPEED
                )
            )


def finger_position_goal(position: float, speed: float | None = None) -> GripperGoal:
    """Go to ``position`` [m]; what is in the way stops the fingers."""
    return GripperGoal(position, speed=speed)


def grip(direction: GripDirection, force: float, speed: float | None = None) -> GripperGoal:
    """Close, or open, until something is held with ``force`` [N]."""
    return GripperGoal(0.0 if direction is GripDirection.INWARDS else FINGER_TRAVEL, direction, force, speed)


def gripper_goal(position: float, effort: float, usual_force: float, speed: float | None = None) -> GripperGoal:
    """What ROS's gripper actions ask for with a position and an effort.

    Closed (0) grips inwards, with the usual force when the effort is 0. Open (0.025) grips outwards when there is an
    effort. Anything else is a position to go to.

    Raises:
        CommandRefused: a value is out of range.
    """
    if not 0.0 <= effort <= MAX_GRIP_FORCE:
        raise CommandRefused(message("gripper_effort_out_of_range", effort=effort, most=MAX_GRIP_FORCE))
    if position == 0.0:
        return grip(GripDirection.INWARDS, effort or usual_force, speed)
    if position == FINGER_TRAVEL and effort > 0.0:
        return grip(GripDirection.OUTWARDS, effort, speed)
    return finger_position_goal(position, speed)
