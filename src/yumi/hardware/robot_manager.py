"""The robot manager: owns the robot's state over RWS, brings it to named states with the controllers on top."""

from __future__ import annotations

from collections.abc import Sequence
from threading import Lock
from typing import Protocol

from yumi.clock import Clock
from yumi.control.requests import Done, HoldArm, Request, SwitchControllers
from yumi.control.snapshot import Snapshot
from yumi.errors import RobotNotReady
from yumi.hardware.bringup import Bringup
from yumi.hardware.controller_data import ControllerData
from yumi.hardware.manager_state import Mode, Report, RobotState
from yumi.hardware.rapid_routines import RapidRoutines
from yumi.hardware.robot_watch import RobotWatch
from yumi.hardware.state_machine import MachineState
from yumi.hardware.waiting import wait_until
from yumi.robot.joints import Side

FIRST_DATAGRAM = 5.0
"""How long the arms may take from the start signal until they follow [s]."""

POSITION_CONTROLLER = "joint_position_controller"
"""What commands an arm after EGM has started, unless told otherwise."""


class FastLines(Protocol):
    """What is needed of the fast lines."""

    def check(self) -> None:
        """See that they run; raises RobotNotReady."""

    def snapshot(self, side: Side) -> Snapshot:
        """What is known of an arm."""

    def ask(self, request: Request) -> Done:
        """Have ``request`` served between two cycles."""


