"""RAPID's message queues, whose messages may order interrupts: RMQ_ and its name for a task, and those of clients."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.builtins.sockets import WAIT_MAX_S
from virtual_irc5.rapid.call import Call, Wait
from virtual_irc5.rapid.devices import MessageQueues, RapidMessage
from virtual_irc5.rapid.interrupts import ChangeOrder
from virtual_irc5.rapid.literals import format_value, parse_value
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.types import RapidRuntimeError, RapidValueError, raised_as, resolved_type

QUEUES = Library(DATA)


@dataclass(eq=False, slots=True)
class QueueSlot:
    """What an rmqslot stands for: the name of a queue."""

    name: str = ""


@dataclass(eq=False, slots=True)
class ReceivedMessage:
    """What an rmqmessage stands for."""

    message: RapidMessage | None = None


QUEUES.object_type("rmqslot", QueueSlot)
QUEUES.object_type("rmqmessage", ReceivedMessage)
QUEUES.record("rmqheader", {"datatype": "string", "ndim": "num", "dim1": "num", "dim2": "num", "dim3": "num"})


def _queues(call: Call) -> MessageQueues:
    """The controller's queues, with that of the task."""
    queues = call.task.host.devices.queues
    queues.open(_own_queue(call))
    for name in call.task.host.devices.tasks():
        queues.open(f"RMQ_{name}")
    return queues


def _own_queue(call: Call) -> str:
    return f"RMQ_{call.task.name}"


@QUEUES.instruction("RMQFindSlot", "VAR rmqslot Slot, string Name")
def _find_slot(call: Call) -> None:
    call["Slot"].name = _queues(call).name(call["Name"])


@QUEUES.function("RMQGetSlotName", "VAR rmqslot Slot", "string")
def _slot_name(call: Call) -> str:
    name: str = call["Slot"].name
    if not name:
        raise call.error("ERR_RMQ_INVALID", "the slot stands for no queue; see RMQFindSlot.")
    return name


def _message_to_send(call: Call) -> RapidMessage:
    type_ = call.reference("SendData").type
    sizes = getattr(resolved_type(type_), "sizes", ())
    text = format_value(type_, call["SendData"])
    return RapidMessage(type_.name, sizes, text, _own_queue(call), call.get("UserDef", 0.0))


@QUEUES.instruction("RMQSendMessage", r"VAR rmqslot Slot, anytype SendData, \num UserDef")
def _send_message(call: Call) -> None:
    _queues(call).send(_slot_name(call), _message_to_send(call))


@QUEUES.instruction(
    "RMQSendWait",
    r"VAR rmqslot Slot, anytype SendData, \num UserDef, VAR rmqmessage Message, anytype ReceiveDataType, "
    r"\num ReceiveUserDef, \num TimeOut",
)
def _send_and_wait(call: Call) -> Wait:
    """Send, and wait for an answer of a type; what else comes meanwhile is lost (reference manual, RMQSendWait)."""
    queues, wanted = _queues(call), call.reference("ReceiveDataType").type.name
    queues.send(_slot_name(call), _message_to_send(call))

    def fits(message: RapidMessage) -> bool:
        is_number_right = not call.present("ReceiveUserDef") or message.user_defined == call["ReceiveUserDef"]
        return message.type_name == wanted and is_number_right

    yield from _wait_for_message(call, fits)


@QUEUES.instruction("RMQReadWait", r"VAR rmqmessage Message, \num TimeOut")
def _read_and_wait(call: Call) -> Wait:
    _queues(call)
    yield from _wait_for_message(call, lambda message: True)


def _wait_for_message(call: Call, fits: Callable[[RapidMessage], bool]) -> Wait:
    queues = call.task.host.devices.queues
    time: float = call.get("TimeOut", WAIT_MAX_S)
    end = math.inf if time >= WAIT_MAX_S else call.task.now + time
    while True:
        message = queues.take(_own_queue(call))
        if message is not None and fits(message):
            call["Message"].message = message
            return
        if message is None:
            if call.task.now >= end:
                raise RapidRuntimeError("ERR_RMQ_TIMEOUT", f"{call.name} has waited in vain.")
            yield None if math.isinf(end) else end


@QUEUES.instruction("RMQGetMessage", "VAR rmqmessage Message")
def _get_message(call: Call) -> None:
    message = _queues(call).take(_own_queue(call))
    if message is None:
        raise call.error("ERR_RMQ_NOMSG", "the queue of the task is empty.")
    call["Message"].message = message


def _received_message(call: Call) -> RapidMessage:
    message: RapidMessage | None = call["Message"].message
    if message is None:
        raise call.error("ERR_RMQ_INVMSG", "nothing has been received into the message.")
    return message


@QUEUES.instruction("RMQGetMsgData", "VAR rmqmessage Message, INOUT anytype Data")
def _message_data(call: Call) -> None:
    message, type_ = _received_message(call), call.reference("Data").type
    if message.type_name.lower() != type_.name.lower():
        sentence = f"The message is a {message.type_name}, not a {type_.name}."
        raise RapidRuntimeError("ERR_RMQ_VALUE", sentence)
    sizes = getattr(resolved_type(type_), "sizes", ())
    if len(sizes) != len(message.sizes):
        raise RapidRuntimeError("ERR_RMQ_DIM", f"The message has {len(message.sizes)} dimensions, not {len(sizes)}.")
    with raised_as("ERR_RMQ_VALUE", RapidValueError):
        call["Data"] = parse_value(type_, message.text)


@QUEUES.instruction(
    "RMQGetMsgHeader", r"VAR rmqmessage Message, \INOUT rmqheader Header, \VAR rmqslot SenderId, \INOUT num UserDef"
)
def _message_header(call: Call) -> None:
    message = _received_message(call)
    if call.present("Header"):
        sizes = (*message.sizes, 0, 0, 0)[:3]
        call["Header"] = (message.type_name, len(message.sizes), *sizes)
    if call.present("SenderId"):
        call["SenderId"].name = message.sender
    call.give("UserDef", message.user_defined)


@QUEUES.instruction("IRMQMessage", "anytype InterruptDataType, VAR intnum Interrupt")
def _order_message(call: Call) -> None:
    """An interrupt whenever a message of a type comes into the queue of the task."""
    queues, interrupts, number = _queues(call), call.task.interrupts, int(call["Interrupt"])
    wanted, order = call.reference("InterruptDataType").type.name, ChangeOrder(is_single=False)
    watchers = queues.watchers.setdefault(_own_queue(call).lower(), [])

    def arrived(message: RapidMessage) -> None:
        if not interrupts.is_ordered(number, order):  # deleted, or ordered anew
            watchers.remove(arrived)
        elif message.type_name == wanted:
            interrupts.occur(number)

    interrupts.order(number, order)
    watchers.append(arrived)


@QUEUES.instruction("RMQEmptyQueue")
def _empty_queue(call: Call) -> None:
    _queues(call).empty(_own_queue(call))
