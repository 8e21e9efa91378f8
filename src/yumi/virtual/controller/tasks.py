"""The RAPID tasks of the virtual controller: started and stopped together, each on its screen, signals and files."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from yumi.egm.messages import RapidState
from yumi.errors import RapidError, RobotNotReady
from yumi.rapid.devices import Devices, NoNetwork
from yumi.rapid.errors import ModuleNameTaken, RapidReferenceError, RapidRuntimeError, UnknownSymbol
from yumi.rapid.program import EventKind, Execution, Severity, TaskEvent
from yumi.rapid.task import Task
from yumi.rws.types import EventType
from yumi.virtual.controller.events import EventLog, Refusal, Refused
from yumi.virtual.controller.files import FileStore, RapidDisk
from yumi.virtual.controller.signals import Signals
from yumi.virtual.controller.units import ArmUnit

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
        events: why the task stopped by itself, until they are read.
        devices: disk, network, FlexPendant and so on, which all tasks of a controller share.
    """

    def __init__(self, signals: Signals, files: Mapping[str, str], log: EventLog, *, is_virtual: bool) -> None:
        self.devices = Devices(RapidDisk(FileStore({})), NoNetwork())
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
"""Events that stop one task while the others continue."""


class RapidExecution:
    r"""The tasks of all arms; an error, EXIT or a stop of all tasks in one of them stops the others with it.

    Args:
        tasks: the tasks in their order, each with the arm it moves and what it runs on.
        events: the controller's event log.
        halt: switches the motors off for a reason (SystemStopAction \Halt).

    Attributes:
        tasks: the tasks by name.
        is_running: whether RAPID runs in any task.
    """

    def __init__(
        self,
        tasks: Sequence[tuple[Task, ArmUnit, TaskHost]],
        events: EventLog,
        halt: Callable[[str], None] = lambda reason: None,
    ) -> None:
        self.tasks: Mapping[str, Task] = MappingProxyType({task.name: task for task, _, _ in tasks})
        self.is_running = False
        self._units = [unit for _, unit, _ in tasks]
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
        # An arm under EGM ramps down as configured; any other motion stops as fast as the drives allow.
        for unit in self._units:
            was_under_egm = unit.arm.egm is not None
            unit.egm.abort()
            if not was_under_egm:
                unit.arm.stop()
        self._events.append(10125, "Program stopped", reason)

    def move_pp_to_main(self) -> None:
        """Set the program pointers to main; all variables are initialized.

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
        none_runs = all(task.execution is not Execution.STARTED for task in self.tasks.values())
        if event.kind not in _OF_ITS_OWN_TASK or none_runs:
            self.stop(reason)
        elif event.kind is EventKind.STOP:
            self._events.append(10125, "Program stopped", reason)
        if event.kind is EventKind.SYSTEM_STOP_BLOCK:
            for each in self.tasks.values():
                each.lose_pp()
        elif event.kind is EventKind.SYSTEM_HALT:
            self._halt(reason)

    def _show_in_egm(self) -> None:
        """The datagrams of each arm carry the state of its own task."""
        for task, unit in zip(self.tasks.values(), self._units, strict=True):
            is_started = task.execution is Execution.STARTED
            unit.egm.rapid = RapidState.RUNNING if is_started else RapidState.STOPPED
