"""``/subscription`` and ``/poll``: clients that want to be told (reference/rws.md §14)."""

from __future__ import annotations

from yumi.errors import ProtocolError
from yumi.links.channel import Channel, Upgrade
from yumi.links.http import HttpReply
from yumi.rws.codes import Code
from yumi.rws.event_pages import write_group
from yumi.rws.representations import Form
from yumi.rws.subscriptions import MAX_GROUPS, MAX_HIGH, MAX_RESOURCES, PROTOCOL, Priority, Resource, read_resources
from yumi.virtual.rws_groups import Group, Groups, Watch
from yumi.virtual.rws_port import Controller
from yumi.virtual.rws_routes import Call, Failure, Route, invalid
from yumi.virtual.rws_sources import Event, find_source

_CREATED = 201
_OK = 200


class Subscriptions:
    """The groups of all clients, as clients see them."""

    def __init__(self) -> None:
        self.groups = Groups()

    def routes(self) -> tuple[Route, ...]:
        return (
            Route("POST", "/subscription", self._create),
            Route("GET", "/subscription/{group}", self._show),
            Route("PUT", "/subscription/{group}", self._replace),
            Route("DELETE", "/subscription/{group}", self._delete),
            Route("DELETE", "/subscription/{group}/{resource*}", self._delete_resource),
        )

    def upgrade(self, call: Call, protocols: str) -> Upgrade:
        """The WebSocket of ``/poll/{group}``; a client that leaves the number out gets its latest group.

        Raises:
            Failure: the group is somebody else's, or none, or the client does not speak the sub-protocol.
        """
        if PROTOCOL not in (each.strip() for each in protocols.split(",")):
            raise invalid(f"Unsupported Sec-WebSocket-Protocol {protocols!r}; it is {PROTOCOL}")
        own = self.groups.of_session(call.session)
        group = self._find(call, call.path[1]) if len(call.path) > 1 else next(reversed(own), None)
        if group is None:
            raise Failure(404, Code.FAIL, "there is no subscription of this client")
        found = group

        def attach(channel: Channel) -> None:
            found.end(in_order=True)  # a client that comes again leaves its old connection
            found.channel = channel
            if self.groups.find(str(found.number)) is not found:
                found.end(in_order=True)  # the group has ended while the connection was made

        return Upgrade(PROTOCOL, attach)

    def _create(self, controller: Controller, call: Call) -> HttpReply:
        if len(self.groups.of_session(call.session)) >= MAX_GROUPS:
            raise Failure(400, Code.MAX_LIMIT_REACHED, f"a client has {MAX_GROUPS} subscriptions at most")
        watches = self._watches(controller, call)
        return _shown(self.groups.open(call.session, call.host, watches), _CREATED)

    def _replace(self, controller: Controller, call: Call) -> HttpReply:
        group = self._find(call)
        group.watches = self._watches(controller, call, group)
        return _shown(group, _OK)

    def _show(self, controller: Controller, call: Call) -> HttpReply:
        return _shown(self._find(call), _OK)

    def _delete(self, controller: Controller, call: Call) -> HttpReply:
        self.groups.close(self._find(call))
        return HttpReply(_OK, (("Content-Type", Form.XHTML.value),))

    def _delete_resource(self, controller: Controller, call: Call) -> HttpReply:
        group = self._find(call)
        wanted = f"/{call.names['resource'].strip('/')}".lower()
        for path in [path for path in group.watches if path.partition(";")[0].lower() == wanted]:
            del group.watches[path]
        return HttpReply(_OK, (("Content-Type", Form.XHTML.value),))

    def _watches(self, controller: Controller, call: Call, old: Group | None = None) -> dict[str, Watch]:
        resources = _wanted(call)
        high = sum(each.priority is Priority.HIGH for each in resources)
        taken = self.groups.count(Priority.HIGH)
        freed = sum(each.resource.priority is Priority.HIGH for each in old.watches.values()) if old else 0
        if taken - freed + high > MAX_HIGH:
            raise Failure(400, Code.MAX_LIMIT_REACHED, f"{MAX_HIGH} resources have high priority at most")
        return {resource.path: _watch(controller, resource) for resource in resources}

    def _find(self, call: Call, number: str | None = None) -> Group:
        number = call.names["group"] if number is None else number
        group = self.groups.find(number)
        if group is None:
            raise Failure(404, Code.FAIL, f"there is no subscription {number}")
        if group.session != call.session:
            raise Failure(403, Code.DENIED, f"Group {number} does not belong to this client")
        return group


def _wanted(call: Call) -> tuple[Resource, ...]:
    try:
        resources = read_resources(call.form)
    except ProtocolError as error:
        raise invalid(str(error)) from error
    if len(resources) > MAX_RESOURCES:
        raise Failure(400, Code.MAX_LIMIT_REACHED, f"a subscription has {MAX_RESOURCES} resources at most")
    return resources


def _watch(controller: Controller, resource: Resource) -> Watch:
    source = find_source(controller, resource)
    return Watch(resource, source, source.read())


def _shown(group: Group, status: int) -> HttpReply:
    """The group with the values its client knows from now on."""
    events: list[Event] = []
    for watch in group.watches.values():
        if watch.told is not None:
            events += watch.source.show(None, watch.told)
    headers = (("Location", f"ws://{group.root}/poll/{group.number}"), ("Content-Type", Form.XHTML.value))
    return HttpReply(status, headers, write_group(group.root, group.number, events))
