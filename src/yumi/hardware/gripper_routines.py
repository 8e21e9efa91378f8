"""The state machine's gripper routine: the one door through which RAPID commands both hands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from threading import Lock

from yumi.clock import Clock
from yumi.errors import RobotNotReady
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.state_machine import GRIPPER, MAIN, RUN_GRIPPER, MachineState, SgCommand
from yumi.robot.joints import Side
from yumi.rws import rapid_values

_GLANCE = 0.1  # [s] between two looks at whether a command was taken


class GripperRoutines:
    """The one signal the grippers share: its edge runs what each arm's task has been told.

    Both tasks see every edge, so the next command waits until the task has taken this one: it would otherwise be
    run twice, or be erased while the task reads it.

    Args:
        client: a connected client.
        clock: where waiting time comes from.
    """

    def __init__(self, client: RwsClient, clock: Clock) -> None:
        self._client = client
        self._clock = clock
        self._lock = Lock()
        self._are_empty = False  # the tasks' slots, as far as we know

    def run(
        self,
        side: Side,
        command: SgCommand,
        timeout: float,
        *,
        target: float | None = None,
        force: float | None = None,
    ) -> None:
        """Have one arm's task run ``command``; returns when the task has issued it.

        Args:
            side: which arm.
            command: what to do.
            timeout: longest wait for the task [s].
            target: finger position [m] for ``MOVE_TO``.
            force: holding force [N] for ``GRIP_IN`` and ``GRIP_OUT``.

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
            self._write(side, "command_input", float(command))
            self._client.pulse_signal(RUN_GRIPPER)
            self._wait_until_taken(side, timeout)
            self._are_empty = True

    def calibrate(self, sides: Sequence[Side], timeout: float, check: Callable[[], None] = lambda: None) -> None:
        """Have the tasks of these arms calibrate their hands at the same time: one edge reaches both.

        Args:
            sides: which arms.
            timeout: longest wait for the tasks, which take the command when they have carried it out [s].
            check: raises when the hands may not move any more, or nobody waits any more.

        Raises:
            RobotNotReady: a task did not take the command, or its arm is guided or runs a routine.
        """
        with self._lock:
            for side in sides:
                self._check_idle(side)
            for each in Side:
                command = SgCommand.CALIBRATE if each in sides else SgCommand.NONE
                self._write(each, "command_input", float(command))
            self._are_empty = False
            check()
            self._client.pulse_signal(RUN_GRIPPER)
            for side in sides:
                self._wait_until_taken(side, timeout, check)
            self._are_empty = True

    def _check_idle(self, side: Side) -> None:
        """The task calibrates in a trap, which would hold back every stop of an arm that moves."""
        state = rapid_values.decode(self._client.symbol(side.task, MAIN, "current_state"))
        if state != MachineState.IDLE:
            raise RobotNotReady(
                f"The {side.word} gripper is not calibrated while its arm is guided or runs a routine; stop that first."
            )

    def _wait_until_taken(self, side: Side, timeout: float, check: Callable[[], None] = lambda: None) -> None:
        end = self._clock.now() + timeout
        while not self._is_taken(side):
            check()
            if self._clock.now() >= end:
                raise RobotNotReady(
                    f"The {side.word} arm took no gripper command within {timeout:g} s; see that the RAPID program "
                    "runs."
                )
            self._clock.wait(_GLANCE)

    def _is_taken(self, side: Side) -> bool:
        return rapid_values.decode(self._client.symbol(side.task, GRIPPER, "command_input")) == SgCommand.NONE

    def _write(self, side: Side, symbol: str, value: float) -> None:
        self._client.set_symbol(side.task, GRIPPER, symbol, rapid_values.encode(value))

    def _write_force(self, side: Side, force: float) -> None:
        current = rapid_values.decode(self._client.symbol(side.task, GRIPPER, "settings"))
        if not isinstance(current, tuple) or len(current) != 3:
            raise RobotNotReady(f"{GRIPPER}/settings of {side.task} has an unknown layout: {current}.")
        max_speed, set_force, limit = current
        if set_force != force:
            self._client.set_symbol(side.task, GRIPPER, "settings", rapid_values.encode((max_speed, force, limit)))
