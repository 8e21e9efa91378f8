"""`yumi rapid check`: what is found in programs, and where."""

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

import abb_protocols.controller_files
from virtual_irc5.commands.check import check_program
from yumi.cli.main import main

PROGRAM = """MODULE Faulty
  VAR nothing odd;
  PROC main()
    VAR num x;
    x := "text";
    helper x;
    IF x > THEN
    ENDIF
  ENDPROC
  PROC helper(num n)
    missing n;
    SoftElbow n;
  ENDPROC
  FUNC num broken(num n)
    RETURN n +;
  ENDFUNC
  TRAP fine
    TPWrite "" \\Num:=broken(1;
  ENDTRAP
ENDMODULE
"""


@pytest.fixture
def faulty(tmp_path: Path) -> Path:
    path = tmp_path / "faulty.mod"
    path.write_text(PROGRAM)
    return path


def test_all_kinds_of_faults_are_found_with_their_places(faulty: Path) -> None:
    found = [(fault.line, fault.column, fault.kind) for fault in check_program([faulty])]
    assert found == [
        (2, 15, "unknown"),
        (7, 12, "syntax"),
        (11, 5, "unknown"),
        (12, 5, "missing"),
        (15, 15, "syntax"),
        (18, 30, "syntax"),
    ]


def test_command_prints_a_line_for_each_and_fails(faulty: Path) -> None:
    result = CliRunner().invoke(main, ["rapid", "check", str(faulty)])
    assert result.exit_code == 1
    assert f"{faulty}:7:12: syntax: found 'THEN' where an expression is allowed." in result.output.splitlines()


def test_use_of_a_datum_that_does_not_fit_says_why(tmp_path: Path) -> None:
    path = tmp_path / "a.mod"
    path.write_text("MODULE A PERS num a{3}:=[1,2]; PROC main() a{1}:=2; ENDPROC ENDMODULE")
    assert [fault.sentence for fault in check_program([path])] == [
        "an aggregate of 2 is found where a num{3} is needed.",
        "'a' cannot be used: an aggregate of 2 is found where a num{3} is needed.",
    ]


def test_editors_get_json(faulty: Path) -> None:
    found = json.loads(CliRunner().invoke(main, ["rapid", "check", "--json", str(faulty)]).output)
    assert found[0] == {
        "file": str(faulty),
        "line": 2,
        "column": 15,
        "kind": "unknown",
        "sentence": "there is no data type 'nothing'.",
    }


def test_modules_are_one_program_and_signals_come_from_a_cfg(tmp_path: Path) -> None:
    (tmp_path / "a.mod").write_text("MODULE A PROC main() Set doLamp; other; ENDPROC ENDMODULE")
    (tmp_path / "b.mod").write_text("MODULE B PROC other() ENDPROC ENDMODULE")
    (tmp_path / "c.mod").write_text("MODULE C PROC Main() ENDPROC ENDMODULE")
    (tmp_path / "EIO.cfg").write_text('EIO:CFG_1.0:6:1::\nEIO_SIGNAL:\n-Name "doLamp" -SignalType "DO"\n')
    files = [tmp_path / name for name in ("a.mod", "b.mod", "c.mod")]
    faults = check_program(files, [tmp_path / "EIO.cfg"])
    assert [(fault.file[-5:], fault.line, fault.kind, fault.sentence) for fault in faults] == [
        ("c.mod", 1, "reference", "'Main' is global in the module 'A', too: make one of them LOCAL.")
    ]


def test_our_own_program_has_no_faults() -> None:
    folder = Path(next(iter(abb_protocols.controller_files.__path__)))
    assert check_program(sorted([*folder.glob("*.mod"), *folder.glob("*.sys")])) == []


@pytest.mark.parametrize(("robot", "count"), [("yumi", 3), ("irb120", 0), ("irb14050", 0)])
def test_names_are_those_of_the_robot_a_program_is_for(tmp_path: Path, robot: str, count: int) -> None:
    """A program of a robot with one arm names ROB_1 and its task; a YuMi has neither, nor the inputs of that robot."""
    path = tmp_path / "one.mod"
    path.write_text(
        "MODULE One VAR egmident id; PROC main() VAR jointtarget j; j:=CJointT(\\TaskRef:=T_ROB1Id); EGMGetId id; "
        'EGMSetupUC ROB_1,id,"default","UCdevice"\\Joint; j.robax.rax_1:=GetMotorTorque(\\MecUnit:=ROB_1,1); '
        "WaitDI custom_DI_0,1; ENDPROC ENDMODULE"
    )
    faults = check_program([path], robot=robot)
    assert [fault.kind for fault in faults] == ["unknown"] * count
    result = CliRunner().invoke(main, ["rapid", "check", "--model", robot, str(path)])
    assert result.exit_code == (1 if count else 0)


def test_registers_are_known_and_a_module_user_takes_the_place_of_the_delivered_one(tmp_path: Path) -> None:
    program, user = tmp_path / "a.mod", tmp_path / "user.sys"
    program.write_text("MODULE A PROC main() reg1 := 1; ClkReset clock1; ENDPROC ENDMODULE")
    user.write_text("MODULE user(SYSMODULE) VAR num reg1; ENDMODULE")
    assert check_program([program]) == []
    assert [fault.sentence for fault in check_program([program, user])] == [
        "'clock1' is not declared, and no signal has that name."
    ]


ROOT = Path(__file__).parents[3]


def test_problem_matcher_of_the_documentation_takes_the_lines_apart(faulty: Path) -> None:
    page = (ROOT / "docs/how-to/run-your-own-rapid.md").read_text(encoding="utf-8")
    tasks = json.loads(page.partition("```json\n")[2].partition("```")[0])
    pattern = tasks["tasks"][0]["problemMatcher"]["pattern"]
    output = CliRunner().invoke(main, ["rapid", "check", str(faulty)]).output
    found = [match for line in output.splitlines() if (match := re.match(pattern["regexp"], line))]
    names = ("file", "line", "column", "code", "message")
    taken = [[match[pattern[name]] for name in names] for match in found]
    given = [
        [each.file, str(each.line), str(each.column), each.kind, each.sentence] for each in check_program([faulty])
    ]
    assert taken == given


def test_program_of_the_tutorial_is_the_one_of_the_examples() -> None:
    page = (ROOT / "docs/tutorials/first-rapid-program.md").read_text(encoding="utf-8")
    shown = page.partition("```rapid\n")[2].partition("```")[0]
    assert shown == (ROOT / "examples/rapid/Hello.mod").read_text(encoding="utf-8")
