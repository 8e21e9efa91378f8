"""Operations on subscriptions to what changes (``/subscription``)."""

from __future__ import annotations

from abb_protocols.rws.operations.operation import delete, get, post, put

_GROUP = "/subscription/{group}"

CREATE_SUBSCRIPTION = post("/subscription", None, "resources", status=201)
SUBSCRIPTION_GROUP = get(_GROUP)
REPLACE_SUBSCRIPTION = put(_GROUP, "resources")
DELETE_SUBSCRIPTION = delete(_GROUP, status=200)
DELETE_SUBSCRIBED_RESOURCE = delete(f"{_GROUP}/{{resource:.+}}", status=200)
