from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from abb_protocols.egm.codec import MciState, MotorState, RapidState, RobotCodec, RobotMessage
from abb_protocols.errors import ProtocolError
from abb_protocols.robot.joints import Joints
from refusals import refused
from yumi.egm.egm_session import ROBOT_SILENCE, SensorSession, SessionCounters
from yumi.egm.joint_codec import JointCodec, JointReport

HOME: Joints = (0.0, -2.0, 1.0, 0.5, 0.0, 0.7, 0.0)
MESSAGE = RobotMessage(
    0, 0, HOME, HOME, None, None, 1.0, 1.0, MotorState.ON, MciState.RUNNING, RapidState.RUNNING, False
)
CYCLE = 0.004
REORDERED = 16  # of the newest numbers are remembered
LARGEST_GAP = 64  # a number higher by more is of another session
LONG_SILENCE = 1.0  # [s] after which a robot whose clock has gone back is believed


def datagram(seqno: int, time: float | None = None) -> bytes:
    """By default of a robot that began at 1000 s."""
    return RobotCodec().encode(
        replace(MESSAGE, seqno=seqno, measured_time=1000.0 + seqno * CYCLE if time is None else time)
    )


@pytest.fixture
def session() -> SensorSession[JointReport]:
    return SensorSession(JointCodec())


def accept(session: SensorSession[JointReport], *seqnos: int, now: float = 0.0) -> int | None:
    message = session.accept([datagram(seqno) for seqno in seqnos], now)
    return None if message is None else message.seqno


def test_session_begins_with_its_first_datagram(session: SensorSession[JointReport]) -> None:
    assert accept(session, 0) == 0
    assert (session.number, session.is_first, session.is_open) == (1, True, True)
    assert accept(session, 1) == 1
    assert (session.number, session.is_first) == (1, False)


def test_session_begins_in_the_middle_when_we_come_late(session: SensorSession[JointReport]) -> None:
    assert accept(session, 352216) == 352216
    assert session.is_first
    assert session.counters == SessionCounters(received=1)


def test_session_counts_its_replies_from_zero_in_every_session(session: SensorSession[JointReport]) -> None:
    accept(session, 0)
    assert [session.next_seqno(), session.next_seqno()] == [0, 1]
    session.accept([datagram(0, 1010.0)], 10.0)
    assert session.next_seqno() == 0


def test_session_answers_the_newest_datagram_and_counts_those_that_came_late(
    session: SensorSession[JointReport],
) -> None:
    accept(session, 0)
    assert accept(session, 1, 2, 3, now=0.012) == 3
    assert session.counters == SessionCounters(received=4, late=2)
    assert session.counters.missed == 2


def test_session_counts_the_gaps_in_the_sequence_as_lost(session: SensorSession[JointReport]) -> None:
    accept(session, 0)
    assert accept(session, 4, now=0.016) == 4
    assert session.counters == SessionCounters(received=2, lost=3)


def test_session_answers_the_newest_of_a_batch_that_was_reordered(session: SensorSession[JointReport]) -> None:
    accept(session, 0)
    assert accept(session, 1, 3, 2, now=0.012) == 3
    assert session.counters == SessionCounters(received=3, late=1, stale=1)


def test_session_answers_the_newest_good_datagram_when_the_newest_is_garbage(
    session: SensorSession[JointReport],
) -> None:
    garbage = b"\xff\xff"
    assert session.accept([datagram(0), garbage], 0.0) is not None
    assert session.counters.malformed == 1
    with refused(ProtocolError, "datagram_not_decoded", size=2) as refusal:
        JointCodec().decode(garbage)
    assert session.last_error == str(refusal.value)


def test_session_tells_what_was_lost_from_what_was_only_overtaken(session: SensorSession[JointReport]) -> None:
    accept(session, 0)
    accept(session, 3, now=3 * CYCLE)
    assert session.counters.lost == 2
    assert accept(session, 2, now=3 * CYCLE) is None
    assert (session.counters.lost, session.counters.stale, session.counters.missed) == (1, 1, 2)


