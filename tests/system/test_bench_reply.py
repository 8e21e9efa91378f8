"""The benchmark's load generator against real servers: every reply is checked, none is missed; times are not judged."""

from __future__ import annotations

import sys

import pytest

from yumi.errors import RobotNotReady
from yumi_evaluation.bench.build import (
    ECHO,
    Case,
    Contender,
    Mode,
    Runtime,
    Workshop,
    compile_programs,
    fast_line,
    find_workshop,
)
from yumi_evaluation.bench.run import run_case

CYCLES = 200
pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the benchmark needs Linux"),
]


@pytest.fixture(scope="module")
def workshop() -> Workshop:
    workshop = find_workshop()
    compile_programs(workshop)
    return workshop


@pytest.mark.parametrize("contender", [ECHO, fast_line("blocking")], ids=lambda each: str(each.name))
@pytest.mark.parametrize("mode", Mode)
def test_every_reply_of_both_arms_is_right(workshop: Workshop, contender: Contender, mode: Mode) -> None:
    run, latencies = run_case(workshop, Case(contender, mode, 2), 1, CYCLES)
    assert run.count("unparsed") == 0
    assert [len(each) for each in latencies] == [CYCLES, CYCLES]
    # A machine under other load may let a few go; what a guard says while it catches up belongs to no certain cycle.
    assert run.count("bad") + run.count("duplicates") <= 0.05 * 2 * CYCLES
    answered = sum(value > 0 for each in latencies for value in each)
    assert answered >= 0.95 * 2 * CYCLES


def test_server_that_does_not_guide_is_noticed(workshop: Workshop) -> None:
    unguided = Contender("unguided", "an echo taken for a server", "echo.c", Runtime.COMPILED, gain=0.1)
    with pytest.raises(RobotNotReady, match="did not guide the robot as it should"):
        run_case(workshop, Case(unguided, Mode.PACED, 1, lead_in=1.0), 1, CYCLES)
