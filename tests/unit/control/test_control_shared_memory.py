from __future__ import annotations

import pytest

from yumi.control.shared_state import SharedHistory, SharedMailbox
from yumi.process.pipe import ChildProcess, PipeClosed, PipeEnd

ROUNDS = 20_000


def fill(pipe: PipeEnd, box: SharedMailbox) -> None:
    """In a child: letters whose numbers are all equal, as fast as it goes."""
    for number in range(1, ROUNDS + 1):
        box.put((float(number),) * 30)
    pipe.send("done")


def answer_once(pipe: PipeEnd) -> None:
    pipe.send(pipe.receive() * 2)


def test_mailbox_is_empty_at_first() -> None:
    assert SharedMailbox(2).peek() is None


def test_mailbox_holds_the_latest_letter_with_its_number() -> None:
    box = SharedMailbox(2)
    box.put((1.0, 2.0))
    box.put((3.0, 4.0))
    assert box.peek() == (2, (3.0, 4.0))


def test_mailbox_refuses_letters_of_another_size() -> None:
    with pytest.raises(ValueError, match="holds 2 numbers, got 3"):
        SharedMailbox(2).put((1.0, 2.0, 3.0))


def test_mailbox_shows_the_letter_before_when_its_writer_died_in_the_middle_of_one() -> None:
    box = SharedMailbox(1)
    assert box.peek() is None
    box.put((1.0,))
    assert box.peek() == (1, (1.0,))
    box._memory[0] = 2.0  # begun, never finished
    box._memory[2] = 5.0
    assert box.peek() == (1, (1.0,))


def test_mailbox_never_shows_half_a_letter_of_another_process() -> None:
    box = SharedMailbox(30)
    child = ChildProcess("writer", fill, box)
    child.start()
    seen = set()
    while not child.pipe.has_value():
        letter = box.peek()
        if letter is not None:
            assert set(letter[1]) == {float(letter[0])}
            seen.add(letter[0])
    assert child.join(10.0)
    assert box.peek() == (ROUNDS, (float(ROUNDS),) * 30)
    assert seen


def test_history_keeps_the_newest_letters_in_order() -> None:
    history = SharedHistory(1, 3)
    assert history.peek() is None
    for value in (10.0, 20.0, 30.0, 40.0):
        history.put((value,))
    assert history.since(0) == [(2, (20.0,)), (3, (30.0,)), (4, (40.0,))]
    assert history.since(3) == [(4, (40.0,))]
    assert history.since(4) == []
    assert history.peek() == (4, (40.0,))


def test_pipe_passes_values_and_notices_the_end_of_the_child() -> None:
    child = ChildProcess("answerer", answer_once)
    child.start()
    child.pipe.send(21)
    assert child.pipe.receive() == 42
    with pytest.raises(PipeClosed):
        child.pipe.receive()
    assert child.join(10.0)
    assert child.exit_code == 0