def test_session_counts_a_repeated_datagram_once_it_came(session: SensorSession[JointReport]) -> None:
    accept(session, 0)
    accept(session, 2, now=2 * CYCLE)
    for seqno in (2, 0, 1, 1):
        assert accept(session, seqno, now=2 * CYCLE) is None
    assert session.counters == SessionCounters(received=2, stale=1, repeated=3)


@pytest.mark.parametrize("behind", [1, REORDERED])
def test_session_leaves_old_datagrams_from_before_its_beginning_aside(
    session: SensorSession[JointReport], behind: int
) -> None:
    accept(session, 100)
    assert accept(session, 100 - behind) is None
    assert session.counters == SessionCounters(received=1, stale=1)


@pytest.mark.parametrize("last", [1, 5, 16, 100, 5000])
@pytest.mark.parametrize("first", [0, 1])
def test_session_begins_anew_when_the_robot_counts_anew(
    session: SensorSession[JointReport], last: int, first: int
) -> None:
    accept(session, last)
    assert session.accept([datagram(first, 1000.0 + (last + 1) * CYCLE)], CYCLE) is not None
    assert (session.number, session.is_first) == (2, True)


def test_session_that_began_within_a_batch_is_first(session: SensorSession[JointReport]) -> None:
    later = [datagram(seqno, 1000.1 + seqno * CYCLE) for seqno in (0, 1)]
    message = session.accept([datagram(6), *later], 3 * CYCLE)
    assert message is not None
    assert (message.seqno, session.number, session.is_first) == (1, 2, True)


def test_session_leaves_stragglers_of_the_session_before_aside(session: SensorSession[JointReport]) -> None:
    accept(session, 100)
    session.accept([datagram(0, 1000.5)], CYCLE)
    assert accept(session, 101, now=2 * CYCLE) is None
    assert session.number == 2


def test_session_begins_anew_after_a_leap_no_loss_explains(session: SensorSession[JointReport]) -> None:
    session = SensorSession(JointCodec(), silence=1.0)
    accept(session, 0)
    accept(session, LARGEST_GAP, now=LARGEST_GAP * CYCLE)
    assert (session.number, session.counters.lost) == (1, LARGEST_GAP - 1)
    assert accept(session, 2 * LARGEST_GAP + 1, now=(LARGEST_GAP + 1) * CYCLE) == 2 * LARGEST_GAP + 1
    assert (session.number, session.counters.lost) == (2, LARGEST_GAP - 1)


@pytest.mark.parametrize("leap", [0.0, 0.5, 1e6])
def test_session_goes_on_when_the_robots_clock_is_set_forward_or_stands(
    session: SensorSession[JointReport], leap: float
) -> None:
    accept(session, 0)
    assert session.accept([datagram(1, 1000.0 + leap)], CYCLE) is not None
    assert session.number == 1


@pytest.mark.parametrize("lost", [0, 1, 5, LARGEST_GAP - 2])
def test_session_goes_on_when_a_datagram_is_lost_of_a_robot_whose_clock_stands(
    session: SensorSession[JointReport], lost: int
) -> None:
    assert session.accept([datagram(0, 1000.0)], 0.0) is not None
    assert session.accept([datagram(1, 1000.0)], CYCLE) is not None
    assert session.accept([datagram(2 + lost, 1000.0)], 2 * CYCLE) is not None
    assert (session.number, session.counters.lost) == (1, lost)


def as_sent(count: int) -> list[tuple[float, int]]:
    """Each number of a robot, and when it arrives [cycles]."""
    return [(number, number) for number in range(count)]


def in_pairs_swapped(count: int) -> list[tuple[float, int]]:
    return [(number, number ^ 1) for number in range(count)]


def every_second(count: int) -> list[tuple[float, int]]:
    return [(number, number) for number in range(0, count, 2)]


def doubled(later: float) -> Callable[[int], list[tuple[float, int]]]:
    return lambda count: sorted([*as_sent(count), *((number + later, number) for number in range(count))])


