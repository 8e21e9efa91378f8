"""The robot at one moment, in values and in words; and the modes that it can be brought to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from html import escape
from typing import Literal

from abb_protocols.catalogue import Message, clause, in_words, message
from abb_protocols.robot.joints import Side
from abb_protocols.rws.operations.event_log import RwsEvent
from abb_protocols.rws.values import ControllerState, ExecutionState, OperatingMode
from yumi.driver.state_machine import MachineState

Report = Callable[[str], None]
"""Takes one short sentence a step: what is done next."""


class RobotMode(Enum):
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


ModeName = Literal["motors_off", "ready", "egm_left", "egm_right", "egm_both"]
"""The value of a mode, as commands name it."""

_ARMS: Mapping[RobotMode, tuple[Side, ...]] = {
    RobotMode.EGM_LEFT: (Side.LEFT,),
    RobotMode.EGM_RIGHT: (Side.RIGHT,),
    RobotMode.EGM_BOTH: tuple(Side),
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
        operating_mode: position of the mode switch.
        controller_state: motors, or the stop that keeps them off.
        execution: whether RAPID runs.
        machines: the state machine of each arm.
        egm: ``off``, ``streaming`` (datagrams arrive) or ``running`` (the robot follows references), of each arm.
        speed_ratio: override of the speeds of RAPID motions [%].
        last_event: the newest message of the event log.
        speed_scale: the factor in force on the speed of every controller, above 0 up to 1; a tenth at most while parts
            may touch.
        reasons: why EGM can neither be started nor runs, see :func:`why_not_ready`; empty when it can or does.
        causes: what stopped the robot, oldest first, while it is stopped; empty while it works.
        stop: id of the stop that a person must confirm before anything moves; empty where there is none.
        allowed_collisions: pairs of parts that may touch now, such as ``left gripper - right gripper``.
        limited_by: the pairs of parts, with their distances, that keep an arm from getting nearer now.
    """

    is_connected: bool = False
    operating_mode: OperatingMode | None = None
    controller_state: ControllerState | None = None
    execution: ExecutionState | None = None
    machines: Mapping[Side, MachineState | None] = field(default_factory=lambda: dict.fromkeys(Side))
    egm: Mapping[Side, str] = field(default_factory=lambda: dict.fromkeys(Side, EGM_OFF))
    speed_ratio: int | None = None
    last_event: RwsEvent | None = None
    speed_scale: float = 1.0
    reasons: tuple[Message, ...] = (message("controller_does_not_answer"),)
    causes: tuple[Message, ...] = ()
    stop: str = ""
    allowed_collisions: tuple[str, ...] = ()
    limited_by: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """In lines, as ``yumi state`` prints what it knows."""
        mode, motors, program = (
            None if value is None else value.value
            for value in (self.operating_mode, self.controller_state, self.execution)
        )
        lines = robot_lines(
            is_connected=self.is_connected,
            operating_mode=mode,
            motors=motors,
            program=program,
            speed_scale=self.speed_scale,
            speed_ratio=self.speed_ratio,
            allowed_collisions=self.allowed_collisions,
            reasons=self.reasons,
            causes=self.causes,
        )
        lines += [f"{side.word} arm: EGM {self.egm[side]}, {machine_name(self, side)}" for side in Side]
        return "\n".join([*lines, *(f"motion limited by {pair}" for pair in self.limited_by)])

    def _repr_html_(self) -> str:
        """For a notebook."""
        return f"<pre>{escape(repr(self))}</pre>"

    def __str__(self) -> str:
        """In one line."""
        arms = "; ".join(f"{side.word} arm {machine_name(self, side)}, EGM {self.egm[side]}" for side in Side)
        if not self.is_connected:
            return f"{'; '.join(map(clause, self.reasons))}; {arms}"
        mode, controller, rapid = (
            "unknown" if value is None else value.value
            for value in (self.operating_mode, self.controller_state, self.execution)
        )
        cause = f"; cause: {'; then '.join(map(clause, self.causes))}" if self.causes else ""
        stop = f"; waits for a person to confirm the stop {self.stop}" if self.stop else ""
        allowed = f"; may touch: {', '.join(self.allowed_collisions)}" if self.allowed_collisions else ""
        return f"operating mode {mode}; controller {controller}; RAPID {rapid}; {arms}{cause}{stop}{allowed}"

    @property
    def reason(self) -> str:
        """The reasons with what to do, in this program's words."""
        return in_words(self.reasons)

    @property
    def cause(self) -> str:
        """The causes with what to do, in this program's words."""
        return in_words(self.causes)

    @property
    def is_stopped(self) -> bool:
        """Whether something keeps the program of the robot from running."""
        return (
            not self.is_connected
            or self.operating_mode is not OperatingMode.AUTO
            or self.controller_state is not ControllerState.MOTORS_ON
            or self.execution is not ExecutionState.RUNNING
        )


def robot_lines(
    *,
    is_connected: bool,
    operating_mode: str | None,
    motors: str | None,
    program: str | None,
    speed_scale: float,
    speed_ratio: int | None,
    allowed_collisions: Sequence[str],
    reasons: Sequence[Message],
    causes: Sequence[Message],
) -> list[str]:
    """What a robot does, why it does not move and what stopped it, in this program's words."""
    lines = []
    if is_connected:
        lines.append(
            f"operating mode {operating_mode}, {motors}, RAPID {program}, speed_scale {speed_scale:g}, "
            f"speed ratio {speed_ratio} %"
        )
    if allowed_collisions:
        lines.append(f"may touch, slowly: {', '.join(allowed_collisions)}")
    lines.append(f"cannot move: {in_words(reasons)}" if reasons else "can move")
    if causes and tuple(causes) != tuple(reasons):
        lines.append(f"stopped by: {in_words(causes)}")
    return lines


def machine_name(state: RobotState, side: Side) -> str:
    """The state of an arm's state machine in a word."""
    machine = state.machines[side]
    return "no state machine" if machine is None else machine.name