class RobotManager:
    """Brings the robot to ready, starts and stops EGM with the controllers on top.

    Every method that changes something waits until it is so, one at a time: the robot has one state. Whatever cannot
    be done raises a YumiError whose sentence says why and what to do.

    Args:
        bringup: what is done over RWS.
        fast_lines: where the controllers live.
        clock: where waiting time comes from.
        leading: name of the controller that commands an arm after EGM has started.
        arms: the arms that are guided unless told otherwise; the others stand still.

    Attributes:
        watch: what is known of the robot.
    """

    def __init__(
        self,
        bringup: Bringup,
        fast_lines: FastLines,
        clock: Clock,
        leading: str = POSITION_CONTROLLER,
        arms: tuple[Side, ...] = tuple(Side),
    ) -> None:
        self.watch = RobotWatch(bringup.client, fast_lines)
        self._bringup = bringup
        self._cabinet = bringup.cabinet
        self._data = ControllerData(bringup.client, bringup.cabinet)
        self._routines = RapidRoutines(bringup.client, bringup.cabinet, bringup.machines, clock)
        self._fast_lines = fast_lines
        self._clock = clock
        self._leading = leading
        self._arms = arms
        self._lock = Lock()  # one at a time; the robot has one state

    # What is known

    def state(self) -> RobotState:
        """All that is known of the robot."""
        return self.watch.look()

    def check_ready(self) -> str:
        """Whether EGM can be started, or runs.

        Raises:
            RobotNotReady: it cannot; the message says why.
        """
        self._fast_lines.check()
        if self._are_guided(self._arms):
            return "ready, EGM runs"
        reason = self.state().reason
        if reason:
            raise RobotNotReady(f"not ready: {reason}")
        return "ready"

    def describe(self) -> str:
        """The robot's state in one line."""
        return str(self.state())

    # Named states

    def make_ready(self) -> str:
        """Motors on, program running, state machines idle; nothing when it is ready or EGM runs."""
        with self._lock:
            if not self._are_guided(self._arms):
                self._bringup.make_ready()
        return "The robot is ready"

    def start_egm(self, arms: Sequence[Side] | None = None) -> str:
        """Start EGM and activate what commands the arms; makes the robot ready first if need be.

        Args:
            arms: which arms; None takes all that are configured. The others stand still.

        Raises:
            YumiError: a step failed; the message says which.
        """
        with self._lock:
            self._fast_lines.check()
            return self._guide(tuple(arms) if arms else self._arms)

    def stop_egm(self) -> str:
        """Deactivate what commands the arms and stop EGM; they come to rest.

        Raises:
            YumiError: a step failed; the message says which.
        """
        with self._lock:
            self._end_egm()
        return "EGM has ended on both arms"

    def go_to(self, mode: Mode, report: Report) -> str:
        """Bring the robot to a named state, step by step.

        Args:
            mode: the state.
            report: told each step.

        Raises:
            YumiError: a step failed; the message says which and what to do.
        """
        with self._lock, self._bringup.telling(report):
            if mode.arms:
                self._fast_lines.check()
                return self._guide(mode.arms)
            self._end_any_egm()
            if mode is Mode.READY:
                self._bringup.make_ready()
                return "The robot is ready, EGM does not run"
            self._switch_motors_off()
            return "The motors are off"

    def end_motion(self) -> None:
        """Hold, and end EGM if the robot is in it: what the driver does before it goes.

        Raises:
            YumiError: the robot could not be told.
        """
        with self._lock:
            self._end_any_egm()

    # Single steps

    def motors_on(self) -> str:
        """Motors on; a released emergency stop is acknowledged by it. Raises RobotNotReady."""
        with self._lock:
            self._cabinet.switch_motors_on()
        return "The motors are on"

    def motors_off(self) -> str:
        """Motors off; EGM is ended before, so that the arms come to rest gently. Raises YumiError."""
        with self._lock:
            self._end_any_egm()
            self._switch_motors_off()
        return "The motors are off"

    def start_rapid(self) -> str:
        """Start the program where its pointers are. Raises RobotNotReady."""
        with self._lock:
            self._cabinet.start_rapid()
        return "The RAPID program runs"

    def stop_rapid(self) -> str:
        """Stop the program; EGM is ended before, so that the arms come to rest gently. Raises YumiError."""
        with self._lock:
            self._end_any_egm()
            self._cabinet.stop_rapid()
        return "The RAPID program is stopped"

    def pp_to_main(self) -> str:
        """Program pointers to main; the program must be stopped. Raises RobotNotReady."""
        with self._lock:
            self._cabinet.move_pp_to_main()
        return "The program pointers are at main"

    def set_speed_ratio(self, percent: int) -> str:
        """Override of the speeds of RAPID motions, 0 to 100 %; EGM motions take no notice. Raises YumiError."""
        with self._lock:
            self._cabinet.set_speed_ratio(percent)
        return f"The speed ratio is {percent} %"

    def run_routine(self, side: Side, name: str) -> str:
        """Run a RAPID routine in one arm's task and wait for its end, see :meth:`RapidRoutines.run`."""
        with self._lock:
            self._routines.run(side, name)
        return f"Routine {name} of {side.task} has run"

    # Data

    def read_signal(self, name: str) -> str:
        """Value of an I/O signal. Raises YumiError."""
        return self._data.read_signal(name)

    def write_signal(self, name: str, value: str | float) -> None:
        """Set an I/O signal. Raises YumiError; nothing was changed then."""
        self._data.write_signal(name, value)

    def read_variable(self, task: str, module: str, name: str) -> str:
        """Value of a RAPID variable as RAPID writes it. Raises YumiError."""
        return self._data.read_variable(task, module, name)

    def write_variable(self, task: str, module: str, name: str, value: str) -> None:
        """Write a RAPID variable, ``value`` as RAPID writes it. Raises YumiError; nothing was changed then."""
        self._data.write_variable(task, module, name, value)

    # How

    def _guide(self, arms: tuple[Side, ...]) -> str:
        """EGM and controllers on exactly these arms."""
        if any(self._snapshot(side).is_running for side in Side if side not in arms):
            self._end_egm()  # the signal that ends EGM ends it on both
        if not self._are_guided(arms):
            self._begin_egm(arms)
        for side in arms:
            if not self._snapshot(side).is_commanded:
                self._bringup.report(f"activate {self._leading} on the {side.word} arm")
                self._fast_lines.ask(SwitchControllers(side, activate=(self._leading,)))
        whom = "both arms" if len(arms) > 1 else f"the {arms[0].word} arm"
        return f"EGM runs on {whom}, {self._leading} is active"

    def _begin_egm(self, arms: tuple[Side, ...]) -> None:
        if any(self._snapshot(side).is_running for side in Side):
            self._bringup.stop_egm()  # one arm alone: end it, so that both begin together
        self._bringup.make_ready()
        self._bringup.start_egm(arms)
        wait_until(self._clock, lambda: self._are_guided(arms), FIRST_DATAGRAM, lambda: self._why_not_guided(arms))

    def _end_egm(self) -> None:
        try:
            self._hold()
        finally:
            self._bringup.stop_egm()  # whatever became of the fast line

    def _end_any_egm(self) -> None:
        if any(self._bringup.state(side) is MachineState.RUN_EGM_ROUTINE for side in Side):
            self._end_egm()

    def _hold(self) -> None:
        """Deactivate whatever commands the arms: they come to rest and hold."""
        for side in Side:
            if self._snapshot(side).is_commanded:
                self._fast_lines.ask(HoldArm(side))

    def _switch_motors_off(self) -> None:
        self._bringup.report("motors off")
        self._cabinet.switch_motors_off()

    def _why_not_guided(self, arms: tuple[Side, ...]) -> str:
        silent = [side for side in arms if not self._snapshot(side).is_streaming]
        if not silent:
            words = " and ".join(side.word for side in arms if not self._snapshot(side).is_running)
            return (
                f"EGM started but the robot does not follow on the {words} arm; look at the event log on the pendant."
            )
        words = " and ".join(side.word for side in silent)
        devices = ", ".join(side.unit for side in silent)
        return (
            f"EGM started on the robot but no datagram came for the {words} arm; check the remote address and port of "
            f"the controller's UDPUC device {devices} and this machine's firewall."
        )

    def _are_guided(self, arms: Sequence[Side]) -> bool:
        return all(self._snapshot(side).is_running for side in arms)

    def _snapshot(self, side: Side) -> Snapshot:
        return self._fast_lines.snapshot(side)
