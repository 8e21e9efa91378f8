"""The virtual IRC5: mode, motors, RAPID execution, tasks, signals, events, and the arms they move."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import PurePosixPath

from abb_protocols.errors import SettingsError
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import CollisionState, ControllerState, EventType, OperatingMode
from virtual_irc5.controller.file_store import FileStore
from virtual_irc5.controller.identity import Identity, OwnSettings
from virtual_irc5.controller.installed_system import DELIVERED_FILES, USER_MODULE, System, is_user_module, modules_of
from virtual_irc5.controller.jobs import Jobs
from virtual_irc5.controller.rapid_devices import rapid_devices
from virtual_irc5.controller.signals import DRIVE_SIGNALS, Signals
from virtual_irc5.controller.task_settings import TaskSettings, event_routines, task_settings
from virtual_irc5.controller.tasks import InstalledTask, RapidExecution, TaskHost
from virtual_irc5.controller_log import ControllerEventLog, RefusalReason, Refused
from virtual_irc5.instructions.multimove import SyncPoints
from virtual_irc5.instructions.robot_data import JointTarget, jointtarget
from virtual_irc5.instructions.robot_library import robot_library
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.contacts import Contact
from virtual_irc5.mechanics.egm_client import EgmOutcome
from virtual_irc5.mechanics.units import ArmUnit, MechanicalUnit, UnitsState
from virtual_irc5.rapid.pauses import StepKind
from virtual_irc5.rapid.program import Program
from virtual_irc5.rapid.states import Execution, SystemEvent
from virtual_irc5.rapid.task import MOST_RETRIES, Task
from virtual_irc5.system_parameters import SystemConfiguration

_log = logging.getLogger(__name__)

_RESTART_DELAY = 0.2
"""The controller still answers for this time after a restart was requested [s]."""

RESTART_TIME = 20.0
"""How long nothing answers during a restart [s]."""

_NOT_LOADED = 40228
"""Number of the event about a module of the configuration that is missing or is not RAPID; ABB's own is not known."""

_STOPPED_BY_SAFETY = (
    ControllerState.GUARD_STOP,
    ControllerState.EMERGENCY_STOP,
    ControllerState.SYSTEM_FAILURE,
)
# What the controller does when EGM fails: the state of its motors afterwards, if they go off, and what it logs.
_EGM_FAILURES: Mapping[EgmOutcome, tuple[ControllerState | None, tuple[int, str]]] = {
    EgmOutcome.COMM_TIMEOUT: (None, (41822, "No data from the UdpUc device")),
    EgmOutcome.OUT_OF_BOUNDS: (ControllerState.MOTORS_OFF, (50027, "EGM input out of bounds")),
    EgmOutcome.OVERLOADED: (ControllerState.MOTORS_OFF, (50375, "Dynamic load too high")),
    EgmOutcome.SYSTEM_FAILURE: (ControllerState.SYSTEM_FAILURE, (10014, "System failure state")),
}
_RAPID_MODES = {  # what OpMode() gives: OP_AUTO, OP_MAN_PROG, OP_MAN_TEST
    OperatingMode.AUTO: 1,
    OperatingMode.MANUAL_REDUCED: 2,
    OperatingMode.MANUAL_FULL: 3,
}
_MODE_EVENTS = {
    OperatingMode.AUTO: (10017, "Automatic mode confirmed"),
    OperatingMode.MANUAL_REDUCED: (10015, "Manual mode selected"),
    OperatingMode.MANUAL_FULL: (10016, "Manual full speed mode selected"),
}


