"""The virtual controller's answers on ``/subscription`` and ``/poll``: events, and their WebSockets (rws.md §14).

An event is sent at once when its resource has been quiet for as long as its priority asks, and else at the end of that
time, with the last value. A group whose client is not connected (yet, or any more) sends the latest values when the
client connects.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import Protocol

from abb_protocols.errors import ProtocolError
from abb_protocols.rws.documents import Form, Pairs, first_value
from abb_protocols.rws.operations import subscriptions as table
from abb_protocols.rws.values import PROTOCOL, Priority, Resource, RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.mastership import Mastership
from virtual_irc5.rws.queues import DipcQueues
from virtual_irc5.rws.render import render_event, write_group
from virtual_irc5.rws.router import Route
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, bad_call
from virtual_irc5.rws.sources import Event, Source, find_source, mastership_source, queue_source, rmmp_source
from virtual_irc5.rws.users import VirtualUsers

_MAX_GROUPS = 2
"""Groups a session may have."""

_MAX_RESOURCES = 1000
"""Resources a group may have."""

_MAX_HIGH = 64
"""Resources with high priority, of all clients together."""


class SubscriptionChannel(Protocol):
    """The server's end of a WebSocket; its methods may be called from any thread."""

    @property
    def is_open(self) -> bool: ...

    @property
    def has_left(self) -> bool:
        """Whether the client has closed the connection in order."""

    def send(self, text: str) -> None:
        """Send a message; it is lost when the channel is closed."""

    def close(self) -> None:
        """End the connection in order."""

    def abort(self) -> None:
        """Break the connection."""


@dataclass(frozen=True, slots=True)
class Upgrade:
    """The answer to a request that opens a WebSocket.

    Attributes:
        protocol: the sub-protocol.
        attach: gets the channel before the client sees that it is open, on the server's thread.
        headers: names and values beside those of the protocol.
    """

    protocol: str
    attach: Callable[[SubscriptionChannel], None]
    headers: tuple[tuple[str, str], ...] = ()


def read_resources(form: Pairs) -> tuple[Resource, ...]:
    """The resources a form asks for.

    Raises:
        ProtocolError: a path or a priority is missing, or the priority is none.
    """
    numbers = [value for name, value in form if name == "resources"]
    if not numbers:
        raise ProtocolError("the body lacks resources")
    resources: list[Resource] = []
    for number in numbers:
        path, priority = first_value(form, number), first_value(form, f"{number}-p")
        if not path or priority is None:
            raise ProtocolError(f"the body lacks {number if not path else f'{number}-p'}")
        if priority not in ("0", "1", "2"):
            raise ProtocolError(f"{number}-p is 0, 1 or 2, not {priority!r}")
        resources.append(Resource(path, Priority(int(priority))))
    return tuple(resources)


# Groups: what a client has subscribed to, and the channel its events go to


_SPACING: Mapping[Priority, float] = {Priority.LOW: 5.0, Priority.MEDIUM: 0.2, Priority.HIGH: 0.05}
"""Shortest time between two events of a resource [s]."""

POLL_PERIOD = 0.012
"""Time after which all resources of a group are read again [s]."""


@dataclass(frozen=True, slots=True)
class SubscriptionRules:
    """What differs between the versions of Robot Web Services.

    Attributes:
        protocol: sub-protocol of the WebSocket.
        is_secure: whether addresses are those of TLS.
        max_groups: groups a session may have.
        rws1_resource: the path of a resource in 1.0; "" for one that there is not.
        is_adding: whether a change of a group adds to its resources; else it replaces them.
        outlives_connection: whether a group whose WebSocket breaks waits for the next one.
    """

    protocol: str = PROTOCOL
    is_secure: bool = False
    max_groups: int = _MAX_GROUPS
    rws1_resource: Callable[[str], str] = str
    is_adding: bool = False
    outlives_connection: bool = True


@dataclass(slots=True)
class _Watch:
    """One resource of a group.

    Attributes:
        resource: what it is.
        source: where its value comes from.
        known: the value the client knows.
        quiet_until: no event before this time [s].
    """

    resource: Resource
    source: Source
    known: str | None
    quiet_until: float = -inf

    def due_events(self, now: float) -> Sequence[Event]:
        """The events to send now."""
        if now < self.quiet_until:
            return ()
        value = self.source.read()
        if value is None or value == self.known:
            return ()
        events = self.source.show(self.known, value)
        self.known = value
        # What changes all the time keeps its rate: a poll that comes late does not delay the next event.
        begin = self.quiet_until if now - self.quiet_until <= 2.0 * POLL_PERIOD else now
        self.quiet_until = begin + _SPACING[self.resource.priority]
        return events


