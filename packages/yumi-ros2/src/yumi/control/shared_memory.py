"""Buffers in memory that the control process shares with the driver.

In a buffer (:class:`SharedBuffer`) the newest value counts. A buffer counts the writes before and after each one, so
that a reader knows when the value changed while it was read; it reads again, a few times, and returns the value it read
before if the writer has died in the middle of one. No side ever waits. The layout of a value follows from its type:
numbers packed and unpacked by one call each, which takes half the time of an array of numbers and a fifth of reading a
``ctypes.Structure`` by its fields.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from itertools import chain
from math import isnan
from multiprocessing.sharedctypes import RawArray
from multiprocessing.synchronize import Semaphore
from operator import attrgetter, itemgetter
from struct import Struct
from typing import Any, Generic, TypeVar, get_type_hints

from abb_protocols.catalogue import message
from abb_protocols.errors import MissingPrerequisite
from abb_protocols.robot.joints import JOINT_COUNT, Joints
from abb_runtime.process.child import PROCESSES
from yumi.control.goals import UNKNOWN_JOINTS, GoalKind

_V = TypeVar("_V")

_READ_ATTEMPTS = 10  # a writer on another processor is done by then; one that we took the processor from never will be
_COUNTERS = Struct("qq")  # writes begun, finished: equal and not 0 when the value is whole
_BEGUN, _FINISHED = Struct("q"), Struct("q")
_LENGTH = Struct("q")
_MESSAGE = _COUNTERS.size + _LENGTH.size  # where the bytes of a message begin
_TEXT = 64  # of a text, which is cut off there [bytes]


class _Layout:
    """How the fields of a named tuple lie in memory: numbers and texts first, then joints.

    Args:
        kind: its fields are numbers, short texts, enumerations of integers, joints, joints that may be None, or named
            tuples of these.
    """

    def __init__(self, kind: type[Any]) -> None:
        codes = {float: "d", int: "q", bool: "?", str: f"{_TEXT}s"}
        hints: dict[str, Any] = {}
        self._parts: list[tuple[int, int, type[Any]]] = []  # where in a value which of its fields make a named tuple
        for number, (name, hint) in enumerate(_fields(kind)):
            inner = {f"{name}.{field}": own for field, own in _fields(hint)}
            if inner:
                self._parts.append((number, len(inner), hint))
            hints.update(inner or {name: hint})
        vectors = [name for name, hint in hints.items() if hint in (Joints, Joints | None)]
        scalars = [name for name in hints if name not in vectors]
        enums = {name: hints[name] for name in scalars if issubclass(hints[name], IntEnum | GoalKind)}
        formats = ["q" if name in enums else codes[hints[name]] for name in scalars]
        self._texts = [index for index, name in enumerate(scalars) if hints[name] is str]
        self._kind = kind
        self._struct = Struct("".join(formats) + f"{len(vectors) * JOINT_COUNT}d")
        self._scalars = _getter(scalars)
        self._vectors = _getter(vectors)
        first = len(scalars)
        begins = {name: first + JOINT_COUNT * index for index, name in enumerate(vectors)}
        taken = [
            slice(begins[name], begins[name] + JOINT_COUNT) if name in begins else scalars.index(name) for name in hints
        ]
        self._take = itemgetter(*taken) if len(taken) > 1 else lambda numbers: (numbers[taken[0]],)
        places = {name: index for index, name in enumerate(hints)}
        self._made = [(places[name], enum) for name, enum in enums.items()]
        self._made += [(places[name], _text) for name in hints if hints[name] is str]
        self._made += [(places[name], _known) for name in vectors if hints[name] != Joints]
        self.size = self._struct.size

    def pack(self, memory: memoryview, value: Any) -> None:
        vectors = [each or UNKNOWN_JOINTS for each in self._vectors(value)]
        scalars = list(self._scalars(value))
        for index in self._texts:
            scalars[index] = scalars[index].encode()
        self._struct.pack_into(memory, _COUNTERS.size, *scalars, *chain.from_iterable(vectors))

    def unpack(self, memory: memoryview) -> Any:
        fields = self._take(self._struct.unpack_from(memory, _COUNTERS.size))
        if self._made or self._parts:
            fields = list(fields)
            for index, make in self._made:
                fields[index] = make(fields[index])
            for number, count, kind in self._parts:
                fields[number : number + count] = [kind(*fields[number : number + count])]
        return self._kind(*fields)


def _text(raw: bytes) -> str:
    return raw.rstrip(b"\0").decode(errors="ignore")  # a character may have been cut in two


def _known(values: Joints) -> Joints | None:
    return None if isnan(values[0]) else values


def _fields(kind: Any) -> list[tuple[str, Any]]:
    """Names and types of a named tuple's fields; of anything else there are none."""
    names = getattr(kind, "_fields", ())
    hints = get_type_hints(kind) if names else {}
    return [(name, hints[name]) for name in names]


_layouts: dict[type[Any], _Layout] = {}


def _layout_of(kind: type[Any]) -> _Layout:
    if kind not in _layouts:
        _layouts[kind] = _Layout(kind)
    return _layouts[kind]


