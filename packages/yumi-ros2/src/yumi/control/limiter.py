"""The limiter: the last step before the network. No command leaves that a robot must never get.

The limiter itself is compiled: ``core/limiter.hpp``. What is done with the arm follows from one state, and the table of
:mod:`yumi.control.limiter_state`.
"""

from __future__ import annotations

from struct import Struct
from typing import Any

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, ArmCommand, ArmState, JointLimits, Joints
from yumi.control.collisions import ArmCollisionLimiter
from yumi.control.counters import LimiterCounters
from yumi.control.limiter_state import (
    SETTLING_STATES,
    TRANSITIONS,
    ForbiddenTransition,
    LimiterEvent,
    LimiterState,
)
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.control.shared_state import ArmProblem, Limited
from yumi.core.library import (
    COMMAND_STRUCT,
    SETTINGS_STRUCT,
    STATE_STRUCT,
    TABLE_STRUCT,
    LimiterExchange,
    load,
    new_handle,
)

_COUNTERS, _NUMBER = Struct("7q"), Struct("q")
_get_state = STATE_STRUCT.unpack_from
_pack_command, _get_command = COMMAND_STRUCT.pack, COMMAND_STRUCT.unpack_from
_COMMAND_AT, _COUNTERS_AT = LimiterExchange.command.offset, LimiterExchange.counters.offset
_UNANSWERED_AT = _COUNTERS_AT + LimiterCounters._fields.index("unanswered") * _NUMBER.size
_TABLE = b"".join(
    [
        bytes([TRANSITIONS[state].get(event, 0xFF) for event in LimiterEvent])  # -1 for what is forbidden
        for state in LimiterState
    ]
    + [bytes([state in SETTLING_STATES for state in LimiterState])]
)

if len(_TABLE) != TABLE_STRUCT.size:
    raise RuntimeError(f"the core's table has {TABLE_STRUCT.size} entries, and that of limiter_state.py {len(_TABLE)}")


def limiter_arm_state(values: tuple[Any, ...]) -> ArmState:
    """Of what the core has packed."""
    time, dt, session = values[:3]
    return ArmState(time, dt, session, values[3:10], values[10:17], values[17:24], values[24] != 0)


def limiter_arm_command(values: tuple[Any, ...]) -> ArmCommand:
    """Of what the core has packed."""
    return ArmCommand(values[:7], values[7:14] if values[14] else ZERO_JOINTS)


def pack_command(command: ArmCommand) -> bytes:
    """As the core takes it."""
    position, velocity = command
    return _pack_command(*position, *velocity, velocity is not ZERO_JOINTS)


