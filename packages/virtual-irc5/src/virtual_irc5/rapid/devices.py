r"""The devices of a task's host, its controller: disk, sockets, dialogs, message queues, event log, facts.

All of them are values or protocols without waiting: an instruction asks once per advance of its task. Files and
sockets report what is wrong as `OSError`, as Python's own do; the instructions make RAPID's errors of them.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

from virtual_irc5.rapid.states import Severity, TaskEvent
from virtual_irc5.rapid.types import RapidRuntimeError

# Disk -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class DiskEntry:
    """A file or directory of the disk.

    Attributes:
        name: the last part of its path.
        size: of its content [bytes], 0 for a directory.
        changed: when it was written, seconds since 1970.
    """

    name: str
    is_directory: bool
    size: int
    changed: float


class Disk(Protocol):
    """Files by their RAPID paths, such as "HOME:/logs/today.txt"; every method raises OSError."""

    def read(self, path: str) -> bytes: ...

    def write(self, path: str, content: bytes) -> None:
        """Create or replace a file in a directory that exists."""

    def entry(self, path: str) -> DiskEntry:
        """What has the path."""

    def entries(self, path: str) -> tuple[DiskEntry, ...]:
        """What is in a directory."""

    def make_directory(self, path: str) -> None: ...

    def remove(self, path: str) -> None:
        """Remove a file or an empty directory."""

    def copy(self, path: str, to: str) -> None: ...

    def rename(self, path: str, to: str) -> None: ...

    def space(self) -> tuple[int, int]:
        """The size of the disk, and how much of it is free [bytes]."""


# Network ----------------------------------------------------------------------------------------------------------


class Socket(Protocol):
    """A socket that never waits; every method raises OSError."""

    def bind(self, address: str, port: int) -> None: ...

    def listen(self) -> None: ...

    def accept(self) -> tuple[Socket, str] | None:
        """A connection and the address of the other side; None while none is asked for."""

    def connect(self, address: str, port: int) -> None:
        """Begin to connect."""

    def is_connected(self) -> bool:
        """Whether what `connect` began is done; raises what it failed with."""

    def send(self, data: bytes) -> int:
        """How many of the bytes are on their way, 0 where the other side takes no more now."""

    def receive(self, size: int) -> bytes | None:
        """What is there, up to `size` bytes; None: nothing yet, b"": the other side has closed the connection."""

    def send_to(self, data: bytes, address: str, port: int) -> None:
        """Send a datagram."""

    def receive_from(self, size: int) -> tuple[bytes, str, int] | None:
        """A datagram and where it came from; None while there is none."""

    def waiting(self) -> int:
        """How many bytes can be received at once."""

    def close(self) -> None: ...


class NetworkDevice(Protocol):
    """Makes sockets."""

    def tcp(self) -> Socket: ...

    def udp(self) -> Socket: ...


# FlexPendant ------------------------------------------------------------------------------------------------------


class DialogKind(Enum):
    """What an operator is asked for."""

    BUTTON = "button"
    NUMBER = "number"
    TEXT = "text"
    LIST = "list"


@dataclass(frozen=True, slots=True)
class DialogChoice:
    """A button or an item of a list.

    Attributes:
        text: what the operator reads.
        value: what the program gets.
    """

    text: str
    value: float


@dataclass(eq=False, slots=True)
class DeviceDialog:
    """A question on the FlexPendant that a program waits for.

    Attributes:
        task: the task that asks.
        instruction: such as "UIMessageBox".
        kind: what the answer is.
        header: the line above.
        lines: the message.
        choices: of the buttons, or of the list.
        buttons: those below a list.
        lowest, highest: limits of a number.
        is_integer: whether a number has to be whole.
        initial: what is shown before the operator enters something.
        number: counted by the FlexPendant.
        answer: the value of a choice, a number or a text; None until there is one.
        button: the value of the button a list was left with, None until then and where it has none.
    """

    task: str
    instruction: str
    kind: DialogKind
    header: str = ""
    lines: tuple[str, ...] = ()
    choices: tuple[DialogChoice, ...] = ()
    buttons: tuple[DialogChoice, ...] = ()
    lowest: float | None = None
    highest: float | None = None
    is_integer: bool = False
    initial: float | str | None = None
    number: int = 0
    answer: float | str | None = None
    button: float | None = None

    def give(self, text: str) -> None:
        """Answer it as an operator does: with the text or value of a choice, with a number, or with a text.

        A list that has buttons is left with the first one; `item/Cancel` leaves it with another.

        Raises:
            ValueError: it is no answer to this question; nothing has changed.
        """
        if self.kind is DialogKind.TEXT:
            if len(text) > _LONGEST_TEXT:
                raise ValueError(f"A text of the FlexPendant has up to {_LONGEST_TEXT} characters, not {len(text)}.")
            self.answer = text
        elif self.kind is DialogKind.NUMBER:
            self.answer = self._number(text)
        elif self.kind is DialogKind.LIST and self.buttons:
            item, slash, button = text.rpartition("/")
            item, button = (item, button) if slash else (text, self.buttons[0].text)
            self.answer, self.button = _chosen(item, self.choices), _chosen(button, self.buttons)
        else:
            self.answer = _chosen(text, self.choices)

    def _number(self, text: str) -> float:
        try:
            value = float(text)
        except ValueError as error:
            raise ValueError(f"{self.instruction} asks for a number, not {text!r}.") from error
        if value - value != 0.0 or (self.is_integer and value != int(value)):
            kind = "an integer" if self.is_integer else "a number"
            raise ValueError(f"{self.instruction} asks for {kind}, not {text}.")
        low, high = (self.lowest, self.highest)
        if (low is not None and value < low) or (high is not None and value > high):
            raise ValueError(f"{self.instruction} takes {low} to {high}, not {text}.")
        return value


_LONGEST_TEXT = 80  # characters


def _chosen(text: str, choices: tuple[DialogChoice, ...]) -> float:
    """The value of a choice, found by its text or its value."""
    for choice in choices:
        if choice.text and text.strip().lower() in (choice.text.strip().lower(), f"{choice.value:g}"):
            return choice.value
    known = ", ".join(f"{choice.value:g} {choice.text}" for choice in choices if choice.text)
    raise ValueError(f"There is no choice {text!r}; there is: {known}.")


_MOST_DIALOGS = 50


class FlexPendant:
    """The questions that programs wait for, oldest first, and the messages they leave on the screen.

    Attributes:
        dialogs: what has no answer yet.
        messages: what UIMsgWrite shows, by task.
        is_connected: whether there is an operator's screen at all (UIClientExist).
    """

    def __init__(self) -> None:
        self.dialogs: dict[int, DeviceDialog] = {}
        self.messages: dict[str, tuple[str, ...]] = {}
        self.is_connected = True
        self._numbers = itertools.count(1)

    def ask(self, dialog: DeviceDialog) -> None:
        """Show a question; raises ERR_TP_NO_CLIENT where there is no screen."""
        if not self.is_connected:
            raise RapidRuntimeError("ERR_TP_NO_CLIENT", f"{dialog.instruction}: no FlexPendant is connected.")
        if len(self.dialogs) >= _MOST_DIALOGS:
            raise RapidRuntimeError("ERR_EXECPHR", f"{_MOST_DIALOGS} questions wait on the FlexPendant already.")
        dialog.number = next(self._numbers)
        self.dialogs[dialog.number] = dialog

    def withdraw(self, dialog: DeviceDialog) -> None:
        """Take a question away, answered or not."""
        self.dialogs.pop(dialog.number, None)

    @property
    def active(self) -> DeviceDialog | None:
        """The question on top, which is the newest one without an answer."""
        return next((d for d in reversed(self.dialogs.values()) if d.answer is None), None)


# Message queues ---------------------------------------------------------------------------------------------------

MOST_MESSAGES = 5  # RMQ Max No Of Messages
LONGEST_MESSAGE = 400  # RMQ Max Message Size [bytes]


@dataclass(frozen=True, slots=True)
class RapidMessage:
    """A RAPID message: a value as text with its type.

    Attributes:
        type_name: the RAPID type, such as "string" or "pos".
        sizes: of an array, empty for a single value.
        text: the value as a RAPID literal.
        sender: the queue it came from, where answers go.
        user_defined: a number of the sender.
    """

    type_name: str
    sizes: tuple[int, ...]
    text: str
    sender: str
    user_defined: float = 0.0


class MessageQueues:
    """The queues by name, as "RMQ_T_ROB_R", found in any letter case; each holds a few messages.

    Attributes:
        watchers: called when a message has come into the queue of a lower-case name.
    """

    def __init__(self) -> None:
        self._queues: dict[str, deque[RapidMessage]] = {}
        self._names: dict[str, str] = {}
        self.listeners: dict[str, Callable[[RapidMessage], bool]] = {}
        self.watchers: dict[str, list[Callable[[RapidMessage], None]]] = {}

    def open(self, name: str) -> None:
        """Create a queue; nothing happens when it is there."""
        self._names.setdefault(name.lower(), name)
        self._queues.setdefault(name.lower(), deque())

    def close(self, name: str) -> None:
        """Remove a queue with its messages."""
        self._queues.pop(name.lower(), None)
        self._names.pop(name.lower(), None)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._names.values())

    def name(self, name: str) -> str:
        """The name as the queue was opened; raises ERR_RMQ_NAME."""
        if name.lower() not in self._queues:
            known = ", ".join(self.names) or "none"
            raise RapidRuntimeError("ERR_RMQ_NAME", f"There is no message queue '{name}'; there is: {known}.")
        return self._names[name.lower()]

    def send(self, name: str, message: RapidMessage) -> None:
        """Put a message into a queue; raises ERR_RMQ_INVALID, ERR_RMQ_FULL or ERR_RMQ_MSGSIZE."""
        queue = self._queues.get(name.lower())
        if queue is None:
            raise RapidRuntimeError("ERR_RMQ_INVALID", f"The message queue '{name}' is gone.")
        if len(message.text) > LONGEST_MESSAGE:
            sentence = f"A message has up to {LONGEST_MESSAGE} bytes, not {len(message.text)}."
            raise RapidRuntimeError("ERR_RMQ_MSGSIZE", sentence)
        listener = self.listeners.get(name.lower())
        if listener is not None and listener(message):
            return
        if len(queue) >= MOST_MESSAGES:
            raise RapidRuntimeError("ERR_RMQ_FULL", f"The message queue '{name}' holds {MOST_MESSAGES} messages.")
        queue.append(message)
        for watcher in tuple(self.watchers.get(name.lower(), ())):
            watcher(message)

    def take(self, name: str) -> RapidMessage | None:
        """The oldest message of a queue, which it no longer holds; None where it is empty."""
        queue = self._queues.get(name.lower())
        return queue.popleft() if queue else None

    def empty(self, name: str) -> None:
        """Forget the messages of a queue."""
        self._queues.get(name.lower(), deque()).clear()


# Event log --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LoggedEvent:
    """An event of the log, as IError and ReadErrData see it.

    Attributes:
        domain: the ten-thousands of its code, as the constants of errdomain.
        number: the rest of its code.
        severity: how serious it is.
        arguments: what of it differs from event to event.
    """

    domain: int
    number: int
    severity: Severity
    title: str
    text: str
    arguments: tuple[str, ...] = ()


# All together -----------------------------------------------------------------------------------------------------


class ConfigurationDevice(Protocol):
    """The system parameters."""

    def read(self, path: str, attribute: str) -> str:
        """An attribute of an instance "/DOMAIN/TYPE/name"; raises KeyError."""

    def write(self, path: str, attribute: str, value: str) -> None:
        """Change it; raises KeyError."""

    def save(self, domain: str) -> str:
        """The text of a domain's cfg file; raises KeyError."""


