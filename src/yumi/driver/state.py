"""The robot's state as the robot manager knows it, and the modes it can bring the robot to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from yumi.driver.state_machine import MachineState
from yumi.robot.joints import Side
from yumi.rws.replies import Event
from yumi.rws.types import ControllerState, ExecutionState, OperatingMode

Report = Callable[[str], None]
"""Takes one short sentence a step: what is done next."""


class Mode(Enum):
    """Named states the robot can be brought to."""

    MOTORS_OFF = "motors_off"
    READY = "ready"
    EGM_LEFT = "egm_left"
    EGM_RIGHT = "egm_right"
    EGM_BOTH = "egm_both"

    @property
    def arms(self) -> tuple[Side, ...]:
        """The arms on which EGM runs in this mode."""
        return _ARMS.get(self, ())


_ARMS: Mapping[Mode, tuple[Side, ...]] = {
    Mode.EGM_LEFT: (Side.LEFT,),
    Mode.EGM_RIGHT: (Side.RIGHT,),
    Mode.EGM_BOTH: tuple(Side),
}

EGM_OFF = "off"
EGM_STREAMING = "streaming"
EGM_RUNNING = "running"


def arms_in_words(arms: tuple[Side, ...]) -> str:
    """``both arms``, or ``the right arm``."""
    return "both arms" if len(arms) > 1 else f"the {arms[0].word} arm"


@dataclass(frozen=True, slots=True)
class RobotState:
    """The robot at one moment; what is unknown is None.

    Attributes:
        is_connected: whether the controller answers.
        mode: position of the mode switch.
        controller_state: motors, or the stop that keeps them off.
        execution: whether RAPID runs.
        machines: the state machine of each arm.
        egm: ``off``, ``streaming`` (datagrams arrive) or ``running`` (the robot follows references), of each arm.
        speed_ratio: override of the speeds of RAPID motions [%].
        last_event: the newest message of the event log.
        speed_scale: the factor on the speed of every controller, above 0 up to 1.
        reason: why EGM can neither be started nor runs (:mod:`yumi.driver.readiness`); empty when it can or does.
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
        arms = "; ".join(f"{side.word} arm {machine_name(self, side)}, EGM {self.egm[side]}" for side in Side)
        if not self.is_connected:
            return f"{self.reason}; {arms}"
        mode, controller, rapid = (
            "unknown" if value is None else value.value for value in (self.mode, self.controller_state, self.execution)
        )
        cause = f"; cause: {self.cause}" if self.cause else ""
        stop = f"; waits for a person to confirm the stop {self.stop}" if self.stop else ""
        return f"mode {mode}; controller {controller}; RAPID {rapid}; {arms}{cause}{stop}"

    @property
    def is_stopped(self) -> bool:
        """Whether something keeps the program of the robot from running."""
        return (
            not self.is_connected
            or self.mode is not OperatingMode.AUTO
            or self.controller_state is not ControllerState.MOTORS_ON
            or self.execution is not ExecutionState.RUNNING
        )


def machine_name(state: RobotState, side: Side) -> str:
    """The state of an arm's state machine in a word."""
    machine = state.machines[side]
    return "no state machine" if machine is None else machine.name
