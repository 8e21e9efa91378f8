"""A pipe whose values come whole or not at all, however long they are, and whose sender may refuse to wait."""

from __future__ import annotations

import mmap
import pickle
import socket
from collections.abc import Iterator

import pytest

from abb_runtime.process.child import PipeClosed, PipeEnd

LONG = 3_000_000


@pytest.fixture
def ends() -> Iterator[tuple[PipeEnd, PipeEnd]]:
    ours, theirs = map(PipeEnd, socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET))
    yield ours, theirs
    ours.close()
    theirs.close()


def test_values_come_one_after_the_other(ends: tuple[PipeEnd, PipeEnd]) -> None:
    ours, theirs = ends
    for value in ("first", {"second": 2}, [1.0, 2.0]):
        ours.send(value)
    assert [theirs.receive() for _ in range(3)] == ["first", {"second": 2}, [1.0, 2.0]]
    assert not theirs.has_value()


@pytest.mark.timeout(10)
@pytest.mark.parametrize("count", [1, 1000])
def test_long_value_comes_whole_its_sender_waits_for_no_reader_and_its_blocks_are_not_copied(
    count: int, ends: tuple[PipeEnd, PipeEnd]
) -> None:
    ours, theirs = ends
    data = bytes(range(250)) * (LONG // count // 250)
    ours.send({"name": "long", "data": [pickle.PickleBuffer(data)] * count})
    ours.send("next")
    value = theirs.receive()
    assert value["name"] == "long"
    assert [bytes(each) for each in value["data"]] == [data] * count
    assert all(isinstance(each.obj, mmap.mmap) for each in value["data"])
    assert theirs.receive() == "next"


def test_long_value_without_blocks_comes_whole(ends: tuple[PipeEnd, PipeEnd]) -> None:
    ours, theirs = ends
    ours.send([float(number) for number in range(100_000)])
    assert sum(theirs.receive()) == 4_999_950_000.0


def test_sender_that_must_not_wait_passes_values_on_whole_and_in_order(ends: tuple[PipeEnd, PipeEnd]) -> None:
    ours, theirs = ends
    values = [bytes([number]) * (100_000 if number % 10 == 0 else 30_000) for number in range(200)]
    assert all(ours.send_soon(value) for value in values)
    assert not ours.flush()  # the socket is full
    heard = []
    while len(heard) < len(values):
        ours.flush()
        heard.append(theirs.receive())
    assert heard == values
    assert ours.flush()


@pytest.mark.timeout(20)
def test_sender_that_must_not_wait_drops_what_a_reader_never_takes(ends: tuple[PipeEnd, PipeEnd]) -> None:
    ours, theirs = ends
    while ours.send_soon(bytes(1000)):
        continue
    assert theirs.receive() == bytes(1000)
    ours.flush()
    assert ours.send_soon(b"room again")
    theirs.close()
    with pytest.raises(PipeClosed):
        ours.flush()


def test_end_of_the_other_side_is_noticed(ends: tuple[PipeEnd, PipeEnd]) -> None:
    ours, theirs = ends
    ours.send("last")
    ours.close()
    assert theirs.receive() == "last"
    assert theirs.has_value()
    for _ in range(2):
        with pytest.raises(PipeClosed):
            theirs.receive()
    with pytest.raises(PipeClosed):
        theirs.send("too late")
