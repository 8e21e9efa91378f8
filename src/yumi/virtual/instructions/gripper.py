"""The Smart Gripper's RAPID instructions of one arm, ``g_...`` and ``Hand_...`` (reference/statemachine.md §5)."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from functools import partial
from typing import Any

from yumi.errors import CommandRefused, RobotNotReady
from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.library import Call, Library, Wait
from yumi.robot.gripper import MAX_FORCE, TOP_SPEED, TRAVEL, ServoState
from yumi.rws.types import EventType
from yumi.virtual.controller.events import EventLog
from yumi.virtual.mechanics.gripper import CHANNELS, SETTLING_TIME, VirtualGripper

DEADLINE = 5.0
"""How long an instruction waits for the fingers [s] (reference/statemachine.md §5.3)."""

_ALLOWANCE_MM = 1.0
_GRIP = r"\num holdForce, \num targetPos, \num posAllowance, \switch NoWait"


class _Failure(Enum):
    """What the gripper's driver logs in domain 11, and the RAPID error it raises."""

    NOT_CALIBRATED = (112755, "ERR_HAND_NOTCALIBRATED")
    OUT_OF_RANGE = (112757, "ERR_HAND_AUGOUTOFRANGE")
    WRONG_STATE = (112751, "ERR_HAND_WRONGSTATE")
    FAILED_MOVE = (112753, "ERR_HAND_FAILEDMOVEPOS")
    FAILED_GRIP_IN = (112754, "ERR_HAND_FAILEDGRIPINWARD")
    FAILED_GRIP_OUT = (112760, "ERR_HAND_FAILEDGRIPOUTWARD")
    FAILED_GRIP_POSITION = (112759, "ERR_HAND_FAILEDGRIPPOS")
    FAILED_VACUUM = (112756, "ERR_HAND_FAILEDVACUUM")


