"""Bringing the robot to where it may move, and back: the answer to "when may the robot move?".

Everything goes over Robot Web Services to the state machine on the robot; each step waits for the state it asked
for, with a deadline, and says what is wrong when it does not come.

What is checked when the driver starts: things that no request can mend, and things that will be missed later.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from yumi.clock import Clock
from yumi.driver.panel import STOPPED_FOR_GOOD, Cabinet
from yumi.driver.speed import SpeedSetting
from yumi.driver.state import Report
from yumi.driver.state_machine import MAIN, EgmMotionSettings, MachineState, StateMachines
from yumi.errors import ControllerRefused, RobotNotReady
from yumi.robot.joints import Side
from yumi.rws import types as rapid_values
from yumi.rws.client import RwsClient
from yumi.rws.replies import SystemInfo
from yumi.rws.types import ControllerState, OperatingMode

OLDEST_ROBOTWARE = (6, 9)
"""EGM for seven axes came with RobotWare 6.09 (reference/statemachine.md §3.5)."""

OPTIONS: Mapping[str, str] = {
    "689-1 Externally Guided Motion (EGM)": "no arm can be guided",
}
"""What the controller must have, and what does not work without.

The programs of two arms need 604-1 MultiMove, with which every YuMi is delivered; that both tasks are there is checked
itself. 623-1 Multitasking and 616-1 PC Interface are not needed.
"""

GRIPPER_PRODUCT = "SmartGripper"

PROGRAM_VERSION = 1.1
"""Of the state machine's interface; see ``controller_files/TRobMain.mod``."""


ANY_ADDRESS = "0.0.0.0"
"""A socket at this address hears what comes to any of this machine's."""


@dataclass(frozen=True, slots=True)
class EgmAddress:
    """Where the robot's datagrams are awaited.

    Attributes:
        host: our address, as the robot shall know it.
        port: UDP port.
    """

    host: str
    port: int


class LaunchChecks:
    """Checks one controller.

    Args:
        client: a connected client.
        addresses: where each arm's datagrams are awaited; left out, the devices are not looked at.

    Attributes:
        remarks: what is not as it should be, but keeps nothing from starting.
    """

    def __init__(self, client: RwsClient, addresses: Mapping[Side, EgmAddress] | None = None) -> None:
        self.remarks: list[str] = []
        self._client = client
        self._addresses = addresses or {}

    def run(self) -> None:
        """Check everything.

        Raises:
            RobotNotReady: something is missing that cannot be mended from here; the message says what and how.
        """
        self.check_program()
        self.check_devices()

    def check_program(self) -> None:
        """See that the controller can move a YuMi by EGM and that the robot-side program is there.

        Raises:
            RobotNotReady: it cannot, or it is not.
        """
        self._check_system(self._client.system())
        for side in Side:
            self.check_unit(side)
        self.check_tasks()

    def check_tasks(self) -> None:
        """See that the robot-side program is in both tasks: of all that is checked, this changes without a restart.

        Raises:
            RobotNotReady: it is not there, or in another version.
        """
        for side in Side:
            self.check_task(side)

    def check_devices(self) -> None:
        """See that the robot's datagrams come here.

        Raises:
            RobotNotReady: an arm has no UDPUC device.
        """
        if self._addresses:
            devices = {each.name: each.attributes for each in self._client.cfg("SIO", "COM_TRP")}
            for side, address in self._addresses.items():
                self._check_device(side, address, devices.get(side.unit, {}))

    def _check_system(self, system: SystemInfo) -> None:
        if tuple(system.robotware[:2]) < OLDEST_ROBOTWARE:
            version = ".".join(map(str, system.robotware))
            raise RobotNotReady(f"The controller runs RobotWare {version}; EGM for a YuMi needs 6.09 or newer.")
        for option, loss in OPTIONS.items():
            if option not in system.options:
                raise RobotNotReady(f"The controller lacks the option {option!r}; without it {loss}.")
        if GRIPPER_PRODUCT not in system.options:
            self.remarks.append(f"the controller lacks the product {GRIPPER_PRODUCT!r}; the hands cannot be used")

    def check_unit(self, side: Side) -> None:
        """See that the controller moves an arm; raises RobotNotReady."""
        try:
            self._client.joint_target(side.unit)
        except ControllerRefused as error:
            raise RobotNotReady(
                f"The controller has no mechanical unit {side.unit}; it does not move a YuMi's {side.word} arm."
            ) from error

    def check_task(self, side: Side) -> None:
        """See that an arm's task has the robot-side program, in its version; raises RobotNotReady."""
        task, remedy = side.task, "load the RAPID modules of this package on it"
        try:
            kind = self._client.symbol_type(task, MAIN, "current_state")
        except ControllerRefused as error:
            raise RobotNotReady(f"Task {task} has no state machine ({MAIN}); {remedy}.") from error
        if kind != "num":
            raise RobotNotReady(f"{task}/{MAIN}/current_state has type {kind}, not num; {remedy}.")
        version = self._version(side)
        if version != PROGRAM_VERSION:
            raise RobotNotReady(
                f"Task {task} has version {version} of the state machine, not {PROGRAM_VERSION}; {remedy}."
            )

    def _version(self, side: Side) -> rapid_values.RapidValue:
        try:
            return rapid_values.decode(self._client.symbol(side.task, MAIN, "VERSION"))
        except ControllerRefused:
            return "unknown"

    def _check_device(self, side: Side, address: EgmAddress, device: Mapping[str, str]) -> None:
        if device.get("Type") != "UDPUC":
            raise RobotNotReady(
                f"The controller has no UDPUC device {side.unit} (Communication, Transmission Protocol); load "
                "SIO.cfg of this package and restart it."
            )
        host, port = device.get("RemoteAdress", ""), device.get("RemotePortNumber", "")
        is_here = address.host in (host, ANY_ADDRESS)
        if not is_here or port != str(address.port):
            self.remarks.append(
                f"the {side.word} arm's datagrams go to {host}:{port}, here they are awaited at "
                f"{address.host}:{address.port}; make the UDPUC device {side.unit} or the settings fit"
            )


