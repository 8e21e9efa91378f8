"""A Smart Gripper behind Robot Web Services: commands through the state machine, state from its own signals.

Whatever is reported here was measured by the gripper; elapsed time decides only that it has failed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import count
from math import inf
from threading import Lock

from yumi.clock import Clock
from yumi.errors import CommandRefused, ControllerRefused, ProtocolError, RobotNotReady
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.state_machine import GRIPPER, RUN_GRIPPER, SgCommand
from yumi.robot.gripper import ALLOWANCE, MAX_FORCE, THINNEST, TRAVEL, HandState, Outcome, outcome_of
from yumi.robot.joints import Side
from yumi.rws import rapid_values

_M_PER_COUNT = 1e-4  # hand_ActualPosition counts 0.1 mm
_GLANCE = 0.1  # [s] between two looks at whether a command was taken
_LOOK = 0.2  # [s] between two looks at fingers that move
_UNKNOWN = 404

# Not READY: the robot's routine brings the hand to READY before it sends each command.
_AT_REST = {HandState.ACTION_COMPLETED, HandState.KEEP_OBJECT}


class GripperRoutines:
    """The one signal the grippers share: its edge runs what each arm's task has been told.

    Both tasks see every edge, so the next command waits until the task has taken this one: it would otherwise be
    run twice, or be erased while the task reads it.

    Args:
        client: a connected client.
        clock: where waiting time comes from.
    """

    def __init__(self, client: RwsClient, clock: Clock) -> None:
        self._client = client
        self._clock = clock
        self._lock = Lock()
        self._are_empty = False  # the tasks' slots, as far as we know

    def run(
        self,
        side: Side,
        command: SgCommand,
        timeout: float,
        *,
        target: float | None = None,
        force: float | None = None,
    ) -> None:
        """Have one arm's task run ``command``; returns when the task has issued it.

        Args:
            side: which arm.
            command: what to do.
            timeout: longest wait for the task [s].
            target: finger position [m] for ``MOVE_TO``.
            force: holding force [N] for ``GRIP_IN``.

        Raises:
            RobotNotReady: the task did not take the command.
        """
        with self._lock:
            if not self._are_empty:
                for each in Side:
                    self._write(each, "command_input", float(SgCommand.NONE))
            self._are_empty = False
            if target is not None:
                self._write(side, "target_position_input", target * 1e3)
            if force is not None:
                self._write_force(side, force)
            self._write(side, "command_input", float(command))
            self._client.pulse_signal(RUN_GRIPPER)
            _wait(
                self._clock,
                lambda: self._is_taken(side),
                timeout,
                f"The {side.word} arm took no gripper command within {timeout:g} s; see that the RAPID program runs.",
            )
            self._are_empty = True

    def _is_taken(self, side: Side) -> bool:
        return rapid_values.decode(self._client.symbol(side.task, GRIPPER, "command_input")) == SgCommand.NONE

    def _write(self, side: Side, symbol: str, value: float) -> None:
        self._client.set_symbol(side.task, GRIPPER, symbol, rapid_values.encode(value))

    def _write_force(self, side: Side, force: float) -> None:
        current = rapid_values.decode(self._client.symbol(side.task, GRIPPER, "settings"))
        if not isinstance(current, tuple) or len(current) != 3:
            raise RobotNotReady(f"{GRIPPER}/settings of {side.task} has an unknown layout: {current}.")
        max_speed, set_force, limit = current
        if set_force != force:
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
        self._force = 0.0
        self._looked_at = -inf
        self.last_position = 0.0

    def position(self) -> float:
        """Where its fingers are now [m].

        Raises:
            RobotNotReady: the controller has no such gripper.
        """
        self.last_position = self._signal("hand_ActualPosition") * _M_PER_COUNT
        self._looked_at = self._clock.now()
        return self.last_position

    def recent_position(self, age: float) -> float:
        """Where its fingers were not longer ago than ``age`` [s], or are now [m]; raises as ``position``."""
        return self.last_position if self._clock.now() - self._looked_at < age else self.position()

    def is_holding(self) -> bool:
        """Whether it holds something now; raises as ``position``."""
        return self._hand_state() is HandState.KEEP_OBJECT and self.position() > THINNEST

    def is_calibrated(self) -> bool:
        """Whether its positions mean anything."""
        return self._signal("hand_StatusCalibrated") != 0

    def calibrate_if_needed(self) -> bool:
        """Close the fingers and call that zero, unless that has been done since the hand has power.

        Returns:
            Whether it was needed.

        Raises:
            RobotNotReady: the controller has no such gripper, or it did not become calibrated.
        """
        if self.is_calibrated():
            return False
        self._routines.run(self._side, SgCommand.CALIBRATE, self._timeout)
        _wait(
            self._clock,
            self.is_calibrated,
            self._timeout,
            f"The {self._side.word} gripper could not be calibrated; check its 24 V supply and its fingers.",
        )
        return True

    def begin(self, position: float, force: float) -> None:
        """Start to move the fingers: 0 grips inwards with ``force``, anything else is a position.

        Args:
            position: distance of each finger from the middle [m].
            force: holding force [N].

        Raises:
            CommandRefused: a value is out of range; nothing was changed.
            RobotNotReady: the gripper is not calibrated, in an error, or did not take the command.
        """
        if not 0.0 <= position <= TRAVEL:
            raise CommandRefused(f"Gripper position {position} m is out of range; each finger travels 0 to {TRAVEL} m.")
        if not 0.0 < force <= MAX_FORCE:
            raise CommandRefused(f"Gripper force {force} N is out of range; allowed is above 0 to {MAX_FORCE:g} N.")
        self._check_ready()
        self._force = force
        if position == 0.0:
            self._routines.run(self._side, SgCommand.GRIP_IN, self._timeout, force=force)
        else:
            self._routines.run(self._side, SgCommand.MOVE_TO, self._timeout, target=position)

    def wait(self, position: float, on_feedback: Callable[[float], None]) -> Outcome:
        """Wait until the command to go to ``position`` [m] has ended.

        Args:
            position: as given to ``begin``.
            on_feedback: told where the fingers are [m], now and then.

        Raises:
            RobotNotReady: the gripper reports an error, or still moves when its time is up.
        """
        end = self._clock.now() + self._timeout
        for look in count():
            outcome = self.outcome(position)
            if outcome is not None:
                return outcome
            if self._clock.now() > end:
                break
            if look % 2:  # a position costs a request, of which there are few
                on_feedback(self.position())
            self._clock.wait(_LOOK)
        raise RobotNotReady(f"The {self._side.word} gripper still moves after {self._timeout:g} s; look at it.")

    def outcome(self, position: float) -> Outcome | None:
        """How the command to go to ``position`` [m] has ended, or None while it goes on.

        Raises:
            RobotNotReady: the gripper reports an error.
        """
        hand = self._hand_state()
        self._check_error(hand)
        if hand not in _AT_REST:
            return None
        now_at = self.position()
        is_held = position == 0.0 and hand is HandState.KEEP_OBJECT and now_at > THINNEST
        is_there = abs(now_at - position) <= ALLOWANCE and not is_held
        return outcome_of(now_at, self._force if is_held else 0.0, stalled=not is_there, reached_goal=is_there)

    def _check_ready(self) -> None:
        if not self.is_calibrated():
            raise RobotNotReady(f"The {self._side.word} gripper is not calibrated; calibrate it first.")
        self._check_error(self._hand_state())

    def _check_error(self, state: HandState) -> None:
        if state is HandState.ERROR:
            raise RobotNotReady(f"The {self._side.word} gripper reports an error; look at the event log.")

    def _hand_state(self) -> HandState:
        value = self._signal("hand_SysState")
        try:
            return HandState(int(value))
        except ValueError as error:
            raise ProtocolError(
                f"The {self._side.word} gripper reports state {value:g}, which no Smart Gripper has; check its "
                "firmware and its fieldbus configuration."
            ) from error

    def _signal(self, name: str) -> float:
        full = f"{name}_{self._side.name[0]}"
        try:
            return self._client.signal(full).value
        except ControllerRefused as error:
            if error.status != _UNKNOWN:
                raise
            raise RobotNotReady(
                f"The controller has no signal {full}; it has no {self._side.word} Smart Gripper."
            ) from error


def calibrate(grippers: Mapping[Side, Gripper], say: Callable[[str], None], complain: Callable[[str], None]) -> None:
    """Calibrate all hands that need it; a hand that cannot be used is told and left, since the arms move without it.

    Args:
        grippers: the hands.
        say: told which hand was calibrated.
        complain: told which hand cannot be used, and why.
    """
    for side, gripper in grippers.items():
        try:
            if gripper.calibrate_if_needed():
                say(f"The {side.word} gripper was calibrated.")
        except (RobotNotReady, ControllerRefused, ProtocolError) as error:
            complain(f"The {side.word} gripper cannot be used: {error}")


def _wait(clock: Clock, is_so: Callable[[], bool], timeout: float, sentence: str) -> None:
    end = clock.now() + timeout
    while not is_so():
        if clock.now() >= end:
            raise RobotNotReady(sentence)
        clock.wait(_GLANCE)
