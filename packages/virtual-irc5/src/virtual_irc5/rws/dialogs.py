"""The virtual controller's answers on ``/rw/rapid/uiinstr``: questions of programs to the operator, and the display."""

from __future__ import annotations

from abb_protocols.rws.documents import Page, RwsState
from abb_protocols.rws.operations import rapid as table
from abb_protocols.rws.operations.operation import get
from abb_protocols.rws.values import RwsCode
from abb_runtime.faults import DISPLAY_PATH
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rapid.devices import DeviceDialog
from virtual_irc5.rws.render import page_at, page_entry
from virtual_irc5.rws.router import Routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, bad_call

_BASE = "/rw/rapid/"
_DISPLAYED = 30  # lines of a task
_ANSWER = "Result"
"""The parameter of a question that is its answer."""


ROUTES = Routes()


@ROUTES.answer(table.DIALOGS)
def _get_dialogs(controller: Irc5, call: RwsCall) -> Page:
    return page_at("rapid", _BASE, "uiinstr", page_entry("rap-uiactive-li", "active", "uiinstr/active"))


@ROUTES.answer(table.ACTIVE_DIALOG)
def _get_active_dialog(controller: Irc5, call: RwsCall) -> table.Dialog:
    """The newest question without an answer."""
    found = controller.devices.pendant.active
    if found is None:
        raise CallFailure(404, RwsCode.UI_NOT_ACTIVE, "no program asks anything")
    return shown_dialog(found)


def shown_dialog(dialog: DeviceDialog) -> table.Dialog:
    """A question in the words of RWS."""
    lines = (line for line in (dialog.header, *dialog.lines) if line)
    return table.Dialog(dialog.instruction, _dialog_stack(dialog), "\n".join(lines))


@ROUTES.answer(table.DIALOG_PARAMETERS)
def _get_dialog_parameters(controller: Irc5, call: RwsCall) -> Page:
    """What the question shows, and the parameter that takes the answer."""
    values = _dialog_values(_dialog_at(controller, call.names["stack"]))
    states = (RwsState("rap-uiparam-li", name, {"name": name, "value": value}) for name, value in values.items())
    return page_at("rapid", f"{_BASE}uiinstr/active/", f"params/{call.names['stack']}", *states)


@ROUTES.answer(table.DIALOG_PARAMETER)
def _get_dialog_parameter(controller: Irc5, call: RwsCall) -> Page:
    stack, _, parameter = call.names["stack"].rpartition("/")
    for name, value in _dialog_values(_dialog_at(controller, stack)).items():
        if name.lower() == parameter.lower():
            state = table.DIALOG_PARAMETER.answered.state(name, value)
            return page_at("rapid", f"{_BASE}uiinstr/active/", f"param/{stack}/{name}", state)
    raise CallFailure(404, RwsCode.NO_SUCH_SYMBOL, f"the question has no parameter {parameter[:50]!r}")


def _dialog_values(dialog: DeviceDialog) -> dict[str, str]:
    return {
        "Header": dialog.header,
        **{f"MsgLine{number}": line for number, line in enumerate(dialog.lines, 1)},
        **{f"Choice{choice.value:g}": choice.text for choice in dialog.choices if choice.text},
        **{f"Button{choice.value:g}": choice.text for choice in dialog.buttons},
        **{
            name: f"{value}"
            for name, value in (
                ("InitValue", dialog.initial),
                ("MinValue", dialog.lowest),
                ("MaxValue", dialog.highest),
            )
            if value is not None
        },
        _ANSWER: "",
    }


@ROUTES.answer(table.ANSWER_DIALOG)
def _answer_dialog(controller: Irc5, call: RwsCall) -> None:
    """Answer the question."""
    stack, _, parameter = call.names["stack"].rpartition("/")
    dialog = _dialog_at(controller, stack)
    if parameter.lower() != _ANSWER.lower():
        raise bad_call(f"the answer to {dialog.instruction} is the parameter {_ANSWER}, not {parameter!r}")
    try:
        dialog.give(call.required("value").removeprefix('"').removesuffix('"'))
    except ValueError as error:
        raise bad_call(str(error)) from error


def _dialog_stack(dialog: DeviceDialog) -> str:
    return f"RAPID/{dialog.task}/%${dialog.number}"


def _dialog_at(controller: Irc5, stack: str) -> DeviceDialog:
    for dialog in controller.devices.pendant.dialogs.values():
        if _dialog_stack(dialog).lower() == stack.lower():
            return dialog
    raise CallFailure(404, RwsCode.FAIL, f"no program asks anything at {stack!r}")


@ROUTES.answer(get(DISPLAY_PATH))
def _get_display(controller: Irc5, call: RwsCall) -> Page:
    """What each task wrote to the FlexPendant last (TPWrite), lines numbered from 1; no ABB controller has this."""
    states = (
        RwsState("display-line", f"{name}/{first + index}", {"task": name, "number": str(first + index), "text": text})
        for name, each in controller.execution.installed.items()
        for lines in [tuple(each.host.lines)[-_DISPLAYED:]]
        for first in [each.host.line_count - len(lines) + 1]
        for index, text in enumerate(lines)
    )
    return page_at("virtual", "/virtual/", "display", *states)
