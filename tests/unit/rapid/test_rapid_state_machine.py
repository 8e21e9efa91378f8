"""The pattern of ABB's state machine: a trap throws the loop out of whatever runs (reference/statemachine.md §1.4)."""

import pytest
from rapid_bench import Bench, started

from virtual_irc5.rapid import Call, InstructionSet, Wait

DECLARATIONS = """
CONST num STATE_IDLE := 0;
CONST num STATE_WORK := 2;
VAR num current_state := 1;
VAR num rounds := 0;
VAR errnum CHANGE_STATE := -1;
VAR intnum on_start;
VAR intnum on_halt;

TRAP handleStart
    IF current_state = STATE_IDLE THEN
        current_state := STATE_WORK;
        RAISE CHANGE_STATE;
    ENDIF
ERROR (CHANGE_STATE)
    RAISE CHANGE_STATE;
ENDTRAP

TRAP handleHalt
    IF current_state = STATE_WORK request STATE_IDLE;
ENDTRAP

LOCAL PROC request(num state)
    current_state := state;
    RAISE CHANGE_STATE;
ENDPROC

LOCAL PROC idle()
    Incr rounds;
ERROR
    RAISE;
ENDPROC

LOCAL PROC work()
    TPWrite "working";
    hold;
    TPWrite "done";
    current_state := STATE_IDLE;
ERROR
    TPWrite "never: a long jump passes by";
ENDPROC

LOCAL PROC hold()
    Grip;
ENDPROC
"""
MAIN = """
    IDisable;
    BookErrNo CHANGE_STATE;
    IDelete on_start;
    CONNECT on_start WITH handleStart;
    ISignalDI di1, HIGH, on_start;
    CONNECT on_halt WITH handleHalt;
    ISignalDI di2, HIGH, on_halt;
    current_state := STATE_IDLE;
    IEnable;
    WHILE TRUE DO
        TEST current_state
        CASE STATE_WORK:
            work;
        DEFAULT:
            idle;
        ENDTEST
        WaitTime 0.01;
    ENDWHILE
ERROR (CHANGE_STATE)
    rounds := 0;
    TRYNEXT;
"""


@pytest.fixture
def outcome() -> list[str]:
    """How each Grip instruction ended."""
    return []


@pytest.fixture
def bench(outcome: list[str]) -> Bench:
    library = InstructionSet()

    @library.instruction("Grip")
    def grip(call: Call) -> Wait:
        outcome.append("begun")
        try:
            while True:
                yield None
        finally:
            outcome.append("closed")

    return started(MAIN, DECLARATIONS, library)


def test_loop_idles_every_ten_milliseconds(bench: Bench) -> None:
    bench.run(1.0)
    assert 99 <= float(bench.read("rounds")) <= 101


def test_state_changes_in_the_trap_before_anything_else_happens(bench: Bench) -> None:
    bench.set("di1", 1)
    assert bench.read("current_state") == "2"


def test_long_jump_leads_to_the_new_state_and_its_handler(bench: Bench) -> None:
    bench.run(0.1)
    bench.set("di1", 1)
    bench.run(0.02)
    assert (bench.lines, bench.read("rounds")) == (["working"], "0")


def test_long_jump_abandons_the_running_routine_and_closes_its_instruction(bench: Bench, outcome: list[str]) -> None:
    bench.set("di1", 1)
    bench.run(0.1)
    assert outcome == ["begun"]
    bench.set("di2", 1)
    bench.run(0.1)
    assert outcome == ["begun", "closed"]
    assert (bench.lines, bench.read("current_state")) == (["working"], "0")


def test_machine_can_be_started_many_times(bench: Bench, outcome: list[str]) -> None:
    for _ in range(3):
        for signal, level in (("di1", 1), ("di1", 0), ("di2", 1), ("di2", 0)):
            bench.set(signal, level)
            bench.run(0.05)
    assert outcome == ["begun", "closed"] * 3
    assert bench.host.events == []


def test_two_edges_at_once_are_served_one_after_the_other(bench: Bench) -> None:
    bench.task.signal_changed("di1", 0, 1)
    bench.task.signal_changed("di2", 0, 1)
    bench.run(0.05)
    assert bench.read("current_state") == "0"
    assert bench.host.events == []


def test_edge_during_initialisation_waits_for_ienable() -> None:
    body = MAIN.replace("current_state := STATE_IDLE;", "WaitTime 0.05; current_state := STATE_IDLE;", 1)
    library = InstructionSet()
    library.instruction("Grip")(lambda call: None)
    bench = started(body, DECLARATIONS, library)
    bench.set("di1", 1)
    assert bench.read("current_state") == "1"
    bench.run(0.1)
    assert bench.lines == ["working", "done"]


def test_pp_to_main_starts_over_with_first_values(bench: Bench, outcome: list[str]) -> None:
    bench.set("di1", 1)
    bench.run(0.1)
    bench.task.stop()
    bench.task.move_pp_to_main()
    assert (bench.read("current_state"), outcome) == ("1", ["begun", "closed"])
    bench.task.start()
    bench.run(0.1)
    assert bench.read("current_state") == "0"