class Irc5:
    """The controller; a request it cannot fulfil raises :class:`Refused` and changes nothing.

    It starts as a controller does after power-up in AUTO: motors off, RAPID stopped, the program loaded and the
    program pointers at main.

    Args:
        arms: the arms with what belongs to them.
        system: system parameters, files, and the modules of each task.
        configuration: the system parameters, as they are after the addresses were changed.
        identity: names, version and options.
        start_time: what its clock shows at first [s]; seconds since 1970 where people read it.

    Attributes:
        identity: names, version and options.
        mode: position of the mode selector.
        controller_state: state of motors and safety chain.
        speed_ratio: speed override of RAPID motions, 0 to 100 [%].
        time: the controller's clock [s].
        files: the file store.
        collision_state: state of the collision detection.
        is_restarting: whether a warm restart is under way: nothing answers.
        units: the mechanical units.
        events: the event log.
        signals: the I/O system.
        execution: the RAPID tasks and whether they run.
        configuration: the system parameters as clients read and change them.
        effective: those that are in use: as they were when the controller started.
        devices: what RAPID programs find: files, network, FlexPendant, message queues.
        installed: the parameters the controller was installed with; an installation restart (istart) returns to them.
        started_at: when it has started last, on its clock [s].
        energy_reset_at: when its counter of energy was reset [s].
        jobs: work that takes its time.
        own_settings: language, clock, network and the like.
        motion: what ``/rw/motionsystem`` shows and sets beside the mechanical units.
    """

    def __init__(
        self,
        arms: Sequence[ArmUnit],
        system: System,
        configuration: SystemConfiguration,
        identity: Identity | None = None,
        start_time: float = 0.0,
    ) -> None:
        self.identity = identity or Identity()
        self.mode = OperatingMode.AUTO
        self.controller_state = ControllerState.MOTORS_OFF
        self.speed_ratio = 100
        self.time = start_time
        self.files = FileStore({**DELIVERED_FILES, **system.files}, lambda: self.time)
        self.collision_state = CollisionState.INIT
        self._collided: set[Side] = set()
        self.is_restarting = False
        self.started_at = self.energy_reset_at = start_time
        self.jobs = Jobs()
        self.own_settings = OwnSettings()
        self.motion = UnitsState()
        self._discards_programs = False
        self._programs: dict[str, tuple[Program, int]] = {}
        self._program_names: dict[str, str] = {}
        self._restart_left = 0.0
        self._restart_time = RESTART_TIME
        self.units: tuple[MechanicalUnit, ...] = system.robot.units
        self.events = ControllerEventLog(lambda: self.time)
        self.signals = Signals((), self._signal_changed)
        self.signals.configure(configuration)
        self._report_rejected_signals()
        self._system = system
        self.configuration = configuration
        self.effective, self.installed = configuration.copy(), configuration.copy()
        self._arms = {unit.side: unit for unit in arms}
        for unit in arms:
            unit.led = self.motion.lead_through
        self._speed_limiters = self._inputs_of_speed_limits()
        self._requests: deque[tuple[str, str]] = deque()  # of system inputs: action and first argument
        self._gripper_signals: dict[Side, Mapping[str, int]] = {}
        self._is_copying = False
        self._sync_points = SyncPoints()
        self.execution = RapidExecution(
            self._tasks(system),
            self.events,
            halt=lambda reason: self._switch_motors_off(ControllerState.MOTORS_OFF, reason),
        )
        self.devices = rapid_devices(
            self.files,
            self.effective,
            self.signals,
            self.identity,
            system.robot,
            self.events,
            now=lambda: self.time,
            tasks=lambda: self.tasks,
            restart=self.restart,
        )
        movers = {each.unit.side: name for name, each in self.execution.installed.items() if each.unit is not None}
        self.units = tuple(replace(unit, task=movers.get(unit.side, unit.side.task)) for unit in self.units)
        self._outputs = self._system_outputs()
        for task in self.tasks.values():
            task.host.devices = self.devices
        if any(each.has_program for each in self.execution.installed.values()):  # from the factory there is none
            try:
                self.execution.move_pp_to_main()
            except Refused as refused:  # what does not fit can be mended over RWS
                self.events.append(40228, "Execution error", str(refused), EventType.ERROR)
                _log.warning("%s", refused)
        self.execution.start_background()
        self.supervise()

    # What clients read

    @property
    def is_running(self) -> bool:
        """Whether RAPID runs."""
        return self.execution.is_running

    @property
    def has_closed_run_chain(self) -> bool:
        """Whether nothing keeps the motors off; in manual mode the enabling device closes the chain with the motors."""
        if self.controller_state is ControllerState.MOTORS_ON:
            return True
        return self.mode is OperatingMode.AUTO and self.controller_state not in _STOPPED_BY_SAFETY

    @property
    def cycle(self) -> str:
        """What RAPID does at the end of main, in the words of RWS."""
        return self.execution.cycle

    @property
    def tasks(self) -> Mapping[str, Task]:
        """The RAPID tasks by name, in the order of their declarations: on a YuMi the right arm's first."""
        return self.execution.tasks

    @property
    def screens(self) -> Mapping[str, tuple[str, ...]]:
        """The lines each task wrote to the FlexPendant, oldest first."""
        return {name: tuple(each.host.lines) for name, each in self.execution.installed.items()}

    def joint_target(self, unit: str) -> JointTarget:
        """Position of the arm that ``unit`` belongs to, as RAPID's jointtarget [deg].

        Raises:
            Refused: UNKNOWN.
        """
        found = next((one for one in self.units if one.name.upper() == unit.upper()), None)
        if found is None:
            raise Refused(RefusalReason.UNKNOWN, f"there is no mechanical unit {unit}.")
        return jointtarget(self._arms[found.side].arm.position)

    def program_changes(self, task: str) -> int:
        """How often the program of a task has changed since it was asked first: modules loaded and unloaded."""
        program = self.tasks[task].program
        known, count = self._programs.get(task, (program, 0))
        self._programs[task] = (program, count + (known is not program))
        return self._programs[task][1]

    def program_name(self, task: str) -> str:
        """The name of a task's program."""
        return self._program_names.get(task, "program")

    def name_program(self, task: str, name: str) -> None:
        """Give a task's program a name."""
        self._program_names[task] = name

    def arm_of(self, unit: MechanicalUnit) -> VirtualArm:
        """The arm that a mechanical unit belongs to."""
        return self._arms[unit.side].arm

    def program_loaded(self, task: str) -> None:
        """Another program has been loaded into a task: its event routines of RESET run."""
        self.tasks[task].begin_event(SystemEvent.RESET)

    # What clients ask for

    def set_motors(self, on: bool) -> None:
        """Switch the motors of all arms; switching them off stops RAPID.

        Raises:
            Refused: WRONG_MODE outside AUTO, EMERGENCY_STOP while a stop is active.
        """
        if not on:
            if self.controller_state is ControllerState.MOTORS_ON:
                self._switch_motors_off(ControllerState.MOTORS_OFF, "Motors off on request.")
            return
        self._check_auto("switching the motors on needs the enabling device")
        if self.controller_state in _STOPPED_BY_SAFETY:
            state = self.controller_state.value
            raise Refused(
                RefusalReason.EMERGENCY_STOP, f"the motors stay off in state {state}: release the stop first."
            )
        if self.controller_state is ControllerState.MOTORS_ON:
            return
        self.controller_state = ControllerState.MOTORS_ON
        for unit in self._arms.values():
            unit.arm.switch_motors_on()
        self.events.append(10011, "Motors ON", "The motors are on.")

    def start_rapid(self, cycle: str = "", step: StepKind | None = None, *, stop_at_breakpoints: bool = False) -> None:
        """Start all selected tasks from their program pointers.

        Args:
            cycle: "once" or "forever" from now on; empty leaves it as it is.
            step: execute one step only.
            stop_at_breakpoints: whether they stop at breakpoints.

        Raises:
            Refused: WRONG_MODE, MOTORS_OFF, ALREADY_RUNNING or NO_PROGRAM_POINTER.
        """
        self._check_auto("starting RAPID needs the start button")
        self.acknowledge_collision()
        if self.controller_state is not ControllerState.MOTORS_ON:
            raise Refused(RefusalReason.MOTORS_OFF, "RAPID starts with motors on only: switch them on first.")
        self.execution.start(cycle, step, stop_at_breakpoints=stop_at_breakpoints)

    def stop_rapid(self) -> None:
        """Stop all NORMAL tasks, and the arms whatever moves them."""
        self.execution.stop("RAPID has been stopped on request.")

    def move_pp_to_main(self) -> None:
        """Set the program pointers of all selected tasks to main; all variables are initialized.

        Raises:
            Refused: WRONG_MODE or NOT_STOPPED.
        """
        self._check_auto("moving the program pointer needs the FlexPendant")
        self.execution.move_pp_to_main()

    def set_speed_ratio(self, percent: int) -> None:
        """Set the speed override of RAPID motions; it counts at once.

        Raises:
            Refused: WRONG_MODE or OUT_OF_RANGE.
        """
        self._check_auto("the speed ratio is set on the FlexPendant")
        if not 0 <= percent <= 100:
            raise Refused(RefusalReason.OUT_OF_RANGE, f"a speed ratio is 0 to 100 %, not {percent} %.")
        self.speed_ratio = percent
        self.events.append(10140, "Speed adjusted", f"The speed override is {percent} %.")

    def load_module(self, task: str, path: str, *, replace: bool) -> None:
        """Load a file of the file store as a module of ``task``.

        Raises:
            Refused: NOT_STOPPED, NO_FILE, BAD_PROGRAM when it is not RAPID or does not fit, NAME_TAKEN.
        """
        if self.files.get_file(path).content is None:
            raise Refused(RefusalReason.NO_FILE, f"{path} is a directory.")
        self.execution.load_module(task, self.files[path], path, replace=replace)

    def replace_program(self, files: Mapping[str, str]) -> None:
        """Load another program into the motion tasks, or that of the configuration when ``files`` is empty.

        The module `user` stays where the program does not bring one.
        """
        self.execution.stop("Another program is loaded.")
        self.files.update(files)
        listed = self.configuration.instances("SYS", "CAB_TASK_MODULES")
        configured = [module.attributes["File"] for module in listed]
        kept = [] if any(map(is_user_module, files.values())) else [each for each in configured if each == USER_MODULE]
        paths = [*kept, *files] if files else configured
        self.execution.replace_program({path: self.files[path] for path in paths})

    def acknowledge_collision(self) -> None:
        """Reset the state of the collision detection."""
        self.collision_state = CollisionState.INIT
        self._collided.clear()

    def restart(
        self, duration: float = RESTART_TIME, *, discards_programs: bool = False, discards_settings: bool = False
    ) -> None:
        """Restart: soon nothing answers for ``duration`` [s]; then motors are off, RAPID is stopped.

        Programs, program pointers, variables and files stay; EGM's identities and virtual signals do not. System
        parameters that have been changed take effect. Nothing happens while a restart is under way.

        Args:
            duration: how long nothing answers [s]; infinite where the controller is shut down.
            discards_programs: whether the tasks begin with the modules of the configuration again (pstart).
            discards_settings: whether the system parameters become those of the installation again (istart).
        """
        if self._restart_left <= 0.0:
            self._restart_left, self._restart_time = _RESTART_DELAY, duration
            self._discards_programs = discards_programs
            if discards_settings:
                self.configuration.become(self.installed)

    def settle(self) -> None:
        """Run the interrupts that are due, so that the effects of a write can be read at once."""
        self.execution.advance(0.0)

    # What happens to it

    def press_emergency_stop(self) -> None:
        """An emergency stop is pressed: brakes, motors off, RAPID stops."""
        self._switch_motors_off(ControllerState.EMERGENCY_STOP, "An emergency stop is pressed.")

    def release_emergency_stop(self) -> None:
        """The button is pulled out; motors on resets the stop."""
        if self.controller_state is ControllerState.EMERGENCY_STOP:
            self.controller_state = ControllerState.EMERGENCY_STOP_RESET

    def reset_emergency_stop(self) -> None:
        """Acknowledge an emergency stop whose button has been pulled out; the motors stay off.

        Raises:
            Refused: EMERGENCY_STOP.
        """
        if self.controller_state is not ControllerState.EMERGENCY_STOP_RESET:
            state = self.controller_state.value
            sentence = f"an emergency stop is reset once its button is pulled out; the state is {state}."
            raise Refused(RefusalReason.EMERGENCY_STOP, sentence)
        self.controller_state = ControllerState.MOTORS_OFF

    def select_mode(self, mode: OperatingMode) -> None:
        """The mode selector is turned: motors off, RAPID stops."""
        if mode is not self.mode:
            if self.controller_state is ControllerState.MOTORS_ON:
                self._switch_motors_off(ControllerState.MOTORS_OFF, "The operating mode has been changed.")
            self.mode = mode
            self.events.append(*_MODE_EVENTS[mode])

    def supervises_motion(self, side: Side) -> bool:
        """Whether a collision of an arm is noticed: its motors are on, and its motion supervision is (MotionSup)."""
        unit, is_on = self._arms[side], self.controller_state is ControllerState.MOTORS_ON
        supervision = self.motion.supervision.get(unit.mechanical_unit)
        if self.is_running:
            return is_on and unit.settings.supervision is not None and (supervision is None or supervision.path)
        return is_on and (supervision is None or supervision.jogging)

    def collide(self, side: Side, met: str = "something") -> None:
        """An arm collides: motion supervision stops RAPID and both arms; the motors stay on (reference/yumi.md §3).

        Args:
            side: which arm.
            met: what it has met, as it is shown.
        """
        if self._arms[side].contact is not None:
            self._arms[side].contact = Contact.MADE
            return
        self.collision_state = CollisionState.TRIGGERED
        self._collided.add(side)
        unit = self._arms[side].mechanical_unit
        name = self._arms[side].arm.kinematics.name
        sentence = f"Motion supervision triggered for {unit}: the {name} has met {met}."
        self.events.append(50204, "Motion supervision", sentence, EventType.ERROR, arguments=(unit,))
        if self.is_running:
            self.execution.stop(sentence)
            return
        for each in self._arms.values():  # that are jogged
            each.arm.stop()

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass for the tasks; the world advances arms and grippers."""
        self.time += dt
        self.jobs.advance(dt)
        while self._requests:
            self._do_requested(*self._requests.popleft())
        if self._restart_left > 0.0:
            self._restart_left -= dt
            if self._restart_left <= 0.0 and self.is_restarting:
                self.is_restarting = False
                self.execution.abandon_events()
                self._use_configuration()
                self.execution.start_background(is_restart=True)
                self.events.append(10045, "System restarted", "The system that was installed has been restarted.")
            elif self._restart_left <= 0.0:  # from now on nothing answers
                self.is_restarting = True
                self.execution.stop_background()
                self._restart_left = self._restart_time
                if self.controller_state in (ControllerState.MOTORS_ON, ControllerState.SYSTEM_FAILURE):
                    self._switch_motors_off(ControllerState.MOTORS_OFF, "The controller is restarted.")
                for unit in self._arms.values():
                    unit.forget_egm()
                self.signals.restore_defaults()
                self._gripper_signals.clear()
                self.acknowledge_collision()
        for unit in self._arms.values():
            unit.override_speed(self.speed_ratio)
        self.execution.advance(dt)

    def supervise(self) -> None:
        """Follow what happened to the arms: their signals, and failures of EGM that stop everything."""
        for signal, holds in self._outputs:
            self.signals.drive(signal, float(holds()))
        for unit in self._arms.values():
            unit.observe()
            for code, title, sentence in unit.faults:
                self.events.append(code, title, sentence, EventType.ERROR)
                self.execution.stop(sentence)
            unit.faults.clear()
            values = unit.gripper.signals()
            if values != self._gripper_signals.get(unit.side):  # in most cycles nothing has changed
                self._gripper_signals[unit.side] = values
                self._is_copying = True
                for name, value in values.items():
                    self._show(f"{name}_{unit.side.name[0]}", float(value))
                self._is_copying = False
            failure = unit.egm.take_failure()
            if failure is None:
                continue
            state, (code, title) = _EGM_FAILURES[failure.outcome]
            self.events.append(code, title, failure.sentence, EventType.ERROR)
            if failure.outcome is EgmOutcome.SYSTEM_FAILURE:
                self.events.append(20192, "EGM reference is not a number", failure.sentence, EventType.ERROR)
            if state is None:
                self.execution.stop(failure.sentence)
            else:
                self._switch_motors_off(state, failure.sentence)

    def _report_rejected_signals(self) -> None:
        for sentence in self.signals.rejected:
            self.events.append(80001, "Cross connection rejected", sentence, EventType.ERROR)

    def _use_configuration(self) -> None:
        """Start with the system parameters as they are: signals, EGM's devices, modules that are listed newly."""
        self.started_at = self.time
        self.effective.become(self.configuration)
        self.signals.configure(self.effective)
        self._report_rejected_signals()
        self._speed_limiters = self._inputs_of_speed_limits()
        self._outputs = self._system_outputs()
        if self._discards_programs:
            for task in self.tasks.values():
                task.lose_pp()
                for module in task.modules:
                    task.unload(module.name)
        for installed in self.execution.installed.values():
            self._configure(installed.task, installed.settings)
            loaded = {PurePosixPath(module.filename).name.lower() for module in installed.task.modules}
            loaded |= {module.name.lower() for module in installed.task.modules}
            for path in modules_of(installed.settings, self._system, self.effective):
                file = PurePosixPath(path)
                if file.name.lower() in loaded or file.stem.lower() in loaded:
                    continue
                try:
                    self.load_module(installed.task.name, path, replace=False)
                except Refused as refused:
                    sentence = f"{installed.task.name}: {refused}"
                    self.events.append(_NOT_LOADED, "Module not loaded", sentence, EventType.ERROR)
        if self._discards_programs:
            self._discards_programs = False
            self._begin_again()

    def _configure(self, task: Task, settings: TaskSettings) -> None:
        """What a task takes from the system parameters at each start."""
        task.event_routines = event_routines(self.effective, settings)
        retries = self.effective.find("SYS", "SYS_MISC", "NoOfRetry")
        value = retries.attributes.get("Value", "") if retries else ""
        task.most_retries = int(value) if value.isdecimal() else MOST_RETRIES

    def _begin_again(self) -> None:
        """Go to main of the programs that have been loaded again."""
        try:
            self.execution.move_pp_to_main()
        except Refused as refused:
            self.events.append(_NOT_LOADED, "No program pointer", str(refused), EventType.ERROR)
        for name in self.tasks:
            self.program_loaded(name)

    def _system_outputs(self) -> tuple[tuple[str, Callable[[], bool]], ...]:
        """The signals that show a state of the controller, each with that state (SYSSIG_OUT).

        What this controller does not follow is in the event log.
        """
        states: Mapping[str, Callable[[], bool]] = {
            "AutoOn": lambda: self.mode is OperatingMode.AUTO,
            "CycleOn": lambda: self.is_running,
            "EmStop": lambda: self.controller_state is ControllerState.EMERGENCY_STOP,
            "MotOffState": lambda: self.controller_state is not ControllerState.MOTORS_ON,
            "MotOnState": lambda: self.controller_state is ControllerState.MOTORS_ON,
            "RunchOk": lambda: self.has_closed_run_chain,
        }
        states = {
            **states,
            "MotorOff": states["MotOffState"],
            "MotorOn": states["MotOnState"],
        }  # that never pulsate here
        of_tasks: Mapping[str, Callable[[InstalledTask], bool]] = {
            "Error": lambda each: each.has_failed,
            "TaskExecuting": lambda each: each.task.execution is Execution.STARTED,
        }
        of_units: Mapping[str, tuple[Callable[[Iterable[bool]], bool], Callable[[MechanicalUnit], bool]]] = {
            "LimitSpeed": (any, lambda unit: self._arms[unit.side].limits_speed),
            "MechUnitActive": (all, lambda unit: unit.is_active),
            "MechUnitNotMoving": (all, lambda unit: self.arm_of(unit).is_stationary),
            "MotSupOn": (all, lambda unit: self.supervises_motion(unit.side)),
            "MotSupTrigg": (any, lambda unit: unit.side in self._collided),
        }
        every_unit = frozenset(unit.name.upper() for unit in self.units)
        found = []
        for output in (each.attributes for each in self.effective.instances("EIO", "SYSSIG_OUT")):
            signal, status, argument = (output.get(name, "") for name in ("Signal", "Status", "Arg1"))
            fault, state = "", states.get(status)
            if signal not in self.signals:
                fault = "there is no such signal"
            elif status in of_tasks:
                named = {argument, output.get("Arg2", "")}  # a task is in Arg2
                tasks = [each for name, each in self.execution.installed.items() if name in named]
                tasks = tasks or [each for each in self.execution.installed.values() if each.is_normal]
                state = partial(_any, tasks, of_tasks[status])
            elif status in of_units and argument.upper() not in (*every_unit, ""):
                fault = f"there is no mechanical unit {argument!r} (Arg1); there are {', '.join(sorted(every_unit))}"
            elif status in of_units:
                names = frozenset({argument.upper()}) if argument else every_unit
                state = partial(self._holds_for, names, *of_units[status])
            elif state is None:
                known = ", ".join(sorted({*states, *of_tasks, *of_units}))
                fault = f"this controller does not follow the Status {status!r}, only {known}"
            if state is not None and not fault:
                found.append((signal, state))
            else:
                sentence = f"The system output {signal} of the EIO parameters stays as it is: {fault}."
                self.events.append(80001, "System output rejected", sentence, EventType.WARNING)
        return (*found, *((signal, states["MotOnState"]) for signal in DRIVE_SIGNALS))

    def _holds_for(
        self,
        names: Container[str],
        combined: Callable[[Iterable[bool]], bool],
        holds: Callable[[MechanicalUnit], bool],
    ) -> bool:
        """Whether something holds for the mechanical units of these names, in capitals: for any, or for all."""
        return combined(holds(unit) for unit in self.units if unit.name.upper() in names)

    def _inputs_of_speed_limits(self) -> frozenset[str]:
        """The signals, in lower case, that make speed limits of programs count (SYSSIG_IN)."""
        inputs = [each.attributes for each in self.effective.instances("EIO", "SYSSIG_IN")]
        return frozenset(each.get("Signal", "").lower() for each in inputs if each.get("Action") == "LimitSpeed")

    def _do_requested(self, action: str, argument: str) -> None:
        """What a system input asks for; a refusal is in the event log."""
        try:
            _ACTIONS[action](self, {"CYCLE": "once", "CONT": "forever"}.get(argument.upper(), ""))
        except Refused as refused:
            sentence = f"The system input for {action} was refused: {refused}"
            self.events.append(80001, "System input refused", sentence, EventType.WARNING)

    def _show(self, name: str, value: float) -> None:
        """Drive a signal that the system parameters may leave out."""
        if name in self.signals:
            self.signals.drive(name, value)

    def _signal_changed(self, name: str, old: float, new: float) -> None:
        if name.startswith("hand_") and self.signals.get(name).type.is_output and not self._is_copying:
            unit = next((unit for unit in self._arms.values() if name.endswith(f"_{unit.side.name[0]}")), None)
            if unit is not None:
                unit.gripper.write(name[:-2], int(new))
        if new and not old and not self.is_restarting:
            for each in (each.attributes for each in self.effective.instances("EIO", "SYSSIG_IN")):
                if each.get("Signal", "").lower() == name.lower() and each.get("Action", "") in _ACTIONS:
                    self._requests.append((each["Action"], each.get("Arg1", "")))
        if name.lower() in self._speed_limiters:
            is_limited = any(self.signals.get(each).value for each in self._speed_limiters if each in self.signals)
            for unit in self._arms.values():
                unit.limits_speed = is_limited
                unit.limit_speed()
        self.execution.signal_changed(name, old, new)

    def _switch_motors_off(self, state: ControllerState, reason: str) -> None:
        """The brakes hold the arms before RAPID stops, as on the real controller."""
        were_on = self.controller_state is ControllerState.MOTORS_ON
        self.controller_state = state
        for unit in self._arms.values():
            unit.arm.switch_motors_off()
        is_quick = state is ControllerState.EMERGENCY_STOP
        self.execution.stop(reason, SystemEvent.QSTOP if is_quick else SystemEvent.STOP)
        if state is ControllerState.EMERGENCY_STOP:
            self.events.append(10013, "Emergency stop", reason, EventType.ERROR)
        elif were_on:
            self.events.append(10010, "Motors OFF", reason)

    def _check_auto(self, otherwise: str) -> None:
        if self.mode is not OperatingMode.AUTO:
            raise Refused(
                RefusalReason.WRONG_MODE, f"the controller is in {self.mode.value}: {otherwise}, or select AUTO."
            )

    def _tasks(self, system: System) -> list[InstalledTask]:
        """The tasks of CAB_TASKS with their modules, each with the arm of its mechanical unit group."""
        tasks = []
        settings = task_settings(self.effective)
        units = self._units_of(settings)
        units_of_tasks = {each.name: unit for each in settings if each.is_motion_task and (unit := units[each.name])}
        for name, moved in units_of_tasks.items():
            moved.task = name
        for each in settings:
            unit = units[each.name]
            host = TaskHost(self.signals, self.files, self.events, is_virtual=self.identity.is_virtual)
            library = robot_library(
                unit or next(iter(self._arms.values())),
                configuration=self.effective,
                events=self.events,
                speed_ratio=lambda: self.speed_ratio,
                units=self.units,
                sync_points=self._sync_points,
                is_motion_task=each.is_motion_task and unit is not None,
                robots=tuple(self._arms.values()),
                units_of_tasks=units_of_tasks,
            )
            for name in (other.name for other in settings):
                library.data(f"{name}Id", "taskid", (name,))
            task = Task(each.name, host, library, each.entry)
            self._configure(task, each)
            task.operating_mode = lambda: _RAPID_MODES[self.mode]
            if unit is not None:
                task.in_position = lambda unit=unit: unit.arm.is_stationary  # type: ignore[misc]
            if each.name in units_of_tasks:
                units_of_tasks[each.name].is_started = partial(_is_started, task)
            for path in modules_of(each, system, self.effective):
                try:
                    task.load(host.read_file(path), path.rsplit("/")[-1])
                except FileNotFoundError as error:
                    sentence = f"CAB_TASK_MODULES names a module of {each.name} that is missing: {error}"
                    self.events.append(40228, "Execution error", sentence, EventType.ERROR)
                    _log.warning("%s", sentence)
            tasks.append(InstalledTask(task, each, host, unit))
        return tasks

    def _units_of(self, settings: Sequence[TaskSettings]) -> Mapping[str, ArmUnit | None]:
        """The arm of each task's mechanical unit group, by the task's name.

        A motion task of a group that this robot does not have moves an arm that no other one moves.
        """
        free = list(self._arms.values())
        named = {unit.mechanical_unit: unit for unit in free}
        for each in (each for each in settings if each.is_motion_task and each.robot.upper() in named):
            if named[each.robot.upper()] not in free:
                sentence = f"{each.name} moves {each.robot}, which another task of CAB_TASKS moves already"
                raise SettingsError(f"{sentence}: give it another UseMechanicalUnitGroup, or no MotionTask.")
            free.remove(named[each.robot.upper()])
        units: dict[str, ArmUnit | None] = {}
        for each in settings:
            unit = named.get(each.robot.upper())
            units[each.name] = free.pop(0) if unit is None and each.is_motion_task and free else unit
        return units