STOP_PROGRAM = "stop the RAPID program"
"""The step before a program that runs is begun anew."""

_IDLE_DEADLINE = 5.0

ANNOUNCEMENT = "Bring-up will: "
"""How the line begins that says what will be done to the robot, before the first of it is done."""


class Bringup:
    """Brings one controller to ready, and starts and stops EGM on its arms.

    Args:
        client: a connected client.
        motion: what EGM motions start with.
        clock: where waiting time comes from.
        report: told each step.
        arms: those that EGM shall guide unless told otherwise; the others stand still meanwhile.
        warn: told what is not as it should be, in place of ``report``.
        speed: the factor on all speeds, which the robot's own limit follows.

    Attributes:
        client: the same client.
        speed: as above.
        cabinet: the controller's switches.
        machines: the state machines on it.
        when_ready: called each time the robot has become ready, and before EGM starts: what has to be done with the
            program running and no arm guided.
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
        self.cabinet = Cabinet(client, clock)
        self.machines = StateMachines(client, motion, clock, self.speed)
        self._reports = [report]
        self._warn = warn or report
        self._arms = arms
        self.when_ready: Callable[[], None] = lambda: None
        self._is_checked = False
        self._addresses: Mapping[Side, EgmAddress] | None = None
        self._remarks: list[str] = []
        self._told_remarks: list[str] = []

    def check_controller(self, addresses: Mapping[Side, EgmAddress] | None = None) -> None:
        """Check what can never be mended from here; what is only odd is told with the next step.

        Args:
            addresses: where each arm's datagrams are awaited, to be compared with the controller's; None: as before.

        Raises:
            RobotNotReady: RobotWare is too old, an option or the RAPID program is not there, or an arm or its device.
        """
        self._addresses = addresses or self._addresses
        checks = LaunchChecks(self.client, self._addresses)
        checks.run()
        self._is_checked = True
        self._remarks = [remark for remark in checks.remarks if remark not in self._told_remarks]

    def check_program(self) -> None:
        """Check what somebody may have changed since at the pendant: the program in both tasks.

        Raises:
            RobotNotReady: it is not there, or in another version.
        """
        LaunchChecks(self.client).check_tasks()

    def make_ready(self) -> None:
        """Motors on, program running, both state machines idle.

        Raises:
            RobotNotReady: a step did not reach its state in time; the message says which and what to do.
        """
        if not self._is_checked:
            self.check_controller()
        self.tell_remarks()
        self.cabinet.check_automatic()
        if not self.cabinet.are_motors_on:
            self.report("motors on")
            self.cabinet.switch_motors_on()
        if not self._is_idle():
            self.restart_program()
        self.when_ready()

    def steps_to_ready(self) -> list[str]:
        """What :meth:`make_ready` will do to the robot as it is now, in words; nothing where it will be refused."""
        state, mode = self.client.controller_state(), self.client.operating_mode()
        if mode is not OperatingMode.AUTO or state in STOPPED_FOR_GOOD:
            return []
        steps = [] if state is ControllerState.MOTORS_ON else ["switch the motors on"]
        is_running, machines = self.cabinet.is_running, set(self.machines.states().values())
        if is_running and MachineState.RUN_EGM_ROUTINE in machines:
            steps.append("end the EGM motion that runs (the arms come to rest)")
        elif is_running and machines != {MachineState.IDLE}:
            steps.append("stop the RAPID program")
            is_running = False
        if not is_running:
            steps += ["move the program pointers to main", "start the RAPID program"]
        return steps

    def _is_idle(self) -> bool:
        """Whether the program runs with both machines idle; an EGM motion that was left behind comes to rest gently."""
        if not self.cabinet.is_running:
            return False
        if MachineState.RUN_EGM_ROUTINE in self.machines.states().values():
            with suppress(RobotNotReady):  # the program begins anew then
                self.stop_egm()
        return self.machines.are_idle

    def restart_program(self) -> None:
        """Stop the program, begin it anew at main, and wait until both machines are idle.

        Raises:
            RobotNotReady: a step did not reach its state in time; the message says which and what to do.
        """
        if self.cabinet.is_running:
            self.report(STOP_PROGRAM)
            self.cabinet.stop_rapid()
        self.report("program pointer to main")
        self.cabinet.move_pp_to_main()
        self.report("start the RAPID program")
        self.cabinet.start_rapid()
        self.machines.wait_for_idle(_IDLE_DEADLINE)

    def start_egm(self, arms: Sequence[Side] | None = None) -> None:
        """Write the EGM settings and start EGM joint motion; an arm that EGM guides already goes on.

        Args:
            arms: which arms; None takes those of the bring-up.

        Raises:
            RobotNotReady: an arm did not begin.
        """
        chosen = tuple(arms) if arms else self._arms
        self.report(f"start EGM on {'both arms' if len(chosen) > 1 else f'the {chosen[0].word} arm'}")
        self.machines.start_egm(chosen)

    def stop_egm(self) -> None:
        """Stop EGM; both arms come to rest. A program that is stopped has ended it by itself.

        Raises:
            RobotNotReady: an arm did not become idle.
        """
        if self.cabinet.is_running:
            self.report("stop EGM")
            self.machines.stop_egm()

    def state(self, side: Side) -> MachineState:
        """The state machine of one arm."""
        return self.machines.state(side)

    def report(self, step: str) -> None:
        """Tell one step to everybody who wants to know."""
        for report in self._reports:
            report(step)

    def tell_remarks(self) -> None:
        """Warn of what the check has found to be odd, once each."""
        for remark in self._remarks:
            self._warn(remark)
            for report in self._reports[1:]:
                report(remark)
        self._told_remarks += self._remarks
        self._remarks = []

    def note(self, step: str) -> None:
        """Log what belongs to no change: nobody else who is being told steps is told this."""
        self._reports[0](step)

    @contextmanager
    def telling(self, report: Report) -> Iterator[None]:
        """Have ``report`` told each step, too, within the block."""
        self._reports.append(report)
        try:
            yield
        finally:
            self._reports.remove(report)
