from __future__ import annotations

from threading import Thread

import pytest

from abb_runtime.clock import ManualClock
from abb_runtime.rws.session import REQUEST_BURST, RateLimit
from abb_runtime.rws.transport import EXCHANGE_INTERVAL


@pytest.fixture
def limit(clock: ManualClock) -> RateLimit:
    return RateLimit(clock)


def turns(limit: RateLimit, clock: ManualClock, count: int) -> list[float]:
    """When each of ``count`` requests has its turn [s]."""
    times = []
    for _ in range(count):
        limit.wait()
        times.append(clock.now())
    return times


def test_burst_need_not_wait(limit: RateLimit, clock: ManualClock) -> None:
    assert turns(limit, clock, REQUEST_BURST) == pytest.approx([0.0] * REQUEST_BURST)


def test_long_run_stays_below_twenty_a_second(limit: RateLimit, clock: ManualClock) -> None:
    later = turns(limit, clock, 400)[REQUEST_BURST:]
    assert (len(later) - 1) / (later[-1] - later[0]) < 20.0


def test_rest_gives_the_burst_back_and_no_more(limit: RateLimit, clock: ManualClock) -> None:
    turns(limit, clock, 50)
    clock.advance(60.0)
    begin = clock.now()
    *burst, after = turns(limit, clock, REQUEST_BURST + 1)
    assert burst == pytest.approx([begin] * REQUEST_BURST)
    assert after == pytest.approx(begin + EXCHANGE_INTERVAL)


def test_counted_request_makes_the_next_one_wait(limit: RateLimit, clock: ManualClock) -> None:
    turns(limit, clock, REQUEST_BURST)
    limit.count()
    assert turns(limit, clock, 1) == [pytest.approx(2 * EXCHANGE_INTERVAL)]


def test_threads_share_one_rate_limit(clock: ManualClock) -> None:
    delays: list[float] = []
    clock.wait = delays.append  # type: ignore[method-assign] # time stands still for all of them
    limit = RateLimit(clock)
    threads = [Thread(target=turns, args=(limit, clock, 5)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(delays)[REQUEST_BURST - 20 :] == pytest.approx(
        [EXCHANGE_INTERVAL * (turn + 1) for turn in range(20 - REQUEST_BURST)]
    )


def test_what_needs_no_pause_between_requests_is_asked_at_once(clock: ManualClock) -> None:
    assert turns(RateLimit(clock, 0.0), clock, 100) == [0.0] * 100
