"""Bring-up: the steps to a robot that is ready, EGM's start and stop on it.

All of it goes over Robot Web Services. :class:`Bringup` puts the steps together: :class:`.LaunchChecks` of what cannot
be repaired from here, motors and program by the :class:`.ControllerPanel`, EGM by the state machines on the robot. A
step that changes something reads the state first, says what forbids it (:mod:`yumi.driver.readiness`), and waits with a
deadline until it is done.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import ControllerState, ExecutionState, OperatingMode
from abb_runtime.clock import Clock
from abb_runtime.rws.client import RwsClient
from yumi.driver.controller_panel import OBEY_TIMEOUT, ControllerPanel
from yumi.driver.launch_checks import EgmAddress, LaunchChecks
from yumi.driver.readiness import NO_STOP, ConditionalRequest, check_request, unmet
from yumi.driver.robot_state import Report, RobotState, arms_in_words
from yumi.driver.speed_setting import SpeedSetting
from yumi.driver.state_machine import EgmMotionSettings, MachineState, StateMachines

BRINGUP_ANNOUNCEMENT = "Bring-up will: "
"""How the line begins that says what will be done to the robot, before the first of it is done."""

STOP_PROGRAM = "stop the RAPID program"
"""The step before a program that runs is started anew."""


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a bring-up: its name, for announcement and report alike, and what it does."""

    name: str
    do: Callable[[], None]


