"""Operations on the mastership of what clients change (``/rw/mastership``), and the client's calls of them."""

from __future__ import annotations

from abb_protocols.rws.operations.operation import get, post
from abb_protocols.rws.operations.service import Service
from abb_protocols.rws.values import Grant

_DOMAIN = "/rw/mastership/{domain}"
_ALL = "/rw/mastership"
MASTERSHIP_GRANT = Grant.RAPID_DEBUG
"""What a client is granted that takes a mastership."""

MASTERSHIP_DOMAINS = get(_ALL)
REQUEST_EVERY_MASTERSHIP = post(_ALL, "request", grant=MASTERSHIP_GRANT)
RELEASE_EVERY_MASTERSHIP = post(_ALL, "release")
MASTERSHIP_DOMAIN = get(_DOMAIN)
REQUEST_MASTERSHIP = post(_DOMAIN, "request", grant=MASTERSHIP_GRANT)
RELEASE_MASTERSHIP = post(_DOMAIN, "release")


class MastershipService(Service):
    """``/rw/mastership``."""

    def mastership(self, domain: str) -> str:
        """Which other client holds the right to change ``cfg``, ``rapid`` or ``motion``; empty where none does."""
        state = self._shown(f"reading the mastership of {domain}", MASTERSHIP_DOMAIN, domain).one("msh-resource")
        if state.text("mastership") == "nomaster" or state.fields.get("mastershipheldbyme", "").upper() == "TRUE":
            return ""
        known = [text for name in ("application", "alias", "location") if (text := state.fields.get(name, ""))]
        return ", ".join(known) or f"another client ({state.text('mastership')})"

    def mastership_domains(self) -> tuple[str, ...]:
        """What a client can have the mastership of: ``cfg``, ``motion``, ``rapid``."""
        return tuple(state.title for state in self._listed("reading the masterships", MASTERSHIP_DOMAINS))

    def request_all_masterships(self) -> None:
        """Take the mastership of all domains; the FlexPendant is locked out until they are released."""
        self._call("requesting all masterships", REQUEST_EVERY_MASTERSHIP)

    def release_all_masterships(self) -> None:
        """Release the mastership of all domains."""
        self._call("releasing all masterships", RELEASE_EVERY_MASTERSHIP)
