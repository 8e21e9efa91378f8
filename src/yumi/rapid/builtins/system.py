"""RAPID's system: interrupts, clocks, the operator's display, stopping, errors and modules."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.errors import RobotNotReady
from yumi.rapid.builtins.data import DATA
from yumi.rapid.errors import ProgramTooLarge, RapidReferenceError, RapidRuntimeError, RapidSyntaxError
from yumi.rapid.interrupts import Edge, SignalOrder, TimerOrder
from yumi.rapid.library import Call, Library, Wait
from yumi.rapid.parser import format_value
from yumi.rapid.program import EventKind, Severity

SYSTEM = Library(DATA)
SHORTEST_TIMER_S = 0.1  # of a repeated ITimer; single ones may be shorter


# Interrupts -------------------------------------------------------------------------------------------------------


def _order_signal(call: Call) -> None:
    value = call.get("TriggValue", Edge.BOTH.value)  # a group signal's interrupt comes with any change
    if value not in (edge.value for edge in Edge):
        sentence = f"{call.name} takes low (0), high (1) or edge (2), not {value:g}."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    is_single = call.present("Single") or call.present("SingleSafe")
    call.task.interrupts.order(int(call["Interrupt"]), SignalOrder(call["Signal"].name, Edge(value), is_single))


for _name, _type, _edge in (
    ("ISignalDI", "signaldi", "dionum TriggValue, "),
    ("ISignalDO", "signaldo", "dionum TriggValue, "),
    ("ISignalGI", "signalgi", ""),
    ("ISignalGO", "signalgo", ""),
):
    _signature = rf"\switch Single | \switch SingleSafe, VAR {_type} Signal, {_edge}VAR intnum Interrupt"
    SYSTEM.instruction(_name, _signature)(_order_signal)


@SYSTEM.instruction("ITimer", r"\switch Single | \switch SingleSafe, anynum Time, VAR intnum Interrupt")
def order_timer(call: Call) -> None:
    is_single = call.present("Single") or call.present("SingleSafe")
    period: float = call["Time"]
    if period <= 0.0 or (period < SHORTEST_TIMER_S and not is_single):
        sentence = f"ITimer takes at least {SHORTEST_TIMER_S:g} s, single ones more than 0, not {period:g} s."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    order = TimerOrder(call.task.now + period, period, is_single)
    call.task.interrupts.order(int(call["Interrupt"]), order)


@SYSTEM.instruction("IDelete", "VAR intnum Interrupt")
def delete_interrupt(call: Call) -> None:
    call.task.interrupts.delete(int(call["Interrupt"]))


@SYSTEM.instruction("ISleep", "VAR intnum Interrupt")
def put_interrupt_to_sleep(call: Call) -> None:
    call.task.interrupts.sleep(int(call["Interrupt"]))


@SYSTEM.instruction("IWatch", "VAR intnum Interrupt")
def watch_interrupt(call: Call) -> None:
    call.task.interrupts.watch(int(call["Interrupt"]))


@SYSTEM.instruction("IDisable")
def disable_interrupts(call: Call) -> None:
    call.task.interrupts.is_disabled = True


@SYSTEM.instruction("IEnable")
def enable_interrupts(call: Call) -> None:
    call.task.interrupts.is_disabled = False


# The operator's display -------------------------------------------------------------------------------------------


@SYSTEM.instruction("TPErase")
def erase_display(call: Call) -> None:
    """The host keeps a log of lines, from which nothing is taken back."""


@SYSTEM.instruction("TPWrite", r"string String, \num Num | \bool Bool | \pos Pos | \orient Orient | \dnum Dnum")
def write_display(call: Call) -> None:
    text: str = call["String"]
    for name in ("Num", "Bool", "Pos", "Orient", "Dnum"):
        if call.present(name):
            text += format_value(call.reference(name).type, call[name])
    call.task.host.write_text(call.task.name, text)


@SYSTEM.instruction(
    "ErrWrite", r"\switch W | \switch I, string Header, string Reason, \string RL2, \string RL3, \string RL4"
)
def write_event(call: Call) -> None:
    r"""On the display and in the event log: an error, with \W a warning, with \I information."""
    title, host, name = call["Header"], call.task.host, call.task.name
    lines = (call["Reason"], *(call.get(each, "") for each in ("RL2", "RL3", "RL4")))
    text = ": ".join(line for line in lines if line)
    host.write_text(name, ": ".join(line for line in (title, text) if line))
    severity = Severity.WARNING if call.present("W") else Severity.INFORMATION if call.present("I") else Severity.ERROR
    host.write_event(name, title, text, severity, (title, *lines))


# Clocks -----------------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class Clock:
    """A stopwatch: seconds counted until the last stop, and since when it runs (None: it stands)."""

    counted: float = 0.0
    since: float | None = None

    def read(self, now: float) -> float:
        return self.counted + (0.0 if self.since is None else now - self.since)


SYSTEM.object_type("clock", Clock)


@SYSTEM.instruction("ClkReset", "VAR clock Clock")
def reset_clock(call: Call) -> None:
    clock: Clock = call["Clock"]
    clock.counted, clock.since = 0.0, None


@SYSTEM.instruction("ClkStart", "VAR clock Clock")
def start_clock(call: Call) -> None:
    clock: Clock = call["Clock"]
    if clock.since is None:
        clock.since = call.task.elapsed


@SYSTEM.instruction("ClkStop", "VAR clock Clock")
def stop_clock(call: Call) -> None:
    clock: Clock = call["Clock"]
    clock.counted, clock.since = clock.read(call.task.elapsed), None


@SYSTEM.function("ClkRead", r"VAR clock Clock, \switch HighRes", "num")
def read_clock(call: Call) -> float:
    clock: Clock = call["Clock"]
    return clock.read(call.task.elapsed)


# Errors, stopping, the system -------------------------------------------------------------------------------------


@SYSTEM.instruction("BookErrNo", "VAR errnum ErrorName")
def book_error_number(call: Call) -> None:
    call["ErrorName"] = call.task.book_error(call.reference("ErrorName").name)


@SYSTEM.instruction("Stop", r"\switch NoRegain | \switch AllMoveTasks")
def stop(call: Call) -> Wait:
    r"""A movement under way is finished first, which one that EGM guides never is; other tasks go on.

    RAPID reference manual, Stop: without \AllMoveTasks only the task that executes it stops.
    """
    while not call.task.in_position():
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
    return call.task.operating_mode()


# Modules ----------------------------------------------------------------------------------------------------------


@SYSTEM.instruction("CallByVar", "string Name, num Number")
def call_by_variable(call: Call) -> None:
    call.task.call_procedure(f"{call['Name']}{int(call['Number'])}")


@SYSTEM.instruction("Load", r"\switch Dynamic, string FilePath, \string File, \switch CheckRef")
def load(call: Call) -> Wait:
    task, path = call.task, _path(call)
    try:
        text = task.host.read_file(path)
    except OSError as error:
        raise RapidRuntimeError("ERR_FILNOTFND", f"The file '{path}' cannot be read: {error}") from error
    try:
        yield from task.loading(text, path)
    except RapidSyntaxError as error:
        raise RapidRuntimeError("ERR_SYNTAX", str(error)) from error
    except ProgramTooLarge as error:
        raise RapidRuntimeError("ERR_PRGMEMFULL", str(error)) from error
    except RapidReferenceError as error:
        raise RapidRuntimeError("ERR_LOADED", str(error)) from error


@SYSTEM.instruction("UnLoad", r"\switch ErrIfChanged | \switch Save, string FilePath, \string File")
def unload(call: Call) -> None:
    task, path = call.task, _path(call)
    found = next((m for m in task.modules if m.filename == path), None)
    if found is None:
        raise RapidRuntimeError("ERR_UNLOAD", f"No module was loaded from '{path}'.")
    try:
        task.unload(found.name)
    except RobotNotReady as error:
        raise RapidRuntimeError("ERR_UNLOAD", str(error)) from error


def _path(call: Call) -> str:
    path: str = call["FilePath"]
    return f"{path.rstrip('/')}/{call['File']}" if call.present("File") else path
