"""The instruction set: Python functions as RAPID instructions."""

import pytest
from rapid_bench import started

from virtual_irc5.rapid import Call, InstructionSet, RapidRuntimeError, Wait
from virtual_irc5.rapid.types import RapidReferenceError, RapidSyntaxError


class Identity:
    """What a datum of the type `ident` is."""

    number = 0


@pytest.fixture
def library() -> InstructionSet:
    return InstructionSet()


def test_instruction_receives_its_arguments_by_name(library: InstructionSet) -> None:
    seen = {}

    @library.instruction("Say", r"string Text, \num Times, \switch Loud | \switch Quiet")
    def say(call: Call) -> None:
        seen.update(
            text=call["text"], times=call.get("Times", 1.0), loud=call.present("Loud"), quiet=call.present("QUIET")
        )

    started('Say "hi" \\Quiet;', library=library)
    assert seen == {"text": "hi", "times": 1.0, "loud": False, "quiet": True}


def test_record_argument_has_components_as_attributes(library: InstructionSet) -> None:
    seen = []
    library.instruction("Go", "jointtarget Target")(lambda call: seen.append(call["Target"].extax.eax_a))
    started("Go [[1,2,3,4,5,6],[7,9E9,9E9,9E9,9E9,9E9]];", library=library)
    assert seen == [7.0]


def test_instruction_writes_to_its_var_arguments(library: InstructionSet) -> None:
    @library.instruction("Measure", "VAR num Value, INOUT bool Done")
    def measure(call: Call) -> None:
        call["Value"] = 4
        call["Done"] = True

    bench = started("Measure n{2}, done;", "VAR num n{2}; PERS bool done := FALSE;", library)
    assert (bench.read("n"), bench.read("done")) == ("[0,4]", "TRUE")


def test_function_gives_a_record(library: InstructionSet) -> None:
    library.function("Where", "", "pos")(lambda call: (1, 2, 3))
    assert started("n := Where();  p := Where(); n := p + n;", "VAR pos n; VAR pos p;", library).read("n") == "[2,4,6]"


def test_instruction_that_yields_goes_on_in_each_advance(library: InstructionSet) -> None:
    polls = []

    @library.instruction("Move", "num Polls")
    def move(call: Call) -> Wait:
        for poll in range(int(call["Polls"])):
            polls.append(poll)
            yield None

    bench = started('Move 3; TPWrite "there";', library=library)
    assert (polls, bench.lines) == ([0], [])
    bench.run(0.012)
    assert (polls, bench.lines) == ([0, 1, 2], ["there"])


def test_function_that_yields_gives_its_value_in_the_end(library: InstructionSet) -> None:
    @library.function("Asked", "", "num")
    def asked(call: Call) -> Wait:
        yield call.task.now + 0.1
        return 5

    bench = started("n := 1 + Asked();", "VAR num n;", library)
    assert bench.read("n") == "0"
    bench.task.advance(0.2)
    assert bench.read("n") == "6"


def test_error_of_an_instruction_reaches_the_handler(library: InstructionSet) -> None:
    library.error("ERR_JAMMED")

    @library.instruction("Grip")
    def grip(call: Call) -> Wait:
        yield None
        raise RapidRuntimeError("ERR_JAMMED", "The gripper is jammed.")

    bench = started('Grip; TPWrite "on"; ERROR IF ERRNO = ERR_JAMMED TRYNEXT;', library=library)
    bench.run(0.01)
    assert bench.lines == ["on"]


def test_error_that_was_never_registered_is_fatal(library: InstructionSet) -> None:
    def fail(call: Call) -> None:
        raise RapidRuntimeError("ERR_BROKEN", "The arm is broken.")

    library.instruction("Fail")(fail)
    bench = started("Fail; ERROR TRYNEXT;", library=library)
    assert bench.stop.sentence == "T_ROB_R stopped in M/main, line 4, with ERR_BROKEN: The arm is broken."


def test_instruction_is_closed_when_pp_is_moved(library: InstructionSet) -> None:
    closed = []

    @library.instruction("Hold")
    def hold(call: Call) -> Wait:
        try:
            while True:
                yield None
        finally:
            closed.append(call.name)

    bench = started("Hold;", library=library)
    bench.task.stop()
    assert closed == []
    bench.task.move_pp_to_main()
    assert closed == ["Hold"]