class Bringup:
    """Brings one controller to ready, and starts and stops EGM on its arms.

    Args:
        client: a connected client.
        motion: what EGM motions start with.
        clock: for waiting.
        report: gets the name of each step.
        arms: those on which EGM runs unless others are named; the others stand still meanwhile.
        warn: gets what is not as it should be, in place of ``report``.
        speed: the factor on all speeds, which the robot's own limit follows.

    Attributes:
        panel: the controller's motors, program and signals.
        machines: the state machines on it.
        before_step: called with the name of each step after it is reported and before it is done; raises where it must
            not be done any more.
        when_ready: called each time the robot has become ready, and before EGM starts: what needs the program running
            and no EGM.
        only_if_ready: whether :meth:`make_ready` refuses where it would have to do something to the robot.
        misdirected: where an arm's datagrams go elsewhere by the controller's configuration, and what to do.
    """

    def __init__(
        self,
        client: RwsClient,
        motion: EgmMotionSettings,
        clock: Clock,
        report: Report,
        arms: tuple[Side, ...] = tuple(Side),
        warn: Report | None = None,
        speed: SpeedSetting | None = None,
    ) -> None:
        self.client = client
        self.speed = speed or SpeedSetting()
        self.panel = ControllerPanel(client, clock)
        self.machines = StateMachines(client, motion, clock, self.speed)
        self.before_step: Report = lambda step: None
        self.when_ready: Callable[[], None] = lambda: None
        self.only_if_ready = False
        self.misdirected: Mapping[Side, Message] = {}
        self._reports = [report]
        self._warn = warn or report
        self._arms = arms
        self._is_checked = False
        self._addresses: Mapping[Side, EgmAddress] | None = None
        self._remarks: list[Message] = []
        self._reported_remarks: list[Message] = []

    def step(self, name: str) -> None:
        """Report a step that is about to be done; raises what :attr:`before_step` raises."""
        for report in tuple(self._reports):
            report(name)
        self.before_step(name)

    @contextmanager
    def reporting(self, report: Report) -> Iterator[None]:
        """Give ``report`` the name of each step, too, within the block."""
        self._reports.append(report)
        try:
            yield
        finally:
            self._reports.remove(report)

    def note(self, text: str) -> None:
        """Log what is not a step."""
        self._reports[0](text)

    def check_controller(self, addresses: Mapping[Side, EgmAddress] | None = None) -> None:
        """Check what can never be repaired from here; what is only odd is reported with the next step.

        Args:
            addresses: where each arm's datagrams are awaited, to be compared with the controller's; None: as before.

        Raises:
            RobotNotReady: RobotWare is too old, or an option, the RAPID program, an arm or its device is missing.
        """
        self._addresses = addresses or self._addresses
        checks = LaunchChecks(self.client, self._addresses)
        checks.run()
        self.machines.read_tools()
        self._is_checked = True
        self.misdirected = checks.misdirected
        self._remarks = [remark for remark in checks.remarks if remark not in self._reported_remarks]

    def check_program(self) -> None:
        """See that the program is in both tasks: it may have been changed at the FlexPendant. Raises RobotNotReady."""
        LaunchChecks(self.client).check_tasks()

    def report_remarks(self) -> None:
        """Warn of what the check has found to be odd, once each."""
        for remark in self._remarks:
            self._warn(str(remark))
            for report in self._reports[1:]:
                report(str(remark))
        self._reported_remarks += self._remarks
        self._remarks = []

    def make_ready(self) -> None:
        """Motors on, program running, both state machines idle.

        Raises:
            RobotNotReady: a step was not done in time, or is needed with :attr:`only_if_ready`; the message says which
                and what to do.
        """
        for step in self.check_named():
            self.step(step.name)
            step.do()
        self.when_ready()

    def check_named(self) -> Sequence[Step]:
        """What :meth:`make_ready` will do; raises RobotNotReady as that does before its first step."""
        if not self._is_checked:
            self.check_controller()
        self.report_remarks()
        state = self.panel.state()
        check_request(ConditionalRequest.BRING_UP, state)
        steps = self._steps(state)
        if steps and self.only_if_ready:
            raise RobotNotReady(message("bring_up_not_named", steps=tuple(step.name for step in steps)))
        return steps

    def steps_to_ready(self) -> list[str]:
        """What :meth:`make_ready` will do to the robot as it is now, in words; nothing where it will be refused."""
        state = self.panel.state()
        if state.operating_mode is not OperatingMode.AUTO or unmet(NO_STOP, state):
            return []
        return [step.name for step in self._steps(state)]

    def _steps(self, state: RobotState) -> list[Step]:
        steps = []
        if state.controller_state is not ControllerState.MOTORS_ON:
            steps.append(Step("switch the motors on", self.panel.switch_motors_on))
        is_running, machines = state.execution is ExecutionState.RUNNING, set(self.machines.states().values())
        if is_running and MachineState.RUN_EGM_ROUTINE in machines:
            steps.append(Step("end the EGM motion that runs (the arms come to rest)", self._end_foreign_egm))
        elif not is_running or machines != {MachineState.IDLE}:
            steps += self._steps_to_restart(is_running=is_running)
        return steps

    def _steps_to_restart(self, *, is_running: bool) -> list[Step]:
        def start() -> None:
            self.panel.start_rapid()
            self.machines.wait_for_idle(OBEY_TIMEOUT)

        stop = [Step(STOP_PROGRAM, self.panel.stop_rapid)] if is_running else []
        to_main = Step("move the program pointers to main", self.panel.move_pp_to_main)
        return [*stop, to_main, Step("start the RAPID program", start)]

    def _end_foreign_egm(self) -> None:
        """End a motion that another program has left behind, gently if it obeys."""
        with suppress(RobotNotReady):
            self.machines.stop_egm()
        if not self.machines.are_idle:
            for step in self._steps_to_restart(is_running=self.panel.is_running):
                self.step(step.name)
                step.do()

    def start_egm(self, arms: Sequence[Side] | None = None) -> None:
        """Write the EGM settings and start EGM joint motion; where EGM runs already it goes on.

        Args:
            arms: which arms; None takes those of the bring-up.

        Raises:
            RobotNotReady: an arm did not start.
        """
        chosen = tuple(arms) if arms else self._arms
        self.step(f"start EGM on {arms_in_words(chosen)}")
        self.machines.start_egm(chosen)

    def stop_egm(self) -> None:
        """Stop EGM; both arms come to rest. A program that is stopped has ended it already.

        Raises:
            RobotNotReady: an arm did not become idle.
        """
        if self.panel.is_running:
            self.step("stop EGM")
            self.machines.stop_egm()
