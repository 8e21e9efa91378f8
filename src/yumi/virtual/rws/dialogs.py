"""``/rw/rapid/uiinstr``: the question that a program asks the operator, and its answer (reference/rws.md §6.8)."""

from __future__ import annotations

from yumi.rapid.devices import Dialog
from yumi.rws.documents import Page, State
from yumi.rws.types import Code
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.rws.operations import Call, Failure, Operation, entry, invalid, resource

_BASE = "/rw/rapid/"
_ANSWER = "Result"
"""The parameter of a question that is its answer."""


def get_dialogs(controller: Irc5, call: Call) -> Page:
    return resource("rapid", _BASE, "uiinstr", entry("rap-uiactive-li", "active", "uiinstr/active"))


def get_active(controller: Irc5, call: Call) -> Page:
    """The newest question without an answer."""
    fields = dialog_fields(_active(controller))
    return resource("rapid", f"{_BASE}uiinstr/", "active", State("rap-uiactive-li", "active", fields))


def dialog_fields(dialog: Dialog) -> dict[str, str]:
    """A question in the words of RWS."""
    return {
        "instr": dialog.instruction,
        "event": "POST",
        "stack": _stack(dialog),
        "execlv": "User",
        "msg": "\n".join(line for line in (dialog.header, *dialog.lines) if line),
    }


def get_parameters(controller: Irc5, call: Call) -> Page:
    """What the question shows, and the parameter that takes the answer."""
    values = _values(_named(controller, call.names["stack"]))
    states = (State("rap-uiparam-li", name, {"name": name, "value": value}) for name, value in values.items())
    return resource("rapid", f"{_BASE}uiinstr/active/", f"params/{call.names['stack']}", *states)


def get_parameter(controller: Irc5, call: Call) -> Page:
    stack, _, parameter = call.names["stack"].rpartition("/")
    for name, value in _values(_named(controller, stack)).items():
        if name.lower() == parameter.lower():
            state = State("rap-uiparam", name, {"value": value})
            return resource("rapid", f"{_BASE}uiinstr/active/", f"param/{stack}/{name}", state)
    raise Failure(404, Code.NO_SUCH_SYMBOL, f"the question has no parameter {parameter[:50]!r}")


def _values(dialog: Dialog) -> dict[str, str]:
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


def set_parameter(controller: Irc5, call: Call) -> None:
    """Answer the question."""
    stack, _, parameter = call.names["stack"].rpartition("/")
    dialog = _named(controller, stack)
    if parameter.lower() != _ANSWER.lower():
        raise invalid(f"the answer to {dialog.instruction} is the parameter {_ANSWER}, not {parameter!r}")
    try:
        dialog.give(call.required("value").removeprefix('"').removesuffix('"'))
    except ValueError as error:
        raise invalid(str(error)) from error


def _stack(dialog: Dialog) -> str:
    return f"RAPID/{dialog.task}/%${dialog.number}"


def _active(controller: Irc5) -> Dialog:
    found = controller.devices.pendant.active
    if found is None:
        raise Failure(404, Code.UI_NOT_ACTIVE, "no program asks anything")
    return found


def _named(controller: Irc5, stack: str) -> Dialog:
    for dialog in controller.devices.pendant.dialogs.values():
        if _stack(dialog).lower() == stack.lower():
            return dialog
    raise Failure(404, Code.FAIL, f"no program asks anything at {stack!r}")


OPERATIONS = (
    Operation("GET", "/rw/rapid/uiinstr", get_dialogs),
    Operation("GET", "/rw/rapid/uiinstr/active", get_active),
    Operation("GET", "/rw/rapid/uiinstr/active/params/{stack:.+}", get_parameters),
    Operation("GET", "/rw/rapid/uiinstr/active/param/{stack:.+}", get_parameter),
    Operation("POST", "/rw/rapid/uiinstr/active/param/{stack:.+}", set_parameter, "set", {"value": ()}),
)
