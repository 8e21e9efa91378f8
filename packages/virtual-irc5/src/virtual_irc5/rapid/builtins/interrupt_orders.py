"""RAPID's instructions of interrupts: what orders them, and when they may come."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from virtual_irc5.rapid.builtins.data import CONSTANTS
from virtual_irc5.rapid.call import Call
from virtual_irc5.rapid.interrupts import ChangeOrder, Edge, SignalOrder, TimerOrder
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.types import Part, RapidRuntimeError, Variable

INTERRUPTS = Library(CONSTANTS)

SHORTEST_TIMER_S = 0.1  # of a repeated ITimer; single ones may be shorter


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
    INTERRUPTS.instruction(_name, _signature)(_order_signal)


@INTERRUPTS.instruction("ITimer", r"\switch Single | \switch SingleSafe, anynum Time, VAR intnum Interrupt")
def order_timer(call: Call) -> None:
    is_single = call.present("Single") or call.present("SingleSafe")
    period: float = call["Time"]
    if period <= 0.0 or (period < SHORTEST_TIMER_S and not is_single):
        sentence = f"ITimer takes at least {SHORTEST_TIMER_S:g} s, single ones more than 0, not {period:g} s."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    order = TimerOrder(call.task.now + period, period, is_single)
    call.task.interrupts.order(int(call["Interrupt"]), order)


@INTERRUPTS.instruction("IDelete", "VAR intnum Interrupt")
def delete_interrupt(call: Call) -> None:
    call.task.interrupts.delete(int(call["Interrupt"]))


@INTERRUPTS.instruction("ISleep", "VAR intnum Interrupt")
def put_interrupt_to_sleep(call: Call) -> None:
    call.task.interrupts.sleep(int(call["Interrupt"]))


@INTERRUPTS.instruction("IWatch", "VAR intnum Interrupt")
def watch_interrupt(call: Call) -> None:
    call.task.interrupts.watch(int(call["Interrupt"]))


@INTERRUPTS.instruction("IDisable")
def disable_interrupts(call: Call) -> None:
    call.task.interrupts.is_disabled = True


@INTERRUPTS.instruction("IEnable")
def enable_interrupts(call: Call) -> None:
    call.task.interrupts.is_disabled = False


@INTERRUPTS.instruction("IPers", r"\switch Single | \switch SingleSafe, PERS anytype Name, VAR intnum Interrupt")
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
    INTERRUPTS.instruction(
        _name,
        rf"\switch Single | \switch SingleSafe, VAR {_type} Signal, aiotrigg Condition, num HighValue, num LowValue, "
        r"num DeltaValue, \switch DPos | \switch DNeg, VAR intnum Interrupt",
    )(_order_analog)
