"""Bring-up: checks of the controller, the steps to a robot that is ready, EGM's start and stop on it.

All of it goes over Robot Web Services. :class:`Bringup` puts the steps together: :class:`LaunchChecks` of what cannot
be repaired from here, motors and program by the :class:`ControllerPanel`, EGM by the state machines on the robot; RAPID
routines run in those by name (:class:`RapidRoutines`). A step that changes something reads the state first, says what
forbids it (:mod:`yumi.driver.readiness`), and waits with a deadline until it is done.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import isfinite

from yumi.catalogue import Message, message
from yumi.clock import Clock, wait_until
from yumi.driver.readiness import NO_STOP, Request, check_request, unmet
from yumi.driver.robot_state import Report, RobotState, arms_in_words
from yumi.driver.state_machine import (
    MAIN,
    RAPID,
    RUN_RAPID,
    EgmMotionSettings,
    MachineState,
    SpeedSetting,
    StateMachines,
)
from yumi.errors import CommandRefused, ControllerRefused, ProtocolError, RobotNotReady
from yumi.robot.joints import Side
from yumi.rws import types as rapid_values
from yumi.rws.client import RwsClient
from yumi.rws.documents import SystemInfo
from yumi.rws.types import ControllerState, ExecutionState, OperatingMode

ANNOUNCEMENT = "Bring-up will: "
"""How the line begins that says what will be done to the robot, before the first of it is done."""

STOP_PROGRAM = "stop the RAPID program"
"""The step before a program that runs is started anew."""

_OBEY_TIMEOUT = 5.0
"""Longest wait for motors, program or state machines to obey [s]."""

LONGEST_ROUTINE = 300.0
"""Longest wait for the end of a routine [s]; it goes on, only the wait ends."""

OLDEST_ROBOTWARE = (6, 9)
"""EGM for seven axes came with RobotWare 6.09 (reference/statemachine.md §3.5)."""

SINGLE_ARM_YUMI = "IRB 14050"

REQUIRED_OPTIONS: Mapping[str, str] = {"689-1 Externally Guided Motion (EGM)": "EGM can move no arm"}
"""What the controller must have, and what does not work without.

The programs of two arms need 604-1 MultiMove, with which every YuMi is delivered; that both tasks are there is checked
itself. 623-1 Multitasking and 616-1 PC Interface are not needed.
"""

GRIPPER_PRODUCT = "SmartGripper"
"""What the grippers need; the arms move without."""

PROGRAM_VERSION = 1.1
"""Of the state machine's interface; see ``controller_files/TRobMain.mod``."""

ANY_ADDRESS = "0.0.0.0"
"""A socket at this address receives what comes to any of this machine's."""

_RAPID_NAME = re.compile(r"[A-Za-z]\w{0,31}")
_SIGNAL_NAME = re.compile(r"[A-Za-z][\w/]{0,95}")
_FILE_NAME = re.compile(r"[A-Za-z]\w{0,31}\.(mod|sys)", re.IGNORECASE)
_MODULE_DECLARATION = re.compile(r"^\s*MODULE\s+([A-Za-z]\w{0,31})", re.IGNORECASE | re.MULTILINE)
_OUR_MODULES = "trob"  # how those of the state machine begin
_BAD_VALUE, _FORBIDDEN, _UNKNOWN = 400, 403, 404  # status of HTTP
_LITERALS = {"bool": "TRUE", "string": '"text"', "num": "1.5", "dnum": "1.5"}


