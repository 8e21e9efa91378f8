"""``/rw/mastership``: one client at a time may change a domain (reference/rws.md §10.1)."""

from __future__ import annotations

from collections.abc import Sequence

from yumi.rws.documents import Page, State
from yumi.rws.types import Code
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.rws.operations import Call, Failure, Operation, entry, resource

DOMAINS = ("cfg", "motion", "rapid")
_BASE = "/rw/mastership/"


class Mastership:
    """Which session holds which domain; a session that ends releases what it holds."""

    def __init__(self) -> None:
        self._holders: dict[str, str] = {}
        path = "/rw/mastership/{domain}"
        self.operations = (
            Operation("GET", "/rw/mastership", self.get_domains),
            Operation("POST", "/rw/mastership", lambda _, call: self.take(call, DOMAINS), "request"),
            Operation("POST", "/rw/mastership", self.release_all, "release"),
            Operation("GET", path, self.get_domain),
            Operation("POST", path, lambda _, call: self.take(call, (_domain(call),)), "request"),
            Operation("POST", path, self.release, "release"),
        )

    def keep(self, sessions: Sequence[str]) -> None:
        """Release what all other sessions hold."""
        self._holders = {domain: holder for domain, holder in self._holders.items() if holder in sessions}

    def check(self, operation: Operation, session: str) -> None:
        """Refuse an operation that another client's mastership forbids, or that needs one.

        Raises:
            Failure: 403.
        """
        domain = operation.needs_mastership or operation.respects_mastership
        if domain:
            self._exclude_others(domain, session)
        if operation.needs_mastership and domain not in self._holders:
            raise Failure(403, Code.MASTER_REJECT, f"the mastership of {domain} is needed; request it first")

    def _exclude_others(self, domain: str, session: str) -> None:
        if self._holders.get(domain, session) != session:
            raise Failure(403, Code.RESOURCE_HELD, f"Requested resource is held by someone else: {domain}")

    def get_domains(self, controller: Irc5, call: Call) -> Page:
        return resource("MasterShip", _BASE, "", *(entry("msh-resource-li", domain) for domain in DOMAINS))

    def get_domain(self, controller: Irc5, call: Call) -> Page:
        domain = _domain(call)
        holder = self._holders.get(domain)
        fields = {"mastership": "nomaster" if holder is None else "remote"}
        fields["mastershipheldbyme"] = "TRUE" if holder == call.session else "FALSE"
        return resource("MasterShip", _BASE, domain, State("msh-resource", domain, fields))

    def take(self, call: Call, domains: Sequence[str]) -> None:
        for domain in domains:
            self._exclude_others(domain, call.session)
        self._holders |= dict.fromkeys(domains, call.session)

    def release_all(self, controller: Irc5, call: Call) -> None:
        self._holders = {domain: holder for domain, holder in self._holders.items() if holder != call.session}

    def release(self, controller: Irc5, call: Call) -> None:
        domain = _domain(call)
        if self._holders.get(domain) != call.session:
            raise Failure(403, Code.RESOURCE_NOT_HELD, f"the mastership of {domain} is not held by this client")
        del self._holders[domain]


def _domain(call: Call) -> str:
    domain = call.names["domain"].lower()
    if domain not in DOMAINS:
        raise Failure(404, Code.FAIL, f"there is no mastership of {domain!r}")
    return domain
