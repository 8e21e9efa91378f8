"""Message queues between clients and RAPID tasks."""

from __future__ import annotations

from yumi.rws.operations.operation import delete, get, post

_QUEUE = "/rw/dipc/{queue}"

QUEUES = get("/rw/dipc")
CREATE = post("/rw/dipc", "dipc-create", "dipc-queue-name, dipc-queue-size, dipc-max-msg-size", status=201)
QUEUE = get(_QUEUE)
READ = get(_QUEUE, "timeout", action="dipc-read")
SEND = post(_QUEUE, "dipc-send", "dipc-src-queue-name, dipc-cmd, dipc-userdef, dipc-msgtype=0|1, dipc-data", status=200)
DELETE = delete(_QUEUE)
