"""RAPID's I/O signals: reading and writing, pulses, waits for a value, their devices and networks, and alias names."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.call import VISUALIZE, Call, CallDeadline, Wait
from virtual_irc5.rapid.devices import IoDevices
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.types import RapidRuntimeError, Signal

SIGNALS = Library(DATA)
_PULSE_S = 0.2  # the length of PulseDO without \PLength


def _write_signal(call: Call, value: float) -> None:
    r"""Set the call's signal, after \SDelay where it is given; the program goes on at once.

    Raises:
        RapidRuntimeError: ERR_AO_LIM or ERR_GO_LIM for a value the signal does not take, ERR_NORUNUNIT.
    """
    task, name = call.task, call["Signal"].name
    _check_device(call, name)
    io = task.host.devices.io
    low, high = io.limits(name) if io is not None else (-math.inf, math.inf)
    if not low <= value <= high:
        error = "ERR_AO_LIM" if call.name == "SetAO" else "ERR_GO_LIM"
        raise call.error(error, f"{name} takes {low:g} to {high:g}, not {value:g}.")
    if call.get("SDelay") is not None:
        task.later(call["SDelay"], lambda: task.write_signal(name, value))
    else:
        task.write_signal(name, value)


@SIGNALS.instruction("Set", "VAR signaldo Signal")
@SIGNALS.instruction("Reset", "VAR signaldo Signal")
def _switch_output(call: Call) -> None:
    _write_signal(call, 1.0 if call.name == "Set" else 0.0)


@SIGNALS.instruction("InvertDO", "VAR signaldo Signal")
def _invert_output(call: Call) -> None:
    name = call["Signal"].name
    call.task.write_signal(name, 0.0 if call.task.read_signal(name) else 1.0)


@SIGNALS.instruction("SetDO", r"\num SDelay | \switch Sync, VAR signaldo Signal, num Value")
def _set_digital_output(call: Call) -> None:
    _write_signal(call, 1.0 if call["Value"] else 0.0)


@SIGNALS.instruction("SetGO", r"\num SDelay, VAR signalgo Signal, anynum Value")
@SIGNALS.instruction("SetAO", "VAR signalao Signal, num Value")
def _set_output_value(call: Call) -> None:
    _write_signal(call, call["Value"])


@SIGNALS.instruction("PulseDO", r"\switch High, \num PLength, VAR signaldo Signal")
def _pulse_output(call: Call) -> None:
    r"""A pulse away from the present level and back, or high and then low with \High; the program goes on."""
    task, name = call.task, call["Signal"].name
    level = 0.0 if call.present("High") else task.read_signal(name)
    task.write_signal(name, 0.0 if level else 1.0)
    task.later(call.get("PLength", _PULSE_S), lambda: task.write_signal(name, level))


def _signal_level(call: Call) -> float:
    _check_device(call, call["Signal"].name)
    return call.task.read_signal(call["Signal"].name)


for _name, _type, _returns in (
    ("DInput", "signaldi", "dionum"),
    ("DOutput", "signaldo", "dionum"),
    ("GInput", "signalgi", "num"),
    ("GOutput", "signalgo", "num"),
    ("AInput", "signalai", "num"),
    ("AOutput", "signalao", "num"),
    ("GInputDnum", "signalgi", "dnum"),
    ("GOutputDnum", "signalgo", "dnum"),
):
    SIGNALS.function(_name, f"VAR {_type} Signal", _returns)(_signal_level)


@SIGNALS.function("TestDI", "VAR signaldi Signal", "bool")
def _is_input_set(call: Call) -> bool:
    return bool(_signal_level(call))


# Waiting ----------------------------------------------------------------------------------------------------------


_RELATIONS: tuple[tuple[str, Callable[[float, float], bool]], ...] = (
    ("LT", operator.lt),
    ("GT", operator.gt),
    ("NOTEQ", operator.ne),
)


def _wait_for_level(call: Call) -> Wait:
    r"""Until the signal has the value, or the relation to it; \ValueAtTimeout gets what it has when time is up."""
    deadline, value = CallDeadline.of(call), call["Value"]
    relation = next((holds for name, holds in _RELATIONS if call.get(name)), operator.eq)
    with deadline.visualized(call["Signal"].name):
        while not relation(_signal_level(call), value):
            if call.task.now >= deadline.time and call.get("ValueAtTimeout") is not None:
                call["ValueAtTimeout"] = _signal_level(call)
            if deadline.expire():
                return
            yield deadline.due
        deadline.met()


for _name, _type, _value, _relation in (
    ("WaitDI", "signaldi", "num Value", ""),
    ("WaitDO", "signaldo", "num Value", ""),
    ("WaitGI", "signalgi", "anynum Value", r"\switch NOTEQ | \switch LT | \switch GT, "),
    ("WaitGO", "signalgo", "anynum Value", r"\switch NOTEQ | \switch LT | \switch GT, "),
    ("WaitAI", "signalai", "num Value", r"\switch LT | \switch GT, "),
    ("WaitAO", "signalao", "num Value", r"\switch LT | \switch GT, "),
):
    _out = r", \VAR num ValueAtTimeout" if _relation else ""
    _signature = rf"VAR {_type} Signal, {_relation}{_value}, \num MaxTime{_out}, \VAR bool TimeFlag, {VISUALIZE}"
    SIGNALS.instruction(_name, _signature)(_wait_for_level)

# Devices, networks and other names for signals ----------------------------------------------------------------------

SIGNALS.alias("busstate", "num")
SIGNALS.alias("iounit_state", "num")
SIGNALS.alias("signalorigin", "num")
SIGNALS.constants(
    "busstate",
    "BUSSTATE_HALTED=0 BUSSTATE_RUN BUSSTATE_ERROR BUSSTATE_STARTUP BUSSTATE_INIT "
    "IOBUS_LOG_STATE_STOPPED=10 IOBUS_LOG_STATE_STARTED IOBUS_PHYS_STATE_HALTED=20 IOBUS_PHYS_STATE_RUNNING "
    "IOBUS_PHYS_STATE_ERROR IOBUS_PHYS_STATE_STARTUP IOBUS_PHYS_STATE_INIT",
)
SIGNALS.constants(
    "iounit_state",
    "IOUNIT_RUNNING=1 IOUNIT_RUNERROR IOUNIT_DISABLE IOUNIT_OTHERERR IOUNIT_LOG_STATE_DISABLED=10 "
    "IOUNIT_LOG_STATE_ENABLED IOUNIT_PHYS_STATE_DEACTIVATED=20 IOUNIT_PHYS_STATE_RUNNING IOUNIT_PHYS_STATE_ERROR "
    "IOUNIT_PHYS_STATE_UNCONNECTED IOUNIT_PHYS_STATE_UNCONFIGURED IOUNIT_PHYS_STATE_STARTUP IOUNIT_PHYS_STATE_INIT",
)
SIGNALS.constants("signalorigin", "SIGORIG_NONE=0 SIGORIG_CFG SIGORIG_ALIAS")


def _io_devices(call: Call, name: str, unit: str) -> IoDevices:
    """The host's devices, of which one has the name; raises ERR_NAME_INVALID."""
    io = call.task.host.devices.io
    known = (() if io is None else io.devices()) if unit == "device" else (io.devices().values() if io else ())
    if io is None or name.lower() not in (each.lower() for each in known):
        raise call.error("ERR_NAME_INVALID", f"there is no {unit} '{name}'.")
    return io


