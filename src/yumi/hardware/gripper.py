"""A Smart Gripper behind Robot Web Services: commands through the state machine, state from its own signals.

Whatever is reported here was measured by the gripper; elapsed time decides only that it has failed.
"""

from __future__ import annotations

from collections.abc import Callable

from yumi.clock import Clock
from yumi.errors import GoalNotReached, RobotNotReady
from yumi.hardware.gripper_routines import GripperRoutines
from yumi.hardware.hand_io import HandIo
from yumi.hardware.state_machine import SgCommand
from yumi.hardware.vacuum import Vacuum
from yumi.robot.gripper import (
    ALLOWANCE,
    THINNEST,
    TOP_SPEED,
    Direction,
    HandCommand,
    HandState,
    Outcome,
    outcome_of,
)
from yumi.robot.hand import HandOrder, HandReading, hand_state, position_of, speed_count
from yumi.robot.joints import Side

STALL_TIME = 1.0
"""Fingers that have stood still for so long on their way to a position are stopped by something [s]."""

_JAMMED = 0.15  # [s]; what was seen standing for so long before the hand gave up was stopped by something, too
_GLANCE = 0.05  # [s] between two looks at what is told
_LOOK = 0.2  # [s] between two looks that cost requests
_MOMENT = 1.0  # [s] for the hand to obey a signal

# Not READY: the robot's routine brings the hand to READY before it sends each command.
_AT_REST = {HandState.ACTION_COMPLETED, HandState.KEEP_OBJECT}
_STANDING = _AT_REST | {HandState.READY, HandState.ERROR}
_JOGGING = {HandState.JOG_OPEN, HandState.JOG_CLOSE, HandState.CALIBRATION}


Check = Callable[[], None]
"""Raises when a hand may not move."""


def _always() -> None:
    """Nothing stands against it."""


def how_to_calibrate(side: Side) -> str:
    """The commands that calibrate a hand, for a sentence."""
    return f"service {side.value}/gripper/calibrate, or robot.{side.word}.gripper.calibrate() in a script"


