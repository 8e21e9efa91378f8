"""What a program may cost: time, memory and depth have limits, and nothing it does ends the controller."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import suppress
from typing import Any

import pytest
from rapid_bench import Bench, error_of, evaluated, started

from abb_protocols.errors import RapidError
from virtual_irc5.rapid import InstructionSet, compiler, loading, parser
from virtual_irc5.rapid.ast import Expression
from virtual_irc5.rapid.call import Call
from virtual_irc5.rapid.expressions import CompiledExpression, Expressions
from virtual_irc5.rapid.parser import LONGEST_MODULE, parse_module
from virtual_irc5.rapid.states import EventKind
from virtual_irc5.rapid.task import STEPS_PER_ADVANCE, TIME_PER_ADVANCE
from virtual_irc5.rapid.types import (
    ModuleNameTaken,
    ProgramTooLarge,
    RapidReferenceError,
    RapidSyntaxError,
    RapidValueError,
    Type,
    UnknownSymbol,
)

LOOP = "WHILE TRUE DO n := n + 1; ENDWHILE"


class StepClock:
    """A clock that goes on by ``tick`` [s] whenever it is read."""

    def __init__(self, tick: float) -> None:
        self.now, self._tick = 0.0, tick

    def __call__(self) -> float:
        self.now += self._tick
        return self.now


# Arguments that would cost seconds or gigabytes


@pytest.mark.parametrize("decimals", ["3E9", "3E8", "-1", "0.5", "81"])
@pytest.mark.parametrize("function", ["NumToStr", "DnumToStr"])
def test_decimals_that_no_string_can_hold_are_an_error(function: str, decimals: str) -> None:
    assert error_of(f"s := {function}(1,{decimals});", "VAR string s;") == "ERR_ARGVALERR"


def test_text_of_a_number_that_is_too_long_is_an_error() -> None:
    assert error_of("s := NumToStr(1,79);", "VAR string s;") == "ERR_STRTOOLNG"


@pytest.mark.parametrize("function", ["Round", "Trunc"])
@pytest.mark.parametrize("decimals", ["400", "-400", "1.5"])
def test_rounding_to_decimals_a_number_does_not_have_is_an_error(function: str, decimals: str) -> None:
    assert error_of(f"x := {function}(1.5\\Dec:={decimals});", "VAR num x;") == "ERR_ARGVALERR"


@pytest.mark.parametrize("use", ["a{huge}", "huge DIV 2", "huge"])
def test_number_that_grows_beyond_all_bounds_is_an_error(use: str) -> None:
    huge = "*".join(["1E30"] * 12)
    assert error_of(f"x := {use.replace('huge', huge)};", "VAR num x; VAR num a{3};") == "ERR_NUM_LIMIT"


def test_text_of_an_array_no_string_can_hold_is_an_error() -> None:
    assert error_of("s := ValToStr(a);", "VAR string s; VAR num a{50000};") == "ERR_STRTOOLNG"


# Arrays and other data


@pytest.mark.parametrize("sizes", ["30000,30000", "50001", "1,1E38,1", "1E30"])
def test_array_there_is_no_memory_for_is_refused_with_a_sentence(sizes: str) -> None:
    bench = Bench("", f"VAR num a{{{sizes}}};")
    with pytest.raises(RapidReferenceError, match=r"the array 'a' would have .* elements, there is memory for 50000"):
        bench.task.move_pp_to_main()


@pytest.mark.parametrize("size", ["1/0", "1.5", "0", "1E400"])
def test_array_of_no_size_is_refused(size: str) -> None:
    with pytest.raises(RapidReferenceError, match=r"size"):
        Bench("", f"VAR num a{{{size}}};").task.move_pp_to_main()


def test_local_array_there_is_no_memory_for_is_refused() -> None:
    with pytest.raises(RapidReferenceError, match="the array 'a' would have 900000000 elements"):
        Bench("VAR num a{30000,30000};").task.move_pp_to_main()


def test_data_of_a_task_have_a_limit_together() -> None:
    bench = Bench("", "".join(f"VAR num a{n}{{50000}};" for n in range(11)))
    with pytest.raises(ProgramTooLarge, match="with 'a10' the data of the task would hold 550000 values"):
        bench.task.move_pp_to_main()


@pytest.mark.parametrize("declared", ["clock a{1001}", "clock a{11,91}", "Pair a{501}"])
def test_array_of_objects_there_is_no_memory_for_is_refused(declared: str) -> None:
    pair = "RECORD Pair clock first; clock second; ENDRECORD"
    for bench in (Bench("", f"{pair} VAR {declared};"), Bench(f"VAR {declared};", pair)):
        with pytest.raises(RapidReferenceError, match=r"the array 'a' of \w+ would hold 100[12] values"):
            bench.task.move_pp_to_main()


def test_data_of_routines_that_call_each_other_have_a_limit_together() -> None:
    bench = started("q;", "VAR num depth; PROC q() VAR num a{50000}; depth := depth + 1; q; ENDPROC")
    assert (bench.stop.error, bench.read("depth")) == ("ERR_PRGMEMFULL", "9")  # depth is a value, too


def test_memory_of_a_routine_is_free_again_when_it_has_ended() -> None:
    bench = started(
        'FOR i FROM 1 TO 30 DO q; ENDFOR TPWrite "done"; WaitTime 10;', "PROC q() VAR num a{50000}; ENDPROC"
    )
    bench.run(0.1)
    assert bench.lines == ["done"]


def test_error_of_full_memory_can_be_handled() -> None:
    bench = started('q; ERROR TPWrite "full"; TRYNEXT;', "PROC q() VAR num a{50000}; q; ENDPROC")
    assert bench.lines == ["full"]


def test_elements_of_an_array_are_independent_of_each_other() -> None:
    bench = started("a{2,3} := 7; b := a; b{1,1} := 5;", "VAR num a{2,3}; VAR num b{2,3};")
    assert (bench.read("a"), bench.read("b")) == ("[[0,0,0],[0,0,7]]", "[[5,0,0],[0,0,7]]")


def test_clocks_of_an_array_are_independent_of_each_other() -> None:
    bench = started("ClkStart c{1}; WaitTime 0.1; x := ClkRead(c{1}); y := ClkRead(c{2});", CLOCKS)
    bench.run(0.2)
    assert (float(bench.read("x")) > 0.05, bench.read("y")) == (True, "0")


CLOCKS = "VAR clock c{2}; VAR num x; VAR num y;"


def test_datum_with_many_values_is_read_by_its_elements() -> None:
    bench = started("", "VAR num a{5001};")
    with pytest.raises(RapidValueError, match="'a' holds 5001 values, at most 5000 are read at a time"):
        bench.read("a")
    assert bench.read("a{5001}") == "0"


def test_value_that_is_very_long_is_refused() -> None:
    bench = started("", "VAR num x;")
    with pytest.raises(RapidValueError, match="a value has up to 16000 characters"):
        bench.task.write("M", "x", "1+" * 20_000 + "1")


def test_reference_that_is_very_long_is_unknown() -> None:
    bench = started("", "VAR num a{3};")
    with pytest.raises(UnknownSymbol, match="up to 100 characters"):
        bench.read(f"a{{1{'+0' * 50}}}")


# Modules


def test_module_that_is_too_long_is_refused() -> None:
    text = "MODULE big " + "! \n" * (LONGEST_MODULE // 3) + "ENDMODULE"
    with pytest.raises(RapidSyntaxError, match="a module has up to 2000000 characters"):
        parse_module(text, "big.mod")


def test_task_has_room_for_some_modules_only() -> None:
    bench, filler = Bench(), f"!{' ' * 1_980_000}\n"
    for n in range(2):
        bench.task.load(f"MODULE big{n}\n{filler}ENDMODULE", f"big{n}.mod")
    with pytest.raises(ProgramTooLarge, match="there is memory for 4000000 and 20000"):
        bench.task.load(f"MODULE big2\n{filler}ENDMODULE", "big2.mod")


def test_task_has_room_for_some_data_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loading, "MOST_DATA", 5000)
    data = "".join(f"VAR bool b{n};" for n in range(5001))
    with pytest.raises(ProgramTooLarge, match="5001 data"):
        Bench().task.load(f"MODULE many {data} ENDMODULE", "many.mod")


DEEP = {
    "statements": "IF TRUE THEN " * 2000 + "ENDIF " * 2000,
    "sum": "x := " + "1+" * 5000 + "1;",
    "signs": "x := " + "-" * 5000 + "1;",
}


@pytest.mark.parametrize("body", DEEP.values(), ids=DEEP)
def test_text_that_is_nested_too_deeply_is_a_syntax_error(body: str) -> None:
    with pytest.raises(RapidSyntaxError, match="nested too deeply: divide"):
        Bench(body, "VAR num x;")


@pytest.mark.parametrize("depth", range(60, 330, 30))
def test_depth_the_parser_bears_is_borne_by_all_that_follows(depth: int) -> None:
    """Whatever is refused is refused with a sentence, and what is not runs."""
    with suppress(RapidSyntaxError, RapidReferenceError):
        bench = Bench("IF TRUE THEN " * depth + f"x := {'-' * depth}1;" + "ENDIF " * depth, "VAR num x;")
        bench.start()
        assert bench.read("x") == "1"


def test_value_of_many_signs_is_no_value() -> None:
    bench = started("", "VAR num x;")
    with pytest.raises(RapidValueError, match="nested too deeply"):
        bench.task.write("M", "x", "-" * 5000 + "1")


@pytest.mark.parametrize("text", ["MODULE once ENDMODULE", "MODULE once PROC ENDMODULE"])
def test_text_is_parsed_once_whether_it_is_a_module_or_not(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with suppress(RapidSyntaxError):
        parse_module(text, "once.mod")
    parsed: list[object] = []
    monkeypatch.setattr(parser, "_parse", lambda *arguments: parsed.append(arguments))
    with suppress(RapidSyntaxError):
        parse_module(text, "once.mod")
    assert parsed == []


# Time


def test_endless_loop_takes_its_share_of_steps_only() -> None:
    bench = started(LOOP, "VAR num n;")
    before = float(bench.read("n"))
    bench.task.advance(0.004)
    assert 0 < float(bench.read("n")) - before <= STEPS_PER_ADVANCE


def test_endless_loop_takes_its_share_of_time_only() -> None:
    bench = started(LOOP, "VAR num n;")
    bench.task.clock = StepClock(TIME_PER_ADVANCE / 10.0)
    before = float(bench.read("n"))
    bench.task.advance(0.004)
    assert 0 < float(bench.read("n")) - before < STEPS_PER_ADVANCE / 20


def test_clock_is_read_after_each_instruction() -> None:
    """One that takes as long as its share allows is the only one in a cycle."""
    library, clock = InstructionSet(), StepClock(0.0)

    @library.function("Slow", "", "num")
    def slow(call: Call) -> float:
        clock.now += 2.0 * TIME_PER_ADVANCE
        return 1.0

    bench = Bench("WHILE TRUE DO n := n + Slow(); ENDWHILE", "VAR num n;", library)
    bench.task.clock = clock
    bench.start()
    bench.run(0.04)
    assert float(bench.read("n")) <= 11


def test_program_that_is_out_of_time_goes_on_in_the_next_cycle() -> None:
    bench = Bench("FOR i FROM 1 TO 1000 DO n := n + 1; ENDFOR", "VAR num n;")
    bench.task.clock = StepClock(TIME_PER_ADVANCE / 10.0)
    bench.start()
    assert 0 < float(bench.read("n")) < 1000
    bench.run(1.0)
    assert (bench.read("n"), bench.stop.kind) == ("1000", EventKind.FINISHED)


def test_interrupts_of_a_program_that_is_out_of_time_come_all_the_same() -> None:
    bench = started(f"CONNECT i WITH trapped; ISignalDI di1,HIGH,i; {LOOP}", f"{TRAPPED} VAR num n; VAR intnum i;")
    bench.task.clock = StepClock(TIME_PER_ADVANCE / 10.0)
    bench.set("di1", 1.0)
    bench.task.advance(0.004)
    assert bench.lines == ["trapped"]


TRAPPED = 'TRAP trapped TPWrite "trapped"; ENDTRAP'


def test_queue_of_interrupts_has_an_end() -> None:
    bench = started(f"CONNECT i WITH trapped; ISignalDI di1,EDGE,i; IDisable; {LOOP}", f"{TRAPPED} {NUMBERS}")
    for n in range(3000):
        bench.task.signal_changed("di1", n % 2, 1 - n % 2)
    assert len(bench.task.interrupts.queue) == 1000


NUMBERS = "VAR num n; VAR intnum i;"


def test_pulses_that_wait_for_their_end_have_a_limit() -> None:
    bench = started("WHILE TRUE DO PulseDO\\PLength:=2000,do1; ENDWHILE")
    bench.run(0.1)
    assert bench.stop.error == "ERR_EXECPHR"


def test_error_numbers_are_not_booked_without_end() -> None:
    assert error_of("WHILE TRUE DO BookErrNo e; ENDWHILE", "VAR errnum e;") == "ERR_EXECPHR"


# Long routines and modules: parsed, linked and compiled in the background

LONG = "MODULE long\nVAR num x;\nPROC long()\n" + "x := x + 1;\n" * 1000 + "ENDPROC\nENDMODULE"


def test_module_that_is_unloaded_leaves_nothing_in_circles_for_the_collector() -> None:
    bench = Bench("WaitTime 10;")
    bench.task.load("MODULE other VAR num x; PROC p() p; ENDPROC ENDMODULE", "other.mod")
    bench.start()
    module = bench.task.program.modules["other"]
    bench.task.unload("other")
    assert (module.symbols, module.data) == ({}, {})


def test_fault_in_a_long_routine_is_an_error_of_its_call() -> None:
    bench = Bench('Load "long.mod"; %"long"%; ERROR TPWrite "caught"; TRYNEXT;')
    bench.host.files["long.mod"] = LONG.replace("ENDPROC", "y := 1;\nENDPROC")
    bench.start()
    bench.run(0.2)
    assert bench.lines == ["caught"]


def test_module_there_is_no_memory_for_is_an_error_of_load(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loading, "MOST_DATA", 5000)
    bench = Bench('Load "many.mod"; ERROR IF ERRNO=ERR_PRGMEMFULL TPWrite "full"; TRYNEXT;')
    bench.host.files["many.mod"] = f"MODULE many {''.join(f'VAR bool b{n};' for n in range(5001))} ENDMODULE"
    bench.start()
    assert bench.lines == ["full"]


TARGET = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
TARGETS = {
    "array": f"CONST robtarget p{{200}} := [{','.join([TARGET] * 200)}];",
    "lines": "".join(f"CONST robtarget p{n} := {TARGET};\n" for n in range(200)),
}


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """The expressions compiled, one after another."""
    nodes: list[object] = []
    compile_any = Expressions.any

    def noted(self: Expressions, node: Expression, wanted: Type | None = None) -> CompiledExpression:
        nodes.append(node)
        return compile_any(self, node, wanted)

    monkeypatch.setattr(Expressions, "any", noted)
    return nodes


class Later:
    """Work in the background that is done when the test says so."""

    def __init__(self) -> None:
        self.works: list[tuple[Callable[[], Any], Future[Any]]] = []

    def __call__(self, work: Callable[[], Any]) -> Future[Any]:
        future: Future[Any] = Future()
        self.works.append((work, future))
        return future

    def do(self) -> None:
        while self.works:
            work, future = self.works.pop(0)
            try:
                future.set_result(work())
            except RapidError as error:
                future.set_exception(error)


def test_module_is_loaded_in_the_background_while_the_program_and_its_traps_go_on() -> None:
    """The controller parses, links and compiles it; Load waits for it, as it waits for a disk."""
    program = 'CONNECT i WITH trapped; ISignalDI di1,HIGH,i; Load "late.mod"; TPWrite "loaded"; WaitTime 10;'
    bench = Bench(program, f"{TRAPPED} VAR intnum i;")
    bench.host.files["late.mod"] = "MODULE late VAR num x := 5; ENDMODULE"
    bench.task.background = later = Later()
    bench.start()
    bench.set("di1", 1.0)
    bench.run(1.0)
    assert (bench.lines, bench.task.is_running) == (["trapped"], True)
    later.do()
    bench.run(0.02)
    assert (bench.lines, bench.task.read("late", "x")) == (["trapped", "loaded"], "5")


def test_routine_is_compiled_in_the_background_while_its_call_waits() -> None:
    bench = Bench('p; TPWrite "done"; WaitTime 10;', "PROC p() x := 1; ENDPROC VAR num x;")
    bench.start()
    bench.task.program.codes = {r: code for r, code in bench.task.program.codes.items() if r.name != "p"}
    bench.task.stop()
    bench.task.background = later = Later()
    bench.task.move_pp_to_main()
    assert later.works == []  # the whole program is compiled by now
    bench.task.program.codes = {r: code for r, code in bench.task.program.codes.items() if r.name != "p"}
    bench.task.start()
    bench.run(0.1)
    assert (bench.read("x"), len(later.works)) == ("0", 1)
    later.do()
    bench.run(0.01)
    assert (bench.read("x"), bench.lines) == ("1", ["done", "done"])


def test_program_that_was_compiled_beforehand_is_compiled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, compiled = Bench("x := 1;", "VAR num x;"), []
    bench.task.compile()
    monkeypatch.setattr(compiler, "compile_routine", lambda *arguments: compiled.append(arguments))
    bench.start()
    assert (compiled, bench.read("x")) == ([], "1")


def test_program_that_does_not_fit_is_refused_at_pp_to_main_whether_it_was_compiled_beforehand_or_not() -> None:
    bench = Bench('y := "";', "VAR num y;")
    bench.task.compile()
    with pytest.raises(RapidReferenceError, match="a string is found where a num is needed"):
        bench.task.move_pp_to_main()


@pytest.mark.parametrize("text", TARGETS.values(), ids=TARGETS)
def test_module_that_was_prepared_is_loaded_without_delay(text: str, compiled: list[object]) -> None:
    bench, module = started("WaitTime 10;"), f"MODULE targets {text} ENDMODULE"
    bench.task.prepare(parse_module(module, "targets.mod"))
    assert len(compiled) > 200
    compiled.clear()
    bench.task.load(module, "targets.mod")
    assert compiled == []
    assert bench.task.symbols("targets")


def test_module_is_linked_anew_when_the_program_changed_since_it_was_prepared() -> None:
    bench, module = started("WaitTime 10;"), "MODULE late VAR num x := N; ENDMODULE"
    bench.task.load("MODULE other CONST num N := 1; ENDMODULE", "other.mod")
    bench.task.prepare(parse_module(module, "late.mod"))
    bench.task.load("MODULE other CONST num N := 2; ENDMODULE", "other.mod", replace=True)
    bench.task.load(module, "late.mod")
    assert bench.task.read("late", "x") == "2"


def test_module_that_was_prepared_before_pp_to_main_has_its_data_afterwards() -> None:
    bench, module = Bench("WaitTime 10;"), "MODULE late VAR num x := 3; ENDMODULE"
    bench.task.prepare(parse_module(module, "late.mod"))
    bench.start()
    bench.task.load(module, "late.mod")
    assert bench.task.read("late", "x") == "3"


def test_load_begins_anew_when_the_program_changes_while_it_waits() -> None:
    bench = Bench('Load "late.mod"; TPWrite "loaded"; WaitTime 10;')
    bench.host.files["late.mod"] = "MODULE late VAR num x := N; ENDMODULE"
    bench.task.load("MODULE other CONST num N := 1; ENDMODULE", "other.mod")
    bench.task.background = later = Later()
    bench.start()
    (work, future), later.works = later.works[0], []
    future.set_result(work())
    bench.task.load("MODULE other CONST num N := 2; ENDMODULE", "other.mod", replace=True)
    bench.run(0.01)
    assert bench.lines == []
    later.do()
    bench.run(0.01)
    assert (bench.lines, bench.task.read("late", "x")) == (["loaded"], "2")


def test_other_text_than_was_prepared_is_what_is_loaded() -> None:
    bench = started("WaitTime 10;")
    bench.task.prepare(parse_module("MODULE late VAR num x := 1; ENDMODULE", "late.mod"))
    bench.task.load("MODULE late VAR num x := 2; ENDMODULE", "late.mod")
    assert bench.task.read("late", "x") == "2"


PROGRAM = {
    "a.mod": "MODULE a PROC main() WaitTime 10; ENDPROC ENDMODULE",
    "b.mod": "MODULE b PROC q() p; ENDPROC ENDMODULE",
}


def test_program_takes_the_place_of_all_program_modules_at_once() -> None:
    bench = started("WaitTime 10;")
    bench.task.stop()
    bench.task.load("MODULE kept(SYSMODULE) PROC p() ENDPROC ENDMODULE", "kept.sys")
    bench.task.load_program(PROGRAM, replace=True)
    assert [each.name for each in bench.task.modules] == ["kept", "a", "b"]
    assert bench.task.call_stack == ()
    bench.task.move_pp_to_main()
    bench.task.load_program({"c.mod": "MODULE c ENDMODULE"}, replace=False)
    assert [each.name for each in bench.task.modules] == ["kept", "a", "b", "c"]
    assert bench.task.call_stack != ()


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("MODULE c PROC", RapidSyntaxError),
        ("MODULE c PROC main() ENDPROC ENDMODULE", RapidReferenceError),
        ("MODULE A ENDMODULE", ModuleNameTaken),
    ],
)
def test_program_of_which_a_module_does_not_fit_changes_nothing(text: str, error: type[RapidError]) -> None:
    bench = started("WaitTime 10;")
    bench.task.stop()
    before, stack = bench.task.modules, bench.task.call_stack
    with pytest.raises(error):
        bench.task.load_program({**PROGRAM, "c.mod": text}, replace=True)
    assert (bench.task.modules, bench.task.call_stack) == (before, stack)


def test_program_that_was_prepared_is_what_is_loaded_unless_another_one_came_between() -> None:
    bench = started("WaitTime 10;")
    bench.task.stop()
    kept = "MODULE kept(SYSMODULE) PROC p() ENDPROC ENDMODULE"
    bench.task.load(kept, "kept.sys")
    modules = [parse_module(text, path) for path, text in PROGRAM.items()]
    bench.task.prepare(*modules, replaces_program=True)
    prepared = bench.task._prepared
    bench.task.load(kept.replace("p()", "r()"), "kept.sys", replace=True)
    bench.task.load_program(PROGRAM, replace=True)
    assert prepared is not None
    assert bench.task.program is not prepared.program
    bench.task.prepare(*modules, replaces_program=True)
    prepared = bench.task._prepared
    bench.task.load_program(PROGRAM, replace=True)
    assert prepared is not None
    assert bench.task.program is prepared.program


def test_code_in_which_a_name_came_to_mean_something_else_is_compiled_anew() -> None:
    """A module's own datum hides what the library calls so; other routines keep their code."""
    bench = Bench(
        "WHILE TRUE DO p; n := n + 1; WaitDI di1,1; WaitDI di1,0; ENDWHILE",
        "PROC p() x := v100.v_tcp; ENDPROC VAR num x; VAR num n;",
    ).start()
    codes = {routine.name: code for routine, code in bench.task.program.codes.items()}
    bench.task.load("MODULE other CONST speeddata v100 := [7,7,7,7]; ENDMODULE", "other.mod")
    changed = {routine.name: code is not codes[routine.name] for routine, code in bench.task.program.codes.items()}
    assert changed == {"p": True, "main": False}
    bench.set("di1", 1.0)
    bench.set("di1", 0.0)
    assert bench.read("x") == "7"


