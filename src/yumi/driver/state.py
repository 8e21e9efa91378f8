"""What the robot manager knows of the robot, and the states it can bring it to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from yumi.driver.state_machine import MachineState
from yumi.robot.joints import Side
from yumi.rws.replies import Event
from yumi.rws.types import ControllerState, ExecutionState, OperatingMode

Report = Callable[[str], None]
"""Told what is being done, one short sentence a step."""


class Mode(Enum):
    """Named states the robot can be brought to."""

    MOTORS_OFF = "motors_off"
    READY = "ready"
    EGM_LEFT = "egm_left"
    EGM_RIGHT = "egm_right"
    EGM_BOTH = "egm_both"

    @property
    def arms(self) -> tuple[Side, ...]:
        """The arms that EGM guides in this state."""
        return _ARMS.get(self, ())


_ARMS: Mapping[Mode, tuple[Side, ...]] = {
    Mode.EGM_LEFT: (Side.LEFT,),
    Mode.EGM_RIGHT: (Side.RIGHT,),
    Mode.EGM_BOTH: tuple(Side),
}

EGM_OFF = "off"
EGM_STREAMING = "streaming"
EGM_RUNNING = "running"


@dataclass(frozen=True, slots=True)
class RobotState:
    """The robot at one moment; what is not known is None.

    Attributes:
        is_connected: whether the controller answers.
        mode: position of the mode switch.
        controller_state: motors, or the stop that keeps them off.
        execution: whether RAPID runs.
        machines: the state machine of each arm.
        egm: ``off``, ``streaming`` (datagrams come) or ``running`` (the robot follows), of each arm.
        speed_ratio: override of the speeds of RAPID motions [%].
        last_event: the newest message of the event log.
        speed_scale: the factor on the speed of every controller, above 0 up to 1.
        reason: why EGM can neither be started nor runs, in words that follow "not ready:"; empty when it can or does.
        cause: what stopped the robot, with what to do, while it is stopped; empty while it works.
        stop: id of the stop that a person must confirm before anything moves; empty where there is none.
    """

    is_connected: bool = False
    mode: OperatingMode | None = None
    controller_state: ControllerState | None = None
    execution: ExecutionState | None = None
    machines: Mapping[Side, MachineState | None] = field(default_factory=lambda: dict.fromkeys(Side))
    egm: Mapping[Side, str] = field(default_factory=lambda: dict.fromkeys(Side, EGM_OFF))
    speed_ratio: int | None = None
    last_event: Event | None = None
    speed_scale: float = 1.0
    reason: str = "the controller does not answer"
    cause: str = ""
    stop: str = ""

    def __str__(self) -> str:
        """In one line."""
        if not self.is_connected:
            return f"{self.reason}; {self._arms()}"
        cause = f"; cause: {self.cause}" if self.cause else ""
        stop = f"; waits for a person to confirm the stop {self.stop}" if self.stop else ""
        return (
            f"mode {_word(self.mode)}; controller {_word(self.controller_state)}; RAPID {_word(self.execution)}; "
            f"{self._arms()}{cause}{stop}"
        )

    @property
    def is_stopped(self) -> bool:
        """Whether something keeps the program of the robot from running."""
        return (
            not self.is_connected
            or self.mode is not OperatingMode.AUTO
            or self.controller_state is not ControllerState.MOTORS_ON
            or self.execution is not ExecutionState.RUNNING
        )

    def _arms(self) -> str:
        return "; ".join(f"{side.word} arm {_name(self.machines[side])}, EGM {self.egm[side]}" for side in Side)


def why_not_ready(state: RobotState) -> str:
    """What keeps the robot from starting EGM, in words that follow "not ready:"; empty when nothing does."""
    if not state.is_connected:
        return "the controller does not answer"
    if state.mode is not OperatingMode.AUTO:
        return "the controller is not in AUTO"
    if state.controller_state is not ControllerState.MOTORS_ON:
        return _MOTORS.get(state.controller_state, "the motors are off")
    if state.execution is not ExecutionState.RUNNING:
        return "the RAPID program is stopped"
    busy = [f"{side.word} arm: {_name(state.machines[side])}" for side in Side if not _is_fit(state, side)]
    return f"the state machines are not idle ({', '.join(busy)})" if busy else ""


_MOTORS: Mapping[ControllerState | None, str] = {
    ControllerState.GUARD_STOP: "a guard stop keeps the motors off",
    ControllerState.EMERGENCY_STOP: "the emergency stop is pressed",
    ControllerState.EMERGENCY_STOP_RESET: "the motors are off after an emergency stop",
    ControllerState.SYSTEM_FAILURE: "the controller is in system failure",
}


def _is_fit(state: RobotState, side: Side) -> bool:
    machine = state.machines[side]
    return machine is MachineState.IDLE or state.egm[side] == EGM_RUNNING


def _word(state: Enum | None) -> str:
    return "unknown" if state is None else str(state.value)


def _name(machine: MachineState | None) -> str:
    return "no state machine" if machine is None else machine.name