@dataclass(slots=True)
class _Group:
    """What one client has subscribed to together.

    Attributes:
        number: as in its address.
        session: of the client.
        root: host and port as the client calls them.
        is_secure: whether the client comes by TLS.
        watches: by the path of the resource.
        channel: where its events go; None before the client has connected.
    """

    number: int
    session: str
    root: str
    is_secure: bool = False
    watches: dict[str, _Watch] = field(default_factory=dict)
    channel: SubscriptionChannel | None = None
    _polled_at: float = -inf

    def advance(self, now: float) -> None:
        """Send the events that are due."""
        if self.channel is None or not self.channel.is_open or now < self._polled_at + POLL_PERIOD:
            return
        self._polled_at = now
        for watch in self.watches.values():
            for event in watch.due_events(now):
                self.channel.send(render_event(self.root, self.number, event, is_secure=self.is_secure))

    def disconnect(self, *, in_order: bool) -> None:
        """End the connection to the client."""
        if self.channel is not None:
            self.channel.close() if in_order else self.channel.abort()
            self.channel = None


class Subscriptions:
    """The groups of all clients of a server, and the operations on them.

    Args:
        mastership: of the server's sessions.
        users: of them.
        messages: their message queues.
        rules: of the version that the server speaks.
    """

    def __init__(
        self, mastership: Mastership, users: VirtualUsers, messages: DipcQueues, rules: SubscriptionRules
    ) -> None:
        self._rules = rules
        self._mastership = mastership
        self._users = users
        self._messages = messages
        self._groups: dict[int, _Group] = {}
        self._opened = 0
        self.routes = (
            Route(table.CREATE_SUBSCRIPTION, self.create),
            Route(table.SUBSCRIPTION_GROUP, self.show),
            Route(table.REPLACE_SUBSCRIPTION, self.replace),
            Route(table.DELETE_SUBSCRIPTION, self.delete),
            Route(table.DELETE_SUBSCRIBED_RESOURCE, self.delete_resource),
        )

    def listening(self) -> set[str]:
        """The sessions whose clients are connected."""
        groups = self._groups.values()
        return {group.session for group in groups if group.channel is not None and group.channel.is_open}

    def keep(self, sessions: Collection[str]) -> None:
        """Forget the groups of all other sessions, and those whose client has left."""
        for group in tuple(self._groups.values()):
            channel = group.channel
            has_left = channel is not None and channel.has_left
            is_lost = channel is not None and not channel.is_open and not self._rules.outlives_connection
            if group.session not in sessions or has_left or is_lost:
                self._close(group)

    def drop_channels(self) -> None:
        """Break all connections; clients may connect again where a group outlives its connection."""
        for group in tuple(self._groups.values()):
            if group.channel is not None and not self._rules.outlives_connection:
                del self._groups[group.number]
            group.disconnect(in_order=False)

    def advance(self, now: float) -> None:
        """Send the events that are due to every client."""
        for group in self._groups.values():
            group.advance(now)

    def upgrade(self, path: Sequence[str], session: str, protocols: str) -> Upgrade:
        """The WebSocket of ``/poll/{group}``; a client that leaves the number out gets its latest group.

        Raises:
            CallFailure: the group is another client's, or there is none, or the sub-protocol is another.
        """
        protocol = self._rules.protocol
        if protocol not in (each.strip() for each in protocols.split(",")):
            raise bad_call(f"Unsupported Sec-WebSocket-Protocol {protocols!r}; it is {protocol}")
        if len(path) > 1:
            group = self._find(path[1], session)
        else:
            own = [group for group in self._groups.values() if group.session == session]
            if not own:
                raise CallFailure(404, RwsCode.FAIL, "there is no subscription of this client")
            group = own[-1]

        def attach(channel: SubscriptionChannel) -> None:
            group.disconnect(in_order=True)  # a client that connects again leaves its old connection
            group.channel = channel
            if self._groups.get(group.number) is not group:
                group.disconnect(in_order=True)  # the group was closed while the connection was made

        return Upgrade(protocol, attach)

    def create(self, controller: Irc5, call: RwsCall) -> HttpReply:
        most = self._rules.max_groups
        if sum(group.session == call.session for group in self._groups.values()) >= most:
            raise CallFailure(400, RwsCode.MAX_LIMIT_REACHED, f"a client has {most} subscriptions at most")
        watches = self._watches(controller, call)
        self._opened += 1
        group = self._groups[self._opened] = _Group(
            self._opened, call.session, call.host, self._rules.is_secure, watches
        )
        return _shown(group, 201)

    def show(self, controller: Irc5, call: RwsCall) -> HttpReply:
        return _shown(self._find(call.names["group"], call.session), 200)

    def replace(self, controller: Irc5, call: RwsCall) -> HttpReply:
        group = self._find(call.names["group"], call.session)
        watches = self._watches(controller, call, group)
        group.watches = {**group.watches, **watches} if self._rules.is_adding else watches
        return _shown(group, 200)

    def delete(self, controller: Irc5, call: RwsCall) -> HttpReply:
        self._close(self._find(call.names["group"], call.session))
        return HttpReply(200, (("Content-Type", Form.XHTML.value),))

    def delete_resource(self, controller: Irc5, call: RwsCall) -> HttpReply:
        group = self._find(call.names["group"], call.session)
        deleted = f"/{call.names['resource'].strip('/')}".lower()
        for path in [path for path in group.watches if path.partition(";")[0].lower() == deleted]:
            del group.watches[path]
        return HttpReply(200, (("Content-Type", Form.XHTML.value),))

    def _watches(self, controller: Irc5, call: RwsCall, old: _Group | None = None) -> dict[str, _Watch]:
        """What a form asks for, within the limits of a group and of all clients together."""
        try:
            resources = read_resources(call.form)
        except ProtocolError as error:
            raise bad_call(str(error)) from error
        if len(resources) > _MAX_RESOURCES:
            raise CallFailure(400, RwsCode.MAX_LIMIT_REACHED, f"a subscription has {_MAX_RESOURCES} resources at most")
        others = (group for group in self._groups.values() if group is not old)
        present = [watch.resource for group in others for watch in group.watches.values()]
        if sum(each.priority is Priority.HIGH for each in (*present, *resources)) > _MAX_HIGH:
            raise CallFailure(400, RwsCode.MAX_LIMIT_REACHED, f"{_MAX_HIGH} resources have high priority at most")
        sources = {}
        for resource in resources:
            rws1 = self._rules.rws1_resource(resource.path)
            sources[resource] = find_source(controller, resource, self._own_sources(resource), rws1)
        return {resource.path: _Watch(resource, source, source.read()) for resource, source in sources.items()}

    def _own_sources(self, resource: Resource) -> Mapping[str, Source]:
        """Sources of what belongs to sessions: masterships, the privilege of manual mode, message queues."""
        path = resource.path
        sources = {"/users/rmmp": rmmp_source(self._users, path), "/users/remoteuser": rmmp_source(self._users, path)}
        for domain in self._mastership.names:
            sources[f"/rw/mastership/{domain}"] = mastership_source(self._mastership, path, (domain,))
        sources["/rw/mastership"] = mastership_source(self._mastership, path, self._mastership.names)
        queue = re.fullmatch(r"/rw/dipc/([^/;]+)(;nomessage)?", path, re.IGNORECASE)
        if queue is not None and self._messages.find(queue[1]) is not None:
            sources[path.lower()] = queue_source(self._messages, path, queue[1], with_message=queue[2] is None)
        return sources

    def _find(self, number: str, session: str) -> _Group:
        group = next((group for known, group in self._groups.items() if str(known) == number), None)
        if group is None:
            raise CallFailure(404, RwsCode.FAIL, f"there is no subscription {number}")
        if group.session != session:
            raise CallFailure(403, RwsCode.DENIED, f"Group {number} does not belong to this client")
        return group

    def _close(self, group: _Group) -> None:
        self._groups.pop(group.number, None)
        group.disconnect(in_order=True)


def _shown(group: _Group, status: int) -> HttpReply:
    """The group with the values its client knows from now on."""
    events: list[Event] = []
    for watch in group.watches.values():
        if watch.known is not None:
            events += watch.source.show(None, watch.known)
    scheme = "wss" if group.is_secure else "ws"
    body = write_group(group.root, group.number, events, is_secure=group.is_secure)
    return replace(HttpReply.at(f"{scheme}://{group.root}/poll/{group.number}", status), body=body)
