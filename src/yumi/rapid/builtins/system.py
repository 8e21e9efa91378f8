r"""RAPID's system: clocks, the display, stopping; signals and waiting for them; questions to the operator.

A question (TPReadFK, UIMessageBox and the like) is answered over RWS or the command line. An instruction shows it on
the controller's FlexPendant and is asked for its answer once per advance of the task. It ends without one after
\MaxTime, at \DIBreak, \DOBreak or \PersBoolBreak: with \BreakFlag the program goes on, without it that is an error.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from yumi.rapid.builtins.data import CONSTANTS, DATA
from yumi.rapid.devices import Choice, Dialog, DialogKind, IoDevices
from yumi.rapid.library import VISUALIZE, Call, Deadline, Library, Wait
from yumi.rapid.parser import format_value
from yumi.rapid.program import EventKind, Severity
from yumi.rapid.types import RapidRuntimeError, Signal

SYSTEM = Library(DATA)


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
def stop_program(call: Call) -> Wait:
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


# Signals ------------------------------------------------------------------------------------------------------------

SIGNALS = Library(CONSTANTS)
PULSE_S = 0.2  # the length of PulseDO without \PLength


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
        raise RapidRuntimeError(error, f"{call.name}: {name} takes {low:g} to {high:g}, not {value:g}.")
    if call.get("SDelay") is not None:
        task.later(call["SDelay"], lambda: task.write_signal(name, value))
    else:
        task.write_signal(name, value)


@SIGNALS.instruction("Set", "VAR signaldo Signal")
def set_output(call: Call) -> None:
    _write_signal(call, 1.0)


@SIGNALS.instruction("Reset", "VAR signaldo Signal")
def reset_output(call: Call) -> None:
    _write_signal(call, 0.0)


@SIGNALS.instruction("InvertDO", "VAR signaldo Signal")
def invert_output(call: Call) -> None:
    name = call["Signal"].name
    call.task.write_signal(name, 0.0 if call.task.read_signal(name) else 1.0)


@SIGNALS.instruction("SetDO", r"\num SDelay | \switch Sync, VAR signaldo Signal, num Value")
def set_digital_output(call: Call) -> None:
    _write_signal(call, 1.0 if call["Value"] else 0.0)


@SIGNALS.instruction("SetGO", r"\num SDelay, VAR signalgo Signal, anynum Value")
def set_group_output(call: Call) -> None:
    _write_signal(call, call["Value"])


@SIGNALS.instruction("SetAO", "VAR signalao Signal, num Value")
def set_analog_output(call: Call) -> None:
    _write_signal(call, call["Value"])


@SIGNALS.instruction("PulseDO", r"\switch High, \num PLength, VAR signaldo Signal")
def pulse_output(call: Call) -> None:
    r"""A pulse away from the present level and back, or high and then low with \High; the program goes on."""
    task, name = call.task, call["Signal"].name
    level = 0.0 if call.present("High") else task.read_signal(name)
    task.write_signal(name, 0.0 if level else 1.0)
    task.later(call.get("PLength", PULSE_S), lambda: task.write_signal(name, level))


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
def is_input_set(call: Call) -> bool:
    return bool(_signal_level(call))


# Waiting ----------------------------------------------------------------------------------------------------------


@SIGNALS.instruction("WaitTime", r"\switch InPos, num Time")
def wait_time(call: Call) -> Wait:
    yield from wait_in_position(call)
    end = call.task.now + max(0.0, call["Time"])
    while call.task.now < end:
        yield end


def wait_in_position(call: Call) -> Wait:
    while not call.task.is_settled(call):
        yield None


_RELATIONS: tuple[tuple[str, Callable[[float, float], bool]], ...] = (
    ("LT", operator.lt),
    ("GT", operator.gt),
    ("NOTEQ", operator.ne),
)


def _wait_for_level(call: Call) -> Wait:
    r"""Until the signal has the value, or the relation to it; \ValueAtTimeout gets what it has when time is up."""
    deadline, value = Deadline.of(call), call["Value"]
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
_IO_STATES: dict[str, dict[str, int]] = {
    "busstate": {
        **{f"BUSSTATE_{name}": value for value, name in enumerate(("HALTED", "RUN", "ERROR", "STARTUP", "INIT"))},
        **{"IOBUS_LOG_STATE_STOPPED": 10, "IOBUS_LOG_STATE_STARTED": 11},
        **{
            f"IOBUS_PHYS_STATE_{name}": value
            for value, name in enumerate(("HALTED", "RUNNING", "ERROR", "STARTUP", "INIT"), 20)
        },
    },
    "iounit_state": {
        **{f"IOUNIT_{name}": value for value, name in enumerate(("RUNNING", "RUNERROR", "DISABLE", "OTHERERR"), 1)},
        **{"IOUNIT_LOG_STATE_DISABLED": 10, "IOUNIT_LOG_STATE_ENABLED": 11},
        **{
            f"IOUNIT_PHYS_STATE_{name}": value
            for value, name in enumerate(
                ("DEACTIVATED", "RUNNING", "ERROR", "UNCONNECTED", "UNCONFIGURED", "STARTUP", "INIT"), 20
            )
        },
    },
    "signalorigin": {"SIGORIG_NONE": 0, "SIGORIG_CFG": 1, "SIGORIG_ALIAS": 2},
}
for _type, _values in _IO_STATES.items():
    for _name, _number in _values.items():
        SIGNALS.data(_name, _type, _number)


def _io_devices(call: Call, name: str, unit: str) -> IoDevices:
    """The host's devices, of which one has the name; raises ERR_NAME_INVALID."""
    io = call.task.host.devices.io
    known = (() if io is None else io.devices()) if unit == "device" else (io.devices().values() if io else ())
    if io is None or name.lower() not in (each.lower() for each in known):
        raise RapidRuntimeError("ERR_NAME_INVALID", f"{call.name}: there is no {unit} '{name}'.")
    return io


