"""Operations on subscriptions to what changes (``/subscription``)."""

from __future__ import annotations

from abb_protocols.rws.operations.operation import delete, get, post, put

_GROUP = "/subscription/{group}"

CREATE = post("/subscription", None, "resources", status=201)
GROUP = get(_GROUP)
REPLACE = put(_GROUP, "resources")
DELETE = delete(_GROUP, status=200)
DELETE_RESOURCE = delete(f"{_GROUP}/{{resource:.+}}", status=200)
