"""Operations on message queues between clients and RAPID tasks (``/rw/dipc``), and the client's calls of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from abb_protocols.rws.operations.operation import delete, get, post
from abb_protocols.rws.operations.operation_answer import record
from abb_protocols.rws.operations.service import Service

_QUEUE = "/rw/dipc/{queue}"
_LONGEST_MESSAGE = 444
"""Of a queue's message [byte]."""

_MS = 1000.0


@dataclass(frozen=True, slots=True)
class QueueMessage:
    """One message.

    Attributes:
        data: type and value as RAPID writes them, such as ``num;5`` or ``string;"go"``.
        user_def: number that sender and receiver agree on.
        sender: name of its queue.
    """

    data: Annotated[str, "dipc-data"]
    user_def: Annotated[int, "dipc-userdef"]
    sender: Annotated[str, "queue-name"]


@dataclass(frozen=True, slots=True)
class QueueInfo:
    """A queue: messages it holds at most, their longest [byte], and its number."""

    size: Annotated[int, "queue-size"]
    name: Annotated[str, "queue-name"]
    longest: Annotated[int, "queue-max-msg-size"]
    slot: Annotated[int, "queue-slot-id"] = 0


_READ_MESSAGE = record("dipc-read-li", QueueMessage)  # none where the queue is empty

QUEUES = get("/rw/dipc")
CREATE_QUEUE = post("/rw/dipc", "dipc-create", "dipc-queue-name, dipc-queue-size, dipc-max-msg-size", status=201)
QUEUE = get(_QUEUE).shows(record("dipc-queue", QueueInfo))
READ_QUEUE = get(_QUEUE, "timeout", action="dipc-read")
SEND_TO_QUEUE = post(
    _QUEUE, "dipc-send", "dipc-src-queue-name, dipc-cmd, dipc-userdef, dipc-msgtype=0|1, dipc-data", status=200
)
DELETE_QUEUE = delete(_QUEUE)


class QueuesService(Service):
    """``/rw/dipc``; a RAPID task's queue is ``RMQ_`` and its name."""

    def queues(self) -> tuple[str, ...]:
        """Names of the queues, those of RAPID tasks too."""
        states = self._listed("reading the queues", QUEUES)
        return tuple(state.title for state in states if state.type == "dipc-queue-li")

    def queue(self, name: str) -> QueueInfo:
        """One queue of this client."""
        return self._answer(f"reading the queue {name}", QUEUE, name)

    def create_queue(self, name: str, size: int = 100, longest: int = _LONGEST_MESSAGE) -> None:
        """Make a queue to which RAPID tasks can send; it goes with the session.

        Args:
            name: of it.
            size: messages it holds, 1 to 32767.
            longest: message in it [byte], 1 to 444.
        """
        sizes = {"dipc_queue_size": size, "dipc_max_msg_size": longest}
        self._call(f"making the queue {name}", CREATE_QUEUE, dipc_queue_name=name, **sizes)

    def remove_queue(self, name: str) -> None:
        """Remove a queue of this client."""
        self._call(f"removing the queue {name}", DELETE_QUEUE, name)

    def send_message(self, to: str, data: str, *, sender: str, user_def: int = 0) -> None:
        """Send to a queue such as ``RMQ_T_ROB_R``.

        Args:
            to: name of the queue.
            data: type and value as RAPID writes them, such as ``num;5``.
            sender: name of a queue of this client, to which the task may answer.
            user_def: number that both agree on.
        """
        self._call(
            f"sending to {to}",
            SEND_TO_QUEUE,
            to,
            dipc_src_queue_name=sender,
            dipc_cmd=111,
            dipc_userdef=user_def,
            dipc_msgtype=1,
            dipc_data=data,
        )

    def read_message(self, name: str, timeout: float = 0.0) -> QueueMessage | None:
        """The oldest message of a queue of this client; None where none comes within ``timeout`` [s]."""
        page = self._shown(f"reading from {name}", READ_QUEUE, name, timeout=round(timeout * _MS))
        return next(map(_READ_MESSAGE.read, page.of_type(*_READ_MESSAGE.types)), None)
