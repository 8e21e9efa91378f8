"""What a controller is, the transitions of its lifecycle (REP-2007), and how others see the controllers of an arm.

To add one: a subclass of :class:`Controller` in ``control/controllers/``, a line with its type in ``CONTROLLER_KINDS``
(``driver/wiring.py``), and its name and type in ``config/controllers.yaml``. For its test, ``VirtualArmRig`` of
``yumi_evaluation`` runs it with a virtual arm in virtual time.

Goals for the joints reach it through a :class:`Buffer`, which holds the latest value only: the one way state and goals
cross between the control process and the driver. A :class:`StageClock` notes where the microseconds of a reply go.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from enum import Enum, IntFlag
from math import inf, isfinite, isnan, nan, pi, radians, sqrt
from typing import Generic, NamedTuple, Protocol, TypeVar

from yumi.catalogue import message
from yumi.errors import CommandRefused
from yumi.robot.joints import YUMI_LIMITS, ArmCommand, ArmState, Joints
from yumi.settings import Parameter, Value, Values, texts


class GoalKind(IntFlag):
    """What the controllers that command an arm take; each kind has a buffer of its own."""

    NONE = 0
    POSITION = 1
    VELOCITY = 2
    FORWARD_POSITION = 4
    FORWARD_VELOCITY = 8
    TOOL = 16


IDLE = 1.0
"""A controller that follows what it is sent is idle when nothing has come for so long [s]."""


class Sampled(NamedTuple):
    """The law by which the core samples a controller itself: ``position + gains · (goal - position)``.

    The goal is the newest in shared memory that is meant for the session, or else the one that was taken last.

    Attributes:
        address: of the goals in memory, of a ``SharedBuffer[SessionGoal]``.
        taken: number of the goal that was taken last.
        goal: which was that [rad], (7,).
        gains: of the joints, (7,); None goes to the goal itself.
    """

    address: int
    taken: int
    goal: Joints
    gains: Joints | None = None


class Controller(ABC):
    """One controller of one arm.

    The controller manager calls everything here, between two cycles or inside one, always in the control process.

    Attributes:
        kind: the type string of ros2_control, ``package/Class``.
        is_command: whether it wants commands, one at a time per interface; else it only watches.
        goal_kind: which goals it takes while it is active.
    """

    kind: str
    is_command = True
    goal_kind = GoalKind.NONE

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        """What can be set, with one parameter for each joint where it differs: ``gains.<joint>.p``.

        What upstream's controller of the same type has and this one does not is a fixed one, with the reason.
        """
        return ()

    def configure(self, values: Values) -> None:
        """Take parameter values, complete, of their own types and inside their ranges; also while active.

        Raises:
            CommandRefused: the values do not go together; nothing was changed.
        """

    def clean_up(self) -> None:
        """Forget what configuring prepared; called before it is configured anew or unloaded."""

    @abstractmethod
    def activate(self, state: ArmState) -> None:
        """Begin from ``state``; whatever was commanded before is forgotten."""

    def deactivate(self) -> None:
        """End; the arm holds from now on."""

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        """The interfaces it claims while active, ``<joint>/position`` and the like."""
        return tuple(f"{name}/position" for name in joint_names) if self.is_command else ()

    def state_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        """The interfaces it reads while active."""
        return tuple(f"{name}/{kind}" for name in joint_names for kind in ("position", "velocity"))

    def update(self, state: ArmState) -> ArmCommand | None:
        """The command for ``state``; None holds the arm. Reads ``state.dt`` for the time that passed.

        Positions and velocities of interfaces it does not claim count only where no controller claims them.
        """
        return None

    @property
    def sampled(self) -> Sampled | None:
        """The law of the next :meth:`update`, if that is so simple; then it may be called after the reply has left."""
        return None

    def check(self, command: object, state: ArmState | None) -> None:
        """Whether :meth:`receive` would take ``command`` now; changes nothing.

        Raises:
            CommandRefused: it would not, and why.
        """
        raise CommandRefused(message("controller_takes_no_commands", type=self.kind))

    def receive(self, command: object, state: ArmState | None) -> None:
        """Take a command between two cycles: a trajectory, a cancel. Only while active.

        Args:
            command: a picklable value the controller knows.
            state: the arm's newest state; None while it is not heard.

        Raises:
            CommandRefused: it breaks a rule; nothing was changed.
        """
        self.check(command, state)

    def note_withheld(self, position: Joints) -> None:
        """The limiter holds the arm at ``position`` [rad], (7,), short of what is commanded.

        It would make up for that as soon as the way is free, so a controller that leads the arm no further gives it up.
        """

    def note_waiting(self, position: Joints) -> None:
        """Replies are lost: the command stands at ``position`` [rad], (7,), until the robot follows it again.

        A motion without a time base outside the controller is planned again from there.
        """

    def is_idle(self, now: float) -> bool:
        """Whether nothing asks it to move the arm at ``now`` [s], so that a goal for another one may replace it."""
        return False

    def take_reports(self) -> Sequence[object]:
        """Its reports since the last call, picklable and frozen; asked after each reply, cheap when empty."""
        return ()

    @property
    def reference(self) -> Joints | None:
        """Where the controller is going, chain order [rad]; None when it has nowhere to go."""
        return None


# ---- the lifecycle


class State(Enum):
    """Primary states; the values are the labels that ros2_control tools compare."""

    UNCONFIGURED = "unconfigured"
    INACTIVE = "inactive"
    ACTIVE = "active"
    FINALIZED = "finalized"


class Transition(Enum):
    """What moves a controller from state to state."""

    CONFIGURE = "configure"
    ACTIVATE = "activate"
    DEACTIVATE = "deactivate"
    CLEANUP = "cleanup"
    SHUTDOWN = "shutdown"


TRANSITIONS: dict[tuple[State, Transition], State] = {
    (State.UNCONFIGURED, Transition.CONFIGURE): State.INACTIVE,
    (State.INACTIVE, Transition.ACTIVATE): State.ACTIVE,
    (State.ACTIVE, Transition.DEACTIVATE): State.INACTIVE,
    (State.INACTIVE, Transition.CLEANUP): State.UNCONFIGURED,
    (State.UNCONFIGURED, Transition.SHUTDOWN): State.FINALIZED,
    (State.INACTIVE, Transition.SHUTDOWN): State.FINALIZED,
    (State.ACTIVE, Transition.SHUTDOWN): State.FINALIZED,
}


def allowed(state: State) -> tuple[Transition, ...]:
    """The transitions that may leave ``state``."""
    return tuple(transition for (source, transition) in TRANSITIONS if source is state)


# ---- what others see of an arm's controllers


@dataclass(frozen=True, slots=True)
class Statistics:
    """A series of values; all zero without any.

    Attributes:
        count: how many values.
        current: the last one.
        mean: their mean.
        minimum: the smallest.
        maximum: the largest.
        deviation: their standard deviation.
    """

    count: int = 0
    current: float = 0.0
    mean: float = 0.0
    minimum: float = 0.0
    maximum: float = 0.0
    deviation: float = 0.0


@dataclass(frozen=True, slots=True)
class ControllerInfo:
    """One controller as the manager knows it.

    Attributes:
        name: its name, unique on this arm.
        kind: ros2_control's type string.
        state: its lifecycle state.
        required: the command interfaces it needs when active.
        claimed: the command interfaces it holds now.
        required_state: the state interfaces it needs when active.
        execution_time: how long its updates took since it was activated last [s].
    """

    name: str
    kind: str
    state: State
    required: tuple[str, ...]
    claimed: tuple[str, ...]
    required_state: tuple[str, ...] = ()
    execution_time: Statistics = field(default_factory=Statistics)


class InterfaceInfo(NamedTuple):
    """One command or state interface; a tuple, since there are many in each answer.

    Attributes:
        name: ``<joint>/<kind>``.
        is_available: whether its component offers it now.
        is_claimed: whether an active controller holds it; state interfaces are never claimed.
    """

    name: str
    is_available: bool
    is_claimed: bool = False


@dataclass(frozen=True, slots=True)
class HardwareInfo:
    """The hardware component of one arm.

    Attributes:
        name: its name.
        state: its lifecycle state.
        command_interfaces: what can be commanded.
        state_interfaces: what is measured.
        read_time: how long reading the arm took, cycle by cycle [s].
        write_time: how long answering it took [s].
        period: time between two cycles [s].
    """

    name: str
    state: State
    command_interfaces: tuple[InterfaceInfo, ...]
    state_interfaces: tuple[InterfaceInfo, ...]
    read_time: Statistics = field(default_factory=Statistics)
    write_time: Statistics = field(default_factory=Statistics)
    period: Statistics = field(default_factory=Statistics)


class ParameterInfo(NamedTuple):
    """A parameter of a controller and what it holds.

    Attributes:
        parameter: what may be set.
        value: what is set.
    """

    parameter: Parameter
    value: Value


def find_parameter(parameters: Iterable[Parameter], name: str) -> Parameter | None:
    """The parameter called ``name``, or the group of fixed ones that it belongs to."""
    known = {parameter.name: parameter for parameter in parameters}
    words = name.split(".")
    groups = (known.get(".".join(words[:count])) for count in range(len(words) - 1, 0, -1))
    return known.get(name) or next((each for each in groups if each and each.is_group), None)


def check_joints(values: Values, joint_names: Sequence[str], *, in_order: bool) -> None:
    """Refuse a parameter ``joints`` that does not name the joints of the arm.

    Args:
        values: complete values of parameters.
        joint_names: of the arm, chain order.
        in_order: whether the order counts.

    Raises:
        CommandRefused: it names others, or in another order.
    """
    given = texts(values, "joints")
    if given == tuple(joint_names) or (not in_order and sorted(given) == sorted(joint_names)):
        return
    foreign = next((name for name in given if name not in joint_names), None)
    if foreign is not None:
        raise CommandRefused(message("parameter_joint_foreign", joint=foreign, joints=tuple(joint_names)))
    raise CommandRefused(
        message(
            "parameter_joints_out_of_order" if in_order else "parameter_joints_incomplete",
            given=", ".join(given),
            joints=tuple(joint_names),
        )
    )


# ---- goals in buffers

V = TypeVar("V")


class Buffer(Protocol[V]):
    """The latest value of one kind; one side writes, any side reads, neither waits."""

    def write(self, value: V) -> None:
        """Replace the value."""

    def read(self) -> tuple[int, V] | None:
        """The number of the newest write, from 1, and its value; None while nothing was ever written."""


class MemoryBuffer(Generic[V]):
    """A buffer inside one process."""

    def __init__(self) -> None:
        self._newest: tuple[int, V] | None = None

    def write(self, value: V) -> None:
        number = self._newest[0] if self._newest else 0
        self._newest = (number + 1, value)

    def read(self) -> tuple[int, V] | None:
        return self._newest


UNKNOWN: Joints = (nan, nan, nan, nan, nan, nan, nan)
"""Positions or velocities that a goal does not have."""


class Goal(NamedTuple):
    """What the joints are to do.

    Attributes:
        position: positions [rad], (7,); NaN in a goal of speeds.
        velocity: velocities [rad/s], (7,); NaN where they are not known.
        time: when it was given, on the machine's monotonic clock [s]; NaN where that is not known.
    """

    position: Joints
    velocity: Joints = UNKNOWN
    time: float = nan


class SessionGoal(NamedTuple):
    """A goal in a buffer.

    Attributes:
        session: the EGM session that it is meant for; a later session will not go there.
        time: as in :class:`Goal`.
        position: as in :class:`Goal`.
        velocity: as in :class:`Goal`.
    """

    session: int
    time: float
    position: Joints
    velocity: Joints


GoalBuffer = Buffer[SessionGoal]
"""Where an arm looks for goals."""


def write_goal(buffer: GoalBuffer, session: int, goal: Joints, velocity: Joints = UNKNOWN, time: float = nan) -> None:
    """Ask for ``goal`` [rad], which itself moves with ``velocity`` [rad/s], in EGM session ``session``."""
    buffer.write(SessionGoal(session, time, goal, velocity))


def write_speeds(buffer: GoalBuffer, session: int, velocity: Joints, time: float = nan) -> None:
    """Ask for speeds [rad/s], (7,), in EGM session ``session``; ``time`` as in :class:`Goal`."""
    buffer.write(SessionGoal(session, time, UNKNOWN, velocity))


def read_goal(buffer: GoalBuffer, session: int) -> tuple[int, Goal | None]:
    """The number of the newest goal, and the goal; None when it is not meant for ``session``."""
    newest = buffer.read()
    if newest is None:
        return 0, None
    number, goal = newest
    return number, Goal(goal.position, goal.velocity, goal.time) if goal.session == session else None


class GoalInbox:
    """A controller's view of its buffer: every goal is taken once."""

    def __init__(self, buffer: GoalBuffer) -> None:
        self._buffer = buffer
        self._number = 0

    def forget(self) -> None:
        """What was sent until now belongs to the past."""
        newest = self._buffer.read()
        self._number = newest[0] if newest else 0

    def sampled(self, goal: Joints, gains: Joints | None = None) -> Sampled | None:
        """The law of a controller that took ``goal`` last; None where the goals are not in shared memory."""
        address = getattr(self._buffer, "address", None)
        return None if address is None else Sampled(address, self._number, goal, gains)

    def take(self, session: int, now: float) -> Goal | None:
        """The newest goal, if it was not taken before and is meant for ``session``.

        A goal of unknown time was given ``now`` [s], since it was not there a cycle ago.
        """
        newest = self._buffer.read()
        if newest is None or newest[0] == self._number:
            return None
        self._number, goal = newest
        if goal.session != session:
            return None
        return Goal(goal.position, goal.velocity, now if isnan(goal.time) else goal.time)


