"""Operations on the event log (``/rw/elog``), and the client's calls of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from abb_protocols.catalogue import message
from abb_protocols.errors import ProtocolError
from abb_protocols.rws.documents import RwsState, member, whole_number
from abb_protocols.rws.operations.files import file_path
from abb_protocols.rws.operations.operation import get, post
from abb_protocols.rws.operations.operation_answer import Spelling, record
from abb_protocols.rws.operations.service import Service
from abb_protocols.rws.values import EventType, Grant

_DOMAIN = "/rw/elog/{domain}"
_EVENTS_PER_PAGE = 50
_NUMBER: Spelling[int] = Spelling(lambda state, name: whole_number(name, state.title), lambda name, value: {})
_STATES = ("elog-message-li", "elog-message")  # types of those that show an event


@dataclass(frozen=True, slots=True)
class RwsEvent:
    """One message of the event log.

    Attributes:
        number: of the message; it rises with each.
        type: its weight.
        code: ABB's number of the event.
        time: the controller's local time as it prints it.
        title: one line.
        description: what happened, in ABB's words.
        arguments: what the controller put into those words.
    """

    number: int
    type: EventType
    code: int
    time: str
    title: str
    description: str
    arguments: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class EventDomain:
    """A part of the event log: how many messages it has, and can have."""

    number: Annotated[int, "domain", _NUMBER]
    name: Annotated[str, "domain-name"]
    messages: Annotated[int, "numevts"]
    capacity: Annotated[int, "buffsize"]


_DOMAIN_IN_LIST = record("elog-domain-li", EventDomain)  # with resource=count

LOGS = get("/rw/elog", "lang, resource=count")
CLEAR_ALL_EVENTS = post("/rw/elog", "clearall", grant=Grant.EVENTLOG_CLEAR)
SAVE_EVENTS = post("/rw/elog", "saveraw", "path", grant=Grant.FTP_WRITE, status=202)
EVENTS = get(_DOMAIN, "lang, resource=count|info|title, order=lifo|fifo, elogseqnum, start, limit")
CLEAR_EVENTS = post(_DOMAIN, "clear", grant=Grant.EVENTLOG_CLEAR)
EVENT = get(f"{_DOMAIN}/{{number}}", "lang")


def read_event(state: RwsState) -> RwsEvent:
    """The event that a state shows."""
    number = state.title.rpartition("/")[2]
    if not number.isdecimal():
        raise ProtocolError(message("event_without_number", title=state.title))
    return RwsEvent(
        number=int(number),
        type=member(EventType, state.whole("msgtype")),
        code=state.whole("code"),
        time=state.text("tstamp"),
        title=state.text("title"),
        description=state.text("desc"),
        arguments=tuple(argument.value for argument in state.arguments),
    )


class EventLogService(Service):
    """``/rw/elog``."""

    def events(self, domain: int = 0, count: int = _EVENTS_PER_PAGE) -> tuple[RwsEvent, ...]:
        """The newest ``count`` messages of the event log, newest first; domain 0 holds all domains."""
        size = min(count, _EVENTS_PER_PAGE)
        found: tuple[RwsEvent, ...] = ()
        while len(found) < count:
            what, number = f"reading the event log {domain}", len(found) // size + 1
            asked = self._shown(what, EVENTS, str(domain), lang="en", order="lifo", start=number, limit=size)
            page = tuple(map(read_event, asked.of_type(*_STATES)))
            found += page
            if len(page) < size:
                break
        return found[:count]

    def clear_events(self, domain: int = 0) -> None:
        """Empty an event log; domain 0 empties all."""
        self._call(f"clearing the event log {domain}", CLEAR_EVENTS, str(domain))

    def event_domains(self) -> tuple[EventDomain, ...]:
        """The domains of the event log; 0 holds all."""
        return tuple(
            map(_DOMAIN_IN_LIST.read, self._listed("reading the event log", LOGS, lang="en", resource="count"))
        )

    def event(self, number: int, domain: int = 0) -> RwsEvent:
        """One message, by its number."""
        page = self._shown(f"reading event {number}", EVENT, str(domain), str(number), lang="en")
        return read_event(page.one(*_STATES))

    def clear_all_events(self) -> None:
        """Empty all event logs."""
        self._call("clearing the event logs", CLEAR_ALL_EVENTS)

    def save_events(self, path: str) -> None:
        """Write the event log to a file of the controller."""
        self._call("saving the event log", SAVE_EVENTS, path=file_path(path))
