"""``/rw/elog``: the event log (reference/rws.md §12)."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timezone

from yumi.rws.codes import Code
from yumi.rws.pages import Argument, Link, Page, State
from yumi.virtual.events import Event
from yumi.virtual.rws_port import Controller
from yumi.virtual.rws_routes import Call, Failure, Route, resource

_BASE = "/rw/elog/"
_PAGE = 50
_DOMAINS: Mapping[int, str] = {
    0: "Common",
    1: "Operational",
    2: "System",
    3: "Hardware",
    4: "Program",
    5: "Motion",
    7: "I/O & Communication",
    8: "User",
    9: "Safety",
    10: "Internal",
    11: "Process",
    12: "Configuration",
    15: "RAPID",
    17: "Connected Services",
}


def _domains(controller: Controller, call: Call) -> Page:
    return resource("Elog", _BASE, "", *(_domain(controller, call, number) for number in _DOMAINS))


def _domain(controller: Controller, call: Call, number: int) -> State:
    fields = {} if call.option("lang") is None else {"domain-name": _DOMAINS[number]}
    if call.option("resource") == "count":
        fields["numevts"] = str(len(controller.events.entries(number)))
    fields["buffsize"] = "20" if number else "1000"
    return State("elog-domain-li", str(number), fields, (Link("self", str(number)),))


def _messages(controller: Controller, call: Call) -> Page:
    """Newest first, in pages counted from 1."""
    domain = _number(call)
    entries = controller.events.entries(domain)
    ordered = tuple(reversed(entries)) if call.option("order") == "fifo" else entries
    size = min(call.number_option("limit", _PAGE), _PAGE)
    number = max(call.number_option("start", 1), 1)
    shown = ordered[(number - 1) * size : number * size]
    more = f"{domain}?start={number + 1}&limit={size}" if number * size < len(ordered) else None
    states = (_message("elog-message-li", domain, event, call) for event in shown)
    return resource("Elog", _BASE, str(domain), *states, next_href=more)


def _one_message(controller: Controller, call: Call) -> Page:
    domain, wanted = _number(call), call.names["number"]
    for event in controller.events.entries(domain):
        if str(event.number) == wanted:
            state = _message("elog-message", domain, event, call)
            return resource("Elog", _BASE, f"{domain}/{wanted}", state)
    raise Failure(404, Code.FAIL, f"domain {domain} has no message {wanted}")


def _clear(controller: Controller, call: Call) -> None:
    controller.events.clear(_number(call))


def _clear_all(controller: Controller, call: Call) -> None:
    controller.events.clear()


def _number(call: Call) -> int:
    text = call.names["domain"]
    if text not in map(str, _DOMAINS):
        raise Failure(404, Code.FAIL, f"there is no event log {text!r}")
    return int(text)


def _message(type: str, domain: int, event: Event, call: Call) -> State:
    fields = {
        "msgtype": str(int(event.type)),
        "code": str(event.code),
        "src-name": "MC0",
        "tstamp": _time(event.time),
        "argc": str(len(event.arguments)),
    }
    if call.option("lang") is not None:
        texts = {"title": event.title, "desc": event.description}
        fields |= {**texts, "conseqs": "", "causes": "", "actions": ""}
    title = f"/rw/elog/{domain}/{event.number}"
    arguments = tuple(Argument("string", text) for text in event.arguments)
    return State(type, title, fields, (Link("self", f"{domain}/{event.number}"),), arguments=arguments)


def _time(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, timezone.utc).strftime("%Y-%m-%d T %H:%M:%S")


ROUTES = (
    Route("GET", "/rw/elog", _domains),
    Route("POST", "/rw/elog", _clear_all, "clearall"),
    Route("GET", "/rw/elog/{domain}", _messages),
    Route("POST", "/rw/elog/{domain}", _clear, "clear"),
    Route("GET", "/rw/elog/{domain}/{number}", _one_message),
)
