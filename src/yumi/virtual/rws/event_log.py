"""``/rw/elog``: the event log (reference/rws.md §12)."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timezone

from yumi.rws.documents import Argument, Form, Link, Page, State
from yumi.rws.types import Code, Grant
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.controller.events import Event
from yumi.virtual.rws.files import path_of_file
from yumi.virtual.rws.http import HttpReply
from yumi.virtual.rws.operations import Call, Failure, Operation, Values, resource

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


def get_domains(controller: Irc5, call: Call) -> Page:
    states = []
    for number, name in _DOMAINS.items():
        fields = {} if call.option("lang") is None else {"domain-name": name}
        if call.option("resource") == "count":
            fields["numevts"] = str(len(controller.events.entries(number)))
        fields["buffsize"] = "20" if number else "1000"
        states.append(State("elog-domain-li", str(number), fields, (Link("self", str(number)),)))
    return resource("Elog", _BASE, "", *states)


def get_messages(controller: Irc5, call: Call) -> Page:
    """Newest first, in pages counted from 1."""
    domain = _number(call)
    entries = controller.events.entries(domain)
    asked, since = call.option("resource"), call.number_option("elogseqnum", -1)
    if asked in ("count", "info"):
        fields = {"numevts": str(len(entries))}
        if asked == "info":
            fields["buffsize"] = "20" if domain else "1000"
        return resource("Elog", _BASE, str(domain), State("elog-domain", str(domain), fields))
    if since >= 0:
        entries = tuple(event for event in entries if event.number >= since)
    ordered = tuple(reversed(entries)) if call.option("order") == "fifo" else entries
    size = min(call.number_option("limit", _PAGE), _PAGE)
    number = max(call.number_option("start", 1), 1)
    shown = ordered[(number - 1) * size : number * size]
    asked_for = "".join(f"{name}={text}&" for name, text in call.query if name in ("lang", "order", "resource"))
    more = f"{domain}?{asked_for}start={number + 1}&limit={size}" if number * size < len(ordered) else None
    states = (_message("elog-message-li", domain, event, call) for event in shown)
    return resource("Elog", _BASE, str(domain), *states, next_href=more)


def get_message(controller: Irc5, call: Call) -> Page:
    domain, number = _number(call), call.names["number"]
    for event in controller.events.entries(domain):
        if str(event.number) == number:
            state = _message("elog-message", domain, event, call)
            return resource("Elog", _BASE, f"{domain}/{number}", state)
    raise Failure(404, Code.FAIL, f"domain {domain} has no message {number}")


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
        "tstamp": datetime.fromtimestamp(event.time, timezone.utc).strftime("%Y-%m-%d T %H:%M:%S"),
        "argc": str(len(event.arguments)),
    }
    if call.option("lang") is not None and call.option("resource") == "title":
        fields["title"] = event.title
    elif call.option("lang") is not None:
        texts = {"title": event.title, "desc": event.description}
        fields |= {**texts, "conseqs": "", "causes": "", "actions": ""}
    title = f"/rw/elog/{domain}/{event.number}"
    arguments = tuple(Argument("string", text) for text in event.arguments)
    return State(type, title, fields, (Link("self", f"{domain}/{event.number}"),), arguments=arguments)


def save_raw(controller: Irc5, call: Call) -> HttpReply:
    path = path_of_file(call.required("path"))

    def work() -> None:
        events = reversed(controller.events.entries())
        lines = (f"{e.number} {e.time:.3f} {int(e.type)} {e.code} {e.title} {e.description}" for e in events)
        controller.files[path] = "\n".join(lines) + "\n"

    job = controller.jobs.begin(work, 1.0)
    return HttpReply(202, (("Location", f"/progress/{job.number}"), ("Content-Type", Form.XHTML.value)))


_LANG: Values = {"lang": ()}
_DOMAIN_QUERY: Values = {
    **_LANG,
    "resource": ("count", "info", "title"),
    "order": ("lifo", "fifo"),
    "elogseqnum": (),
    "start": (),
    "limit": (),
}
OPERATIONS = (
    Operation("GET", "/rw/elog", get_domains, query={**_LANG, "resource": ("count",)}),
    Operation(
        "POST",
        "/rw/elog",
        lambda controller, _: controller.events.clear(),
        "clearall",
        needs_grant=Grant.EVENTLOG_CLEAR,
    ),
    Operation("POST", "/rw/elog", save_raw, "saveraw", {"path": ()}, status=202, needs_grant=Grant.FTP_WRITE),
    Operation("GET", "/rw/elog/{domain}", get_messages, query=_DOMAIN_QUERY),
    Operation(
        "POST",
        "/rw/elog/{domain}",
        lambda controller, call: controller.events.clear(_number(call)),
        "clear",
        needs_grant=Grant.EVENTLOG_CLEAR,
    ),
    Operation("GET", "/rw/elog/{domain}/{number}", get_message, query=_LANG),
)
