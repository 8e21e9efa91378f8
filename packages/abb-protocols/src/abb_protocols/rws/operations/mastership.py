"""Operations on the mastership of what clients change (``/rw/mastership``), and the client's calls of them."""

from __future__ import annotations

from abb_protocols.rws.operations.operation import get, post
from abb_protocols.rws.operations.service import Service
from abb_protocols.rws.values import Grant

_DOMAIN = "/rw/mastership/{domain}"
_ALL = "/rw/mastership"
GRANT = Grant.RAPID_DEBUG
"""What a client is granted that takes a mastership."""

DOMAINS = get(_ALL)
REQUEST_ALL = post(_ALL, "request", grant=GRANT)
RELEASE_ALL = post(_ALL, "release")
DOMAIN = get(_DOMAIN)
REQUEST = post(_DOMAIN, "request", grant=GRANT)
RELEASE = post(_DOMAIN, "release")


class MastershipService(Service):
    """``/rw/mastership``."""

    def mastership(self, domain: str) -> str:
        """Which other client holds the right to change ``cfg``, ``rapid`` or ``motion``; empty where none does."""
        state = self._shown(f"reading the mastership of {domain}", DOMAIN, domain).one("msh-resource")
        if state.text("mastership") == "nomaster" or state.fields.get("mastershipheldbyme", "").upper() == "TRUE":
            return ""
        known = [text for name in ("application", "alias", "location") if (text := state.fields.get(name, ""))]
        return ", ".join(known) or f"another client ({state.text('mastership')})"

    def mastership_domains(self) -> tuple[str, ...]:
        """What a client can have the mastership of: ``cfg``, ``motion``, ``rapid``."""
        return tuple(state.title for state in self._listed("reading the masterships", DOMAINS))

    def request_all_masterships(self) -> None:
        """Take the mastership of all domains; the FlexPendant is locked out until they are released."""
        self._call("requesting all masterships", REQUEST_ALL)

    def release_all_masterships(self) -> None:
        """Release the mastership of all domains."""
        self._call("releasing all masterships", RELEASE_ALL)
