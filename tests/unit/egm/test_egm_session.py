from __future__ import annotations

from dataclasses import replace

import pytest

from yumi.egm.codec import RobotCodec, SensorCodec
from yumi.egm.messages import MciState, MotorState, RapidState, RobotMessage
from yumi.egm.session import REORDERED, SensorSession
from yumi.robot.joints import Joints

HOME: Joints = (0.0, -2.0, 1.0, 0.5, 0.0, 0.7, 0.0)
MESSAGE = RobotMessage(
    0, 0, HOME, HOME, None, None, 1.0, 1.0, MotorState.ON, MciState.RUNNING, RapidState.RUNNING, False
)


def datagram(seqno: int) -> bytes:
    return RobotCodec().encode(replace(MESSAGE, seqno=seqno))


@pytest.fixture
def session() -> SensorSession:
    return SensorSession(SensorCodec(), silence=0.05)


def reply_seqno(session: SensorSession) -> int | None:
    return RobotCodec().decode(session.reply(HOME, None)).seqno


def test_session_begins_with_its_first_datagram(session: SensorSession) -> None:
    received = session.accept([datagram(0)], 0.0)
    assert received is not None
    assert (received.session, received.is_first) == (1, True)


def test_session_begins_in_the_middle_when_we_come_late(session: SensorSession) -> None:
    received = session.accept([datagram(352216)], 0.0)
    assert received is not None
    assert received.is_first


def test_session_counts_its_replies_from_zero_in_every_session(session: SensorSession) -> None:
    session.accept([datagram(0)], 0.0)
    assert [reply_seqno(session), reply_seqno(session)] == [0, 1]
    session.accept([datagram(0)], 10.0)
    assert reply_seqno(session) == 0


def test_session_answers_the_newest_datagram_and_counts_those_it_skipped(session: SensorSession) -> None:
    session.accept([datagram(0)], 0.0)
    received = session.accept([datagram(1), datagram(2), datagram(3)], 0.012)
    assert received is not None
    assert (received.message.seqno, session.counters.missed) == (3, 2)


def test_session_answers_the_newest_good_datagram_when_the_newest_is_garbage(session: SensorSession) -> None:
    received = session.accept([datagram(0), b"\xff\xff"], 0.0)
    assert received is not None
    assert (received.message.seqno, session.counters.malformed) == (0, 1)
    assert "cannot be decoded" in session.last_error


@pytest.mark.parametrize("seqno", [100, 99, 100 - REORDERED])
def test_session_leaves_repeated_and_old_datagrams_aside(session: SensorSession, seqno: int) -> None:
    session.accept([datagram(100)], 0.0)
    assert session.accept([datagram(seqno)], 0.004) is None
    assert session.counters.stale == 1


@pytest.mark.parametrize("seqno", [0, 3])
def test_session_begins_anew_when_the_robot_counts_anew(session: SensorSession, seqno: int) -> None:
    session.accept([datagram(100)], 0.0)
    received = session.accept([datagram(seqno)], 0.004)
    assert received is not None
    assert (received.session, received.is_first) == (2, True)


def test_session_begins_anew_after_a_silence(session: SensorSession) -> None:
    session.accept([datagram(10)], 0.0)
    received = session.accept([datagram(30)], 0.08)
    assert received is not None
    assert (received.session, received.is_first, session.counters.missed) == (2, True, 0)


def test_session_is_closed_once_when_the_robot_is_silent(session: SensorSession) -> None:
    session.accept([datagram(0)], 0.0)
    assert not session.close_if_silent(0.05)
    assert session.close_if_silent(0.051)
    assert not session.close_if_silent(0.06)
    assert not session.is_open


def test_session_that_never_began_is_not_silent(session: SensorSession) -> None:
    assert not session.close_if_silent(100.0)
