"""The parser: text to tree, and errors that say where, what and what instead."""

import pytest

from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.parser import parse_expression, parse_module, parse_parameters, parse_reference
from virtual_irc5.rapid.types import RapidSyntaxError


def in_main(statements: str) -> tuple[s.Statement, ...]:
    return parse_module(f"MODULE M PROC main() {statements} ENDPROC ENDMODULE", "m.mod").routines[0].body


def refusal(text: str) -> str:
    with pytest.raises(RapidSyntaxError) as caught:
        parse_module(text, "m.mod")
    return str(caught.value)


def test_module_keeps_name_attributes_and_file() -> None:
    module = parse_module("MODULE Tools(SysModule, NOSTEPIN) ENDMODULE", "HOME:/tools.sys")
    assert (module.name, module.attributes, module.is_system) == ("Tools", {"SYSMODULE", "NOSTEPIN"}, True)
    assert module.filename == "HOME:/tools.sys"


def test_keywords_are_read_in_any_case() -> None:
    assert parse_module("Module m pRoC p() return; EndProc ENDMODULE", "m").routines[0].body == (s.Return(None),)


def test_name_may_begin_with_a_keyword() -> None:
    (call,) = in_main("IFfy;")
    assert isinstance(call, s.ProcedureCall)
    assert call.name == "IFfy"


def test_comments_and_file_headers_are_skipped() -> None:
    header = "%%%\n  VERSION:1\n  LANGUAGE:ENGLISH\n%%%\n"
    assert parse_module(header + '! a "comment"\nMODULE M ! and one more\nENDMODULE', "m").name == "M"


def test_data_know_storage_dimensions_and_line() -> None:
    module = parse_module("MODULE M\nTASK PERS num a{2,3}:=[[1,2,3],[4,5,6]];\nENDMODULE", "m")
    (datum,) = module.data
    assert (datum.storage, datum.is_task, datum.is_local, datum.line) == (s.Storage.PERS, True, False, 2)
    assert len(datum.dimensions) == 2


@pytest.mark.parametrize(
    ("text", "value"),
    [("1", 1), ("1.5", 1.5), (".5", 0.5), ("2.", 2), ("1E-05", 1e-5), ("9e+09", 9e9), ("0xFF", 255), ("0b101", 5)],
)
def test_number_is_read(text: str, value: float) -> None:
    assert parse_expression(text) == s.Literal(value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ('""', ""),
        ('"say ""hi"""', 'say "hi"'),
        (r'"a\\b"', "a\\b"),
        (r'"\5C\41"', "\\A"),
        ('"! no comment"', "! no comment"),
    ],
)
def test_string_is_read(text: str, value: str) -> None:
    assert parse_expression(text) == s.Literal(value)


def test_not_reaches_over_the_ands_behind_it() -> None:
    tree = parse_expression("NOT a AND b OR c")
    assert isinstance(tree, s.Binary)
    assert tree.operator == "OR"
    assert isinstance(tree.left, s.Unary)
    assert isinstance(tree.left.operand, s.Binary)


def test_not_behind_an_and_takes_its_own_operand_only() -> None:
    tree = parse_expression("a AND NOT b AND c")
    assert isinstance(tree, s.Binary)
    assert isinstance(tree.right, s.Name)


def test_reference_goes_through_elements_and_components() -> None:
    reference = parse_reference("frames{2}.trans.x")
    assert isinstance(reference, s.Field)
    assert isinstance(reference.base, s.Field)
    assert isinstance(reference.base.base, s.Element)


def test_parameters_that_exclude_each_other_share_a_group() -> None:
    parameters = parse_parameters(r"num a, \switch on | switch off, \num b")
    assert [p.group for p in parameters] == [None, 1, 1, 2]


def test_optional_parameter_needs_no_comma_before_it() -> None:
    assert [p.name for p in parse_parameters(r"VAR num x{*,*} \INOUT bool flag")] == ["x", "flag"]


def test_optional_arguments_need_no_comma() -> None:
    (call,) = in_main(r"Go id, Hold \J1 \J2 \Time:=1, \Off?off, last;")
    assert isinstance(call, s.ProcedureCall)
    assert [a.name for a in call.arguments] == [None, None, "J1", "J2", "Time", "Off", None]


def test_compact_if_is_an_if_with_one_statement() -> None:
    (statement,) = in_main("IF a = 1 GOTO done;")
    assert isinstance(statement, s.If)
    assert statement.branches[0][1] == (s.Goto("done"),)


def test_routine_has_backward_error_and_undo_clauses() -> None:
    text = "MODULE M PROC p() a; BACKWARD b; ERROR (ERR_A, 3) c; UNDO d; ENDPROC ENDMODULE"
    (routine,) = parse_module(text, "m").routines
    assert routine.handler is not None
    assert len(routine.handler.numbers) == 2
    assert (routine.backward, routine.undo) == ((s.ProcedureCall("b", ()),), (s.ProcedureCall("d", ()),))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "MODULE M\nPROC p()\n  x := 3\nENDPROC ENDMODULE",
            "m.mod:4:1: found 'ENDPROC' where an operator or ';' is allowed. Is a ';' missing after line 3?",
        ),
        (
            'MODULE M\nPROC p()\n  TPWrite "a"\n\n  ! a comment\n  WaitTime 1;\nENDPROC\nENDMODULE',
            "Is a ';' missing after line 3?",
        ),
        ("MODULE M\nVAR num a\nENDMODULE", "Is a ';' missing after line 2?"),
        ("MODULE M PROC p() x := ; ENDPROC ENDMODULE", "m.mod:1:24: found ';' where an expression is allowed."),
        ("MODULE M VAR num if; ENDMODULE", "m.mod:1:18: found 'if' where a name is allowed."),
        ('MODULE M VAR string a := "b;\nENDMODULE', "m.mod:1:26: the string does not end on its line."),
        (
            'MODULE M VAR string a := "C:\\temp"; ENDMODULE',
            r"m.mod:1:29: a backslash in a string is \\, or \ with the two hexadecimal digits of a character.",
        ),
        ("MODULE M VAR num §; ENDMODULE", "m.mod:1:18: RAPID has no sign '§'."),
        ("MODULE M(HIDDEN) ENDMODULE", "a module has no attribute 'HIDDEN'; there are NOSTEPIN,"),
        (f"MODULE {'m' * 33} ENDMODULE", "m.mod:1:8: a name has up to 32 characters"),
        (f'MODULE M CONST string a := "{"x" * 81}"; ENDMODULE', "a string has up to 80 characters, this one has 81."),
    ],
)
def test_wrong_text_is_refused_with_place_and_remedy(text: str, sentence: str) -> None:
    assert sentence in refusal(text)


@pytest.mark.parametrize("statement", ["x := 3 y;", "x := ;", "x := (3\n;"])
def test_semicolon_is_not_named_as_missing_where_the_line_goes_on(statement: str) -> None:
    assert "missing" not in refusal(f"MODULE M PROC p() {statement} ENDPROC ENDMODULE")


def test_unfinished_module_is_refused_at_its_end() -> None:
    assert refusal("MODULE M\nPROC p()\n").startswith("m.mod:2:9: found the end of the text where a statement,")


def test_end_of_file_that_dos_wrote_is_skipped() -> None:
    assert parse_module("MODULE M\r\nENDMODULE\r\n\x1a", "M.mod").name == "M"