class GripperInstructions:
    """The gripper's instructions of one task."""

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
            yield from self._standing(call, _Failure.FAILED_MOVE)

    def grip_in(self, call: Call) -> Wait:
        r"""g_GripIn: done when something is held, or at once with \NoWait."""
        yield from self._readied(call)
        self._do(lambda: self._gripper.grip_in(call.get("holdForce")))
        yield from self._held(call, _Failure.FAILED_GRIP_IN)

    def grip_out(self, call: Call) -> Wait:
        r"""g_GripOut: done when something is held, or at once with \NoWait."""
        yield from self._readied(call)
        self._do(lambda: self._gripper.grip_out(call.get("holdForce")))
        yield from self._held(call, _Failure.FAILED_GRIP_OUT)

    def jog(self, call: Call, *, opens: bool) -> Wait:
        """g_JogIn, g_JogOut: done when the fingers stand; the motor then lets go."""
        yield from self._readied(call)
        self._gripper.jog(opens=opens)
        begin = call.task.now
        while call.task.now - begin < SETTLING_TIME or self._gripper.speed != 0.0:
            if call.task.now - begin >= DEADLINE:
                self._fail(_Failure.WRONG_STATE, f"The fingers have been moving for {DEADLINE:g} s.")
            yield None
        self._gripper.stop()

    def vacuum_on(self, call: Call, channel: int) -> Wait:
        """g_VacuumOn: done at once, or with a threshold [kPa] when the pressure is below it."""
        self._gripper.set_vacuum(channel, is_on=True)
        deadline = call.task.now + DEADLINE
        while call.present("threshold") and self.pressure(call, channel) > call["threshold"]:
            if call.task.now >= deadline:
                self._fail(_Failure.FAILED_VACUUM, f"Vacuum {channel} does not get below {call['threshold']:g} kPa.")
            yield None

    def pressure(self, call: Call, channel: int) -> float:
        """g_GetPressure [kPa]; 0 where there is no such module."""
        return self._gripper.cups[channel].pressure * 1e-3 if channel in self._gripper.cups else 0.0

    def wait_for_fingers(self, call: Call) -> Wait:
        """Hand_WaitMovingCompleted: until the fingers stand."""
        yield from self._standing(call, _Failure.FAILED_MOVE)

    def _readied(self, call: Call) -> Wait:
        """Bring the gripper to READY for one cycle before the next command, as the gripper's own driver does.

        ``hand_SysState`` then shows where one command ends and the next begins.
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
            self._fail(_Failure.WRONG_STATE, "The gripper could not be calibrated.")

    def _held(self, call: Call, failure: _Failure) -> Wait:
        if call.present("NoWait"):
            return
        yield from self._standing(call, failure)
        if not self._gripper.is_holding:
            self._fail(failure, "The fingers found nothing to hold.")
        allowance_mm = call.get("posAllowance", call.get("posAlowance", _ALLOWANCE_MM))
        position_mm = self._gripper.position * 1e3
        if call.present("targetPos") and abs(position_mm - call["targetPos"]) > allowance_mm:
            self._fail(_Failure.FAILED_GRIP_POSITION, f"The fingers hold something {position_mm:.1f} mm wide.")

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
            self._fail(_Failure.NOT_CALIBRATED, str(error))
        except CommandRefused as error:
            self._fail(_Failure.OUT_OF_RANGE, str(error))

    def _fail(self, failure: _Failure, sentence: str) -> None:
        code, name = failure.value
        self._events.append(code, "Smart Gripper", sentence, EventType.ERROR)
        raise RapidRuntimeError(name, sentence)


def add_gripper(library: Library, gripper: VirtualGripper, events: EventLog) -> None:
    """Register the gripper's instructions of one task."""
    commands = GripperInstructions(gripper, events)
    for failure in _Failure:
        library.error(failure.value[1])
    library.instruction("g_Init", r"\num maxSpd, \num holdForce, \num phyLimit, \switch Calibrate")(commands.init)
    library.instruction("g_Calibrate", r"\switch Jog")(commands.calibrate)
    library.instruction("g_MoveTo", r"num TargetPos, \switch NoWait")(commands.move_to)
    library.instruction("g_GripIn", _GRIP)(commands.grip_in)
    library.instruction("g_GripOut", _GRIP)(commands.grip_out)
    library.instruction("g_JogIn")(partial(commands.jog, opens=False))
    library.instruction("g_JogOut")(partial(commands.jog, opens=True))
    library.instruction("g_Stop")(lambda call: gripper.stop())
    library.instruction("g_SetMaxSpd", "num maxSpd")(lambda call: gripper.set_max_speed(call["maxSpd"] * 1e-3))
    library.instruction("g_SetForce", "num holdForce")(lambda call: gripper.set_hold_force(call["holdForce"]))
    library.function("g_IsCalibrated", "", "bool")(lambda call: gripper.is_calibrated)
    library.function("g_GetPos", "", "num")(lambda call: gripper.position * 1e3)  # of each finger [mm]
    library.function("g_GetSpd", "", "num")(lambda call: abs(gripper.speed) * 1e3)  # of each finger [mm/s]
    # The names of the add-in's first generation (reference/statemachine.md), with its spelling.
    grip = rf"{_GRIP.replace('posAllowance', 'posAlowance')}, \switch NotLimitDriveForce"
    older: tuple[tuple[str, str, Callable[[Call], Any]], ...] = (
        ("Hand_Initialize", r"\num maxSpd, \num holdForce, \num phyLimit, \switch Calibrate", commands.init),
        ("Hand_DoCalibrate", r"\switch Jog", commands.calibrate),
        ("Hand_MoveTo", r"num TargetPos, \switch NoWait", commands.move_to),
        ("Hand_GripInward", grip, commands.grip_in),
        ("Hand_GripOutward", grip, commands.grip_out),
        ("Hand_JogInward", "", partial(commands.jog, opens=False)),
        ("Hand_JogOutward", "", partial(commands.jog, opens=True)),
        ("Hand_Stop", "", lambda call: gripper.stop()),
        ("Hand_WaitMovingCompleted", "", commands.wait_for_fingers),
        ("Hand_SetMaxSpeed", "num maxSpd", lambda call: gripper.set_max_speed(call["maxSpd"] * 1e-3)),
        ("Hand_SetHoldForce", "num holdForce", lambda call: gripper.set_hold_force(call["holdForce"])),
    )
    for name, signature, implementation in older:
        library.instruction(name, signature)(implementation)
    library.function("Hand_IsCalibrated", "", "bool")(lambda call: gripper.is_calibrated)
    library.function("Hand_IsCamConnected", "", "bool")(lambda call: False)
    library.function("Hand_GetActualPos", "", "num")(lambda call: gripper.position * 1e3)
    library.function("Hand_GetActualSpd", "", "num")(lambda call: abs(gripper.speed) * 1e3)
    library.function("Hand_GetFingerState", "", "num")(lambda call: float(gripper.state.value))
    for channel in CHANNELS:
        for name, switch, is_on in (
            ("TurnOffVacuum", gripper.set_vacuum, False),
            ("TurnOnBlow", gripper.set_blow, True),
            ("TurnOffBlow", gripper.set_blow, False),
        ):
            library.instruction(f"Hand_{name}{channel}")(partial(_switch, switch, channel, is_on))
        library.instruction(f"Hand_TurnOnVacuum{channel}", r"\num threshold")(
            partial(commands.vacuum_on, channel=channel)
        )
        library.function(f"Hand_GetVacuumPressure{channel}", "", "num")(partial(commands.pressure, channel=channel))
        switches = (
            ("VacuumOff", gripper.set_vacuum, False),
            ("BlowOn", gripper.set_blow, True),
            ("BlowOff", gripper.set_blow, False),
        )
        for name, switch, is_on in switches:
            library.instruction(f"g_{name}{channel}")(partial(_switch, switch, channel, is_on))
        library.instruction(f"g_VacuumOn{channel}", r"\num threshold")(partial(commands.vacuum_on, channel=channel))
        library.function(f"g_GetPressure{channel}", "", "num")(partial(commands.pressure, channel=channel))


def _switch(set_channel: Callable[..., None], channel: int, is_on: bool, call: Call) -> None:
    set_channel(channel, is_on=is_on)