def _check_device(call: Call, signal: str) -> None:
    """Raise ERR_NORUNUNIT where the signal is on a device that the program has disabled."""
    devices = call.task.host.devices
    if devices.disabled and devices.io is not None and devices.io.device_of(signal).lower() in devices.disabled:
        raise RapidRuntimeError("ERR_NORUNUNIT", f"{call.name}: the device of {signal} is disabled; see IOEnable.")


@SIGNALS.instruction("IODisable", "string UnitName, num MaxTime")
@SIGNALS.instruction("IOEnable", "string UnitName, num MaxTime")
def switch_device(call: Call) -> None:
    """Disable a device, so that its signals cannot be used, or enable it again; done at once here."""
    _io_devices(call, call["UnitName"], "device")
    disabled, name = call.task.host.devices.disabled, call["UnitName"].lower()
    if call.name == "IODisable":
        disabled.add(name)
    else:
        disabled.discard(name)


@SIGNALS.function("IOUnitState", r"string UnitName, \switch Phys | \switch Logic", "iounit_state")
def device_state(call: Call) -> float:
    _io_devices(call, call["UnitName"], "device")
    is_enabled = call["UnitName"].lower() not in call.task.host.devices.disabled
    if call.present("Phys"):
        name = "IOUNIT_PHYS_STATE_RUNNING" if is_enabled else "IOUNIT_PHYS_STATE_DEACTIVATED"
    elif call.present("Logic"):
        name = "IOUNIT_LOG_STATE_ENABLED" if is_enabled else "IOUNIT_LOG_STATE_DISABLED"
    else:
        name = "IOUNIT_RUNNING" if is_enabled else "IOUNIT_DISABLE"
    return float(_IO_STATES["iounit_state"][name])


@SIGNALS.instruction("IOBusStart", "string BusName")
def start_bus(call: Call) -> None:
    """An I/O network always runs here; one that does not exist is an error."""
    _io_devices(call, call["BusName"], "network")


@SIGNALS.instruction("IOBusState", r"string BusName, VAR busstate State, \switch Phys | \switch Logic")
def bus_state(call: Call) -> None:
    _io_devices(call, call["BusName"], "network")
    name = "IOBUS_PHYS_STATE_RUNNING" if call.present("Phys") else "BUSSTATE_RUN"
    name = "IOBUS_LOG_STATE_STARTED" if call.present("Logic") else name
    call["State"] = float(_IO_STATES["busstate"][name])


@SIGNALS.function("ValidIO", "VAR signal Signal", "bool")
def is_signal_valid(call: Call) -> bool:
    """Whether a signal can be used: it exists, an alias is connected, its device is enabled."""
    try:
        _signal_level(call)
    except RapidRuntimeError:
        return False
    return True