def _check_device(call: Call, signal: str) -> None:
    """Raise ERR_NORUNUNIT where the signal is on a device that the program has disabled."""
    devices = call.task.host.devices
    if devices.disabled and devices.io is not None and devices.io.device_of(signal).lower() in devices.disabled:
        raise call.error("ERR_NORUNUNIT", f"the device of {signal} is disabled; see IOEnable.")


@SIGNALS.instruction("IODisable", "string UnitName, num MaxTime")
@SIGNALS.instruction("IOEnable", "string UnitName, num MaxTime")
def _switch_device(call: Call) -> None:
    """Disable a device, so that its signals cannot be used, or enable it again; done at once here."""
    _io_devices(call, call["UnitName"], "device")
    disabled, name = call.task.host.devices.disabled, call["UnitName"].lower()
    if call.name == "IODisable":
        disabled.add(name)
    else:
        disabled.discard(name)


@SIGNALS.function("IOUnitState", r"string UnitName, \switch Phys | \switch Logic", "iounit_state")
def _device_state(call: Call) -> Any:
    _io_devices(call, call["UnitName"], "device")
    is_enabled = call["UnitName"].lower() not in call.task.host.devices.disabled
    if call.present("Phys"):
        name = "IOUNIT_PHYS_STATE_RUNNING" if is_enabled else "IOUNIT_PHYS_STATE_DEACTIVATED"
    elif call.present("Logic"):
        name = "IOUNIT_LOG_STATE_ENABLED" if is_enabled else "IOUNIT_LOG_STATE_DISABLED"
    else:
        name = "IOUNIT_RUNNING" if is_enabled else "IOUNIT_DISABLE"
    return SIGNALS.value(name)


