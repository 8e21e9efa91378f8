"""The Smart Gripper of one arm: fingers, vacuum cups, commands, states and I/O; advances by dt.

Positions are per finger from the closed position: 0 closed, 25 mm open (reference/yumi.md §2, statemachine.md §5).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import exp, isfinite

from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.gripper_values import (
    ATMOSPHERIC_PRESSURE,
    FINGER_TRAVEL,
    LOWEST_FINGER_SPEED,
    MAX_GRIP_FORCE,
    TOP_FINGER_SPEED,
    GripperModules,
    ServoCommand,
    ServoState,
)

_FORCE_RATE = 100.0
"""Rate at which the motor builds up force against an obstacle [N/s]."""

_FINGER_LENGTH = 0.020
"""Distance after which an object that slides between the fingers is lost [m]."""

_GRAVITY = 9.81
"""[m/s²]"""


@dataclass(frozen=True, slots=True)
class Workpiece:
    """Something the fingers may hold: between them or, when it is hollow, from inside.

    It lies in place all the time; the fingers meet it when they come from the right side.

    Attributes:
        width: distance of the two faces that the fingers touch [m], above 0, at most 0.05.
        is_hollow: whether the fingers press outward from inside.
        mass: what hangs between the fingers [kg].
        friction: coefficient between fingers and faces.
    """

    width: float
    is_hollow: bool = False
    mass: float = 0.050
    friction: float = 0.5

    def __post_init__(self) -> None:
        if not 0.0 < self.width <= 2.0 * FINGER_TRAVEL:
            raise ValueError(
                f"a workpiece of {self.width} m: widths above 0 and up to {2.0 * FINGER_TRAVEL} m are allowed"
            )
        if self.mass < 0.0 or self.friction <= 0.0:
            raise ValueError(f"a workpiece of {self.mass} kg and friction {self.friction}: both are positive")

    def slide(self, force: float) -> float:
        """Acceleration with which it slides out of fingers that press with ``force`` [N]; 0 when it is held [m/s²]."""
        if self.mass == 0.0:
            return 0.0
        return max(0.0, _GRAVITY - 2.0 * self.friction * force / self.mass)


class _Fingers:
    """Position, speed and force of the fingers; the motor keeps both at the same distance from the middle.

    Attributes:
        opening: of each finger from the closed position [m].
        speed: of each finger, positive when opening [m/s].
        force: what they press with [N].
        workpiece: what they may meet; None is nothing.
    """

    def __init__(self, workpiece: Workpiece | None) -> None:
        self.opening = 0.0
        self.speed = 0.0
        self.force = 0.0
        self.workpiece = workpiece
        self._slid = self._sliding = 0.0  # [m], [m/s]

    def rest(self) -> None:
        """The motor is switched off."""
        self.speed = self.force = self._slid = self._sliding = 0.0

    def drive(self, target: float, speed: float, force: float, dt: float) -> float:
        """Move towards ``target`` [m] with ``speed`` [m/s]; against an obstacle build up at most ``force`` [N].

        Returns:
            What was left of ``dt`` [s] when the fingers stood, at the target or at an obstacle.
        """
        stop = target
        if self.workpiece is not None:  # its face may be in the way
            face = self.workpiece.width / 2.0
            is_hollow = self.workpiece.is_hollow
            if (is_hollow and self.opening <= face < target) or (not is_hollow and target < face <= self.opening):
                stop = face
        needed = abs(stop - self.opening) / speed
        if needed > dt:
            self.speed = speed if stop > self.opening else -speed
            self.opening += self.speed * dt
            self.force = 0.0
            return 0.0
        self.opening, self.speed = stop, 0.0
        left = dt - needed
        self.force = 0.0 if stop == target else min(force, self.force + _FORCE_RATE * left)
        if self.force >= force > 0.0:  # at full force, an object that is too heavy slides out and is lost
            acceleration = 0.0 if self.workpiece is None else self.workpiece.slide(self.force)
            if acceleration == 0.0:
                self._slid = self._sliding = 0.0
            self._slid += self._sliding * left + acceleration * left**2 / 2.0
            self._sliding += acceleration * left
            if self._slid >= _FINGER_LENGTH:
                self.workpiece = None
        return left


_JOG_SPEED = 0.010
_STALL_TIME = 0.5
"""How long a free move may push against an obstacle before it is an error [s]."""


class _Action:
    """One thing the motor does.

    Attributes:
        state: what ``hand_SysState`` shows.
        is_over: whether the next action may begin.
    """

    def __init__(self, state: ServoState) -> None:
        self.state = state
        self.is_over = False

    def end(self, state: ServoState) -> None:
        """The action is over, in a state."""
        self.state, self.is_over = state, True

    def advance(self, fingers: _Fingers, dt: float) -> float:
        """Let ``dt`` [s] pass; what is left of it when the action was over sooner."""
        raise NotImplementedError


class _FreeMove(_Action):
    """Go to a position; an obstacle is an error."""

    def __init__(self, state: ServoState, target: float, speed: float) -> None:
        super().__init__(state)
        self._target, self._speed = target, speed
        self._stalled = 0.0

    def advance(self, fingers: _Fingers, dt: float) -> float:
        left = fingers.drive(self._target, self._speed, MAX_GRIP_FORCE, dt)
        if fingers.opening == self._target:
            self.end(ServoState.ACTION_COMPLETED)
            return left
        self._stalled += left
        if self._stalled >= _STALL_TIME:
            self.end(ServoState.ERROR)
        return 0.0


class _Grip(_Action):
    """Close in on something and hold it; to reach the end of the travel means that there was nothing."""

    def __init__(self, state: ServoState, target: float, speed: float, force: float) -> None:
        super().__init__(state)
        self._gripping = state
        self._target, self._speed, self._force = target, speed, force

    def advance(self, fingers: _Fingers, dt: float) -> float:
        left = fingers.drive(self._target, self._speed, self._force, dt)
        if fingers.opening == self._target:
            self.end(ServoState.ACTION_COMPLETED)
            return left
        stands_with_force = fingers.speed == 0.0 and fingers.force >= self._force
        self.state = ServoState.KEEP_OBJECT if stands_with_force else self._gripping
        return 0.0


class _Jog(_Action):
    """Open or close, calibrated or not, until stopped or, if asked, until the fingers stand."""

    def __init__(self, *, opens: bool, ends_at_standstill: bool = False) -> None:
        super().__init__(ServoState.JOG_OPEN if opens else ServoState.JOG_CLOSE)
        self._target = FINGER_TRAVEL if opens else 0.0
        self._ends_at_standstill = ends_at_standstill

    def advance(self, fingers: _Fingers, dt: float) -> float:
        left = fingers.drive(self._target, _JOG_SPEED, MAX_GRIP_FORCE, dt)
        if fingers.speed != 0.0 or not self._ends_at_standstill:
            return 0.0
        self.end(self.state)
        return left


class _GripperPause(_Action):
    """Stand still in a state for a time [s], then do ``at_end``."""

    def __init__(
        self,
        state: ServoState,
        duration: float,
        *,
        state_after: ServoState,
        at_end: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__(state)
        self._left, self._state_after, self._at_end = duration, state_after, at_end

    def advance(self, fingers: _Fingers, dt: float) -> float:
        fingers.rest()
        self._left -= dt
        if self._left > 0.0:
            return 0.0
        self.end(self._state_after)
        self._at_end()
        return -self._left


DEEPEST_VACUUM = 25_000.0
"""Pressure under a cup that is tight [Pa]."""

OPEN_CUP_PRESSURE = 90_000.0
"""Pressure in a cup that sucks air [Pa]."""

_EVACUATION = 0.12
"""Time constant of evacuating a cup [s]."""

_VENTING = 0.25
"""Time constant of a cup that is left to itself, through the ejector [s]."""

_BLOW_OFF = 0.02
"""Time constant of a cup that is blown off [s]."""


@dataclass(frozen=True, slots=True)
class CupObject:
    """Something under a cup.

    Attributes:
        leak: how much air passes: 0 is tight, 1 as without an object.
    """

    leak: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.leak <= 1.0:
            raise ValueError(f"a leak of {self.leak}: 0 (tight) to 1 (open) are allowed")


class VacuumCup:
    """One cup; its ejector either sucks or blows.

    Attributes:
        sucks: ``hand_StatusVacuum``.
        blows: ``hand_StatusBlowoff``.
        pressure: absolute, in the cup [Pa].
        under: what lies under it; None is nothing.
    """

    def __init__(self, under: CupObject | None = None) -> None:
        self.sucks = False
        self.blows = False
        self.pressure = ATMOSPHERIC_PRESSURE
        self.under = under

    def suck(self, *, is_on: bool) -> None:
        """Switch the vacuum; a cup that sucks does not blow."""
        self.sucks = is_on
        self.blows = self.blows and not is_on

    def blow(self, *, is_on: bool) -> None:
        """Switch the blow-off; a cup that blows does not suck."""
        self.blows = is_on
        self.sucks = self.sucks and not is_on

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass."""
        if self.sucks:
            leak = 1.0 if self.under is None else self.under.leak
            final, time_constant = DEEPEST_VACUUM + leak * (OPEN_CUP_PRESSURE - DEEPEST_VACUUM), _EVACUATION
        else:
            final, time_constant = ATMOSPHERIC_PRESSURE, _BLOW_OFF if self.blows else _VENTING
        self.pressure = final + (self.pressure - final) * exp(-dt / time_constant)