def check_position(name: str, index: int, position: float) -> None:
    """Refuse a position that a joint cannot have.

    Args:
        name: the joint's, for the refusal.
        index: its place in the chain.
        position: [rad].

    Raises:
        CommandRefused: it is no finite number, or out of the joint's range.
    """
    if not isfinite(position):
        raise CommandRefused(message("goal_joint_not_finite", joint=name, value=str(position)))
    lower, upper = YUMI_LIMITS.lower[index], YUMI_LIMITS.upper[index]
    if not lower <= position <= upper:
        raise CommandRefused(
            message(
                "goal_joint_in_degrees" if looks_like_degrees(index, position) else "goal_joint_out_of_range",
                joint=name,
                position=position,
                lower=lower,
                upper=upper,
            )
        )


def looks_like_degrees(index: int, position: float) -> bool:
    """Whether a position [rad] that a joint cannot have would be one in degrees.

    No range of a joint reaches a whole turn, so that a value beyond one was hardly meant in radians.
    """
    return abs(position) > 2.0 * pi and YUMI_LIMITS.lower[index] <= radians(position) <= YUMI_LIMITS.upper[index]


# ---- the stages of a cycle and their times
#
#     begin ─ receive ─ decode ─ update ─ limit ─ encode ─ send ─ after the reply
#             └ the arm's receive ┘ manager └ the arm's reply ┘
#
# The cycle notes what the controllers take, the arm what the core does, the control loop the first and the last.

