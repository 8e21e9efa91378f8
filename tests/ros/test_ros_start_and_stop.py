"""EGM is started and stopped again and again: nothing of that stays."""

from __future__ import annotations

import pytest
from ros_bench import Client
from std_srvs.srv import Trigger

from process_sizes import PATIENCE, settled_sizes, sizes
from soak import CYCLES, long, short, tell
from yumi.clock import SystemClock
from yumi.links.command import Command

LEAST = 5
"""After so many starts everything that is made once is there."""

AT_ONCE = 8
"""Requests that a node of the driver serves at once, each on a thread that then stays."""

GROWTH_KB = 2048
EVERY = 10


def begin_all_threads(client: Client) -> None:
    """Have the robot manager wait for itself on all threads it may have; else one begins whenever two requests meet."""
    caller = client.node.create_client(Trigger, "yumi_robot_manager/start_egm")
    client.until(caller.service_is_ready)
    futures = [caller.call_async(Trigger.Request()) for _ in range(AT_ONCE)]
    client.until(lambda: all(future.done() for future in futures))
    client.node.destroy_client(caller)


@pytest.mark.parametrize("count", [short(2 * LEAST, pytest.mark.ros), long(CYCLES, 10.0 * CYCLES)])
def test_starting_and_stopping_egm_leaves_no_thread_descriptor_or_memory_behind(
    client: Client, driver: Command, count: int
) -> None:
    half = max(LEAST, count // 4)
    before = None
    begin_all_threads(client)
    for number in range(1, count + 1):
        for name in ("start_egm", "stop_egm"):
            answer = client.call(Trigger, f"yumi_robot_manager/{name}")
            assert answer.success, answer.message
        if number == half:
            before = settled_sizes(driver.pid)
        if number % EVERY == 0:
            tell(f"{number} of {count} starts and stops of EGM: {sizes(driver.pid)}")
    assert before is not None
    clock = SystemClock()
    end = clock.now() + PATIENCE
    while (after := settled_sizes(driver.pid)).counts != before.counts and clock.now() < end:
        continue
    assert after.counts == before.counts
    assert after.memory_kb - before.memory_kb <= GROWTH_KB
