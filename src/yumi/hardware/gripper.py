"""A Smart Gripper behind Robot Web Services: commands through the state machine, state from its own signals.

Whatever is reported here was measured by the gripper; elapsed time decides only that it has failed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, IntEnum
from threading import Lock

from yumi.clock import Clock
from yumi.errors import CommandRefused, RobotNotReady
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.state_machine import GRIPPER, RUN_GRIPPER, GripperCommand
from yumi.robot.joints import Side
from yumi.rws import rapid_values

TRAVEL = 0.025
"""Travel of each finger [m] (reference/yumi.md §2.1)."""

MAX_FORCE = 20.0
"""Largest holding force [N]."""

_M_PER_COUNT = 1e-4  # hand_ActualPosition counts 0.1 mm
_CLOSED = 0.0005  # [m] nothing fits between fingers nearer than this
_IN_PLACE = 0.001  # [m] the hand's own positioning allowance (reference/yumi.md §2.1)
_GLANCE = 0.05  # [s]


class HandState(IntEnum):
    """``hand_SysState`` of the gripper (reference/statemachine.md §5.3)."""

    READY = 0
    ERROR = 1
    FREE_MOVE_TO_MAX = 2
    FREE_MOVE_TO_MIN = 3
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


class Outcome(Enum):
    """How a gripper command ended; the value says it in a sentence."""

    OPEN = "open"
    CLOSED = "closed"
    IN_PLACE = "in place"
    HOLDING = "holding"
    STALLED = "stalled"


@dataclass(frozen=True, slots=True)
class GripperState:
    """What the gripper measures.

    Attributes:
        position: distance of each finger from the middle [m], 0 to 0.025.
        state: what it is doing.
    """

    position: float
    state: HandState

    @property
    def is_holding(self) -> bool:
        """Whether an object is between the fingers: the hand keeps it, and the fingers are not together."""
        return self.state is HandState.KEEP_OBJECT and self.position > _CLOSED

    @property
    def is_moving(self) -> bool:
        """Whether a command is still being carried out."""
        return self.state not in _AT_REST


# Not READY: the robot's routine brings the hand to READY before it sends each command.
_AT_REST = {HandState.ERROR, HandState.ACTION_COMPLETED, HandState.KEEP_OBJECT}


class GripperRoutines:
    """The one command slot the grippers share: a signal edge runs what both tasks have been told."""

    def __init__(self, client: RwsClient) -> None:
        self._client = client
        self._lock = Lock()

    def run(self, side: Side, command: GripperCommand, target: float | None = None, force: float | None = None) -> None:
        """Have one arm's task run ``command``; the other arm's slot is emptied first.

        Args:
            side: which arm.
            command: what to do.
            target: finger position [m] for ``MOVE_TO``.
            force: holding force [N].
        """
        with self._lock:
            for other in Side:
                chosen = command if other is side else GripperCommand.NONE
                self._write(other, "command_input", float(chosen))
            if target is not None:
                self._write(side, "target_position_input", target * 1e3)
            if force is not None:
                self._write_force(side, force)
            self._client.pulse_signal(RUN_GRIPPER)

    def is_accepted(self, side: Side) -> bool:
        """Whether the task has taken its command and issued it."""
        return rapid_values.decode(self._client.symbol(side.task, GRIPPER, "command_input")) == 0.0

    def _write(self, side: Side, symbol: str, value: float) -> None:
        self._client.set_symbol(side.task, GRIPPER, symbol, rapid_values.encode(value))

    def _write_force(self, side: Side, force: float) -> None:
        current = rapid_values.decode(self._client.symbol(side.task, GRIPPER, "settings"))
        if not isinstance(current, tuple) or len(current) != 3:
            raise RobotNotReady(f"{GRIPPER}/settings of {side.task} has an unknown layout: {current}.")
        max_speed, _, limit = current
        self._client.set_symbol(side.task, GRIPPER, "settings", rapid_values.encode((max_speed, force, limit)))


class Gripper:
    """One hand.

    Attributes:
        last_position: where its fingers were when it was last looked at [m].

    Args:
        side: which arm carries it.
        client: a connected client.
        routines: shared by both hands.
        clock: where waiting time comes from.
        timeout: a command that has not ended after this time has failed [s].
    """

    def __init__(self, side: Side, client: RwsClient, routines: GripperRoutines, clock: Clock, timeout: float) -> None:
        self._side = side
        self._client = client
        self._routines = routines
        self._clock = clock
        self._timeout = timeout
        self.last_position = 0.0

    def state(self) -> GripperState:
        """What the gripper measures now."""
        self.last_position = self._signal("hand_ActualPosition") * _M_PER_COUNT
        return GripperState(position=self.last_position, state=HandState(int(self._signal("hand_SysState"))))

    def is_calibrated(self) -> bool:
        """Whether its positions mean anything."""
        return self._signal("hand_StatusCalibrated") != 0

    def calibrate_if_needed(self) -> bool:
        """Close the fingers and call that zero, unless that has been done since the hand has power.

        Returns:
            Whether it was needed.

        Raises:
            RobotNotReady: the gripper did not become calibrated in time.
        """
        if self.is_calibrated():
            return False
        self._routines.run(self._side, GripperCommand.CALIBRATE)
        self._wait(
            lambda: self._routines.is_accepted(self._side) and self.is_calibrated(),
            "it could not be calibrated (check its 24 V supply and its fingers)",
        )
        return True

    def begin(self, position: float, force: float) -> None:
        """Start to move the fingers: 0 grips inwards with ``force``, anything else is a position.

        Args:
            position: distance of each finger from the middle [m].
            force: holding force [N].

        Raises:
            CommandRefused: a value is out of range; nothing was changed.
            RobotNotReady: the gripper is not calibrated, or in an error.
        """
        if not 0.0 <= position <= TRAVEL:
            raise CommandRefused(f"Gripper position {position} m is out of range; each finger travels 0 to {TRAVEL} m.")
        if not 0.0 < force <= MAX_FORCE:
            raise CommandRefused(f"Gripper force {force} N is out of range; allowed is above 0 to {MAX_FORCE:g} N.")
        self._check_ready()
        if position == 0.0:
            self._routines.run(self._side, GripperCommand.GRIP_IN, force=force)
        else:
            self._routines.run(self._side, GripperCommand.MOVE_TO, target=position, force=force)
        self._wait(lambda: self._routines.is_accepted(self._side), "the robot did not take the command")

    def outcome(self, position: float) -> Outcome | None:
        """How the command to go to ``position`` [m] has ended, or None while it goes on."""
        state = self.state()
        if state.state is HandState.ERROR:
            raise RobotNotReady(f"The {self._side.word} gripper reports an error; look at the event log.")
        if state.is_moving:
            return None
        if position == 0.0 and state.is_holding:
            return Outcome.HOLDING
        if abs(state.position - position) > _IN_PLACE:
            return Outcome.STALLED
        if position == 0.0:
            return Outcome.CLOSED
        return Outcome.OPEN if position >= TRAVEL - _IN_PLACE else Outcome.IN_PLACE

    @property
    def timeout(self) -> float:
        """Longest time a command may take [s]."""
        return self._timeout

    def check_deadline(self, now: float, end: float) -> None:
        """Give up a command that should have ended at ``end`` [s].

        Raises:
            RobotNotReady: it is later than that.
        """
        if now > end:
            raise RobotNotReady(f"The {self._side.word} gripper still moves after {self._timeout:g} s; look at it.")

    def _check_ready(self) -> None:
        if not self.is_calibrated():
            raise RobotNotReady(f"The {self._side.word} gripper is not calibrated; calibrate it first.")
        if self.state().state is HandState.ERROR:
            raise RobotNotReady(f"The {self._side.word} gripper reports an error; look at the event log.")

    def _wait(self, is_so: Callable[[], bool], reason: str) -> None:
        end = self._clock.now() + self._timeout
        while not is_so():
            if self._clock.now() >= end:
                raise RobotNotReady(f"The {self._side.word} gripper failed: {reason} after {self._timeout:g} s.")
            self._clock.wait(_GLANCE)

    def _signal(self, name: str) -> float:
        return self._client.signal(f"{name}_{self._side.name[0]}").value