@SIGNALS.instruction("AliasIO", "anytype FromSignal, VAR signal ToSignal")
def connect_alias(call: Call) -> None:
    """Let a datum of the program stand for a signal of the configuration, given itself or by its name."""
    given, io = call["FromSignal"], call.task.host.devices.io
    name = given.name if isinstance(given, Signal) else given
    if not isinstance(name, str):
        raise RapidRuntimeError("ERR_ALIASIO_DEF", "AliasIO takes a signal or its name.")
    try:
        call.task.read_signal(name)
    except RapidRuntimeError as error:
        raise RapidRuntimeError("ERR_ALIASIO_DEF", f"AliasIO: there is no signal '{name}'.") from error
    reference = call.reference("ToSignal")
    if io is not None and reference.type.name != f"signal{io.type_of(name).lower()}":
        sentence = f"AliasIO: {name} is a signal{io.type_of(name).lower()}, {reference.name} a {reference.type.name}."
        raise RapidRuntimeError("ERR_ALIASIO_TYPE", sentence)
    reference.value = Signal(name)


@SIGNALS.instruction("AliasIOReset", "VAR signal Signal")
def reset_alias(call: Call) -> None:
    reference = call.reference("Signal")
    if not reference.value.name:
        raise RapidRuntimeError("ERR_NO_ALIASIO_DEF", f"AliasIOReset: {reference.name} stands for no signal.")
    reference.value = Signal("")


@SIGNALS.function("GetSignalOrigin", "VAR signal Signal, VAR string SignalName", "signalorigin")
def signal_origin(call: Call) -> float:
    """Whether a signal is the configuration's or an alias, and which it stands for."""
    reference = call.reference("Signal")
    call["SignalName"] = reference.value.name
    if not reference.value.name:
        return float(_IO_STATES["signalorigin"]["SIGORIG_NONE"])
    is_alias = reference.name.lower() != reference.value.name.lower()
    return float(_IO_STATES["signalorigin"]["SIGORIG_ALIAS" if is_alias else "SIGORIG_CFG"])


# Questions to the operator ------------------------------------------------------------------------------------------

DIALOGS = Library(CONSTANTS)
MOST_MESSAGE_LINES = 5

DIALOGS.record("listitem", {"image": "string", "text": "string"})

# Constants of a button set, and what its buttons give.
BUTTON_RESULTS = {"Unkwn": 0, "OK": 1, "Abort": 2, "Retry": 3, "Ignore": 4, "Cancel": 5, "Yes": 6, "No": 7}
BUTTON_SETS: dict[str, tuple[int, tuple[str, ...]]] = {
    "btnNone": (-1, ()),
    "btnOK": (0, ("OK",)),
    "btnAbrtRtryIgn": (1, ("Abort", "Retry", "Ignore")),
    "btnOKCancel": (2, ("OK", "Cancel")),
    "btnRetryCancel": (3, ("Retry", "Cancel")),
    "btnYesNo": (4, ("Yes", "No")),
    "btnYesNoCancel": (5, ("Yes", "No", "Cancel")),
}
for _name, _number in BUTTON_RESULTS.items():
    DIALOGS.data(f"res{_name}", "btnres", _number)
for _name, (_number, _) in BUTTON_SETS.items():
    DIALOGS.data(_name, "buttondata", _number)
for _number, _name in enumerate(("iconNone", "iconInfo", "iconWarning", "iconError")):
    DIALOGS.data(_name, "icondata", _number)
for _number, _name in enumerate(("TP_LATEST", "TP_PROGRAM", "TP_SCREENVIEWER"), 1):
    DIALOGS.data(_name, "tpnum", float(_number))

_BREAKS = (
    r"\num MaxTime, \VAR signaldi DIBreak, \switch DIPassive, \VAR signaldo DOBreak, \switch DOPassive, "
    r"\PERS bool PersBoolBreak, \switch PersBoolPassive, \VAR errnum BreakFlag"
)
_MESSAGE = r"\string Header, \string Message | \string MsgArray{*}, \switch Wrap"


def _asked(call: Call, dialog: Dialog) -> Any:
    """Show a question until it is answered (the generator's value), or until something ends it (None)."""
    task, pendant = call.task, call.task.host.devices.pendant
    end = task.now + call.get("MaxTime", math.inf)
    pendant.ask(dialog)
    try:
        while dialog.answer is None:
            broken = _ending(call, end)
            if broken:
                if not call.present("BreakFlag"):
                    raise RapidRuntimeError(broken, f"{call.name}: the operator has given no answer ({broken}).")
                call["BreakFlag"] = task.library.error_number(broken)
                return None
            yield None if math.isinf(end) else end
    finally:
        pendant.withdraw(dialog)
    if call.get("BreakFlag") is not None:
        call["BreakFlag"] = 0.0
    return dialog.answer