@dataclass(frozen=True, slots=True)
class EgmAddress:
    """Where the robot's datagrams are awaited: our address as the robot must know it, and the UDP port."""

    host: str
    port: int


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
            RobotNotReady: a step was not done in time; the message says which and what to do.
        """
        if not self._is_checked:
            self.check_controller()
        self.report_remarks()
        state = self.panel.state()
        check_request(Request.BRING_UP, state)
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
            self.machines.wait_for_idle(_OBEY_TIMEOUT)

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


def other_robot(robot: str, units: Sequence[str]) -> str:
    """A robot that is not a YuMi, in a sentence.

    Args:
        robot: ABB's name of it; empty where the controller does not name it.
        units: its mechanical units.
    """
    name = f"an {robot}" if robot else "another robot"
    listed = f"mechanical unit{'s' * (len(units) > 1)} {', '.join(units)}" if units else "no mechanical unit"
    return f"{name} ({listed}), not a YuMi{' with two arms' * (robot == SINGLE_ARM_YUMI)}"


class LaunchChecks:
    """Checks one controller for what no request can repair, and for what will be missed later.

    Args:
        client: a connected client.
        addresses: where each arm's datagrams are awaited; left out, the devices are not checked.

    Attributes:
        remarks: what is not as it should be, but prevents nothing.
        misdirected: those of them that say that an arm's datagrams go elsewhere.
    """

    def __init__(self, client: RwsClient, addresses: Mapping[Side, EgmAddress] | None = None) -> None:
        self.remarks: list[Message] = []
        self.misdirected: dict[Side, Message] = {}
        self._client = client
        self._addresses = addresses or {}

    def run(self) -> None:
        """Check everything.

        Raises:
            RobotNotReady: something is missing that cannot be repaired from here; the message says what and how.
        """
        system = self._client.system()
        self.check_robot(system)
        if tuple(system.robotware[:2]) < OLDEST_ROBOTWARE:
            version = ".".join(map(str, system.robotware))
            raise RobotNotReady(message("robotware_too_old", version=version, oldest="6.09"))
        for option, loss in REQUIRED_OPTIONS.items():
            if option not in system.options:
                raise RobotNotReady(message("option_missing", option=option, loss=loss))
        if GRIPPER_PRODUCT not in system.options:
            self.remarks.append(message("grippers_missing", product=GRIPPER_PRODUCT))
        for side in Side:
            self.check_unit(side)
        self.check_tasks()
        self.check_devices()

    def check_robot(self, system: SystemInfo) -> None:
        """See that the controller moves a YuMi.

        Args:
            system: of the controller.

        Raises:
            RobotNotReady: it moves another robot; the message names the robot and what to use instead.
        """
        units = self._client.mechanical_units()
        if any(side.unit in units for side in Side):
            return
        address = self._client.address
        raise RobotNotReady(message("not_a_yumi", address=address, robot=other_robot(system.robot, units)))

    def check_unit(self, side: Side) -> None:
        """See that the controller moves an arm; raises RobotNotReady."""
        try:
            self._client.joint_target(side.unit)
        except ControllerRefused:
            raise RobotNotReady(message("unit_missing", unit=side.unit, arm=side.word)) from None

    def check_tasks(self) -> None:
        """See that the program is in both tasks: of all that is checked, this changes without a restart."""
        for side in Side:
            self.check_task(side)

    def check_task(self, side: Side) -> None:
        """See that an arm's task has the robot-side program, in its version; raises RobotNotReady."""
        task = side.task
        try:
            kind = self._client.symbol_type(task, MAIN, "current_state")
        except ControllerRefused:
            raise RobotNotReady(message("state_machine_missing", task=task, module=MAIN)) from None
        if kind != "num":
            raise RobotNotReady(message("state_has_wrong_type", task=task, module=MAIN, kind=kind))
        try:
            version = rapid_values.decode(self._client.symbol(task, MAIN, "VERSION"))
        except ControllerRefused:
            version = "unknown"
        if version != PROGRAM_VERSION:
            raise RobotNotReady(
                message("state_machine_of_other_version", task=task, version=str(version), expected=PROGRAM_VERSION)
            )

    def check_devices(self) -> None:
        """See that the robot's datagrams come here; raises RobotNotReady when an arm has no UDPUC device."""
        if not self._addresses:
            return
        devices = {each.name: each.attributes for each in self._client.cfg("SIO", "COM_TRP")}
        for side, address in self._addresses.items():
            device = devices.get(side.unit, {})
            if device.get("Type") != "UDPUC":
                raise RobotNotReady(message("udpuc_device_missing", device=side.unit))
            host, port = device.get("RemoteAdress", ""), device.get("RemotePortNumber", "")
            if address.host not in (host, ANY_ADDRESS) or port != str(address.port):
                self.misdirected[side] = message(
                    "datagrams_go_elsewhere",
                    arm=side.word,
                    there=f"{host}:{port}",
                    here=f"{address.host}:{address.port}",
                    device=side.unit,
                )
                self.remarks.append(self.misdirected[side])


