"""RAPID's instructions of the Smart Gripper: ``g_...``, before them ``Hand_...`` (reference/statemachine.md §5)."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Any, TypeVar

from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.gripper_values import FINGER_TRAVEL, MAX_GRIP_FORCE, TOP_FINGER_SPEED, ServoState
from abb_protocols.rws.values import EventType
from virtual_irc5.controller_log import ControllerEventLog
from virtual_irc5.mechanics.virtual_gripper import SETTLING_TIME, VACUUM_CHANNELS, VirtualGripper
from virtual_irc5.rapid import STANDARD, Call, Library, RapidRuntimeError, Wait

_FINGER_TIMEOUT = 5.0
"""How long an instruction waits for the fingers [s] (reference/statemachine.md §5.3)."""


class _GripperFailure(Enum):
    """What the gripper's driver logs in domain 11, and the RAPID error it raises."""

    NOT_CALIBRATED = (112755, "ERR_HAND_NOTCALIBRATED")
    OUT_OF_RANGE = (112757, "ERR_HAND_AUGOUTOFRANGE")
    WRONG_STATE = (112751, "ERR_HAND_WRONGSTATE")
    FAILED_MOVE = (112753, "ERR_HAND_FAILEDMOVEPOS")
    FAILED_GRIP_IN = (112754, "ERR_HAND_FAILEDGRIPINWARD")
    FAILED_GRIP_OUT = (112760, "ERR_HAND_FAILEDGRIPOUTWARD")
    FAILED_GRIP_POSITION = (112759, "ERR_HAND_FAILEDGRIPPOS")
    FAILED_VACUUM = (112756, "ERR_HAND_FAILEDVACUUM")


GRIPPER = Library(STANDARD)
for _failure in _GripperFailure:
    GRIPPER.error(_failure.value[1])
_SETTINGS = r"\num maxSpd, \num holdForce, \num phyLimit, \switch Calibrate"
_GRIP = r"\num holdForce, \num targetPos, \num posAllowance, \switch NoWait"
# The first generation's, with its spelling (reference/statemachine.md).
_OLD_GRIP = r"\num holdForce, \num targetPos, \num posAlowance, \switch NoWait, \switch NotLimitDriveForce"

_Method = TypeVar("_Method", bound=Callable[..., Any])


def _of_channels(*names: str, signature: str = "", returns: str = "") -> Callable[[_Method], _Method]:
    """Register a method under each name with the number of each vacuum channel, which it finds in the call's name."""

    def registered(method: _Method) -> _Method:
        for name in (f"{name}{channel}" for name in names for channel in VACUUM_CHANNELS):
            register = GRIPPER.function(name, signature, returns) if returns else GRIPPER.instruction(name, signature)
            register(method)
        return method

    return registered


def _channel(call: Call) -> int:
    return int(call.name[-1])


