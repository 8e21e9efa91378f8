"""The virtual controller's answers on ``/rw/mastership``: which client holds what one at a time may change."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from abb_protocols.rws.documents import Page, RwsState
from abb_protocols.rws.operations import mastership as table
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.operations.users import User
from abb_protocols.rws.values import RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws.render import page_at, page_entry
from virtual_irc5.rws.router import Route
from virtual_irc5.rws.rws_call import CallFailure, RwsCall
from virtual_irc5.rws.users import VirtualUsers, refuse_in_manual_mode

_MASTERSHIP_BASE = "/rw/mastership/"

Domains = Mapping[str, str]
"""What one client at a time may change: the names a client knows, by those of the table of operations."""

OWN_DOMAINS: Domains = {"cfg": "cfg", "motion": "motion", "rapid": "rapid"}
"""Those of RobotWare 6."""


class Mastership:
    """Which session of ``users`` holds which domain; a session that ends releases what it holds.

    Attributes:
        names: of the domains, as clients know them.
    """

    def __init__(self, users: VirtualUsers, domains: Domains) -> None:
        self._users = users
        self._domains = domains
        self.names = tuple(dict.fromkeys(domains.values()))
        self._holders: dict[str, str] = {}
        self.routes = (
            Route(table.MASTERSHIP_DOMAINS, self.get_domains),
            Route(table.REQUEST_EVERY_MASTERSHIP, self.request_all),
            Route(table.RELEASE_EVERY_MASTERSHIP, self.release_all),
            Route(table.MASTERSHIP_DOMAIN, self.get_domain),
            Route(table.REQUEST_MASTERSHIP, self.request),
            Route(table.RELEASE_MASTERSHIP, self.release),
        )

    def keep(self, sessions: Collection[str]) -> None:
        """Release what all other sessions hold."""
        self._holders = {domain: holder for domain, holder in self._holders.items() if holder in sessions}

    def check(self, operation: Operation[Any], controller: Irc5, call: RwsCall, *, is_implicit: bool = False) -> None:
        """Refuse an operation that another client's mastership forbids, or that needs one.

        Args:
            operation: to be carried out.
            controller: that is to do it.
            call: of the client.
            is_implicit: whether the client takes the mastership for this operation alone.

        Raises:
            CallFailure: 403.
        """
        domain = self._domains.get(operation.needs_mastership or operation.respects_mastership, "")
        if domain:
            self._exclude_others(domain, call.session)
        if not operation.needs_mastership or domain in self._holders:
            return
        if is_implicit:
            self._check_taking(controller, call, (domain,))
        else:
            raise CallFailure(403, RwsCode.MASTER_REJECT, f"the mastership of {domain} is needed; request it first")

    def _exclude_others(self, domain: str, session: str) -> None:
        if self._holders.get(domain, session) != session:
            raise CallFailure(403, RwsCode.RESOURCE_HELD, f"Requested resource is held by someone else: {domain}")

    def get_domains(self, controller: Irc5, call: RwsCall) -> Page:
        return page_at(
            "MasterShip", _MASTERSHIP_BASE, "", *(page_entry("msh-resource-li", domain) for domain in self.names)
        )

    def get_domain(self, controller: Irc5, call: RwsCall) -> Page:
        domain = self._domain(call)
        is_own = self._holders.get(domain) == call.session
        fields = {**self.fields(domain), "mastershipheldbyme": "TRUE" if is_own else "FALSE"}
        return page_at("MasterShip", _MASTERSHIP_BASE, domain, RwsState("msh-resource", domain, fields))

    def fields(self, domain: str) -> dict[str, str]:
        """Who holds a domain."""
        holder = self._holders.get(domain)
        user = User(0) if holder is None else self._users.of(holder)
        return {
            "uid": str(user.uid),
            "location": user.location,
            "alias": user.name,
            "application": user.application,
            "mastership": "nomaster" if holder is None else "local" if user.is_local else "remote",
        }

    def request_all(self, controller: Irc5, call: RwsCall) -> None:
        self._take(controller, call, self.names)

    def request(self, controller: Irc5, call: RwsCall) -> None:
        self._take(controller, call, (self._domain(call),))

    def _take(self, controller: Irc5, call: RwsCall, domains: Sequence[str]) -> None:
        self._check_taking(controller, call, domains)
        self._holders |= dict.fromkeys(domains, call.session)

    def _check_taking(self, controller: Irc5, call: RwsCall, domains: Sequence[str]) -> None:
        """Refuse a mastership, for one request or until it is released.

        Raises:
            CallFailure: 403.
        """
        self._users.check_grant(table.MASTERSHIP_GRANT)
        refuse_in_manual_mode(controller, call, "the mastership")
        for domain in domains:
            self._exclude_others(domain, call.session)

    def release_all(self, controller: Irc5, call: RwsCall) -> None:
        self._holders = {domain: holder for domain, holder in self._holders.items() if holder != call.session}

    def release(self, controller: Irc5, call: RwsCall) -> None:
        domain = self._domain(call)
        if self._holders.get(domain) != call.session:
            raise CallFailure(403, RwsCode.RESOURCE_NOT_HELD, f"the mastership of {domain} is not held by this client")
        del self._holders[domain]

    def _domain(self, call: RwsCall) -> str:
        domain = call.names["domain"].lower()
        if domain not in self.names:
            raise CallFailure(404, RwsCode.FAIL, f"there is no mastership of {domain!r}")
        return domain
