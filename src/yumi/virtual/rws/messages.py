"""``/rw/dipc``: message queues of clients and RAPID tasks (reference/rws.md §13)."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from yumi.rws.documents import Page, State
from yumi.rws.types import Code
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.rws.operations import Call, Failure, Operation, entry, invalid, resource

_BASE = "/rw/dipc/"
_TITLE = "RobAPI2 DIPC"
MOST_BYTES = 444
"""Of the data of a message."""

MOST_QUEUES = 100


@dataclass(frozen=True, slots=True)
class DipcMessage:
    """One message: its data as the sender wrote them, and who sent it."""

    data: str
    user_def: str
    kind: str
    command: str
    sender: str


@dataclass(slots=True)
class DipcQueue:
    """One queue.

    Attributes:
        session: of the client it belongs to.
        size: messages it holds.
        largest: longest message [bytes].
        slot: its number.
        taken: messages that have been taken from it.
    """

    name: str
    session: str
    size: int
    largest: int
    slot: int
    messages: deque[DipcMessage] = field(default_factory=deque)
    taken: int = 0

    def take(self) -> DipcMessage:
        """The oldest message, which the queue has no longer."""
        self.taken += 1
        return self.messages.popleft()


class MessageService:
    """The queues of all clients."""

    def __init__(self) -> None:
        self._queues: dict[str, DipcQueue] = {}
        self._made = 0
        path = "/rw/dipc/{queue}"
        size = {"dipc-queue-name": (), "dipc-queue-size": (), "dipc-max-msg-size": ()}
        message = {
            "dipc-src-queue-name": (),
            "dipc-cmd": (),
            "dipc-userdef": (),
            "dipc-msgtype": ("0", "1"),
            "dipc-data": (),
        }
        self.operations = (
            Operation("GET", "/rw/dipc", self.get_queues),
            Operation("POST", "/rw/dipc", self.create, "dipc-create", size, status=201),
            Operation("GET", path, self.get_queue),
            Operation("GET", path, self.read, "dipc-read", query={"timeout": ()}),
            Operation("POST", path, self.send, "dipc-send", message, status=200),
            Operation("DELETE", path, self.delete),
        )

    def keep(self, sessions: Sequence[str]) -> None:
        """Forget the queues of all other sessions."""
        if any(queue.session not in sessions for queue in self._queues.values()):
            self._queues = {name: queue for name, queue in self._queues.items() if queue.session in sessions}

    def find(self, name: str) -> DipcQueue | None:
        """The queue of that name, or None."""
        return self._queues.get(name.lower())

    def get_queues(self, controller: Irc5, call: Call) -> Page:
        sizes = entry("dipc-info-li", "info", "", max_body_size=str(MOST_BYTES), max_pkg_size="5000")
        queues = (entry("dipc-queue-li", queue.name, f"dipc/{queue.name}") for queue in self._queues.values())
        return resource(_TITLE, "/rw/", "dipc", sizes, *queues)

    def create(self, controller: Irc5, call: Call) -> None:
        name = call.required("dipc-queue-name")
        size, largest = int(call.number("dipc-queue-size")), int(call.number("dipc-max-msg-size"))
        if not name or not 1 <= size <= 32767 or not 1 <= largest <= MOST_BYTES:
            raise invalid(f"a queue has a name, a size of 1 to 32767 and messages of 1 to {MOST_BYTES} bytes")
        if self.find(name) is not None:
            raise invalid(f"there is a queue {name} already")
        if len(self._queues) >= MOST_QUEUES:
            raise Failure(400, Code.MAX_LIMIT_REACHED, f"there are {MOST_QUEUES} queues at most")
        self._made += 1
        self._queues[name.lower()] = DipcQueue(name, call.session, size, largest, self._made)

    def get_queue(self, controller: Irc5, call: Call) -> Page:
        queue = self._find(call)
        fields = {
            "queue-size": str(queue.size),
            "queue-name": queue.name,
            "queue-max-msg-size": str(queue.largest),
            "queue-slot-id": str(queue.slot),
        }
        return resource(_TITLE, _BASE, queue.name, State("dipc-queue", queue.name, fields))

    def read(self, controller: Irc5, call: Call) -> Page:
        """The oldest message; an empty page when there is none: the answer does not wait for one."""
        queue = self._find(call)
        states = []
        if queue.messages:
            message = queue.take()
            sender = self.find(message.sender)
            fields = {
                "dipc-data": message.data,
                "dipc-userdef": message.user_def,
                "dipc-msgtype": message.kind,
                "dipc-cmd": message.command,
                "queue-name": queue.name,
                "queue-size": str(queue.size),
                "queue-sid": str(queue.slot),
                "queue-did": str(sender.slot if sender else 0),
            }
            states.append(State("dipc-read-li", queue.name, fields))
        return resource(_TITLE, _BASE, queue.name, *states)

    def send(self, controller: Irc5, call: Call) -> None:
        queue, data = self._find(call), call.required("dipc-data")
        if len(data.encode()) > queue.largest:
            raise invalid(f"a message to {queue.name} has up to {queue.largest} bytes")
        if len(queue.messages) >= queue.size:
            raise Failure(400, Code.MAX_LIMIT_REACHED, f"the queue {queue.name} is full")
        queue.messages.append(
            DipcMessage(
                data,
                call.required("dipc-userdef"),
                call.required("dipc-msgtype"),
                call.required("dipc-cmd"),
                call.required("dipc-src-queue-name"),
            )
        )

    def delete(self, controller: Irc5, call: Call) -> None:
        queue = self._find(call)
        if queue.session != call.session:
            raise Failure(403, Code.DENIED, f"the queue {queue.name} belongs to another client")
        del self._queues[queue.name.lower()]

    def _find(self, call: Call) -> DipcQueue:
        queue = self.find(call.names["queue"])
        if queue is None:
            raise Failure(404, Code.UNRESOLVED_URL, f"there is no queue {call.names['queue'][:50]!r}")
        return queue