def _getter(names: list[str]) -> Any:
    """Several attributes at once, as a tuple whatever their number."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda value: tuple(getattr(value, name) for name in names)


class SharedBuffer(Generic[_V]):
    """A buffer between two processes; hand it to the child when it is spawned.

    Args:
        kind: of the values; a named tuple of numbers and joints.
    """

    def __init__(self, kind: type[_V]) -> None:
        with _from_the_system():
            memory = RawArray(ctypes.c_char, _COUNTERS.size + _layout_of(kind).size)
        self.__setstate__((kind, memory))

    def __getstate__(self) -> tuple[type[_V], Any]:
        return self._kind, self._shared

    def __setstate__(self, state: tuple[type[_V], Any]) -> None:
        self._kind, self._shared = state
        self._layout = _layout_of(self._kind)
        self._memory = memoryview(self._shared).cast("B")
        self._read_last: tuple[int, _V] | None = None

    @property
    def address(self) -> int:
        """Of the memory, for the core."""
        return ctypes.addressof(self._shared)

    def write(self, value: _V, number: int | None = None) -> None:
        """Replace the value; one process only may write. ``number``: its own in place of the next one."""
        memory = self._memory
        if number is None:
            number = _COUNTERS.unpack_from(memory)[1] + 1
        _BEGUN.pack_into(memory, 0, number)
        self._layout.pack(memory, value)
        _FINISHED.pack_into(memory, _BEGUN.size, number)

    def read(self) -> tuple[int, _V] | None:
        """The number of the newest write, from 1, and its value; None while nothing was ever written."""
        memory, before = self._memory, self._read_last
        for _ in range(_READ_ATTEMPTS):
            begun, finished = _COUNTERS.unpack_from(memory)
            if before is not None and begun == finished == before[0]:
                return before  # the control loop reads in every cycle; a new value is rare
            if begun != finished:
                continue
            if not finished:
                return None
            value = self._layout.unpack(memory)
            if _COUNTERS.unpack_from(memory) == (finished, finished):
                self._read_last = (finished, value)
                break
        return self._read_last


class SharedBytes:
    """The newest of a series of short messages, between two processes; hand it to the child when it is spawned.

    Args:
        size: a longer message is left out [bytes].
    """

    def __init__(self, size: int) -> None:
        with _from_the_system():
            memory = RawArray(ctypes.c_char, _MESSAGE + size)
        self.__setstate__(memory)

    def __getstate__(self) -> Any:
        return self._shared

    def __setstate__(self, shared: Any) -> None:
        self._shared = shared
        self._memory = memoryview(shared).cast("B")

    def write(self, message: bytes) -> None:
        """Replace the message; one process only may write."""
        memory, end = self._memory, _MESSAGE + len(message)
        if end > len(memory):
            return
        number = _COUNTERS.unpack_from(memory)[1] + 1
        _BEGUN.pack_into(memory, 0, number)
        _LENGTH.pack_into(memory, _COUNTERS.size, len(message))
        memory[_MESSAGE:end] = message
        _FINISHED.pack_into(memory, _BEGUN.size, number)

    def read(self) -> bytes:
        """The newest message; empty while nothing was ever written, or where a writer has died in the middle."""
        memory = self._memory
        for _ in range(_READ_ATTEMPTS):
            before = _COUNTERS.unpack_from(memory)
            (length,) = _LENGTH.unpack_from(memory, _COUNTERS.size)
            message = bytes(memory[_MESSAGE : _MESSAGE + length])
            if before[0] == before[1] and _COUNTERS.unpack_from(memory) == before:
                return message
        return b""


class SharedHistory(Generic[_V]):
    """The last ``depth`` values: a reader that was busy for a moment misses none."""

    def __init__(self, kind: type[_V], depth: int) -> None:
        self._slots = tuple(SharedBuffer(kind) for _ in range(depth))
        self._newest = shared_numbers(1)

    def write(self, value: _V) -> None:
        """Add a value; the oldest one makes room. One process only may write."""
        number = int(self._newest[0]) + 1
        self._slots[number % len(self._slots)].write(value, number)
        self._newest[0] = float(number)

    def read(self) -> tuple[int, _V] | None:
        """The newest value with its number, from 1; None while nothing was ever written."""
        values = self.since(int(self._newest[0]) - 1)
        return values[-1] if values else None

    def since(self, number: int) -> list[tuple[int, _V]]:
        """The values after ``number`` that are still there, oldest first."""
        newest = int(self._newest[0])
        numbers = range(max(number, newest - len(self._slots)) + 1, newest + 1)
        values = ((each, self._slots[each % len(self._slots)].read()) for each in numbers)
        # A value that was replaced meanwhile bears another number: it comes with the next call.
        return [value for each, value in values if value and value[0] == each]


SharedNumbers = ctypes.Array[ctypes.c_double]
"""A block of numbers that two processes see."""


def shared_numbers(count: int) -> SharedNumbers:
    """``count`` zeros of 8 bytes; hand them to the child when it is spawned. Who writes and reads how is theirs.

    Raises:
        MissingPrerequisite: the machine has no shared memory left.
    """
    with _from_the_system():
        return RawArray(ctypes.c_double, count)


CycleEvent = Semaphore
"""Wakes a thread that waits in another process."""


def new_cycle_event() -> CycleEvent:
    """An event for a process that will be spawned; raises MissingPrerequisite as :func:`shared_numbers`."""
    with _from_the_system():
        return PROCESSES.Semaphore(0)


@contextmanager
def _from_the_system() -> Iterator[None]:
    try:
        yield
    except (OSError, MemoryError) as error:
        why = error.strerror if isinstance(error, OSError) else "out of memory"
        raise MissingPrerequisite(message("no_shared_memory", why=why)) from error
