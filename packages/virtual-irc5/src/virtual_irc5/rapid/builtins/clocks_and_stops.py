"""RAPID's clocks, booked errors, stops, and questions about the task and its controller."""

from __future__ import annotations

from dataclasses import dataclass

from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.call import Call, Wait
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.states import EventKind
from virtual_irc5.rapid.task import task_of

SYSTEM = Library(DATA)


# Clocks -----------------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class RapidClock:
    """A stopwatch: seconds counted until the last stop, and since when it runs (None: it stands)."""

    counted: float = 0.0
    since: float | None = None

    def read(self, now: float) -> float:
        return self.counted + (0.0 if self.since is None else now - self.since)


SYSTEM.object_type("clock", RapidClock)


@SYSTEM.instruction("ClkReset", "VAR clock Clock")
def reset_clock(call: Call) -> None:
    clock: RapidClock = call["Clock"]
    clock.counted, clock.since = 0.0, None


@SYSTEM.instruction("ClkStart", "VAR clock Clock")
def start_clock(call: Call) -> None:
    clock: RapidClock = call["Clock"]
    if clock.since is None:
        clock.since = call.task.elapsed


@SYSTEM.instruction("ClkStop", "VAR clock Clock")
def stop_clock(call: Call) -> None:
    clock: RapidClock = call["Clock"]
    clock.counted, clock.since = clock.read(call.task.elapsed), None


@SYSTEM.function("ClkRead", r"VAR clock Clock, \switch HighRes", "num")
def read_clock(call: Call) -> float:
    clock: RapidClock = call["Clock"]
    return clock.read(call.task.elapsed)


# Errors, stopping, the system -------------------------------------------------------------------------------------


@SYSTEM.instruction("BookErrNo", "VAR errnum ErrorName")
def book_error_number(call: Call) -> None:
    call["ErrorName"] = task_of(call).machine.book_error(call.reference("ErrorName").name)


@SYSTEM.instruction("Stop", r"\switch NoRegain | \switch AllMoveTasks")
def stop_program(call: Call) -> Wait:
    r"""A movement under way is finished first, which one that EGM guides never is; other tasks go on.

    RAPID reference manual, Stop: without \AllMoveTasks only the task that executes it stops.
    """
    while not task_of(call).in_position():
        yield None
    call.task.stopped_by_program(EventKind.STOP_ALL_TASKS if call.present("AllMoveTasks") else EventKind.STOP)


@SYSTEM.instruction("SystemStopAction", r"\switch Stop | \switch StopBlock | \switch Halt")
def stop_system(call: Call) -> None:
    r"""Program and movements of all motion tasks stop at once, whatever guides them.

    RAPID reference manual, SystemStopAction: after \StopBlock the program pointers have to be moved, after \Halt the
    motors are off.
    """
    kinds = {"StopBlock": EventKind.SYSTEM_STOP_BLOCK, "Halt": EventKind.SYSTEM_HALT}
    call.task.stopped_by_program(next((kinds[name] for name in kinds if call.present(name)), EventKind.SYSTEM_STOP))


@SYSTEM.function("RobOS", "", "bool")
def is_real_robot(call: Call) -> bool:
    return not call.task.host.is_virtual()


@SYSTEM.function("GetTaskName", r"\VAR num TaskNo | \VAR num MecTaskNo", "string")
def task_name(call: Call) -> str:
    """The task's name; its number counts from 1 in the order of the configuration."""
    names = [name.lower() for name in call.task.host.devices.tasks()]
    for argument in ("TaskNo", "MecTaskNo"):
        if call.present(argument) and call.task.name.lower() in names:
            call[argument] = names.index(call.task.name.lower()) + 1
    return call.task.name


@SYSTEM.function("OpMode", "", "symnum")
def operating_mode(call: Call) -> float:
    return task_of(call).operating_mode()
