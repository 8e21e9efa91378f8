"""Subscription groups: who is to be told of what, what has been told, and on which channel (reference/rws.md §14).

A change is told at once when the resource has been quiet for as long as its priority asks, and else at the end of that
time, with its last value. A group whose client is not connected yet, or not any more, tells the latest values when it
comes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

from yumi.links.channel import Channel
from yumi.rws.event_pages import write_event
from yumi.rws.subscriptions import Priority, Resource
from yumi.virtual.rws_sources import Event, Source

SPACING: Mapping[Priority, float] = {Priority.LOW: 5.0, Priority.MEDIUM: 0.2, Priority.HIGH: 0.05}
"""Shortest time between two events of a resource [s]."""

GLANCE = 0.012
"""Time between two looks at all resources of a group [s]."""


@dataclass(slots=True)
class Watch:
    """One resource of a group.

    Attributes:
        resource: what it is.
        source: where its value comes from.
        told: the value the client knows.
        quiet_until: no event before this time [s].
    """

    resource: Resource
    source: Source
    told: str | None
    quiet_until: float = -inf

    def news(self, now: float) -> Sequence[Event]:
        """The events that are due."""
        if now < self.quiet_until:
            return ()
        value = self.source.read()
        if value is None or value == self.told:
            return ()
        events = self.source.show(self.told, value)
        self.told = value
        # What changes all the time keeps its pace: a look that comes late does not put off the next.
        begin = self.quiet_until if now - self.quiet_until <= 2.0 * GLANCE else now
        self.quiet_until = begin + SPACING[self.resource.priority]
        return events


@dataclass(slots=True)
class Group:
    """What one client wants to be told of.

    Attributes:
        number: as in its address.
        session: who it belongs to.
        root: host and port as the client calls them.
        watches: by the path of the resource.
        channel: where its events go; None before the client has come.
    """

    number: int
    session: str
    root: str
    watches: dict[str, Watch] = field(default_factory=dict)
    channel: Channel | None = None
    _looked_at: float = -inf

    def advance(self, now: float) -> None:
        """Tell what has changed."""
        if self.channel is None or not self.channel.is_open or now < self._looked_at + GLANCE:
            return
        self._looked_at = now
        for watch in self.watches.values():
            for event in watch.news(now):
                self.channel.send(write_event(self.root, self.number, event))

    def end(self, *, in_order: bool) -> None:
        """Part from the client."""
        if self.channel is not None:
            self.channel.close() if in_order else self.channel.abort()
            self.channel = None


class Groups:
    """All groups of a server."""

    def __init__(self) -> None:
        self._groups: dict[int, Group] = {}
        self._opened = 0

    def of_session(self, session: str) -> list[Group]:
        """The groups of one client."""
        return [group for group in self._groups.values() if group.session == session]

    def listening(self) -> set[str]:
        """The sessions whose clients are connected."""
        groups = self._groups.values()
        return {group.session for group in groups if group.channel is not None and group.channel.is_open}

    def find(self, number: str) -> Group | None:
        """The group of a number as it is written in an address."""
        return next((group for known, group in self._groups.items() if str(known) == number), None)

    def count(self, priority: Priority) -> int:
        """How many resources have a priority, of all clients."""
        watches = (watch for group in self._groups.values() for watch in group.watches.values())
        return sum(watch.resource.priority is priority for watch in watches)

    def open(self, session: str, root: str, watches: Mapping[str, Watch]) -> Group:
        self._opened += 1
        group = Group(self._opened, session, root, dict(watches))
        self._groups[group.number] = group
        return group

    def close(self, group: Group, *, in_order: bool = True) -> None:
        """Forget a group."""
        self._groups.pop(group.number, None)
        group.end(in_order=in_order)

    def keep(self, sessions: Sequence[str]) -> None:
        """Forget the groups of all other sessions, and those whose client has left."""
        for group in tuple(self._groups.values()):
            if group.session not in sessions or (group.channel is not None and group.channel.has_left):
                self.close(group)

    def drop_channels(self) -> None:
        """Cut all clients off; they may come again."""
        for group in self._groups.values():
            group.end(in_order=False)

    def advance(self, now: float) -> None:
        """Tell every client what has changed."""
        for group in self._groups.values():
            group.advance(now)
