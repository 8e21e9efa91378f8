"""RAPID's instructions about execution itself: interrupts of data, cycles, retries, where it is, modules in pieces."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from yumi.errors import RobotNotReady
from yumi.rapid.ast import Module
from yumi.rapid.builtins.constants import CONSTANTS
from yumi.rapid.builtins.symbols import OF_TASK, task_meant
from yumi.rapid.errors import ProgramTooLarge, RapidReferenceError, RapidRuntimeError, RapidSyntaxError, UnknownSymbol
from yumi.rapid.interrupts import ChangeOrder, SignalOrder
from yumi.rapid.library import Call, Library, Wait
from yumi.rapid.parser import parse_module
from yumi.rapid.program import EventKind
from yumi.rapid.task import CyclicBool, StackEntry, Task
from yumi.rapid.types import ABSENT, Part, Reference, Variable

EXECUTION = Library(CONSTANTS)


# Interrupts -------------------------------------------------------------------------------------------------------


@EXECUTION.instruction("IPers", r"\switch Single | \switch SingleSafe, PERS anytype Name, VAR intnum Interrupt")
def order_change(call: Call) -> None:
    """An interrupt whenever the value of a persistent changes, whichever task writes it."""
    task, number = call.task, int(call["Interrupt"])
    variable: Any = call.reference("Name")
    while isinstance(variable, Part):
        variable = variable.whole
    if not isinstance(variable, Variable):
        raise RapidRuntimeError("ERR_ARGNOTPER", "IPers takes a persistent.")
    order = ChangeOrder(call.present("Single") or call.present("SingleSafe"))
    task.interrupts.order(number, order)

    def changed() -> None:
        if not task.interrupts.is_ordered(number, order):
            variable.watchers.remove(changed)
        elif task.is_running:
            task.interrupts.occurred(number)

    variable.watch(changed)


@dataclass(slots=True)
class AnalogChange:
    """When an analog signal orders its interrupt: it fulfils the condition and has changed by more than `delta`.

    Technical reference manual, ISignalAI: the change counts from the value at the order, then from each interrupt.
    """

    condition: str
    high: float
    low: float
    delta: float
    direction: int
    reference: float

    def is_in(self, old: float, new: float) -> bool:
        """Whether a change to `new` is such a one."""
        is_fulfilled = {
            "AIO_ABOVE_HIGH": new > self.high,
            "AIO_BELOW_HIGH": new < self.high,
            "AIO_ABOVE_LOW": new > self.low,
            "AIO_BELOW_LOW": new < self.low,
            "AIO_BETWEEN": self.low <= new <= self.high,
            "AIO_OUTSIDE": not self.low <= new <= self.high,
            "AIO_ALWAYS": True,
        }[self.condition]
        change = new - self.reference
        is_far = abs(change) > self.delta and (self.direction == 0 or change * self.direction > 0)
        if is_fulfilled and is_far:
            self.reference = new
        return is_fulfilled and is_far


def _order_analog(call: Call) -> None:
    names = CONSTANTS_OF_CONDITIONS.get(call["Condition"])
    if names is None:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name} takes AIO_ABOVE_HIGH and the like as condition.")
    signal = call["Signal"].name
    change = AnalogChange(
        names,
        call["HighValue"],
        call["LowValue"],
        call["DeltaValue"],
        1 if call.present("DPos") else -1 if call.present("DNeg") else 0,
        call.task.read_signal(signal),
    )
    is_single = call.present("Single") or call.present("SingleSafe")
    call.task.interrupts.order(int(call["Interrupt"]), SignalOrder(signal, change, is_single))


_CONDITIONS = ("ABOVE_HIGH", "BELOW_HIGH", "ABOVE_LOW", "BELOW_LOW", "BETWEEN", "OUTSIDE", "ALWAYS")
CONSTANTS_OF_CONDITIONS = {
    datum.value: f"AIO_{name}" for name in _CONDITIONS if (datum := CONSTANTS.datum(f"AIO_{name}")) is not None
}
for _name, _type in (("ISignalAI", "signalai"), ("ISignalAO", "signalao")):
    EXECUTION.instruction(
        _name,
        rf"\switch Single | \switch SingleSafe, VAR {_type} Signal, aiotrigg Condition, num HighValue, num LowValue, "
        r"num DeltaValue, \switch DPos | \switch DNeg, VAR intnum Interrupt",
    )(_order_analog)


# Flags that follow conditions -------------------------------------------------------------------------------------

MOST_CYCLIC_BOOLS = 60
CYCLE_OF_BOOLS = 0.012  # [s]


def _flag(call: Call) -> tuple[str, Reference]:
    reference = call.reference("Flag")
    if not isinstance(reference, Variable):
        raise RapidRuntimeError("ERR_ARGNOTPER", f"{call.name} takes a whole persistent, not a part of one.")
    return reference.name.lower(), reference


@EXECUTION.instruction("SetupCyclicBool", "PERS bool Flag, bool Cond")
def follow_condition(call: Call) -> Callable[[Callable[[], bool]], None]:
    """Let a persistent have the value of a condition from now on, which the compiler passes to what is returned."""
    task, (name, flag) = call.task, _flag(call)
    if name not in task.cyclic_bools and len(task.cyclic_bools) >= MOST_CYCLIC_BOOLS:
        raise RapidRuntimeError("ERR_EXECPHR", f"{MOST_CYCLIC_BOOLS} conditions are computed cyclically already.")

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
        task.later(CYCLE_OF_BOOLS, lambda: _update_flags(task))
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
def leave_condition(call: Call) -> None:
    call.task.cyclic_bools.pop(_flag(call)[0], None)


@EXECUTION.instruction("RemoveAllCyclicBool", r"\switch AllTasks")
def leave_conditions(call: Call) -> None:
    tasks = call.task.host.devices.tasks().values() if call.present("AllTasks") else [call.task]
    for task in tasks:
        task.cyclic_bools.clear()


@EXECUTION.function("IsCyclicBool", "PERS bool Flag", "bool")
def follows_condition(call: Call) -> bool:
    return _flag(call)[0] in call.task.cyclic_bools


@EXECUTION.function("GetNextCyclicBool", "INOUT num ListNumber, INOUT string Name", "bool")
def next_flag(call: Call) -> bool:
    """The name of the flag at the list number, which begins with 0 and moves on; FALSE behind the last one."""
    index, flags = int(call["ListNumber"]), list(call.task.cyclic_bools.values())
    if not 0 <= index < len(flags):
        return False
    call["ListNumber"], call["Name"] = index + 1, flags[index].flag.name
    return True


EXECUTION.function("GetNumberOfCyclicBool", "", "num")(lambda call: len(call.task.cyclic_bools))
EXECUTION.formula("GetMaxNumberOfCyclicBool", "", "num", lambda: MOST_CYCLIC_BOOLS)


# Where execution is -----------------------------------------------------------------------------------------------


@EXECUTION.instruction("ExitCycle")
def exit_cycle(call: Call) -> None:
    """The program goes on with main, in run mode "once" when it is started again."""
    call.task.exit_cycle()


@EXECUTION.function("RemainingRetries", "", "num")
def remaining_retries(call: Call) -> float:
    return call.task.remaining_retries()


@EXECUTION.instruction("ResetRetryCount")
def reset_retries(call: Call) -> None:
    call.task.reset_retries()


@EXECUTION.function("ExecHandler", "", "handler_type")
def executing_handler(call: Call) -> float:
    return _constant(f"HANDLER_{call.task.clause}")


@EXECUTION.function("ExecLevel", "", "exec_level")
def execution_level(call: Call) -> float:
    level = "LEVEL_SERVICE" if call.task.event else "LEVEL_TRAP" if call.task.is_in_trap else "LEVEL_NORMAL"
    return _constant(level)


@EXECUTION.function("EventType", "", "event_type")
def event_type(call: Call) -> float:
    """The system event whose event routine is being executed."""
    event = call.task.event
    return _constant("EVENT_NONE") if event is None else event.value


def _constant(name: str) -> float:
    datum = CONSTANTS.datum(name)
    assert datum is not None
    value: float = datum.value
    return value


@EXECUTION.function("ArgName", r"INOUT anytype Parameter, \VAR errnum ErrorNumber", "string")
def argument_name(call: Call) -> str:
    """The name of the datum that the caller has passed for a parameter, at whatever depth."""
    reference = call.reference("Parameter")
    if reference is ABSENT:
        raise RapidRuntimeError("ERR_ARGNAME", "ArgName is given a parameter that is not present.")
    return reference.name


@EXECUTION.instruction("Break")
def break_execution(call: Call) -> None:
    """Stop the program at once, for debugging; it goes on with the next instruction."""
    call.task.stopped_by_program(EventKind.STOP)


@EXECUTION.function("IsStopStateEvent", r"\switch PPMoved | \switch PPToMain", "bool")
def was_pointer_moved(call: Call) -> bool:
    """Whether the program pointer was moved before the program was started the last time."""
    where = call.task.stop_event
    return where == "main" if call.present("PPToMain") else bool(where)


@EXECUTION.function("PPMovedInManMode", "", "bool")
def was_pointer_moved_by_hand(call: Call) -> bool:
    """Whether the program pointer was moved in manual mode since ResetPPMoved."""
    return call.task.pp_moved_in_manual


@EXECUTION.instruction("ResetPPMoved")
def forget_moved_pointer(call: Call) -> None:
    call.task.pp_moved_in_manual = False


MOST_RECORDED = 10_000  # instructions


@EXECUTION.instruction("SpyStart", "string File")
def record_execution(call: Call) -> None:
    """Record each instruction of the task with the time it begins and ends [ms], for SpyStop to write."""
    task, start, lines = call.task, call.task.now, ["TASK INSTR IN CODE OUT"]
    begun: list[tuple[str, int]] = []
    path = call["File"]

    def now_ms() -> int:
        return round((task.now - start) * 1e3)

    def finish() -> None:
        if begun and len(lines) <= MOST_RECORDED:
            text, at = begun.pop()
            lines.append(f"{task.name}: {text} {at} READY {now_ms()}")

    def watch(entry: StackEntry) -> None:
        finish()
        text = task.program.modules[entry.module.lower()].syntax.text.splitlines()
        begun[:] = [(text[entry.line - 1].strip() if entry.line <= len(text) else "", now_ms())]

    def write() -> None:
        finish()
        try:
            task.host.devices.disk.write(path, "\n".join([*lines, ""]).encode("latin-1", "replace"))
        except OSError as error:
            raise RapidRuntimeError("ERR_FILEOPEN", f"SpyStop: '{path}' cannot be written: {error}") from error

    task.spy, task.end_of_spy = watch, write
    task.watch_statements()


@EXECUTION.instruction("SpyStop")
def end_recording(call: Call) -> None:
    task = call.task
    if task.spy is not None:
        task.spy = None
        task.watch_statements()
        task.end_of_spy()


# Modules ----------------------------------------------------------------------------------------------------------


def _path(call: Call, path: str = "FilePath", file: str = "File") -> str:
    given: str = call[path]
    return f"{given.rstrip('/')}/{call[file]}" if call.present(file) else given


@EXECUTION.function("ModExist", "string ModuleName", "bool")
def module_exists(call: Call) -> bool:
    return call["ModuleName"].lower() in call.task.program.modules


@EXECUTION.instruction("EraseModule", "string ModuleName")
def erase_module(call: Call) -> None:
    try:
        call.task.unload(call["ModuleName"])
    except (UnknownSymbol, RobotNotReady) as error:
        raise RapidRuntimeError("ERR_MODULE", str(error)) from error


@EXECUTION.instruction("CheckProgRef")
def check_references(call: Call) -> None:
    faults = call.task.faults()
    if faults:
        raise RapidRuntimeError("ERR_LINKREF", str(faults[0]))


@dataclass(eq=False, slots=True)
class LoadSession:
    """What a loadsession stands for: a module that is being read in the background."""

    path: str = ""
    text: str = ""
    work: Future[Module] | None = None


EXECUTION.object_type("loadsession", LoadSession)


@EXECUTION.instruction("StartLoad", r"\switch Dynamic, string FilePath, \string File, VAR loadsession LoadNo")
def start_load(call: Call) -> None:
    session, path = call["LoadNo"], _path(call)
    if session.work is not None:
        raise RapidRuntimeError("ERR_LOADNO_INUSE", f"{call.reference('LoadNo').name} is loading {session.path}.")
    try:
        session.text = call.task.host.read_file(path)
    except OSError as error:
        raise RapidRuntimeError("ERR_FILNOTFND", f"The file '{path}' cannot be read: {error}") from error
    session.path = path
    session.work = call.task.background(lambda: parse_module(session.text, path))


@EXECUTION.instruction("WaitLoad", r"\string UnloadPath, \string UnloadFile, VAR loadsession LoadNo, \switch CheckRef")
def wait_load(call: Call) -> Wait:
    session, task = call["LoadNo"], call.task
    if session.work is None:
        raise RapidRuntimeError("ERR_LOADNO_NOUSE", f"{call.reference('LoadNo').name} is not loading anything.")
    while not session.work.done():
        yield None
    if call.present("UnloadPath"):
        path = _path(call, "UnloadPath", "UnloadFile")
        old = next((module for module in task.modules if module.filename == path), None)
        try:
            task.unload(old.name if old else "")
        except (UnknownSymbol, RobotNotReady) as error:
            session.work = None
            raise RapidRuntimeError("ERR_UNLOAD", f"'{path}' cannot be unloaded: {error}") from error
    session.work = None
    try:
        yield from task.loading(session.text, session.path)
    except RapidSyntaxError as error:
        raise RapidRuntimeError("ERR_SYNTAX", str(error)) from error
    except ProgramTooLarge as error:
        raise RapidRuntimeError("ERR_PRGMEMFULL", str(error)) from error
    except RapidReferenceError as error:
        raise RapidRuntimeError("ERR_LOADED", str(error)) from error
    if call.present("CheckRef"):
        check_references(call)


@EXECUTION.instruction("CancelLoad", "VAR loadsession LoadNo")
def cancel_load(call: Call) -> None:
    session = call["LoadNo"]
    if session.work is None:
        raise RapidRuntimeError("ERR_LOADNO_NOUSE", f"{call.reference('LoadNo').name} is not loading anything.")
    session.work = None


@EXECUTION.instruction("Save", rf"{OF_TASK}, string ModuleName, \string FilePath, \string File")
def save(call: Call) -> None:
    """A module's text into a file, its persistents with the values they have now."""
    task = task_meant(call)
    module = task.program.modules.get(call["ModuleName"].lower())
    if module is None:
        raise RapidRuntimeError("ERR_MODULE", f"The task {task.name} has no module '{call['ModuleName']}'.")
    path = _path(call) if call.present("FilePath") else module.syntax.filename
    try:
        task.host.devices.disk.write(path, task.saved_text(module).encode("latin-1", "replace"))
    except OSError as error:
        raise RapidRuntimeError("ERR_IOERROR", f"'{path}' cannot be written: {error}") from error
