"""EGM is started and stopped again and again: nothing of that stays."""

from __future__ import annotations

import pytest
from process_sizes import PATIENCE, settled_sizes, sizes
from ros_bench import Client
from std_srvs.srv import Trigger

from abb_runtime.clock import SystemClock
from abb_runtime.process.command_process import CommandProcess
from soak import CYCLES, long, short, tell

LEAST = 5
"""After so many starts everything that is made once is there."""

WARM = 50
"""After so many starts no pool of memory grows any more."""

GROWTH_KB = 2048
"""Of all processes, in 150 starts."""

WARM_UP_KB = 2 * GROWTH_KB
"""What the first starts may still take beside: pools of small objects grow by a megabyte at a time."""

EVERY = 10


@pytest.mark.parametrize(
    "count", [short(2 * LEAST, pytest.mark.ros, pytest.mark.timeout(150)), long(CYCLES, 10.0 * CYCLES)]
)
def test_starting_and_stopping_egm_leaves_no_thread_descriptor_or_memory_behind(
    client: Client, driver: CommandProcess, count: int
) -> None:
    half = max(LEAST, count // 4)
    before = None
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
    assert after.memory_kb - before.memory_kb <= (GROWTH_KB if half >= WARM else WARM_UP_KB)