T = TypeVar("T")

BEGIN, RECEIVE, DECODE, UPDATE, LIMIT, ENCODE, SEND, AFTER_REPLY = range(8)
"""Indices of marks: the cycle began, or the stage of that name was done."""

MARK_COUNT = 8


@dataclass(frozen=True, slots=True)
class StageTimes:
    """How long each stage of one cycle took [s].

    Attributes:
        receive: taking the datagrams from the socket.
        decode: bytes to state, with what the session counts and whether that state can be true.
        update: the controllers.
        limit: the limiter.
        encode: command to bytes.
        send: handing them to the socket.
        after_reply: what can wait until after the reply, without the flight recorder itself.
    """

    receive: float
    decode: float
    update: float
    limit: float
    encode: float
    send: float
    after_reply: float

    @staticmethod
    def of(marks: Sequence[float]) -> StageTimes:
        """From the marks of one cycle [s]; a stage that was not noted took no time."""
        durations, last = [], marks[BEGIN]
        for mark in marks[RECEIVE:]:
            durations.append(max(0.0, mark - last))
            last = max(last, mark)
        return StageTimes(*durations)

    @property
    def reply(self) -> float:
        """From the beginning of the cycle until the reply had left [s]."""
        return self.receive + self.decode + self.update + self.limit + self.encode + self.send


