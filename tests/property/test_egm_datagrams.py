"""Datagrams that no robot sends: nothing but a refusal may come of them, and the next good one is answered.

``YUMI_EGM_DATAGRAMS=1000000 pytest tests/property/test_egm_datagrams.py`` sends a million.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from math import radians
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.egm.codec import (
    LARGEST_DATAGRAM,
    MciState,
    MotorState,
    Pose,
    RapidState,
    RobotCodec,
    RobotMessage,
    SensorCodec,
)
from abb_protocols.errors import ProtocolError
from abb_protocols.robot.joints import Joints
from yumi.egm.egm_session import SensorSession
from yumi.egm.joint_codec import JointCodec, JointReport

LONG_SILENCE = 1.0  # [s] after which a robot whose clock has gone back is believed
COUNT = int(os.environ.get("YUMI_EGM_DATAGRAMS", "20000"))
CYCLE = 0.004
HOME: Joints = (0.0, -2.0, 1.0, 0.5, 0.0, 0.7, 0.0)
POSE = Pose((0.3, 0.2, 0.1), (0.5, 0.5, 0.5, 0.5))
MESSAGE = RobotMessage(
    0, 0, HOME, HOME, POSE, POSE, 1.0, 1.0, MotorState.ON, MciState.RUNNING, RapidState.RUNNING, False, 0.5
)


def good_datagrams(count: int) -> list[bytes]:
    codec = RobotCodec()
    return [codec.encode(replace(MESSAGE, seqno=n, measured_time=1.0 + n * CYCLE)) for n in range(count)]


def noise(chance: Random, good: bytes) -> bytes:
    return chance.randbytes(chance.randrange(LARGEST_DATAGRAM))


def truncated(chance: Random, good: bytes) -> bytes:
    return good[: chance.randrange(len(good))]


def oversized(chance: Random, good: bytes) -> bytes:
    return good + chance.randbytes(LARGEST_DATAGRAM + 1 - len(good) + chance.randrange(1000))


def flipped(chance: Random, good: bytes) -> bytes:
    wrong = bytearray(good)
    for _ in range(chance.randrange(1, 9)):
        wrong[chance.randrange(len(wrong))] ^= 1 << chance.randrange(8)
    return bytes(wrong)


def spliced(chance: Random, good: bytes) -> bytes:
    cut, paste = chance.randrange(len(good)), chance.randrange(len(good))
    return good[:cut] + good[paste:]


def stuffed(chance: Random, good: bytes) -> bytes:
    place = chance.randrange(len(good))
    return good[:place] + chance.randbytes(chance.randrange(1, 20)) + good[place:]


KINDS: tuple[Callable[[Random, bytes], bytes], ...] = (noise, truncated, oversized, flipped, spliced, stuffed)


def bad_datagrams(seed: int, good: list[bytes]) -> Iterator[bytes]:
    chance = Random(seed)
    while True:
        yield chance.choice(KINDS)(chance, chance.choice(good))


class Bystander:
    """Our end of a wire that carries anything."""

    def __init__(self) -> None:
        self._codec = JointCodec()
        self.session: SensorSession[JointReport] = SensorSession(self._codec)
        self.now = 0.0
        self._robot = RobotCodec()

    def answers(self, datagram: bytes) -> bool:
        """Whether ``datagram``, half a cycle later, is answered; the answer is where the arm is said to be."""
        self.now += 0.5 * CYCLE
        report = self.session.accept([datagram], self.now)
        if report is None:
            return False
        told = self._robot.decode(self._codec.encode_joints(self.session.next_seqno(), report.measured, None)).position
        self.session.settle()
        assert told == pytest.approx(report.measured, abs=1e-9)
        assert all(abs(angle) < radians(1100.0) for angle in report.measured)
        return True


def true_datagrams(number: int, before: list[bytes]) -> list[bytes]:
    """The newest of the robot's datagrams and this one, the last."""
    time = 1.0 + number * CYCLE
    return [*before[-200:], RobotCodec().encode(replace(MESSAGE, seqno=number, measured_time=time))]


@pytest.mark.timeout(1200)
def test_session_answers_the_next_good_datagram_after_any_that_is_old_or_cannot_be_read() -> None:
    """One that can be read and says something else is of a sender with the robot's own address (decision 55)."""
    reader, end, chance = JointCodec(), Bystander(), Random(20)
    recent: list[bytes] = []
    read = 0
    for number in range(COUNT):
        recent = true_datagrams(number, recent)
        assert end.answers(recent[-1])
        bad = chance.choice(KINDS)(chance, chance.choice(recent))
        report = refused_or_read(reader.decode, bad)
        is_old = isinstance(report, JointReport) and (number - 200 <= report.seqno <= number) and is_true(report)
        if report is None or is_old:
            assert not end.answers(bad)
        read += report is not None
    assert end.session.number == 1
    assert end.session.counters.received == COUNT
    assert end.session.counters.malformed > 0.5 * COUNT
    assert read < 0.3 * COUNT


def is_true(report: JointReport) -> bool:
    """Whether number and clock are those of one of the robot's datagrams: the wire has whole microseconds."""
    return report.measured_time == pytest.approx(1.0 + report.seqno * CYCLE, abs=0.5e-6)


@pytest.mark.timeout(1200)
def test_session_survives_any_datagram_and_goes_on_after_the_longest_silence() -> None:
    end, chance, accepted = Bystander(), Random(21), 0
    recent: list[bytes] = []
    for number in range(COUNT):
        recent = true_datagrams(number, recent)
        end.answers(recent[-1])
        accepted += end.answers(chance.choice(KINDS)(chance, chance.choice(recent)))
    assert end.session.counters.malformed > 0.5 * COUNT
    assert accepted < 0.3 * COUNT
    answered = []
    for number in range(COUNT, COUNT + 2 * round(LONG_SILENCE / CYCLE)):
        recent = true_datagrams(number, recent)
        answered.append(end.answers(recent[-1]))
        end.now += 0.5 * CYCLE
    assert all(answered[round(LONG_SILENCE / CYCLE) + 2 :])


@pytest.mark.timeout(1200)
def test_codecs_raise_nothing_but_protocol_errors_whatever_they_read() -> None:
    robot = RobotCodec()
    for bad in islice(bad_datagrams(21, good_datagrams(100)), COUNT):
        for decode in (SensorCodec().decode, SensorCodec(axes=6).decode, robot.decode, robot.decode_correction):
            refused_or_read(decode, bad)


@given(st.lists(st.binary(max_size=1100), max_size=5), st.integers(0, 50))
def test_session_answers_a_good_datagram_among_any_others(others: list[bytes], seqno: int) -> None:
    session: SensorSession[JointReport] = SensorSession(JointCodec())
    good = good_datagrams(seqno + 1)[seqno]
    report = session.accept([*others, good], 0.0)
    assert report is not None
    assert report.seqno == seqno


def refused_or_read(decode: Callable[[bytes], object], datagram: bytes) -> object:
    try:
        return decode(datagram)
    except ProtocolError:
        return None