SETTLING_TIME = 0.5
_CALIBRATION_TIME = 0.5
VACUUM_CHANNELS = (1, 2)
"""Vacuum modules."""

_STALL_ERROR = 1
"""``hand_SysError`` when a free move meets an obstacle; the gripper's own numbers are not published."""


class VirtualGripper:
    """One gripper, closed and not calibrated at first, as after power-up.

    Attributes:
        modules: servo, vacuum and camera.
        cups: its vacuum modules by number.
        is_calibrated: ``hand_StatusCalibrated``.
        max_speed: speed of moves and grips [m/s].
        hold_force: force of grips [N].
        physical_limit: largest position that may be asked for [m].
    """

    def __init__(
        self,
        workpiece: Workpiece | None = None,
        modules: GripperModules = GripperModules.SERVO,
        under_cups: CupObject | None = None,
        *,
        is_calibrated: bool = False,
    ) -> None:
        self.modules = modules
        self.cups = {channel: VacuumCup(under_cups) for channel in modules.vacuum_channels}
        self.is_calibrated = is_calibrated
        self.max_speed = TOP_FINGER_SPEED
        self.hold_force = MAX_GRIP_FORCE
        self.physical_limit = FINGER_TRAVEL
        self._fingers = _Fingers(workpiece)
        self._zero = 0.0
        self._min_position, self._max_position = 0.0, FINGER_TRAVEL
        self._state = ServoState.READY
        self._shown: tuple[object, ...] = ()  # what the signals were made from last
        self._signals: Mapping[str, int] = {}
        self._command_shown = ServoCommand.NONE
        self._error = 0
        self._actions: deque[_Action] = deque()

    @property
    def state(self) -> ServoState:
        """``hand_SysState``."""
        return self._state

    @property
    def position(self) -> float:
        """Position of each finger as the gripper knows it [m]."""
        return self._fingers.opening - self._zero

    @property
    def speed(self) -> float:
        """Speed of each finger, positive when opening [m/s]."""
        return self._fingers.speed

    @property
    def force(self) -> float:
        """What the fingers press with [N]; 0 when they are closed on nothing."""
        return self._fingers.force

    @property
    def is_moving(self) -> bool:
        """Whether a command is being carried out; a grip that holds its object is done."""
        return bool(self._actions) and not self.is_holding

    @property
    def is_holding(self) -> bool:
        """Whether the fingers hold an object with the hold force."""
        return self._state is ServoState.KEEP_OBJECT

    @property
    def workpiece(self) -> Workpiece | None:
        """What the fingers may hold; it may be exchanged or taken away at any time."""
        return self._fingers.workpiece

    @workpiece.setter
    def workpiece(self, workpiece: Workpiece | None) -> None:
        self._fingers.workpiece = workpiece

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass."""
        for cup in self.cups.values():
            cup.advance(dt)
        while self._actions and dt > 0.0:
            action = self._actions[0]
            dt = action.advance(self._fingers, dt)
            if action.is_over:
                self._actions.popleft()
                self._fingers.rest()
            self._state = self._actions[0].state if action.is_over and self._actions else action.state
        if self._state is not ServoState.ERROR:
            self._error = 0
        elif self._error == 0:
            self._error = _STALL_ERROR

    # What happens to it

    def fail(self, error: int) -> None:
        """The gripper reports the internal ``error``, 1 to 255, until it is cleared."""
        self._execute(ServoCommand.GO_TO_ERROR)
        self._error = error

    def cut_power(self) -> None:
        """The 24 V supply is interrupted: what it held falls, the calibration is lost."""
        self.stop()
        self.is_calibrated = False
        self._zero = 0.0
        for cup in self.cups.values():
            cup.suck(is_on=False)
            cup.blow(is_on=False)

    # What RAPID's g_ instructions do

    def initialize(
        self,
        max_speed: float = TOP_FINGER_SPEED,
        hold_force: float = MAX_GRIP_FORCE,
        physical_limit: float = FINGER_TRAVEL,
    ) -> None:
        """g_Init: speed [m/s] and force [N] are brought into range, the limit of positions [m] is checked.

        Raises:
            CommandRefused: the limit is outside the fingers' travel.
        """
        _check_position(physical_limit, FINGER_TRAVEL)
        self.set_max_speed(max_speed)
        self.set_hold_force(hold_force)
        self.physical_limit = physical_limit
        self.stop()

    def set_max_speed(self, max_speed: float) -> None:
        """g_SetMaxSpd [m/s], brought into the range of the drive."""
        self.max_speed = max(LOWEST_FINGER_SPEED, min(TOP_FINGER_SPEED, max_speed))

    def set_hold_force(self, hold_force: float) -> None:
        """g_SetForce [N], brought into the range of the drive."""
        self.hold_force = max(0.0, min(MAX_GRIP_FORCE, hold_force))

    def calibrate(self, *, jog: bool = True) -> None:
        """g_Calibrate: with ``jog`` the fingers close first; where they are then becomes 0. It takes seconds."""
        closing: tuple[_Action, ...] = (
            _Jog(opens=False, ends_at_standstill=True),
            _GripperPause(ServoState.READY, SETTLING_TIME, state_after=ServoState.READY),
        )
        self._begin(*(closing if jog else ()), self._zeroing(ServoState.READY))
        self._command_shown = ServoCommand.GO_TO_READY

    # The next three raise RobotNotReady without calibration, CommandRefused for a position outside 0 to physical_limit.

    def move_to(self, position: float) -> None:
        """g_MoveTo: free move of each finger to ``position`` [m]."""
        self._check_target(position)
        if self.position >= position:
            self._min_position = position
            self._execute(ServoCommand.FREE_MOVE_TO_MIN_POS)
        else:
            self._max_position = position
            self._execute(ServoCommand.FREE_MOVE_TO_MAX_POS)

    def grip_in(self, hold_force: float | None = None) -> None:
        """g_GripIn: close until something is held with ``hold_force`` [N], or nothing was found."""
        self._check_target(0.0)
        self._min_position = 0.0
        self._grip(ServoCommand.AGILE_GRIP_INWARD, hold_force)

    def grip_out(self, hold_force: float | None = None) -> None:
        """g_GripOut: open until something is held with ``hold_force`` [N], or nothing was found."""
        self._check_target(self.physical_limit)
        self._max_position = self.physical_limit
        self._grip(ServoCommand.AGILE_GRIP_OUTWARD, hold_force)

    def _grip(self, command: ServoCommand, hold_force: float | None) -> None:
        if hold_force is not None:
            self.set_hold_force(hold_force)
        self._execute(command)

    def stop(self) -> None:
        """g_Stop: the motor is switched off; the gripper is ready for the next command."""
        self._execute(ServoCommand.GO_TO_READY)

    def jog(self, *, opens: bool) -> None:
        """g_JogOut, g_JogIn: open or close at low speed until stopped, calibrated or not."""
        self._execute(ServoCommand.JOG_OPEN if opens else ServoCommand.JOG_CLOSE)

    def set_vacuum(self, channel: int, *, is_on: bool) -> None:
        """g_VacuumOn, g_VacuumOff of channel 1 or 2; where there is no such module nothing happens."""
        if channel in self.cups:
            self.cups[channel].suck(is_on=is_on)

    def set_blow(self, channel: int, *, is_on: bool) -> None:
        """g_BlowOn, g_BlowOff of channel 1 or 2; where there is no such module nothing happens."""
        if channel in self.cups:
            self.cups[channel].blow(is_on=is_on)

    # What the fieldbus carries; positions in 0.1 mm, speeds in 0.1 mm/s, forces in 0.1 N

    def signals(self) -> Mapping[str, int]:
        """Its I/O by name, without the suffix of the arm.

        Commands, speed and force are outputs of the controller: they follow RAPID's instructions, since the gripper's
        own driver writes them.
        """
        servo = (self._state, self.is_calibrated, self.position, self.speed, self._error, self._command_shown)
        cups = [(cup.sucks, cup.blows, cup.pressure) for cup in self.cups.values()]
        shown = (*servo, self.max_speed, self.hold_force, *cups)
        if shown == self._shown:  # in most cycles nothing has changed
            return self._signals
        values = {
            "hand_SysState": int(self._state),
            "hand_StatusCalibrated": int(self.is_calibrated),
            "hand_ActualPosition": max(0, round(self.position * 1e4)),
            "hand_ActualSpeed": round(abs(self.speed) * 1e4),
            "hand_SysError": self._error,
            "hand_StatusCamLinked": int(self.modules.has_camera),
            "hand_SoftwareVersion": 0,
            "hand_CmdGripper": int(self._command_shown),
            "hand_MaxSpeed": round(self.max_speed * 1e4),
            "hand_HoldForce": round(self.hold_force * 10.0),
        }
        for channel, cup in self.cups.items():
            values[f"hand_StatusVacuum{channel}"] = int(cup.sucks)
            values[f"hand_StatusBlowoff{channel}"] = int(cup.blows)
            values[f"hand_CmdVacuum{channel}"] = int(cup.sucks)
            values[f"hand_CmdBlowoff{channel}"] = int(cup.blows)
            values[f"hand_ActualPressure{channel}"] = round(cup.pressure * 1e-3)
        self._shown, self._signals = shown, values
        return values

    def write(self, signal: str, value: int) -> None:
        """An output of the controller changes, named without the suffix of the arm.

        A command counts in state READY only, but for the one that leads there; unknown ones do nothing.
        """
        is_on = bool(value)
        may_execute = value == ServoCommand.GO_TO_READY or self._state is ServoState.READY
        if signal == "hand_CmdGripper":
            if may_execute and value in set(ServoCommand):
                self._execute(ServoCommand(value))
        elif signal == "hand_CmdClearErr":
            if is_on and self._state is ServoState.ERROR:
                self.stop()
        elif signal == "hand_MinPosition":
            self._min_position = value * 1e-4
        elif signal == "hand_MaxPosition":
            self._max_position = value * 1e-4
        elif signal == "hand_MaxSpeed":
            self.set_max_speed(value * 1e-4)
        elif signal == "hand_HoldForce":
            self.set_hold_force(value * 0.1)
        elif signal[:-1] in ("hand_CmdVacuum", "hand_CmdBlowoff"):
            switch = self.set_vacuum if "Vacuum" in signal else self.set_blow
            switch(int(signal[-1]), is_on=is_on)

    def _check_target(self, position: float) -> None:
        if not self.is_calibrated:
            raise RobotNotReady("The gripper is not calibrated: calibrate it first.")
        _check_position(position, self.physical_limit)

    def _execute(self, command: ServoCommand) -> None:
        self._command_shown = command
        narrow, wide = (
            max(0.0, min(FINGER_TRAVEL, position + self._zero)) for position in (self._min_position, self._max_position)
        )
        speed, force = self.max_speed, self.hold_force
        actions: dict[ServoCommand, _Action] = {
            ServoCommand.JOG_OPEN: _Jog(opens=True),
            ServoCommand.JOG_CLOSE: _Jog(opens=False),
            ServoCommand.FREE_MOVE_TO_MAX_POS: _FreeMove(ServoState.FREE_MOVE_TO_MAX_POS, wide, speed),
            ServoCommand.FREE_MOVE_TO_MIN_POS: _FreeMove(ServoState.FREE_MOVE_TO_MIN_POS, narrow, speed),
            ServoCommand.AGILE_GRIP_INWARD: _Grip(ServoState.AGILE_GRIP_INWARD, narrow, speed, force),
            ServoCommand.AGILE_GRIP_OUTWARD: _Grip(ServoState.AGILE_GRIP_OUTWARD, wide, speed, force),
            ServoCommand.GO_TO_CALIBRATION: self._zeroing(ServoState.ACTION_COMPLETED),
        }
        if command in actions:
            self._begin(actions[command])
        elif command is not ServoCommand.NONE:
            self._begin()
            self._state = ServoState.ERROR if command is ServoCommand.GO_TO_ERROR else ServoState.READY

    def _begin(self, *actions: _Action) -> None:
        self._actions = deque(actions)
        self._fingers.rest()
        if actions:
            self._state = actions[0].state

    def _zeroing(self, state_after: ServoState) -> _GripperPause:
        """Take the position for 0 after a while: calibrated, correctly if the fingers are closed."""

        def take_zero() -> None:
            self._zero = self._fingers.opening
            self.is_calibrated = True

        return _GripperPause(ServoState.CALIBRATION, _CALIBRATION_TIME, state_after=state_after, at_end=take_zero)


def _check_position(position: float, limit: float) -> None:
    if not (isfinite(position) and 0.0 <= position <= limit):
        raise CommandRefused(f"Gripper position {position * 1e3:g} mm: allowed are 0 to {limit * 1e3:g} mm.")
