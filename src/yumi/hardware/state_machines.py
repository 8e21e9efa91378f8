"""The state machines of both arms: what state they are in, and EGM's begin and end on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isclose

from yumi.clock import Clock
from yumi.errors import ProtocolError, RobotNotReady
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.speed_setting import SpeedSetting
from yumi.hardware.state_machine import (
    EGM,
    MAIN,
    START_JOINT,
    STOP,
    EgmMotionSettings,
    MachineState,
    merge_egm_settings,
)
from yumi.hardware.waiting import wait_until
from yumi.robot.joints import Side
from yumi.rws import rapid_values
from yumi.rws.rapid_values import RapidValue

_START_DEADLINE = 1.0
_STOP_DEADLINE = 5.0
_LOOK_AT_LOG = "look at the event log on the pendant"


class StateMachines:
    """The state machines of one controller.

    Args:
        client: a connected client.
        motion: what EGM motions start with.
        clock: where waiting time comes from.
        speed: what the robot's own limit is lowered with.
    """

    def __init__(
        self, client: RwsClient, motion: EgmMotionSettings, clock: Clock, speed: SpeedSetting | None = None
    ) -> None:
        self._speed = speed or SpeedSetting()
        self._client = client
        self._motion = motion
        self._clock = clock

    def state(self, side: Side) -> MachineState:
        """The state of one arm's machine.

        Raises:
            RobotNotReady: what the robot says is none.
        """
        literal = self._client.symbol(side.task, MAIN, "current_state")
        try:
            return read_machine_state(literal)
        except ProtocolError as error:
            raise RobotNotReady(
                f"{side.task}/{MAIN}/current_state is {literal}; load the RAPID modules of this version."
            ) from error

    def states(self) -> Mapping[Side, MachineState]:
        """The states of both arms' machines."""
        return {side: self.state(side) for side in Side}

    @property
    def are_idle(self) -> bool:
        return all(self.state(side) is MachineState.IDLE for side in Side)

    def start_egm(self, arms: Sequence[Side]) -> None:
        """Write the EGM settings and start EGM joint motion on ``arms``; an arm that EGM guides already goes on.

        Raises:
            RobotNotReady: an arm did not begin, or did not take its settings.
        """
        scale = self._speed.value
        beginning = [side for side in arms if not self._speed.is_guided(side)]
        for side in Side:
            self._write_settings(side, scale, is_allowed=side in arms)
        self._client.pulse_signal(START_JOINT)
        remedy = "see that the RAPID program runs and EGM motions are allowed"
        self.wait_for(MachineState.RUN_EGM_ROUTINE, arms, _START_DEADLINE, remedy)
        self._speed.note_start(beginning, scale)

    def stop_egm(self) -> None:
        """Stop EGM; both arms come to rest.

        Raises:
            RobotNotReady: an arm did not become idle.
        """
        self._client.pulse_signal(STOP)
        self.wait_for_idle(_STOP_DEADLINE + self._motion.ramp_out_time)

    def wait_for_idle(self, deadline: float) -> None:
        """Wait until both machines are idle, at most ``deadline`` [s]; raises RobotNotReady."""
        self.wait_for(MachineState.IDLE, tuple(Side), deadline, _LOOK_AT_LOG)

    def wait_for(self, wanted: MachineState, arms: Sequence[Side], deadline: float, remedy: str) -> None:
        """Wait until the machines of ``arms`` are in a state.

        Args:
            wanted: the state.
            arms: whose machines.
            deadline: longest wait [s].
            remedy: what to do when it does not come about, for the sentence.

        Raises:
            RobotNotReady: it did not come about.
        """

        def sentence() -> str:
            states = ", ".join(f"{side.word} arm {self.state(side).name}" for side in arms)
            return f"The state machines did not reach {wanted.name} within {deadline:g} s ({states}); {remedy}."

        wait_until(self._clock, lambda: all(self.state(side) is wanted for side in arms), deadline, sentence)

    def _write_settings(self, side: Side, scale: float, *, is_allowed: bool) -> None:
        motion = replace(self._motion, max_speed_deviation=scale * self._motion.max_speed_deviation)
        current = rapid_values.decode(self._client.symbol(side.task, EGM, "settings"))
        wanted = merge_egm_settings(current, motion, is_allowed=is_allowed)
        if _equal(current, wanted):
            return
        self._client.set_symbol(side.task, EGM, "settings", rapid_values.encode(wanted))
        written = rapid_values.decode(self._client.symbol(side.task, EGM, "settings"))
        if not _equal(written, wanted):
            raise RobotNotReady(f"{side.task} did not take the EGM settings: wrote {wanted}, it holds {written}.")


def read_machine_state(literal: str) -> MachineState:
    """The state that ``TRobMain/current_state`` tells.

    Raises:
        ProtocolError: it is no state.
    """
    value = rapid_values.decode(literal)
    if not isinstance(value, float) or value not in set(MachineState):
        raise ProtocolError(f"{MAIN}/current_state is {literal}, which is no state of the state machine.")
    return MachineState(int(value))


def _equal(left: RapidValue, right: RapidValue) -> bool:
    """Whether two values are the same in the single precision of RAPID's num."""
    if isinstance(left, tuple) and isinstance(right, tuple):
        return len(left) == len(right) and all(_equal(one, other) for one, other in zip(left, right, strict=True))
    if isinstance(left, float) and isinstance(right, float | int) and not isinstance(right, bool):
        return isclose(left, right, rel_tol=1e-5, abs_tol=1e-9)
    return left == right