class GripperInstructions:
    """The gripper's instructions of one task."""

    def __init__(self, gripper: VirtualGripper, events: ControllerEventLog) -> None:
        self._gripper = gripper
        self._events = events

    @GRIPPER.instruction("g_Init", _SETTINGS)
    @GRIPPER.instruction("Hand_Initialize", _SETTINGS)
    def init(self, call: Call) -> Wait:
        speed, force = call.get("maxSpd", TOP_FINGER_SPEED * 1e3) * 1e-3, call.get("holdForce", MAX_GRIP_FORCE)
        limit = call.get("phyLimit", FINGER_TRAVEL * 1e3) * 1e-3
        self._do(lambda: self._gripper.initialize(speed, force, limit))
        if call.present("Calibrate"):
            yield from self._calibrated(jog=True)

    @GRIPPER.instruction("g_Calibrate", r"\switch Jog")
    @GRIPPER.instruction("Hand_DoCalibrate", r"\switch Jog")
    def calibrate(self, call: Call) -> Wait:
        """Done when the gripper knows its zero."""
        yield from self._calibrated(jog=call.present("Jog"))

    @GRIPPER.instruction("g_MoveTo", r"num TargetPos, \switch NoWait")
    @GRIPPER.instruction("Hand_MoveTo", r"num TargetPos, \switch NoWait")
    def move_to(self, call: Call) -> Wait:
        r"""Done when the fingers are there, or at once with \NoWait."""
        position = call["TargetPos"] * 1e-3
        yield from self._readied(call)
        self._do(lambda: self._gripper.move_to(position))
        if not call.present("NoWait"):
            yield from self._standing(call, _GripperFailure.FAILED_MOVE)

    @GRIPPER.instruction("g_GripIn", _GRIP)
    @GRIPPER.instruction("Hand_GripInward", _OLD_GRIP)
    @GRIPPER.instruction("g_GripOut", _GRIP)
    @GRIPPER.instruction("Hand_GripOutward", _OLD_GRIP)
    def grip(self, call: Call) -> Wait:
        r"""Done when the fingers stand, at something or at their end, or at once with \NoWait."""
        close, failure = self._gripper.grip_in, _GripperFailure.FAILED_GRIP_IN
        if "Out" in call.name:
            close, failure = self._gripper.grip_out, _GripperFailure.FAILED_GRIP_OUT
        yield from self._readied(call)
        self._do(lambda: close(call.get("holdForce", MAX_GRIP_FORCE)))
        yield from self._held(call, failure)

    @GRIPPER.instruction("g_JogIn")
    @GRIPPER.instruction("g_JogOut")
    @GRIPPER.instruction("Hand_JogInward")
    @GRIPPER.instruction("Hand_JogOutward")
    def jog(self, call: Call) -> Wait:
        """Done when the fingers stand; the motor then lets go."""
        yield from self._readied(call)
        self._gripper.jog(opens="Out" in call.name)
        begin = call.task.now
        while call.task.now - begin < SETTLING_TIME or self._gripper.speed != 0.0:
            if call.task.now - begin >= _FINGER_TIMEOUT:
                self._fail(_GripperFailure.WRONG_STATE, f"The fingers have been moving for {_FINGER_TIMEOUT:g} s.")
            yield None
        self._gripper.stop()

    @_of_channels("g_VacuumOn", "Hand_TurnOnVacuum", signature=r"\num threshold")
    def vacuum_on(self, call: Call) -> Wait:
        """Done at once, or with a threshold [kPa] when the pressure is below it."""
        channel = _channel(call)
        self._gripper.set_vacuum(channel, is_on=True)
        deadline = call.task.now + _FINGER_TIMEOUT
        while call.present("threshold") and self.pressure(call) > call["threshold"]:
            if call.task.now >= deadline:
                self._fail(
                    _GripperFailure.FAILED_VACUUM, f"Vacuum {channel} does not get below {call['threshold']:g} kPa."
                )
            yield None

    @_of_channels("g_GetPressure", "Hand_GetVacuumPressure", returns="num")
    def pressure(self, call: Call) -> float:
        """The pressure [kPa]; 0 where there is no such module."""
        cup = self._gripper.cups.get(_channel(call))
        return 0.0 if cup is None else cup.pressure * 1e-3

    @_of_channels("g_VacuumOff", "Hand_TurnOffVacuum")
    def vacuum_off(self, call: Call) -> None:
        self._gripper.set_vacuum(_channel(call), is_on=False)

    @_of_channels("g_BlowOn", "Hand_TurnOnBlow", "g_BlowOff", "Hand_TurnOffBlow")
    def blow(self, call: Call) -> None:
        self._gripper.set_blow(_channel(call), is_on="Off" not in call.name)

    @GRIPPER.instruction("g_Stop")
    @GRIPPER.instruction("Hand_Stop")
    def stop(self, call: Call) -> None:
        self._gripper.stop()

    @GRIPPER.instruction("g_SetMaxSpd", "num maxSpd")
    @GRIPPER.instruction("Hand_SetMaxSpeed", "num maxSpd")
    def set_max_speed(self, call: Call) -> None:
        self._gripper.set_max_speed(call["maxSpd"] * 1e-3)

    @GRIPPER.instruction("g_SetForce", "num holdForce")
    @GRIPPER.instruction("Hand_SetHoldForce", "num holdForce")
    def set_hold_force(self, call: Call) -> None:
        self._gripper.set_hold_force(call["holdForce"])

    @GRIPPER.function("g_IsCalibrated", "", "bool")
    @GRIPPER.function("Hand_IsCalibrated", "", "bool")
    def is_calibrated(self, call: Call) -> bool:
        return self._gripper.is_calibrated

    @GRIPPER.function("Hand_IsCamConnected", "", "bool")
    def has_camera(self, call: Call) -> bool:
        return False

    @GRIPPER.function("g_GetPos", "", "num")
    @GRIPPER.function("Hand_GetActualPos", "", "num")
    def position_mm(self, call: Call) -> float:
        """Of each finger [mm]."""
        return self._gripper.position * 1e3

    @GRIPPER.function("g_GetSpd", "", "num")
    @GRIPPER.function("Hand_GetActualSpd", "", "num")
    def speed_mm_s(self, call: Call) -> float:
        """Of each finger [mm/s]."""
        return abs(self._gripper.speed) * 1e3

    @GRIPPER.function("Hand_GetFingerState", "", "num")
    def finger_state(self, call: Call) -> float:
        return float(self._gripper.state.value)

    @GRIPPER.instruction("Hand_WaitMovingCompleted")
    def wait_for_fingers(self, call: Call) -> Wait:
        """Until the fingers stand."""
        yield from self._standing(call, _GripperFailure.FAILED_MOVE)

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
            self._fail(_GripperFailure.WRONG_STATE, "The gripper could not be calibrated.")

    def _held(self, call: Call, failure: _GripperFailure) -> Wait:
        if call.present("NoWait"):
            return
        # ABB's driver waits for the state that force is held, which the end of the fingers' travel brings about, too:
        # programs open fingers by gripping outward on nothing.
        yield from self._standing(call, failure)
        allowance_mm = call.get("posAllowance", call.get("posAlowance"))
        position_mm = self._gripper.position * 1e3
        if (
            call.present("targetPos")
            and allowance_mm is not None
            and abs(position_mm - call["targetPos"]) > allowance_mm
        ):
            sentence = f"The fingers stand at {position_mm:.1f} mm each, not within {allowance_mm:g} mm of the target."
            self._fail(_GripperFailure.FAILED_GRIP_POSITION, sentence)

    def _standing(self, call: Call, failure: _GripperFailure) -> Wait:
        deadline = call.task.now + _FINGER_TIMEOUT
        while self._gripper.is_moving:
            if call.task.now >= deadline:
                self._fail(failure, f"The fingers have been moving for {_FINGER_TIMEOUT:g} s.")
            yield None
        if self._gripper.state is ServoState.ERROR:
            self._fail(failure, "The gripper reports an error.")

    def _do(self, action: Callable[[], None]) -> None:
        try:
            action()
        except RobotNotReady as error:
            self._fail(_GripperFailure.NOT_CALIBRATED, str(error))
        except CommandRefused as error:
            self._fail(_GripperFailure.OUT_OF_RANGE, str(error))

    def _fail(self, failure: _GripperFailure, sentence: str) -> None:
        code, name = failure.value
        self._events.append(code, "Smart Gripper", sentence, EventType.ERROR)
        raise RapidRuntimeError(name, sentence)
