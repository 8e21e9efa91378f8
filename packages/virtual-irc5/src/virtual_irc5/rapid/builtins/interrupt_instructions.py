"""RAPID's instructions of interrupts: orders (ISignalDI, ITimer, IPers, IError), IDelete, ISleep and their like."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.call import Call
from virtual_irc5.rapid.devices import LoggedEvent
from virtual_irc5.rapid.interrupts import ChangeOrder, SignalEdge, SignalOrder, TimerOrder
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.types import LONGEST_STRING, DatumPart, RapidRuntimeError, Variable

INTERRUPTS = Library(DATA)

_SHORTEST_TIMER_S = 0.1  # of a repeated ITimer; single ones may be shorter
_SINGLE = r"\switch Single | \switch SingleSafe"


def _is_single(call: Call) -> bool:
    """Whether the interrupt comes once."""
    return call.present("Single") or call.present("SingleSafe")


def _order_signal(call: Call) -> None:
    value = call.get("TriggValue", SignalEdge.BOTH.value)  # a group signal's interrupt comes with any change
    if value not in (edge.value for edge in SignalEdge):
        sentence = f"{call.name} takes low (0), high (1) or edge (2), not {value:g}."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    order = SignalOrder(call["Signal"].name, SignalEdge(value), _is_single(call))
    call.task.interrupts.order(int(call["Interrupt"]), order)


for _name, _type, _edge in (
    ("ISignalDI", "signaldi", "dionum TriggValue, "),
    ("ISignalDO", "signaldo", "dionum TriggValue, "),
    ("ISignalGI", "signalgi", ""),
    ("ISignalGO", "signalgo", ""),
):
    INTERRUPTS.instruction(_name, f"{_SINGLE}, VAR {_type} Signal, {_edge}VAR intnum Interrupt")(_order_signal)


@INTERRUPTS.instruction("ITimer", f"{_SINGLE}, anynum Time, VAR intnum Interrupt")
def _order_timer(call: Call) -> None:
    is_single = _is_single(call)
    period: float = call["Time"]
    if period <= 0.0 or (period < _SHORTEST_TIMER_S and not is_single):
        sentence = f"ITimer takes at least {_SHORTEST_TIMER_S:g} s, single ones more than 0, not {period:g} s."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    order = TimerOrder(call.task.now + period, period, is_single)
    call.task.interrupts.order(int(call["Interrupt"]), order)


@INTERRUPTS.instruction("IDelete", "VAR intnum Interrupt")
def _delete_interrupt(call: Call) -> None:
    call.task.interrupts.delete(int(call["Interrupt"]))


@INTERRUPTS.instruction("ISleep", "VAR intnum Interrupt")
@INTERRUPTS.instruction("IWatch", "VAR intnum Interrupt")
def _watch_interrupt(call: Call) -> None:
    call.task.interrupts.connection(int(call["Interrupt"])).is_asleep = call.name == "ISleep"


@INTERRUPTS.instruction("IDisable")
@INTERRUPTS.instruction("IEnable")
def _enable_interrupts(call: Call) -> None:
    call.task.interrupts.is_disabled = call.name == "IDisable"


@INTERRUPTS.instruction("IPers", f"{_SINGLE}, PERS anytype Name, VAR intnum Interrupt")
def _order_change(call: Call) -> None:
    """An interrupt whenever the value of a persistent changes, whichever task writes it."""
    task, number = call.task, int(call["Interrupt"])
    variable: Any = call.reference("Name")
    while isinstance(variable, DatumPart):
        variable = variable.whole
    if not isinstance(variable, Variable):
        raise RapidRuntimeError("ERR_ARGNOTPER", "IPers takes a persistent.")
    order = ChangeOrder(_is_single(call))
    task.interrupts.order(number, order)

    def changed() -> None:
        if not task.interrupts.is_ordered(number, order):
            variable.watchers.remove(changed)
        elif task.is_running:
            task.interrupts.occur(number)

    variable.watch(changed)


# By aiotrigg: whether a value fulfils the condition, beside a low and a high one.
_CONDITIONS: Mapping[float, Callable[[float, float, float], bool]] = {
    DATA.value("AIO_ABOVE_HIGH"): lambda value, low, high: value > high,
    DATA.value("AIO_BELOW_HIGH"): lambda value, low, high: value < high,
    DATA.value("AIO_ABOVE_LOW"): lambda value, low, high: value > low,
    DATA.value("AIO_BELOW_LOW"): lambda value, low, high: value < low,
    DATA.value("AIO_BETWEEN"): lambda value, low, high: low <= value <= high,
    DATA.value("AIO_OUTSIDE"): lambda value, low, high: not low <= value <= high,
    DATA.value("AIO_ALWAYS"): lambda value, low, high: True,
}


@dataclass(slots=True)
class AnalogInterruptChange:
    """When an analog signal orders its interrupt: it fulfils the condition and has changed by more than `delta`.

    Technical reference manual, ISignalAI: the change counts from the value at the order, then from each interrupt.
    """

    is_fulfilled: Callable[[float, float, float], bool]
    low: float
    high: float
    delta: float
    direction: int
    reference: float

    def is_in(self, old: float, new: float) -> bool:
        """Whether a change to `new` is such a one."""
        change = new - self.reference
        is_far = abs(change) > self.delta and (self.direction == 0 or change * self.direction > 0)
        is_ordered = is_far and self.is_fulfilled(new, self.low, self.high)
        if is_ordered:
            self.reference = new
        return is_ordered


def _order_analog(call: Call) -> None:
    is_fulfilled = _CONDITIONS.get(call["Condition"])
    if is_fulfilled is None:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name} takes AIO_ABOVE_HIGH and the like as condition.")
    signal, direction = call["Signal"].name, 1 if call.present("DPos") else -1 if call.present("DNeg") else 0
    limits, reference = (call["LowValue"], call["HighValue"], call["DeltaValue"]), call.task.read_signal(signal)
    change = AnalogInterruptChange(is_fulfilled, *limits, direction, reference)
    call.task.interrupts.order(int(call["Interrupt"]), SignalOrder(signal, change, _is_single(call)))


for _name, _type in (("ISignalAI", "signalai"), ("ISignalAO", "signalao")):
    INTERRUPTS.instruction(
        _name,
        rf"{_SINGLE}, VAR {_type} Signal, aiotrigg Condition, num HighValue, num LowValue, num DeltaValue, "
        r"\switch DPos | \switch DNeg, VAR intnum Interrupt",
    )(_order_analog)


# Events of the log ------------------------------------------------------------------------------------------------


@dataclass(eq=False, slots=True)
class TrapData:
    """What a trapdata stands for: the event that has interrupted the program."""

    event: LoggedEvent | None = None


INTERRUPTS.object_type("trapdata", TrapData)


@INTERRUPTS.instruction(
    "IError", rf"{_SINGLE}, errdomain ErrorDomain, \num ErrorId, errtype ErrorType, VAR intnum Interrupt"
)
def _order_event(call: Call) -> None:
    """An interrupt whenever an event comes into the log: COMMON_ERR stands for all domains, TYPE_ALL for all types."""
    devices, interrupts, number, task = call.task.host.devices, call.task.interrupts, int(call["Interrupt"]), call.task
    domain, identity, kind = call["ErrorDomain"], call.get("ErrorId"), call["ErrorType"]
    order = ChangeOrder(_is_single(call))

    def logged(event: LoggedEvent) -> None:
        if not interrupts.is_ordered(number, order):  # deleted, or it was a single one
            devices.watchers.remove(logged)
            return
        is_wanted = domain in (0, event.domain) and identity in (None, event.number)
        if is_wanted and kind in (0, event.severity.value) and task.is_running:
            devices.trapped[task.name] = event
            interrupts.occur(number)

    interrupts.order(number, order)
    devices.watchers.append(logged)


@INTERRUPTS.instruction("GetTrapData", "VAR trapdata TrapEvent")
def _trap_data(call: Call) -> None:
    call["TrapEvent"].event = call.task.host.devices.trapped.get(call.task.name)


@INTERRUPTS.instruction(
    "ReadErrData",
    r"VAR trapdata TrapEvent, INOUT errdomain ErrorDomain, INOUT num ErrorId, INOUT errtype ErrorType, "
    r"\VAR string Title, \VAR string Str1, \VAR string Str2, \VAR string Str3, \VAR string Str4, \VAR string Str5",
)
def _event_data(call: Call) -> None:
    event: LoggedEvent | None = call["TrapEvent"].event
    if event is None:
        raise call.error("ERR_ARGVALERR", "GetTrapData has found no event.")
    call["ErrorDomain"], call["ErrorId"] = float(event.domain), float(event.number)
    call["ErrorType"] = float(event.severity.value)
    texts = (event.title, *event.arguments)
    for name, text in zip(("Title", "Str1", "Str2", "Str3", "Str4", "Str5"), (*texts, *[""] * 5), strict=False):
        call.give(name, text[:LONGEST_STRING])
