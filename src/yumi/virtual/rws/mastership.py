"""``/rw/mastership``: one client at a time may change what a domain stands for (reference/rws.md §10.1)."""

from __future__ import annotations

from collections.abc import Sequence

from yumi.rws.documents import Page, State
from yumi.rws.types import Code
from yumi.virtual.rws.routes import Call, Controller, Failure, Route, entry, resource

DOMAINS = ("cfg", "motion", "rapid")
_BASE = "/rw/mastership/"


class Mastership:
    """Who holds which domain; a session that ends gives back what it holds."""

    def __init__(self) -> None:
        self._holders: dict[str, str] = {}

    def keep(self, sessions: Sequence[str]) -> None:
        """Free what sessions hold that are no more."""
        self._holders = {domain: holder for domain, holder in self._holders.items() if holder in sessions}

    def check(self, call: Call) -> None:
        """Refuse a call that somebody else's mastership forbids, or that needs one.

        Raises:
            Failure: 403.
        """
        if call.path[:2] != ("rw", "rapid"):
            return
        if call.option("action") in ("loadmod", "unloadmod"):
            self.demand("rapid", call.session)
        elif call.option("action") == "set":
            self.exclude("rapid", call.session)

    def demand(self, domain: str, session: str) -> None:
        """Make sure that ``session`` holds ``domain``.

        Raises:
            Failure: it does not.
        """
        self.exclude(domain, session)
        if domain not in self._holders:
            raise Failure(403, Code.MASTER_REJECT, f"the mastership of {domain} is needed; request it first")

    def exclude(self, domain: str, session: str) -> None:
        """Make sure that nobody but ``session`` holds ``domain``.

        Raises:
            Failure: somebody does.
        """
        if self._holders.get(domain, session) != session:
            raise Failure(403, Code.RESOURCE_HELD, f"Requested resource is held by someone else: {domain}")

    def routes(self) -> tuple[Route, ...]:
        return (
            Route("GET", "/rw/mastership", self._list),
            Route("POST", "/rw/mastership", self._request_all, "request"),
            Route("POST", "/rw/mastership", self._release_all, "release"),
            Route("GET", "/rw/mastership/{domain}", self._one),
            Route("POST", "/rw/mastership/{domain}", self._request, "request"),
            Route("POST", "/rw/mastership/{domain}", self._release, "release"),
        )

    def _list(self, controller: Controller, call: Call) -> Page:
        return resource("MasterShip", _BASE, "", *(entry("msh-resource-li", domain) for domain in DOMAINS))

    def _one(self, controller: Controller, call: Call) -> Page:
        domain = _domain(call)
        holder = self._holders.get(domain)
        fields = {"mastership": "nomaster" if holder is None else "remote"}
        fields["mastershipheldbyme"] = "TRUE" if holder == call.session else "FALSE"
        return resource("MasterShip", _BASE, domain, State("msh-resource", domain, fields))

    def _request_all(self, controller: Controller, call: Call) -> None:
        self._take(call, DOMAINS)

    def _request(self, controller: Controller, call: Call) -> None:
        self._take(call, (_domain(call),))

    def _take(self, call: Call, domains: Sequence[str]) -> None:
        for domain in domains:
            self.exclude(domain, call.session)
        self._holders |= dict.fromkeys(domains, call.session)

    def _release_all(self, controller: Controller, call: Call) -> None:
        self._holders = {domain: holder for domain, holder in self._holders.items() if holder != call.session}

    def _release(self, controller: Controller, call: Call) -> None:
        domain = _domain(call)
        if self._holders.get(domain) != call.session:
            raise Failure(403, Code.RESOURCE_NOT_HELD, f"the mastership of {domain} is not held by this client")
        del self._holders[domain]


def _domain(call: Call) -> str:
    domain = call.names["domain"].lower()
    if domain not in DOMAINS:
        raise Failure(404, Code.FAIL, f"there is no mastership of {domain!r}")
    return domain
