r"""RAPID's questions to the operator: what is shown, what an answer gives, and what ends them without one."""

from __future__ import annotations

import pytest
from rapid_bench import Bench, started

DATA = """
VAR num n; VAR dnum d; VAR btnres b; VAR string s; VAR errnum why; PERS bool given:=FALSE;
VAR string many{3}:=["red","","blue"]; CONST listitem items{3}:=[["","open"],["","close"],["","stop"]];
"""


def asked(body: str) -> Bench:
    bench = started(body, DATA)
    assert bench.host.devices.pendant.active is not None
    return bench


@pytest.mark.parametrize(
    ("body", "answer", "symbol", "value"),
    [
        ('TPReadFK n,"Go on?","Yes","No","","","Never"', "never", "n", "5"),
        ('TPReadFK n,"Go on?",stEmpty,"No","","","Never"', "2", "n", "2"),
        ('TPReadNum n,"How many?"', "2.5", "n", "2.5"),
        ('TPReadDnum d,"How many?"', "1234567890123", "d", "1234567890123"),
        (r'UIMsgBox \Header:="H","one"\MsgLine2:="two"\Buttons:=btnYesNo\Icon:=iconInfo\Result:=b', "No", "b", "7"),
        (r'UIMsgBox "one"\Buttons:=btnOK', "OK", "b", "0"),
        (r'b:=UIMessageBox(\Message:="Sure?"\Buttons:=btnOKCancel)', "Cancel", "b", "5"),
        (r"n:=UIMessageBox(\MsgArray:=many\BtnArray:=many\Icon:=iconWarning)", "blue", "n", "3"),
        (r'n:=UIListView(\Header:="Do",items)', "stop", "n", "3"),
        (r'n:=UIListView(\Result:=b\Header:="Do",items\Buttons:=btnOKCancel\Icon:=iconError)', "close", "b", "1"),
        (r"n:=UIListView(\Result:=b,items\Buttons:=btnOKCancel)", "close/cancel", "b", "5"),
        (r'n:=UINumEntry(\Header:="H"\Message:="m"\InitValue:=5\MinValue:=1\MaxValue:=9\AsInteger)', "9", "n", "9"),
        (r'd:=UIDnumEntry(\Message:="m"\MaxValue:=12345678901)', "12345678901", "d", "12345678901"),
        (r'n:=UINumTune(\Message:="m",5,0.5\MinValue:=1)', "5.5", "n", "5.5"),
        (r'd:=UIDnumTune(\Message:="m",5,1)', "6", "d", "6"),
        (r's:=UIAlphaEntry(\Message:="Name?"\InitString:="x")', "part 7", "s", '"part 7"'),
    ],
)
def test_answer_reaches_the_program(body: str, answer: str, symbol: str, value: str) -> None:
    bench = asked(f'{body}; TPWrite "on";')
    dialog = bench.host.devices.pendant.active
    assert dialog is not None
    dialog.give(answer)
    bench.run(0.01)
    assert (bench.lines, bench.read(symbol)) == (["on"], value if 'UIMsgBox "one"' not in body else "0")
    assert bench.host.devices.pendant.dialogs == {}


@pytest.mark.parametrize(
    ("body", "answer"),
    [
        ('TPReadFK n,"Go on?","Yes","No","","",""', "3"),
        ('TPReadNum n,"How many?"', "many"),
        (r"n:=UINumEntry(\MinValue:=1\MaxValue:=9)", "10"),
        (r"n:=UINumEntry(\AsInteger)", "1.5"),
        (r"n:=UINumEntry(\MinValue:=1)", "nan"),
        (r"s:=UIAlphaEntry()", "x" * 81),
        (r"n:=UIListView(items)", "jump"),
    ],
)
def test_what_is_no_answer_is_refused(body: str, answer: str) -> None:
    bench = asked(f"{body};")
    dialog = bench.host.devices.pendant.active
    assert dialog is not None
    with pytest.raises(ValueError, match=r"\."):
        dialog.give(answer)
    assert dialog.answer is None


@pytest.mark.parametrize(
    ("option", "error"),
    [
        (r"\MaxTime:=0.5", "ERR_TP_MAXTIME"),
        (r"\DIBreak:=di1", "ERR_TP_DIBREAK"),
        (r"\DOBreak:=do1", "ERR_TP_DOBREAK"),
        (r"\PersBoolBreak:=given", "ERR_TP_PERSBOOLBREAK"),
    ],
)
def test_question_ends_without_an_answer(option: str, error: str) -> None:
    handled = asked(rf"n:=UINumEntry(\InitValue:=3{option}\BreakFlag:=why); TPWrite ValToStr(why={error});")
    failed = asked(rf"n:=UINumEntry(\InitValue:=3{option});")
    for bench in (handled, failed):
        bench.run(0.4)
        assert bench.host.devices.pendant.active is not None
        bench.host.signals |= {"di1": 1.0, "do1": 1.0}
        bench.task.write("M", "given", "TRUE")
        bench.run(0.2)
        assert bench.host.devices.pendant.active is None
    assert (handled.lines, handled.read("n"), failed.stop.error) == (["TRUE"], "3", error)


@pytest.mark.parametrize(
    ("body", "error"),
    [
        (r"n:=UINumEntry(\MinValue:=9\MaxValue:=1)", "ERR_UI_MAXMIN"),
        (r"n:=UINumEntry(\InitValue:=0\MinValue:=1)", "ERR_UI_INITVALUE"),
        (r"n:=UINumEntry(\InitValue:=1.5\AsInteger)", "ERR_UI_NOTINT"),
        (r"b:=UIMessageBox(\Buttons:=99)", "ERR_UI_BUTTONS"),
        ('TPReadFK n,"Go on?","","","","",""', "ERR_ARGVALERR"),
    ],
)
def test_question_that_makes_no_sense_is_an_error(body: str, error: str) -> None:
    assert started(f"{body};", DATA).stop.error == error


def test_nobody_is_asked_without_a_flexpendant() -> None:
    bench = Bench('IF NOT UIClientExist() TPWrite "nobody"; TPReadNum n,"?";', DATA)
    bench.host.devices.pendant.is_connected = False
    assert (bench.start().lines, bench.stop.error) == (["nobody"], "ERR_TP_NO_CLIENT")


def test_message_stays_until_it_is_taken_away() -> None:
    bench = started(r'UIMsgWrite \Header:="H","busy"; WaitTime 1; UIMsgWriteAbort; WaitTime 1;', DATA)
    assert bench.host.devices.pendant.messages == {"T_ROB_R": ("H", "busy")}
    bench.run(1.1)
    assert bench.host.devices.pendant.messages == {}


def test_message_box_without_buttons_does_not_wait() -> None:
    bench = started(r'UIMsgBox "busy"\Buttons:=btnNone; TPWrite "on";', DATA)
    assert (bench.lines, bench.host.devices.pendant.messages["T_ROB_R"]) == (["on"], ("", "busy"))


def test_question_of_a_program_that_is_left_is_withdrawn() -> None:
    bench = asked('TPReadNum n,"How many?";')
    bench.task.stop()
    assert bench.host.devices.pendant.active is not None
    bench.task.move_pp_to_main()
    assert bench.host.devices.pendant.active is None
