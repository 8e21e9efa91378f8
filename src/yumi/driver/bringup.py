"""Bring-up: checks of the controller, the steps to a robot that is ready, EGM's start and stop on it.

Everything goes over Robot Web Services to the state machine on the robot; each step waits until it is done, with a
deadline, and says what is wrong when it is not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from yumi.clock import Clock
from yumi.driver.panel import ControllerPanel
from yumi.driver.readiness import NO_STOP, Report, Request, RobotState, arms_in_words, check, unmet
from yumi.driver.state_machine import MAIN, EgmMotionSettings, MachineState, SpeedSetting, StateMachines
from yumi.errors import ControllerRefused, RobotNotReady
from yumi.robot.joints import Side
from yumi.rws import types as rapid_values
from yumi.rws.client import RwsClient
from yumi.rws.types import ControllerState, ExecutionState, OperatingMode

OLDEST_ROBOTWARE = (6, 9)
"""EGM for seven axes came with RobotWare 6.09 (reference/statemachine.md §3.5)."""

OPTIONS: Mapping[str, str] = {"689-1 Externally Guided Motion (EGM)": "EGM can move no arm"}
"""What the controller must have, and what does not work without.

The programs of two arms need 604-1 MultiMove, with which every YuMi is delivered; that both tasks are there is checked
itself. 623-1 Multitasking and 616-1 PC Interface are not needed.
"""

GRIPPER_PRODUCT = "SmartGripper"

PROGRAM_VERSION = 1.1
"""Of the state machine's interface; see ``controller_files/TRobMain.mod``."""

ANY_ADDRESS = "0.0.0.0"
"""A socket at this address receives what comes to any of this machine's."""


@dataclass(frozen=True, slots=True)
class EgmAddress:
    """Where the robot's datagrams are awaited: our address as the robot must know it, and the UDP port."""

    host: str
    port: int


class LaunchChecks:
    """Checks one controller for what no request can repair, and for what will be missed later.

    Args:
        client: a connected client.
        addresses: where each arm's datagrams are awaited; left out, the devices are not checked.

    Attributes:
        remarks: what is not as it should be, but prevents nothing.
    """

    def __init__(self, client: RwsClient, addresses: Mapping[Side, EgmAddress] | None = None) -> None:
        self.remarks: list[str] = []
        self._client = client
        self._addresses = addresses or {}

    def run(self) -> None:
        """Check everything.

        Raises:
            RobotNotReady: something is missing that cannot be repaired from here; the message says what and how.
        """
        system = self._client.system()
        if tuple(system.robotware[:2]) < OLDEST_ROBOTWARE:
            version = ".".join(map(str, system.robotware))
            raise RobotNotReady(f"The controller runs RobotWare {version}; EGM for a YuMi needs 6.09 or newer.")
        for option, loss in OPTIONS.items():
            if option not in system.options:
                raise RobotNotReady(f"The controller lacks the option {option!r}; without it {loss}.")
        if GRIPPER_PRODUCT not in system.options:
            self.remarks.append(f"the controller lacks the product {GRIPPER_PRODUCT!r}; the grippers cannot be used")
        for side in Side:
            self.check_unit(side)
        self.check_tasks()
        self.check_devices()

    def check_unit(self, side: Side) -> None:
        """See that the controller moves an arm; raises RobotNotReady."""
        try:
            self._client.joint_target(side.unit)
        except ControllerRefused as error:
            raise RobotNotReady(
                f"The controller has no mechanical unit {side.unit}; it does not move a YuMi's {side.word} arm."
            ) from error

    def check_tasks(self) -> None:
        """See that the program is in both tasks: of all that is checked, this changes without a restart."""
        for side in Side:
            self.check_task(side)

    def check_task(self, side: Side) -> None:
        """See that an arm's task has the robot-side program, in its version; raises RobotNotReady."""
        task, remedy = side.task, "load the RAPID modules of this package on it"
        try:
            kind = self._client.symbol_type(task, MAIN, "current_state")
        except ControllerRefused as error:
            raise RobotNotReady(f"Task {task} has no state machine ({MAIN}); {remedy}.") from error
        if kind != "num":
            raise RobotNotReady(f"{task}/{MAIN}/current_state has type {kind}, not num; {remedy}.")
        try:
            version = rapid_values.decode(self._client.symbol(task, MAIN, "VERSION"))
        except ControllerRefused:
            version = "unknown"
        if version != PROGRAM_VERSION:
            raise RobotNotReady(
                f"Task {task} has version {version} of the state machine, not {PROGRAM_VERSION}; {remedy}."
            )

    def check_devices(self) -> None:
        """See that the robot's datagrams come here; raises RobotNotReady when an arm has no UDPUC device."""
        if not self._addresses:
            return
        devices = {each.name: each.attributes for each in self._client.cfg("SIO", "COM_TRP")}
        for side, address in self._addresses.items():
            device = devices.get(side.unit, {})
            if device.get("Type") != "UDPUC":
                raise RobotNotReady(
                    f"The controller has no UDPUC device {side.unit} (Communication, Transmission Protocol); load "
                    "SIO.cfg of this package and restart it."
                )
            host, port = device.get("RemoteAdress", ""), device.get("RemotePortNumber", "")
            if address.host not in (host, ANY_ADDRESS) or port != str(address.port):
                self.remarks.append(
                    f"the {side.word} arm's datagrams go to {host}:{port}, here they are awaited at "
                    f"{address.host}:{address.port}; make the UDPUC device {side.unit} or the settings fit"
                )


ANNOUNCEMENT = "Bring-up will: "
"""How the line begins that says what will be done to the robot, before the first of it is done."""

STOP_PROGRAM = "stop the RAPID program"
"""The step before a program that runs is started anew."""

_IDLE_DEADLINE = 5.0


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
        self._reports = [report]
        self._warn = warn or report
        self._arms = arms
        self._is_checked = False
        self._addresses: Mapping[Side, EgmAddress] | None = None
        self._remarks: list[str] = []
        self._reported_remarks: list[str] = []

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
        self._remarks = [remark for remark in checks.remarks if remark not in self._reported_remarks]

    def check_program(self) -> None:
        """See that the program is in both tasks: it may have been changed at the FlexPendant. Raises RobotNotReady."""
        LaunchChecks(self.client).check_tasks()

    def report_remarks(self) -> None:
        """Warn of what the check has found to be odd, once each."""
        for remark in self._remarks:
            self._warn(remark)
            for report in self._reports[1:]:
                report(remark)
        self._reported_remarks += self._remarks
        self._remarks = []

    def make_ready(self) -> None:
        """Motors on, program running, both state machines idle.

        Raises:
            RobotNotReady: a step was not done in time; the message says which and what to do.
        """
        if not self._is_checked:
            self.check_controller()
        self.report_remarks()
        state = self.panel.state()
        check(Request.BRING_UP, state)
        for step in self._steps(state):
            self.step(step.name)
            step.do()
        self.when_ready()

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
            self.machines.wait_for_idle(_IDLE_DEADLINE)

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

    def state(self, side: Side) -> MachineState:
        """The state machine of one arm."""
        return self.machines.state(side)
