"""RAPID's instructions about execution itself: interrupts of data, cycles, retries, where it is, modules in pieces."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from yumi.errors import RobotNotReady
from yumi.rapid.ast import Module
from yumi.rapid.builtins.constants import CONSTANTS
from yumi.rapid.errors import ProgramTooLarge, RapidReferenceError, RapidRuntimeError, RapidSyntaxError, UnknownSymbol
from yumi.rapid.interrupts import ChangeOrder, SignalOrder
from yumi.rapid.library import Call, Library, Wait
from yumi.rapid.parser import parse_module
from yumi.rapid.types import ABSENT, Part, Variable

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
    return _constant("LEVEL_TRAP" if call.task.is_in_trap else "LEVEL_NORMAL")


@EXECUTION.function("EventType", "", "event_type")
def event_type(call: Call) -> float:
    """No event routine is being executed: this controller has none."""
    return _constant("EVENT_NONE")


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


@EXECUTION.instruction("Save", r"\switch TaskRef | \string TaskName, string ModuleName, \string FilePath, \string File")
def save(call: Call) -> None:
    """A module's text into a file, its persistents with the values they have now."""
    task = call.task
    module = task.program.modules.get(call["ModuleName"].lower())
    if module is None:
        raise RapidRuntimeError("ERR_MODULE", f"The task {task.name} has no module '{call['ModuleName']}'.")
    path = _path(call) if call.present("FilePath") else module.syntax.filename
    try:
        task.host.devices.disk.write(path, task.saved_text(module).encode("latin-1", "replace"))
    except OSError as error:
        raise RapidRuntimeError("ERR_IOERROR", f"'{path}' cannot be written: {error}") from error
