"""The RAPID tasks of the virtual controller: NORMAL ones start and stop together, the others always run.

Each has its screen; all share signals, files and the persistents of one name.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

from abb_protocols.egm.codec import RapidState
from abb_protocols.errors import RapidError, RobotNotReady
from abb_protocols.rws.values import EventType
from virtual_irc5.controller.file_store import FileStore
from virtual_irc5.controller.rapid_devices import RapidDisk
from virtual_irc5.controller.signals import Signals
from virtual_irc5.controller.task_settings import TaskSettings, TaskType, TrustLevel
from virtual_irc5.controller_log import ControllerEventLog, RefusalReason, Refused
from virtual_irc5.mechanics.units import ArmUnit
from virtual_irc5.rapid.ast import Storage
from virtual_irc5.rapid.devices import Devices, NoNetwork
from virtual_irc5.rapid.pauses import StepKind
from virtual_irc5.rapid.states import EventKind, Execution, Severity, SystemEvent, TaskEvent
from virtual_irc5.rapid.task import Task
from virtual_irc5.rapid.types import (
    UNSET_DATA,
    ModuleNameTaken,
    RapidReferenceError,
    RapidRuntimeError,
    UnknownSymbol,
    Variable,
)

_log = logging.getLogger(__name__)

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
        show: called with the task and each line that it writes.
        line_count: how many lines that were.
        events: why the task stopped by itself, until they are read.
        devices: disk, network, FlexPendant and so on, which all tasks of a controller share.
    """

    def __init__(
        self, signals: Signals, files: Mapping[str, str], log: ControllerEventLog, *, is_virtual: bool
    ) -> None:
        self.devices = Devices(RapidDisk(FileStore({})), NoNetwork())
        self.lines: deque[str] = deque(maxlen=_SCREEN_LINES)
        self.show: Callable[[str, str], None] = lambda task, line: None
        self.line_count = 0
        self.events: deque[TaskEvent] = deque()
        self._signals = signals
        self._files = files
        self._log = log
        self._is_virtual = is_virtual

    def write_text(self, task: str, text: str) -> None:
        self.lines.append(text)
        self.line_count += 1
        self.show(task, text)

    def write_event(self, task: str, title: str, text: str, severity: Severity, arguments: tuple[str, ...]) -> None:
        code, type = _NUMBERS[severity]
        self._log.append(code, title, text, type, arguments=arguments)

    def read_signal(self, name: str) -> float:
        try:
            return self._signals.get(name).value
        except Refused as refused:
            raise KeyError(name) from refused

    def write_signal(self, name: str, value: float) -> None:
        try:
            self._signals.drive(name, value)
        except Refused as refused:
            if refused.reason is RefusalReason.UNKNOWN:
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


_LONGEST_STOP = 60.0
"""How long the arms and the event routines of a stop may take [s]."""

_STOPS = (EventKind.STOP, EventKind.STOP_ALL_TASKS, EventKind.SYSTEM_STOP, EventKind.SYSTEM_HALT)
"""Events that event routines of STOP follow in the task itself: neither errors nor EXIT."""

_OF_ITS_OWN_TASK = (EventKind.STOP, EventKind.FINISHED, EventKind.STEPPED)
"""Events that stop one task while the others continue."""


@dataclass(eq=False, slots=True)
class InstalledTask:
    """A task with what it runs on.

    Attributes:
        task: the task itself.
        settings: what CAB_TASKS says of it.
        host: its screen, signals and files.
        unit: the arm its instructions move, None for a task without.
        is_active: whether the task panel has it selected; tasks that are not are neither started nor stopped.
        has_failed: whether an error has stopped it, until it is started or its program pointer is moved to main.
    """

    task: Task
    settings: TaskSettings
    host: TaskHost
    unit: ArmUnit | None = None
    is_active: bool = True
    has_failed: bool = False

    @property
    def is_normal(self) -> bool:
        return self.settings.type is TaskType.NORMAL

    @property
    def has_program(self) -> bool:
        """Whether there is more in it than system modules: it has, or should have, an entry routine."""
        has_entry = self.task.program.find(self.task.entry, None) is not None
        return has_entry or any(not module.is_system for module in self.task.modules)


@dataclass(slots=True)
class _Stop:
    """A stop whose event routines have not been executed yet.

    Attributes:
        reason: why RAPID stops, for the event log.
        event: STOP or QSTOP.
        tasks: those that it has stopped.
        have_begun: whether the arms stand still, so that the routines are being executed.
        left: of the time it may take [s].
    """

    reason: str
    event: SystemEvent
    tasks: Sequence[InstalledTask]
    have_begun: bool = False
    left: float = _LONGEST_STOP


