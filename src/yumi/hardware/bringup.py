"""Bringing the robot to where it may move, and back: the answer to "when may the robot move?".

Everything goes over Robot Web Services to the state machine on the robot; each step waits for the state it asked
for, with a deadline, and says what is wrong when it does not come.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isclose

from yumi.clock import Clock
from yumi.errors import ControllerRefused, RobotNotReady
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.state_machine import (
    EGM,
    MAIN,
    START_JOINT,
    STOP,
    EgmMotionSettings,
    MachineState,
    merge_egm_settings,
)
from yumi.robot.joints import Side
from yumi.rws import rapid_values
from yumi.rws.rapid_values import RapidValue
from yumi.rws.states import ControllerState, ExecutionState, OperatingMode

OLDEST_ROBOTWARE = (6, 9)
"""EGM for seven axes came with RobotWare 6.09 (reference/statemachine.md §3.5)."""

EGM_OPTION = "689-1 Externally Guided Motion (EGM)"

GLANCE = 0.05
"""Pause between two looks at a state [s]; the session keeps the pace of requests."""

Report = Callable[[str], None]
"""Told what is being done, one short sentence a step."""


class Bringup:
    """Brings one controller to ready, and starts and stops EGM on its arms.

    Args:
        client: a connected client.
        motion: what EGM motions start with.
        clock: where waiting time comes from.
        report: told each step.
        arms: those that EGM shall guide; the others stand still meanwhile.
    """

    def __init__(
        self,
        client: RwsClient,
        motion: EgmMotionSettings,
        clock: Clock,
        report: Report,
        arms: tuple[Side, ...] = tuple(Side),
    ) -> None:
        self._client = client
        self._motion = motion
        self._clock = clock
        self._report = report
        self._arms = arms
        self._is_checked = False

    def check_controller(self) -> None:
        """Check what can never be mended from here.

        Raises:
            RobotNotReady: RobotWare is too old, EGM is missing, or the RAPID program is not there.
        """
        system = self._client.system()
        if tuple(system.robotware[:2]) < OLDEST_ROBOTWARE:
            version = ".".join(map(str, system.robotware))
            raise RobotNotReady(f"The controller runs RobotWare {version}; EGM for a YuMi needs 6.09 or newer.")
        if EGM_OPTION not in system.options:
            raise RobotNotReady(f"The controller lacks the option {EGM_OPTION!r}; without it no arm can be guided.")
        for side in Side:
            self._check_program(side)
        self._is_checked = True

    def make_ready(self) -> None:
        """Motors on, program running, both state machines idle.

        Raises:
            RobotNotReady: a step did not reach its state in time; the message says which and what to do.
        """
        if not self._is_checked:
            self.check_controller()
        self._check_automatic()
        self._switch_motors_on()
        if not self._are_idle():
            self._restart_program()

    def why_not_ready(self) -> str | None:
        """What keeps the robot from starting EGM, or None."""
        if self._client.operating_mode() is not OperatingMode.AUTO:
            return "the controller is not in AUTO"
        if self._client.controller_state() is not ControllerState.MOTORS_ON:
            return "the motors are off"
        if self._client.execution() is not ExecutionState.RUNNING:
            return "the RAPID program is stopped"
        states = {side: self.state(side) for side in Side}
        busy = [f"{side.word} arm: {state.name}" for side, state in states.items() if state is not MachineState.IDLE]
        return f"the state machines are not idle ({', '.join(busy)})" if busy else None

    def describe(self) -> str:
        """Mode, motors and program in one line."""
        mode, motors = self._client.operating_mode().value, self._client.controller_state().value
        return f"mode {mode}; controller {motors}; RAPID {self._client.execution().value}"

    def start_egm(self) -> None:
        """Write the EGM settings and start EGM joint motion.

        Raises:
            RobotNotReady: an arm did not begin.
        """
        for side in Side:
            self._write_settings(side)
        self._report(f"start EGM on {'both arms' if len(self._arms) > 1 else f'the {self._arms[0].word} arm'}")
        self._client.pulse_signal(START_JOINT)
        remedy = "see that the RAPID program runs and EGM motions are allowed"
        self._wait_for(MachineState.RUN_EGM_ROUTINE, 1.0, remedy, self._arms)

    def stop_egm(self) -> None:
        """Stop EGM; both arms come to rest.

        Raises:
            RobotNotReady: an arm did not become idle.
        """
        self._report("stop EGM")
        self._client.pulse_signal(STOP)
        self._wait_for(MachineState.IDLE, 5.0, "look at the event log on the pendant")

    def state(self, side: Side) -> MachineState:
        """The state machine of one arm."""
        value = rapid_values.decode(self._client.symbol(side.task, MAIN, "current_state"))
        if not isinstance(value, float) or value not in set(MachineState):
            raise RobotNotReady(
                f"{side.task}/{MAIN}/current_state is {value!r}; load the RAPID modules of this version."
            )
        return MachineState(int(value))

    def _check_program(self, side: Side) -> None:
        try:
            kind = self._client.symbol_type(side.task, MAIN, "current_state")
        except ControllerRefused as error:
            raise RobotNotReady(
                f"Task {side.task} has no state machine ({MAIN}); load the RAPID modules of this package on it."
            ) from error
        if kind != "num":
            raise RobotNotReady(
                f"{side.task}/{MAIN}/current_state has type {kind}, not num; load this version's modules."
            )

    def _check_automatic(self) -> None:
        mode = self._client.operating_mode()
        if mode is not OperatingMode.AUTO:
            raise RobotNotReady(f"The controller is in {mode.value}; turn it to AUTO on the pendant, nothing else can.")

    def _switch_motors_on(self) -> None:
        if self._client.controller_state() is ControllerState.MOTORS_ON:
            return
        self._report("motors on")
        self._client.set_motors(True)
        self._wait(
            lambda: self._client.controller_state() is ControllerState.MOTORS_ON,
            5.0,
            lambda: (
                f"Motors do not go on, the controller is in {self._client.controller_state().value!r}; "
                "release the emergency stop and acknowledge it on the pendant."
            ),
        )

    def _are_idle(self) -> bool:
        return self._client.execution() is ExecutionState.RUNNING and all(
            self.state(side) == MachineState.IDLE for side in Side
        )

    def _restart_program(self) -> None:
        if self._client.execution() is ExecutionState.RUNNING:
            self._report("stop the RAPID program")
            self._client.stop_rapid()
            self._wait_for_execution(ExecutionState.STOPPED)
        self._report("program pointer to main")
        self._client.move_pp_to_main()
        self._report("start the RAPID program")
        self._client.start_rapid()
        self._wait_for_execution(ExecutionState.RUNNING)
        self._wait_for(MachineState.IDLE, 5.0, "look at the event log on the pendant")

    def _wait_for_execution(self, wanted: ExecutionState) -> None:
        self._wait(
            lambda: self._client.execution() is wanted,
            5.0,
            lambda: f"The RAPID program is not {wanted.value} after 5 s; look at the event log on the pendant.",
        )

    def _write_settings(self, side: Side) -> None:
        current = rapid_values.decode(self._client.symbol(side.task, EGM, "settings"))
        wanted = merge_egm_settings(current, self._motion, is_allowed=side in self._arms)
        if _equal(current, wanted):
            return
        self._client.set_symbol(side.task, EGM, "settings", rapid_values.encode(wanted))
        written = rapid_values.decode(self._client.symbol(side.task, EGM, "settings"))
        if not _equal(written, wanted):
            raise RobotNotReady(f"{side.task} did not take the EGM settings: wrote {wanted}, it holds {written}.")

    def _wait_for(
        self, wanted: MachineState, deadline: float, remedy: str, arms: tuple[Side, ...] = tuple(Side)
    ) -> None:
        def sentence() -> str:
            states = ", ".join(f"{side.word} arm {self.state(side).name}" for side in arms)
            return f"The state machines did not reach {wanted.name} within {deadline:g} s ({states}); {remedy}."

        self._wait(lambda: all(self.state(side) == wanted for side in arms), deadline, sentence)

    def _wait(self, is_so: Callable[[], bool], deadline: float, sentence: Callable[[], str]) -> None:
        end = self._clock.now() + deadline
        while not is_so():
            if self._clock.now() >= end:
                raise RobotNotReady(sentence())
            self._clock.wait(GLANCE)


def _equal(left: RapidValue, right: RapidValue) -> bool:
    """Whether two values are the same in the single precision of RAPID's num."""
    if isinstance(left, tuple) and isinstance(right, tuple):
        return len(left) == len(right) and all(_equal(one, other) for one, other in zip(left, right, strict=True))
    if isinstance(left, float) and isinstance(right, float | int) and not isinstance(right, bool):
        return isclose(left, right, rel_tol=1e-5, abs_tol=1e-9)
    return left == right