class ControllerPanel:
    """Motors, program, speed ratio, I/O signals and RAPID variables of one controller.

    Signals and variables are text in, text out, as a person gives and reads them.

    Args:
        client: a connected client.
        clock: for waiting.
    """

    def __init__(self, client: RwsClient, clock: Clock) -> None:
        self._client = client
        self._clock = clock

    @property
    def are_motors_on(self) -> bool:
        return self._client.controller_state() is ControllerState.MOTORS_ON

    @property
    def is_running(self) -> bool:
        """Whether the RAPID program runs."""
        return self._client.execution() is ExecutionState.RUNNING

    def state(self) -> RobotState:
        """Mode, motors and program, read now; nothing else of the state is known."""
        client = self._client
        return RobotState(True, client.operating_mode(), client.controller_state(), client.execution())

    def check_automatic(self) -> None:
        """See that requests which change something are accepted at all.

        Raises:
            RobotNotReady: the mode switch is not in AUTO.
        """
        check_request(Request.WRITE, RobotState(True, self._client.operating_mode()))

    def switch_motors_on(self) -> None:
        """Motors on, which also acknowledges an emergency stop that has been released.

        Raises:
            RobotNotReady: not in AUTO, or a stop keeps them off.
        """
        state = self.state()
        check_request(Request.BRING_UP, state)
        if state.controller_state is not ControllerState.MOTORS_ON:
            self._client.set_motors(True)
            wait_until(
                self._clock,
                lambda: self.are_motors_on,
                _OBEY_TIMEOUT,
                lambda: message("motors_stay_off", state=self._client.controller_state().value),
            )

    def switch_motors_off(self) -> None:
        """Motors off; the brakes hold the arms and the program stops.

        Raises:
            RobotNotReady: they stay on.
        """
        if self.are_motors_on:
            self._client.set_motors(False)
            wait_until(self._clock, lambda: not self.are_motors_on, _OBEY_TIMEOUT, message("motors_stay_on"))

    def start_rapid(self) -> None:
        """Start the program where its pointers are.

        Raises:
            RobotNotReady: not in AUTO, motors off, or it does not run.
        """
        state = self.state()
        check_request(Request.START_RAPID, state)
        if state.execution is not ExecutionState.RUNNING:
            self._client.start_rapid()
            self._wait_for(ExecutionState.RUNNING)

    def stop_rapid(self) -> None:
        """Stop the program; the arms come to rest on their paths.

        Raises:
            RobotNotReady: it still runs.
        """
        if self.is_running:
            self._client.stop_rapid()
            self._wait_for(ExecutionState.STOPPED)

    def move_pp_to_main(self) -> None:
        """Program pointers of all tasks to main; all variables get their initial values.

        Raises:
            RobotNotReady: not in AUTO, or the program runs.
        """
        check_request(Request.MOVE_PP, self.state())
        self._client.move_pp_to_main()

    def set_speed_ratio(self, percent: int) -> None:
        """Override of the speeds of RAPID motions, 0 to 100 %; it counts from the next motion on.

        Raises:
            CommandRefused: outside that range.
            RobotNotReady: not in AUTO, or the controller keeps another value.
        """
        self.check_automatic()
        self._client.set_speed_ratio(percent)
        kept = self._client.speed_ratio()
        if kept != percent:
            raise RobotNotReady(message("speed_ratio_not_kept", kept=kept, asked=percent))

    def _wait_for(self, state: ExecutionState) -> None:
        wait_until(
            self._clock,
            lambda: self._client.execution() is state,
            _OBEY_TIMEOUT,
            message("program_does_not_obey", state=state.value, duration=_OBEY_TIMEOUT),
        )

    def read_signal(self, name: str) -> str:
        """The logical value of an I/O signal; raises CommandRefused when the controller has no such signal."""
        return _signal_text(self._signal(name))

    def write_signal(self, name: str, value: str | float) -> None:
        """Set an I/O signal, and see that it keeps the value.

        Raises:
            CommandRefused: no such signal, or no such value; nothing was changed.
            RobotNotReady: not in AUTO, where this controller takes none.
            ControllerRefused: the controller does not let remote clients write it.
        """
        try:
            number = float(value)
        except ValueError as error:
            raise CommandRefused(message("no_number_for_signal", value=value, signal=name)) from error
        if not isfinite(number):
            raise CommandRefused(message("signal_not_finite", signal=name, value=number))
        self._signal(name)
        try:
            self._client.set_signal(name, number)
        except ControllerRefused as error:
            if error.status == _FORBIDDEN:
                self.check_automatic()  # what may be written in AUTO may be forbidden in manual
            if error.status != _BAD_VALUE:
                raise
            raise CommandRefused(message("signal_value_refused", value=_signal_text(number), signal=name)) from error
        kept = self._signal(name)
        if kept != number:
            raise CommandRefused(
                message("signal_not_kept", signal=name, kept=_signal_text(kept), written=_signal_text(number))
            )

    def _signal(self, name: str) -> float:
        if not _SIGNAL_NAME.fullmatch(name):
            raise CommandRefused(message("no_signal_name", name=name))
        try:
            return self._client.signal(name).value
        except ControllerRefused as error:
            if error.status != _UNKNOWN:
                raise
            raise CommandRefused(message("signal_unknown", signal=name)) from error

    def read_variable(self, task: str, module: str, name: str) -> str:
        """The value of a RAPID variable as RAPID writes it; raises CommandRefused when there is none of that name."""
        self._type_of(task, module, name)
        return self._client.symbol(task, module, name)

    def write_variable(self, task: str, module: str, name: str, value: str) -> None:
        """Write a RAPID variable; ``value`` as RAPID writes it: ``1.5``, ``TRUE``, ``"text"``, ``[1,[2,3]]``.

        Raises:
            CommandRefused: there is none of that name, ``value`` is not a RAPID value or not of its type, or it is a
                constant; nothing was changed.
            RobotNotReady: not in AUTO.
        """
        self.check_automatic()
        kind = self._type_of(task, module, name)
        example = _LITERALS.get(kind, "[1,[2,3]]")
        try:
            rapid_values.decode(value)
        except ProtocolError as error:
            raise CommandRefused(
                message(
                    "no_rapid_value", value=value, module=module, variable=name, task=task, kind=kind, example=example
                )
            ) from error
        try:
            self._client.set_symbol(task, module, name, value)
        except ControllerRefused as error:
            if error.status != _BAD_VALUE:
                raise
            raise CommandRefused(
                message(
                    "variable_refused", value=value, module=module, variable=name, task=task, kind=kind, example=example
                )
            ) from error

    def _type_of(self, task: str, module: str, name: str) -> str:
        for word in (task, module, name):
            if not _RAPID_NAME.fullmatch(word):
                raise CommandRefused(message("no_rapid_name", name=word))
        try:
            return self._client.symbol_type(task, module, name)
        except ControllerRefused as error:
            raise CommandRefused(message("variable_unknown", module=module, variable=name, task=task)) from error