def test_object_type_gives_each_datum_its_own_object(library: InstructionSet) -> None:
    library.object_type("ident", Identity)
    library.instruction("Take", "VAR ident Id, num Number")(lambda call: setattr(call["Id"], "number", call["Number"]))
    library.function("NumberOf", "VAR ident Id", "num")(lambda call: call["Id"].number)
    bench = started("Take a, 1; Take b, 2; n := NumberOf(a);", "VAR ident a; VAR ident b; VAR num n;", library)
    assert bench.read("n") == "1"


def test_predefined_object_is_passed_to_a_var_parameter(library: InstructionSet) -> None:
    library.object_type("unit", Identity)
    library.data("ROB_ID", "unit", "the right arm")
    seen = []
    library.instruction("Use", "VAR unit Unit")(lambda call: seen.append(call["Unit"]))
    started("Use ROB_ID;", library=library)
    assert seen == ["the right arm"]


def test_record_type_and_data_extend_the_language(library: InstructionSet) -> None:
    library.record("egm_minmax", {"min": "num", "max": "num"})
    library.alias("egmstate", "num")
    library.data("EGM_BAND", "egm_minmax", (-0.5, 0.5))
    bench = started("b := EGM_BAND; b.max := 1; s := 2;", "VAR egm_minmax b; VAR egmstate s;", library)
    assert (bench.read("b"), bench.task.type_of("M", "s")) == ("[-0.5,1]", "egmstate")


def test_registered_name_hides_the_standard_one(library: InstructionSet) -> None:
    library.data("v100", "speeddata", (90, 500, 5000, 1000))
    assert started("n := v100.v_tcp;", "VAR num n;", library).read("n") == "90"


def test_libraries_do_not_disturb_each_other(library: InstructionSet) -> None:
    library.instruction("Mine")(lambda call: None)
    assert started("Mine;").stop.error == "ERR_REFUNKPRC"


def test_signature_with_unknown_type_is_refused(library: InstructionSet) -> None:
    with pytest.raises(RapidReferenceError, match="There is no type 'nothing'"):
        library.instruction("Odd", "nothing x")


def test_signature_that_is_no_parameter_list_is_refused(library: InstructionSet) -> None:
    with pytest.raises(RapidSyntaxError, match="found the end of the text where a name is allowed"):
        library.instruction("Odd", "num")


@pytest.mark.parametrize(
    "statement",
    [
        "WZFree p1\\Conc, 5;",
        "x := 1 + CSpeedOverride(5);",
        "IF CSpeedOverride(5) = 1 THEN RETURN; ENDIF",
        "IF x = 0 WZFree;",
        "p CSpeedOverride();",
    ],
)
def test_program_runs_up_to_an_instruction_that_is_not_provided(statement: str) -> None:
    program = f'TPWrite "before";\n{statement}\nTPWrite "never"; ERROR TRYNEXT;'
    bench = started(program, "VAR num x; PROC p(num n) ENDPROC")
    assert (bench.lines, bench.stop.error, bench.stop.line) == (["before"], "NOT_PROVIDED", 5)
    assert "is an instruction or function of RobotWare that is not provided here" in bench.stop.sentence
    assert [fault.line for fault in bench.task.faults()] == [5]


def test_branch_that_is_not_executed_may_use_what_is_not_provided() -> None:
    body = 'IF x = 1 THEN WZFree; ELSE TPWrite "else"; ENDIF GOTO end; WZFree; end: TPWrite "end";'
    assert started(body, "VAR num x;").lines == ["else", "end"]


def test_name_that_a_program_declares_is_provided() -> None:
    assert started("WZFree;", 'PROC WZFree() TPWrite "own"; ENDPROC').lines == ["own"]


def test_late_binding_of_what_is_not_provided_stops_there() -> None:
    assert started('%"WZFree"% x; ERROR TRYNEXT;', "VAR num x;").stop.error == "NOT_PROVIDED"


def test_names_of_robotware_are_known_without_regard_to_case() -> None:
    assert started("Confl \\Off; ERROR TRYNEXT;").stop.error == "NOT_PROVIDED"
    assert started("ConfM \\Off;").stop.error == "ERR_REFUNKPRC"


def test_number_that_grows_too_large_while_an_instruction_waits_is_an_error_of_the_program(
    library: InstructionSet,
) -> None:
    @library.instruction("Overflow", "")
    def overflow(call: Call) -> Wait:
        yield None
        raise OverflowError("math range error")

    bench = started("Overflow; ERROR n := 1; TRYNEXT;", "VAR num n;", library)
    bench.run(0.01)
    assert bench.read("n") == "1"
    bench = started("Overflow;", library=library)
    bench.run(0.01)
    assert bench.stop.error == "ERR_NUM_LIMIT"
