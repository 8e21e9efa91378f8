"""The virtual controller's answers on ``/rw/elog``: the event log (reference/rws.md §12)."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timezone

from abb_protocols.rws.documents import EventArgument, Page, RwsLink, RwsState
from abb_protocols.rws.operations import event_log as table
from abb_protocols.rws.values import RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller_log import ControllerLogEvent
from virtual_irc5.rws.files import path_of_file
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.render import page_at
from virtual_irc5.rws.router import Routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall

_LOG_BASE = "/rw/elog/"
_LOG_PAGE = 50

_LOG_DOMAINS: Mapping[int, str] = {
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

ROUTES = Routes()


@ROUTES.answer(table.LOGS)
def _get_logs(controller: Irc5, call: RwsCall) -> Page:
    states = []
    for number, name in _LOG_DOMAINS.items():
        fields = {} if call.option("lang") is None else {"domain-name": name}
        if call.option("resource") == "count":
            fields["numevts"] = str(len(controller.events.entries(number)))
        fields["buffsize"] = "20" if number else "1000"
        states.append(RwsState("elog-domain-li", str(number), fields, (RwsLink("self", str(number)),)))
    return page_at("Elog", _LOG_BASE, "", *states)


@ROUTES.answer(table.EVENTS)
def _get_events(controller: Irc5, call: RwsCall) -> Page:
    """Newest first, in pages counted from 1."""
    domain = _log_domain(call)
    entries = controller.events.entries(domain)
    asked, since = call.option("resource"), call.number_option("elogseqnum", -1)
    if asked in ("count", "info"):
        fields = {"numevts": str(len(entries))}
        if asked == "info":
            fields["buffsize"] = "20" if domain else "1000"
        return page_at("Elog", _LOG_BASE, str(domain), RwsState("elog-domain", str(domain), fields))
    if since >= 0:
        entries = tuple(event for event in entries if event.number >= since)
    ordered = tuple(reversed(entries)) if call.option("order") == "fifo" else entries
    size = min(call.number_option("limit", _LOG_PAGE), _LOG_PAGE)
    number = max(call.number_option("start", 1), 1)
    shown = ordered[(number - 1) * size : number * size]
    asked_for = "".join(f"{name}={text}&" for name, text in call.query if name in ("lang", "order", "resource"))
    more = f"{domain}?{asked_for}start={number + 1}&limit={size}" if number * size < len(ordered) else None
    states = (_event_state("elog-message-li", domain, event, call) for event in shown)
    return page_at("Elog", _LOG_BASE, str(domain), *states, next_href=more)


@ROUTES.answer(table.EVENT)
def _get_event(controller: Irc5, call: RwsCall) -> Page:
    domain, number = _log_domain(call), call.names["number"]
    for event in controller.events.entries(domain):
        if str(event.number) == number:
            state = _event_state("elog-message", domain, event, call)
            return page_at("Elog", _LOG_BASE, f"{domain}/{number}", state)
    raise CallFailure(404, RwsCode.FAIL, f"domain {domain} has no message {number}")


def _log_domain(call: RwsCall) -> int:
    text = call.names["domain"]
    if text not in map(str, _LOG_DOMAINS):
        raise CallFailure(404, RwsCode.FAIL, f"there is no event log {text!r}")
    return int(text)


def _event_state(type: str, domain: int, event: ControllerLogEvent, call: RwsCall) -> RwsState:
    fields = {
        "msgtype": str(int(event.type)),
        "code": str(event.code),
        "src-name": "MC0",
        "tstamp": datetime.fromtimestamp(event.time, timezone.utc).strftime("%Y-%m-%d T %H:%M:%S"),
        "argc": str(len(event.arguments)),
    }
    if call.option("lang") is not None and call.option("resource") == "title":
        fields["title"] = event.title
    elif call.option("lang") is not None:
        texts = {"title": event.title, "desc": event.description}
        fields |= {**texts, "conseqs": "", "causes": "", "actions": ""}
    title = f"/rw/elog/{domain}/{event.number}"
    arguments = tuple(EventArgument("string", text) for text in event.arguments)
    return RwsState(type, title, fields, (RwsLink("self", f"{domain}/{event.number}"),), arguments=arguments)


@ROUTES.answer(table.SAVE_EVENTS)
def _save_events(controller: Irc5, call: RwsCall) -> HttpReply:
    path = path_of_file(call.required("path"))

    def work() -> None:
        events = reversed(controller.events.entries())
        lines = (f"{e.number} {e.time:.3f} {int(e.type)} {e.code} {e.title} {e.description}" for e in events)
        controller.files[path] = "\n".join(lines) + "\n"

    return HttpReply.at(f"/progress/{controller.jobs.begin(work, 1.0).number}")


@ROUTES.answer(table.CLEAR_ALL_EVENTS)
def _clear_all(controller: Irc5, call: RwsCall) -> None:
    controller.events.clear()


@ROUTES.answer(table.CLEAR_EVENTS)
def _clear(controller: Irc5, call: RwsCall) -> None:
    controller.events.clear(_log_domain(call))