def _ending(call: Call, end: float) -> str:
    """The error of what ends the question, "" while nothing does."""
    if call.task.now >= end:
        return "ERR_TP_MAXTIME"
    for name, passive, error in (
        ("DIBreak", "DIPassive", "ERR_TP_DIBREAK"),
        ("DOBreak", "DOPassive", "ERR_TP_DOBREAK"),
    ):
        if call.present(name):
            signal: Signal = call[name]
            if bool(call.task.read_signal(signal.name)) is not call.present(passive):
                return error
    if call.present("PersBoolBreak") and call["PersBoolBreak"] is not call.present("PersBoolPassive"):
        return "ERR_TP_PERSBOOLBREAK"
    return ""


def _message_lines(call: Call) -> tuple[str, ...]:
    r"""The message, of \Message or \MsgArray."""
    array = call.get("MsgArray")
    return tuple(array) if array is not None else tuple(line for line in (call.get("Message", ""),) if line)


def _box_lines(call: Call) -> tuple[str, ...]:
    """The lines of a box, of MsgLine1 and those that are passed."""
    lines = (call.get(f"MsgLine{number}") for number in range(1, MOST_MESSAGE_LINES + 1))
    return tuple(line for line in lines if line is not None)


def _dialog(call: Call, kind: DialogKind, lines: Sequence[str], **more: Any) -> Dialog:
    return Dialog(call.task.name, call.name, kind, call.get("Header", ""), tuple(lines), **more)


def _button_set(call: Call, default: float = 0.0) -> tuple[Choice, ...]:
    r"""Those of \BtnArray, whose values count from 1, or of \Buttons; raises ERR_UI_BUTTONS where there is none."""
    array = call.get("BtnArray")
    if array is not None and any(array):
        return _numbered(array)
    chosen: float = call.get("Buttons", default)
    for value, names in BUTTON_SETS.values():
        if value == chosen and array is None:
            return tuple(Choice(name, float(BUTTON_RESULTS[name])) for name in names)
    raise RapidRuntimeError("ERR_UI_BUTTONS", f"{call.name}: {chosen:g} is not a set of buttons, as btnOK is.")


def _numbered(texts: Sequence[str]) -> tuple[Choice, ...]:
    return tuple(Choice(text, float(number)) for number, text in enumerate(texts, 1))


# The TP instructions ----------------------------------------------------------------------------------------------


@DIALOGS.instruction(
    "TPReadFK",
    "INOUT num TPAnswer, string TPText, string TPFK1, string TPFK2, string TPFK3, string TPFK4, string TPFK5, "
    + _BREAKS,
)
def read_function_key(call: Call) -> Wait:
    keys = _numbered([call[f"TPFK{number}"] for number in range(1, 6)])
    if not any(key.text for key in keys):
        raise RapidRuntimeError("ERR_ARGVALERR", "TPReadFK needs a text for one function key at least.")
    answer = yield from _asked(call, _dialog(call, DialogKind.BUTTON, (call["TPText"],), choices=keys))
    if answer is not None:
        call["TPAnswer"] = answer


@DIALOGS.instruction("TPReadNum", f"INOUT num TPAnswer, string TPText, {_BREAKS}")
@DIALOGS.instruction("TPReadDnum", f"INOUT dnum TPAnswer, string TPText, {_BREAKS}")
def read_number(call: Call) -> Wait:
    answer = yield from _asked(call, _dialog(call, DialogKind.NUMBER, (call["TPText"],)))
    if answer is not None:
        call["TPAnswer"] = answer


# Boxes ------------------------------------------------------------------------------------------------------------


@DIALOGS.instruction(
    "UIMsgBox",
    r"\string Header, string MsgLine1, \string MsgLine2, \string MsgLine3, \string MsgLine4, \string MsgLine5, "
    rf"\switch Wrap, \buttondata Buttons, \icondata Icon, \string Image, \VAR btnres Result, {_BREAKS}",
)
def message_box(call: Call) -> Wait:
    shown = _box_lines(call)
    buttons = _button_set(call)
    if not buttons:  # only shown; the program goes on
        call.task.host.devices.pendant.messages[call.task.name] = (call.get("Header", ""), *shown)
        return
    answer = yield from _asked(call, _dialog(call, DialogKind.BUTTON, shown, choices=buttons))
    if call.present("Result"):
        call["Result"] = float(BUTTON_RESULTS["Unkwn"]) if answer is None else answer


