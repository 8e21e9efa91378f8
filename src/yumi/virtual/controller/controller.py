"""The virtual IRC5: mode, motors, RAPID execution, tasks, signals, events, and the arms they move.

RAPID execution: the tasks of the virtual controller, started and stopped together.

The warm restart of the virtual controller: announced, then dark, then up again; advances by dt.

What a RAPID task of the virtual controller runs on: screen, signals, files.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from enum import Enum, auto
from types import MappingProxyType

from yumi.egm.messages import RapidState
from yumi.errors import RapidError, RobotNotReady
from yumi.rapid.errors import ModuleNameTaken, RapidReferenceError, RapidRuntimeError, UnknownSymbol
from yumi.rapid.host import EventKind, Execution, Severity, TaskEvent
from yumi.rapid.task import Task
from yumi.robot.joints import Side
from yumi.rws.types import CollisionState, ControllerState, OperatingMode
from yumi.virtual.controller.configuration import Configuration, Instance
from yumi.virtual.controller.egm import EgmFailure, EgmOutcome
from yumi.virtual.controller.errors import Refusal, Refused
from yumi.virtual.controller.events import EventLog, EventType
from yumi.virtual.controller.files import FileStore
from yumi.virtual.controller.signals import Signals
from yumi.virtual.controller.station import Station
from yumi.virtual.controller.units import YUMI_UNITS, Identity, MechanicalUnit, SyncPoints
from yumi.virtual.instructions.data import JointTarget, jointtarget
from yumi.virtual.instructions.library import robot_library

_SCREEN_LINES = 200
_NUMBERS: Mapping[Severity, tuple[int, EventType]] = {
    Severity.ERROR: (80001, EventType.ERROR),
    Severity.WARNING: (80002, EventType.WARNING),
    Severity.INFORMATION: (80003, EventType.INFORMATION),
}  # of messages that programs write


class TaskHost:
    """The host of one task.

    Attributes:
        lines: what the task wrote to the FlexPendant, oldest first; it remembers the last few.
        events: why the task stopped by itself, until somebody takes note.
    """

    def __init__(self, signals: Signals, files: Mapping[str, str], log: EventLog, *, is_virtual: bool) -> None:
        self.lines: deque[str] = deque(maxlen=_SCREEN_LINES)
        self.events: deque[TaskEvent] = deque()
        self._signals = signals
        self._files = files
        self._log = log
        self._is_virtual = is_virtual

    def write_text(self, task: str, text: str) -> None:
        self.lines.append(text)

    def write_event(self, task: str, title: str, text: str, severity: Severity) -> None:
        code, type = _NUMBERS[severity]
        self._log.append(code, title, text, type)

    def read_signal(self, name: str) -> float:
        try:
            return self._signals.get(name).value
        except Refused as refused:
            raise KeyError(name) from refused

    def write_signal(self, name: str, value: float) -> None:
        try:
            self._signals.drive(name, value)
        except Refused as refused:
            if refused.reason is Refusal.UNKNOWN:
                raise KeyError(name) from refused
            raise RapidRuntimeError("ERR_ARGVALERR", str(refused)) from refused

    def read_file(self, path: str) -> str:
        try:
            return self._files[path]
        except KeyError as error:
            raise FileNotFoundError(f"there is no file {path}.") from error

    def report(self, task: str, event: TaskEvent) -> None:
        self.events.append(event)

    def is_virtual(self) -> bool:
        return self._is_virtual


_OF_ITS_OWN_TASK = (EventKind.STOP, EventKind.FINISHED)
"""What one task stops for while the others go on."""


class RapidExecution:
    r"""The tasks of all arms; an error, EXIT or a stop of all tasks in one of them stops the others with it.

    Args:
        tasks: the tasks in their order, each with the arm it moves and what it runs on.
        events: the controller's event log.
        halt: switches the motors off and says why (SystemStopAction \Halt).

    Attributes:
        tasks: the tasks by name.
        is_running: whether RAPID runs in any task.
    """

    def __init__(
        self,
        tasks: Sequence[tuple[Task, Station, TaskHost]],
        events: EventLog,
        halt: Callable[[str], None] = lambda reason: None,
    ) -> None:
        self.tasks: Mapping[str, Task] = MappingProxyType({task.name: task for task, _, _ in tasks})
        self.is_running = False
        self._stations = [station for _, station, _ in tasks]
        self._hosts = {task.name: host for task, _, host in tasks}
        self._events = events
        self._halt = halt

    @property
    def screens(self) -> Mapping[str, tuple[str, ...]]:
        """The lines each task wrote to the FlexPendant, oldest first."""
        return {name: tuple(host.lines) for name, host in self._hosts.items()}

    def start(self) -> None:
        """Start all tasks that do not run from their program pointers.

        Raises:
            Refused: ALREADY_RUNNING or NO_PROGRAM_POINTER.
        """
        if all(task.execution is Execution.STARTED for task in self.tasks.values()):
            raise Refused(Refusal.ALREADY_RUNNING, "RAPID is running already.")
        for task in self.tasks.values():
            if task.execution is Execution.UNINITIALIZED:
                raise Refused(Refusal.NO_PROGRAM_POINTER, f"{task.name} has no program pointer: move it to main first.")
        self.is_running = True
        for task in self.tasks.values():
            task.start()
        self._show_in_egm()
        self._events.append(10150, "Program started", "RAPID runs in all tasks.")

    def stop(self, reason: str) -> None:
        """Stop all tasks and bring the arms to a standstill; nothing happens when RAPID is stopped."""
        if not self.is_running:
            return
        self.is_running = False
        for task in self.tasks.values():
            task.stop()
        self._show_in_egm()
        for station in self._stations:
            _bring_to_rest(station)
        self._events.append(10125, "Program stopped", reason)

    def move_pp_to_main(self) -> None:
        """Set the program pointers to main; all variables begin anew.

        Raises:
            Refused: NOT_STOPPED, or NO_PROGRAM_POINTER when a module that was loaded meanwhile does not fit.
        """
        if self.is_running:
            raise Refused(Refusal.NOT_STOPPED, "the program pointer cannot be moved while RAPID runs: stop it first.")
        for task in self.tasks.values():
            try:
                task.move_pp_to_main()
            except RapidReferenceError as error:
                raise Refused(Refusal.NO_PROGRAM_POINTER, f"{task.name} has no program to run: {error}") from error

    def load_module(self, task: str, text: str, path: str, *, replace: bool) -> None:
        """Load a module into ``task``.

        Raises:
            Refused: NOT_STOPPED, NAME_TAKEN or BAD_PROGRAM; the program is as it was.
        """
        self._check_stopped("modules are loaded")
        try:
            self.tasks[task].load(text, path, replace=replace)
        except ModuleNameTaken as error:
            raise Refused(Refusal.NAME_TAKEN, str(error)) from error
        except RobotNotReady as error:
            raise Refused(Refusal.NOT_STOPPED, str(error)) from error
        except RapidError as error:
            raise Refused(Refusal.BAD_PROGRAM, str(error)) from error

    def replace_program(self, texts: Mapping[str, str]) -> None:
        """Load other modules, by their paths, in the place of all; the program pointers go to their main."""
        for task in self.tasks.values():
            task.lose_pp()
            for module in task.modules:
                task.unload(module.name)
            for path, text in texts.items():
                task.load(text, path)
        self.move_pp_to_main()

    def unload_module(self, task: str, name: str) -> None:
        """Remove a module from ``task``.

        Raises:
            Refused: NOT_STOPPED or NO_MODULE.
        """
        self._check_stopped("modules are unloaded")
        try:
            self.tasks[task].unload(name)
        except UnknownSymbol as error:
            raise Refused(Refusal.NO_MODULE, str(error)) from error
        except RobotNotReady as error:
            raise Refused(Refusal.NOT_STOPPED, str(error)) from error

    def _check_stopped(self, what: str) -> None:
        if self.is_running:
            raise Refused(Refusal.NOT_STOPPED, f"{what} while RAPID is stopped: stop it first.")

    def advance(self, dt: float) -> None:
        """Let the tasks run for ``dt`` [s]; 0 runs what is due at once."""
        if not self.is_running:
            return
        for task in self.tasks.values():
            task.advance(dt)
        for name, host in self._hosts.items():
            while host.events:
                self._react(name, host.events.popleft())

    def signal_changed(self, name: str, old: float, new: float) -> None:
        """Pass an edge on to the tasks; those that do not run lose it."""
        for task in self.tasks.values():
            task.signal_changed(name, old, new)

    def _react(self, task: str, event: TaskEvent) -> None:
        if event.kind is EventKind.ERROR:
            place = f"{task}/{event.module}/{event.routine}, line {event.line}"
            self._events.append(40228, "Execution error", f"{place}: {event.sentence}", EventType.ERROR)
        self._show_in_egm()
        reason = f"{task} has stopped: {event.sentence}"
        if event.kind not in _OF_ITS_OWN_TASK or self._none_runs():
            self.stop(reason)
        elif event.kind is EventKind.STOP:
            self._events.append(10125, "Program stopped", reason)
        if event.kind is EventKind.SYSTEM_STOP_BLOCK:
            for each in self.tasks.values():
                each.lose_pp()
        elif event.kind is EventKind.SYSTEM_HALT:
            self._halt(reason)

    def _none_runs(self) -> bool:
        return all(task.execution is not Execution.STARTED for task in self.tasks.values())

    def _show_in_egm(self) -> None:
        """The datagrams of each arm tell whether its own task runs."""
        for task, station in zip(self.tasks.values(), self._stations, strict=True):
            is_started = task.execution is Execution.STARTED
            station.egm.rapid = RapidState.RUNNING if is_started else RapidState.STOPPED


def _bring_to_rest(station: Station) -> None:
    """An arm that EGM guides ramps down as configured; any other motion stops as fast as it can."""
    was_guided = station.arm.egm is not None
    station.egm.abort()
    if not was_guided:
        station.arm.stop()


NOTICE = 0.2
"""The controller still answers so long after a restart was asked for [s]."""

DARKNESS = 20.0
"""How long nothing answers [s]."""


class Turn(Enum):
    """What a restart has come to."""

    NONE = auto()
    DOWN = auto()
    UP = auto()


class Restart:
    """Whether a restart is under way.

    Attributes:
        is_dark: whether the controller is down.
    """

    def __init__(self) -> None:
        self.is_dark = False
        self._left = 0.0
        self._darkness = 0.0

    def order(self, darkness: float = DARKNESS) -> None:
        """Restart soon, and stay dark for so long [s]; nothing happens while a restart is under way."""
        if self._left <= 0.0:
            self._left, self._darkness = NOTICE, darkness

    def advance(self, dt: float) -> Turn:
        """Let ``dt`` [s] pass; what has begun."""
        if self._left <= 0.0:
            return Turn.NONE
        self._left -= dt
        if self._left > 0.0:
            return Turn.NONE
        self.is_dark = not self.is_dark
        self._left = self._darkness if self.is_dark else 0.0
        return Turn.DOWN if self.is_dark else Turn.UP


_STOPPED_BY_SAFETY = (
    ControllerState.GUARD_STOP,
    ControllerState.EMERGENCY_STOP,
    ControllerState.SYSTEM_FAILURE,
)
# What the controller does when EGM fails: the state of its motors afterwards, if they go off, and what it logs.
_EGM_FAILURES: Mapping[EgmOutcome, tuple[ControllerState | None, tuple[tuple[int, str], ...]]] = {
    EgmOutcome.COMM_TIMEOUT: (None, ((41822, "No data from the UdpUc device"),)),
    EgmOutcome.OUT_OF_BOUNDS: (ControllerState.MOTORS_OFF, ((50027, "EGM input out of bounds"),)),
    EgmOutcome.OVERLOADED: (ControllerState.MOTORS_OFF, ((50375, "Dynamic load too high"),)),
    EgmOutcome.SYSTEM_FAILURE: (
        ControllerState.SYSTEM_FAILURE,
        ((10014, "System failure state"), (20192, "EGM reference is not a number")),
    ),
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
        stations: the arms with what belongs to them, in the order of the tasks.
        configuration: the system parameters.
        files: the file store, by path such as ``HOME:/yumi/TRobMain.mod``.
        identity: names, version and options.
        start_time: what its clock shows at first [s]; seconds since 1970 where people shall read it.

    Attributes:
        identity: names, version and options.
        mode: position of the mode selector.
        controller_state: state of motors and safety chain.
        cycle: RWS' word for what RAPID does at the end of main.
        speed_ratio: speed override of RAPID motions, 0 to 100 [%].
        time: the controller's clock [s].
        files: the file store.
        collision_state: what the collision detection has to say.
        units: the mechanical units.
        events: the event log.
        signals: the I/O system.
        execution: the RAPID tasks and whether they run.
    """

    def __init__(
        self,
        stations: Sequence[Station],
        configuration: Configuration,
        files: Mapping[str, str],
        identity: Identity | None = None,
        start_time: float = 0.0,
    ) -> None:
        self.identity = identity or Identity()
        self.mode = OperatingMode.AUTO
        self.controller_state = ControllerState.MOTORS_OFF
        self.cycle = "forever"
        self.speed_ratio = 100
        self.time = start_time
        self.files = FileStore(files, lambda: self.time)
        self.collision_state = CollisionState.INIT
        self._restart = Restart()
        self.units: tuple[MechanicalUnit, ...] = YUMI_UNITS
        self.events = EventLog(lambda: self.time)
        self.signals = Signals.configured(configuration, self._signal_changed)
        self._configuration = configuration
        self._stations = {station.side: station for station in stations}
        self._gripper_signals: dict[Side, dict[str, int]] = {}
        self._is_copying = False
        self._sync_points = SyncPoints()
        tasks = [self._loaded(station) for station in stations]
        self.execution = RapidExecution(tasks, self.events, self._halt)
        self.execution.move_pp_to_main()
        self.supervise()

    # What clients read

    @property
    def is_running(self) -> bool:
        """Whether RAPID runs."""
        return self.execution.is_running

    @property
    def tasks(self) -> Mapping[str, Task]:
        """The RAPID tasks by name, the right arm's first."""
        return self.execution.tasks

    @property
    def screens(self) -> Mapping[str, tuple[str, ...]]:
        """The lines each task wrote to the FlexPendant, oldest first."""
        return self.execution.screens

    def joint_target(self, unit: str) -> JointTarget:
        """Position of the arm that ``unit`` belongs to, as RAPID's jointtarget [deg].

        Raises:
            Refused: UNKNOWN.
        """
        found = next((one for one in self.units if one.name.upper() == unit.upper()), None)
        if found is None:
            raise Refused(Refusal.UNKNOWN, f"there is no mechanical unit {unit}.")
        return jointtarget(self._stations[found.side].arm.position)

    def cfg(self, domain: str, type: str) -> tuple[Instance, ...]:
        """The instances of a configuration type; none when there is no such type."""
        return self._configuration.instances(domain, type)

    # What clients ask for

    def set_motors(self, on: bool) -> None:
        """Switch the motors of both arms; switching them off stops RAPID.

        Raises:
            Refused: WRONG_MODE outside AUTO, EMERGENCY_STOP while a stop is active.
        """
        if on:
            self._switch_motors_on()
        elif self.controller_state is ControllerState.MOTORS_ON:
            self._switch_motors_off(ControllerState.MOTORS_OFF, "Motors off on request.")

    def start_rapid(self) -> None:
        """Start both tasks from their program pointers.

        Raises:
            Refused: WRONG_MODE, MOTORS_OFF, ALREADY_RUNNING or NO_PROGRAM_POINTER.
        """
        self._check_auto("starting RAPID needs the start button")
        self.acknowledge_collision()
        if self.controller_state is not ControllerState.MOTORS_ON:
            raise Refused(Refusal.MOTORS_OFF, "RAPID starts with motors on only: switch them on first.")
        self.execution.start()

    def stop_rapid(self) -> None:
        """Stop both tasks and the arms; nothing happens when RAPID is stopped."""
        self.execution.stop("RAPID has been stopped on request.")

    def move_pp_to_main(self) -> None:
        """Set the program pointers of both tasks to main; all variables begin anew.

        Raises:
            Refused: WRONG_MODE or NOT_STOPPED.
        """
        self._check_auto("moving the program pointer needs the FlexPendant")
        self.execution.move_pp_to_main()

    def set_speed_ratio(self, percent: int) -> None:
        """Set the speed override of RAPID motions; it counts from the next motion on.

        Raises:
            Refused: WRONG_MODE or OUT_OF_RANGE.
        """
        self._check_auto("the speed ratio is set on the FlexPendant")
        if not 0 <= percent <= 100:
            raise Refused(Refusal.OUT_OF_RANGE, f"a speed ratio is 0 to 100 %, not {percent} %.")
        self.speed_ratio = percent
        self.events.append(10140, "Speed adjusted", f"The speed override is {percent} %.")

    def load_module(self, task: str, path: str, *, replace: bool) -> None:
        """Load a file of the file store as a module of ``task``.

        Raises:
            Refused: NOT_STOPPED, NO_FILE, BAD_PROGRAM when it is not RAPID or does not fit, NAME_TAKEN.
        """
        if self.files.get_file(path).content is None:
            raise Refused(Refusal.NO_FILE, f"{path} is a directory.")
        self.execution.load_module(task, self.files[path], path, replace=replace)

    def unload_module(self, task: str, name: str) -> None:
        """Remove a module from ``task``.

        Raises:
            Refused: NOT_STOPPED or NO_MODULE.
        """
        self.execution.unload_module(task, name)

    def replace_program(self, files: Mapping[str, str]) -> None:
        """Somebody loads another program into both tasks, or that of the configuration when ``files`` is empty."""
        self.execution.stop("Another program is loaded.")
        self.files.update(files)
        paths = list(files) or [module.attributes["File"] for module in self.cfg("SYS", "CAB_TASK_MODULES")]
        self.execution.replace_program({path: self.files[path] for path in paths})

    def acknowledge_collision(self) -> None:
        """Somebody has taken note of the latest collision."""
        self.collision_state = CollisionState.INIT

    def restart(self, darkness: float = DARKNESS) -> None:
        """Warm restart: in a moment nothing answers for ``darkness`` [s]; then motors are off, RAPID is stopped.

        Programs, program pointers, variables and files stay; EGM's identities and virtual signals do not.
        """
        self._restart.order(darkness)

    @property
    def is_dark(self) -> bool:
        """Whether it is restarting."""
        return self._restart.is_dark

    def settle(self) -> None:
        """Run the interrupts that are due, so that the effects of a write can be read at once."""
        self.execution.advance(0.0)

    # What happens to it

    def press_emergency_stop(self) -> None:
        """Someone presses an emergency stop: brakes, motors off, RAPID stops."""
        self._switch_motors_off(ControllerState.EMERGENCY_STOP, "An emergency stop is pressed.")

    def release_emergency_stop(self) -> None:
        """The button is pulled out; motors on resets the stop."""
        if self.controller_state is ControllerState.EMERGENCY_STOP:
            self.controller_state = ControllerState.EMERGENCY_STOP_RESET

    def select_mode(self, mode: OperatingMode) -> None:
        """Someone turns the mode selector: motors off, RAPID stops."""
        if mode is not self.mode:
            if self.controller_state is ControllerState.MOTORS_ON:
                self._switch_motors_off(ControllerState.MOTORS_OFF, "The operating mode has been changed.")
            self.mode = mode
            self.events.append(*_MODE_EVENTS[mode])

    def collide(self, side: Side) -> None:
        """An arm meets something: motion supervision stops RAPID and both arms; the motors stay on."""
        self.collision_state = CollisionState.TRIGGERED
        sentence = f"Motion supervision triggered for {side.unit}: the {side.word} arm has met something."
        self.events.append(50204, "Motion supervision", sentence, EventType.ERROR, arguments=(side.unit,))
        self.execution.stop(sentence)

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass for the tasks; the world advances arms and grippers."""
        self.time += dt
        turn = self._restart.advance(dt)
        if turn is Turn.DOWN:
            self._go_down()
        elif turn is Turn.UP:
            self._come_up()
        self.execution.advance(dt)

    def supervise(self) -> None:
        """Follow what happened to the arms: their signals, and faults of EGM that stop everything."""
        for station in self._stations.values():
            self.signals.drive(f"OUTPUT_STATIONARY_{station.side.unit}", float(station.arm.is_stationary))
            self._copy_gripper(station)
            failure = station.egm.take_failure()
            if failure is not None:
                self._stop_for(failure)

    def _go_down(self) -> None:
        """Everything that is not stored is lost."""
        if self.controller_state in (ControllerState.MOTORS_ON, ControllerState.SYSTEM_FAILURE):
            self._switch_motors_off(ControllerState.MOTORS_OFF, "The controller is restarted.")
        for station in self._stations.values():
            station.forget_egm()
        self.signals.restore_defaults()
        self._gripper_signals.clear()
        self.collision_state = CollisionState.INIT

    def _come_up(self) -> None:
        self.events.append(10045, "System restarted", "The system that was installed has been restarted.")

    def _stop_for(self, failure: EgmFailure) -> None:
        """Log what EGM ended with, and stop what has to stop."""
        state, events = _EGM_FAILURES[failure.outcome]
        for code, title in events:
            self.events.append(code, title, failure.sentence, EventType.ERROR)
        if state is None:
            self.execution.stop(failure.sentence)
        else:
            self._switch_motors_off(state, failure.sentence)

    def _copy_gripper(self, station: Station) -> None:
        """What the gripper shows; most cycles bring nothing new."""
        values = station.gripper.signals()
        if values != self._gripper_signals.get(station.side):
            self._gripper_signals[station.side] = values
            self._is_copying = True
            for name, value in values.items():
                self.signals.drive(f"{name}_{station.side.name[0]}", float(value))
            self._is_copying = False

    def _signal_changed(self, name: str, old: float, new: float) -> None:
        if name.startswith("hand_") and self.signals.get(name).type.is_output and not self._is_copying:
            station = next(s for s in self._stations.values() if name.endswith(f"_{s.side.name[0]}"))
            station.gripper.write(name[:-2], int(new))
        self.execution.signal_changed(name, old, new)

    def _switch_motors_on(self) -> None:
        self._check_auto("switching the motors on needs the enabling device")
        if self.controller_state in _STOPPED_BY_SAFETY:
            state = self.controller_state.value
            raise Refused(Refusal.EMERGENCY_STOP, f"the motors stay off in state {state}: release the stop first.")
        if self.controller_state is ControllerState.MOTORS_ON:
            return
        self.controller_state = ControllerState.MOTORS_ON
        for station in self._stations.values():
            station.arm.switch_motors_on()
        self.events.append(10011, "Motors ON", "The motors of both arms are on.")

    def _switch_motors_off(self, state: ControllerState, reason: str) -> None:
        """The brakes hold the arms before RAPID is told, as they do in the cabinet."""
        were_on = self.controller_state is ControllerState.MOTORS_ON
        self.controller_state = state
        for station in self._stations.values():
            station.arm.switch_motors_off()
        self.execution.stop(reason)
        if state is ControllerState.EMERGENCY_STOP:
            self.events.append(10013, "Emergency stop", reason, EventType.ERROR)
        elif were_on:
            self.events.append(10010, "Motors OFF", reason)

    def _halt(self, reason: str) -> None:
        self._switch_motors_off(ControllerState.MOTORS_OFF, reason)

    def _check_auto(self, otherwise: str) -> None:
        if self.mode is not OperatingMode.AUTO:
            raise Refused(Refusal.WRONG_MODE, f"the controller is in {self.mode.value}: {otherwise}, or select AUTO.")

    def _loaded(self, station: Station) -> tuple[Task, Station, TaskHost]:
        """The task of one arm with the modules the configuration lists for it (CAB_TASK_MODULES)."""
        host = TaskHost(self.signals, self.files, self.events, is_virtual=self.identity.is_virtual)
        library = robot_library(
            station,
            configuration=self._configuration,
            events=self.events,
            speed_ratio=lambda: self.speed_ratio,
            units=self.units,
            sync_points=self._sync_points,
        )
        task = Task(station.side.task, host, library)
        task.in_position = lambda: station.arm.is_stationary
        for module in self.cfg("SYS", "CAB_TASK_MODULES"):
            path = module.attributes["File"]
            task.load(host.read_file(path), path.rsplit("/")[-1])
        return task, station, host
