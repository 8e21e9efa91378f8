"""The task: modules, program pointer, stop and start, symbols from outside."""

import pytest
from rapid_bench import Bench, started

from abb_protocols.errors import RobotNotReady
from virtual_irc5.rapid.states import EventKind, Execution
from virtual_irc5.rapid.types import RapidReferenceError, RapidValueError, UnknownSymbol

DATA = """
LOCAL RECORD OwnSettings
    bool allow;
    num gain;
ENDRECORD
LOCAL VAR OwnSettings settings := [TRUE,0.5];
CONST num LIMIT := 2 * HALF;
CONST num HALF := 4;
PERS string note := "kept";
VAR num grid{2,2};
VAR errnum ERR_OWN := -1;
VAR clock watch;
"""


@pytest.fixture
def bench() -> Bench:
    return Bench('note := "changed"; settings.gain := 7; WaitTime 10;', DATA)


def test_modules_are_listed_with_their_files(bench: Bench) -> None:
    assert bench.task.load("MODULE Sys(SYSMODULE) ENDMODULE", "HOME:/sys.sys") == "Sys"
    modules = [(each.name, each.is_system, each.filename) for each in bench.task.modules]
    assert modules == [("M", False, "M.mod"), ("Sys", True, "HOME:/sys.sys")]


def test_module_name_can_be_taken_once(bench: Bench) -> None:
    with pytest.raises(RapidReferenceError, match="the task T_ROB_R already has a module 'm'"):
        bench.task.load("MODULE m ENDMODULE", "again.mod")


def test_module_is_unloaded_by_name(bench: Bench) -> None:
    bench.task.unload("m")
    assert bench.task.modules == ()
    with pytest.raises(UnknownSymbol, match="has no module 'm'; it has none"):
        bench.task.unload("m")


def test_execution_goes_from_uninitialized_to_finished(bench: Bench) -> None:
    states = [bench.task.execution]
    for step in (bench.task.move_pp_to_main, bench.task.start, bench.task.stop, bench.task.start):
        step()
        states.append(bench.task.execution)
    bench.task.advance(11.0)
    bench.task.advance(11.0)
    assert [state.value for state in states] == ["unin", "read", "star", "stop", "star"]
    assert (bench.task.execution, bench.stop.kind) == (Execution.READY, EventKind.FINISHED)


def test_start_needs_a_program_pointer(bench: Bench) -> None:
    with pytest.raises(RobotNotReady, match="move PP to main before the start"):
        bench.task.start()


def test_pp_cannot_be_moved_while_the_task_runs(bench: Bench) -> None:
    bench.start()
    with pytest.raises(RobotNotReady, match="stop it before PP is moved to main"):
        bench.task.move_pp_to_main()


def test_pp_needs_a_main() -> None:
    bench = Bench()
    bench.task.unload("M")
    with pytest.raises(RapidReferenceError, match=r"No module of the task T_ROB_R has a procedure main\(\)"):
        bench.task.move_pp_to_main()


def test_pp_to_main_renews_variables_and_keeps_persistents(bench: Bench) -> None:
    bench.start()
    assert (bench.read("settings"), bench.read("note")) == ("[TRUE,7]", '"changed"')
    bench.task.stop()
    bench.task.move_pp_to_main()
    assert (bench.read("settings"), bench.read("note")) == ("[TRUE,0.5]", '"changed"')


def test_stopped_task_keeps_its_place_and_time_passes_by() -> None:
    bench = started('WaitTime 0.1; TPWrite "over";')
    bench.task.stop()
    bench.run(1.0)
    assert bench.lines == []
    bench.task.start()
    bench.run(0.01)
    assert bench.lines == ["over"]


def test_finished_program_starts_again_at_main() -> None:
    bench = started("Incr n;", "VAR num n;")
    bench.task.start()
    bench.task.advance(0.004)
    assert bench.read("n") == "2"


def test_symbols_are_read_with_type_and_kind_local_ones_too(bench: Bench) -> None:
    rows = [
        (bench.read(n), bench.task.type_of("m", n), bench.task.kind_of("M", n)) for n in ("SETTINGS", "limit", "note")
    ]
    assert rows == [("[TRUE,0.5]", "OwnSettings", "var"), ("8", "num", "con"), ('"kept"', "string", "per")]


def test_array_and_alias_are_described(bench: Bench) -> None:
    assert (bench.read("grid"), bench.task.type_of("M", "grid")) == ("[[0,0],[0,0]]", "num")
    assert (bench.task.dimensions_of("M", "grid"), bench.task.dimensions_of("M", "note")) == ((2, 2), ())
    assert bench.task.type_of("M", "ERR_OWN") == "errnum"
    assert bench.task.symbols("M")[:3] == ("settings", "LIMIT", "HALF")


def test_symbol_is_written_as_a_literal(bench: Bench) -> None:
    bench.task.write("M", "settings", "[false, 1e-05]")
    assert bench.read("settings") == "[FALSE,1E-05]"


@pytest.mark.parametrize(
    ("symbol", "literal", "sentence"),
    [
        ("settings", "[TRUE]", "is not a value of type OwnSettings"),
        ("settings", "[TRUE,FALSE]", "A num is expected."),
        ("LIMIT", "1", "'LIMIT' is a constant and cannot be written."),
        ("watch", "1", "The type clock has no values"),
    ],
)
def test_literal_that_does_not_fit_changes_nothing(bench: Bench, symbol: str, literal: str, sentence: str) -> None:
    with pytest.raises(RapidValueError) as caught:
        bench.task.write("M", symbol, literal)
    assert sentence in str(caught.value)
    assert bench.read("settings") == "[TRUE,0.5]"


def test_array_element_is_read_and_written(bench: Bench) -> None:
    bench.task.write("M", "grid{2,1}", "5")
    assert (bench.read("grid{2,1}"), bench.read("grid")) == ("5", "[[0,0],[5,0]]")


@pytest.mark.parametrize(
    ("symbol", "sentence"),
    [
        ("grid{3,1}", "The index 3 is outside of the array, which has 1 to 2."),
        ("grid{1}", "a num{2,2} has no 1-dimensional elements"),
        ("grid{", "found the end of the text where an expression is allowed."),
        ("note{1}", "a string has no 1-dimensional elements"),
    ],
)
def test_array_element_that_does_not_exist_is_unknown(bench: Bench, symbol: str, sentence: str) -> None:
    with pytest.raises(UnknownSymbol) as caught:
        bench.read(symbol)
    assert sentence in str(caught.value)


def test_unknown_modules_and_symbols_have_sentences_of_their_own(bench: Bench) -> None:
    with pytest.raises(UnknownSymbol, match="The task T_ROB_R has no module 'N'; it has M"):
        bench.task.read("N", "x")
    with pytest.raises(UnknownSymbol, match="The module 'M' has no datum 'main'"):
        bench.task.read("M", "main")


def test_module_loaded_while_the_program_runs_has_its_data(bench: Bench) -> None:
    bench.start()
    bench.task.load("MODULE Late VAR num x := 3; ENDMODULE", "late.mod")
    assert bench.task.read("Late", "x") == "3"
