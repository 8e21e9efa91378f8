"""Which browser sessions on other machines may operate a real robot."""

from __future__ import annotations

import pytest

from abb_protocols.errors import CommandRefused
from refusals import refused
from yumi.web.pairing import FIRST_PAIRING_PAUSE, LONGEST_PAIRING_PAUSE, PAIRING_DIGITS, WRONG_PAIRING_CODES, Pairing


class Terminal:
    """The codes that a person at the robot's machine has seen, and a clock that a test sets."""

    def __init__(self) -> None:
        self.codes: list[str] = []
        self.time = 100.0
        self.pairing = Pairing(self.codes.append, lambda: self.time)
        self.pairing.begin()

    @property
    def wrong(self) -> str:
        return f"{(int(self.codes[-1]) + 1) % 10**PAIRING_DIGITS:0{PAIRING_DIGITS}d}"

    def guess_wrongly(self) -> float:
        """As often as is allowed; the pause that follows [s]."""
        for _ in range(WRONG_PAIRING_CODES - 1):
            with refused(CommandRefused, "pairing_code_wrong"):
                self.pairing.pair(self.wrong)
        with pytest.raises(CommandRefused) as error:
            self.pairing.pair(self.wrong)
        assert error.value.said.code == "pairing_paused"
        return float(str(error.value.said.values["duration"]))


@pytest.fixture
def terminal() -> Terminal:
    return Terminal()


def test_code_pairs_one_session_and_another_code_is_shown_then(terminal: Terminal) -> None:
    code = terminal.codes[-1]
    assert len(code) == PAIRING_DIGITS
    assert code.isdigit()
    key = terminal.pairing.pair(f" {code[:3]} {code[3:]} ")
    assert terminal.pairing.is_paired(key)
    assert len(terminal.codes) == 2
    with refused(CommandRefused, "pairing_code_wrong"):
        terminal.pairing.pair(code if code != terminal.codes[-1] else terminal.wrong)
    assert terminal.pairing.is_paired(terminal.pairing.pair(terminal.codes[-1]))
    assert terminal.pairing.is_paired(key)


@pytest.mark.parametrize("key", ["", "guess", "ü", "\udcff"])
def test_session_without_a_key_of_a_pairing_is_not_paired(terminal: Terminal, key: str) -> None:
    assert not terminal.pairing.is_paired(key)
    terminal.pairing.pair(terminal.codes[-1])
    assert not terminal.pairing.is_paired(key)


@pytest.mark.parametrize("code", ["", " ", "12345", "ü", "\udcff", "１２３４５６"])
def test_what_is_no_code_is_a_wrong_one(terminal: Terminal, code: str) -> None:
    with refused(CommandRefused, "pairing_code_wrong"):
        terminal.pairing.pair(code)


def test_nothing_pairs_before_a_code_was_shown() -> None:
    with refused(CommandRefused, "pairing_code_wrong"):
        Pairing(lambda code: None).pair("")


def test_wrong_codes_make_a_pause_in_which_the_right_one_is_refused_too_and_a_new_code(terminal: Terminal) -> None:
    code = terminal.codes[-1]
    terminal.guess_wrongly()
    assert len(terminal.codes) == 2
    for _ in range(2):
        with refused(CommandRefused, "pairing_paused", duration=FIRST_PAIRING_PAUSE):
            terminal.pairing.pair(terminal.codes[-1])
    terminal.time += FIRST_PAIRING_PAUSE
    if code != terminal.codes[-1]:
        with refused(CommandRefused, "pairing_code_wrong"):
            terminal.pairing.pair(code)
    assert terminal.pairing.is_paired(terminal.pairing.pair(terminal.codes[-1]))


def test_each_pause_is_twice_as_long_until_somebody_is_paired(terminal: Terminal) -> None:
    pauses: list[float] = []
    while LONGEST_PAIRING_PAUSE not in pauses:
        pauses.append(terminal.guess_wrongly())
        terminal.time += pauses[-1]
    assert pauses == [min(LONGEST_PAIRING_PAUSE, FIRST_PAIRING_PAUSE * 2**count) for count in range(len(pauses))]
    terminal.pairing.pair(terminal.codes[-1])
    assert terminal.guess_wrongly() == FIRST_PAIRING_PAUSE