class IoDevices(Protocol):
    """The devices and networks that I/O signals are on."""

    def device_of(self, signal: str) -> str:
        """The device of a signal, "" where it is on none; raises KeyError."""

    def type_of(self, signal: str) -> str:
        """DI, DO, GI, GO, AI or AO; raises KeyError."""

    def limits(self, signal: str) -> tuple[float, float]:
        """The lowest and highest value of a signal; raises KeyError."""

    def devices(self) -> Mapping[str, str]:
        """The network of each device."""


@dataclass(slots=True)
class Devices:
    """What a task's host offers.

    Attributes:
        disk, network, pendant, queues: see there; the queues and the FlexPendant are those of all tasks.
        facts: by name, such as "SerialNo", "SWVersion", "SWVersionName", "RobotType", "CtrlId", "LanIp",
            "CtrlLang", "SystemName".
        time: what the controller's clock shows, seconds since 1970.
        tasks: all tasks of the controller by name.
        texts: text tables by name: each has texts by number.
        disabled: devices that a program has disabled (IODisable).
        restart: a warm restart, or None where the host has none.
        watchers: called for each event of the log.
        trapped: the last event that has interrupted each task (IError).
        searches: what SetDataSearch of each task has found: module and name.
        log: puts a message into the event log: number, title, text, severity, arguments.
    """

    disk: Disk
    network: NetworkDevice
    pendant: FlexPendant = field(default_factory=FlexPendant)
    queues: MessageQueues = field(default_factory=MessageQueues)
    facts: Mapping[str, str] = field(default_factory=dict)
    time: Callable[[], float] = lambda: 0.0
    tasks: Callable[[], Mapping[str, object]] = dict
    texts: dict[str, dict[int, str]] = field(default_factory=dict)
    disabled: set[str] = field(default_factory=set)
    io: IoDevices | None = None
    configuration: ConfigurationDevice | None = None
    restart: Callable[[], None] | None = None
    watchers: list[Callable[[LoggedEvent], None]] = field(default_factory=list)
    trapped: dict[str, LoggedEvent] = field(default_factory=dict)
    searches: dict[str, Iterator[tuple[str, str]]] = field(default_factory=dict)
    log: Callable[[int, str, str, Severity, tuple[str, ...]], None] = lambda *message: None


class NoNetwork:
    """A controller without the option PC Interface: it has no sockets."""

    def tcp(self) -> Socket:
        raise OSError("this controller has no network.")

    udp = tcp


class Host(Protocol):
    """The controller as a RAPID task sees it.

    Attributes:
        devices: its disk, network, FlexPendant and so on.
    """

    devices: Devices

    def write_text(self, task: str, text: str) -> None:
        """Show one line on the operator's display (TPWrite)."""

    def write_event(self, task: str, title: str, text: str, severity: Severity, arguments: tuple[str, ...]) -> None:
        """Put a message into the event log (ErrWrite); the arguments are what of it the program has given."""

    def read_signal(self, name: str) -> float:
        """The value of an I/O signal; raises KeyError when there is none of that name."""

    def write_signal(self, name: str, value: float) -> None:
        """Set an output; raises KeyError when there is none of that name."""

    def read_file(self, path: str) -> str:
        """The text of a file, by RAPID path ("HOME:/x.mod"); raises OSError."""

    def report(self, task: str, event: TaskEvent) -> None:
        """Called when the task has stopped by itself."""

    def is_virtual(self) -> bool:
        """Whether the controller is a simulation; RobOS() is the opposite."""
