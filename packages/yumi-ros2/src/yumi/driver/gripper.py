"""The Smart Gripper over Robot Web Services: its fingers and vacuum modules, by commands to the state machine.

Whatever is reported here was measured by the gripper; elapsed time decides only that a command has failed. One
:class:`RwsGripper` an arm; both share :class:`GripperRoutines`, which has the state machine run their commands, and
:class:`.GripperSignals`, which knows their signals by subscription.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from threading import Lock

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused, ControllerRefused, GoalNotReached, RobotNotReady
from abb_protocols.robot.gripper_values import (
    ATMOSPHERIC_PRESSURE,
    FINGER_ALLOWANCE,
    THINNEST_GRIPPED,
    TOP_FINGER_SPEED,
    GripDirection,
    GripOutcome,
    GripperGoal,
    GripperModules,
    GripperState,
    ServoCommand,
    ServoState,
    VacuumState,
    outcome_of,
    position_of,
    read_gripper,
    read_vacuum,
    servo_state,
    speed_count,
)
from abb_protocols.robot.joints import Side
from abb_runtime.clock import POLL_PERIOD, Clock, comes_true, wait_until
from abb_runtime.rws.client import RwsClient
from yumi.driver.gripper_signals import GripperSignals, full_signal_name
from yumi.driver.readiness import ConditionalRequest, check_request
from yumi.driver.robot_state import RobotState
from yumi.driver.state_machine import RUN_SG_SIGNAL, SG_MODULE, SgCommand, read_machine_state

VACUUM_CHANNELS = (1, 2)
"""Numbers of the vacuum modules."""

_STALL_TIME = 1.0
"""Fingers that have stood still for so long on their way to a position are stopped by something [s]."""

_JAMMED = 0.15  # [s]; fingers seen standing for so long before the gripper gave up were stopped by something, too
_REQUEST_POLL = 0.2  # [s] between two polls that cost requests
_ROUTINE_POLL = 0.1  # [s] between two polls whether a command was taken
_MOMENT = 1.0  # [s] for the gripper to switch
_VENTED = 0.95 * ATMOSPHERIC_PRESSURE
_UNKNOWN = 404

# Not READY: the robot's routine brings the gripper to READY before it sends each command.
_AT_REST = {ServoState.ACTION_COMPLETED, ServoState.KEEP_OBJECT}
_STANDING = _AT_REST | {ServoState.READY, ServoState.ERROR}
_JOGGING = {ServoState.JOG_OPEN, ServoState.JOG_CLOSE, ServoState.CALIBRATION}

GripperCheck = Callable[[], None]
"""Raises when a gripper may not move."""


def forbid_nothing() -> None:
    """The check where nothing forbids a motion."""


class RwsGripper:
    """One gripper: its fingers and its vacuum modules.

    What was reported lags behind by what a subscription takes, 50 ms or so; what is asked for costs a request, of which
    there are few a second (see :mod:`abb_runtime.rws.session`). Refusals and ends count only when they are found by
    asking.

    Args:
        side: which arm carries it.
        client: a connected client.
        routines: shared by both grippers.
        clock: for waiting.
        timeout: a command that has not ended after this time has failed [s].
        usual_speed: of its fingers, where a goal names none [m/s].
        modules: what it is made of.
        signals: of both grippers by subscription; None asks for everything.

    Attributes:
        side: which arm carries it.
        modules: what it is made of.
        last_position: where its fingers were when they were last read [m].
        goal: what they were sent to last; None after a jog, or where that is not known.
        busy: held while a command has the fingers move, see :meth:`alone`; a stop needs it not.
    """

    def __init__(
        self,
        side: Side,
        client: RwsClient,
        routines: GripperRoutines,
        clock: Clock,
        timeout: float,
        usual_speed: float = TOP_FINGER_SPEED,
        modules: GripperModules = GripperModules.SERVO,
        signals: GripperSignals | None = None,
    ) -> None:
        self.side = side
        self.modules = modules
        self.last_position = 0.0
        self.goal: GripperGoal | None = None
        self.busy = Lock()
        self._client = client
        self._signals = signals
        self._routines = routines
        self._clock = clock
        self._timeout = timeout
        self._usual_speed = usual_speed
        self._polled = self._stands_since = self._stood = 0.0  # the fingers, as far as they were polled
        self._is_stopped = self._is_jogging = False

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Nothing else has the fingers move within the block, neither a goal of ROS nor a client or script.

        Raises:
            CommandRefused: another command is being carried out.
        """
        if not self.busy.acquire(blocking=False):
            raise CommandRefused(message("gripper_busy", gripper=self.side.word))
        try:
            yield
        finally:
            self.busy.release()

    # What it shows

    def state(self) -> GripperState:
        """Everything it shows now.

        Raises:
            RobotNotReady: the controller has no such gripper.
        """
        state = read_gripper(self._value, self.modules)
        self.last_position = state.position
        return state

    def position(self) -> float:
        """Where its fingers are now [m]; raises as :meth:`state`."""
        self.last_position = position_of(self._value("hand_ActualPosition"))
        return self.last_position

    def is_holding(self) -> bool:
        """Whether it holds something now; raises as :meth:`state`."""
        return self._servo_state() is ServoState.KEEP_OBJECT and self.position() > THINNEST_GRIPPED

    def is_calibrated(self) -> bool:
        """Whether its positions mean anything; raises as :meth:`state`."""
        return self._ask("hand_StatusCalibrated") != 0

    def why_not_calibrate(self) -> Message | None:
        """Why its fingers must not be closed without being asked for: they hold something, or move; else None.

        Positions mean nothing before calibration, so that a force is taken for something held. Raises as :meth:`state`.
        """
        state = self._ask_servo_state()
        if state is ServoState.KEEP_OBJECT:
            return message("gripper_presses_on_something")
        return None if state in _STANDING else message("gripper_fingers_move")

    # Fingers

    def calibrate(self, *others: RwsGripper, check: GripperCheck = forbid_nothing) -> None:
        """Close the fingers and call that zero; see also :meth:`RobotManager.calibrate`, which sees that they may.

        Args:
            others: grippers of the same robot that are calibrated at the same time.
            check: raises when the grippers may not move any more.

        Raises:
            RobotNotReady: the controller has no such gripper, its arm is in EGM, or it did not become calibrated.
        """
        grippers = (self, *others)
        self._routines.calibrate([gripper.side for gripper in grippers], self._timeout, check)
        for gripper in grippers:
            wait_until(
                self._clock,
                gripper.is_calibrated,
                _MOMENT,
                message("gripper_calibration_failed", gripper=gripper.side.word),
            )

    def begin(self, goal: GripperGoal, check: GripperCheck = forbid_nothing) -> None:
        """Start to move the fingers.

        Args:
            goal: what to do.
            check: raises when the gripper may not move any more; a hold that comes after it is not forgotten.

        Raises:
            RobotNotReady: the gripper is not calibrated, in an error, or did not take the command.
            GoalNotReached: it was stopped meanwhile.
        """

        def check_may_move() -> None:
            check()
            if self._is_stopped:
                raise GoalNotReached(message("gripper_stopped_before_it_moved", gripper=self.side.word))

        self._is_stopped = self._is_jogging = False
        check()
        self.goal = goal
        if self._value("hand_StatusCalibrated") == 0 and not self.is_calibrated():
            raise RobotNotReady(message("gripper_not_calibrated", gripper=self.side.word))
        if self._servo_state() is ServoState.ERROR:
            self._check_error(self._ask_servo_state())
        # Each time: whatever was written before, the controller may have been restarted since.
        self._write("hand_MaxSpeed", speed_count(goal.speed or self._usual_speed))
        try:
            if goal.direction is None:
                move = SgCommand.MOVE_TO
                self._routines.run(self.side, move, self._timeout, target=goal.position, check_may_move=check_may_move)
            else:
                command = SgCommand.GRIP_IN if goal.direction is GripDirection.INWARDS else SgCommand.GRIP_OUT
                self._routines.run(self.side, command, self._timeout, force=goal.force, check_may_move=check_may_move)
        finally:
            if self._is_stopped:  # while the command was under way
                self.stop()
        self._stands_since, self._stood = self._clock.now(), 0.0

    def wait(
        self,
        goal: GripperGoal,
        on_feedback: Callable[[float], None] = lambda position: None,
        is_cancelled: Callable[[], bool] = lambda: False,
    ) -> GripOutcome | None:
        """Wait until ``goal`` has ended; None when it was cancelled, and the fingers stopped.

        Args:
            goal: as given to :meth:`begin`.
            on_feedback: gets where the fingers are [m], now and then.
            is_cancelled: polled.

        Raises:
            RobotNotReady: the gripper reports an error, or still moves when its time is up.
            GoalNotReached: it was stopped.
        """
        outcome: GripOutcome | None = None

        def has_ended() -> bool:
            nonlocal outcome
            if is_cancelled():
                self.stop()
                return True
            if self._is_stopped:
                raise GoalNotReached(message("gripper_stopped", gripper=self.side.word))
            outcome = self.outcome(goal)
            if outcome is None:
                on_feedback(self.last_position)
            return outcome is not None

        refusal = message("gripper_still_moves", gripper=self.side.word, timeout=self._timeout)

        def period() -> float:
            reported = self._signals and self._signals.value(self.side, "hand_SysState")
            return _REQUEST_POLL if reported is None else POLL_PERIOD

        wait_until(self._clock, has_ended, self._timeout, refusal, period=period)
        return outcome

    def outcome(self, goal: GripperGoal) -> GripOutcome | None:
        """How ``goal`` has ended, or None while it goes on.

        What was reported may be older than the goal, so that an end counts only when it is found by asking.

        Raises:
            RobotNotReady: the gripper reports an error.
        """
        state = self._servo_state()
        if state in _AT_REST or state is ServoState.ERROR:
            state = self._ask_servo_state()
        if state in _AT_REST:
            position = self._ask_position()
            is_held = goal.is_held(state, position)
            is_there = abs(position - goal.position) <= FINGER_ALLOWANCE and not is_held
            return outcome_of(position, goal.force if is_held else 0.0, stalled=not is_there, reached_goal=is_there)
        if state is not ServoState.ERROR:
            before, now = self._polled, self._clock.now()
            self._polled = self.position()
            if self._polled != before:
                self._stands_since = now
            self._stood = now - self._stands_since
        if goal.direction is None and self._is_stalled(goal, state):
            # Stop pushing against what is in the way.
            if state is ServoState.ERROR:
                self.clear_error()
            else:
                self.stop()
            return GripOutcome.STALLED
        self._check_error(state)
        return None

    def _is_stalled(self, goal: GripperGoal, state: ServoState) -> bool:
        """A gripper gives up by itself, too; an error of fingers that moved has another cause."""
        if state is ServoState.ERROR:
            return self._stood >= _JAMMED and abs(self.last_position - goal.position) > FINGER_ALLOWANCE
        if self._stood < _STALL_TIME:
            return False
        before = self.last_position  # what was reported may have been held up on its way: ask
        return self._ask_position() == before and self._ask("hand_ActualSpeed") == 0

    def jog(self, *, opens: bool, check: GripperCheck = forbid_nothing) -> None:
        """Open or close slowly until :meth:`stop`, calibrated or not.

        Args:
            opens: which way.
            check: as for :meth:`begin`.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        self.stop()
        self._is_stopped, self._is_jogging = False, True
        self.goal = None
        check()
        self._write("hand_CmdGripper", ServoCommand.JOG_OPEN if opens else ServoCommand.JOG_CLOSE)
        if self._is_stopped:  # while the command was under way
            self.stop()

    def stop(self) -> None:
        """Stop the fingers: the motor lets go, and with it what the gripper holds.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        self._is_stopped, self._is_jogging = True, False
        self._write("hand_CmdGripper", ServoCommand.GO_TO_READY)
        wait_until(
            self._clock,
            lambda: self._ask_servo_state() is ServoState.READY,
            _MOMENT,
            message("gripper_does_not_stop", gripper=self.side.word),
        )

    def hold(self) -> None:
        """Stop fingers that move, and a command under way; a gripper that holds something goes on holding it.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        self._is_stopped = True
        if self._ask_servo_state() not in _STANDING:
            self.stop()

    def end_jog(self) -> None:
        """Stop a jog or a calibration, which would go on although the robot was stopped: it needs no motors.

        Raises:
            RobotNotReady: the gripper does not obey.
        """
        if self._is_jogging or self._ask_servo_state() in _JOGGING:
            self.hold()

    def clear_error(self) -> None:
        """Acknowledge the gripper's error; nothing where there is none.

        Raises:
            RobotNotReady: it still reports one.
        """
        for level in (1, 0):
            self._write("hand_CmdClearErr", level)
        wait_until(
            self._clock,
            lambda: self._ask_servo_state() is not ServoState.ERROR,
            _MOMENT,
            message("gripper_error_stays", gripper=self.side.word),
        )

    def _check_error(self, state: ServoState) -> None:
        if state is ServoState.ERROR:
            number = self._ask("hand_SysError")
            raise RobotNotReady(message("gripper_reports_error", gripper=self.side.word, error=number))

    # Vacuum modules, by their numbers 1 and 2

    def check_vacuum(self, channel: int) -> None:
        """Refuse a vacuum module that the gripper does not have, as all methods below do; raises CommandRefused."""
        if channel not in VACUUM_CHANNELS:
            raise CommandRefused(message("vacuum_channel_unknown", channel=channel))
        channels = self.modules.vacuum_channels
        if channel not in channels:
            raise CommandRefused(
                message(
                    "gripper_has_other_vacuum" if channels else "gripper_has_no_vacuum",
                    gripper=self.side.word,
                    has=tuple(channels),
                    modules=self.modules.value,
                    channel=channel,
                )
            )

    def vacuum(self, channel: int) -> VacuumState:
        """A vacuum module as it is now."""
        self.check_vacuum(channel)
        return read_vacuum(self._value, channel)

    def switch_vacuum(self, channel: int, *, is_on: bool) -> None:
        """Switch the vacuum of a module; its blow-off ends.

        Raises:
            RobotNotReady: the gripper is not calibrated, or did not obey.
        """
        self._switch("VACUUM", "Vacuum", channel, is_on=is_on)

    def switch_blow_off(self, channel: int, *, is_on: bool) -> None:
        """Switch the blow-off of a module; its vacuum ends. Raises as :meth:`switch_vacuum`."""
        self._switch("BLOW", "Blowoff", channel, is_on=is_on)

    def wait_until_picked(self, channel: int, threshold: float, timeout: float) -> bool:
        """Wait until the pressure shows that something closes the cup; whether it does.

        Args:
            channel: which module.
            threshold: the pressure at which it does [Pa].
            timeout: longest wait [s].
        """
        return comes_true(self._clock, lambda: self.vacuum(channel).has_picked(threshold), timeout)

    def drop(self, channel: int) -> None:
        """Blow off what is held, until the cup is vented, but no longer than a second.

        Raises:
            RobotNotReady: the gripper is not calibrated, or did not obey.
        """
        self.switch_blow_off(channel, is_on=True)
        comes_true(self._clock, lambda: self.vacuum(channel).pressure >= _VENTED, _MOMENT)
        self.switch_blow_off(channel, is_on=False)

    def _switch(self, command: str, signal: str, channel: int, *, is_on: bool) -> None:
        self.check_vacuum(channel)
        if not self.is_calibrated():  # the robot's routine would do nothing
            raise RobotNotReady(message("gripper_not_calibrated", gripper=self.side.word))
        is_vacuum = command == "VACUUM"
        switch = SgCommand[f"{command}_{'ON' if is_on else 'OFF'}_{channel}"]
        self._routines.run(self.side, switch, self._timeout)
        wait_until(
            self._clock,
            lambda: (self._ask(f"hand_Status{signal}{channel}") != 0) is is_on,
            _MOMENT,
            message(
                "vacuum_not_switched" if is_vacuum else "blow_off_not_switched",
                gripper=self.side.word,
                channel=channel,
                level="on" if is_on else "off",
            ),
        )

    # Signals, by their names without the arm's suffix

    def _value(self, name: str) -> float:
        """A signal as it was reported, or else asked for."""
        reported = None if self._signals is None else self._signals.value(self.side, name)
        return self._ask(name) if reported is None else reported

    def _ask(self, name: str) -> float:
        """A signal as it is now; raises RobotNotReady when the controller has no such signal."""
        full = full_signal_name(self.side, name)
        try:
            return self._client.signal(full).value
        except ControllerRefused as error:
            if error.status != _UNKNOWN:
                raise
            raise RobotNotReady(message("no_smart_gripper", gripper=self.side.word, signal=full)) from error

    def _servo_state(self) -> ServoState:
        return servo_state(self._value("hand_SysState"))

    def _ask_servo_state(self) -> ServoState:
        return servo_state(self._ask("hand_SysState"))

    def _ask_position(self) -> float:
        self.last_position = position_of(self._ask("hand_ActualPosition"))
        return self.last_position

    def _write(self, name: str, value: float) -> None:
        self._client.set_signal(full_signal_name(self.side, name), value)


class GripperRoutines:
    """The one signal the grippers share: its edge runs the command that each arm's task holds.

    Both tasks see every edge, so the next command waits until the task has taken this one: it would otherwise be
    run twice, or be erased while the task reads it.

    Args:
        client: a connected client.
        clock: for waiting.
    """

    def __init__(self, client: RwsClient, clock: Clock) -> None:
        self._client = client
        self._clock = clock
        self._lock = Lock()
        self._are_empty = False  # the tasks' command variables, as far as we know

    def run(
        self,
        side: Side,
        command: SgCommand,
        timeout: float,
        *,
        target: float | None = None,
        force: float | None = None,
        check_may_move: GripperCheck = forbid_nothing,
    ) -> None:
        """Have one arm's task run ``command``; returns when the task has taken it.

        Args:
            side: which arm.
            command: what to do.
            timeout: longest wait for the task [s].
            target: finger position [m] for ``MOVE_TO``.
            force: holding force [N] for ``GRIP_IN`` and ``GRIP_OUT``.
            check_may_move: raises when the gripper may not move any more: the other one's calibration, which takes
                seconds, goes first.

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
            check_may_move()
            self._write(side, "command_input", float(command))
            self._client.pulse_signal(RUN_SG_SIGNAL)
            self._wait_until_taken(side, timeout)
            self._are_empty = True

    def calibrate(self, sides: Sequence[Side], timeout: float, check_may_move: GripperCheck = forbid_nothing) -> None:
        """Have the tasks of these arms calibrate their grippers at the same time: one edge reaches both.

        Args:
            sides: which arms.
            timeout: longest wait for the tasks, which take the command when they have carried it out [s].
            check_may_move: raises when the grippers may not move any more, or the wait must end.

        Raises:
            RobotNotReady: a task did not take the command, or its arm is in EGM or runs a routine.
        """
        with self._lock:
            for side in sides:
                # The task calibrates in a trap, which would hold back every stop of an arm that moves.
                machine = read_machine_state(self._client, side)
                state = RobotState(True, machines={side: machine})
                check_request(ConditionalRequest.CALIBRATE, state, (side,))
            for each in Side:
                command = SgCommand.CALIBRATE if each in sides else SgCommand.NONE
                self._write(each, "command_input", float(command))
            self._are_empty = False
            check_may_move()
            self._client.pulse_signal(RUN_SG_SIGNAL)
            for side in sides:
                self._wait_until_taken(side, timeout, check_may_move)
            self._are_empty = True

    def _wait_until_taken(self, side: Side, timeout: float, check_may_move: GripperCheck = forbid_nothing) -> None:
        def is_taken() -> bool:
            return self._client.value(side.task, SG_MODULE, "command_input") == SgCommand.NONE

        refusal = message("gripper_command_not_taken", arm=side.word, timeout=timeout)
        wait_until(self._clock, is_taken, timeout, refusal, check=check_may_move, period=_ROUTINE_POLL)

    def _write(self, side: Side, symbol: str, value: float) -> None:
        self._client.set_value(side.task, SG_MODULE, symbol, value)

    def _write_force(self, side: Side, force: float) -> None:
        current = self._client.value(side.task, SG_MODULE, "settings")
        if not isinstance(current, tuple) or len(current) != 3:
            symbol = f"{side.task}/{SG_MODULE}/settings"
            raise RobotNotReady(message("rapid_record_of_unknown_layout", symbol=symbol, value=str(current)))
        max_speed, set_force, limit = current
        if set_force != force:
            self._client.set_value(side.task, SG_MODULE, "settings", (max_speed, force, limit))
