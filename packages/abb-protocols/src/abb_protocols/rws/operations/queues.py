"""Operations on message queues between clients and RAPID tasks (``/rw/dipc``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from abb_protocols.rws.operations.operation import delete, get, post
from abb_protocols.rws.operations.operation_answer import record

_QUEUE = "/rw/dipc/{queue}"


@dataclass(frozen=True, slots=True)
class QueueInfo:
    """A queue: messages it holds at most, their longest [byte], and its number."""

    size: Annotated[int, "queue-size"]
    name: Annotated[str, "queue-name"]
    longest: Annotated[int, "queue-max-msg-size"]
    slot: Annotated[int, "queue-slot-id"] = 0


QUEUES = get("/rw/dipc")
CREATE = post("/rw/dipc", "dipc-create", "dipc-queue-name, dipc-queue-size, dipc-max-msg-size", status=201)
QUEUE = get(_QUEUE).shows(record("dipc-queue", QueueInfo))
READ = get(_QUEUE, "timeout", action="dipc-read")
SEND = post(_QUEUE, "dipc-send", "dipc-src-queue-name, dipc-cmd, dipc-userdef, dipc-msgtype=0|1, dipc-data", status=200)
DELETE = delete(_QUEUE)
