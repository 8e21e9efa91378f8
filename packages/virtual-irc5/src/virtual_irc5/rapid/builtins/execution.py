"""RAPID's instructions about execution: conditions to follow, cycles, retries, waits, errors, stops, where it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.call import Call, Wait
from virtual_irc5.rapid.pauses import StackEntry
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.states import EventKind
from virtual_irc5.rapid.task import CyclicBool, Task, task_of, tasks_of
from virtual_irc5.rapid.types import ABSENT_DATA, Propagated, RapidRuntimeError, Reference, Variable, raised_as

EXECUTION = Library(DATA)


# Flags that follow conditions -------------------------------------------------------------------------------------

_MOST_CYCLIC_BOOLS = 60
_CYCLE_OF_BOOLS = 0.012  # [s]


def _cyclic_flag(call: Call) -> tuple[str, Reference]:
    reference = call.reference("Flag")
    if not isinstance(reference, Variable):
        raise RapidRuntimeError("ERR_ARGNOTPER", f"{call.name} takes a whole persistent, not a part of one.")
    return reference.name.lower(), reference


@EXECUTION.instruction("SetupCyclicBool", "PERS bool Flag, bool Cond")
def _follow_condition(call: Call) -> Callable[[Callable[[], bool]], None]:
    """Let a persistent have the value of a condition from now on, which the compiler passes to what is returned."""
    task, (name, flag) = task_of(call), _cyclic_flag(call)
    if name not in task.cyclic_bools and len(task.cyclic_bools) >= _MOST_CYCLIC_BOOLS:
        raise RapidRuntimeError("ERR_EXECPHR", f"{_MOST_CYCLIC_BOOLS} conditions are computed cyclically already.")

    def setup(condition: Callable[[], bool]) -> None:
        if not task.has_flag_timer:
            task.later(0.0, lambda: _update_flags(task))
            task.has_flag_timer = True
        task.cyclic_bools[name] = CyclicBool(flag, condition)

    return setup


def _update_flags(task: Task) -> None:
    """Compute all flags now and, as long as there are any, every 12 ms.

    A condition that fails stops the task once, not in each cycle, and keeps no other flag from following its own.
    """
    task.has_flag_timer = bool(task.cyclic_bools)
    if task.has_flag_timer:
        task.later(_CYCLE_OF_BOOLS, lambda: _update_flags(task))
    new: list[Exception] = []
    for each in list(task.cyclic_bools.values()):
        try:
            value = each.condition()
        except Exception as error:  # what the task makes of it, its timers say
            if not each.has_failed:
                new.append(error)
            each.has_failed = True
            continue
        each.has_failed = False
        if value != each.flag.value:
            each.flag.value = value
    if new:
        raise new[0]


@EXECUTION.instruction("RemoveCyclicBool", "PERS bool Flag")
def _leave_condition(call: Call) -> None:
    task_of(call).cyclic_bools.pop(_cyclic_flag(call)[0], None)


@EXECUTION.instruction("RemoveAllCyclicBool", r"\switch AllTasks")
def _leave_conditions(call: Call) -> None:
    tasks = tasks_of(call).values() if call.present("AllTasks") else (task_of(call),)
    for task in tasks:
        task.cyclic_bools.clear()


@EXECUTION.function("IsCyclicBool", "PERS bool Flag", "bool")
def _follows_condition(call: Call) -> bool:
    return _cyclic_flag(call)[0] in task_of(call).cyclic_bools


@EXECUTION.function("GetNextCyclicBool", "INOUT num ListNumber, INOUT string Name", "bool")
def _next_flag(call: Call) -> bool:
    """The name of the flag at the list number, which begins with 0 and moves on; FALSE behind the last one."""
    index, flags = int(call["ListNumber"]), list(task_of(call).cyclic_bools.values())
    if not 0 <= index < len(flags):
        return False
    call["ListNumber"], call["Name"] = index + 1, flags[index].flag.name
    return True


EXECUTION.function("GetNumberOfCyclicBool", "", "num")(lambda call: len(task_of(call).cyclic_bools))
EXECUTION.formula("GetMaxNumberOfCyclicBool", "", "num", lambda: _MOST_CYCLIC_BOOLS)


# Where execution is -----------------------------------------------------------------------------------------------


@EXECUTION.instruction("ExitCycle")
def _exit_cycle(call: Call) -> None:
    """The program goes on with main, in run mode "once" when it is started again."""
    task = task_of(call)
    task.machine.unwind(0, task.finished)


@EXECUTION.function("RemainingRetries", "", "num")
def _remaining_retries(call: Call) -> float:
    return task_of(call).frame.remaining_retries


@EXECUTION.instruction("ResetRetryCount")
def _reset_retries(call: Call) -> None:
    task_of(call).frame.reset_retries()


@EXECUTION.function("ExecHandler", "", "handler_type")
def _executing_handler(call: Call) -> Any:
    return DATA.value(f"HANDLER_{task_of(call).frame.clause}")


@EXECUTION.function("ExecLevel", "", "exec_level")
def _execution_level(call: Call) -> Any:
    level = "LEVEL_SERVICE" if call.task.event else "LEVEL_TRAP" if task_of(call).machine.in_trap else "LEVEL_NORMAL"
    return DATA.value(level)


@EXECUTION.function("EventType", "", "event_type")
def _event_type(call: Call) -> Any:
    """The system event whose event routine is being executed."""
    event = call.task.event
    return DATA.value("EVENT_NONE") if event is None else event.value


@EXECUTION.function("ArgName", r"INOUT anytype Parameter, \VAR errnum ErrorNumber", "string")
def _argument_name(call: Call) -> str:
    """The name of the datum that the caller has passed for a parameter, at whatever depth."""
    reference = call.reference("Parameter")
    if reference is ABSENT_DATA:
        raise RapidRuntimeError("ERR_ARGNAME", "ArgName is given a parameter that is not present.")
    return reference.name


@EXECUTION.instruction("Break")
def _break_execution(call: Call) -> None:
    """Stop the program at once, for debugging; it goes on with the next instruction."""
    call.task.stopped_by_program(EventKind.STOP)


@EXECUTION.function("IsStopStateEvent", r"\switch PPMoved | \switch PPToMain", "bool")
def _was_pointer_moved(call: Call) -> bool:
    """Whether the program pointer was moved before the program was started the last time."""
    where = task_of(call).stop_event
    return where == "main" if call.present("PPToMain") else bool(where)


@EXECUTION.function("PPMovedInManMode", "", "bool")
def _was_pointer_moved_by_hand(call: Call) -> bool:
    """Whether the program pointer was moved in manual mode since ResetPPMoved."""
    return task_of(call).pp_moved_in_manual


@EXECUTION.instruction("ResetPPMoved")
def _forget_moved_pointer(call: Call) -> None:
    task_of(call).pp_moved_in_manual = False


_MOST_RECORDED = 10_000  # instructions


@EXECUTION.instruction("SpyStart", "string File")
def _record_execution(call: Call) -> None:
    """Record each instruction of the task with the time it begins and ends [ms], for SpyStop to write."""
    task, start, lines = task_of(call), call.task.now, ["TASK INSTR IN CODE OUT"]
    begun: list[tuple[str, int]] = []
    path = call["File"]

    def now_ms() -> int:
        return round((task.now - start) * 1e3)

    def finish() -> None:
        if begun and len(lines) <= _MOST_RECORDED:
            text, at = begun.pop()
            lines.append(f"{task.name}: {text} {at} READY {now_ms()}")

    def watch(entry: StackEntry) -> None:
        finish()
        text = task.program.modules[entry.module.lower()].syntax.text.splitlines()
        begun[:] = [(text[entry.line - 1].strip() if entry.line <= len(text) else "", now_ms())]

    def write() -> None:
        finish()
        with raised_as("ERR_FILEOPEN", OSError, before=f"SpyStop: '{path}' cannot be written: "):
            task.host.devices.disk.write(path, "\n".join([*lines, ""]).encode("latin-1", "replace"))

    task.pauses.spy, task.pauses.end_of_spy = watch, write
    task.pauses.watch()


@EXECUTION.instruction("SpyStop")
def _end_recording(call: Call) -> None:
    task = task_of(call)
    if task.pauses.spy is not None:
        task.pauses.spy = None
        task.pauses.watch()
        task.pauses.end_of_spy()


# Waits, errors and stops ----------------------------------------------------------------------------------------------


@EXECUTION.instruction("WaitTime", r"\switch InPos, num Time")
def _wait_time(call: Call) -> Wait:
    while not call.task.is_settled(call):
        yield None
    end = call.task.now + max(0.0, call["Time"])
    while call.task.now < end:
        yield end


@EXECUTION.function("TestAndSet", "INOUT bool Object", "bool")
def _test_and_set(call: Call) -> bool:
    r"""Whether it was FALSE; it is TRUE from now on. Two tasks never get it both: one is executed at a time."""
    was_free = not call["Object"]
    call["Object"] = True
    return was_free


@EXECUTION.instruction("WaitTestAndSet", "PERS bool Object")
def _wait_test_and_set(call: Call) -> Wait:
    while call["Object"]:
        yield None
    call["Object"] = True


@EXECUTION.instruction("RaiseToUser", r"\switch Continue | \switch BreakOff, \num ErrorNumber")
def _raise_to_user(call: Call) -> None:
    """Raise the error of the handler, or another one; NOSTEPIN routines, which it leaves, are ordinary ones here."""
    number = call.get("ErrorNumber", task_of(call).program.system_data["errno"].value)
    error = RapidRuntimeError(task_of(call).machine.error_name(number), f"RaiseToUser: the error {number:g}.")
    error.number = number
    raise Propagated(error, is_long_jump=False)


@EXECUTION.instruction("BookErrNo", "VAR errnum ErrorName")
def _book_error_number(call: Call) -> None:
    call["ErrorName"] = task_of(call).machine.book_error(call.reference("ErrorName").name)


@EXECUTION.instruction("Stop", r"\switch NoRegain | \switch AllMoveTasks")
def _stop_program(call: Call) -> Wait:
    r"""A movement under way is finished first, which one that EGM guides never is; other tasks go on.

    RAPID reference manual, Stop: without \AllMoveTasks only the task that executes it stops.
    """
    while not task_of(call).in_position():
        yield None
    call.task.stopped_by_program(EventKind.STOP_ALL_TASKS if call.present("AllMoveTasks") else EventKind.STOP)


@EXECUTION.instruction("SystemStopAction", r"\switch Stop | \switch StopBlock | \switch Halt")
def _stop_system(call: Call) -> None:
    r"""Program and movements of all motion tasks stop at once, whatever guides them.

    RAPID reference manual, SystemStopAction: after \StopBlock the program pointers have to be moved, after \Halt the
    motors are off.
    """
    kinds = {"StopBlock": EventKind.SYSTEM_STOP_BLOCK, "Halt": EventKind.SYSTEM_HALT}
    call.task.stopped_by_program(next((kinds[name] for name in kinds if call.present(name)), EventKind.SYSTEM_STOP))