def _start_at_main(controller: Irc5, cycle: str) -> None:
    controller.move_pp_to_main()
    controller.start_rapid(cycle)


def _start_with_motors(controller: Irc5, cycle: str) -> None:
    controller.set_motors(True)
    controller.start_rapid(cycle)


def _reset_errors(controller: Irc5, _: str) -> None:
    for each in controller.execution.installed.values():
        each.has_failed = False


# What system inputs ask for, with the run mode they choose ("" leaves it as it is).
_ACTIONS: Mapping[str, Callable[[Irc5, str], None]] = {
    "MotorOn": lambda controller, _: controller.set_motors(True),
    "MotorOff": lambda controller, _: controller.set_motors(False),
    "Start": Irc5.start_rapid,
    "StartMain": _start_at_main,
    "MotOnStart": _start_with_motors,
    "PPMain": lambda controller, _: controller.move_pp_to_main(),
    "Stop": lambda controller, _: controller.stop_rapid(),
    "QuickStop": lambda controller, _: controller.execution.stop("A system input has stopped it.", SystemEvent.QSTOP),
    "SoftStop": lambda controller, _: controller.stop_rapid(),
    "StopInstr": lambda controller, _: controller.stop_rapid(),
    "StopCycle": lambda controller, _: controller.execution.end_after_cycle(),
    "ResetError": _reset_errors,
    "ResetEstop": lambda controller, _: controller.reset_emergency_stop(),
}


def _is_started(task: Task) -> bool:
    return task.execution is Execution.STARTED


def _any(tasks: Sequence[InstalledTask], holds: Callable[[InstalledTask], bool]) -> bool:
    return any(holds(each) for each in tasks)