@DIALOGS.function(
    "UIMessageBox",
    rf"{_MESSAGE}, \buttondata Buttons | \string BtnArray{{*}}, \num DefaultBtn, \icondata Icon, \string Image, "
    + _BREAKS,
    "btnres",
)
def message_box_result(call: Call) -> Any:
    r"""The pressed button: a btnres of \Buttons, or the index in \BtnArray from 1."""
    buttons = _button_set(call)
    if not buttons:
        raise RapidRuntimeError("ERR_UI_BUTTONS", "UIMessageBox needs a button.")
    answer = yield from _asked(call, _dialog(call, DialogKind.BUTTON, _message_lines(call), choices=buttons))
    return call.get("DefaultBtn", float(BUTTON_RESULTS["Unkwn"])) if answer is None else answer


@DIALOGS.function(
    "UIListView",
    r"\VAR btnres Result, \string Header, listitem ListItems{*}, \buttondata Buttons | \string BtnArray{*}, "
    rf"\icondata Icon, \num DefaultIndex, {_BREAKS}",
    "num",
)
def list_view(call: Call) -> Any:
    """The chosen item, from 1; 0 where the operator chose none."""
    has_buttons = call.present("BtnArray") or call.present("Buttons")
    items = _numbered([item.text for item in call["ListItems"] if item.text])
    default: float = call.get("DefaultIndex", 0.0)
    more = {"choices": items, "buttons": _button_set(call) if has_buttons else (), "initial": default}
    dialog = _dialog(call, DialogKind.LIST, (), **more)
    answer = yield from _asked(call, dialog)
    if call.present("Result"):
        call["Result"] = float(BUTTON_RESULTS["Unkwn"]) if dialog.button is None else dialog.button
    return default if answer is None else answer


_NUMBER_LIMITS = r"\{0} InitValue, \{0} MinValue, \{0} MaxValue, \switch AsInteger"
for _prefix, _type in (("UINum", "num"), ("UIDnum", "dnum")):
    _entry = rf"{_MESSAGE}, \icondata Icon, {_NUMBER_LIMITS.format(_type)}, {_BREAKS}"
    _tune = (
        rf"{_MESSAGE}, \icondata Icon, {_type} InitValue, {_type} Increment, \{_type} MinValue, \{_type} MaxValue, "
        + _BREAKS
    )

    @DIALOGS.function(f"{_prefix}Entry", _entry, _type)
    @DIALOGS.function(f"{_prefix}Tune", _tune, _type)
    def number_entry(call: Call) -> Any:
        low, high, initial = call.get("MinValue"), call.get("MaxValue"), call.get("InitValue")
        whole = call.present("AsInteger") if call.name.endswith("Entry") else False
        if low is not None and high is not None and low > high:
            raise RapidRuntimeError("ERR_UI_MAXMIN", f"{call.name}: MinValue {low:g} is above MaxValue {high:g}.")
        for value in (initial, low, high) if whole else ():
            if value is not None and value != int(value):
                raise RapidRuntimeError("ERR_UI_NOTINT", f"{call.name}: {value:g} is not an integer.")
        is_low = initial is not None and low is not None and initial < low
        is_high = initial is not None and high is not None and initial > high
        if is_low or is_high:
            raise RapidRuntimeError("ERR_UI_INITVALUE", f"{call.name}: InitValue {initial:g} is not within the limits.")
        more = {"lowest": low, "highest": high, "is_integer": whole, "initial": initial}
        answer = yield from _asked(call, _dialog(call, DialogKind.NUMBER, _message_lines(call), **more))
        return (initial or 0.0) if answer is None else answer


@DIALOGS.function("UIAlphaEntry", rf"{_MESSAGE}, \icondata Icon, \string InitString, {_BREAKS}", "string")
def text_entry(call: Call) -> Any:
    initial: str = call.get("InitString", "")
    answer = yield from _asked(call, _dialog(call, DialogKind.TEXT, _message_lines(call), initial=initial))
    return initial if answer is None else answer


@DIALOGS.function("UIClientExist", "", "bool")
def client_exists(call: Call) -> bool:
    return bool(call.task.host.devices.pendant.is_connected)


@DIALOGS.instruction(
    "UIMsgWrite",
    r"\string Header, string MsgLine1, \string MsgLine2, \string MsgLine3, \string MsgLine4, \string MsgLine5, "
    r"\switch Wrap, \icondata Icon, \string Image",
)
def show_message(call: Call) -> None:
    """A message that stays until UIMsgWriteAbort, while the program goes on."""
    call.task.host.devices.pendant.messages[call.task.name] = (call.get("Header", ""), *_box_lines(call))


@DIALOGS.instruction("UIMsgWriteAbort")
def hide_message(call: Call) -> None:
    call.task.host.devices.pendant.messages.pop(call.task.name, None)