@SIGNALS.instruction("IOBusStart", "string BusName")
def _start_bus(call: Call) -> None:
    """An I/O network always runs here; one that does not exist is an error."""
    _io_devices(call, call["BusName"], "network")


@SIGNALS.instruction("IOBusState", r"string BusName, VAR busstate State, \switch Phys | \switch Logic")
def _bus_state(call: Call) -> None:
    _io_devices(call, call["BusName"], "network")
    name = "IOBUS_PHYS_STATE_RUNNING" if call.present("Phys") else "BUSSTATE_RUN"
    name = "IOBUS_LOG_STATE_STARTED" if call.present("Logic") else name
    call["State"] = SIGNALS.value(name)


@SIGNALS.function("ValidIO", "VAR signal Signal", "bool")
def _is_signal_valid(call: Call) -> bool:
    """Whether a signal can be used: it exists, an alias is connected, its device is enabled."""
    try:
        _signal_level(call)
    except RapidRuntimeError:
        return False
    return True


@SIGNALS.instruction("AliasIO", "anytype FromSignal, VAR signal ToSignal")
def _connect_alias(call: Call) -> None:
    """Let a datum of the program stand for a signal of the configuration, given itself or by its name."""
    given, io = call["FromSignal"], call.task.host.devices.io
    name = given.name if isinstance(given, Signal) else given
    if not isinstance(name, str):
        raise RapidRuntimeError("ERR_ALIASIO_DEF", "AliasIO takes a signal or its name.")
    try:
        call.task.read_signal(name)
    except RapidRuntimeError as error:
        raise call.error("ERR_ALIASIO_DEF", f"there is no signal '{name}'.") from error
    reference = call.reference("ToSignal")
    if io is not None and reference.type.name != f"signal{io.type_of(name).lower()}":
        sentence = f"{name} is a signal{io.type_of(name).lower()}, {reference.name} a {reference.type.name}."
        raise call.error("ERR_ALIASIO_TYPE", sentence)
    reference.value = Signal(name)


@SIGNALS.instruction("AliasIOReset", "VAR signal Signal")
def _reset_alias(call: Call) -> None:
    reference = call.reference("Signal")
    if not reference.value.name:
        raise call.error("ERR_NO_ALIASIO_DEF", f"{reference.name} stands for no signal.")
    reference.value = Signal("")


@SIGNALS.function("GetSignalOrigin", "VAR signal Signal, VAR string SignalName", "signalorigin")
def _signal_origin(call: Call) -> Any:
    """Whether a signal is the configuration's or an alias, and which it stands for."""
    reference = call.reference("Signal")
    call["SignalName"] = reference.value.name
    if not reference.value.name:
        return SIGNALS.value("SIGORIG_NONE")
    is_alias = reference.name.lower() != reference.value.name.lower()
    return SIGNALS.value("SIGORIG_ALIAS" if is_alias else "SIGORIG_CFG")
