"""The virtual controller's answers on ``/rw/dipc``: message queues between clients and tasks (reference/rws.md §13)."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from abb_protocols.rws.documents import Page, RwsState
from abb_protocols.rws.operations import queues as table
from abb_protocols.rws.values import RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rapid.devices import LONGEST_MESSAGE, MOST_MESSAGES, RapidMessage
from virtual_irc5.rapid.types import RapidRuntimeError
from virtual_irc5.rws.render import page_at, page_entry
from virtual_irc5.rws.router import Route
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, bad_call

_DIPC_BASE = "/rw/dipc/"
_DIPC_TITLE = "RobAPI2 DIPC"
_MOST_DATA_BYTES = 444
"""Of the data of a message."""

_MOST_QUEUES = 100
_RAPID_MESSAGE = re.compile(r"\s*(\w{1,32})\s*(?:\{([\d, ]{1,50})\})?\s*;(.*)", re.DOTALL)
"""What a RAPID program understands: ``string;"text"``, ``num{2};[1,2]``."""


@dataclass(frozen=True, slots=True)
class _DipcMessage:
    """One message: its data as the sender wrote them, and who sent it."""

    data: str
    user_def: str
    kind: str
    command: str
    sender: str


@dataclass(slots=True)
class _DipcQueue:
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
    messages: deque[_DipcMessage] = field(default_factory=deque)
    taken: int = 0

    def take(self) -> _DipcMessage:
        """The oldest message, which the queue has no longer."""
        self.taken += 1
        return self.messages.popleft()


class DipcQueues:
    """The queues of all clients, which RAPID's tasks find and write to; a task's queue is ``RMQ_`` and its name."""

    def __init__(self, controller: Irc5) -> None:
        self._controller = controller
        self._queues: dict[str, _DipcQueue] = {}
        self._made = 0
        self.routes = (
            Route(table.QUEUES, self.get_queues),
            Route(table.CREATE_QUEUE, self.create),
            Route(table.QUEUE, self.get_queue),
            Route(table.READ_QUEUE, self.read),
            Route(table.SEND_TO_QUEUE, self.send),
            Route(table.DELETE_QUEUE, self.delete),
        )

    def keep(self, sessions: Collection[str]) -> None:
        """Forget the queues of all other sessions."""
        for queue in [queue for queue in self._queues.values() if queue.session not in sessions]:
            self._forget(queue)

    def find(self, name: str) -> _DipcQueue | None:
        """The queue of that name, or None."""
        return self._queues.get(name.lower())

    def get_queues(self, controller: Irc5, call: RwsCall) -> Page:
        sizes = page_entry("dipc-info-li", "info", "", max_body_size=str(_MOST_DATA_BYTES), max_pkg_size="5000")
        queues = (page_entry("dipc-queue-li", queue.name, f"dipc/{queue.name}") for queue in self._queues.values())
        tasks = (page_entry("dipc-queue-li", f"RMQ_{name}", f"dipc/RMQ_{name}") for name in controller.tasks)
        return page_at(_DIPC_TITLE, "/rw/", "dipc", sizes, *tasks, *queues)

    def create(self, controller: Irc5, call: RwsCall) -> None:
        name = call.required("dipc-queue-name")
        size, largest = int(call.number("dipc-queue-size")), int(call.number("dipc-max-msg-size"))
        if not name or not 1 <= size <= 32767 or not 1 <= largest <= _MOST_DATA_BYTES:
            raise bad_call(f"a queue has a name, a size of 1 to 32767 and messages of 1 to {_MOST_DATA_BYTES} bytes")
        if self.find(name) is not None or name.lower() in (f"rmq_{task}".lower() for task in controller.tasks):
            raise bad_call(f"there is a queue {name} already")
        if len(self._queues) >= _MOST_QUEUES:
            raise CallFailure(400, RwsCode.MAX_LIMIT_REACHED, f"there are {_MOST_QUEUES} queues at most")
        self._made += 1
        queue = self._queues[name.lower()] = _DipcQueue(name, call.session, size, largest, self._made)

        def receive(message: RapidMessage) -> bool:
            sizes = f"{{{','.join(map(str, message.sizes))}}}" if message.sizes else ""
            data = f"{message.type_name}{sizes};{message.text}"
            if len(queue.messages) >= queue.size:
                raise RapidRuntimeError("ERR_RMQ_FULL", f"The message queue '{name}' holds {queue.size} messages.")
            queue.messages.append(_DipcMessage(data, f"{message.user_defined:g}", "1", "111", message.sender))
            return True

        queues = controller.devices.queues
        queues.open(name)
        queues.listeners[name.lower()] = receive

    def get_queue(self, controller: Irc5, call: RwsCall) -> Mapping[str, table.QueueInfo]:
        for number, task in enumerate(controller.tasks, 1):
            if f"RMQ_{task}".lower() == call.names["queue"].lower():
                shown = _DipcQueue(f"RMQ_{task}", "", MOST_MESSAGES, LONGEST_MESSAGE, _MOST_QUEUES + number)
                break
        else:
            shown = self._find(call)
        return {shown.name: table.QueueInfo(shown.size, shown.name, shown.largest, shown.slot)}

    def read(self, controller: Irc5, call: RwsCall) -> Page:
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
            states.append(RwsState("dipc-read-li", queue.name, fields))
        return page_at(_DIPC_TITLE, _DIPC_BASE, queue.name, *states)

    def send(self, controller: Irc5, call: RwsCall) -> None:
        task = next((name for name in controller.tasks if f"RMQ_{name}".lower() == call.names["queue"].lower()), None)
        if task is not None:
            self._send_to_task(task, call)
            return
        queue, data = self._find(call), call.required("dipc-data")
        if len(data.encode()) > queue.largest:
            raise bad_call(f"a message to {queue.name} has up to {queue.largest} bytes")
        if len(queue.messages) >= queue.size:
            raise CallFailure(400, RwsCode.MAX_LIMIT_REACHED, f"the queue {queue.name} is full")
        queue.messages.append(
            _DipcMessage(
                data,
                call.required("dipc-userdef"),
                call.required("dipc-msgtype"),
                call.required("dipc-cmd"),
                call.required("dipc-src-queue-name"),
            )
        )

    def delete(self, controller: Irc5, call: RwsCall) -> None:
        queue = self._find(call)
        if queue.session != call.session:
            raise CallFailure(403, RwsCode.DENIED, f"the queue {queue.name} belongs to another client")
        self._forget(queue)

    def _forget(self, queue: _DipcQueue) -> None:
        queues = self._controller.devices.queues
        queues.listeners.pop(queue.name.lower(), None)
        queues.close(queue.name)
        del self._queues[queue.name.lower()]

    def _send_to_task(self, task: str, call: RwsCall) -> None:
        queues, name = self._controller.devices.queues, f"RMQ_{task}"
        sender, user_defined = call.required("dipc-src-queue-name"), call.number("dipc-userdef")
        match = _RAPID_MESSAGE.fullmatch(call.required("dipc-data"))
        if match is None:
            raise bad_call('a RAPID task takes a type and a value, such as string;"text" or num{2};[1,2]')
        type_name, sizes, text = match.groups()
        dimensions = tuple(int(size) for size in (sizes or "").split(",") if size.strip().isdecimal())
        if len(text.encode()) > LONGEST_MESSAGE:
            raise bad_call(f"a message to {name} has up to {LONGEST_MESSAGE} bytes")
        queues.open(name)
        try:
            queues.send(name, RapidMessage(type_name, dimensions, text, sender, user_defined))
        except RapidRuntimeError as error:
            raise CallFailure(400, RwsCode.MAX_LIMIT_REACHED, str(error)) from error

    def _find(self, call: RwsCall) -> _DipcQueue:
        queue = self.find(call.names["queue"])
        if queue is None:
            raise CallFailure(404, RwsCode.UNRESOLVED_URL, f"there is no queue {call.names['queue'][:50]!r}")
        return queue