class RapidExecution:
    r"""All tasks; an error, EXIT or a stop of all tasks in a NORMAL one stops the others with it.

    Args:
        tasks: the tasks in their order.
        events: the controller's event log.
        halt: switches the motors off for a reason (SystemStopAction \Halt).

    Attributes:
        installed: the tasks with what they run on, by name.
        tasks: the tasks by name.
        is_running: whether RAPID runs in any NORMAL task, or event routines of its stop do.
        cycle: what happens at the end of a program: "forever", it begins again, or "once"; the words are RWS'.
    """

    def __init__(
        self,
        tasks: Sequence[InstalledTask],
        events: ControllerEventLog,
        halt: Callable[[str], None] = lambda reason: None,
    ) -> None:
        self.installed: Mapping[str, InstalledTask] = MappingProxyType({each.task.name: each for each in tasks})
        self.tasks: Mapping[str, Task] = MappingProxyType({each.task.name: each.task for each in tasks})
        self.is_running = False
        self.cycle = "forever"
        self._events = events
        self._halt = halt
        self._stop: _Stop | None = None
        self._resuming: list[InstalledTask] = []  # whose arms wait for event routines of the start
        self._in_order = _behind_their_foreground(tasks)
        for each in tasks:
            each.task.program.shared = partial(self._shared, each.task)

    def _shared(self, task: Task, name: str) -> Variable | None:
        """The persistent of a name that another task has; all tasks share its value.

        Of tasks that are not linked yet nothing is shared: they look here when they are.
        """
        for other in self.tasks.values():
            found = other.program.exported(name) if other is not task else None
            if (
                isinstance(found, Variable)
                and found.storage is Storage.PERS
                and not found.is_task
                and found.value is not UNSET_DATA
            ):
                return found
        return None

    @property
    def _selected(self) -> list[InstalledTask]:
        """The tasks that users start and stop."""
        return [each for each in self._normal if each.is_active and each.has_program]

    @property
    def _normal(self) -> list[InstalledTask]:
        return [each for each in self.installed.values() if each.is_normal]

    @property
    def _started(self) -> list[InstalledTask]:
        return [each for each in self._normal if each.task.execution is Execution.STARTED]

    @property
    def _tasks_in_stop_routines(self) -> list[InstalledTask]:
        """The tasks that have stopped and execute their event routines of STOP."""
        return [each for each in self._normal if each.task.event is SystemEvent.STOP]

    def select(self, task: str, *, is_active: bool) -> None:
        """Select a task on the task panel, or take it out.

        Raises:
            Refused: NOT_STOPPED while it runs; WRONG_MODE for a task that is not NORMAL, which always runs.
        """
        installed = self.installed[task]
        if not installed.is_normal:
            raise Refused(
                RefusalReason.WRONG_MODE, f"{task} is a {installed.settings.type.name} task, which always runs."
            )
        if installed.task.execution is Execution.STARTED:
            raise Refused(RefusalReason.NOT_STOPPED, f"{task} runs: stop RAPID before it is selected or taken out.")
        installed.is_active = is_active

    def start(self, cycle: str = "", step: StepKind | None = None, *, stop_at_breakpoints: bool = False) -> None:
        """Start all selected tasks that do not run from their program pointers.

        Args:
            cycle: "once" or "forever" from now on; empty leaves it as it is.
            step: execute one step only.
            stop_at_breakpoints: whether they stop at breakpoints.

        Raises:
            Refused: ALREADY_RUNNING or NO_PROGRAM_POINTER.
        """
        selected = self._selected
        if self._stop is not None:
            raise Refused(
                RefusalReason.ALREADY_RUNNING, f"the event routines of {self._stop.event.name} are still running."
            )
        if not selected:
            raise Refused(RefusalReason.NO_PROGRAM_POINTER, "no task that is selected has a program: load one first.")
        if all(each.task.execution is Execution.STARTED for each in selected):
            raise Refused(RefusalReason.ALREADY_RUNNING, "RAPID is running already.")
        for each in selected:
            if not each.task.has_program_pointer:  # also after EXIT
                name = each.task.name
                raise Refused(
                    RefusalReason.NO_PROGRAM_POINTER, f"{name} has no program pointer: move it to main first."
                )
        self.is_running = True
        self.cycle = cycle or self.cycle
        for each in selected:
            if each.task.execution is not Execution.STARTED:
                each.task.repeats = self.cycle == "forever"
                each.has_failed = False
                each.task.start(step, stop_at_breakpoints=stop_at_breakpoints)
            self._resuming.append(each)
        self._resume()
        self._show_in_egm()
        names = ", ".join(each.task.name for each in selected)
        self._events.append(10150, "Program started", f"RAPID runs in {names}.")

    def end_after_cycle(self) -> None:
        """Stop when the programs have come to their end; the next start repeats them as `cycle` says."""
        for each in self._selected:
            each.task.repeats = False

    def _resume(self) -> None:
        """Let the arms go on with what a stop has interrupted, each after the event routines of the start."""
        for each in [each for each in self._resuming if each.task.event is None]:
            self._resuming.remove(each)
            if each.unit is not None and each.task.execution is Execution.STARTED:
                with suppress(RobotNotReady):
                    each.unit.arm.follow_path()

    def start_background(self, *, is_restart: bool = False) -> None:
        """Start the tasks that are not NORMAL: SEMISTATIC ones from their beginning, STATIC ones where they were."""
        for each in self.installed.values():
            if each.is_normal or not each.has_program:
                continue
            task = each.task
            try:
                if not task.has_program_pointer or (is_restart and each.settings.type is TaskType.SEMISTATIC):
                    task.stop()
                    task.move_pp_to_main()
            except RapidReferenceError as error:
                self._events.append(40228, "Execution error", f"{task.name} cannot run: {error}", EventType.ERROR)
                continue
            task.repeats = True
            task.start()
        for each in self.installed.values():
            each.task.begin_event(SystemEvent.POWER_ON)

    def stop_background(self) -> None:
        """Stop the tasks that are not NORMAL, as a restart does."""
        for each in self.installed.values():
            if not each.is_normal:
                each.task.stop()

    def stop(
        self, reason: str, event: SystemEvent = SystemEvent.STOP, *, stopped: Sequence[InstalledTask] = ()
    ) -> None:
        """Stop all tasks and bring the arms to a standstill, whatever moves them.

        Event routines that run alone are left: those of POWER_ON and RESET, and those of a stop before. An emergency
        stop has its own ones executed instead of those of a stop before.

        Args:
            reason: for the event log.
            event: STOP, or QSTOP of an emergency stop: its event routines are executed when the arms stand still.
            stopped: tasks that their own instructions have stopped, whose event routines are executed, too.
        """
        normal, before = self._normal, self._stop
        if before is None:
            tasks = [each for each in normal if each.task.execution is Execution.STARTED or each in stopped]
        else:
            tasks = list(before.tasks)
        self._resuming.clear()
        for each in normal:
            each.task.stop()
            each.task.abandon_event()
        self._show_in_egm()
        self._stop_arms()
        if not self.is_running:
            return
        if before is None or (event is SystemEvent.QSTOP and before.event is not event):
            self._stop = _Stop(reason, event, tasks)
            if not any(each.task.event_routines.get(event) for each in tasks):
                self._end_stop()
        elif before.have_begun:
            self._end_stop()

    def _stop_arms(self) -> None:
        """An arm under EGM ramps down as configured; any other motion stops as fast as the drives allow."""
        for unit in [each.unit for each in self._normal if each.unit is not None]:
            was_under_egm = unit.arm.egm is not None
            unit.egm.abort()
            if not was_under_egm:
                unit.arm.stop()

    def _go_on_stopping(self, stop: _Stop, dt: float) -> None:
        """Execute the event routines of a stop once the arms stand still."""
        stop.left -= dt
        units = (each.unit for each in self.installed.values() if each.unit is not None)
        if not stop.have_begun and all(unit.arm.is_stationary for unit in units):
            stop.have_begun = True
            for each in stop.tasks:
                each.task.begin_event(stop.event)
        unfinished = [each for each in stop.tasks if each.task.is_running or not stop.have_begun]
        if unfinished and stop.left <= 0.0:
            names = ", ".join(each.task.name for each in unfinished)
            sentence = f"The event routines of {stop.event.name} in {names} took longer than {_LONGEST_STOP:g} s."
            self._events.append(40228, "Execution error", sentence, EventType.ERROR)
        if not unfinished or stop.left <= 0.0:
            self._end_stop()

    def abandon_events(self) -> None:
        """Leave the event routines that run alone in all tasks, which ends a stop."""
        if self._stop is not None:
            self._end_stop()
        for each in self.installed.values():
            each.task.abandon_event()

    def _end_stop(self) -> None:
        assert self._stop is not None
        for each in self._stop.tasks:
            each.task.abandon_event()
        reason, self._stop = self._stop.reason, None
        self.is_running = False
        self._events.append(10125, "Program stopped", reason)

    def move_pp_to_main(self) -> None:
        """Set the program pointers to main; all variables are initialized.

        Raises:
            Refused: NOT_STOPPED, or NO_PROGRAM_POINTER when a module that was loaded meanwhile does not fit.
        """
        self._check_pointers_may_move()
        tasks = [each.task for each in self._selected]
        for task in tasks:  # all or none
            try:
                task.check()
            except RapidReferenceError as error:
                raise Refused(
                    RefusalReason.NO_PROGRAM_POINTER, f"{task.name} has no program to run: {error}"
                ) from error
        for each in self._selected:
            each.has_failed = False
            each.task.move_pp_to_main()
            if each.unit is not None:
                each.unit.begin_program()

    def move_pp_to_routine(self, task: str, routine: str, module: str = "") -> None:
        """Set the program pointer of one task to a procedure without parameters; its variables are initialized.

        Raises:
            Refused: NOT_STOPPED, or NO_PROGRAM_POINTER when there is no such procedure or the program does not fit.
        """
        self._check_pointers_may_move()
        try:
            self.tasks[task].move_pp_to_routine(routine, module)
        except (RapidReferenceError, UnknownSymbol, RobotNotReady) as error:
            raise Refused(RefusalReason.NO_PROGRAM_POINTER, str(error)) from error
        unit = self.installed[task].unit
        if unit is not None:
            unit.begin_program()

    def _check_pointers_may_move(self) -> None:
        if self.is_running:
            raise Refused(
                RefusalReason.NOT_STOPPED, "the program pointer cannot be moved while RAPID runs: stop it first."
            )

    def load_module(self, task: str, text: str, path: str, *, replace: bool) -> None:
        """Load a module into ``task``.

        Raises:
            Refused: NOT_STOPPED, NAME_TAKEN or BAD_PROGRAM; the program is as it was.
        """
        with self._loading(task):
            self.tasks[task].load(text, path, replace=replace)

    def load_program(self, task: str, texts: Mapping[str, str], *, replace: bool) -> None:
        """Load modules by their paths, all or none, in the place of the program modules of ``task`` or beside them.

        Raises:
            Refused: NOT_STOPPED, NAME_TAKEN or BAD_PROGRAM; the program is as it was.
        """
        with self._loading(task):
            self.tasks[task].load_program(texts, replace=replace)

    @contextmanager
    def _loading(self, task: str) -> Iterator[None]:
        self.check_stopped("modules are loaded", task)
        try:
            yield
        except ModuleNameTaken as error:
            raise Refused(RefusalReason.NAME_TAKEN, str(error)) from error
        except RobotNotReady as error:
            raise Refused(RefusalReason.NOT_STOPPED, str(error)) from error
        except RapidError as error:
            raise Refused(RefusalReason.BAD_PROGRAM, str(error)) from error

    def replace_program(self, texts: Mapping[str, str]) -> None:
        """Load other modules, by their paths, in the place of all of motion tasks; PP goes to their main.

        What is left of the event routines of a stop is not executed.
        """
        if self._stop is not None:
            self._end_stop()
        for task in [each.task for each in self.installed.values() if each.settings.is_motion_task]:
            task.lose_pp()
            for module in task.modules:
                task.unload(module.name)
            for path, text in texts.items():
                task.load(text, path)
        self.move_pp_to_main()
        for each in self.installed.values():
            each.task.begin_event(SystemEvent.RESET)

    def unload_module(self, task: str, name: str) -> None:
        """Remove a module from ``task``.

        Raises:
            Refused: NOT_STOPPED or NO_MODULE.
        """
        self.check_stopped("modules are unloaded", task)
        try:
            self.tasks[task].unload(name)
        except UnknownSymbol as error:
            raise Refused(RefusalReason.NO_MODULE, str(error)) from error
        except RobotNotReady as error:
            raise Refused(RefusalReason.NOT_STOPPED, str(error)) from error

    def check_stopped(self, what: str, task: str) -> None:
        """Raise Refused, NOT_STOPPED, while RAPID runs in ``task``; ``what`` is done while it does not."""
        if self.is_running and self.installed[task].is_normal:
            raise Refused(RefusalReason.NOT_STOPPED, f"{what} while RAPID is stopped: stop it first.")

    def advance(self, dt: float) -> None:
        """Let the tasks run for ``dt`` [s]; 0 runs what is due at once."""
        busy = set()
        for each in self._in_order:
            if not each.task.is_running:
                each.task.stand(dt)
                continue
            if each.settings.foreground.upper() in busy:
                each.task.pass_time(dt)
                busy.add(each.task.name.upper())
            else:
                each.task.advance(dt)
                if each.task.is_busy:
                    busy.add(each.task.name.upper())
        self._react_to_reports()
        if self._resuming:
            self._resume()
        if self._stop is not None:
            self._go_on_stopping(self._stop, dt)

    def signal_changed(self, name: str, old: float, new: float) -> None:
        """Pass an edge on to the tasks; those that do not run lose it."""
        for task in self.tasks.values():
            task.signal_changed(name, old, new)

    def _react_to_reports(self) -> None:
        """React to all tasks that have stopped by themselves in this cycle; RAPID ends with the last one."""
        reports = [(each, event) for each in self.installed.values() for event in each.host.events]
        stopped = [each for each, event in reports if each.is_normal and event.kind in _STOPS]
        for each, _ in reports:
            each.host.events.clear()
        for each, event in reports:
            self._react(each, event, stopped)
        if self.is_running and self._stop is None and not self._started:  # only routines of tasks that stopped earlier
            self._stop_arms()
            tasks = self._tasks_in_stop_routines
            self._stop = _Stop("All tasks have stopped.", SystemEvent.STOP, tasks, have_begun=True)

    def _react(self, reporter: InstalledTask, event: TaskEvent, stopped: Sequence[InstalledTask]) -> None:
        """React to the report of a task; `stopped` are those that their own instructions stopped in this cycle."""
        task = reporter.task.name
        if event.kind is EventKind.ERROR:
            reporter.has_failed = True
            place = f"{task}/{event.module}/{event.routine}, line {event.line}"
            arguments = task, event.error, f"/{event.module}/{event.routine}/{event.line}"
            text = f"{place}: {event.sentence}"
            self._events.append(40228, "Execution error", text, EventType.ERROR, arguments=arguments)
            _log.warning("%s", event.sentence)
        self._show_in_egm()
        reason = f"{task} has stopped: {event.sentence}"
        if not reporter.is_normal:
            # System parameters manual, TrustLevel: what the error of a task that always runs does to the others.
            trust = reporter.settings.trust if event.kind is EventKind.ERROR else TrustLevel.NO_SAFETY
            if trust is not TrustLevel.NO_SAFETY:
                self.stop(reason, stopped=stopped)
            if trust in (TrustLevel.SYS_FAIL, TrustLevel.SYS_HALT):
                self._halt(reason)
            return
        if self.is_running and self._stop is None:  # otherwise a routine has ended that ran alone: others go on
            self._stop_with(reporter, event, reason, stopped)
        if event.kind is EventKind.SYSTEM_STOP_BLOCK:
            for each in self._selected:
                each.task.lose_pp()
        elif event.kind is EventKind.SYSTEM_HALT:
            self._halt(reason)

    def _stop_with(
        self, reporter: InstalledTask, event: TaskEvent, reason: str, stopped: Sequence[InstalledTask]
    ) -> None:
        """Stop the other tasks with one that has stopped by itself, or execute its own event routines of STOP."""
        if event.kind not in _OF_ITS_OWN_TASK or not (self._started or self._tasks_in_stop_routines):
            self.stop(reason, stopped=stopped)
        elif event.kind is EventKind.STOP:
            reporter.task.begin_event(SystemEvent.STOP)
            self._events.append(10125, "Program stopped", reason)

    def _show_in_egm(self) -> None:
        """The datagrams of each arm carry the state of its own task."""
        for each in self.installed.values():
            if each.unit is not None and each.settings.is_motion_task:
                is_started = each.task.execution is Execution.STARTED
                each.unit.egm.rapid = RapidState.RUNNING if is_started else RapidState.STOPPED


def _behind_their_foreground(tasks: Sequence[InstalledTask]) -> tuple[InstalledTask, ...]:
    """The tasks in the order they are executed in a cycle: each after the task in its foreground."""
    by_name = {each.task.name.upper(): each for each in tasks}
    depths = {}
    for each in tasks:
        chain = [each]
        while (next_one := by_name.get(chain[-1].settings.foreground.upper())) is not None and next_one not in chain:
            chain.append(next_one)
        depths[each.task.name] = len(chain)
    return tuple(sorted(tasks, key=lambda each: depths[each.task.name]))
