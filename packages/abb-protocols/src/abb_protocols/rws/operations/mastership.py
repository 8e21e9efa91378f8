"""Operations on the mastership of what clients change (``/rw/mastership``)."""

from __future__ import annotations

from abb_protocols.rws.operations.operation import get, post
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