@pytest.mark.parametrize("is_noticed", [False, True])
@pytest.mark.parametrize("clock", [0.0, 1.0, 12.0])  # it stands, goes as a robot's, and as one of another sample rate
@pytest.mark.parametrize("pace", [0.5, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("arriving", [as_sent, in_pairs_swapped, every_second, *map(doubled, (0.1, 0.3, 0.6, 0.9))])
def test_robot_whose_clock_went_back_is_heard_after_a_second_whatever_its_pace(
    session: SensorSession[JointReport],
    arriving: Callable[[int], list[tuple[float, int]]],
    pace: float,
    clock: float,
    *,
    is_noticed: bool,
) -> None:
    """It was restarted, a virtual one as fast as its machine allows."""
    begin, cycle, accepted = live(session, 300) + CYCLE, CYCLE / pace, []
    for at, number in arriving(round(1.2 * LONG_SILENCE / cycle)):
        now = begin + at * cycle
        if is_noticed:
            session.close_if_silent(now)
        if session.accept([datagram(number, 5.0 + number * CYCLE * clock)], now) is not None:
            accepted.append(now)
    assert session.number == 2
    assert accepted[0] <= begin + LONG_SILENCE + 4 * max(cycle, CYCLE)
    assert len(accepted) > 0.3 * (begin + 1.2 * LONG_SILENCE - accepted[0]) / cycle


@pytest.mark.parametrize("leap", [-500.0, -2.0])
def test_robot_whose_clock_goes_back_in_a_session_begins_another_after_a_second(
    session: SensorSession[JointReport], leap: float
) -> None:
    now, in_vain = live(session, 300), round(LONG_SILENCE / CYCLE)
    for count in range(1, in_vain + 4):
        later = count * CYCLE
        answered = session.accept([datagram(299 + count, 1001.196 + leap + later)], now + later) is not None
        assert answered == (count > in_vain)
    assert (session.number, session.counters.missed) == (2, in_vain)


def test_session_goes_on_when_the_clock_has_caught_up_with_what_it_was_set_back(
    session: SensorSession[JointReport],
) -> None:
    now = live(session, 300)
    accepted = []
    for count in range(1, 6):
        later = count * CYCLE
        if session.accept([datagram(299 + count, 1001.196 - 0.010 + later)], now + later) is not None:
            accepted.append(count)
    assert (accepted, session.number) == ([3, 4, 5], 1)


def test_late_datagrams_of_a_session_before_count_beside_what_was_lost(session: SensorSession[JointReport]) -> None:
    begin = live(session, 300) + 0.3
    assert session.accept([datagram(0, 1001.5)], begin) is not None
    assert accept(session, 1, 2, now=begin + CYCLE) is None
    assert session.accept([datagram(3, 1001.512)], begin + 3 * CYCLE) is not None
    assert session.counters == SessionCounters(received=302, lost=2, stale=2)


@pytest.mark.parametrize("count", [1, 2, 100])
def test_late_datagrams_that_arrive_at_once_begin_no_session_however_long_none_was_accepted(
    session: SensorSession[JointReport], count: int
) -> None:
    """Of a robot whose clock went back; one alone does not, and many waited together."""
    now = live(session, 300) + 10.0 * LONG_SILENCE
    late = [datagram(number, 900.0 + number * CYCLE) for number in range(count)]
    assert session.accept(late, now) is None
    assert session.accept([datagram(500, 5.0)], now + 0.5 * CYCLE) is None
    assert session.accept(late, now + CYCLE) is None
    assert session.accept([datagram(501, 5.0 + CYCLE)], now + 1.5 * CYCLE) is not None
    assert session.number == 2


@pytest.mark.parametrize("apart", [0.0, 0.2 * CYCLE])
@pytest.mark.parametrize("count", [1, 2, 20])
@pytest.mark.parametrize("is_begun", [False, True])
def test_session_does_not_take_late_datagrams_of_a_session_before_that_have_the_numbers_due_next(
    session: SensorSession[JointReport], is_begun: bool, count: int, apart: float
) -> None:
    begin = live(session, 300) + 0.3
    for seqno in range(9 * is_begun + 1):
        assert session.accept([datagram(seqno, 1001.5 + seqno * CYCLE)], begin + seqno * CYCLE) is not None
    for late in range(count):
        assert accept(session, seqno + 1 + late, now=begin + (seqno + 0.1) * CYCLE + late * apart) is None
    assert session.accept([datagram(seqno + 1, 1001.5 + (seqno + 1) * CYCLE)], begin + (seqno + 5) * CYCLE) is not None
    assert (session.number, session.counters.missed) == (2, count)


@pytest.mark.parametrize("seqno", [0, 100, 290])
def test_late_datagram_of_a_session_before_begins_none_after_a_silence_however_long(
    session: SensorSession[JointReport], seqno: int
) -> None:
    begin = live(session, 300) + 0.3
    assert session.accept([datagram(0, 1001.5)], begin) is not None
    assert session.close_if_silent(begin + 10.0 * LONG_SILENCE)
    assert accept(session, seqno, now=begin + 10.0 * LONG_SILENCE) is None
    now = begin + 10.0 * LONG_SILENCE + CYCLE
    assert session.accept([datagram(0, 1001.5 + 10.0 * LONG_SILENCE)], now) is not None
    assert (session.number, session.is_first) == (3, True)


@pytest.mark.parametrize("is_noticed", [False, True])
def test_session_goes_on_after_a_silence_when_the_robot_has_counted_on(
    session: SensorSession[JointReport], is_noticed: bool
) -> None:
    accept(session, 10)
    session.next_seqno()
    assert session.close_if_silent(4.0) if is_noticed else session.is_open
    assert accept(session, 1010, now=4.0) == 1010
    assert (session.number, session.is_first, session.is_resumed, session.is_open) == (1, False, is_noticed, True)
    assert (session.counters.lost, session.next_seqno()) == (999, 1)


def test_session_goes_on_with_the_very_next_datagram_of_a_robot_that_stood_still_with_us(
    session: SensorSession[JointReport],
) -> None:
    accept(session, 10)
    assert session.close_if_silent(2.0)
    assert accept(session, 11, now=2.0) == 11
    assert (session.number, session.is_resumed) == (1, True)


def test_copy_of_the_last_datagram_does_not_end_the_session_of_a_robot_that_stood_still_with_us(
    session: SensorSession[JointReport],
) -> None:
    accept(session, 10)
    assert accept(session, 10, now=0.001) is None
    assert session.close_if_silent(2.0)
    assert accept(session, 11, now=2.0) == 11
    assert (session.number, session.is_resumed) == (1, True)


def test_very_next_datagram_is_late_when_one_of_another_session_has_come(
    session: SensorSession[JointReport],
) -> None:
    accept(session, 10)
    assert session.close_if_silent(0.3)
    assert session.accept([datagram(0, 1000.35)], 0.3) is not None
    assert accept(session, 11, now=0.301) is None
    assert (session.number, session.is_open) == (2, True)


def test_session_goes_on_after_a_silence_when_the_robot_had_stopped_its_clock_with_its_count(
    session: SensorSession[JointReport],
) -> None:
    accept(session, 10)
    assert session.close_if_silent(2.0)
    assert accept(session, 12, now=2.0) == 12
    assert (session.number, session.is_resumed, session.counters.lost) == (1, True, 1)


@pytest.mark.parametrize("heard", [5.0, 20.0, 60.0])
def test_session_begins_anew_when_egm_was_stopped_and_started_during_a_silence(
    session: SensorSession[JointReport], heard: float
) -> None:
    """However long the other session runs before the first datagram of it arrives: the arm may have moved between."""
    accept(session, *range(50))
    assert session.close_if_silent(heard)
    count = round((heard - 0.5) / CYCLE)  # EGM did not run for 0.5 s, then counted anew
    assert session.accept([datagram(count, 1000.0 + 49 * CYCLE + heard)], heard) is not None
    assert (session.number, session.is_first) == (2, True)


def test_session_begins_anew_when_a_clock_that_went_back_fits_the_count_after_a_silence(
    session: SensorSession[JointReport],
) -> None:
    accept(session, 10)
    assert session.accept([datagram(80, 999.0)], 0.1) is None
    assert session.close_if_silent(0.5)
    assert accept(session, 110, now=0.5) == 110
    assert (session.number, session.is_first) == (2, True)


@pytest.mark.parametrize("behind", [0, 1, 10])
@pytest.mark.parametrize("silence", [0.1, 10.0 * LONG_SILENCE])
def test_session_does_not_begin_with_its_own_datagrams_after_a_silence_however_long(
    session: SensorSession[JointReport], silence: float, behind: int
) -> None:
    accept(session, 20)
    assert session.close_if_silent(silence)
    assert accept(session, 20 - behind, now=silence) is None
    assert accept(session, 21, now=silence) == 21
    assert session.number == 1


def test_session_begins_anew_when_the_controller_was_restarted_and_its_clock_with_it(
    session: SensorSession[JointReport],
) -> None:
    accept(session, 300)
    assert session.close_if_silent(0.5)
    assert session.accept([datagram(0, 5.0)], 0.5) is None
    assert session.accept([datagram(1, 5.0 + CYCLE)], 0.5 + CYCLE) is None  # so soon both may be late
    assert session.accept([datagram(2, 5.0 + 2 * CYCLE)], 0.1 + LONG_SILENCE) is not None
    assert (session.number, session.is_first) == (2, True)


@pytest.mark.parametrize("began_later", [0.0, 2.0])
def test_session_begins_anew_when_a_simulated_robot_was_restarted_and_counts_and_keeps_time_as_the_first_time(
    session: SensorSession[JointReport], began_later: float
) -> None:
    accept(session, 0)
    for seqno in range(1, 15001):
        accept(session, seqno, now=seqno * CYCLE)
    end = 15000 * CYCLE
    assert session.close_if_silent(end + 0.5)
    assert session.accept([datagram(0, 1000.0 + began_later)], end + 0.5) is None  # it may be a late datagram
    assert session.accept([datagram(1, 1000.0 + began_later + CYCLE)], end + 0.1 + LONG_SILENCE) is not None
    assert (session.number, session.is_first) == (2, True)


@pytest.mark.parametrize("seqno", [0, 10, 29, 300])
def test_session_begins_anew_after_a_long_silence_when_the_robot_has_not(
    session: SensorSession[JointReport], seqno: int
) -> None:
    accept(session, 10)
    accept(session, 20, now=0.04)
    assert session.accept([datagram(seqno, 1002.0)], 0.041 + LONG_SILENCE) is not None
    assert (session.number, session.is_first, session.is_resumed, session.counters.missed) == (2, True, False, 9)


@pytest.mark.parametrize("seqno", [0, 10, 29, 300])
def test_session_begins_anew_after_a_short_silence_when_the_number_does_not_fit_the_clock(
    session: SensorSession[JointReport], seqno: int
) -> None:
    accept(session, 10)
    accept(session, 20, now=0.04)
    for count in range(4):
        assert session.accept([datagram(seqno + count, 1000.4 + count * CYCLE)], 0.4 + count * CYCLE) is not None
        assert session.number == 2


def test_session_is_closed_once_when_the_robot_is_silent(session: SensorSession[JointReport]) -> None:
    accept(session, 0)
    assert not session.close_if_silent(ROBOT_SILENCE)
    assert session.close_if_silent(ROBOT_SILENCE + 0.001)
    assert not session.close_if_silent(ROBOT_SILENCE + 0.002)
    assert not session.is_open


def test_session_that_never_began_is_not_silent(session: SensorSession[JointReport]) -> None:
    assert not session.close_if_silent(100.0)


def test_session_takes_a_message_into_the_statistics_once(session: SensorSession[JointReport]) -> None:
    accept(session, 0, now=0.0)
    session.settle()
    accept(session, 1, now=0.004)
    accept(session, 3, now=0.012)
    session.settle()
    session.settle()
    assert session.arrivals.cycle_time == pytest.approx(0.004)


def live(session: SensorSession[JointReport], count: int) -> float:
    """A session of ``count`` datagrams in time; when the last one arrived [s]."""
    for seqno in range(count):
        assert accept(session, seqno, now=seqno * CYCLE) == seqno
    return (count - 1) * CYCLE


@pytest.mark.parametrize("behind", [1, 16, 17, 20, 30, 60, 100, 200, 250])
def test_session_never_begins_with_a_datagram_that_is_old(session: SensorSession[JointReport], behind: int) -> None:
    now = live(session, 300)
    assert accept(session, 299 - behind, now=now + 0.002) is None
    assert accept(session, 300, now=now + CYCLE) == 300
    assert (session.number, session.counters.stale + session.counters.repeated) == (1, 1)


def test_session_does_not_begin_with_many_old_datagrams_at_once(session: SensorSession[JointReport]) -> None:
    now = live(session, 300)
    assert accept(session, *range(150, 250), now=now + 0.002) is None
    assert accept(session, 300, now=now + CYCLE) == 300
    assert session.number == 1


def test_session_does_not_begin_with_its_own_datagrams_that_one_has_overtaken(
    session: SensorSession[JointReport],
) -> None:
    now = live(session, 300)
    assert accept(session, 303, now=now + 4 * CYCLE) == 303
    late = [accept(session, seqno, now=now + (seqno - 295) * CYCLE) for seqno in (300, 301, 302)]
    assert late == [None, None, None]
    assert accept(session, 307, now=now + 8 * CYCLE) == 307
    assert (session.number, session.counters.lost, session.counters.stale) == (1, 3, 3)


def test_session_takes_up_a_robot_that_begins_anew_at_once(session: SensorSession[JointReport]) -> None:
    now = live(session, 300)
    for seqno in range(5):
        time = 1000.0 + (300 + seqno) * CYCLE
        assert session.accept([datagram(seqno, time)], now + (seqno + 1) * CYCLE) is not None
        assert (session.number, session.is_first) == (2, seqno == 0)


def test_session_goes_on_when_the_robots_count_wraps(session: SensorSession[JointReport]) -> None:
    for count in range(6):
        time = 1000.0 + count * CYCLE
        assert session.accept([datagram((2**32 - 3 + count) % 2**32, time)], count * CYCLE) is not None
    assert (session.number, session.counters) == (1, SessionCounters(received=6))


@pytest.mark.parametrize("cycle", [0.004032, 0.008, 0.048])
def test_session_learns_the_period_of_the_robot(cycle: float) -> None:
    session: SensorSession[JointReport] = SensorSession(JointCodec(), silence=1.0)
    for seqno in range(20):
        assert session.accept([datagram(seqno, 1000.0 + seqno * cycle)], seqno * cycle) is not None
    assert session.accept([datagram(24, 1000.0 + 24 * cycle)], 24 * cycle) is not None
    assert (session.number, session.counters.lost) == (1, 4)


@pytest.mark.parametrize(("before", "after"), [(0.004, 0.016), (0.004, 0.048), (0.016, 0.004)])
def test_session_takes_up_a_robot_that_was_restarted_with_another_sample_rate(before: float, after: float) -> None:
    session = SensorSession(JointCodec(), silence=0.2)
    for seqno in range(500):
        session.accept([datagram(seqno, 1000.0 + seqno * before)], seqno * before)
    begin = 500 * before + 5.0
    session.close_if_silent(begin)
    accepted = [
        session.accept([datagram(seqno, 1.0 + seqno * after)], begin + seqno * after) is not None for seqno in range(50)
    ]
    assert accepted == [False] + 49 * [True]  # the first may be a late datagram
    assert session.number == 2


@pytest.mark.parametrize("period", [0.0, 0.016, 0.05])
def test_session_does_not_begin_with_datagrams_of_another_period_that_come_at_once(
    session: SensorSession[JointReport], period: float
) -> None:
    now = live(session, 300)
    assert session.accept([datagram(seqno, 1.0 + seqno * period) for seqno in range(20)], now + 0.001) is None
    assert session.number == 1
