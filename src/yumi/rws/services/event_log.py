"""The event log: domains, messages, clearing, saving."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.rws import replies
from yumi.rws.replies import Event
from yumi.rws.services.requests import Requests, file_path, get, post

_EVENTS_PER_PAGE = 50


@dataclass(frozen=True, slots=True)
class EventDomain:
    """A part of the event log: how many messages it has, and can have."""

    number: int
    name: str
    messages: int
    capacity: int


class EventLog(Requests):
    """``/rw/elog``."""

    def events(self, domain: int = 0, count: int = _EVENTS_PER_PAGE) -> tuple[Event, ...]:
        """The newest ``count`` messages of the event log, newest first; domain 0 holds all domains."""
        size = min(count, _EVENTS_PER_PAGE)
        found: tuple[Event, ...] = ()
        while len(found) < count:
            number = len(found) // size + 1
            query = (("lang", "en"), ("order", "lifo"), ("start", str(number)), ("limit", str(size)))
            page = self._read(get(f"/rw/elog/{domain}", *query), replies.events, f"reading the event log {domain}")
            found += page
            if len(page) < size:
                break
        return found[:count]

    def clear_events(self, domain: int = 0) -> None:
        """Empty an event log; domain 0 empties all."""
        self._do(post(f"/rw/elog/{domain}", "clear"), f"clearing the event log {domain}")

    def event_domains(self) -> tuple[EventDomain, ...]:
        """The domains of the event log; 0 holds all."""
        states = self._states("reading the event log", "/rw/elog", ("lang", "en"), ("resource", "count"))
        return tuple(
            EventDomain(int(state.title), state.text("domain-name"), state.whole("numevts"), state.whole("buffsize"))
            for state in states
        )

    def event(self, number: int, domain: int = 0) -> Event:
        """One message, by its number."""
        request = get(f"/rw/elog/{domain}/{number}", ("lang", "en"))
        (found,) = self._read(request, replies.events, f"reading event {number}")
        return found

    def clear_all_events(self) -> None:
        """Empty all event logs."""
        self._do(post("/rw/elog", "clearall"), "clearing the event logs")

    def save_events(self, path: str) -> None:
        """Write the event log to a file of the controller."""
        self._do(post("/rw/elog", "saveraw", ("path", file_path(path))), "saving the event log")