def test_record_type_that_was_unknown_is_known_when_its_module_is_loaded() -> None:
    bench = Bench("", "RECORD big small part; ENDRECORD VAR big b;")
    with pytest.raises(UnknownSymbol, match="there is no data type 'small'"):
        bench.start().read("b")
    bench.task.stop()
    bench.task.load("MODULE other RECORD small num x; ENDRECORD ENDMODULE", "other.mod")
    assert bench.start().read("b") == "[[0]]"


def test_names_of_a_module_do_not_count_for_the_one_that_takes_its_place() -> None:
    bench = started("WaitTime 10;")
    bench.task.load("MODULE late CONST num N := 1; ENDMODULE", "late.mod")
    bench.task.load("MODULE late VAR num x := N; ENDMODULE", "late.mod", replace=True)
    with pytest.raises(UnknownSymbol, match="'N' is not declared"):
        bench.task.read("late", "x")


def test_calls_in_an_aggregate_are_searched_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """And not once for each item before them, which takes seconds."""
    nodes: list[object] = []
    runs_routine = Expressions.runs_routine
    monkeypatch.setattr(Expressions, "runs_routine", lambda self, n: nodes.append(n) or runs_routine(self, n))
    started(f"x := [{','.join(['y'] * 1500)}];", "VAR num x{1500}; VAR num y;")
    assert len(nodes) == 1500


