"""RAPID's display, clocks and modules; interrupts have a file of their own."""

import pytest
from rapid_bench import Bench, error_of, started

from virtual_irc5.rapid.states import Severity

EXTRA = 'MODULE Extra\nPROC extra() TPWrite "extra"; ENDPROC\nENDMODULE'


FLAGS = "PERS bool bad:=FALSE; PERS bool good:=FALSE; PERS num n:=0; PERS num index:=1; VAR num list{2}:=[1,2];"


def test_condition_that_fails_stops_the_program_once_and_other_flags_follow_theirs() -> None:
    bench = started(
        "SetupCyclicBool bad,list{index}>1; SetupCyclicBool good,n>1; WHILE TRUE DO WaitTime 1; ENDWHILE", FLAGS
    )
    bench.run(0.1)
    bench.task.write("M", "index", "3")
    bench.run(0.1)
    assert not bench.task.is_running
    assert [event.error for event in bench.host.events] == ["ERR_OUTOFBND"]
    bench.task.write("M", "n", "5")
    bench.task.write("M", "index", "2")
    bench.task.start()
    bench.run(0.1)
    assert (bench.read("good"), bench.read("bad"), bench.task.is_running) == ("TRUE", "TRUE", True)
    bench.task.write("M", "index", "0")
    bench.run(0.1)
    assert len(bench.host.events) == 2


def test_flag_that_is_set_up_again_and_again_is_computed_by_one_timer() -> None:
    bench = started(
        "FOR i FROM 1 TO 1100 DO RemoveAllCyclicBool; SetupCyclicBool good,n>1; WaitTime 0.001; ENDFOR "
        "n:=2; WaitTime 0.02; TPWrite ValToStr(good);",
        FLAGS,
    )
    bench.run(1.5)
    assert bench.lines == ["TRUE"], bench.stop.sentence


def test_program_knows_whether_its_pointer_was_moved_before_the_start() -> None:
    asked = "TPWrite ValToStr(IsStopStateEvent(\\PPMoved))+ValToStr(IsStopStateEvent(\\PPToMain));"
    bench = started(f"{asked} Stop; {asked}", f"PROC other() {asked} ENDPROC")
    bench.task.start()
    bench.run(0.1)
    bench.task.move_pp_to_routine("other")
    bench.task.start()
    bench.run(0.1)
    assert bench.lines == ["TRUETRUE", "FALSEFALSE", "TRUEFALSE"]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ('"text"', "text"),
        ('"n: "\\Num:=1.141367', "n: 1.14137"),
        ('""\\Bool:=FALSE', "FALSE"),
        ('""\\Pos:=[1,2.5,3]', "[1,2.5,3]"),
        ('""\\Orient:=[1,0,0,0]', "[1,0,0,0]"),
        ('""\\Dnum:=NumToDnum(3)', "3"),
    ],
)
def test_text_is_written_with_a_value(arguments: str, line: str) -> None:
    assert started(f"TPErase; TPWrite {arguments};").lines == [line]


@pytest.mark.parametrize(
    ("switch", "severity"),
    [("", Severity.ERROR), ("\\W, ", Severity.WARNING), ("\\I, ", Severity.INFORMATION)],
)
def test_event_is_written_with_its_reason(switch: str, severity: Severity) -> None:
    bench = started(f'ErrWrite {switch}"Gripper", "not calibrated"\\RL2:="jog it";')
    assert bench.lines == ["Gripper: not calibrated: jog it"]
    assert bench.host.log == [("Gripper", "not calibrated: jog it", severity)]


def test_clock_counts_while_it_runs() -> None:
    body = "ClkReset c; ClkStart c; WaitTime 0.5; ClkStop c; WaitTime 0.5; n := ClkRead(c);"
    bench = started(body, "VAR clock c; VAR num n;")
    bench.run(1.2)
    assert bench.read("n") == "0.5"


def test_clock_goes_on_from_where_it_was_stopped() -> None:
    body = "ClkStart c; WaitTime 0.5; ClkStop c; ClkStart c; WaitTime 0.25; n := ClkRead(c);"
    bench = started(body, "VAR clock c; VAR num n;")
    bench.run(1.0)
    assert bench.read("n") == "0.75"


def test_operating_mode_comes_from_the_host() -> None:
    bench = Bench("n := OpMode();", "VAR num n;")
    bench.task.operating_mode = lambda: 2
    assert bench.start().read("n") == "2"


def test_module_is_loaded_called_and_unloaded_by_the_program() -> None:
    bench = Bench('Load "HOME:/extra.mod"; %"extra"%; UnLoad "HOME:/extra.mod"; WaitTime 1;')
    bench.host.files["HOME:/extra.mod"] = EXTRA
    bench.start()
    assert (bench.lines, [m.name for m in bench.task.modules]) == (["extra"], ["M"])


def test_module_path_may_be_given_in_two_parts() -> None:
    bench = Bench('Load \\Dynamic, "HOME:" \\File:="extra.mod"; %"extra"%;')
    bench.host.files["HOME:/extra.mod"] = EXTRA
    assert bench.start().lines == ["extra"]


@pytest.mark.parametrize(
    ("text", "name"),
    [(None, "ERR_FILNOTFND"), ("MODULE", "ERR_SYNTAX"), ("MODULE M ENDMODULE", "ERR_LOADED")],
)
def test_module_that_cannot_be_loaded_is_an_error(text: str | None, name: str) -> None:
    bench = Bench('Load "HOME:/extra.mod";')
    if text is not None:
        bench.host.files["HOME:/extra.mod"] = text
    assert bench.start().stop.error == name


def test_module_that_was_not_loaded_cannot_be_unloaded() -> None:
    assert error_of('UnLoad "HOME:/extra.mod";') == "ERR_UNLOAD"


def test_module_cannot_unload_itself() -> None:
    bench = started('UnLoad "M.mod";')
    assert bench.stop.error == "ERR_UNLOAD"
    assert "The module 'M' is executing" in bench.stop.sentence


def test_task_has_ten_files_open_at_most() -> None:
    body = r'FOR i FROM 1 TO 12 DO Open "HOME:/f"+ValToStr(i), f{i}\Write; n := i; ENDFOR'
    bench = started(body, "VAR iodev f{12}; VAR num n;")
    assert (bench.stop.error, bench.read("n")) == ("ERR_FILEOPEN", "10")
    assert "10 files open already" in bench.stop.sentence


def test_file_that_is_closed_leaves_room_for_another() -> None:
    body = r'FOR i FROM 1 TO 30 DO Open "HOME:/f", f\Write; Close f; n := i; ENDFOR'
    bench = started(body, "VAR iodev f; VAR num n;")
    assert (bench.stop.error, bench.read("n")) == ("", "30")
