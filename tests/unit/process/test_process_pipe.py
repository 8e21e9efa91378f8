"""A pipe whose long values come in parts, so that their reader has time for other things in between."""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterator
from threading import Thread

import pytest

from yumi.process.supervision import PROCESSES, PipeClosed, PipeEnd

LONG = 3_000_000


@pytest.fixture
def ends() -> Iterator[tuple[PipeEnd, PipeEnd]]:
    ours, theirs = map(PipeEnd, PROCESSES.Pipe())
    yield ours, theirs
    ours.close()
    theirs.close()


def test_values_come_one_after_the_other(ends: tuple[PipeEnd, PipeEnd]) -> None:
    ours, theirs = ends
    for value in ("first", {"second": 2}):
        ours.send(value)
    assert (theirs.receive(), theirs.receive()) == ("first", {"second": 2})


def test_short_value_is_whole_at_once(ends: tuple[PipeEnd, PipeEnd]) -> None:
    ours, theirs = ends
    ours.send([1.0, 2.0])
    assert theirs.read()
    assert theirs.receive() == [1.0, 2.0]


def test_blocks_of_a_long_value_are_read_a_part_at_a_time_and_come_whole(ends: tuple[PipeEnd, PipeEnd]) -> None:
    ours, theirs = ends
    data = bytes(range(250)) * (LONG // 250)
    sender = Thread(target=ours.send, args=({"name": "long", "data": pickle.PickleBuffer(data)},))
    sender.start()
    parts = 1
    while not theirs.read():
        parts += 1
    value = theirs.receive()
    sender.join()
    assert parts > LONG // (1 << 16)
    assert (value["name"], bytes(value["data"])) == ("long", data)
    ours.send("next")
    assert theirs.receive() == "next"


def test_reader_does_not_wait_for_the_rest_of_a_long_value(ends: tuple[PipeEnd, PipeEnd]) -> None:
    ours, theirs = ends
    ours.send(pickle.PickleBuffer(bytes(1000)))
    frame = os.read(theirs.fileno(), 1 << 16)
    os.write(ours.fileno(), frame[:-600])
    assert not theirs.read()
    assert not theirs.read()
    assert not theirs.has_value()
    os.write(ours.fileno(), frame[-600:])
    assert theirs.read()
    assert len(theirs.receive()) == 1000


def test_sender_that_must_not_wait_passes_long_values_on_whole_and_in_order(ends: tuple[PipeEnd, PipeEnd]) -> None:
    ours, theirs = ends
    values = [bytes([number]) * 100_000 for number in range(10)]
    assert all(ours.send_soon(value) for value in values)
    assert not ours.flush()  # the pipe is full
    heard = []
    while len(heard) < len(values):
        ours.flush()
        if theirs.read():
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


def test_end_of_the_other_side_is_told_in_the_middle_of_a_value(ends: tuple[PipeEnd, PipeEnd]) -> None:
    ours, theirs = ends
    ours.close()
    with pytest.raises(PipeClosed):
        theirs.read()
    with pytest.raises(PipeClosed):
        theirs.receive()