class StageClock:
    """Notes when the stages of the current cycle were done.

    Args:
        now: returns the time on the machine's monotonic clock [s]. Without it every stage takes no time.
    """

    __slots__ = ("_is_timed", "_now", "marks")

    def __init__(self, now: Callable[[], float] | None = None) -> None:
        self.marks = [0.0] * MARK_COUNT
        self._now = now or float  # 0.0
        self._is_timed = now is not None

    def begin(self, now: float) -> None:
        """A cycle begins; ``now`` by the same clock."""
        self.marks = [now if self._is_timed else 0.0] * MARK_COUNT

    def note(self, stage: int) -> None:
        """``stage`` is done."""
        self.marks[stage] = self._now()

    def timed(self, stage: int, result: T) -> T:
        """``stage`` is done and this is its ``result``."""
        self.marks[stage] = self._now()
        return result


class RunningStatistics:
    """Adds up a series of values by Welford's method: no memory that grows, a handful of operations for each value."""

    __slots__ = ("_count", "_current", "_maximum", "_mean", "_minimum", "_squares")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all values."""
        self._count = 0
        self._current = self._mean = self._squares = 0.0
        self._minimum, self._maximum = inf, -inf

    def add(self, value: float) -> None:
        """Take one more value."""
        self._count += 1
        self._current = value
        step = value - self._mean
        self._mean += step / self._count
        self._squares += step * (value - self._mean)
        self._minimum, self._maximum = min(self._minimum, value), max(self._maximum, value)

    def result(self) -> Statistics:
        """The statistics of the values until now."""
        if not self._count:
            return Statistics()
        deviation = sqrt(self._squares / self._count)
        return Statistics(self._count, self._current, self._mean, self._minimum, self._maximum, deviation)