def _signal_text(value: float) -> str:
    return str(int(value)) if value.is_integer() else repr(value)


class RapidRoutines:
    """Runs routines in the tasks of both arms, one at a time: both tasks see the edge that starts one.

    Args:
        client: a connected client.
        panel: of the same controller.
        machines: the state machines.
        clock: for waiting.

    Attributes:
        is_running: whether the end of one is awaited.
    """

    def __init__(self, client: RwsClient, panel: ControllerPanel, machines: StateMachines, clock: Clock) -> None:
        self._client = client
        self._panel = panel
        self._machines = machines
        self._clock = clock
        self.is_running = False

    def run(self, side: Side, name: str) -> None:
        """Run a routine in one arm's task and wait for its end.

        Args:
            side: whose task.
            name: of the state machine's own (``runMoveToCalibrationPosition``, ``runMoveJ``, ``runMoveAbsJ``,
                ``runCallByVar``), of your ``TRobSystem``, or of any procedure without parameters in the task.

        Raises:
            CommandRefused: it is not a name of a routine; nothing was changed.
            RobotNotReady: the program does not run, the arm is busy, or the routine did not end in time.
        """
        if not _RAPID_NAME.fullmatch(name):
            raise CommandRefused(message("no_routine_name", name=name))
        self._check_free(side, Request.RUN_ROUTINE)

        def why_not_ended() -> Message:
            code = "routine_not_ended" if self._client.speed_ratio() > 0 else "routine_without_speed"
            return message(code, routine=name, task=side.task, duration=LONGEST_ROUTINE)

        self.is_running = True
        try:
            self._write(side, "routine_name_input", name)
            self._write(side.other, "routine_name_input", "")
            self._client.pulse_signal(RUN_RAPID)
            wait_until(
                self._clock,
                lambda: self._is_over(side),
                LONGEST_ROUTINE,
                why_not_ended,
            )
        finally:
            self.is_running = False
        try:
            is_unknown = self._client.symbol(side.task, RAPID, "is_routine_unknown") == "TRUE"
        except ControllerRefused:  # ABB's own state machine does not report it
            is_unknown = False
        if is_unknown:
            raise CommandRefused(message("routine_unknown", task=side.task, routine=name))

    def load_module(self, side: Side, file_name: str, text: str) -> None:
        """Write a RAPID module into the controller's HOME folder and load it into one arm's task.

        A module that was loaded from the same file before is replaced. The state machine loads it, so that the program
        goes on meanwhile.

        Args:
            side: whose task.
            file_name: such as ``Pick.mod``.
            text: the module.

        Raises:
            CommandRefused: name or text is impossible, the text is not RAPID, or the module is there from another file.
            RobotNotReady: the program does not run, or the arm is busy.
        """
        module = _module_in(file_name, text)
        self._check_free(side, Request.LOAD_MODULE)
        path = f"HOME:/{file_name}"
        if self._has_module(side, module):
            self._run_with_file(side, "runModuleUnload", path)
            if self._has_module(side, module):
                raise CommandRefused(message("module_from_other_file", task=side.task, module=module))
        self._client.upload(path, text)
        self._run_with_file(side, "runModuleLoad", path)
        if not self._has_module(side, module):
            raise CommandRefused(message("module_not_loaded", task=side.task, path=path))

    def _run_with_file(self, side: Side, routine: str, path: str) -> None:
        self._write(side, "module_file_path_input", path)
        self.run(side, routine)

    def _has_module(self, side: Side, name: str) -> bool:
        return any(module.name.lower() == name.lower() for module in self._client.modules(side.task))

    def _check_free(self, side: Side, request: Request) -> None:
        client = self._client
        machines = dict.fromkeys(Side, self._machines.state(side))
        state = RobotState(True, client.operating_mode(), execution=client.execution(), machines=machines)
        check_request(request, state, (side,))

    def _is_over(self, side: Side) -> bool:
        """The name is cleared when the routine has ended, in the same step in which the machine becomes idle."""
        if not self._panel.is_running:
            raise RobotNotReady(message("program_stopped_in_routine", task=side.task))
        if self._client.symbol(side.task, RAPID, "routine_name_input") != '""':
            return False
        return self._machines.state(side) is MachineState.IDLE

    def _write(self, side: Side, symbol: str, value: rapid_values.RapidValue) -> None:
        self._client.set_symbol(side.task, RAPID, symbol, rapid_values.encode(value))


def _module_in(file_name: str, text: str) -> str:
    """The name of the module that ``text`` declares."""
    if not _FILE_NAME.fullmatch(file_name):
        raise CommandRefused(message("no_rapid_file_name", name=file_name))
    found = _MODULE_DECLARATION.search(text)
    if found is None:
        raise CommandRefused(message("text_without_module", file=file_name))
    if found[1].lower().startswith(_OUR_MODULES):
        raise CommandRefused(message("module_name_reserved", module=found[1]))
    return found[1]