class Gripper:
    """One hand.

    Attributes:
        side: which arm carries it.
        last_position: where its fingers were when it was last looked at [m].
        vacuum: its vacuum modules.

    Args:
        io: its signals.
        routines: shared by both hands.
        clock: where waiting time comes from.
        timeout: a command that has not ended after this time has failed [s].
        usual_speed: of its fingers, where an order names none [m/s].
    """

    def __init__(
        self, io: HandIo, routines: GripperRoutines, clock: Clock, timeout: float, usual_speed: float = TOP_SPEED
    ) -> None:
        self.side = io.side
        self.last_position = 0.0
        self.vacuum = Vacuum(io, routines, clock, timeout)
        self._io = io
        self._routines = routines
        self._clock = clock
        self._timeout = timeout
        self._usual_speed = usual_speed
        self._looked_at = self._stands_since = self._stood = 0.0  # the fingers, as far as they were looked at
        self._is_stopped = self._is_jogging = False

    def reading(self) -> HandReading:
        """Everything it shows now.

        Raises:
            RobotNotReady: the controller has no such gripper.
        """
        reading = self._io.reading()
        self.last_position = reading.position
        return reading

    def position(self) -> float:
        """Where its fingers are now [m]; raises as ``reading``."""
        self.last_position = position_of(self._io.value("hand_ActualPosition"))
        return self.last_position

    def is_holding(self) -> bool:
        """Whether it holds something now; raises as ``reading``."""
        return self._state() is HandState.KEEP_OBJECT and self.position() > THINNEST

    def is_calibrated(self) -> bool:
        """Whether its positions mean anything."""
        return self._io.ask("hand_StatusCalibrated") != 0

    def why_not_calibrate(self) -> str | None:
        """Why its fingers should not be closed without being asked for: they hold something, or move; else None.

        Positions mean nothing before calibration, so that a force is taken for something held.

        Raises:
            RobotNotReady: the controller has no such gripper.
        """
        state = hand_state(self._io.ask("hand_SysState"))
        if state is HandState.KEEP_OBJECT:
            return "it presses on something"
        return None if state in _STANDING else "its fingers move"

    def calibrate(self, *others: Gripper, check: Check = _always) -> None:
        """Close the fingers and call that zero; see also :meth:`RobotManager.calibrate`, which sees that they may.

        Args:
            others: hands of the same robot that are calibrated at the same time.
            check: raises when the hands may not move any more.

        Raises:
            RobotNotReady: the controller has no such gripper, its arm is guided, or it did not become calibrated.
        """
        hands = (self, *others)
        self._routines.calibrate([hand.side for hand in hands], self._timeout, check)
        for hand in hands:
            self._wait(
                hand.is_calibrated,
                _MOMENT,
                f"The {hand.side.word} gripper could not be calibrated; check its 24 V supply and its fingers.",
            )

    def begin(self, order: HandOrder, check: Check = _always) -> None:
        """Start to move the fingers.

        Args:
            order: what to do.
            check: raises when the hand may not move any more; a hold that comes after it is not forgotten.

        Raises:
            RobotNotReady: the gripper is not calibrated, in an error, or did not take the command.
        """
        self._is_stopped = self._is_jogging = False
        check()
        self._check_ready()
        # Each time: whatever was written before, the controller may have been restarted since.
        self._io.write("hand_MaxSpeed", speed_count(order.speed or self._usual_speed))
        try:
            self._send(order)
        finally:
            if self._is_stopped:  # while the command was on its way
                self.stop()
        self._stands_since, self._stood = self._clock.now(), 0.0

    def _send(self, order: HandOrder) -> None:
        if order.direction is None:
            self._routines.run(self.side, SgCommand.MOVE_TO, self._timeout, target=order.position)
        else:
            command = SgCommand.GRIP_IN if order.direction is Direction.INWARDS else SgCommand.GRIP_OUT
            self._routines.run(self.side, command, self._timeout, force=order.force)

    def wait(
        self,
        order: HandOrder,
        on_feedback: Callable[[float], None] = lambda position: None,
        is_cancelled: Callable[[], bool] = lambda: False,
    ) -> Outcome | None:
        """Wait until ``order`` has ended; None when it was cancelled, and the fingers stopped.

        Args:
            order: as given to ``begin``.
            on_feedback: told where the fingers are [m], now and then.
            is_cancelled: asked now and then.

        Raises:
            RobotNotReady: the gripper reports an error, or still moves when its time is up.
            GoalNotReached: somebody stopped it.
        """
        end = self._clock.now() + self._timeout
        while self._clock.now() <= end:
            if is_cancelled():
                self.stop()
                return None
            if self._is_stopped:
                raise GoalNotReached(f"The {self.side.word} gripper was stopped on its way.")
            outcome = self.outcome(order)
            if outcome is not None:
                return outcome
            on_feedback(self.last_position)
            self._clock.wait(_GLANCE if self._io.is_told else _LOOK)
        raise RobotNotReady(f"The {self.side.word} gripper still moves after {self._timeout:g} s; look at it.")

    def outcome(self, order: HandOrder) -> Outcome | None:
        """How ``order`` has ended, or None while it goes on.

        What was told may be older than the order, so that an end counts only when it is found by asking.

        Raises:
            RobotNotReady: the gripper reports an error.
        """
        state = self._state()
        if state in _AT_REST or state is HandState.ERROR:
            state = hand_state(self._io.ask("hand_SysState"))
        if state in _AT_REST:
            return self._outcome_at_rest(order, state)
        if state is not HandState.ERROR:
            self._look_at_fingers()
        if order.direction is None and self._is_stalled(order, state):
            self._let_go(state)
            return Outcome.STALLED
        self._check_error(state)
        return None

    def jog(self, *, opens: bool, check: Check = _always) -> None:
        """Open or close with little speed until ``stop``, calibrated or not.

        Args:
            opens: which way.
            check: as for ``begin``.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        self.stop()
        self._is_stopped, self._is_jogging = False, True
        check()
        self._io.write("hand_CmdGripper", HandCommand.JOG_OPEN if opens else HandCommand.JOG_CLOSE)
        if self._is_stopped:  # while the command was on its way
            self.stop()

    def stop(self) -> None:
        """Stop the fingers: the motor lets go, and with it what the hand holds.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        self._is_stopped, self._is_jogging = True, False
        self._io.write("hand_CmdGripper", HandCommand.GO_TO_READY)
        self._wait(
            lambda: hand_state(self._io.ask("hand_SysState")) is HandState.READY,
            _MOMENT,
            f"The {self.side.word} gripper does not stop; clear its error, or look at the event log.",
        )

    def hold(self) -> None:
        """Stop fingers that move, and what is on its way to them; a hand that holds something goes on holding it.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        self._is_stopped = True
        if hand_state(self._io.ask("hand_SysState")) not in _STANDING:
            self.stop()

    def end_jog(self) -> None:
        """Stop a jog or a calibration, which would go on although the robot was stopped: it needs no motors.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        if self._is_jogging or hand_state(self._io.ask("hand_SysState")) in _JOGGING:
            self.hold()

    def clear_error(self) -> None:
        """Acknowledge the hand's error; nothing where there is none.

        Raises:
            RobotNotReady: it still reports one.
        """
        for level in (1, 0):
            self._io.write("hand_CmdClearErr", level)
        self._wait(
            lambda: hand_state(self._io.ask("hand_SysState")) is not HandState.ERROR,
            _MOMENT,
            f"The {self.side.word} gripper still reports an error; check its 24 V supply and look at the event log.",
        )

    def _outcome_at_rest(self, order: HandOrder, state: HandState) -> Outcome:
        position = self.last_position = position_of(self._io.ask("hand_ActualPosition"))
        is_held = order.is_held(state, position)
        is_there = abs(position - order.position) <= ALLOWANCE and not is_held
        return outcome_of(position, order.force if is_held else 0.0, stalled=not is_there, reached_goal=is_there)

    def _look_at_fingers(self) -> None:
        """See for how long they have been where they are."""
        before, now = self._looked_at, self._clock.now()
        self._looked_at = self.position()
        if self._looked_at != before:
            self._stands_since = now
        self._stood = now - self._stands_since

    def _is_stalled(self, order: HandOrder, state: HandState) -> bool:
        """A hand gives up by itself, too; an error of fingers that moved has another cause."""
        is_there = abs(self.last_position - order.position) <= ALLOWANCE
        if state is HandState.ERROR:
            return self._stood >= _JAMMED and not is_there
        return self._stood >= STALL_TIME and self._do_fingers_stand()

    def _do_fingers_stand(self) -> bool:
        """What was told may have been held up on its way: ask."""
        before, self.last_position = self.last_position, position_of(self._io.ask("hand_ActualPosition"))
        return self.last_position == before and self._io.ask("hand_ActualSpeed") == 0

    def _let_go(self, state: HandState) -> None:
        """Stop pushing against what is in the way."""
        if state is HandState.ERROR:
            self.clear_error()
        else:
            self.stop()

    def _check_ready(self) -> None:
        """What was told may be old: a refusal asks."""
        if self._io.value("hand_StatusCalibrated") == 0 and not self.is_calibrated():
            raise RobotNotReady(
                f"The {self.side.word} gripper is not calibrated; calibrate it first: {how_to_calibrate(self.side)}."
            )
        if self._state() is HandState.ERROR:
            self._check_error(hand_state(self._io.ask("hand_SysState")))

    def _check_error(self, state: HandState) -> None:
        if state is HandState.ERROR:
            raise RobotNotReady(
                f"The {self.side.word} gripper reports error {self._io.ask('hand_SysError'):g}; look at the event log, "
                "then clear it."
            )

    def _state(self) -> HandState:
        return hand_state(self._io.value("hand_SysState"))

    def _wait(self, is_so: Callable[[], bool], timeout: float, sentence: str) -> None:
        end = self._clock.now() + timeout
        while not is_so():
            if self._clock.now() >= end:
                raise RobotNotReady(sentence)
            self._clock.wait(_GLANCE)
