r"""RAPID's instructions of the FlexPendant: the display, and questions to the operator.

A question (TPReadFK, UIMessageBox and the like) is answered over RWS or the command line. An instruction shows it on
the controller's FlexPendant and is asked for its answer once per advance of the task. It ends without one after
\MaxTime, at \DIBreak, \DOBreak or \PersBoolBreak: with \BreakFlag the program goes on, without it that is an error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.builtins.strings import PRINTED, printed_text
from virtual_irc5.rapid.call import Call, Wait
from virtual_irc5.rapid.devices import DeviceDialog, DialogChoice, DialogKind
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.states import Severity
from virtual_irc5.rapid.types import RapidRuntimeError, Signal

DIALOGS = Library(DATA)
_MOST_MESSAGE_LINES = 5

# The operator's display -------------------------------------------------------------------------------------------


@DIALOGS.instruction("TPErase")
def _erase_display(call: Call) -> None:
    """The host keeps a log of lines, from which nothing is taken back."""


@DIALOGS.instruction("TPWrite", PRINTED)
def _write_display(call: Call) -> None:
    call.task.host.write_text(call.task.name, printed_text(call))


@DIALOGS.instruction(
    "ErrWrite", r"\switch W | \switch I, string Header, string Reason, \string RL2, \string RL3, \string RL4"
)
def _write_event(call: Call) -> None:
    r"""On the display and in the event log: an error, with \W a warning, with \I information."""
    title, host, name = call["Header"], call.task.host, call.task.name
    lines = (call["Reason"], *(call.get(each, "") for each in ("RL2", "RL3", "RL4")))
    text = ": ".join(line for line in lines if line)
    host.write_text(name, ": ".join(line for line in (title, text) if line))
    severity = Severity.WARNING if call.present("W") else Severity.INFORMATION if call.present("I") else Severity.ERROR
    host.write_event(name, title, text, severity, (title, *lines))


# The questions ----------------------------------------------------------------------------------------------------

DIALOGS.record("listitem", {"image": "string", "text": "string"})

# Constants of a button set, and what its buttons give.
_BUTTON_RESULTS = {"Unkwn": 0, "OK": 1, "Abort": 2, "Retry": 3, "Ignore": 4, "Cancel": 5, "Yes": 6, "No": 7}
_BUTTON_SETS: dict[str, tuple[int, tuple[str, ...]]] = {
    "btnNone": (-1, ()),
    "btnOK": (0, ("OK",)),
    "btnAbrtRtryIgn": (1, ("Abort", "Retry", "Ignore")),
    "btnOKCancel": (2, ("OK", "Cancel")),
    "btnRetryCancel": (3, ("Retry", "Cancel")),
    "btnYesNo": (4, ("Yes", "No")),
    "btnYesNoCancel": (5, ("Yes", "No", "Cancel")),
}
for _name, _number in _BUTTON_RESULTS.items():
    DIALOGS.data(f"res{_name}", "btnres", _number)
for _name, (_number, _) in _BUTTON_SETS.items():
    DIALOGS.data(_name, "buttondata", _number)
DIALOGS.constants("icondata", "iconNone=0 iconInfo iconWarning iconError")
DIALOGS.constants("tpnum", "TP_LATEST=1 TP_PROGRAM TP_SCREENVIEWER")

_BREAKS = (
    r"\num MaxTime, \VAR signaldi DIBreak, \switch DIPassive, \VAR signaldo DOBreak, \switch DOPassive, "
    r"\PERS bool PersBoolBreak, \switch PersBoolPassive, \VAR errnum BreakFlag"
)
_MESSAGE = r"\string Header, \string Message | \string MsgArray{*}, \switch Wrap"
_BOX = (
    r"\string Header, string MsgLine1, \string MsgLine2, \string MsgLine3, \string MsgLine4, \string MsgLine5, "
    r"\switch Wrap"
)


def _asked(call: Call, dialog: DeviceDialog) -> Any:
    """Show a question until it is answered (the generator's value), or until something ends it (None)."""
    task, pendant = call.task, call.task.host.devices.pendant
    end = task.now + call.get("MaxTime", math.inf)
    pendant.ask(dialog)
    try:
        while dialog.answer is None:
            broken = _ending(call, end)
            if broken:
                if not call.present("BreakFlag"):
                    raise call.error(broken, f"the operator has given no answer ({broken}).")
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
    for kind in ("DI", "DO"):
        if call.present(f"{kind}Break"):
            signal: Signal = call[f"{kind}Break"]
            if bool(call.task.read_signal(signal.name)) is not call.present(f"{kind}Passive"):
                return f"ERR_TP_{kind}BREAK"
    if call.present("PersBoolBreak") and call["PersBoolBreak"] is not call.present("PersBoolPassive"):
        return "ERR_TP_PERSBOOLBREAK"
    return ""


def _message_lines(call: Call) -> tuple[str, ...]:
    r"""The message, of \Message or \MsgArray."""
    array = call.get("MsgArray")
    return tuple(array) if array is not None else tuple(line for line in (call.get("Message", ""),) if line)


def _box_lines(call: Call) -> tuple[str, ...]:
    """The lines of a box, of MsgLine1 and those that are passed."""
    lines = (call.get(f"MsgLine{number}") for number in range(1, _MOST_MESSAGE_LINES + 1))
    return tuple(line for line in lines if line is not None)


def _dialog(call: Call, kind: DialogKind, lines: Sequence[str], **more: Any) -> DeviceDialog:
    return DeviceDialog(call.task.name, call.name, kind, call.get("Header", ""), tuple(lines), **more)


def _button_set(call: Call) -> tuple[DialogChoice, ...]:
    r"""Those of \BtnArray, whose values count from 1, or of \Buttons; raises ERR_UI_BUTTONS where there is none."""
    array = call.get("BtnArray")
    if array is not None and any(array):
        return _numbered(array)
    chosen: float = call.get("Buttons", 0.0)
    for value, names in _BUTTON_SETS.values():
        if value == chosen and array is None:
            return tuple(DialogChoice(name, float(_BUTTON_RESULTS[name])) for name in names)
    raise call.error("ERR_UI_BUTTONS", f"{chosen:g} is not a set of buttons, as btnOK is.")


def _numbered(texts: Sequence[str]) -> tuple[DialogChoice, ...]:
    return tuple(DialogChoice(text, float(number)) for number, text in enumerate(texts, 1))


# The TP instructions ----------------------------------------------------------------------------------------------


@DIALOGS.instruction(
    "TPReadFK",
    "INOUT num TPAnswer, string TPText, string TPFK1, string TPFK2, string TPFK3, string TPFK4, string TPFK5, "
    + _BREAKS,
)
def _read_function_key(call: Call) -> Wait:
    keys = _numbered([call[f"TPFK{number}"] for number in range(1, 6)])
    if not any(key.text for key in keys):
        raise RapidRuntimeError("ERR_ARGVALERR", "TPReadFK needs a text for one function key at least.")
    answer = yield from _asked(call, _dialog(call, DialogKind.BUTTON, (call["TPText"],), choices=keys))
    if answer is not None:
        call["TPAnswer"] = answer


@DIALOGS.instruction("TPReadNum", f"INOUT num TPAnswer, string TPText, {_BREAKS}")
@DIALOGS.instruction("TPReadDnum", f"INOUT dnum TPAnswer, string TPText, {_BREAKS}")
def _read_number(call: Call) -> Wait:
    answer = yield from _asked(call, _dialog(call, DialogKind.NUMBER, (call["TPText"],)))
    if answer is not None:
        call["TPAnswer"] = answer


# Boxes ------------------------------------------------------------------------------------------------------------


@DIALOGS.instruction(
    "UIMsgBox", rf"{_BOX}, \buttondata Buttons, \icondata Icon, \string Image, \VAR btnres Result, {_BREAKS}"
)
def _message_box(call: Call) -> Wait:
    shown = _box_lines(call)
    buttons = _button_set(call)
    if not buttons:  # only shown; the program goes on
        call.task.host.devices.pendant.messages[call.task.name] = (call.get("Header", ""), *shown)
        return
    answer = yield from _asked(call, _dialog(call, DialogKind.BUTTON, shown, choices=buttons))
    call.give("Result", float(_BUTTON_RESULTS["Unkwn"]) if answer is None else answer)


@DIALOGS.function(
    "UIMessageBox",
    rf"{_MESSAGE}, \buttondata Buttons | \string BtnArray{{*}}, \num DefaultBtn, \icondata Icon, \string Image, "
    + _BREAKS,
    "btnres",
)
def _message_box_result(call: Call) -> Any:
    r"""The pressed button: a btnres of \Buttons, or the index in \BtnArray from 1."""
    buttons = _button_set(call)
    if not buttons:
        raise RapidRuntimeError("ERR_UI_BUTTONS", "UIMessageBox needs a button.")
    answer = yield from _asked(call, _dialog(call, DialogKind.BUTTON, _message_lines(call), choices=buttons))
    return call.get("DefaultBtn", float(_BUTTON_RESULTS["Unkwn"])) if answer is None else answer


@DIALOGS.function(
    "UIListView",
    r"\VAR btnres Result, \string Header, listitem ListItems{*}, \buttondata Buttons | \string BtnArray{*}, "
    rf"\icondata Icon, \num DefaultIndex, {_BREAKS}",
    "num",
)
def _list_view(call: Call) -> Any:
    """The chosen item, from 1; 0 where the operator chose none."""
    has_buttons = call.present("BtnArray") or call.present("Buttons")
    items = _numbered([item.text for item in call["ListItems"] if item.text])
    default: float = call.get("DefaultIndex", 0.0)
    more = {"choices": items, "buttons": _button_set(call) if has_buttons else (), "initial": default}
    dialog = _dialog(call, DialogKind.LIST, (), **more)
    answer = yield from _asked(call, dialog)
    call.give("Result", float(_BUTTON_RESULTS["Unkwn"]) if dialog.button is None else dialog.button)
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
            raise call.error("ERR_UI_MAXMIN", f"MinValue {low:g} is above MaxValue {high:g}.")
        for value in (initial, low, high) if whole else ():
            if value is not None and value != int(value):
                raise call.error("ERR_UI_NOTINT", f"{value:g} is not an integer.")
        is_low = initial is not None and low is not None and initial < low
        is_high = initial is not None and high is not None and initial > high
        if is_low or is_high:
            raise call.error("ERR_UI_INITVALUE", f"InitValue {initial:g} is not within the limits.")
        more = {"lowest": low, "highest": high, "is_integer": whole, "initial": initial}
        answer = yield from _asked(call, _dialog(call, DialogKind.NUMBER, _message_lines(call), **more))
        return (initial or 0.0) if answer is None else answer


@DIALOGS.function("UIAlphaEntry", rf"{_MESSAGE}, \icondata Icon, \string InitString, {_BREAKS}", "string")
def _text_entry(call: Call) -> Any:
    initial: str = call.get("InitString", "")
    answer = yield from _asked(call, _dialog(call, DialogKind.TEXT, _message_lines(call), initial=initial))
    return initial if answer is None else answer


@DIALOGS.function("UIClientExist", "", "bool")
def _client_exists(call: Call) -> bool:
    return bool(call.task.host.devices.pendant.is_connected)


@DIALOGS.instruction("UIMsgWrite", rf"{_BOX}, \icondata Icon, \string Image")
def _show_message(call: Call) -> None:
    """A message that stays until UIMsgWriteAbort, while the program goes on."""
    call.task.host.devices.pendant.messages[call.task.name] = (call.get("Header", ""), *_box_lines(call))


@DIALOGS.instruction("UIMsgWriteAbort")
def _hide_message(call: Call) -> None:
    call.task.host.devices.pendant.messages.pop(call.task.name, None)
