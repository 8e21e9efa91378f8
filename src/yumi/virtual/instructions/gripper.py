"""The Smart Gripper's RAPID instructions of one arm, ``g_...`` (reference/statemachine.md §5)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from yumi.errors import CommandRefused, RobotNotReady
from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.library import Call, Library, Wait
from yumi.robot.gripper import MAX_FORCE, TOP_SPEED, TRAVEL, ServoState
from yumi.virtual.controller.events import EventLog, EventType
from yumi.virtual.mechanics.gripper import CHANNELS, SETTLING_TIME, VirtualGripper

DEADLINE = 5.0
"""How long an instruction waits for the fingers [s] (reference/statemachine.md §5.3)."""

_ALLOWANCE_MM = 1.0
_GRIP = r"\num holdForce, \num targetPos, \num posAllowance, \switch NoWait"

# What the gripper's driver logs in domain 11, and the RAPID error it raises.
_NOT_CALIBRATED = (112755, "ERR_HAND_NOTCALIBRATED")
_OUT_OF_RANGE = (112757, "ERR_HAND_AUGOUTOFRANGE")
_WRONG_STATE = (112751, "ERR_HAND_WRONGSTATE")
_FAILED_MOVE = (112753, "ERR_HAND_FAILEDMOVEPOS")
_FAILED_GRIP_IN = (112754, "ERR_HAND_FAILEDGRIPINWARD")
_FAILED_GRIP_OUT = (112760, "ERR_HAND_FAILEDGRIPOUTWARD")
_FAILED_GRIP_POSITION = (112759, "ERR_HAND_FAILEDGRIPPOS")
_FAILED_VACUUM = (112756, "ERR_HAND_FAILEDVACUUM")
_ERRORS = (
    _NOT_CALIBRATED,
    _OUT_OF_RANGE,
    _WRONG_STATE,
    _FAILED_MOVE,
    _FAILED_GRIP_IN,
    _FAILED_GRIP_OUT,
    _FAILED_GRIP_POSITION,
    _FAILED_VACUUM,
)
_Failure = tuple[int, str]


class GripperInstructions:
    """The gripper's instructions of one task.

    Args:
        gripper: the gripper they command.
        events: the controller's event log.
    """

    def __init__(self, gripper: VirtualGripper, events: EventLog) -> None:
        self._gripper = gripper
        self._events = events

    def init(self, call: Call) -> Wait:
        """g_Init."""
        speed, force = call.get("maxSpd", TOP_SPEED * 1e3) * 1e-3, call.get("holdForce", MAX_FORCE)
        limit = call.get("phyLimit", TRAVEL * 1e3) * 1e-3
        self._do(lambda: self._gripper.initialize(speed, force, limit))
        if call.present("Calibrate"):
            yield from self._calibrated(jog=True)

    def calibrate(self, call: Call) -> Wait:
        """g_Calibrate: done when the gripper knows its zero."""
        yield from self._calibrated(jog=call.present("Jog"))

    def move_to(self, call: Call) -> Wait:
        r"""g_MoveTo: done when the fingers are there, or at once with \NoWait."""
        position = call["TargetPos"] * 1e-3
        yield from self._readied(call)
        self._do(lambda: self._gripper.move_to(position))
        if not call.present("NoWait"):
            yield from self._standing(call, _FAILED_MOVE)

    def grip_in(self, call: Call) -> Wait:
        r"""g_GripIn: done when something is held, or at once with \NoWait."""
        yield from self._readied(call)
        self._do(lambda: self._gripper.grip_in(call.get("holdForce")))
        yield from self._held(call, _FAILED_GRIP_IN)

    def grip_out(self, call: Call) -> Wait:
        r"""g_GripOut: done when something is held, or at once with \NoWait."""
        yield from self._readied(call)
        self._do(lambda: self._gripper.grip_out(call.get("holdForce")))
        yield from self._held(call, _FAILED_GRIP_OUT)

    def jog(self, call: Call, *, opens: bool) -> Wait:
        """g_JogIn, g_JogOut: done when the fingers stand; the motor then lets go."""
        yield from self._readied(call)
        self._gripper.jog(opens=opens)
        begin = call.task.now
        while call.task.now - begin < SETTLING_TIME or self._gripper.speed != 0.0:
            if call.task.now - begin >= DEADLINE:
                self._fail(_WRONG_STATE, f"The fingers have been moving for {DEADLINE:g} s.")
            yield None
        self._gripper.stop()

    def vacuum_on(self, call: Call, channel: int) -> Wait:
        """g_VacuumOn: done at once, or with a threshold [kPa] when the pressure is below it."""
        self._gripper.set_vacuum(channel, is_on=True)
        deadline = call.task.now + DEADLINE
        while call.present("threshold") and self.pressure(call, channel) > call["threshold"]:
            if call.task.now >= deadline:
                self._fail(_FAILED_VACUUM, f"Vacuum {channel} does not get below {call['threshold']:g} kPa.")
            yield None

    def pressure(self, call: Call, channel: int) -> float:
        """g_GetPressure [kPa]; 0 where there is no such module."""
        return self._gripper.cups[channel].pressure * 1e-3 if channel in self._gripper.cups else 0.0

    def speed(self, call: Call) -> float:
        """g_GetSpd: of each finger [mm/s]."""
        return abs(self._gripper.speed) * 1e3

    def stop(self, call: Call) -> None:
        """g_Stop."""
        self._gripper.stop()

    def set_max_speed(self, call: Call) -> None:
        """g_SetMaxSpd [mm/s]."""
        self._gripper.set_max_speed(call["maxSpd"] * 1e-3)

    def set_force(self, call: Call) -> None:
        """g_SetForce [N]."""
        self._gripper.set_hold_force(call["holdForce"])

    def is_calibrated(self, call: Call) -> bool:
        """g_IsCalibrated."""
        return self._gripper.is_calibrated

    def position(self, call: Call) -> float:
        """g_GetPos: of each finger [mm]."""
        return self._gripper.position * 1e3

    def _readied(self, call: Call) -> Wait:
        """Bring the hand to READY and let the I/O show it before the next command, as the hand's own driver does.

        Who watches ``hand_SysState`` thereby sees where one command ends and the next begins.
        """
        self._gripper.stop()
        begin = call.task.now
        while call.task.now == begin:
            yield None

    def _calibrated(self, *, jog: bool) -> Wait:
        self._gripper.calibrate(jog=jog)
        while self._gripper.is_moving:
            yield None
        if not self._gripper.is_calibrated:
            self._fail(_WRONG_STATE, "The gripper could not be calibrated.")

    def _held(self, call: Call, failure: _Failure) -> Wait:
        if call.present("NoWait"):
            return
        yield from self._standing(call, failure)
        if not self._gripper.is_holding:
            self._fail(failure, "The fingers found nothing to hold.")
        allowance_mm = call.get("posAllowance", _ALLOWANCE_MM)
        if call.present("targetPos") and abs(self._gripper.position * 1e3 - call["targetPos"]) > allowance_mm:
            self._fail(_FAILED_GRIP_POSITION, f"The fingers hold something {self._gripper.position * 1e3:.1f} mm wide.")

    def _standing(self, call: Call, failure: _Failure) -> Wait:
        deadline = call.task.now + DEADLINE
        while self._gripper.is_moving:
            if call.task.now >= deadline:
                self._fail(failure, f"The fingers have been moving for {DEADLINE:g} s.")
            yield None
        if self._gripper.state is ServoState.ERROR:
            self._fail(failure, "The gripper reports an error.")

    def _do(self, action: Callable[[], None]) -> None:
        try:
            action()
        except RobotNotReady as error:
            self._fail(_NOT_CALIBRATED, str(error))
        except CommandRefused as error:
            self._fail(_OUT_OF_RANGE, str(error))

    def _fail(self, failure: _Failure, sentence: str) -> None:
        code, name = failure
        self._events.append(code, "Smart Gripper", sentence, EventType.ERROR)
        raise RapidRuntimeError(name, sentence)


def add_gripper(library: Library, gripper: VirtualGripper, events: EventLog) -> None:
    """Register the gripper's instructions of one task."""
    hand = GripperInstructions(gripper, events)
    for _, name in _ERRORS:
        library.error(name)
    library.instruction("g_Init", r"\num maxSpd, \num holdForce, \num phyLimit, \switch Calibrate")(hand.init)
    library.instruction("g_Calibrate", r"\switch Jog")(hand.calibrate)
    library.instruction("g_MoveTo", r"num TargetPos, \switch NoWait")(hand.move_to)
    library.instruction("g_GripIn", _GRIP)(hand.grip_in)
    library.instruction("g_GripOut", _GRIP)(hand.grip_out)
    library.instruction("g_JogIn")(partial(hand.jog, opens=False))
    library.instruction("g_JogOut")(partial(hand.jog, opens=True))
    library.instruction("g_Stop")(hand.stop)
    library.instruction("g_SetMaxSpd", "num maxSpd")(hand.set_max_speed)
    library.instruction("g_SetForce", "num holdForce")(hand.set_force)
    library.function("g_IsCalibrated", "", "bool")(hand.is_calibrated)
    library.function("g_GetPos", "", "num")(hand.position)
    library.function("g_GetSpd", "", "num")(hand.speed)
    for channel in CHANNELS:
        _add_channel(library, hand, gripper, channel)


def _add_channel(library: Library, hand: GripperInstructions, gripper: VirtualGripper, channel: int) -> None:
    def switch(set_channel: Callable[..., None], *, is_on: bool) -> Callable[[Call], None]:
        return lambda call: set_channel(channel, is_on=is_on)

    library.instruction(f"g_VacuumOn{channel}", r"\num threshold")(partial(hand.vacuum_on, channel=channel))
    library.instruction(f"g_VacuumOff{channel}")(switch(gripper.set_vacuum, is_on=False))
    library.instruction(f"g_BlowOn{channel}")(switch(gripper.set_blow, is_on=True))
    library.instruction(f"g_BlowOff{channel}")(switch(gripper.set_blow, is_on=False))
    library.function(f"g_GetPressure{channel}", "", "num")(partial(hand.pressure, channel=channel))