def test_statement_that_is_very_long_is_refused() -> None:
    with pytest.raises(RapidReferenceError, match="M, line 5: a statement has up to 2000 names, numbers and operators"):
        started(f"x{{1}} := 1;\nx := [{','.join(['y'] * 2000)}];", "VAR num x{2000}; VAR num y;")


def test_late_calls_do_not_make_a_statement_longer() -> None:
    bench = started('FOR i FROM 1 TO 3000 DO %"p"% 1; ENDFOR TPWrite "done"; WaitTime 10;', "PROC p(num n) ENDPROC")
    bench.run(0.1)
    assert bench.lines == ["done"]


# Faults that RAPID has no error for


def broken_library() -> InstructionSet:
    library = InstructionSet()

    @library.instruction("Break")
    def broken(call: Call) -> None:
        raise KeyError("of ours")

    @library.instruction("BreakLater")
    def broken_later(call: Call) -> Iterator[None]:
        yield
        raise ValueError("of ours")

    return library


@pytest.mark.parametrize("instruction", ["Break", "BreakLater"])
def test_fault_of_ours_in_an_instruction_stops_the_task_and_is_logged_once(
    instruction: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR):
        bench = started(f'TPWrite "before";\n{instruction};', library=broken_library())
        bench.run(0.1)
    assert "system error, which is the virtual controller's" in bench.stop.sentence
    assert (bench.stop.kind, bench.stop.line, bench.lines) == (EventKind.ERROR, 5, ["before"])
    assert [record.exc_info is not None for record in caplog.records] == [True]
    assert not bench.task.is_running


def test_task_that_broke_begins_anew_at_main() -> None:
    bench = started("Break;", library=broken_library())
    bench.task.move_pp_to_main()
    assert evaluated("1+1") == "2"
    bench.task.start()
    bench.task.advance(0.004)
    assert len(bench.host.events) == 2


def test_endless_loop_costs_a_small_part_of_a_cycle_of_processor_time() -> None:
    """On the clock the controller uses; ten times what it allows is left to the machine."""
    bench = started(LOOP, "VAR num n;")
    bench.task.clock = time.thread_time
    longest = 0.0
    for _ in range(50):
        begin = time.thread_time()
        bench.task.advance(0.004)
        longest = max(longest, time.thread_time() - begin)
    assert longest < 10.0 * TIME_PER_ADVANCE