class Limiter:
    """Limits the commands of one arm.

    What reaches it is the matter of the core (``core/arm_handle.hpp``), to which :attr:`handle` is given.

    Attributes:
        handle: what the core calls it.

    Args:
        limits: of the joints; speeds, accelerations and jerks bound how the position sent moves, and how the robot
            moves where a speed is fed forward too.
        period: time between two states of the arm [s]. No command moves further than the joints may within this time,
            in which the robot takes a command, however long ago the one before was.
        gain: of the robot's position loop [1/s].
        collisions: what keeps the arm apart from the other one and from all else; None where nothing does.
        bandwidth: of the robot's low-pass filter on the speed [Hz]; 0 is none.
    """

    def __init__(
        self,
        limits: JointLimits,
        period: float = CYCLE,
        gain: float = EGM_GAIN,
        collisions: ArmCollisionLimiter | None = None,
        bandwidth: float = 0.0,
    ) -> None:
        self._library = load()
        self._collisions = collisions
        own = (*limits.lower, *limits.upper, *limits.velocity, *limits.acceleration, *limits.jerk)
        settings = SETTINGS_STRUCT.pack(*own, *YUMI_LIMITS.velocity, period, gain, bandwidth)
        both, arm = (collisions.handle, collisions.number) if collisions is not None else (None, 0)
        self.handle = new_handle(self, "limiter", settings, _TABLE, both, arm)
        self._exchange = LimiterExchange.from_address(self.handle)
        self._other: Limiter | None = None  # kept, since the core reads what it has measured

    def pair(self, other: Limiter) -> None:
        """From now on each of both arms knows where the other was measured last: their datagrams may be exchanged."""
        self._other, other._other = other, self
        self._library.limiter_pair(self.handle, other.handle)

    @property
    def state(self) -> LimiterState:
        """What is done with the arm."""
        return LimiterState(self._exchange.limiter_state)

    @property
    def counters(self) -> LimiterCounters:
        """What was changed so far."""
        return LimiterCounters._make(_COUNTERS.unpack_from(self._exchange, _COUNTERS_AT))

    @property
    def unanswered(self) -> int:
        """The last of the counters, which each cycle reads."""
        return _NUMBER.unpack_from(self._exchange, _UNANSWERED_AT)[0]  # type: ignore[no-any-return]

    @property
    def is_waiting(self) -> bool:
        """Whether the command waits since the robot follows an older one."""
        return self._exchange.limiter_state == LimiterState.WAITING  # type: ignore[no-any-return]

    @property
    def is_at_rest(self) -> bool:
        """Whether the command stands, and does not lead the robot any more."""
        return bool(self._exchange.is_at_rest)

    @property
    def must_settle(self) -> bool:
        """Whether the arm is held until its command is back where the arm is, whatever is desired."""
        return bool(self._exchange.must_settle)

    @property
    def problem(self) -> ArmProblem:
        """Why the arm holds whatever is desired."""
        if self._exchange.is_implausible:
            return ArmProblem.IMPLAUSIBLE
        return ArmProblem.REFERENCES_IGNORED if self._exchange.are_references_ignored else ArmProblem.NONE

    @property
    def implausible_position(self) -> Joints:
        """The newest measured position that was not used [rad], (7,)."""
        return tuple(self._exchange.implausible_position)

    @property
    def is_other_arm(self) -> bool:
        """Whether that is where the other arm is."""
        return bool(self._exchange.is_other_arm)

    @property
    def limited(self) -> Limited | None:
        """The parts that must not come nearer to each other, where that limits the arm in this cycle."""
        return self._collisions.limited if self._collisions else None

    def note_interruption(self) -> None:
        """No datagram of the arm arrives: the other arm keeps clear of where this one may go."""
        self.done(self._library.limiter_lose(self.handle, LimiterEvent.INTERRUPTION))

    def note_connection_lost(self) -> None:
        """No datagram has arrived for so long that the arm's controllers are deactivated; see above."""
        self.done(self._library.limiter_lose(self.handle, LimiterEvent.CONNECTION_LOST))

    def note_position(self, position: Joints) -> None:
        """The arm, whose datagrams do not arrive, was read from the controller to be at ``position`` [rad], (7,)."""
        if self._collisions is not None:
            self._collisions.note_measured(position)

    def scale_speed(self, scale: float) -> None:
        """Move no joint faster than ``scale`` times its limit: speeds from the next command on, positions later."""
        self._library.limiter_scale_speed(self.handle, scale)

    def checked(self) -> ArmState:
        """The state that was checked last, as far as it is plausible.

        A position that no arm can have reached is replaced by the last plausible one, and the plan by where the
        references lead it, as long as it is in doubt.
        """
        return limiter_arm_state(_get_state(self._exchange))

    def sent(self) -> ArmCommand:
        """The command that was limited last.

        The first of a session in which the robot does not follow yet equals the measured position: a robot that begins
        to follow finds no step. So do the commands while the robot does not follow, once they have come there.
        """
        return limiter_arm_command(_get_command(self._exchange, _COMMAND_AT))

    def done(self, result: int) -> int:
        """What the core returned.

        Raises:
            ForbiddenTransition: the program is wrong. The cycle gets no reply, so that the robot keeps its reference.
        """
        if result < 0 and self._exchange.forbidden < 0:
            raise RuntimeError("the core's limiter has failed")
        if result < 0:
            raise ForbiddenTransition(f"{LimiterEvent(self._exchange.forbidden).name} in the state {self.state.name}")
        return result
