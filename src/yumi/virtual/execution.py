"""RAPID execution: the tasks of the virtual controller, started and stopped together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from yumi.egm.messages import RapidState
from yumi.errors import RapidError, RobotNotReady
from yumi.rapid.errors import ModuleNameTaken, RapidReferenceError, UnknownSymbol
from yumi.rapid.host import EventKind, Execution, TaskEvent
from yumi.rapid.task import Task
from yumi.virtual.events import EventLog, EventType
from yumi.virtual.refusal import Refusal, Refused
from yumi.virtual.station import Station
from yumi.virtual.task_host import TaskHost

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
